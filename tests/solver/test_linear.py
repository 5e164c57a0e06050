"""The shipped solver of x = q + F rho x: against a dense solve, against the classical ones, and where none exists."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.benchmarks.linear.methods import SOLVERS
from radiosity.benchmarks.linear.systems import cube, two_rooms
from radiosity.solver.errors import Cancelled
from radiosity.solver.linear import GOOD_ENOUGH, MOST_PRODUCTS, solve_linear


def _random(count, radius, seed=0):
    """An unsymmetric matrix (count, count) of nonnegative entries whose rows sum to `radius`."""
    matrix = np.random.default_rng(seed).exponential(size=(count, count)) ** 3
    return radius * matrix / matrix.sum(axis=1, keepdims=True)


@pytest.mark.parametrize("radius", [0.1, 0.5, 0.9, 0.99, 0.999])
@pytest.mark.parametrize("count", [1, 7, 200])
def test_it_finds_what_the_dense_solve_finds(radius, count):
    # (I - A) x = b with three channels; the error is at most the residual over 1 - |A|.
    matrix = _random(count, radius)
    right = np.random.default_rng(1).random((count, 3))
    result = solve_linear(lambda x: matrix @ x, right, tolerance=1e-10)
    exact = np.linalg.solve(np.eye(count) - matrix, right)
    assert result.outcome == "converged"
    assert np.abs(result.value - exact).max() < 1e-9 * count**0.5 * np.abs(right).max() / (1 - radius)


@pytest.mark.parametrize("name", sorted(set(SOLVERS) - {"overshooting", "CG, unsymmetrised", "ours"}))
@pytest.mark.parametrize("build", [cube, two_rooms])
def test_it_finds_what_the_classical_solvers_find(name, build):
    # B = E + rho H, rho .7, closed: all of them to 1e-8 of one another.
    system = build(3, 0.7)
    rho, emission = system.reflectance, system.emission
    result = solve_linear(lambda h: system.F @ (rho * h), system.F @ emission, tolerance=1e-11)
    classical = SOLVERS[name](system.F, rho, emission, system.areas, 1e-10, 2000).radiosity
    assert emission + rho * result.value == pytest.approx(classical, abs=1e-8 * emission.max())


def test_a_closed_furnace_fills_with_even_light():
    # E = 1, rho = .8, rows sum to 1: H = 5 everywhere.
    system = cube(4, 0.8)
    result = solve_linear(lambda h: system.F @ (0.8 * h), system.F @ np.ones(len(system.F)), tolerance=1e-10)
    assert result.value == pytest.approx(5, abs=1e-8)


def test_the_reported_residual_is_the_true_one():
    # |b - (I - A) x| / |b|, last of as many numbers as products were asked for.
    matrix, asked = _random(100, 0.95), []
    right = np.random.default_rng(2).random((100, 3))

    def apply(x):
        asked.append(1)
        return matrix @ x

    result = solve_linear(apply, right, tolerance=1e-5)
    residual = np.linalg.norm(right - result.value + matrix @ result.value) / np.linalg.norm(right)
    assert result.residuals[-1] == pytest.approx(residual, rel=1e-6)
    assert residual <= 1.01e-5
    assert result.products == len(asked)


@pytest.mark.parametrize("off", [0.0, 1e-3])
def test_it_goes_on_from_what_is_about_the_solution(off):
    # From the solution itself one product tells so; from near it fewer are needed than from zero; the end is the same.
    matrix, right = _random(200, 0.98), np.random.default_rng(2).random((200, 3))
    exact = np.linalg.solve(np.eye(200) - matrix, right)
    start = exact * (1 + off * np.random.default_rng(3).normal(size=exact.shape))
    from_zero = solve_linear(lambda x: matrix @ x, right, tolerance=1e-6)
    result = solve_linear(lambda x: matrix @ x, right, tolerance=1e-6, start=start)
    assert result.outcome == "converged"
    assert result.value == pytest.approx(exact, rel=1e-4)
    assert result.products == 1 if off == 0 else result.products < from_zero.products


def test_residuals_never_rise():
    # GMRES: the smallest residual of a growing space.
    matrix = _random(200, 0.99)
    result = solve_linear(lambda x: matrix @ x, np.random.default_rng(3).random(200), tolerance=1e-10)
    assert (np.diff(result.residuals[:-1]) <= 1e-12).all()


def test_a_closed_room_that_absorbs_nothing_stalls():
    # Rho 1: I - F is singular, and with power in there is no solution.
    system = cube(4, 1.0)
    result = solve_linear(lambda h: system.F @ h, system.F @ system.emission)
    assert result.outcome == "stalled"
    assert result.products < MOST_PRODUCTS
    assert result.residuals[-1] > 0.01


def test_more_modes_than_a_restart_holds_are_solved_in_more_than_one():
    # A cyclic shift of 90: eigenvalues all round a circle of radius .85, so that 30 products bring .85^30 = .0076.
    count = 90
    shift = 0.85 * np.roll(np.eye(count), 1, axis=0)
    right = np.random.default_rng(4).random(count)
    result = solve_linear(lambda x: shift @ x, right, tolerance=1e-8)
    assert result.outcome == "converged"
    assert 30 < result.products < MOST_PRODUCTS
    assert result.value == pytest.approx(np.linalg.solve(np.eye(count) - shift, right), rel=1e-5)


def test_many_slow_modes_with_little_in_them_are_left_once_the_rest_is_good_enough():
    # 2,000 modes as light in gaps between white boards has them, eigenvalues out to .999 and -.999, and 3,000 usual
    # ones: all others are right to a ten thousandth, for fewer products than the whole tolerance takes (219).
    random = np.random.default_rng(0)
    gap = 1 - np.geomspace(1e-3, 0.3, 1000)
    usual = random.uniform(0, 0.6, 3000)
    eigenvalue = np.concatenate([usual, gap, -gap])
    right = np.concatenate([random.uniform(0.5, 1, 3000), 0.03 * random.uniform(0, 1, 2000)])
    result = solve_linear(lambda x: eigenvalue * x, right, tolerance=1e-5)
    assert result.outcome == "converged"
    assert result.products < 190
    assert result.residuals[-1] <= GOOD_ENOUGH
    assert result.value[:3000] == pytest.approx(right[:3000] / (1 - usual), rel=1e-4)


def test_darkness_costs_no_product():
    # Right-hand side 0: the answer is 0.
    result = solve_linear(lambda x: x / 2, np.zeros((5, 3)))
    assert (result.value == 0).all()
    assert (result.outcome, result.products) == ("converged", 0)


def test_it_can_be_stopped_before_any_product():
    # The check raises: so does the solve.
    def check():
        raise Cancelled("cancelled")

    with pytest.raises(Cancelled):
        solve_linear(lambda x: x / 2, np.ones(3), check=check)
