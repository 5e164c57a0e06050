"""Lamps of one kind side by side, so that rays to many of them are worked on together.

A bank answers what a lamp does (`lights.py`), each point about a lamp of its own, whose number is given with it. The
same surfaces stop the light of all lamps of a bank.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .area_lamp import Area
from .lamps import Point, View
from .lights import Light, LightSample, aimed, inside_box
from .linking import links_of, without_links
from .mesh_emitter import CLOSED_FORM_TRIANGLES, MeshEmitter
from .panel_draw import PanelDraw
from .polygon import Shapes, indexed_form_factor

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


class Bank(Protocol):
    """Lamps of one kind."""

    def irradiance(self, points: Float, normals: Float, lamp: Int) -> Float:
        """Unoccluded irradiance over the lamp's colour (n,) float32, in closed form; nan where there is none."""
        ...

    def sample(self, points: Float, normals: Float, uv: Float, lamp: Int) -> LightSample:
        """One shadow ray a point, towards lamp `lamp` (n,) of the bank."""
        ...


def banks(lights: Sequence[Light]) -> tuple[list[Bank], Int, Int, list[NDArray[np.bool_]]]:
    """Lamps in banks: the banks, for each lamp its bank and its number there, and for each bank the surfaces that stop
    its light (see `linking.Links`)."""
    lamps = [without_links(light) for light in lights]
    blockers = [np.asarray(links_of(light).blockers) for light in lights]
    whole: list[Bank] = []
    first: list[int] = []
    bank, place = np.full(len(lights), -1, np.int64), np.zeros(len(lights), np.int64)
    for kind, fits in ((FlatBank, _is_flat), (PointBank, _is_point)):
        alike: dict[bytes, list[int]] = defaultdict(list)
        for number, lamp in enumerate(lamps):
            if fits(lamp):
                alike[blockers[number].tobytes()].append(number)
        for numbers in alike.values():
            if len(numbers) > 1:
                bank[numbers], place[numbers] = len(whole), np.arange(len(numbers))
                whole.append(kind([lamps[number] for number in numbers]))
                first.append(numbers[0])
    for number in np.flatnonzero(bank < 0):
        bank[number] = len(whole)
        whole.append(Single(lamps[number]))
        first.append(int(number))
    return whole, bank, place, [blockers[number] for number in first]


def _is_point(light: Light) -> bool:
    return type(light) is Point


def _is_flat(light: Light) -> bool:
    return isinstance(light, MeshEmitter) or (
        isinstance(light, Area) and not light.round and light.spread == np.pi and light.area > 0)


class Single:
    """One lamp of any kind."""

    def __init__(self, light: Light) -> None:
        self._light = light
        self._channel = int(np.argmax(light.colour))
        self._strength = max(float(light.colour[self._channel]), 1e-30)

    def irradiance(self, points: Float, normals: Float, lamp: Int) -> Float:
        """See Bank."""
        closed = self._light.irradiance(points, normals)
        if closed is None:
            return np.full(len(points), np.nan, np.float32)
        return np.asarray(closed[:, self._channel] / np.float32(self._strength), np.float32)

    def sample(self, points: Float, normals: Float, uv: Float, lamp: Int) -> LightSample:
        """See Bank."""
        return self._light.sample(points, normals, uv)


class PointBank:
    """Point lamps."""

    def __init__(self, lights: Sequence[Any]) -> None:
        self._position = np.array([light.position for light in lights], np.float32)
        self._radius = np.array([light.radius for light in lights], np.float32)
        self._sphere = np.array([light.sphere for light in lights])

    def irradiance(self, points: Float, normals: Float, lamp: Int) -> Float:
        """See Bank."""
        return self._view(points, normals, lamp).unit_irradiance()

    def sample(self, points: Float, normals: Float, uv: Float, lamp: Int) -> LightSample:
        """See Bank."""
        return self._view(points, normals, lamp).sample(self._radius[lamp], self._sphere[lamp], uv)

    def _view(self, points: Float, normals: Float, lamp: Int) -> View:
        return View.around(self._position[lamp], self._radius[lamp], self._sphere[lamp], points, normals)


