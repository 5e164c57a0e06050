"""The classical solvers of the radiosity system: how many products each needs, where each fails; ours beside them."""

from __future__ import annotations

import csv
import inspect

import numpy as np
import pytest
from radiosity.benchmarks.form_factors.cases import level, upright
from radiosity.benchmarks.linear import chebyshev
from radiosity.benchmarks.linear.methods import SOLVERS
from radiosity.benchmarks.linear.run import COLUMNS, write
from radiosity.benchmarks.linear.systems import System, cube, cube_form_factors, two_rooms, uneven_cube
from radiosity.solver.contour import convex_form_factor

TOLERANCE = 1e-4
SIDE = 6
RIGHT = sorted(set(SOLVERS) - {"overshooting", "CG, unsymmetrised"})


def run(name, system, cap, tolerance=TOLERANCE):
    return SOLVERS[name](system.F, system.reflectance, system.emission, system.areas, tolerance, cap)


def painted(side):
    """A cube whose walls have six reflectances, one of them 0."""
    system = cube(side, 0.5)
    reflectance = np.repeat([0.1, 0.9, 0.3, 0.7, 0.0, 0.95], side**2)
    return System(system.F, reflectance, system.emission, system.areas)


# ---- the systems


@pytest.mark.parametrize("side", [1, 4])
def test_cubes_form_factors_close_and_are_symmetric(side):
    # Rows sum to 1; all areas are equal, so F is symmetric; side 1: P-01 and P-05.
    F = cube_form_factors(side)
    np.testing.assert_allclose(F.sum(axis=1), 1, atol=1e-13)
    np.testing.assert_allclose(F, F.T, atol=1e-15)
    if side == 1:
        np.testing.assert_allclose(F[0], [0, 0.19982489569839, *[0.2000437760754] * 4], atol=1e-13)


def test_table_of_squares_agrees_with_the_contour():
    # Square (1, 2) of the wall x = 0 and (0, 3) of the floor z = 0, on a cube of 4 x 4: two independent formulas.
    F = cube_form_factors(4)
    wall = upright(0.25, 0.5, 0.5, 0.75)
    floor = level(0, 0.25, 0.75, 1, 0)
    assert F[1 * 4 + 2, 4 * 16 + 0 * 4 + 3] == pytest.approx(convex_form_factor(wall, floor), rel=1e-10)


def test_cube_agrees_with_the_continuum():
    # P-39: rho .5, ceiling E = 1: wall means of H .342432, .208723, .362211; 16 x 16 squares are within .2 %.
    system = cube(16, 0.5)
    irradiance = ((system.radiosity() - system.emission) / system.reflectance).reshape(6, -1).mean(axis=1)
    np.testing.assert_allclose(irradiance, [*[0.362211] * 4, 0.342432, 0.208723], rtol=2e-3)


def test_one_patch_a_wall_is_the_lumped_cube():
    # P-40: H floor .363491652216, ceiling .181818196215, side .363672537892.
    system = cube(1, 0.5)
    irradiance = (system.radiosity() - system.emission) / system.reflectance
    np.testing.assert_allclose(irradiance, [*[0.363672537892] * 4, 0.363491652216, 0.181818196215], atol=1e-11)


def test_pin_hole_has_a_second_slow_mode():
    # Two rooms of 383 patches: the second eigenvalue is .9948; the cube's is .53 at most.
    slow = np.linalg.eigvalsh(two_rooms(8, 0.5).F)[-2]
    assert slow == pytest.approx(0.9948, abs=2e-4)
    assert np.linalg.eigvalsh(cube_form_factors(8))[-2] < 0.53
    np.testing.assert_allclose(two_rooms(8, 0.5).F.sum(axis=1), 1, atol=1e-13)


# ---- the solvers


@pytest.mark.parametrize("name", SOLVERS)
def test_every_solver_has_the_same_signature_and_tells_what_it_costs(name):
    first = ["F", "reflectance", "emission", "areas", "tolerance", "cap"]
    assert list(inspect.signature(SOLVERS[name]).parameters)[:6] == first
    function = getattr(SOLVERS[name], "func", SOLVERS[name])
    text = inspect.getdoc(inspect.getmodule(function))
    assert [word for word in ("Cost ", "Accuracy ", "Fails ", "Reference ") if word not in text] == []


