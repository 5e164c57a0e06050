"""Take the table of exact answers that the last test run wrote into the documentation, or check it.

    python tools/validation.py            copy out/validation.md to docs/validation.md, unless rows would be lost
    python tools/validation.py --drop     copy it even then (a run of some of the tests writes some of the rows)
    python tools/validation.py --check    exit with 1 if a case came, went, or has another verdict
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
WRITTEN, KEPT = ROOT / "out" / "validation.md", ROOT / "docs" / "validation.md"


def verdicts(path: Path) -> set[tuple[str, str, str, str]]:
    """(case, quantity, exact, verdict) of every row: the other columns' last digits differ between machines."""
    rows = [line.strip("|\n ").split(" | ") for line in path.read_text(encoding="utf-8").splitlines() if " | " in line]
    return {(row[0], row[1], row[2], row[-1]) for row in rows if len(row) == 8}


def main() -> int:
    """Copy or check."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--check", action="store_true", help="change nothing; exit with 1 if the tables differ")
    parser.add_argument("--drop", action="store_true", help="let rows go that the last run didn't write")
    arguments = parser.parse_args()
    if not WRITTEN.is_file():
        print("out/validation.md is not there: run the tests first (make test)", file=sys.stderr)
        return 1
    written, kept = verdicts(WRITTEN), verdicts(KEPT) if KEPT.is_file() else set()
    wrong = written ^ kept if arguments.check else set() if arguments.drop else kept - written
    for row in sorted(wrong):
        print("only in", "out:" if row in written else "docs:", " | ".join(row), file=sys.stderr)
    if not wrong and not arguments.check:
        KEPT.write_text(WRITTEN.read_text(encoding="utf-8"), encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
