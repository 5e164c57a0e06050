"""Bake whole scenes as they come, and put a picture and a row of figures of each into the documentation.

    python tools/gallery.py FOLDER                        every FOLDER/NAME/NAME.blend, default settings
    python tools/gallery.py FOLDER --only NAME ...        some of them; the other rows stay as they are
    python tools/gallery.py FOLDER --options "--error .1" with other options of `radiosity bake`
    python tools/gallery.py FOLDER --write                no bake: pictures and rows of what out/gallery holds

Each scene gets a folder out/gallery/NAME with what `radiosity bake` writes; docs/scenes/NAME.png is its picture by
lightmaps alone (tools/picture.py), and docs/scenes.md gets its row. No seconds: they tell of the machine.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from radiosity.tools.page_table import with_rows

ROOT = Path(__file__).resolve().parents[1]
PAGE, PICTURES, OUT = ROOT / "docs" / "scenes.md", ROOT / "docs" / "scenes", ROOT / "out" / "gallery"
# Pixels of the longer side of a picture.
SIDE = 480
# Exit codes of a bake that wrote its results: the second did not reach the wanted error.
WRITTEN = (0, 4)
HEAD = ("scene", "options", "triangles", "lumels", "patches", "rays", "error wanted", "estimated", "energy", "warnings")


def bake(blend: Path, folder: Path, options: list[str]) -> int:
    """Bake a .blend into a folder as a user would; the exit code."""
    folder.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "radiosity", "bake", str(blend), "--output", str(folder),
               "--save", str(folder / "baked.blend"), "--report", str(folder / "report.json"), *options]
    with (folder / "bake.log").open("w", encoding="utf-8") as log:
        code = subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, check=False).returncode
    (folder / "options.txt").write_text(shlex.join(options), encoding="utf-8")
    return code


def take_picture(folder: Path, picture: Path) -> int:
    """Render what was baked; the exit code."""
    picture.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, str(ROOT / "tools" / "picture.py"), str(folder / "baked.blend"), str(picture),
               "--side", str(SIDE)]
    with (folder / "picture.log").open("w", encoding="utf-8") as log:
        return subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, check=False).returncode


def row(name: str, report: dict[str, Any], options: str) -> tuple[str, ...]:
    """The cells of a scene's row."""
    error, energy = report["error"], report["energy"]
    codes = Counter(warning["code"] for warning in report["warnings"])
    told = ", ".join(f"{count} {code}" for code, count in sorted(codes.items())) or "none"
    found = error["estimated"]
    return (name, f"`{options}`" if options else "defaults", f"{report['triangles']:,}", f"{report['lumels']:,}",
            f"{report['patches']:,}", f"{report['rays'] / 1e6:.1f} M", f"{error['wanted']:.1%}",
            f"{found['rms']:.1%} ({found['rms_low']:.1%} to {found['rms_high']:.1%})", f"{energy['imbalance']:+.1%}",
            told)


def main() -> int:
    """Command line; 1 if a scene failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, help="a folder of folders, each with a .blend of its own name")
    parser.add_argument("--only", metavar="NAME", nargs="+", help="these scenes")
    parser.add_argument("--options", default="", help="options of the bake, as one word")
    parser.add_argument("--write", action="store_true", help="no bake: show what the last one left")
    arguments = parser.parse_args()
    names = arguments.only or sorted(path.stem for path in arguments.scenes.glob("*/*.blend"))
    failed = []
    with tempfile.TemporaryDirectory(prefix="radiosity-gallery-") as resources:
        os.environ.setdefault("BLENDER_USER_RESOURCES", resources)
        for name in names:
            folder = OUT / name
            blend = arguments.scenes.absolute() / name / f"{name}.blend"
            code = 0 if arguments.write else bake(blend, folder, shlex.split(arguments.options))
            if code not in WRITTEN or take_picture(folder, PICTURES / f"{name}.png"):
                failed.append(name)
                print(f"{name}: failed, see the logs in {folder}", file=sys.stderr)
                continue
            report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
            page = PAGE.read_text(encoding="utf-8")
            options = (folder / "options.txt").read_text(encoding="utf-8")
            PAGE.write_text(with_rows(page, HEAD, {name: row(name, report, options)}), encoding="utf-8")
            print(*row(name, report, options), sep="  ", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
