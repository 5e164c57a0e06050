"""Error against time, ours and other programs', as pictures, with the numbers beside them.

    python benchmarks/chart.py                                    measure everything, then draw
    python benchmarks/chart.py --scenes cornell --programs ours cycles oidn     of other scenes, the rows stay
    python benchmarks/chart.py --draw                             draw the tables that are there

Writes accuracy.csv, accuracy.png and the tables of accuracy.md (lightmaps), form_factors.csv and form_factors.png
(single form factors). Other people's programs are installed first, in an environment of their own (.venv-peers);
docs/peers.md tells of them.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from radiosity.benchmarks.accuracy_page import points, rows_of, with_tables

ROOT = Path(__file__).resolve().parents[1]
SCENES = ("cornell", "classroom", "living-room", "truck_town", "pandora")
PROGRAMS = ("ours", "cycles", "oidn", "mitsuba", "luxcore", "form_factors")
# Those that need the peers' environment.
PEERS = {"oidn", "mitsuba", "luxcore", "form_factors"}
STYLES = {
    "ours": ("black", "o-"),
    "cycles": ("tab:blue", "s--"),
    "cycles + oidn lightmap": ("tab:orange", "^--"),
    "cycles + oidn": ("tab:red", "v--"),
    "mitsuba": ("tab:green", "D--"),
    "luxcore": ("tab:purple", "P--"),
}
# Panels side by side at most.
COLUMNS = 3
SECONDS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
PER_CENT = (0.5, 1, 2, 3, 5, 10, 20, 50)


def run(*words: str) -> int:
    """A command of this project, from its root; its exit code."""
    return subprocess.run([sys.executable, "-m", *words], cwd=ROOT, check=False).returncode


def measure(scenes: list[str], programs: list[str], rounds: int, output: Path) -> None:
    """Run what was asked for and gather its rows in `output`."""
    if PEERS & set(programs):
        run("benchmarks.peers.environment")
    baked = [program for program in programs if program != "form_factors"]
    tables = []
    if baked:
        for scene in scenes:
            if run("radiosity.benchmarks.peers.run", scene, "--rounds", str(rounds), "--programs", *baked):
                sys.exit(f"{scene} could not be measured")
            tables.append((ROOT / "out" / "benchmarks" / scene / "peers.csv").read_text().splitlines())
        lines = with_others([line for table in tables for line in table[1:]], tables[0][0], output / "accuracy.csv")
        (output / "accuracy.csv").write_text("\n".join(lines) + "\n")
    if "form_factors" in programs and run("radiosity.benchmarks.form_factors.run", "--output",
                                          str(output / "form_factors.csv"), "--peers"):
        sys.exit("the form factors could not be measured")


def with_others(lines: list[str], head: str, table: Path) -> list[str]:
    """Lines of a table of bakes, its head first: those just measured, and of scenes that were not measured this time
    those that it has."""
    measured = {line.split(",")[0] for line in lines}
    before = table.read_text().splitlines() if table.is_file() else []
    if before[:1] == [head]:
        lines = lines + [line for line in before[1:] if line.split(",")[0] not in measured]
    order = {scene: number for number, scene in enumerate(SCENES)}
    return [head, *sorted(lines, key=lambda line: order.get(line.split(",")[0], len(order)))]


def draw_bakes(table: Path, picture: Path) -> None:
    """One panel a scene, one curve a program; both axes logarithmic. The legend fills a panel that is left over."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = rows_of(table)
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    columns = min(COLUMNS, len(scenes))
    lines = -(-len(scenes) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(2.5 + 4 * columns, 4.2 * lines), sharey=True, squeeze=False,
                                layout="constrained")
    for axis, scene in zip(axes.flat, scenes, strict=False):
        for program, (colour, style) in STYLES.items():
            curve = sorted((seconds, 100 * error) for error, seconds in points(rows, scene, (program,)))
            if curve:
                axis.loglog(*zip(*curve, strict=True), style, color=colour, label=program)
        axis.set_title(scene)
        axis.set_xlabel("seconds (wall clock)")
        axis.grid(True, which="both", alpha=0.3)
        _plain_ticks(axis)
    for axis in axes[:, 0]:
        axis.set_ylabel("relative RMS error, %")
    handles = {label: handle for axis in axes.flat
               for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    spare = axes.flat[len(scenes):]
    for axis in spare:
        axis.set_axis_off()
    legend: Any = spare[0].legend if len(spare) else figure.legend
    legend(handles.values(), handles.keys(), loc="center" if len(spare) else "outside right center")
    figure.savefig(picture, dpi=100)
    plt.close(figure)


def _plain_ticks(axis: Any) -> None:
    from matplotlib.ticker import NullFormatter, ScalarFormatter

    for scale, wanted in ((axis.xaxis, SECONDS), (axis.yaxis, PER_CENT)):
        low, high = scale.get_view_interval()
        scale.set_ticks([tick for tick in wanted if low <= tick <= high])
        scale.set_major_formatter(ScalarFormatter())
        scale.set_minor_formatter(NullFormatter())


def draw(output: Path) -> list[Path]:
    """Draw each table that is there; the pictures."""
    made = []
    if (output / "accuracy.csv").is_file():
        draw_bakes(output / "accuracy.csv", output / "accuracy.png")
        made.append(output / "accuracy.png")
        page = output / "accuracy.md"
        if page.is_file():
            page.write_text(with_tables(page.read_text(), rows_of(output / "accuracy.csv")))
    if (output / "form_factors.csv").is_file():
        picture = output / "form_factors.png"
        if run("radiosity.benchmarks.form_factors.picture", str(output / "form_factors.csv"), str(picture)):
            sys.exit("the form factors could not be drawn")
        made.append(picture)
    return made


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="draw the tables that are there, without measuring")
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), help=f"({' '.join(SCENES)})")
    parser.add_argument("--programs", nargs="+", choices=PROGRAMS, default=list(PROGRAMS), help="all by default")
    parser.add_argument("--rounds", type=int, default=1, help="times that ours and Cycles are timed, in turn (1)")
    parser.add_argument("--output", type=Path, default=ROOT / "docs", help="folder of tables and pictures (docs)")
    chosen = parser.parse_args(arguments)
    chosen.output.mkdir(parents=True, exist_ok=True)
    output = Path(os.path.abspath(chosen.output))
    if not chosen.draw:
        measure(chosen.scenes, chosen.programs, chosen.rounds, output)
    pictures = draw(output)
    if not pictures:
        sys.exit(f"no table in {output}: measure first")
    for picture in pictures:
        print(picture)
    return 0


if __name__ == "__main__":
    sys.exit(main())
