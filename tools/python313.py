"""Run the solver's tests in Python 3.13 with NumPy 2, as in Blender 5.1 and later: `python tools/python313.py [ARGS]`.

Python 3.13 and NumPy come with the real Blender's Debian root; all else is unpacked into build/python313.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from radiosity.tools import real_blender, wheels

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ROOT / "build" / "python313"
# The link `radiosity` in it leads to the root; `make check` has it too.
LINK = ROOT / "build" / "types" / "radiosity"
# Left to Debian: NumPy. Not needed by the solver's tests: Blender, lint, charts.
NAMES = ("pytest", "pytest-timeout", "iniconfig", "packaging", "pluggy", "Pygments", "scipy", "mpmath",
         "embreex", "xatlas", "OpenEXR")


def pinned() -> list[str]:
    """The requirements of NAMES, as `make setup` has them."""
    lines = (ROOT / "tools" / "requirements.txt").read_text(encoding="utf-8").splitlines()
    pins = {line.split("==")[0].lower(): line for line in lines if "==" in line}
    return [pins[name.lower()] for name in NAMES]


def install() -> None:
    """Unpack the packages, unless those of the same pins are there."""
    stamp = PACKAGES / ".pins"
    wanted = "\n".join(pinned())
    if stamp.is_file() and stamp.read_text(encoding="utf-8") == wanted:
        return
    shutil.rmtree(PACKAGES, ignore_errors=True)
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--only-binary", ":all:"]
    command += ["--implementation", "cp", "--python-version", "3.13", "--abi", "cp313", "--target", str(PACKAGES)]
    for tag in wheels.PLATFORMS["linux-x64"]:
        command += ["--platform", tag]
    subprocess.run([*command, *pinned()], check=True)
    stamp.write_text(wanted, encoding="utf-8")


def main(arguments: list[str]) -> int:
    """Command line; the exit code is pytest's."""
    if reason := real_blender.reason_absent():
        print(f"error: {reason}", file=sys.stderr)
        return 1
    install()
    LINK.parent.mkdir(parents=True, exist_ok=True)
    if not LINK.is_symlink():
        LINK.symlink_to(Path("..") / "..")
    with tempfile.TemporaryDirectory(prefix="radiosity-python313-") as folder:
        command = real_blender.blender_command(
            ["-m", "pytest", "-p", "no:cacheprovider", "--rootdir", str(ROOT), "-c", str(ROOT / "pyproject.toml"),
             "tests/solver", *arguments],
            program=("env", f"--chdir={ROOT}", "python3"),
        )
        extra = {"PYTHONPATH": f"{PACKAGES}:{LINK.parent}", "PYTHONDONTWRITEBYTECODE": "1"}
        return subprocess.run(command, env=real_blender.environment(Path(folder), extra), check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
