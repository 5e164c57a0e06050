"""What all tests share: an empty folder for Blender's user files, the real Blender, and the built zips."""

from __future__ import annotations

import atexit
import os
import shutil
import tempfile
from pathlib import Path

import pytest
from radiosity.tools import package, real_blender, wheels

# Before the first import of bpy: it would put the wheels of the user's own extensions ahead of this environment's.
_RESOURCES = tempfile.mkdtemp(prefix="radiosity-tests-")
atexit.register(shutil.rmtree, _RESOURCES, ignore_errors=True)
os.environ["BLENDER_USER_RESOURCES"] = _RESOURCES


@pytest.fixture(scope="session", name="real_blender")
def real_blender_() -> None:
    """Skips where there is no real Blender, and fails instead where RADIOSITY_REQUIRE_BLENDER is set."""
    if reason := real_blender.reason_absent():
        if os.environ.get(real_blender.REQUIRE):
            pytest.fail(f"{reason} ({real_blender.REQUIRE} is set)")
        pytest.skip(reason)


@pytest.fixture(scope="session")
def locked_wheels() -> list[wheels.Locked]:
    """The wheels of the lock, fetched and checked."""
    return wheels.fetch()


@pytest.fixture(scope="session")
def zips(locked_wheels: list[wheels.Locked], tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The extension's zips, one a platform, built from the checkout as it stands."""
    assert locked_wheels
    return package.build(tmp_path_factory.mktemp("dist"))


@pytest.fixture(scope="session")
def linux_zip(zips: list[Path]) -> Path:
    """The zip for this machine."""
    return next(path for path in zips if path.stem.endswith("linux_x64"))
