"""The documentation tells the truth: files that it names exist, and the theory page's numbers are the benchmarks'."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from radiosity.benchmarks.form_factors.cases import BY_NAME
from radiosity.benchmarks.form_factors.methods import METHODS, NO_OCCLUDERS
from radiosity.benchmarks.form_factors.run import measure
from radiosity.benchmarks.linear.elements import EXACT as CUBE
from radiosity.benchmarks.linear.elements import coloured_floor, wall_means
from radiosity.benchmarks.linear.methods import SOLVERS
from radiosity.benchmarks.linear.systems import cube, two_rooms

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
# Folders of the repository that paths in the text may begin with; out/, build/ and dist/ are made.
FOLDERS = ("solver", "radiosity_addon", "operators", "tests", "benchmarks", "docs", "tools", "examples")
# A name without a folder may be of any of them. Without one, .csv and .json are files that a command writes.
NAMES = {path.name for folder in FOLDERS for path in (ROOT / folder).rglob("*.*")} | {
    path.name for path in ROOT.iterdir()}
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
QUOTED = re.compile(r"`([\w./-]+\.(?:py|md|csv|toml))`")
MODULE = re.compile(r"python -m (?:radiosity\.)?((?:benchmarks|tools)[\w.]*)")
CASES = ("P-01", "P-03", "P-05", "P-04", "P-14")
# Below this an error is rounding, which differs between machines.
ROUNDING = 1e-8


def rows(page: str, first: str) -> dict[str, list[str]]:
    """The cells of a table of a page by the first cell of each row; `first` begins the table's head."""
    lines = (ROOT / "docs" / page).read_text(encoding="utf-8").splitlines()
    begin = next(number for number, line in enumerate(lines) if line.startswith(f"| {first} |"))
    found = {}
    for line in lines[begin + 2:]:
        if not line.startswith("|"):
            break
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        found[name] = cells
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_file_that_a_page_names_exists(page):
    # Links, quoted paths, and modules of commands: none is missing.
    text = page.read_text(encoding="utf-8")
    missing = [link for link in LINK.findall(text) if "://" not in link and not (page.parent / link).exists()]
    for name in QUOTED.findall(text):
        folder = name.split("/")[0] if "/" in name else None
        if folder in FOLDERS:
            missing += [name] * (not (ROOT / name).exists())
        elif folder is None:
            missing += [name] * (name.endswith((".py", ".md", ".toml")) and name not in NAMES)
    for module in MODULE.findall(text):
        path = ROOT / module.replace(".", "/")
        missing += [module] * (not (path.is_dir() or path.with_suffix(".py").is_file()))
    assert missing == []


def test_every_case_of_the_catalogue_has_an_exact_answer_and_holds():
    # P-01 to P-50 and S-1 to S-22: at least one row each, and no row that fails.
    page = (ROOT / "docs" / "validation.md").read_text(encoding="utf-8")
    told = {(kind, int(number)) for kind, number in re.findall(r"^\| ([PS])-(\d+)", page, re.MULTILINE)}
    assert told == {("P", number) for number in range(1, 51)} | {("S", number) for number in range(1, 23)}
    assert "FAILS" not in page


@pytest.mark.parametrize("method", METHODS)
def test_the_theory_page_has_the_form_factor_methods_errors(method):
    # 4,096 samples on five cases, two digits: as measured, to half of the last digit; rounding errors stay such.
    told = rows("theory.md", "method | unit squares, gap 1")[method]
    for name, cell in zip(CASES, told, strict=True):
        case = BY_NAME[name]
        assert (cell == "-") == bool(case.occluders and method in NO_OCCLUDERS)
        if cell != "-":
            error = measure(case, method, 4096)[1]
            assert float(f"{error:.2g}") == pytest.approx(float(cell), rel=0.06) or max(error, float(cell)) < ROUNDING


@pytest.mark.parametrize("solver", ["Jacobi", "Gauss-Seidel", "Chebyshev", "CG", "ours"])
def test_the_theory_page_has_the_solvers_products(solver):
    # 384 patches of a cube at rho .5, .9, .99 and 766 of two rooms at .99, to a residual of 1e-4: as counted.
    told = rows("theory.md", r"solver | cube, $\rho = .5$")[solver]
    systems = [cube(8, 0.5), cube(8, 0.9), cube(8, 0.99), two_rooms(8, 0.99)]
    for system, cell in zip(systems, told, strict=True):
        result = SOLVERS[solver](system.F, system.reflectance, system.emission, system.areas, 1e-4, 1000)
        assert round(result.products) == pytest.approx(int(cell), abs=1)


@pytest.mark.parametrize("solver", ["shooting", "overshooting", "overshooting, mended"])
def test_the_theory_page_has_the_shooters_work(solver):
    # The cube at rho .5; at .9 plain overshooting has not converged after 100 products' worth of shots.
    told = rows("theory.md", r"solver | cube, $\rho = .5$")[solver]
    for reflectance, cell in zip((0.5, 0.9), told[:2], strict=True):
        system = cube(8, reflectance)
        result = SOLVERS[solver](system.F, system.reflectance, system.emission, system.areas, 1e-4, 100)
        if cell == "-":
            assert result.residuals[-1] > 1e-2
        else:
            assert round(result.products) == pytest.approx(int(cell), abs=1)


def test_the_theory_page_has_the_elements_errors_and_the_colours():
    # Exact: the continuous solution of the cube (P-39). n x n constant elements, floor, ceiling and side at rho .5; and
    # the irradiance of the floor beside the red wall, in the middle, beside the green wall.
    for side, name in ((1, "1 x 1"), (4, "4 x 4"), (16, "16 x 16")):
        told = [cell.removesuffix(" %") for cell in rows("theory.md", "elements a wall")[name]]
        found = 100 * (wall_means(side, 0.5) / CUBE[0.5] - 1)
        assert found == pytest.approx([float(cell) for cell in told], abs=0.006)
    colours, floor = rows("theory.md", "| red | green | blue"), coloured_floor(9)
    for name, place in (("beside the red wall", 0), ("in the middle", 4), ("beside the green wall", 8)):
        assert floor[place] == pytest.approx([float(cell) for cell in colours[name]], abs=0.0006)
