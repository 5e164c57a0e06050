"""Bits do not depend on how work is cut into chunks or over threads, and rays follow what a scene and an error need."""

from __future__ import annotations

import importlib
from functools import cache

import numpy as np
import pytest
from radiosity.solver import Settings, bake
from radiosity.tests.solver.rooms import box
from radiosity.tests.solver.test_determinism import _bits, _scene
from radiosity.tests.solver.test_radiosity_stability import HIGH, LOW

SETTINGS = Settings(error=0.1, threads=2, texel_density=5.0)
# Every constant that cuts work for memory or threads, and an odd one in its place.
CHUNKS = {
    "transport.CHUNK_RAYS": 2**11, "gather.CHUNK_RAYS": 3000, "direct.CHUNK_RAYS": 2**11, "met_cells.CHUNK_CELLS": 999,
    "seen.CHUNK_POINTS": 555, "inside.CHUNK_RAYS": 500, "lumels.CHUNK": 333, "polygon.CHUNK": 100, "blocks.CHUNK": 77,
    "kernels.CHUNK": 100, "tables.CHUNK": 1000, "raster.ROW_CHUNK": 10, "raster.PIXEL_CHUNK": 1000, "mixing.CHUNK": 999,
}


@cache
def _as_it_is():
    return bake(_scene(), SETTINGS)


@pytest.mark.parametrize("chunk", CHUNKS)
def test_a_chunk_of_another_size_changes_no_bit(chunk, monkeypatch):
    # A room with every way that light can take; one constant at a time, one thread instead of two.
    usual = _as_it_is()
    name, constant = chunk.split(".")
    part = importlib.import_module(f"radiosity.solver.{name}")
    assert getattr(part, constant) != CHUNKS[chunk]
    monkeypatch.setattr(part, constant, CHUNKS[chunk])
    other = bake(_scene(), Settings(error=0.1, threads=1, texel_density=5.0))
    assert _bits(other) == _bits(usual)
    assert other.report["rays"] == usual.report["rays"]


def _rays(shape, error):
    return bake(shape.scene(), Settings(error=error, texel_density=4.0)).report["rays"]


@pytest.mark.slow
def test_a_coarse_error_is_markedly_cheaper_than_a_fine_one():
    # A room with a glowing ceiling: .10 against .01 takes less than a fifth of the rays.
    room = box(LOW, HIGH, 0.6, (0, 1, 0, 0, 0, 0))
    assert _rays(room, 0.1) < 0.2 * _rays(room, 0.01)


def _rays_for_an_error(shape):
    """The rays of a bake (not of its audit, which is as long for any scene) that an error of 1 would take: they are as
    one over its square at most."""
    report = bake(shape.scene(), Settings(error=0.03, texel_density=8.0)).report
    rays = sum(stage["rays"] for stage in report["stages"] if stage["name"] != "audit")
    return rays * report["error"]["estimated"]["rms"] ** 2


def test_an_empty_room_is_markedly_cheaper_than_a_cluttered_one():
    # The same room, and with 24 boxes on its floor, at the same texels a metre: less than half of the rays.
    # (Of small images the first rays are so many that hardly any follow in either; the empty room then errs by less.)
    random = np.random.default_rng(2)
    empty = cluttered = box(LOW, HIGH, 0.6, (0, 1, 0, 0, 0, 0))
    for x in np.arange(0.3, 3.7, 0.6):
        for y in np.arange(0.3, 2.7, 0.7):
            size = random.uniform(0.1, 0.4, 3) * (1, 1, 3)
            cluttered = cluttered + box((x, y, 0), np.array([x, y, 0]) + size, 0.6, inward=False)
    assert _rays_for_an_error(empty) < 0.5 * _rays_for_an_error(cluttered)
