"""Kept light groups on disk: beside the images, or in the user's own folder where there are none.

One folder a Blender scene, `NAME.radiosity`:

    groups.json    what the light depends on, the groups, what was baked
    layers_N.npy   (groups, height, width, 3) half floats of image N; for vertex colours (groups, triangles, 3, 3)
    layout.npz     UV maps and corners, with which images can be put on meshes anew
    paths_*.npy    what other reflectances need (see `solver.paths`), where they are to be followed
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.errors import OutputError
from ..solver.groups import GroupLight
from ..solver.mixing import Layer
from ..solver.paths import Paths
from ..solver.result import Bake, Lightmap
from ..solver.scene import Surface
from ..solver.settings import Settings
from .binding import Binding
from .converted import Converted
from .digest import digest
from .light_groups import Group, Member
from .names import file_stem
from .survey import Survey

Float = NDArray[np.floating[Any]]
# Layers of all groups, of one page or object.
Stack = tuple[Layer, ...]

SUFFIX = ".radiosity"
ABOUT, LAYOUT, LAYERS, PATHS = "groups.json", "layout.npz", "layers_{}.npy", "paths_{}.npy"
# Arrays of more bytes are left on disk until they are used.
LARGE = 2**20
# What the report of a relight has from that of the bake.
TOLD = ("version", "error", "lumels", "triangles", "patches", "cells", "solver")
# Changes with what the files hold: older ones are as good as none.
FORMAT = "radiosity light groups 7"


@dataclass(frozen=True, eq=False)
class Kept:
    """A bake whose groups were kept.

    seen : the scene when it was baked.
    groups : in the order of the layers.
    settings : of the bake.
    surfaces, bindings : of the exported scene, in the same order.
    bake : the bake without pixels: its pages' and objects' arrays are empty. Its groups' layers are `mixing.Layer`.
    converted : what was converted to meshes after it, by surface.
    """

    folder: Path
    seen: Survey
    groups: tuple[Group, ...]
    settings: Settings
    surfaces: tuple[Surface, ...]
    bindings: tuple[Binding, ...]
    bake: Bake
    converted: dict[str, Converted]


def places(output: Path | None, scene_name: str) -> list[Path]:
    """Where the groups of a scene may be kept: in the output folder, if there is one, and in the user's folder."""
    name = file_stem(scene_name) + SUFFIX
    own = user_folder() / (digest(bpy.data.filepath) if bpy.data.filepath else f"unsaved-{os.getpid()}") / name
    return [own] if output is None else [output / name, own]


def find(output: Path | None, scene_name: str) -> Path:
    """The first place that holds groups, or the first."""
    found = places(output, scene_name)
    return next((folder for folder in found if is_kept(folder)), found[0])


def user_folder() -> Path:
    """The extension's own folder; of an add-on that is no extension, one under Blender's user data."""
    package = __package__.rpartition(".")[0]
    if package.startswith("bl_ext."):
        return Path(bpy.utils.extension_path_user(package, path="groups"))
    return Path(bpy.utils.user_resource("DATAFILES", path="radiosity_lightmaps"))


def stage(folder: Path, bake: Bake, groups: Sequence[Group], seen: Survey, settings: Settings,
          surfaces: Sequence[Surface], bindings: Sequence[Binding], materials: Sequence[dict[str, Any]]) -> Path:
    """Write a bake's groups into a folder beside `folder`, and return it.

    Raises
    ------
    OutputError
        If they can't be written.
    """
    beside = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    shutil.rmtree(beside, ignore_errors=True)
    try:
        beside.mkdir(parents=True)
        scales = _write_layers(beside, bake, groups)
        _write_layout(beside, bake, surfaces)
        for name, array in (bake.paths.as_arrays() if bake.paths is not None else {}).items():
            np.save(beside / PATHS.format(name), array)
        about = {
            "format": FORMAT, "seen": seen.as_dict(), "groups": [asdict(group) for group in groups],
            "settings": {**settings.as_dict(), "atlas": settings.atlas}, "bindings": [asdict(one) for one in bindings],
            "surfaces": [{"name": one.name, "count": one.count, "receives": one.receives} for one in surfaces],
            "pages": [{"name": page.name, "surfaces": page.surfaces} for page in bake.lightmaps], "scales": scales,
            "report": {**{word: bake.report[word] for word in TOLD}, "materials": list(materials)},
        }
        (beside / ABOUT).write_text(json.dumps(about), encoding="utf-8")
    except OSError as cause:
        shutil.rmtree(beside, ignore_errors=True)
        raise _unwritten(folder, cause) from cause
    return beside


