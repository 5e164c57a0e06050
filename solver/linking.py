"""Light and shadow linking: which surfaces a lamp reaches, and which of them stop its light.

This is no physics, it is how a scene is lit on purpose: a lamp for the face alone, a window frame that throws no
shadow. Light that a surface reflects is light like any other: linking rules the way from the lamp to the first surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SceneError
from .lamp_of import LampOf
from .lights import Light, LightSample

if TYPE_CHECKING:
    from .footprints import Footprints

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Links:
    """What a lamp is linked to.

    Parameters
    ----------
    receivers : (s,) bool, the surfaces of the scene that get its light; or one bool for all of them.
    blockers : (s,) bool, the surfaces that its shadow rays meet, of those that cast shadows; or one bool for all of
        them: with False it casts no shadows.
    probes : whether points on no surface get its light.
    """

    receivers: ArrayLike = True
    blockers: ArrayLike = True
    probes: bool = True

    def __post_init__(self) -> None:
        for name in ("receivers", "blockers"):
            mask = np.array(getattr(self, name))
            if mask.dtype != bool or mask.ndim > 1:
                raise SceneError(f"{name} of a lamp are {mask.dtype} {mask.shape}: give one bool, or one a surface")
            mask.flags.writeable = False
            object.__setattr__(self, name, mask)

    def check(self, surfaces: int, whose: str) -> None:
        """Refuse links to another number of surfaces than a scene has.

        Raises
        ------
        SceneError
            Naming what they belong to.
        """
        for name in ("receivers", "blockers"):
            shape = np.shape(getattr(self, name))
            if shape not in ((), (surfaces,)):
                raise SceneError(f"{whose}: its {name} are {shape[0]} bools, and the scene has {surfaces} surfaces: "
                                 "give one for each, or one for all")


FREE = Links()


@dataclass(frozen=True, eq=False)
class Linked(LampOf):
    """A lamp with links; by itself it shines as the lamp does: what asks for its light minds the links.

    Parameters
    ----------
    lamp : what shines.
    links : whom it reaches, and who stops its light.
    """

    lamp: Light
    links: Links

    def power(self) -> Float:
        """The lamp's."""
        return self.lamp.power()

    def irradiance(self, points: Float, normals: Float) -> Float | None:
        """The lamp's."""
        return self.lamp.irradiance(points, normals)

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """The lamp's."""
        return self.lamp.sample(points, normals, uv)

    def translated(self, offset: Float) -> Linked:
        """The same lamp, moved by (3,) metres."""
        return Linked(self.lamp.translated(offset), self.links)


def links_of(light: Light) -> Links:
    """A lamp's links."""
    return light.links if isinstance(light, Linked) else FREE


def without_links(light: Light) -> Light:
    """What shines."""
    return light.lamp if isinstance(light, Linked) else light


@dataclass(frozen=True, eq=False)
class Reach:
    """Which of m lamps reach which surfaces.

    kind : (s + 1,) int, the same for surfaces that the same lamps reach; the last is that of points on no surface,
        whose surface is -1.
    lamps : (m, kinds) bool, whether each lamp reaches surfaces of each kind.
    """

    kind: Int
    lamps: Mask

    @classmethod
    def of(cls, links: Sequence[Links], surfaces: int) -> Reach:
        """Of lamps with these links, in a scene of so many surfaces."""
        # Many lamps share few links.
        number = {one: index for index, one in enumerate(dict.fromkeys(links))}
        masks = np.ones((len(number), surfaces + 1), bool)
        for row, one in zip(masks, number, strict=True):
            row[:-1], row[-1] = one.receivers, one.probes
        if masks.all():
            return cls(np.zeros(surfaces + 1, np.int64), np.ones((len(links), 1), bool))
        kinds, kind = np.unique(masks, axis=1, return_inverse=True)
        return cls(kind.reshape(-1), kinds[[number[one] for one in links]])

    @property
    def is_everywhere(self) -> bool:
        """Whether every lamp reaches everything."""
        return self.lamps.shape[1] == 1 and bool(self.lamps.all())

    def kinds(self, places: Footprints) -> Int | None:
        """(n,) the kinds of surface that footprints lie on; None where all are alike."""
        return None if self.is_everywhere else self.kind[places.surface]

    def rows(self, lamp: int, places: Footprints) -> Int:
        """(k,) the footprints that a lamp reaches."""
        kind = self.kinds(places)
        return np.arange(len(places)) if kind is None else np.flatnonzero(self.lamps[lamp, kind])
