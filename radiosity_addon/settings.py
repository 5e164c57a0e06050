"""The settings of a bake as they are kept in each scene, in the same words as `solver.Settings`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from ..solver.errors import SettingsError
from ..solver.settings import MAX_RESOLUTION, PRESETS, Settings

ADVICE = "save it, choose an output folder (--output), or pack the images"


def _preset_chosen(self: Any, _context: Any) -> None:
    if self.preset in PRESETS:
        self.error = PRESETS[self.preset]


def _live_switched(self: Any, context: Any) -> None:
    from .live_relight import switched

    switched(self, context)


class RADIOSITY_PG_settings(bpy.types.PropertyGroup):
    """What to bake, and how well."""

    target: EnumProperty(  # type: ignore[valid-type]
        name="Target", description="Where the light is stored", default="lightmap",
        items=[("lightmap", "Lightmap", "Images, laid out by a UV map"),
               ("vertex", "Vertex Colors", "A color attribute on the corners of each mesh")])
    preset: EnumProperty(  # type: ignore[valid-type]
        name="Quality", description="Sets the wanted error", default="medium", update=_preset_chosen,
        items=[(name, name.capitalize(), f"Error of {error:.1%}") for name, error in PRESETS.items()])
    error: FloatProperty(  # type: ignore[valid-type]
        name="Error", description="Wanted relative error of the baked light (0.03 is 3 %)", default=PRESETS["medium"],
        min=1e-4, max=1.0, soft_min=0.001, soft_max=0.2, precision=4, step=0.1)
    uv_layer: StringProperty(  # type: ignore[valid-type]
        name="UV Map", description="An existing UV map to use as it is; empty makes UVMap_Lightmap")
    resolution: IntProperty(  # type: ignore[valid-type]
        name="Resolution", description="Pixels a side of each image; 0 sizes images by density", default=0, min=0,
        max=MAX_RESOLUTION)
    texel_density: FloatProperty(  # type: ignore[valid-type]
        name="Texel Density", description="Pixels per meter, as Blender shows lengths; 0 fills the pages",
        default=0.0, min=0.0, max=1e6)
    max_pages: IntProperty(  # type: ignore[valid-type]
        name="Max Pages", description="Most images of a shared atlas", default=1, min=1, max=1024)
    atlas: EnumProperty(  # type: ignore[valid-type]
        name="Atlas", description="How objects share images", default="auto",
        items=[("auto", "Automatic", "Shared pages; one image an object with a UV map of your own"),
               ("shared", "Shared", "Objects share pages"), ("object", "Object", "One image an object")])
    quantity: EnumProperty(  # type: ignore[valid-type]
        name="Quantity", description="What a pixel says", default="radiance",
        items=[("radiance", "Radiance", "Irradiance over pi, as Cycles' diffuse bake without color"),
               ("irradiance", "Irradiance", "W/m2"), ("illuminance", "Illuminance", "lux, at 683 lm/W"),
               ("radiosity", "Radiosity", "Light that leaves the surface, W/m2")])
    passes: EnumProperty(  # type: ignore[valid-type]
        name="Passes", description="Which light is baked", default="both",
        items=[("both", "Direct and Indirect", ""), ("direct", "Direct", ""), ("indirect", "Indirect", "")])
    only_selected: BoolProperty(  # type: ignore[valid-type]
        name="Selected Only", default=False,
        description="Bake the selected objects; others still block, reflect and emit (the command line has --only)")
    footprint: FloatProperty(  # type: ignore[valid-type]
        name="Footprint", description="Part of a texel, each way, that its value is the mean of (0.5 as in Cycles)",
        default=0.5, min=0.0, max=1.0)
    margin: IntProperty(  # type: ignore[valid-type]
        name="Margin", description="Pixels that light is spread beyond the edges of UV islands", default=16, min=0,
        max=256)
    seed: IntProperty(  # type: ignore[valid-type]
        name="Seed", description="The same seed gives the same result", default=0, min=0)
    watch: BoolProperty(  # type: ignore[valid-type]
        name="Show While Baking", default=True,
        description="Draw the light over the viewport while it is baked, coarse at first; a bake takes somewhat longer")
    keep_draft: BoolProperty(  # type: ignore[valid-type]
        name="Esc Keeps Draft", default=False,
        description="Esc ends a bake with the last draft that was shown; off, it leaves everything as it was")
    threads: IntProperty(  # type: ignore[valid-type]
        name="Threads", description="0 uses all cores", default=0, min=0, max=1024)
    groups: EnumProperty(  # type: ignore[valid-type]
        name="Keep Groups", default="none",
        description="Keep the light of lamps apart, so that they can be changed without another bake; emissive "
                    "materials and the world are groups of their own",
        items=[("none", "None", "Keep nothing: the bake is quicker and leaves less on disk"),
               ("lamp", "By Lamp", "A group for each lamp: power and color of every one can be changed"),
               ("collection", "By Collection", "Lamps of a collection are changed together"),
               ("all", "All Lamps", "All lamps are changed together")])
    reflectances: BoolProperty(  # type: ignore[valid-type]
        name="Follow Base Colors", default=False,
        description="Keep what Update Light needs to follow other base colors and textures too: half a kilobyte a "
                    "pixel on disk, up to 512 MB and what goes with them")
    live_relight: BoolProperty(  # type: ignore[valid-type]
        name="Live", default=False, update=_live_switched,
        description="Update the images by themselves, a moment after a light was changed")
    group_layers: BoolProperty(  # type: ignore[valid-type]
        name="Group Layers", default=False,
        description="Write the groups as layers of an EXR file beside each image; they add up to it")
    output: StringProperty(  # type: ignore[valid-type]
        name="Output", description="Folder of the images and the report", subtype="DIR_PATH", default="//lightmaps")
    pack: BoolProperty(  # type: ignore[valid-type]
        name="Pack Images", default=False,
        description="Keep the images in the .blend and write no files; else they are linked to EXR files")
    apply_modifiers: BoolProperty(  # type: ignore[valid-type]
        name="Apply Modifiers", default=False,
        description="Apply the modifiers of objects whose mesh could not hold the result otherwise")


CLASSES = (RADIOSITY_PG_settings,)


def attach() -> None:
    """Give every scene its settings."""
    bpy.types.Scene.radiosity = PointerProperty(type=RADIOSITY_PG_settings)


def detach() -> None:
    """Take them away again."""
    del bpy.types.Scene.radiosity


def words_of(scene: Any) -> dict[str, Any]:
    """The scene's settings as arguments of `Settings`; what is empty or 0 is left to its default."""
    kept = scene.radiosity
    words = {name: getattr(kept, name) for name in (
        "target", "error", "max_pages", "quantity", "passes", "footprint", "margin", "seed", "threads")}
    # A float property holds .03 as .029999999: as many digits as it has, and no more.
    words.update({name: float(f"{words[name]:.6g}") for name in ("error", "footprint")})
    optional = {"uv_layer": kept.uv_layer, "resolution": kept.resolution,
                "texel_density": float(f"{kept.texel_density:.6g}"),
                "atlas": kept.atlas if kept.atlas != "auto" else ""}
    return {**words, **{name: value for name, value in optional.items() if value}}


