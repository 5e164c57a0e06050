"""Arrows point one way, and each foreign library has one door; read from the syntax trees, nothing is imported."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("solver", "radiosity_addon", "operators")
ALLOWED = {
    "solver": {"solver"},
    "radiosity_addon": {"solver", "radiosity_addon"},
    "operators": {"solver", "radiosity_addon", "operators"},
}
# A foreign library, and the one file that may import it.
DOORS = {
    "embreex": "solver/visibility.py",
    "xatlas": "solver/unwrap.py",
    "OpenEXR": "solver/image_file.py",
}
BLENDER = {"bpy", "bmesh", "mathutils", "gpu", "bpy_extras", "addon_utils", "blf"}
# In Blender's Python too, but only in tests, benchmarks and the library's own environment.
DEVELOPMENT = {"scipy", "mpmath", "matplotlib", "pytest", "PIL"}


def package_files(layer: str) -> list[Path]:
    return sorted((ROOT / layer).rglob("*.py"))


def syntax_tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def imports(path: Path) -> Iterator[tuple[int, str, int]]:
    """Yields (level, dotted name, line); level 0 is absolute. `from .. import solver` yields (2, "solver", line)."""
    for node in ast.walk(syntax_tree(path)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield 0, alias.name, node.lineno
        elif isinstance(node, ast.ImportFrom):
            if node.module:
                yield node.level, node.module, node.lineno
            else:
                for alias in node.names:
                    yield node.level, alias.name, node.lineno


def layer_of_import(path: Path, level: int, name: str) -> str | None:
    """The layer that a relative import of `path` leads to; None for an absolute import."""
    if level == 0:
        return None
    folder = path.relative_to(ROOT).parent.parts
    target = (*folder[: len(folder) - (level - 1)], *name.split("."))
    return target[0] if target else None


@pytest.mark.parametrize("layer", LAYERS)
def test_arrows_point_from_operators_to_addon_to_solver(layer: str) -> None:
    # No scene. Exact answer: no import of a layer leads to a layer above it.
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {target}"
        for path in package_files(layer)
        for level, name, line in imports(path)
        if (target := layer_of_import(path, level, name)) in {*LAYERS, "tests", "benchmarks", "tools", "examples"}
        and target not in ALLOWED[layer]
    ]
    assert wrong == []


@pytest.mark.parametrize("layer", LAYERS)
def test_imports_of_our_own_files_are_relative(layer: str) -> None:
    # Inside Blender the package is bl_ext.<repository>.radiosity_lightmaps: an absolute name would find nothing.
    ours = {*LAYERS, "radiosity"}
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in package_files(layer)
        for level, name, line in imports(path)
        if level == 0 and name.split(".")[0] in ours
    ]
    assert wrong == []


def test_solver_never_sees_blender() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in package_files("solver")
        for level, name, line in imports(path)
        if level == 0 and name.split(".")[0] in BLENDER
    ]
    assert wrong == []


@pytest.mark.parametrize("library", sorted(DOORS))
def test_each_foreign_library_is_imported_by_one_file(library: str) -> None:
    importers = {
        path.relative_to(ROOT).as_posix()
        for layer in LAYERS
        for path in package_files(layer)
        for level, name, _ in imports(path)
        if level == 0 and name.split(".")[0] == library
    }
    assert importers == {DOORS[library]}


@pytest.mark.parametrize("layer", LAYERS)
def test_a_run_needs_nothing_but_numpy_and_the_wheels(layer: str) -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in package_files(layer)
        for level, name, line in imports(path)
        if level == 0 and name.split(".")[0] in DEVELOPMENT
    ]
    assert wrong == []


def attribute_chain(node: ast.AST) -> str:
    """`bpy.app.version` for that expression, "" for anything but names and attributes."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else ""


def test_one_file_asks_for_the_version_of_blender() -> None:
    askers = {
        path.relative_to(ROOT).as_posix()
        for layer in LAYERS
        for path in package_files(layer)
        for node in ast.walk(syntax_tree(path))
        if attribute_chain(node).startswith("bpy.app.version")
    }
    assert askers <= {"radiosity_addon/compat.py"}


def test_blenders_own_operators_are_called_where_there_is_no_other_way() -> None:
    # Baking with Cycles, opening and saving files, and leaving Edit Mode exist only as operators; and only an operator
    # of ours may look after work in a window, where Live starts it. One file for each.
    callers = {
        (path.relative_to(ROOT).as_posix(), family)
        for layer in LAYERS
        for path in package_files(layer)
        for node in ast.walk(syntax_tree(path))
        for family in [".".join(attribute_chain(node).split(".")[:3])]
        if family.startswith("bpy.ops.")
    }
    assert callers <= {
        ("radiosity_addon/cycles.py", "bpy.ops.render"),
        ("radiosity_addon/cycles.py", "bpy.ops.object"),
        ("radiosity_addon/blend_file.py", "bpy.ops.wm"),
        ("radiosity_addon/blend_file.py", "bpy.ops.object"),
        ("operators/relight.py", "bpy.ops.radiosity"),
    }


def test_nothing_happens_when_the_root_is_imported() -> None:
    # pytest and the library read the root's __init__.py; it may import siblings and bpy only inside its functions.
    top = [node for node in syntax_tree(ROOT / "__init__.py").body if isinstance(node, ast.Import | ast.ImportFrom)]
    names = {alias.name for node in top if isinstance(node, ast.Import) for alias in node.names}
    names |= {"." * node.level + str(node.module) for node in top if isinstance(node, ast.ImportFrom)}
    assert names <= {"__future__", "importlib", "importlib.util", "types", "typing"}
