"""What tests of relighting share: a small scene that keeps a light group for its lamp, and its bake."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest
from radiosity import operators


@pytest.fixture
def stage(build: Any, tmp_path: Path) -> Iterator[Any]:
    """A saved file with a square alone under a sun of 1 W/m2, to be baked quickly, with a group for each lamp."""
    operators.register()
    build.sun()
    square = build.mesh("Square", material=(0.5, 0.5, 0.5))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    settings = bpy.context.scene.radiosity
    settings.error, settings.resolution, settings.groups = 0.2, 32, "lamp"
    assert square
    yield build
    operators.unregister()


@pytest.fixture(scope="session")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where `baked` keeps its file for the next test."""
    return tmp_path_factory.mktemp("baked") / "template"


@pytest.fixture
def baked(stage: Any, template: Path, tmp_path: Path) -> Any:
    """The stage after a bake, which is done once for all tests."""
    if not template.exists():
        bpy.ops.radiosity.bake()
        bpy.ops.wm.save_mainfile()
        shutil.copytree(tmp_path, template)
    else:
        shutil.copytree(template, tmp_path, dirs_exist_ok=True)
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    return stage
