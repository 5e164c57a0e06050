"""The classical pipeline from end to end: walls into elements, exact form factors, LU, and what comes of it.

    python -m radiosity.benchmarks.linear.elements

prints how far off the walls of a closed cube are with n x n constant elements a wall (the exact values are those of the
continuous radiosity equation, P-39 of docs/validation.md), what a red and a green wall do to a white floor, and how far
off a shadow's edge is between elements.
"""

from __future__ import annotations

import numpy as np
from radiosity.solver.form_factor import element_form_factor

from .systems import Float, cube, cube_form_factors

# Mean irradiance of floor, ceiling and sides of a unit cube, rho .5 and .8, ceiling E = 1 W/m2: six digits.
EXACT = {0.5: (0.342432, 0.208723, 0.362211), 0.8: (0.826224, 0.734382, 0.859849)}
SIDES = (1, 2, 4, 8, 16)
# Walls of `cube_form_factors`: x = 0, x = 1, y = 0, y = 1, z = 0, z = 1.
FLOOR, CEILING, RED, GREEN = 4, 5, 0, 1
# Elements across a floor of 2 m under a shadow's edge whose penumbra is .2 m wide, and points that are looked at.
ACROSS, POINTS = (4, 8, 16, 32, 64), 401
WHITE, COLOURED = (0.75, 0.75, 0.75), {RED: (0.75, 0.15, 0.15), GREEN: (0.15, 0.75, 0.15)}


def wall_means(side: int, reflectance: float) -> Float:
    """Mean irradiance H = F B (3,) of floor, ceiling and one side, W/m2."""
    system = cube(side, reflectance)
    walls = (system.F @ system.radiosity()).reshape(6, -1).mean(axis=1)
    return np.asarray(walls[[FLOOR, CEILING, RED]])


def coloured_floor(side: int) -> Float:
    """Irradiance (side, 3) along the floor from the red wall to the green one, mean over the other way; W/m2."""
    F = cube_form_factors(side)
    rho = np.repeat([COLOURED.get(wall, WHITE) for wall in range(6)], side**2, axis=0)
    emission = np.zeros(len(F))
    emission[CEILING * side**2:] = 1
    B = [np.linalg.solve(np.eye(len(F)) - channel[:, None] * F, emission) for channel in rho.T]
    floor = (F @ np.stack(B, axis=1)).reshape(6, side, side, 3)[FLOOR]
    return np.asarray(floor.mean(axis=1))


def shadow_edge(x: Float) -> Float:
    """Form factors (n,) from points (x, 0, 0) that face up to a lamp of .2 m, 2 m above, past a half-plane at 1 m."""
    lamp = np.array([[-0.1, -0.1, 2], [-0.1, 0.1, 2], [0.1, 0.1, 2], [0.1, -0.1, 2]])
    blade = np.array([[-9, -9, 1], [0, -9, 1], [0, 9, 1], [-9, 9, 1]], float)
    return np.array([element_form_factor((place, 0, 0), (0, 0, 1), lamp, (blade,)).value for place in x])


def reconstruction_error(across: int, exact: Float) -> float:
    """The largest error of values at the elements' middles, joined by lines, over the largest exact value."""
    places = np.linspace(-1, 1, POINTS)
    middles = (np.arange(across) + 0.5) / across * 2 - 1
    inside = np.abs(places) <= middles[-1]
    joined = np.interp(places, middles, shadow_edge(middles))
    return float(np.abs(joined - exact)[inside].max() / exact.max())


def main() -> None:
    """Print all three."""
    print("elements a wall, reflectance, relative error of floor, ceiling, side")
    for reflectance, exact in EXACT.items():
        for side in SIDES:
            error = wall_means(side, reflectance) / exact - 1
            print(f"{side} x {side},", f"{reflectance},", ", ".join(f"{value:+.2%}" for value in error))
    print("floor beside the red wall, in the middle, beside the green wall: red, green, blue, W/m2")
    floor = coloured_floor(9)
    for row in (0, 4, 8):
        print(", ".join(f"{value:.3f}" for value in floor[row]))
    print("elements across 2 m, largest error of a shadow's edge of .2 m, of the unshadowed light")
    edge = shadow_edge(np.linspace(-1, 1, POINTS))
    for across in ACROSS:
        print(f"{across},", f"{reconstruction_error(across, edge):.0%}")


if __name__ == "__main__":
    main()