class FlatBank:
    """Emissive triangles in groups, and rectangular area lamps: parallelograms and triangles of constant radiance."""

    def __init__(self, lights: Sequence[Any]) -> None:
        parts = [_pieces(light) for light in lights]
        corner, first, second, normal, square, limit, brightness = (
            np.concatenate([part[column] for part in parts]) for column in range(7))
        self._count = np.array([len(part[0]) for part in parts])
        self._first = np.cumsum(self._count) - self._count
        self._normal = np.asarray(normal, np.float32)
        self._draw = PanelDraw(corner, first, second, square)
        lamp = np.repeat(np.arange(len(lights)), self._count)
        # Lamp k's panels share the numbers from k to k + 1 by their flux.
        self._limit = limit + lamp
        # A triangle is a quadrilateral whose last corners are one.
        far = corner + second + np.where(square[:, None], first, 0)
        self._shapes = Shapes.of(np.stack([corner, corner + first, far, corner + second], axis=1), np.float32)
        self._strength = np.asarray(brightness, np.float32)
        many = [isinstance(light, MeshEmitter) and len(light.corners) > CLOSED_FORM_TRIANGLES for light in lights]
        self._closed = ~np.array(many)
        self._two_sided = np.array([isinstance(light, MeshEmitter) and light.two_sided for light in lights])
        boxes = [light.closed_box if isinstance(light, MeshEmitter) else None for light in lights]
        self._boxed = np.array([box is not None for box in boxes])
        self._box = np.array([np.zeros((2, 3)) if box is None else box for box in boxes], np.float32)

    def _sees_backs(self, points: Float, lamp: Int) -> NDArray[np.bool_]:
        backs = self._two_sided[lamp]
        rows = np.flatnonzero(backs & self._boxed[lamp])
        low, high = np.take(self._box, lamp[rows], axis=0).transpose(1, 2, 0)
        backs[rows] = inside_box(np.take(points, rows, axis=0), low, high)
        return np.asarray(backs)

    def irradiance(self, points: Float, normals: Float, lamp: Int) -> Float:
        """See Bank."""
        count = np.where(self._closed[lamp], self._count[lamp], 0)
        pair = np.repeat(np.arange(len(lamp)), count)
        piece = self._first[lamp][pair] + np.arange(len(pair)) - (np.cumsum(count) - count)[pair]
        points_of_pair, normals_of_pair = (np.take(array, pair, axis=0) for array in (points, normals))
        factor = indexed_form_factor(points_of_pair, normals_of_pair, self._shapes, piece, "signed")
        back = self._sees_backs(points, lamp)[pair]
        factor = np.where(back, np.abs(factor), np.maximum(factor, 0)) * self._strength[piece]
        total = np.bincount(pair, factor, len(lamp)).astype(np.float32)
        return np.where(self._closed[lamp], total, np.float32(np.nan))

    def sample(self, points: Float, normals: Float, uv: Float, lamp: Int) -> LightSample:
        """See Bank."""
        at = lamp + uv[:, 0].astype(np.float64)
        piece = np.searchsorted(self._limit, at, side="right")
        low = np.where(piece > self._first[lamp], self._limit[piece - 1], lamp)
        width = np.maximum(self._limit[piece] - low, np.finfo(np.float64).tiny)
        u = np.clip((at - low) / width, 0, 1).astype(np.float32)
        target, scale = self._draw.targets(points, piece, u, uv[:, 1])
        normal = np.take(self._normal, piece, axis=0)
        return aimed(points, normals, target, normal, self._sees_backs(points, lamp), scale)


def _pieces(light: MeshEmitter | Area) -> tuple[NDArray[Any], ...]:
    """Corner, two sides, normal (k, 3); whether it is a parallelogram, upper limit of its part of the flux, and its
    exitance over the lamp's colour (k,)."""
    if isinstance(light, Area):
        corner = light.centre - (light.axis_u + light.axis_v) / 2
        return (corner[None], light.axis_u[None], light.axis_v[None], light.normal[None], np.ones(1, bool), np.ones(1),
                np.full(1, np.pi / light.area))
    return light.pieces()
