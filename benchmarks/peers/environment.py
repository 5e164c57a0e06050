"""The environment of the peers, .venv-peers: made on demand, apart from the project's own.

    python -m benchmarks.peers.environment          make it, or say what is in it

What can't be installed is told and left out; the charts then lack that curve and say so.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(os.environ.get("RADIOSITY_PEERS", ROOT / ".venv-peers"))
REQUIREMENTS = ROOT / "tools" / "requirements-peers.txt"

# Mitsuba 3.9 compiles its kernels with LLVM; versions 14 and 15 end with "Cannot select: f32 = fmaximum".
LLVM = 19
# A peer that says nothing for so long is given up, seconds.
PATIENCE = 1800.0


class PeerError(RuntimeError):
    """A peer is not there, or failed; the message says which, what it said, and what to do."""


def python() -> Path:
    """The interpreter of the peers' environment, which may not exist."""
    return FOLDER / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def wanted() -> list[str]:
    """The pinned packages, one requirement each."""
    lines = [line.strip() for line in REQUIREMENTS.read_text().splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


def make() -> list[str]:
    """Make the environment and install each package that is missing; the requirements that could not be installed."""
    if not python().is_file():
        venv.create(FOLDER, with_pip=True)
    failed = []
    for requirement in wanted():
        if not has(requirement.split("==")[0]):
            done = subprocess.run([str(python()), "-m", "pip", "install", "--quiet", requirement], check=False)
            failed += [requirement] * (done.returncode != 0)
    return failed + [f"LLVM {LLVM} (set DRJIT_LIBLLVM_PATH to its library)"] * (not _fetch_llvm())


def llvm() -> Path | None:
    """The LLVM library that Mitsuba compiles with: DRJIT_LIBLLVM_PATH, or the one that `make` put here; or None."""
    given = os.environ.get("DRJIT_LIBLLVM_PATH")
    found = [Path(given)] if given else sorted((FOLDER / "llvm").glob(f"usr/lib/*/libLLVM.so.{LLVM}*"))
    return found[0] if found else None


def _fetch_llvm() -> bool:
    """Unpack Debian's LLVM into the environment, installing nothing; whether it is there."""
    if llvm() is None and shutil.which("apt-get") and shutil.which("dpkg-deb"):
        place = FOLDER / "llvm"
        place.mkdir(parents=True, exist_ok=True)
        if not subprocess.run(["apt-get", "download", f"libllvm{LLVM}"], cwd=place, check=False).returncode:
            for package in place.glob("*.deb"):
                subprocess.run(["dpkg-deb", "-x", str(package), str(place)], check=False)
                package.unlink()
    return llvm() is not None


def has(package: str) -> bool:
    """Whether a package is installed there."""
    return any(packages().glob(f"{package.replace('-', '_')}-*.dist-info"))


def packages() -> Path:
    """The environment's folder of packages; one that does not exist if there is no environment."""
    found = sorted(FOLDER.glob("lib/python3*/site-packages")) or [FOLDER / "Lib" / "site-packages"]
    return found[0]


def require(package: str) -> None:
    """Raise PeerError unless `package` is installed in the peers' environment."""
    if not has(package):
        raise PeerError(f"{package} is not installed: run python -m benchmarks.peers.environment")


def run(script: Path, request: dict[str, Any], folder: Path, patience: float = PATIENCE) -> dict[str, Any]:
    """Run a script of this folder in the peers' environment; request and answer are files of JSON in `folder`.

    Raises
    ------
    PeerError
        With the last line that the script said.
    """
    folder.mkdir(parents=True, exist_ok=True)
    asked, answered = folder / f"{script.stem}_request.json", folder / f"{script.stem}_answer.json"
    asked.write_text(json.dumps(request))
    answered.unlink(missing_ok=True)
    command = [str(python()), str(script), str(asked), str(answered)]
    # The project's own packages must not leak in.
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    if library := llvm():
        variables["DRJIT_LIBLLVM_PATH"] = str(library)
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, env=variables,
                              timeout=patience)
    except subprocess.TimeoutExpired as problem:
        raise PeerError(f"{script.stem} took more than {patience:.0f} s: given up") from problem
    if done.returncode or not answered.is_file():
        said = (done.stderr.strip() or done.stdout.strip() or "nothing").splitlines()
        raise PeerError(f"{script.stem} ended with code {done.returncode} and said: {said[-1]}")
    answer: dict[str, Any] = json.loads(answered.read_text())
    return answer


def main() -> int:
    """Command line; 1 if a package could not be installed."""
    failed = make()
    for requirement in failed:
        print(f"{requirement}: could not be installed; its curves will be missing", file=sys.stderr)
    print(f"{FOLDER}: {', '.join(r for r in wanted() if r not in failed)}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
