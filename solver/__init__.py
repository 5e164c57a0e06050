"""Radiosity: form factors F_ij, the system B = E + rho F B, and lightmaps. NumPy and Embree, no Blender.

Start with `bake.py`: it lists the steps of the whole way of the light.
"""

from .bake import bake, irradiance, solve
from .brdf import Blinn, Lambert, Phong
from .brdf_integrals import diffuse_equivalent
from .errors import (
    Cancelled,
    NothingToBake,
    OutputError,
    RadiosityError,
    SceneError,
    SettingsError,
    UnwrapError,
)
from .form_factor import Estimate, element_form_factor, form_factor
from .groups import LightGroup
from .lights import Light
from .merl import read_merl
from .relight import relight
from .result import Bake, Lightmap, Solution
from .scene import Scene, Sky, Surface, Texture
from .settings import Settings

__all__ = [
    "Bake", "Blinn", "Cancelled", "Estimate", "Lambert", "Light", "LightGroup", "Lightmap", "NothingToBake",
    "OutputError", "Phong", "RadiosityError", "Scene", "SceneError", "Settings", "SettingsError", "Sky",
    "Solution", "Surface", "Texture", "UnwrapError", "bake", "diffuse_equivalent", "element_form_factor",
    "form_factor", "irradiance", "read_merl", "relight", "solve",
]
