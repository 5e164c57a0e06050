"""What all lamps share that are another lamp with something added: a pattern, a falloff, links."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .lights import Light

Float = NDArray[np.floating[Any]]


class LampOf:
    """A lamp that goes by another's name and colour.

    lamp : what shines.
    """

    lamp: Light

    @property
    def name(self) -> str:
        """The lamp's."""
        return self.lamp.name

    @property
    def colour(self) -> Float:
        """The lamp's."""
        return self.lamp.colour
