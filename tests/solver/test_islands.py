"""Pieces of surface: which are closed, which way they face, and which of them have an inside."""

import numpy as np
import pytest
from radiosity.solver.islands import Islands
from radiosity.tests.solver.rooms import box, quad, shape

CUBE = box((0, 0, 0), (1, 1, 1), inward=False)
BESIDE = box((1, 1, 0), (2, 2, 1), inward=False)  # shares one upright edge with it
SHEET = quad((0, 0, 0), (0, -1, 0), (1, 0, 0))  # shares one edge of its floor
TWO_SIDED = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)) + quad((0, 0, 0), (0, 1, 0), (1, 0, 0))


@pytest.mark.parametrize(("surface", "closed", "solid", "inverted"), [
    (CUBE, True, True, False),
    (box((0, 0, 0), (1, 1, 1)), True, False, True),
    (shape(CUBE.corners[2:]), False, False, False),  # no floor
    (CUBE + BESIDE, True, True, False),  # an edge of four faces, two each way
    (CUBE + SHEET, False, False, False),  # an edge of three
    (TWO_SIDED, True, False, False),  # nothing inside
], ids=["cube", "inward", "open", "touching cubes", "cube on a sheet", "sheet and its back"])
def test_a_piece_is_closed_and_solid(surface, closed, solid, inverted):
    found = Islands.of(surface.corners)
    assert found.closed.tolist() == [closed]
    assert (found.solid == solid).all()
    assert (found.inverted == inverted).all()


def test_pieces_of_different_objects_are_apart():
    # A cube of one object that stands on the edge of another's floor. Exact answer: solid all the same.
    found = Islands.of((CUBE + SHEET).corners, np.r_[np.zeros(12, int), 1, 1])
    assert found.solid.tolist() == [True] * 12 + [False] * 2
    assert found.closed.tolist() == [True, False]