@pytest.mark.parametrize("name", RIGHT)
@pytest.mark.parametrize("build", [lambda: cube(3, 0.7), lambda: two_rooms(3, 0.7), lambda: painted(3),
                                   lambda: uneven_cube(0)], ids=["cube", "two rooms", "painted", "uneven"])
def test_right_solvers_find_the_solution_of_lu(name, build):
    # To 1e-9 of the largest emission; the error is at most the residual over 1 - rho.
    system = build()
    result = run(name, system, 2000, tolerance=1e-9)
    exact = system.radiosity()
    assert np.abs(result.radiosity - exact).max() < 1e-9 / (1 - system.reflectance.max()) + 1e-12


@pytest.mark.parametrize("name", RIGHT)
def test_closed_furnace_glows_evenly(name):
    # E = 1 everywhere, rho = .8: B = 5 everywhere.
    system = cube(3, 0.8)
    system = System(system.F, system.reflectance, np.ones(54), system.areas)
    np.testing.assert_allclose(run(name, system, 1000, tolerance=1e-10).radiosity, 5, atol=1e-8)


@pytest.mark.parametrize("reflectance", [0.5, 0.8, 0.9, 0.95])
def test_jacobi_needs_as_many_sweeps_as_the_logarithm_says(reflectance):
    # The first residual is rho, about; each sweep takes rho off: ln(tolerance) / ln(rho) at most.
    products = run("Jacobi", cube(SIDE, reflectance), 2000).products
    bound = np.log(TOLERANCE) / np.log(reflectance)
    assert 0.7 * bound < products <= bound + 2


def test_jacobi_falls_by_the_reflectance_each_sweep():
    # Closed cube, rho .9: in the long run the residuals' ratio is rho lambda_1 = .9, no other mode is left.
    residuals = np.array(run("Jacobi", cube(SIDE, 0.9), 60, tolerance=0).residuals)
    np.testing.assert_allclose(residuals[41:] / residuals[40:-1], 0.9, rtol=1e-3)


@pytest.mark.parametrize("reflectance", [0.8, 0.95])
def test_gauss_seidel_halves_jacobi(reflectance):
    system = cube(SIDE, reflectance)
    assert run("Gauss-Seidel", system, 500).products == pytest.approx(run("Jacobi", system, 500).products / 2, rel=0.25)


def test_chebyshev_needs_the_root_of_jacobis_sweeps_but_bounds_that_hold():
    # rho .99: Jacobi 916 to an error of 1e-4; Chebyshev 64 to the residual, but 220 with .95 as the bound, 440 with .8.
    system = cube(SIDE, 0.99)
    arguments = (system.F, system.reflectance, system.emission, system.areas, TOLERANCE, 1000)
    steps = [chebyshev.solve(*arguments, bound=bound).products for bound in (0.99, 0.95, 0.8)]
    assert steps[0] < 80
    assert 3 * steps[0] < steps[1] < steps[2] < run("Jacobi", system, 2000).products


@pytest.mark.parametrize("reflectance", [0.5, 0.8, 0.9, 0.95, 0.99, 0.999])
def test_krylov_does_not_care_about_the_reflectance_of_a_room(reflectance):
    # Closed cube: CG and ours need about ten products at any reflectance; Jacobi 9,205 at .999.
    system = cube(SIDE, reflectance)
    for name in ("CG", "ours"):
        result = run(name, system, 100)
        assert result.converged(TOLERANCE)
        assert result.products <= 13


@pytest.mark.parametrize("reflectance", [0.9, 0.99])
def test_krylov_finds_two_rooms_by_itself(reflectance):
    # Two slow modes: 10 to 15 products, where Jacobi needs 82 and 862.
    system = two_rooms(SIDE, reflectance)
    for name in ("CG", "ours"):
        result = run(name, system, 100)
        assert result.converged(TOLERANCE)
        assert result.products <= 17


def test_overshooting_is_fast_in_a_dark_room():
    # rho .5: about 2.5 n shots where plain shooting takes 6 n.
    system = cube(SIDE, 0.5)
    assert run("overshooting", system, 50).products < 0.6 * run("shooting", system, 50).products


