"""Build the extension, one zip a platform, into dist/ and check each: `python tools/package.py`.

Blender's own builder does it, which the bpy wheel carries; no Blender program is needed.
"""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
import tempfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DIST = ROOT / "dist"
# Bundled package -> its name at the start of a wheel's file name.
PACKAGES = ("embreex", "xatlas", "openexr")
ABIS = ("cp311", "cp313")
# Every folder of ours that a zip holds; all else stays out.
LAYERS = ("solver", "radiosity_addon", "operators")
# And every file beside them, but for the manifest.
FILES = ("__init__.py", "LICENSE", "THIRD_PARTY.md")


class PackageError(Exception):
    """A zip can't be built, or lacks something."""


def blender_ext() -> Path:
    """Blender's extension tool inside the bpy wheel."""
    spec = importlib.util.find_spec("bpy")
    folders = list(spec.submodule_search_locations or ()) if spec else []
    for folder in folders:
        for path in Path(folder).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"):
            return path
    raise PackageError("bpy is not installed in this Python: run `make setup`, then `make package`")


def run_blender_ext(*arguments: str) -> None:
    """Run the tool; its own words become the error."""
    command = [sys.executable, "-W", "ignore", str(blender_ext()), *arguments]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        raise PackageError(f"blender_ext.py {arguments[0]} failed:\n{result.stdout}{result.stderr}")


def read_manifest() -> dict[str, object]:
    """blender_manifest.toml as a dictionary."""
    with (ROOT / "blender_manifest.toml").open("rb") as file:
        return tomllib.load(file)


def check_manifest_against_lock() -> None:
    """Raise PackageError unless the manifest lists exactly the wheels of the lock, and all are there."""
    lock = (ROOT / "tools" / "wheels.lock").read_text(encoding="utf-8").splitlines()
    locked = {line.split()[-1] for line in lock if line and not line.startswith("#")}
    listed = {Path(str(wheel)).name for wheel in read_manifest()["wheels"]}  # type: ignore[attr-defined]
    if locked != listed:
        raise PackageError(f"blender_manifest.toml and tools/wheels.lock differ in {sorted(locked ^ listed)}")
    absent = [name for name in sorted(listed) if not (ROOT / "wheels" / name).is_file()]
    if absent:
        raise PackageError(f"not in wheels/: {', '.join(absent)}; run `python tools/wheels.py`")


def check_zip(path: Path) -> None:
    """Raise PackageError unless the zip has every package for every ABI, our files, and nothing of the workshop.

    Blender judges compatibility by the union of all wheels: with one package lacking an ABI it would still install,
    and fail at import.
    """
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    wheels = [Path(name).name.lower() for name in names if name.endswith(".whl")]
    for package in PACKAGES:
        for abi in ABIS:
            found = [wheel for wheel in wheels if wheel.startswith(f"{package}-") and f"-{abi}-{abi}-" in wheel]
            if len(found) != 1:
                raise PackageError(f"{path.name}: {len(found)} wheels of {package} for {abi}, not 1")
    if len(wheels) != len(PACKAGES) * len(ABIS):
        raise PackageError(f"{path.name}: {len(wheels)} wheels, not {len(PACKAGES) * len(ABIS)}")
    generated = {Path(name).name.lower() for name in manifest["build"]["generated"]["wheels"]}
    if generated != set(wheels):
        differing = sorted(generated ^ set(wheels))
        raise PackageError(f"{path.name}: its manifest and its content differ in {differing}")
    ours = {str(file.relative_to(ROOT).as_posix()) for layer in LAYERS for file in (ROOT / layer).rglob("*.py")}
    if absent := sorted({*ours, *FILES} - set(names)):
        raise PackageError(f"{path.name}: lacks {', '.join(absent)}")
    foreign = {name.split("/")[0] for name in names} - {*LAYERS, "wheels"}
    if foreign - {*FILES, "blender_manifest.toml"}:
        raise PackageError(f"{path.name}: holds files of the workshop: {sorted(foreign)}")


def build(dist: Path = DIST) -> list[Path]:
    """Build, validate and check; the zips, one a platform."""
    check_manifest_against_lock()
    manifest = read_manifest()
    dist.mkdir(parents=True, exist_ok=True)
    prefix = f"{manifest['id']}-{manifest['version']}"
    for old in dist.glob(f"{prefix}-*.zip"):
        old.unlink()
    with tempfile.TemporaryDirectory(prefix="radiosity-package-") as folder:
        # A folder that the manifest lets in is let in whole, compiled files too: so what is built from has none.
        for layer in LAYERS:
            shutil.copytree(ROOT / layer, Path(folder) / layer, ignore=shutil.ignore_patterns("__pycache__", "*.pyc"))
        for name in (*FILES, "blender_manifest.toml"):
            shutil.copy2(ROOT / name, folder)
        (Path(folder) / "wheels").symlink_to(ROOT / "wheels")
        run_blender_ext("build", "--source-dir", folder, "--output-dir", str(dist), "--split-platforms")
    zips = sorted(dist.glob(f"{prefix}-*.zip"))
    platforms = {str(platform).replace("-", "_") for platform in manifest["platforms"]}  # type: ignore[attr-defined]
    if {path.stem.removeprefix(f"{prefix}-") for path in zips} != platforms:
        raise PackageError(f"built {[path.name for path in zips]}, not one zip for each of {sorted(platforms)}")
    for path in zips:
        run_blender_ext("validate", str(path))
        check_zip(path)
    return zips


def main() -> int:
    """Command line; 1 if a zip can't be built or is not whole."""
    try:
        zips = build()
    except PackageError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    for path in zips:
        print(f"{path.relative_to(ROOT)}  {path.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
