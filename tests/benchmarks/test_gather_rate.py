"""The measure of the gather's rays on a small room: it sees all of them, and changes nothing."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from radiosity.benchmarks import gather_rate
from radiosity.solver import Settings, bake
from radiosity.solver.geometry import Geometry
from radiosity.solver.visibility import Visibility
from radiosity.tests.solver.rooms import box

# A closed room with a glowing ceiling and a block in it.
ROOM = (box((0, 0, 0), (4, 3, 2.5), 0.6, (0, 1, 0, 0, 0, 0)) + box((1, 1, 0), (1.8, 2.1, 1.2), inward=False)).scene()
SETTINGS = Settings(error=0.1, texel_density=4, threads=2)


@pytest.fixture(scope="module")
def watched():
    """A watch that kept every chunk, and the report of its bake."""
    watch = gather_rate.Watch(1)
    return watch, watch.bake(ROOM, SETTINGS)


def test_every_ray_of_the_gather_is_counted_and_kept(watched):
    # Those of the stage "gather", and those by which cells that it meets look how much room is in front of them: the
    # report counts the former.
    watch, report = watched
    counted = next(stage["rays"] for stage in report["stages"] if stage["name"] == "gather")
    assert watch.rays == sum(len(chunk.origins) for chunk in watch.chunks)
    assert 0 < counted <= watch.rays < 1.1 * counted
    nearest = [chunk.directions for chunk in watch.chunks if chunk.distances is None]
    np.testing.assert_allclose(np.linalg.norm(np.concatenate(nearest), axis=1), 1, atol=1e-5)


def test_being_watched_changes_no_bit_and_nothing_is_watched_afterwards(watched):
    watch, report = watched
    rays = watch.rays
    plain = bake(ROOM, SETTINGS).report
    assert plain["error"] == report["error"]
    assert watch.rays == rays
    assert Visibility.hits.__qualname__ == "Visibility.hits"


def test_shadow_rays_are_kept_with_how_far_they_go():
    # Two rays from the room's middle, its origin, to its floor 1.25 m below, that end before it and behind it: one is
    # blocked.
    watch = gather_rate.Watch(1)
    visibility = Geometry(ROOM).visibility
    with watch._stage("gather"):
        blocked = watch._occluded(Visibility.occluded)(
            visibility, np.zeros((2, 3), np.float32), np.full((2, 3), (0, 0, -1), np.float32),
            np.array([1.0, 1.5], np.float32))
    assert blocked.tolist() == [False, True]
    assert watch.rays == 2
    assert watch.chunks[0].distances.tolist() == [1.0, 1.5]
    assert gather_rate.bare(watch.chunks, 1).wall > 0


def test_some_of_the_chunks_may_stand_for_all(watched):
    # Every third of them.
    watch = gather_rate.Watch(3)
    watch.bake(ROOM, SETTINGS)
    assert watch.rays == watched[0].rays
    assert len(watch.chunks) == len(watched[0].chunks) // 3


def test_the_gather_takes_more_time_than_its_rays_alone(tmp_path):
    # The same rays, counted once; the share is the rates' ratio and below 1.
    row = gather_rate.measure("room", ROOM, SETTINGS)
    assert row.share_cpu == pytest.approx(row.gather_cpu / row.bare_cpu)
    assert 0 < row.share_cpu < 1
    gather_rate.write_csv(tmp_path / "rates.csv", [row])
    with (tmp_path / "rates.csv").open(encoding="utf-8") as file:
        (read,) = csv.DictReader(file)
    assert int(read["rays"]) == row.rays
    assert float(read["share_cpu"]) == pytest.approx(row.share_cpu, rel=1e-4)
    assert "rays/s" in gather_rate.line(row)
