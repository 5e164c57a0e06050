"""Take the tables of exact answers and of stability that the last test run wrote into docs/, or check them.

    python tools/validation.py            copy out/{validation,stability}.md to docs/, unless rows would be lost
    python tools/validation.py --drop     copy it even then (a run of some of the tests writes some of the rows)
    python tools/validation.py --check    exit with 1 if a case came, went, or has another verdict
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# The columns of each table that must not change: the others' last digits differ between machines.
VERDICTS = {"validation.md": (8, (0, 1, 2, 7)), "stability.md": (5, (0, 1, 4))}


def verdicts(path: Path) -> set[tuple[str, ...]]:
    """(case, quantity, exact, verdict), or (case, method, test), of every row."""
    width, columns = VERDICTS[path.name]
    rows = [line.strip("|\n ").split(" | ") for line in path.read_text(encoding="utf-8").splitlines() if " | " in line]
    return {tuple(row[column] for column in columns) for row in rows if len(row) == width}


def compare(name: str, check: bool, drop: bool) -> bool:
    """Copy or check one table; whether all is well."""
    written_file, kept_file = ROOT / "out" / name, ROOT / "docs" / name
    if not written_file.is_file():
        print(f"out/{name} is not there: run the tests first (make test)", file=sys.stderr)
        return False
    written, kept = verdicts(written_file), verdicts(kept_file) if kept_file.is_file() else set()
    wrong = written ^ kept if check else set() if drop else kept - written
    for row in sorted(wrong):
        print("only in", "out:" if row in written else "docs:", " | ".join(row), file=sys.stderr)
    if not wrong and not check:
        kept_file.write_text(written_file.read_text(encoding="utf-8"), encoding="utf-8")
    return not wrong


def main() -> int:
    """Copy or check."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--check", action="store_true", help="change nothing; exit with 1 if the tables differ")
    parser.add_argument("--drop", action="store_true", help="let rows go that the last run didn't write")
    arguments = parser.parse_args()
    right = [compare(name, arguments.check, arguments.drop) for name in VERDICTS]
    return 0 if all(right) else 1


if __name__ == "__main__":
    sys.exit(main())
