"""Spot lamps: a point lamp cut to a cone.

As in Cycles, the cone is a smooth step in the cosine of the angle that the *shadow ray*, not the direction to the
lamp's centre, makes with the axis. It is measured in the lamp's own frame, scale included: a lamp scaled in x alone
has an elliptic cone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import cap
from .errors import SceneError
from .lamp_checks import put, unit_vector, within
from .lamps import Point, View
from .lights import LightSample, dot
from .parallel import slices
from .sampling import combined

Float = NDArray[np.floating[Any]]

# Quadrature over the lamp where the cone's edge cuts it: between these half angles of the lamp per width of the edge,
# so many Gauss nodes along the area and angles around. RMS error measured on a lamp of 30 cm at 2 m, of the mean: .03 %
# with edges of a tenth of the cone and more, .5 % with a sharp one.
QUADRATURE = ((0.0, 0.4, 3, 10), (0.4, 1.5, 5, 16), (1.5, np.inf, 8, 32))
# Nodes of all points that are worked on together, about.
CHUNK_NODES = 2**16
# Gauss nodes along the cosine, and angles around, of a spot's flux.
FLUX_NODES, FLUX_ANGLES = 48, 64


@dataclass(frozen=True, eq=False)
class Spot(Point):
    """A point lamp cut to a cone.

    Parameters
    ----------
    flux : (3,) W, as if it shone in all directions; what leaves it is less (see `power`).
    direction : (3,) the cone's axis, away from the lamp.
    spot_size : full angle of the cone, radians, above 0 to pi.
    blend : part of 1 - cos(spot_size / 2) over which the edge fades, 0 to 1.
    frame : (3, 3) whose columns are the lamp's axes, scale included; it shines along minus the last. Made from
        `direction` if None.
    """

    direction: Float = None  # type: ignore[assignment]
    spot_size: float = np.pi / 4
    blend: float = 0.0
    frame: Float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        frame = _frame_along(self.name, self.direction) if self.frame is None else np.array(self.frame, np.float64)
        if frame.shape != (3, 3) or not np.isfinite(frame).all() or abs(np.linalg.det(frame)) == 0:
            raise SceneError(f"lamp {self.name!r}: its axes {frame.tolist()} span no space: mend its scale")
        put(self, frame=frame)
        put(self, direction=unit_vector(self.name, "direction", -frame[:, 2]))
        put(self, spot_size=within(self.name, "spot size", self.spot_size, 1e-6, np.pi))
        put(self, blend=within(self.name, "spot blend", self.blend, 0.0, 1.0))

    def power(self) -> Float:
        """(3,) float32: flux that leaves the cone, W."""
        # On the unit sphere of the lamp's frame, where the cone is round: the solid angle of the world is
        # |det M| / |M l|^3 times that of the frame.
        assert self.frame is not None
        nodes, weights = np.polynomial.legendre.leggauss(FLUX_NODES)
        start, width = self._step
        flux = 0.0
        for low, high in ((start, start + width), (start + width, 1.0)):
            cosine = (low + high) / 2 + (high - low) / 2 * nodes
            angle = 2 * np.pi * np.arange(FLUX_ANGLES) / FLUX_ANGLES
            sine = np.sqrt(np.maximum(1 - cosine**2, 0))[:, None]
            local = np.stack([sine * np.cos(angle), sine * np.sin(angle),
                              np.broadcast_to(-cosine[:, None], (FLUX_NODES, FLUX_ANGLES))], axis=-1)
            spread = abs(np.linalg.det(self.frame)) / np.linalg.norm(local @ self.frame.T, axis=-1) ** 3
            per_cosine = spread.mean(axis=1) * self._fade(cosine)
            flux += float((weights * per_cosine).sum() * (high - low) / 2 * 2 * np.pi)
        return np.asarray(self.flux * np.float32(flux / (4 * np.pi)))

    def irradiance(self, points: Float, normals: Float) -> Float:
        """Unoccluded irradiance (n, 3) float32, W/m2.

        Closed form where the lamp as a whole is inside the cone or outside of it; where the cone's edge cuts it, the
        closed form times a mean of the edge over points of the lamp (`QUADRATURE`).
        """
        view = View.of(self, points, normals)
        return (self.unit_irradiance(view) * self._mean_fade(view))[:, None] * self.colour

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """As a point lamp's, times the cone; inside a sphere there is no cone, as in Cycles."""
        plain = super().sample(points, normals, uv)
        fade = self.attenuation(plain.direction)
        if self.sphere:
            fade = np.where(View.of(self, points, normals).inside, 1, fade)
        return LightSample(plain.direction, plain.distance, np.asarray(plain.weight * fade, np.float32))

    @cached_property
    def _to_frame(self) -> Float:
        """(3, 3) float32, what takes directions of the world, as rows, into the lamp's frame."""
        return np.asarray(np.linalg.inv(self.frame).T, np.float32)  # type: ignore[arg-type]

    @property
    def _step(self) -> tuple[float, float]:
        """Cosine at which the cone starts, and the width over which it fades in."""
        start = float(np.cos(self.spot_size / 2))
        return start, (1 - start) * self.blend

    def _fade(self, cosine: Float) -> Float:
        start, width = self._step
        x = np.clip((cosine - start) / max(width, 1e-12), 0, 1)
        return np.asarray(x * x * (3 - 2 * x))

    def _local_cosine(self, towards_lamp: Float) -> Float:
        """Cosine to the cone's axis in the lamp's frame, of (n, 3) directions from the receivers to the lamp."""
        local = combined(towards_lamp, self._to_frame)
        return np.asarray(local[:, 2] / np.maximum(np.sqrt(dot(local, local)), np.finfo(np.float32).tiny))

    def attenuation(self, towards_lamp: Float) -> Float:
        """(n,) part of the light that the cone lets pass, of (n, 3) unit directions from receivers to the lamp."""
        return self._fade(self._local_cosine(towards_lamp))

    def _mean_fade(self, view: View) -> Float:
        """The cone's mean over the lamp as seen from each point, weighted by the surface's cosine."""
        fade = self.attenuation(view.axis)
        if self.radius == 0:
            return fade
        # Angles in the lamp's frame grow by the frame's condition number at most.
        assert self.frame is not None
        half_angle = np.arcsin(np.sqrt(np.minimum(view.sine_squared, 1)))
        reach = half_angle * float(np.linalg.cond(self.frame))
        angle = np.arccos(np.clip(self._local_cosine(view.axis), -1, 1))
        start, width = self._step
        plateau, outside = np.arccos(min(start + width, 1.0)), np.arccos(start)
        edge = (angle + reach > plateau) & (angle - reach < outside) & ~view.inside
        widths = half_angle / max(float(outside - plateau), 1e-9)
        for low, high, *nodes in QUADRATURE:
            some = np.flatnonzero(edge & (widths >= low) & (widths < high))
            if len(some):
                fade[some] = self._quadrature(view.axis[some], view.sine_squared[some], view.normals[some], *nodes)
        return np.asarray(np.where(view.inside, 1, fade))

    def _quadrature(self, axis: Float, sine_squared: Float, normals: Float, radial: int, angular: int) -> Float:
        x, y, node_weight = _disc_nodes(radial, angular)
        out = np.empty(len(axis), np.float32)
        for some in slices(len(axis), max(1, CHUNK_NODES // len(x))):
            count = len(axis[some])
            wide, facing, sines = (np.repeat(array[some], len(x), axis=0) for array in (axis, normals, sine_squared))
            direction = cap.towards(wide, sines, np.tile(x, count), np.tile(y, count))
            weight = np.tile(node_weight, count) * np.maximum(dot(direction, facing), 0)
            passed = weight * self.attenuation(direction)
            total, norm = (part.reshape(count, -1).sum(axis=1) for part in (passed, weight))
            out[some] = total / np.maximum(norm, np.finfo(np.float64).tiny)
        return out


@cache
def _disc_nodes(radial: int, angular: int) -> tuple[Float, Float, Float]:
    """Places (k,) x and y on the unit disc, float32, and their weights, float64."""
    nodes, weights = np.polynomial.legendre.leggauss(radial)
    radius, angle = np.sqrt((nodes + 1) / 2), 2 * np.pi * (np.arange(angular) + 0.5) / angular
    x, y = (np.outer(radius, turn(angle)).ravel().astype(np.float32) for turn in (np.cos, np.sin))
    return x, y, np.repeat(weights, angular)


def _frame_along(name: str, direction: Float) -> Float:
    axis = -unit_vector(name, "direction", direction)
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis], axis=1)
