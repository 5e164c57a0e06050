"""Fetch the wheels that the extension bundles into wheels/, each checked against the hash in tools/wheels.lock.

    python tools/wheels.py              fetch what is missing, check everything
    python tools/wheels.py --update     fetch anew and rewrite the lock (after a change of PACKAGES)
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "tools" / "wheels.lock"
FOLDER = ROOT / "wheels"

PACKAGES = ("embreex==4.4.0.post1", "xatlas==0.0.11", "OpenEXR==3.5.3")
# Blender 4.2 to 5.0 carry Python 3.11, 5.1 and later 3.13.
PYTHONS = ("3.11", "3.13")
# Blender's name of a platform, and the wheel tags that run on it (Blender itself asks for glibc 2.28;
# embreex's wheels for macOS 13).
PLATFORMS = {
    "linux-x64": ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_13_0_arm64",),
    "macos-x64": ("macosx_13_0_x86_64",),
}


class WheelError(Exception):
    """A wheel can't be had, or is not the one that the lock names."""


@dataclass(frozen=True)
class Locked:
    """One line of the lock."""

    platform: str
    python: str
    sha256: str
    name: str

    @property
    def path(self) -> Path:
        """Where the wheel lies once it is fetched."""
        return FOLDER / self.name


def read_lock() -> list[Locked]:
    """Every wheel that the lock names."""
    lines = LOCK.read_text(encoding="utf-8").splitlines()
    return [Locked(*line.split()) for line in lines if line and not line.startswith("#")]


def write_lock(wheels: list[Locked]) -> None:
    """Write the lock, in the order of platform, Python and name."""
    head = "# Made by tools/wheels.py --update: Blender's platform, Python, SHA-256, file.\n"
    lines = sorted(f"{wheel.platform} {wheel.python} {wheel.sha256} {wheel.name}\n" for wheel in wheels)
    LOCK.write_text(head + "".join(lines), encoding="utf-8")


def sha256(path: Path) -> str:
    """The file's SHA-256, 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def download(platform: str, python: str, folder: Path) -> None:
    """Download all packages for one platform and one Python.

    Raises WheelError if pip finds none.
    """
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary", ":all:"]
    command += ["--implementation", "cp", "--python-version", python, "--abi", "cp" + python.replace(".", "")]
    for tag in PLATFORMS[platform]:
        command += ["--platform", tag]
    result = subprocess.run([*command, "--dest", str(folder), *PACKAGES], capture_output=True, text=True, check=False)
    if result.returncode:
        raise WheelError(f"{platform}, Python {python}: pip found no wheel\n{result.stderr.strip()}")


def check(wheel: Locked) -> None:
    """Raise WheelError unless the fetched file is the one that the lock names."""
    if not wheel.path.is_file():
        raise WheelError(f"{wheel.name}: absent after the download; run tools/wheels.py --update, then read the lock")
    found = sha256(wheel.path)
    if found != wheel.sha256:
        raise WheelError(
            f"{wheel.path}: its SHA-256 is {found}, but tools/wheels.lock says {wheel.sha256}. "
            "Remove the file and run again; if it stays different, the registry serves another file: do not use it."
        )


def fetch() -> list[Locked]:
    """Fetch what is missing and check all; the wheels that the lock names."""
    FOLDER.mkdir(exist_ok=True)
    wheels = read_lock()
    missing = {(wheel.platform, wheel.python) for wheel in wheels if not wheel.path.is_file()}
    for platform, python in sorted(missing):
        print(f"fetching {', '.join(PACKAGES)} for {platform}, Python {python}", flush=True)
        download(platform, python, FOLDER)
    for wheel in wheels:
        check(wheel)
    return wheels


def update() -> list[Locked]:
    """Fetch every wheel anew and write the lock from what came."""
    wheels = []
    for platform in PLATFORMS:
        for python in PYTHONS:
            folder = FOLDER / platform / python
            download(platform, python, folder)
            for path in sorted(folder.iterdir()):
                wheels.append(Locked(platform, python, sha256(path), path.name))
                path.replace(FOLDER / path.name)
            folder.rmdir()
        (FOLDER / platform).rmdir()
    write_lock(wheels)
    return wheels


def main() -> int:
    """Command line; 1 if a wheel is missing or differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--update", action="store_true", help="rewrite tools/wheels.lock")
    arguments = parser.parse_args()
    try:
        wheels = update() if arguments.update else fetch()
    except WheelError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{len(wheels)} wheels in {FOLDER.relative_to(ROOT)}/, all as in tools/wheels.lock")
    return 0


if __name__ == "__main__":
    sys.exit(main())