@pytest.mark.parametrize(("build", "reflectance"), [(cube, 0.9), (cube, 0.95), (two_rooms, 0.95), (two_rooms, 0.99)])
def test_overshooting_stalls_in_a_bright_room(build, reflectance):
    # 40 n shots, and the residual is above the emission still; CG's last is below 1e-4 of it.
    system = build(SIDE, reflectance)
    assert not run("overshooting", system, 40).residuals[-1] < 0.5
    assert run("CG", system, 40).converged(TOLERANCE)


def test_overshooting_chosen_by_what_would_be_shot_converges_but_slowly_where_rooms_hardly_meet():
    # rho .95: the cube 6 n, two rooms 46 n; CG 9 and 11.
    assert run("overshooting, mended", cube(SIDE, 0.95), 60).products < 10
    assert run("overshooting, mended", two_rooms(SIDE, 0.95), 60).products > 30


def test_unsymmetrised_gradients_lose_their_way_when_patches_differ():
    # Areas 1 : 48, reflectances .1 to .99, eight rooms: the right one takes some 14 products to 1e-8 in each; the wrong
    # one at least twice as many, and in half of the rooms or more it isn't there after 60, nor ever after.
    lost = 0
    for seed in range(8):
        system = uneven_cube(seed)
        exact = system.radiosity()
        right, wrong = (run(name, system, 60, tolerance=1e-8) for name in ("CG", "CG, unsymmetrised"))
        assert right.products < 20
        assert np.abs(right.radiosity - exact).max() < 1e-7 * exact.max()
        assert wrong.products >= 2 * right.products
        lost += np.abs(wrong.radiosity - exact).max() > 1e-5 * exact.max()
    assert lost >= 4


def test_unsymmetrised_gradients_get_away_with_it_when_all_is_equal():
    assert run("CG, unsymmetrised", cube(SIDE, 0.9), 100).products <= 12


def test_ours_takes_rows_that_are_not_symmetric():
    # Rows of a cube with ray-counting noise: 256 rays a row, counted: CG's symmetry is gone, GMRES doesn't need it.
    rng = np.random.default_rng(1)
    system = cube(SIDE, 0.9)
    F = np.stack([rng.multinomial(256, row / row.sum()) / 256 for row in system.F])
    noisy = System(F, system.reflectance, system.emission, system.areas)
    ours = run("ours", noisy, 100, tolerance=1e-8)
    np.testing.assert_allclose(ours.radiosity, noisy.radiosity(), rtol=1e-6)


def test_ours_says_that_a_room_which_absorbs_nothing_has_no_solution():
    # S-10: rho 1, closed, with power in. The iteration stalls or runs into its cap: the residual stays large.
    assert run("ours", cube(3, 1.0), 100).residuals[-1] > 0.01


@pytest.mark.parametrize("name", ["Jacobi", "Gauss-Seidel", "Chebyshev", "CG", "ours", "LU"])
def test_black_room_is_lit_by_its_lamp_alone(name):
    system = cube(2, 0.0)
    np.testing.assert_allclose(run(name, system, 20).radiosity, system.emission, atol=1e-14)


@pytest.mark.parametrize("name", RIGHT)
def test_patch_that_nobody_sees_keeps_its_own_light(name):
    # A column and a row of zeros: the hidden patch has B = E = 2, the others don't notice.
    system = cube(2, 0.5)
    F = np.zeros((25, 25))
    F[:24, :24] = system.F
    hidden = System(F, np.full(25, 0.5), np.append(system.emission, 2.0), np.append(system.areas, 0.25))
    result = run(name, hidden, 200, tolerance=1e-10)
    assert result.radiosity[-1] == pytest.approx(2, abs=1e-9)
    np.testing.assert_allclose(result.radiosity[:24], system.radiosity(), atol=1e-8)


def test_driver_writes_one_row_for_every_system_and_solver(tmp_path):
    write(tmp_path / "table.csv", side=2, cap=50, reflectances=(0.5,))
    with (tmp_path / "table.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert tuple(table[0]) == COLUMNS
    assert len(table) == 2 * len(SOLVERS)
    assert all(float(row["error"]) < 1e-3 for row in table if row["solver"] in RIGHT)
