"""The chart of Phong against data: the fit finds what is there, and the documentation has its numbers."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest
from radiosity.benchmarks.brdf import run
from radiosity.benchmarks.brdf.synthetic import SURFACES, write_merl
from radiosity.solver.brdf import Phong

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def paint(tmp_path_factory):
    """The matte paint as a file of MERL's format."""
    path = tmp_path_factory.mktemp("merl") / "matte paint.binary"
    write_merl(path, SURFACES[1])
    return path


def test_the_fit_of_a_phong_is_itself():
    # k_d .3, k_s .2, n 25: found again to .1 %, no distance left.
    found, distance = run.fit_phong(Phong(0.3, 0.2, 25))
    assert np.mean(found.diffuse) == pytest.approx(0.3, rel=1e-3)
    assert np.mean(found.specular) == pytest.approx(0.2, rel=1e-3)
    assert found.exponent == pytest.approx(25, rel=1e-3)
    assert distance < 1e-4


def test_a_file_of_ones_own_is_charted_and_the_documented_row_comes_out(paint, tmp_path, monkeypatch, capsys):
    # The matte paint by way of a file: a picture, and docs/brdf.csv's row to 2 %.
    monkeypatch.setattr(sys, "argv", ["run", "--merl", str(paint), "--output", str(tmp_path / "out" / "mine")])
    run.main()
    assert capsys.readouterr().out.startswith("matte paint")
    with (tmp_path / "out" / "mine.csv").open() as mine, (DOCS / "brdf.csv").open() as kept:
        (found,) = csv.DictReader(mine)
        told = next(row for row in csv.DictReader(kept) if row["surface"] == "matte paint")
    for column in run.COLUMNS[1:]:
        assert float(found[column]) == pytest.approx(float(told[column]), rel=0.02)
    assert (tmp_path / "out" / "mine.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_s_table_is_the_csv_file():
    # Surface by surface: k_d, k_s, n, distance, reflectances, residuals, and even light.
    page = (DOCS / "brdf.md").read_text(encoding="utf-8")
    with (DOCS / "brdf.csv").open() as file:
        for row in csv.DictReader(file):
            name, *numbers = row.values()
            line = next(line for line in page.splitlines() if line.startswith(f"| {name} |"))
            told = [float(number) for cell in line.strip("|").split("|")[1:] for number in cell.split(",")]
            assert told == [float(number) for number in numbers]