def settings_of(scene: Any, changes: dict[str, Any], only: Iterable[str] = ()) -> Settings:
    """The scene's settings with some words changed.

    Raises
    ------
    SettingsError
        On a value that makes no sense, or a change that would be without effect.
    """
    words = words_of(scene)
    for one, other in (("resolution", "texel_density"), ("texel_density", "resolution")):
        if one in changes and other not in changes:
            words.pop(other, None)
    settings = Settings(**{"only": tuple(only), **words, **changes})
    if "uv_layer" in changes and settings.target == "vertex":
        raise SettingsError(f"--uv-layer {settings.uv_layer!r} is given, and vertex colours need no UV map: leave it "
                            "away, or bake with --target lightmap")
    return settings


def groups_of(scene: Any, given: dict[str, Any]) -> str:
    """Which lights a bake keeps apart; options that are given go before the scene's settings.

    Raises
    ------
    SettingsError
        If something is given that is of use with groups alone, and there are none.
    """
    groups: str = given.get("groups", scene.radiosity.groups)
    idle = [word for word in ("reflectances", "group_layers") if given.get(word)]
    # A relight has those of the bake.
    if idle and groups == "none" and given["command"] != "relight":
        raise SettingsError(f"--{idle[0].replace('_', '-')} is given, and no light groups are kept: add --groups lamp, "
                            "or leave it away")
    return groups
