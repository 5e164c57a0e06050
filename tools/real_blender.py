"""A real Blender 4.3.2 (Python 3.13, with a window) in a Debian root of its own, for the tests that need the program.

    python tools/real_blender.py provision          make the root; nothing to do if it is there (about two minutes)
    python tools/real_blender.py run -b --version   run its Blender; project and temporary folder keep their paths

The root lies at RADIOSITY_BLENDER_ROOT, by default /opt/blender-root. Both need to be root: the project is bound into
the Debian root inside a mount namespace of the process, so no mount outlives it.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[1]
SUITE = "trixie"
PACKAGES = ("blender", "python3-numpy", "xvfb", "xauth", "libgl1-mesa-dri", "imagemagick")
# What a whole root holds; the root is renamed into place only once it has all of it.
PARTS = ("usr/bin/blender", "usr/bin/Xvfb", "usr/bin/xauth", "usr/bin/import", "usr/lib/python3/dist-packages/numpy")
# With this set, a test that finds no Blender fails; it is skipped otherwise.
REQUIRE = "RADIOSITY_REQUIRE_BLENDER"

# $1 is the root; folders to bind up to "--"; then the command.
_ENTER = """
set -e
root=$1; shift
while [ "$1" != -- ]; do
    mkdir -p "$root$1"
    mount --rbind "$1" "$root$1"
    shift
done
shift
exec chroot "$root" "$@"
"""


class RealBlenderError(Exception):
    """The root can't be made or entered; the message says what to do."""


def root() -> Path:
    """Where the Debian root lies or will lie."""
    return Path(os.environ.get("RADIOSITY_BLENDER_ROOT", "/opt/blender-root"))


def is_whole(folder: Path) -> bool:
    """Whether the folder is a complete root."""
    # Debian's alternatives are absolute links, which lead somewhere only inside the root.
    return all(os.path.lexists(folder / part) for part in PARTS)


def reason_absent() -> str | None:
    """Why the real Blender can't be run here; None if it can."""
    if not is_whole(root()):
        return f"no real Blender at {root()}: run `python tools/real_blender.py provision` as root"
    if os.geteuid() != 0:
        return f"the real Blender at {root()} can be entered only as root"
    return None


def enter(folder: Path, binds: Sequence[Path], command: Sequence[str]) -> list[str]:
    """The command line that runs `command` inside the root, with the folders bound at their own paths."""
    bound = [str(path) for path in (Path("/proc"), Path("/sys"), Path("/dev"), *binds)]
    head = ["unshare", "--mount", "--propagation", "private", "sh", "-c", _ENTER, "sh"]
    return [*head, str(folder), *bound, "--", *command]


def blender_command(arguments: Sequence[str], program: Sequence[str] = ("blender",)) -> list[str]:
    """The command line that runs Blender (or `program`) with the project and the temporary folder in sight.

    Raises RealBlenderError where there is no Blender.
    """
    if reason := reason_absent():
        raise RealBlenderError(reason)
    return enter(root(), (Path(tempfile.gettempdir()), PROJECT), [*program, *arguments])


def environment(resources: Path, extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """A clean environment for Blender: nothing of the user's, resources in the given folder."""
    kept = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": str(resources), "LANG": "C.UTF-8"}
    kept |= {"TMPDIR": tempfile.gettempdir(), "BLENDER_USER_RESOURCES": str(resources), "LIBGL_ALWAYS_SOFTWARE": "1"}
    return kept | dict(extra or {})


def run(
    arguments: Sequence[str],
    resources: Path,
    timeout: float,
    program: Sequence[str] = ("blender",),
    extra: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run Blender to its end, or past `timeout` seconds end it and all that it started.

    Raises subprocess.TimeoutExpired, with what was printed so far.
    """
    process = subprocess.Popen(
        blender_command(arguments, program),
        env=environment(resources, extra),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        output, _ = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output, _ = process.communicate()
        raise subprocess.TimeoutExpired(process.args, timeout, output) from None
    return subprocess.CompletedProcess(process.args, process.returncode, output, "")


def provision() -> Path:
    """Make the root unless it is whole; its folder."""
    folder = root()
    if is_whole(folder):
        return folder
    if os.geteuid() != 0:
        raise RealBlenderError("making a Debian root needs root")
    if shutil.which("debootstrap") is None:
        raise RealBlenderError("debootstrap not found: run `apt-get install debootstrap`")
    if folder.exists():
        raise RealBlenderError(f"{folder} exists and is not whole: remove it, or set RADIOSITY_BLENDER_ROOT")
    partial = folder.with_name(folder.name + ".partial")
    shutil.rmtree(partial, ignore_errors=True)
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C"}
    steps = (
        ["debootstrap", "--variant=minbase", SUITE, str(partial)],
        enter(partial, (), ["apt-get", "update", "--quiet"]),
        enter(partial, (), ["apt-get", "install", "--quiet", "--yes", "--no-install-recommends", *PACKAGES]),
    )
    for step in steps:
        if subprocess.run(step, env=quiet, stdin=subprocess.DEVNULL, check=False).returncode:
            raise RealBlenderError(f"failed: {' '.join(step)}")
    if not is_whole(partial):
        raise RealBlenderError(f"{partial} lacks one of {', '.join(PARTS)}")
    partial.rename(folder)
    return folder


def main(arguments: Sequence[str]) -> int:
    """Command line: `provision`, or `run` with Blender's arguments."""
    try:
        if arguments[:1] == ["provision"]:
            print(f"real Blender: {provision()}")
            return 0
        if arguments[:1] == ["run"]:
            with tempfile.TemporaryDirectory(prefix="radiosity-blender-") as resources:
                command = blender_command(arguments[1:])
                return subprocess.run(command, env=environment(Path(resources)), check=False).returncode
    except RealBlenderError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(__doc__, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
