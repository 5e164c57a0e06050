"""What a lightmap's numbers mean.

    radiance      L = E / pi            W / (m2 sr)   what a white diffuse surface would send back; Cycles' DIFFUSE
                                                      bake without COLOR
    irradiance    E                     W / m2
    illuminance   E_v = K (w . E)       lux = lm / m2 luminous efficacy K = 683 lm/W of the definition of the lumen
                                                      (at 555 nm) on the Rec. 709 luminance weights w
    radiosity     B = rho E             W / m2        what the surface itself sends back

A photometric quantity is K times the luminance of the radiometric one (`photometric`, `TABLE`). Why K is 683 and what
others there are: docs/units.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .errors import SettingsError
from .settings import Settings

Float = NDArray[np.floating[Any]]

# Luminous efficacy of the definition of the candela, lm / W (BIPM, SI brochure).
LUMINOUS_EFFICACY = 683.0
# Luminance of linear Rec. 709 primaries (ITU-R BT.709).
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
UNITS = {"radiance": "W/(m2 sr)", "irradiance": "W/m2", "illuminance": "lux", "radiosity": "W/m2"}
# Before the names of the attributes of an image file.
PREFIX = "radiosity:"


class Pair(NamedTuple):
    """A radiometric quantity and its unit, the photometric one beside it, its unit, and that unit in lumens."""

    radiometric: str
    unit: str
    photometric: str
    photometric_unit: str
    in_lumens: str


# By symbol.
TABLE = {
    "Phi": Pair("radiant flux", "W", "luminous flux", "lumen", "lm"),
    "E": Pair("irradiance", "W/m2", "illuminance", "lux", "lm/m2"),
    "B": Pair("radiosity", "W/m2", "luminous exitance", "lux", "lm/m2"),
    "I": Pair("radiant intensity", "W/sr", "luminous intensity", "candela", "lm/sr"),
    "L": Pair("radiance", "W/(m2 sr)", "luminance", "nit", "lm/(m2 sr)"),
}


def encode(irradiance: Float, quantity: str, reflectance: Float) -> Float:
    """Irradiance (n, 3) in W/m2 as the wanted quantity (n, 3) float32; `reflectance` (n, 3) is the surfaces' own."""
    if quantity == "radiance":
        return np.asarray(irradiance / np.float32(np.pi), np.float32)
    if quantity == "illuminance":
        return np.repeat(photometric(irradiance)[:, None], 3, axis=1)
    if quantity == "radiosity":
        return irradiance * reflectance
    return irradiance


def photometric(radiometric: Float, luminous_efficacy: float = LUMINOUS_EFFICACY) -> Float:
    """Flux, irradiance, radiosity, intensity or radiance (..., 3) as lumen, lux, candela or nit (...): K (w . x).

    Parameters
    ----------
    radiometric : red, green, blue in linear Rec. 709, W and its kin.
    luminous_efficacy : K of white light of 1 W, lm / W.

    Raises
    ------
    SettingsError
        If K is not from above 0 to 683, the most that light of any spectrum has.
    """
    if not 0 < luminous_efficacy <= LUMINOUS_EFFICACY:
        raise SettingsError(f"luminous_efficacy is {luminous_efficacy!r}: use lm/W above 0, up to 683")
    return np.asarray(np.float32(luminous_efficacy) * (radiometric @ LUMINANCE))


def watts(lumens: float, luminous_efficacy: float = LUMINOUS_EFFICACY) -> float:
    """The power of a white lamp of that many lumens, so that its light comes out as many lumens again: W."""
    return float(lumens / photometric(np.ones(3), luminous_efficacy))


def header(settings: Settings, report: Mapping[str, Any] | None = None) -> dict[str, str | float]:
    """What an image file says of its numbers, as attributes `radiosity:...`: text and numbers.

    quantity, unit : what a pixel is; linear, no exposure, no view transform, Rec. 709 primaries.
    passes, seed : as in the settings; the seed as text, for attributes hold 32-bit floats.
    wantedError, error : relative RMS, wanted and as the report's audit found it; errorHigh is the interval's end.
    luminousEfficacy : of illuminance alone, lm/W.
    whiteLuminance : OpenEXR's own, of radiance alone: what (1, 1, 1) is in cd/m2.
    """
    attributes: dict[str, str | float] = {
        "quantity": settings.quantity, "unit": UNITS[settings.quantity], "passes": settings.passes,
        "seed": str(settings.seed), "wantedError": settings.error}
    estimated = report["error"]["estimated"] if report is not None else {}
    for name, key in (("error", "rms"), ("errorHigh", "rms_high")):
        if math.isfinite(estimated.get(key, math.nan)):
            attributes[name] = float(estimated[key])
    if settings.quantity == "illuminance":
        attributes["luminousEfficacy"] = LUMINOUS_EFFICACY
    named = {PREFIX + name: value for name, value in attributes.items()}
    if settings.quantity == "radiance":
        named["whiteLuminance"] = LUMINOUS_EFFICACY
    return named
