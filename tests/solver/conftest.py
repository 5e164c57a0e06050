"""The table of exact answers: a test that knows one asks for `validation`, which judges and writes the row down.

The rows of a run go to out/validation.md; `python tools/validation.py` keeps docs/validation.md up to it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from radiosity.tests.solver.stability import Failures

TABLE = Path(__file__).resolve().parents[2] / "out" / "validation.md"
# An estimate may lie this many of its standard errors from the truth.
STANDARD_ERRORS = 4.0

HEADER = """# Exact answers, and ours

Written by the tests (`tests/solver/conftest.py`). A value without a standard error must agree to the relative error
allowed; one with a standard error must lie within four of them, plus the relative error allowed for the exact value's
own digits. What S-1 to S-22 break is told in [stability.md](stability.md).

| case | quantity | exact | ours | standard error | deviation | allowed | verdict |
|---|---|---|---|---|---|---|---|
"""


class Row(NamedTuple):
    case: str
    quantity: str
    exact: float
    ours: float
    standard_error: float
    relative: float

    @property
    def allowed(self) -> float:
        return abs(self.exact) * self.relative + STANDARD_ERRORS * self.standard_error

    @property
    def holds(self) -> bool:
        return abs(self.ours - self.exact) <= self.allowed

    def line(self) -> str:
        error = f"{self.standard_error:.1e}" if self.standard_error else "0"
        return (f"| {self.case} | {self.quantity} | {self.exact:.10g} | {self.ours:.10g} | {error} "
                f"| {abs(self.ours - self.exact):.1e} | {self.allowed:.1e} | {'holds' if self.holds else 'FAILS'} |\n")


class Validation:
    """Call it with what is known and what came out: it keeps the row, and fails the test if the row doesn't hold."""

    def __init__(self) -> None:
        self.rows: list[Row] = []

    def __call__(self, case: str, quantity: str, exact: float, ours: float, standard_error: float = 0.0,
                 relative: float = 1e-8) -> None:
        row = Row(case, quantity, float(exact), float(ours), float(standard_error), relative)
        self.rows.append(row)
        assert row.holds, f"{case}, {quantity}: {ours!r} is not {exact!r} (allowed {row.allowed:.1e})"


def _in_order(row: Row) -> list[tuple[int, str]]:
    """P-2 before P-10: numbers in the name count as numbers."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", row.case)]


@pytest.fixture(scope="session")
def validation() -> Iterator[Validation]:
    """Keeps a row for every exact answer: validation(case, quantity, exact, ours, standard_error, relative)."""
    collected = Validation()
    yield collected
    if collected.rows:
        TABLE.parent.mkdir(exist_ok=True)
        lines = [row.line() for row in sorted(collected.rows, key=_in_order)]
        TABLE.write_text(HEADER + "".join(lines), encoding="utf-8")


@pytest.fixture
def judge(validation: Validation) -> Callable[..., None]:
    """Hold answers (times, n) to exact values (n,): all to `error` (RMS), the mean of each point's to a third of it.

    judge(case, quantities, exact, ours, error, truncation): `truncation` is what the scene's own shape is off by,
    relative to the exact values' mean.
    """
    def check(case: str, quantities: Sequence[str], exact: Any, ours: Any, error: float,
              truncation: float = 0.0) -> None:
        exact = np.asarray(exact, float)
        level = exact.mean()
        deviation = np.sqrt(np.mean((ours - exact) ** 2)) / level
        assert deviation <= error + truncation, f"{case}: RMS error {deviation:.4f}, wanted {error}"
        noise = ours.std(axis=0, ddof=1) / np.sqrt(len(ours))
        for quantity, right, found, sigma in zip(quantities, exact, ours.mean(axis=0), noise, strict=True):
            validation(case, quantity, right, found, sigma, relative=(error / 3 + truncation) * level / right)
    return check


@pytest.fixture(scope="session")
def failures() -> Iterator[Failures]:
    """What classical methods were measured to do; written down at the end."""
    collected = Failures()
    yield collected
    if collected.rows:
        collected.write()


@pytest.fixture
def stability(request: pytest.FixtureRequest, failures: Failures) -> Callable[[str, str, float, float], None]:
    """Keeps a row of docs/stability.md: stability(case, method, its error, our error)."""
    return partial(failures.add, request.node.originalname)
