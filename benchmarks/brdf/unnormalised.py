"""Phong's formula as lectures print it, as a BRDF: L = I (k_d n.l + k_s (r.v)^n) over the irradiance I n.l.

Cost      as the normalised one's.
Accuracy  a look, not a quantity: k_d and k_s are no reflectances.
Fails     reciprocity, for it is divided by the cosine of the incoming direction alone; energy, for k_d lacks its
          1 / pi, a broad lobe reflects more than all light already along the normal, and any lobe does towards grazing
          light, without bound.
Reference Phong 1975; Lewis 1993 tells what it breaks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from radiosity.solver.brdf import Float, mirrored


@dataclass(frozen=True)
class UnnormalisedPhong:
    """f = k_d + k_s (r . o)^n / (i . z)."""

    diffuse: float
    specular: float
    exponent: float

    def __call__(self, incoming: Float, outgoing: Float) -> Float:
        """Evaluate, see `solver.brdf.Brdf`."""
        above = (incoming[..., 2] > 0) & (outgoing[..., 2] > 0)
        lobe = np.maximum((mirrored(incoming) * outgoing).sum(axis=-1), 0) ** self.exponent
        value = self.diffuse + self.specular * np.divide(lobe, incoming[..., 2], out=np.zeros_like(lobe), where=above)
        return np.repeat((above * value)[..., None], 3, axis=-1)
