"""What a bake keeps so that other reflectances need no ray: where the bounced light of every receiver came from.

    cells    which patch each belongs to, what it reflected, and the direct light of every light group on it
    rows     form factors of the patches, as ray hits
    looks    the first rays of every receiver, twice: the cells that they met, and where they went on

Rays know nothing of reflectance, so the light that they bring can be worked out for any (see `recolour`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING
from .mixing import Layer
from .rows import Rows
from .scene import Scene

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# What two scenes must share, beside textures, so that rays do the same in both.
SHAPE = ("vertices", "triangles", "corner_normals", "casts_shadow", "seen", "opacity")


@dataclass(frozen=True, eq=False)
class Level:
    """Rays that went on from what rays of the level before had met.

    parent : (k,) int32, which ray of that level each continues; in order.
    cell : (k,) int32, what it met; NOTHING for the sky.
    factor : for how many rays each stands.
    sky : (j, 3) float32, irradiance that each that met the sky stands for, W/m2; without the sky's tint.
    """

    parent: NDArray[np.int32]
    cell: NDArray[np.int32]
    factor: float
    sky: Float


@dataclass(frozen=True, eq=False)
class KeptLook:
    """The first rays of n receivers.

    hits : (n, rays) int32 cells; NOTHING for the sky, and where no light can arrive.
    levels : of the rays that went on; ray k of receiver i is number i * rays + k.
    """

    hits: NDArray[np.int32]
    levels: tuple[Level, ...]


@dataclass(frozen=True, eq=False)
class Paths:
    """Where bounced light came from.

    shape : a sum of all of the scene that rays depend on.
    cell_size : of the cells, metres (see `Cells`).
    side, patch : (c,) int64 and int32, side and patch of each cell.
    reflectance : (c, 3) uint16, as `recolour.reflectance_of` gives.
    incident : of each light group direct irradiance of the cells (c, 3), W/m2, without its tint.
    glowing, glow, glow_group : (k,) int32 cells that emit what no lamp stands for, (k, 3) float32 W/m2 without tint,
        and (k,) int32 the group that it belongs to.
    sky_group : the group of the sky, -1 for none.
    patches : how many there are.
    rows : of the patches; the sky in them is without its tint.
    looks : two, with independent random shifts.
    """

    shape: str
    cell_size: float
    side: NDArray[np.int64]
    patch: NDArray[np.int32]
    reflectance: NDArray[np.uint16]
    incident: tuple[Layer, ...]
    glowing: NDArray[np.int32]
    glow: Float
    glow_group: NDArray[np.int32]
    sky_group: int
    patches: int
    rows: tuple[Rows, ...]
    looks: tuple[KeptLook, ...]

    @property
    def rays(self) -> int:
        """Kept rays of a receiver."""
        return sum(look.hits.shape[1] for look in self.looks)

    def as_arrays(self) -> dict[str, NDArray[Any]]:
        """All of it as arrays by name, to be put on disk."""
        out: dict[str, NDArray[Any]] = {
            "about": np.array([self.cell_size, self.sky_group, self.patches]), "shape": np.array(self.shape),
            "side": self.side, "patch": self.patch, "reflectance": self.reflectance, "glowing": self.glowing,
            "glow": self.glow, "glow_group": self.glow_group,
            "incident": np.stack([layer.bits for layer in self.incident]),
            "incident_scale": np.array([layer.scale for layer in self.incident])}
        for number, rows in enumerate(self.rows):
            out |= {f"rows_{number}_patch": rows.patch, f"rows_{number}_hits": rows.hits,
                    f"rows_{number}_sky": rows.mean_sky()}
        for number, look in enumerate(self.looks):
            out[f"look_{number}_hits"] = look.hits
            for depth, level in enumerate(look.levels):
                out |= {f"look_{number}_{depth}_{name}": np.asarray(getattr(level, name))
                        for name in ("parent", "cell", "factor", "sky")}
        return out

    @classmethod
    def of_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Paths:
        """From what `as_arrays` gave.

        Raises
        ------
        KeyError
            If an array is missing.
        """
        cell_size, sky_group, patches = arrays["about"]
        incident = tuple(Layer(bits, float(scale))
                         for bits, scale in zip(arrays["incident"], arrays["incident_scale"], strict=True))
        rows: list[Rows] = []
        while f"rows_{len(rows)}_patch" in arrays:
            patch, hits, sky = (arrays[f"rows_{len(rows)}_{name}"] for name in ("patch", "hits", "sky"))
            rows.append(light_rows(patch, hits, sky))
        looks: list[KeptLook] = []
        while f"look_{len(looks)}_hits" in arrays:
            looks.append(_look_of(arrays, f"look_{len(looks)}_"))
        return cls(str(arrays["shape"]), float(cell_size), arrays["side"], arrays["patch"], arrays["reflectance"],
                   incident, arrays["glowing"], arrays["glow"], arrays["glow_group"], int(sky_group), int(patches),
                   tuple(rows), tuple(looks))


def light_rows(patch: NDArray[np.int32], hits: NDArray[np.int32], mean_sky: Float) -> Rows:
    """Rows that can be solved and not refined: without the eighths, and with the sky's mean (p, 3) alone."""
    return Rows(patch, hits, np.empty((len(patch), 0), np.uint8), mean_sky[:, None])


def shape_of(scene: Scene) -> str:
    """A sum of all of a scene that rays depend on."""
    state = hashlib.blake2b(digest_size=16)
    parts = [getattr(scene, name) for name in SHAPE]
    holed = np.flatnonzero(np.asarray(scene.opacity_texture) >= 0)
    if len(holed) and scene.uv is not None:
        # By what is in them: the numbers of textures change with the colours of others.
        number, first, place = np.unique(np.asarray(scene.opacity_texture)[holed], return_index=True,
                                         return_inverse=True)
        parts += [holed, first[place], scene.uv[holed], *(scene.textures[texture].pixels for texture in number)]
    for part in parts:
        state.update(b";" if part is None else np.ascontiguousarray(part).tobytes())
    return state.hexdigest()


def sky_hits(cell: Int) -> Int:
    """Which rays met the sky."""
    return np.flatnonzero(cell == NOTHING)


def _look_of(arrays: Mapping[str, NDArray[Any]], name: str) -> KeptLook:
    levels: list[Level] = []
    while f"{name}{len(levels)}_parent" in arrays:
        parent, cell, factor, sky = (arrays[f"{name}{len(levels)}_{part}"]
                                     for part in ("parent", "cell", "factor", "sky"))
        levels.append(Level(parent, cell, float(factor), sky))
    return KeptLook(arrays[f"{name}hits"], tuple(levels))
