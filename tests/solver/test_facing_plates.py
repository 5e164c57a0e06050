"""Discs, strips and endless plates that face each other, gap 1: bakes against exact answers.

Where the exact answer is that of endless plates, the plates of the test end so far from where the light is asked for
that the ends matter less than is said; nothing is allowed for them.
"""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.benchmarks.form_factors.cases import disc, facing_down, level
from radiosity.solver import Settings, form_factor, solve
from radiosity.tests.solver import nystroem
from radiosity.tests.solver.light import at, mean
from radiosity.tests.solver.rooms import quad, shape

UP, DOWN = (0, 0, 1), (0, 0, -1)
RHO = 0.8
# Corners of the polygons that stand for discs, of the same area: form factors are 4e-8 off (P-12).
CORNERS = 96


def _disc(z, corners):
    """A disc as a fan of triangles that faces up at z = 0 and down above."""
    rim = disc(1, z, corners)
    rim = rim[::-1] if z > 0 else rim
    centre = np.broadcast_to((0.0, 0, z), rim.shape)
    return shape(np.stack([centre, rim, np.roll(rim, -1, axis=0)], axis=1), RHO, 1.0)


def test_two_discs_that_glow_alike(judge, validation):
    # P-37: unit discs, gap 1, open, rho .8, E = 1 both: B centre 1.590979607694, edge 1.319396540108, mean
    # 1.445961591547, which 40 nodes of Nystroem's method give, too.
    radius, weight = nystroem.gauss(0, 1, 40)
    exact = nystroem.radiosity(nystroem.discs, radius, weight, RHO)
    published = [1.590979607694, 1.319396540108]
    assert exact(np.array([0.0, 1.0])) == pytest.approx(published, rel=1e-12)
    assert 2 * (weight * radius) @ exact(radius) == pytest.approx(1.445961591547, rel=1e-12)
    low, high = _disc(0, CORNERS), _disc(1, CORNERS)
    scene = (low + high).scene()
    found = at(scene, 0.01, [((0, 0, 0), UP), ((1, 0, 0), UP), ((0, 0, 1), DOWN), ((0, -1, 1), DOWN)])
    judge("P-37", ["H1 centre", "H1 edge", "H2 centre", "H2 edge"], (np.tile(published, 2) - 1) / RHO, found, 0.01)
    solution = solve(scene, Settings(error=0.03))
    validation("P-37", "mean B", 1.445961591547, mean(solution.radiosity, low + high), relative=0.01)


def test_two_endless_strips_that_glow_alike(judge):
    # P-38: strips of width 1, gap 1, rho .8, E = 1 both: B centre 1.536712831416, edge 1.423492956916, mean
    # 1.496771899620. Light is asked for midway along strips of 40: their exact B is 5e-5 below the endless ones'.
    published = [1.536712831416, 1.423492956916, 1.496771899620]
    across, share = nystroem.gauss(0, 1, 12)
    endless = nystroem.radiosity(nystroem.endless_strips, across, share, RHO)
    exact = [*endless(np.array([0.5, 0.0])), share @ endless(across)]
    assert exact == pytest.approx(published, rel=1e-11)
    finite = nystroem.radiosity(nystroem.rectangles, *nystroem.rectangle_nodes(1, 40, 8, 160), RHO)
    lost = endless(across) - finite(np.stack([across, 0 * across], axis=1))
    assert 0 < lost.min() < lost.max() < 6e-5
    scene = (quad((0, -20, 0), (1, 0, 0), (0, 40, 0), RHO, 1.0)
             + quad((0, -20, 1), (0, 40, 0), (1, 0, 0), RHO, 1.0)).scene()
    place, weight = nystroem.gauss(0, 1, 6)
    found = at(scene, 0.01, [((x, 0, 0), UP) for x in (0.5, 0.0, *place)])
    found = np.concatenate([found[:, :2], found[:, 2:] @ weight[:, None]], axis=1)
    judge("P-38", ["H centre, strips of 40", "H edge, strips of 40", "mean H, strips of 40"],
          (np.array(published) - 1) / RHO, found, 0.01)


def test_strips_as_they_grow_endless(validation):
    # P-26: strips of width 1, gap 1, length L: F = sqrt 2 - 1 less what leaves at the ends, in proportion to 1 / L.
    short, long = (form_factor(level(0, 1, 0, length, 0), facing_down(0, 1, 0, length, 1)).value
                   for length in (1000, 2000))
    validation("P-26", "endless strips, from 1 x 1,000 and 1 x 2,000", 2**0.5 - 1, 2 * long - short, relative=1e-9)


def test_two_endless_plates_one_of_which_glows(judge):
    # P-42: rho .8 and .5, E 1 and 0: H1 = B2 = 5/6 and H2 = B1 = 5/3 everywhere. Plates of 1,000 gaps a side, asked in
    # the middle: light leaves them over the edges with a chance of h^2 / R^2 = 4e-6 a crossing. A path of k crossings
    # leaves k times as often: H2 loses 4e-6 (1 + 3 (.4) + 5 (.4)^2 + ...) = 1.6e-5.
    side, gap = 100.0, 0.1
    scene = (quad((-side / 2, -side / 2, 0), (side, 0, 0), (0, side, 0), 0.8, 1.0)
             + quad((-side / 2, -side / 2, gap), (0, side, 0), (side, 0, 0), 0.5, 0.0)).scene()
    found = at(scene, 0.01, [((0, 0, 0), UP), ((0.3, 0.2, 0), UP), ((0, 0, gap), DOWN), ((-0.2, 0.3, gap), DOWN)])
    names = [f"{name}, plates of 1,000 gaps" for name in ("H1 middle", "H1 beside it", "H2 middle", "H2 beside it")]
    judge("P-42", names, [5 / 6, 5 / 6, 5 / 3, 5 / 3], found, 0.01)