def place(staged: Path, folder: Path, converted: Mapping[str, Converted]) -> None:
    """Put staged groups into their folder, in place of what was kept there.

    converted : what was converted to meshes since they were staged, by surface.

    Raises
    ------
    OutputError
        If that can't be done, or if the folder holds something else.
    """
    try:
        if converted:
            about = json.loads((staged / ABOUT).read_text(encoding="utf-8"))
            about["converted"] = {surface: asdict(made) for surface, made in converted.items()}
            (staged / ABOUT).write_text(json.dumps(about), encoding="utf-8")
        clear(folder)
        os.replace(staged, folder)
    except OSError as cause:
        raise _unwritten(folder, cause) from cause


def _unwritten(folder: Path, cause: OSError) -> OutputError:
    reason = (cause.strerror or type(cause).__name__).lower()
    return OutputError(f"light groups can't be kept in {folder} ({reason}): check its rights and free space, or bake "
                       "without groups")


def read(folder: Path) -> Kept:
    """What is kept; its layers are read from disk when they are mixed.

    Raises
    ------
    OutputError
        If nothing is kept there, or not by this version, or its files are damaged.
    """
    try:
        about = json.loads((folder / ABOUT).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise OutputError(f"no light groups are kept in {folder}: bake with --groups lamp first") from None
    except (OSError, ValueError) as cause:
        raise _damaged(folder, cause) from cause
    if about.get("format") != FORMAT:
        raise OutputError(f"the light groups in {folder} were kept by another version: bake again")
    try:
        return _kept(folder, about)
    except (OSError, ValueError, KeyError, TypeError, IndexError) as cause:
        raise _damaged(folder, cause) from cause


def is_kept(folder: Path) -> bool:
    """Whether groups are kept there."""
    return os.path.isfile(folder / ABOUT)


def follows_colours(folder: Path) -> bool:
    """Whether what other reflectances need is kept there."""
    return os.path.isfile(folder / PATHS.format("shape"))


def size(folder: Path) -> int:
    """Bytes on disk."""
    return sum(path.stat().st_size for path in _files(folder))


def clear(folder: Path) -> int:
    """Remove kept groups; how many bytes that were. Files that are not ours stay, and their folder with them."""
    freed = size(folder)
    for path in _files(folder):
        path.unlink()
    with contextlib.suppress(OSError):
        folder.rmdir()
    return freed


def _files(folder: Path) -> list[Path]:
    if not is_kept(folder):
        return []
    # What says that they are ours goes last.
    return [*folder.glob(LAYERS.format("*")), *folder.glob(PATHS.format("*")), *folder.glob(LAYOUT), folder / ABOUT]


def _damaged(folder: Path, cause: Exception) -> OutputError:
    return OutputError(f"the light groups in {folder} can't be read ({str(cause) or type(cause).__name__}): bake again")


def _write_layers(folder: Path, bake: Bake, groups: Sequence[Group]) -> list[list[float]]:
    """One file a page; the layers' scales, by page and group."""
    columns = [bake.groups.layers[group.name] for group in groups]
    if bake.corner_colours is not None:
        columns = [(np.concatenate([part for part in column if part is not None]),) for column in columns]
    scales = []
    for number, parts in enumerate(zip(*columns, strict=True)):
        layers = [Layer.of(part) for part in parts]
        np.save(folder / LAYERS.format(number), np.stack([layer.bits for layer in layers]))
        scales.append([layer.scale for layer in layers])
    return scales


def _write_layout(folder: Path, bake: Bake, surfaces: Sequence[Surface]) -> None:
    corners = [one.corner_ids if one.corner_ids is not None else np.arange(3 * one.count).reshape(-1, 3)
               for one in surfaces]
    uv = [np.zeros((one.count, 3, 2), np.float32) if layout is None else layout
          for one, layout in zip(surfaces, bake.uv, strict=True)]
    coloured = bake.corner_colours if bake.corner_colours is not None else (None,) * len(surfaces)
    np.savez(folder / LAYOUT, page_of_surface=bake.page_of_surface, corners=np.concatenate(corners).astype(np.int32),
             uv=np.concatenate(uv), laid_out=np.array([layout is not None for layout in bake.uv]),
             coloured=np.array([colours is not None for colours in coloured]))


def _kept(folder: Path, about: dict[str, Any]) -> Kept:
    with np.load(folder / LAYOUT) as layout:
        arrays = dict(layout.items())
    surfaces: list[Surface] = []
    for entry in about["surfaces"]:
        first = surfaces[-1].first + surfaces[-1].count if surfaces else 0
        surfaces.append(Surface(entry["name"], first, entry["count"], receives=entry["receives"],
                                corner_ids=arrays["corners"][first:first + entry["count"]]))
    nothing = np.empty((0, 0, 3), np.float32)
    coloured = arrays["coloured"]
    stacks: list[Stack | None] = [_stack(folder / LAYERS.format(number), scales)
                                  for number, scales in enumerate(about["scales"])]
    if coloured.any() and stacks[0] is not None:
        stacks = _by_surface(stacks[0], surfaces, coloured)
    names = [entry["name"] for entry in about["groups"]]
    layers = {name: tuple(None if stack is None else stack[number] for stack in stacks)
              for number, name in enumerate(names)}
    bake = Bake(tuple(Lightmap(page["name"], nothing, tuple(page["surfaces"])) for page in about["pages"]),
                tuple(arrays["uv"][surface.triangles] if there else None
                      for surface, there in zip(surfaces, arrays["laid_out"], strict=True)), arrays["page_of_surface"],
                tuple(nothing if there else None for there in coloured) if coloured.any() else None,
                about["report"], GroupLight(layers, {name: np.ones(3, np.float32) for name in names}),
                paths=_paths(folder))
    groups = tuple(Group(entry["name"], tuple(_member(one) for one in entry["members"]), tuple(entry["tint"]))
                   for entry in about["groups"])
    settings = Settings(**{**about["settings"], "only": tuple(about["settings"]["only"])})
    bindings = tuple(Binding(**entry) for entry in about["bindings"])
    converted = {surface: Converted(**made) for surface, made in about.get("converted", {}).items()}
    return Kept(folder, Survey.of_dict(about["seen"]), groups, settings, tuple(surfaces), bindings, bake, converted)


def _stack(path: Path, scales: Sequence[float]) -> Stack:
    bits = np.load(path, mmap_mode="r")
    if len(bits) != len(scales) or bits.dtype != np.int16:
        raise ValueError(f"{path.name} does not fit the groups")
    return tuple(Layer(layer, scale) for layer, scale in zip(bits, scales, strict=True))


def _by_surface(stack: Stack, surfaces: Sequence[Surface], coloured: NDArray[np.bool_]) -> list[Stack | None]:
    """The layers of all corners, object by object; None for one that has none."""
    parts: list[Stack | None] = []
    first = 0
    for surface, there in zip(surfaces, coloured, strict=True):
        last = first + surface.count * int(there)
        parts.append(tuple(Layer(layer.bits[first:last], layer.scale) for layer in stack) if there else None)
        first = last
    return parts


def _paths(folder: Path) -> Paths | None:
    """What other reflectances need, if it was kept; large arrays are read from disk when they are used."""
    if not follows_colours(folder):
        return None
    files = {path.stem.removeprefix("paths_"): path for path in folder.glob(PATHS.format("*"))}
    return Paths.of_arrays({name: np.load(path, mmap_mode="r" if path.stat().st_size > LARGE else None)
                            for name, path in files.items()})


def _member(entry: dict[str, Any]) -> Member:
    red, green, blue = entry["reference"]
    return Member(entry["kind"], entry["name"], entry["part"], (red, green, blue))
