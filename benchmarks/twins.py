"""The diffuse twins of the nine scenes, baked by our command line, against Cycles on the same lumels.

    python -m benchmarks.twins --error .02              all scenes
    python -m benchmarks.twins cornell --error .02      some of them; the others' rows stay as they are

Needs the scenes (see `benchmarks/cycles/scenes.py`) and their references, which
`python -m benchmarks.cycles.reference NAME` makes and refines. Writes twins.csv and the table in twins.md of docs; rows
are printed as they come. Ends with 1 if a scene's RMS error is above the wanted one, its bias above `MOST_BIAS` or the
scene could not be measured.
"""

from __future__ import annotations

import argparse
import csv
import sys
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from radiosity.tools.page_table import with_rows

from .cycles.compare import Comparison
from .cycles.scenes import CASES, ROOT, Case, case_named

DOCS = ROOT / "docs"
# A signed error, in parts of the scene's mean, above which a scene does not hold.
MOST_BIAS = 0.007
HEAD = ("scene", "lumels", "RMS error", "bias", "our own estimate", "references: samples", "their noise",
        "left out: edges, black, farthest", "RMS error with the farthest", "of the edges")


@dataclass(frozen=True)
class Twin:
    """One scene's bake against its references; every number but the counts is a part of the reference's mean.

    wanted : error that was asked for;  reached : whether the report says that it was reached.
    lumels : that count: inner, lit in both references, the farthest left out.
    rms, rms_low, rms_high : relative RMS error and its interval of 95 %;  bias : signed, with its standard error.
    estimated, estimated_low, estimated_high : the RMS error that the report gives, with its interval.
    noise : of one reference;  clean : whether that is below three times rms;  first_samples, second_samples : theirs.
    edges, edge_rms : lumels at the borders of charts, which are left out, and their error in parts of their own mean.
    black : lumels without light in a reference;  farthest : those left out for their deviation (1 in 1,000), and
    rms_untrimmed : rms with them.
    """

    scene: str
    wanted: float
    reached: bool
    lumels: int
    rms: float
    rms_low: float
    rms_high: float
    bias: float
    bias_standard_error: float
    estimated: float
    estimated_low: float
    estimated_high: float
    noise: float
    clean: bool
    first_samples: int
    second_samples: int
    edges: int
    edge_rms: float
    black: int
    farthest: int
    rms_untrimmed: float

    def holds(self) -> bool:
        """Whether the error is no larger than was asked for, and the bias no larger than `MOST_BIAS`."""
        return self.rms <= self.wanted and abs(self.bias) <= MOST_BIAS

    def cells(self) -> tuple[str, ...]:
        """Its row of the page."""
        return (
            self.scene,
            f"{self.lumels:,}",
            f"{self.rms:.2%} ({self.rms_low:.2%} to {self.rms_high:.2%})",
            f"{self.bias:+.2%} ± {self.bias_standard_error:.2%}",
            f"{self.estimated:.2%} ({self.estimated_low:.2%} to {self.estimated_high:.2%})"
            + ("" if self.reached else ", not reached"),
            f"{self.first_samples:,} and {self.second_samples:,}",
            f"{self.noise:.1%}" + ("" if self.clean else ", too much"),
            f"{self.edges:,}, {self.black:,}, {self.farthest:,}",
            f"{self.rms_untrimmed:.2%}",
            f"{self.edge_rms:.1%}",
        )


def measure(case: Case, error: float) -> Twin:
    """Bake a twin to `error` and compare it.

    Raises
    ------
    RuntimeError
        If the bake fails.
    """
    comparison = Comparison(case)
    row, done = comparison.add_ours(error)
    return Twin(
        scene=case.name,
        wanted=error,
        reached=done.reached,
        lumels=row.lumels,
        rms=row.rms,
        rms_low=row.rms_low,
        rms_high=row.rms_high,
        bias=row.bias,
        bias_standard_error=row.bias_standard_error,
        estimated=done.estimated["rms"],
        estimated_low=done.estimated["rms_low"],
        estimated_high=done.estimated["rms_high"],
        noise=row.noise,
        clean=row.clean,
        first_samples=comparison.pair.samples[0],
        second_samples=comparison.pair.samples[1],
        edges=row.edge_lumels,
        edge_rms=row.edge_rms,
        black=int(comparison.known["lumels"]) - row.lumels - row.trimmed - row.edge_lumels,
        farthest=row.trimmed,
        rms_untrimmed=row.rms_untrimmed,
    )


def write(folder: Path, twins: list[Twin]) -> None:
    """Put these rows among those of twins.csv and of the table in twins.md."""
    table, page = folder / "twins.csv", folder / "twins.md"
    rows: dict[str, dict[str, object]] = {}
    if table.is_file():
        with table.open(newline="", encoding="utf-8") as file:
            rows = {row["scene"]: dict(row) for row in csv.DictReader(file)}
    for twin in twins:
        rows[twin.scene] = {key: f"{value:.6g}" if isinstance(value, float) else value
                            for key, value in asdict(twin).items()}
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Twin)])
        writer.writeheader()
        writer.writerows(rows[name] for name in sorted(rows))
    text = page.read_text(encoding="utf-8")
    page.write_text(with_rows(text, HEAD, {twin.scene: twin.cells() for twin in twins}), encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    """Command line; 1 if a scene does not hold."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.twins", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", nargs="*", help=f"some of {', '.join(CASES)}; all by default")
    parser.add_argument("--error", type=float, default=0.02, help="error that is asked of our bake (.02)")
    parser.add_argument("--output", type=Path, default=DOCS, help="folder of twins.csv and twins.md (docs)")
    chosen = parser.parse_args(arguments)
    held = True
    for name in chosen.scene or CASES:
        try:
            twin = measure(case_named(name), chosen.error)
        except RuntimeError as problem:
            print(problem, file=sys.stderr)
            held = False
            continue
        write(chosen.output, [twin])
        held &= twin.holds()
        print("  ".join(twin.cells()), "" if twin.holds() else "DOES NOT HOLD", flush=True)
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
