"""What a lightmap's numbers mean.

    radiance      L = E / pi            W / (m2 sr)   what a white diffuse surface would send back; Cycles' DIFFUSE
                                                      bake without COLOR
    irradiance    E                     W / m2
    illuminance   E_v = K (w . E)       lx            luminous efficacy K = 683 lm/W of the definition of the lumen
                                                      (at 555 nm) on the Rec. 709 luminance weights w
    radiosity     B = rho E             W / m2        what the surface itself sends back
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# Luminous efficacy of the definition of the candela, lm / W (BIPM, SI brochure).
LUMINOUS_EFFICACY = 683.0
# Luminance of linear Rec. 709 primaries (ITU-R BT.709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
UNITS = {"radiance": "W/(m2 sr)", "irradiance": "W/m2", "illuminance": "lx", "radiosity": "W/m2"}


def encode(irradiance: Float, quantity: str, reflectance: Float) -> Float:
    """Irradiance (n, 3) in W/m2 as the wanted quantity (n, 3) float32; `reflectance` (n, 3) is the surfaces' own."""
    if quantity == "radiance":
        return np.asarray(irradiance / np.float32(np.pi), np.float32)
    if quantity == "illuminance":
        lux = np.float32(LUMINOUS_EFFICACY) * (irradiance @ LUMINANCE)
        return np.repeat(lux[:, None], 3, axis=1)
    if quantity == "radiosity":
        return irradiance * reflectance
    return irradiance
