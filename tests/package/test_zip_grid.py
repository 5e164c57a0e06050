"""The zips that `make package` builds: whole for every platform and both Pythons, and refused when they are not."""

from __future__ import annotations

import shutil
import zipfile
from pathlib import Path

import pytest
from radiosity.tools import package, wheels


def copy_without(source: Path, target: Path, left_out: str) -> None:
    """The zip without the files whose name holds `left_out`."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for item in old.infolist():
            if left_out not in item.filename:
                new.writestr(item, old.read(item))


def test_every_platform_of_the_manifest_gets_one_zip(zips: list[Path]) -> None:
    # Four platforms; build() has validated each and counted 3 packages x 2 ABIs in it.
    assert [path.stem.split("-")[-1] for path in zips] == ["linux_x64", "macos_arm64", "macos_x64", "windows_x64"]


def test_a_zip_holds_nothing_of_the_workshop(zips: list[Path]) -> None:
    for path in zips:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
        assert not [name for name in names if "__pycache__" in name or name.endswith((".pyc", ".blend", ".exr"))]
        assert not [name for name in names if name.startswith(("tests", "benchmarks", "tools", "docs", ".", "out"))]


@pytest.mark.parametrize("left_out", ["embreex-4.4.0.post1-cp313", "xatlas-0.0.11-cp311", "openexr-3.5.3-cp313"])
def test_a_zip_that_lacks_one_wheel_is_refused(zips: list[Path], tmp_path: Path, left_out: str) -> None:
    # Blender would call it compatible (the union over all wheels), skip the wheel and fail at import.
    broken = tmp_path / zips[0].name
    copy_without(zips[0], broken, left_out)
    with pytest.raises(package.PackageError, match="0 wheels of"):
        package.check_zip(broken)


def test_a_zip_that_lacks_a_file_of_ours_is_refused(zips: list[Path], tmp_path: Path) -> None:
    broken = tmp_path / zips[0].name
    copy_without(zips[0], broken, "solver/scene.py")
    with pytest.raises(package.PackageError, match=r"lacks solver/scene\.py"):
        package.check_zip(broken)


def test_a_wheel_with_another_hash_is_refused_with_both_hashes(
    locked_wheels: list[wheels.Locked], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # One byte more than the wheel that the lock names.
    smallest = min(locked_wheels, key=lambda wheel: wheel.path.stat().st_size)
    shutil.copy(smallest.path, tmp_path / smallest.name)
    with (tmp_path / smallest.name).open("ab") as file:
        file.write(b"x")
    monkeypatch.setattr(wheels, "FOLDER", tmp_path)
    with pytest.raises(wheels.WheelError, match=smallest.sha256) as caught:
        wheels.check(smallest)
    assert wheels.sha256(tmp_path / smallest.name) in str(caught.value)


def test_the_lock_has_every_package_for_every_platform_and_python(locked_wheels: list[wheels.Locked]) -> None:
    # 4 platforms x 2 Pythons x 3 packages, each once.
    grid = {(wheel.platform, wheel.python, wheel.name.split("-")[0]) for wheel in locked_wheels}
    assert grid == {
        (platform, python, name)
        for platform in wheels.PLATFORMS
        for python in wheels.PYTHONS
        for name in package.PACKAGES
    }
    assert len(locked_wheels) == len(grid)
