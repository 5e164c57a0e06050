"""Measured BRDFs in MERL's binary format: isotropic tables over half and difference angles.

A file holds three int32 numbers 90, 90, 180 and then, for red, green and blue one after the other, that many float64
values. Rows run over theta_h, then theta_d, then phi_d (fastest). Bins of theta_h are spaced by its square root, so
that a gloss gets many; phi_d ends at 180 degrees, for reciprocity gives the other half. A stored number times the
channel's scale is the BRDF, 1 / sr; a negative one was not measured.

Reference: Matusik, Pfister, Brand and McMillan 2003 (data and format); Rusinkiewicz 1998 (the angles).
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .brdf import half_vector
from .errors import SceneError

Float = NDArray[np.floating[Any]]
Index = NDArray[np.intp]

SHAPE = (90, 90, 180)
# Red, green, blue: what the stored numbers are multiplied by.
SCALE = np.array([1.0, 1.15, 1.66]) / 1500
HEADER_BYTES = 12


@dataclass(frozen=True, eq=False)
class Measured:
    """A measured BRDF; between the measured angles it has its bin's value, as the data's authors read it.

    Parameters
    ----------
    table : (90, 90, 180, 3) float32 over theta_h, theta_d, phi_d; 1 / sr, 0 where nothing was measured.
    measured : part of the bins that hold a measurement, 0 ... 1.
    name : for messages.
    """

    table: Float
    measured: float
    name: str

    def __call__(self, incoming: Float, outgoing: Float) -> Float:
        """Evaluate, see `brdf.Brdf`."""
        above = (incoming[..., 2] > 0) & (outgoing[..., 2] > 0)
        return np.asarray(self.table[bins(*half_difference(incoming, outgoing))] * above[..., None], np.float64)


def read_merl(path: str | os.PathLike[str]) -> Measured:
    """Read a file of MERL's format.

    Raises
    ------
    SceneError
        If it can't be read, has other dimensions or another length, or holds a value that is not finite.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as cause:
        raise SceneError(f"{path} can't be read ({cause.strerror}): check the name") from cause
    shape = tuple(np.frombuffer(data[:HEADER_BYTES], "<i4").tolist()) if len(data) >= HEADER_BYTES else ()
    if shape != SHAPE:
        raise SceneError(f"{path} is no MERL table of 90 x 90 x 180 (it begins with {shape}): give an isotropic one")
    wanted = 3 * int(np.prod(SHAPE))
    if len(data) != HEADER_BYTES + 8 * wanted:
        raise SceneError(f"{path} has {len(data)} bytes, not {HEADER_BYTES + 8 * wanted}: get it again")
    stored = np.frombuffer(data, "<f8", offset=HEADER_BYTES).reshape(3, *SHAPE)
    if not np.isfinite(stored).all():
        raise SceneError(f"{path} holds a value that is not finite: get it again")
    table = np.ascontiguousarray(np.moveaxis(np.maximum(stored, 0), 0, -1) * SCALE, np.float32)
    table.flags.writeable = False
    return Measured(table, float((stored >= 0).all(axis=0).mean()), path.name)


def half_difference(incoming: Float, outgoing: Float) -> tuple[Float, Float, Float]:
    """Rusinkiewicz's angles theta_h, theta_d, phi_d of two directions (..., 3), radians; phi_d in [0, pi).

    The difference vector is i turned by -phi_h about the normal and then by -theta_h about y, so that the half vector
    stands on z. Exchanged directions have phi_d + pi: they share a bin.
    """
    half = half_vector(incoming, outgoing)
    across = np.hypot(half[..., 0], half[..., 1])
    # At theta_h = 0 any azimuth is phi_h; 0 is taken.
    cos_phi = np.divide(half[..., 0], across, out=np.ones_like(across), where=across > 0)
    sin_phi = np.divide(half[..., 1], across, out=np.zeros_like(across), where=across > 0)
    x = cos_phi * incoming[..., 0] + sin_phi * incoming[..., 1]
    y = cos_phi * incoming[..., 1] - sin_phi * incoming[..., 0]
    turned_x = half[..., 2] * x - across * incoming[..., 2]
    turned_z = across * x + half[..., 2] * incoming[..., 2]
    phi = np.arctan2(y, turned_x) % np.pi
    return np.arctan2(across, half[..., 2]), np.arctan2(np.hypot(turned_x, y), turned_z), phi


def bins(theta_h: Float, theta_d: Float, phi_d: Float) -> tuple[Index, Index, Index]:
    """The table's indices of three angles in radians."""
    parts = (np.sqrt(np.maximum(theta_h, 0) / (np.pi / 2)), theta_d / (np.pi / 2), phi_d / np.pi)
    first, second, third = (np.clip((part * count).astype(np.intp), 0, count - 1)
                            for part, count in zip(parts, SHAPE, strict=True))
    return first, second, third
