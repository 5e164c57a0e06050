"""Phong's lobe fitted to data in MERL's format, beside the Lambertian surface that a bake takes instead of both.

    python -m radiosity.benchmarks.brdf.run                                   docs/brdf.csv and .png, synthetic surfaces
    python -m radiosity.benchmarks.brdf.run --merl FILE ... --output out/brdf the same of measured files of your own

Columns: surface, k_d, k_s, n (the fit's), fit_error (RMS of log10 f), reflectance_data, reflectance_phong
(bihemispherical), residual_data, residual_phong (part of the reflected light that the diffuse equivalent sends
elsewhere), and even_light_error (how far the equivalent is off where light comes evenly from everywhere: relative RMS
over outgoing directions).
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from pathlib import Path

import matplotlib
import numpy as np
from radiosity.solver.brdf import Brdf, Float, Lambert, Phong
from radiosity.solver.brdf_integrals import (
    directional_reflectance,
    directional_residual,
    hemispherical_reflectance,
    residual,
)
from radiosity.solver.merl import Measured, read_merl
from radiosity.solver.quantities import LUMINANCE
from scipy.optimize import least_squares

from .synthetic import SURFACES, write_merl

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).resolve().parents[2]
COLUMNS = ("surface", "k_d", "k_s", "n", "fit_error", "reflectance_data", "reflectance_phong", "residual_data",
           "residual_phong", "even_light_error")
# Angles of incidence of the fit and of the picture, degrees.
FITTED = (15, 30, 45, 60)
SHOWN = (30, 60)
# Outgoing angles of the fit, degrees: measured data is not to be trusted closer to the horizon.
STEEPEST = 80.0
# Below this f counts as this, 1 / sr.
FLOOR = 1e-4
# Powers of ten at the picture's circles.
RADII = (-3, -2, -1, 0, 1)
# Most of the exponents tried.
MOST = 1e4


def in_plane(degrees: Float) -> Float:
    """Directions (n, 3) in the plane y = 0, by their angle to the normal, positive towards +x."""
    angle = np.radians(degrees)
    return np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=-1)


def lobe(brdf: Brdf, incidence: float, degrees: Float) -> Float:
    """Luminance of f in the plane of incidence (n,), light coming from -incidence."""
    return np.asarray(brdf(in_plane(np.full_like(degrees, -incidence)), in_plane(degrees)) @ LUMINANCE)


def fit_phong(brdf: Brdf) -> tuple[Phong, float]:
    """The grey Phong that is nearest in log f over the plane of incidence, and its RMS distance in log10."""
    # Half a degree off: on whole ones, where entries of a measured table meet, rounding would choose which one is read.
    degrees = np.arange(-STEEPEST + 0.5, STEEPEST, 2)
    wanted = np.log10(np.maximum([lobe(brdf, incidence, degrees) for incidence in FITTED], FLOOR))

    def model(x: Float) -> Phong:
        diffuse = 1 / (1 + np.exp(-x[0]))
        return Phong(diffuse, (1 - diffuse) / (1 + np.exp(-x[1])), min(np.exp(x[2]), MOST))

    def distance(x: Float) -> Float:
        found = [lobe(model(x), incidence, degrees) for incidence in FITTED]
        return np.asarray((np.log10(np.maximum(found, FLOOR)) - wanted).ravel())

    starts = [least_squares(distance, (-2.0, -1.0, np.log(n))) for n in (3, 20, 100)]
    best = min(starts, key=lambda found: found.cost)
    return model(best.x), float(np.sqrt(np.mean(distance(best.x) ** 2)))


def row(name: str, data: Brdf, phong: Phong, fit_error: float) -> list[str]:
    """One line of the table."""
    def grey(values: Float) -> float:
        return float(values @ LUMINANCE)

    cosines, weight = np.polynomial.legendre.leggauss(32)
    cosines = (cosines + 1) / 2
    even = directional_reflectance(data, cosines) @ LUMINANCE / grey(hemispherical_reflectance(data)) - 1
    numbers = (float(np.mean(phong.diffuse)), float(np.mean(phong.specular)), phong.exponent, fit_error,
               grey(hemispherical_reflectance(data)), grey(hemispherical_reflectance(phong)), grey(residual(data)),
               grey(residual(phong)), float(np.sqrt((weight * cosines * even**2).sum())))
    return [name, *(f"{number:.3g}" for number in numbers)]


def measured(paths: list[Path]) -> list[tuple[str, Measured]]:
    """The files, or the synthetic surfaces by way of files."""
    if paths:
        return [(path.stem, read_merl(path)) for path in paths]
    found = []
    for surface in SURFACES:
        with tempfile.TemporaryDirectory(prefix="radiosity-merl-") as folder:
            write_merl(Path(folder) / "surface.binary", surface)
            found.append((surface.name, read_merl(Path(folder) / "surface.binary")))
    return found


def draw(path: Path, fits: list[tuple[str, Measured, Phong]]) -> None:
    """For each surface the lobes, polar, with log f as radius; below, by angle of incidence, what a bake leaves out."""
    figure = plt.figure(figsize=(4 * len(fits), 6))
    width = 1 / len(fits)
    for column, (name, data, phong) in enumerate(fits):
        polar = figure.add_axes((width * (column + 0.08), 0.42, width * 0.84, 0.62), projection="polar")
        _draw_lobes(polar, data, phong)
        figure.text(width * (column + 0.5), 0.96, f"{name}: f, 1/sr, logarithmic", ha="center")
        axes = figure.add_axes((width * (column + 0.15), 0.08, width * 0.78, 0.32))
        _draw_reflectance(axes, data, phong)
        if column == 0:
            handles, labels = polar.get_legend_handles_labels()
            figure.legend(handles, labels, fontsize=8, loc="center", bbox_to_anchor=(0.5, 0.465), ncols=len(handles))
            axes.legend(fontsize=7)
    figure.savefig(path, dpi=100)


def _draw_lobes(polar: plt.PolarAxes, data: Measured, phong: Phong) -> None:
    """Data, Phong and the diffuse equivalent in the plane of incidence; shaded: what the equivalent leaves out."""
    degrees = np.arange(-89.5, 90, 0.5)
    even = Lambert(hemispherical_reflectance(data))
    angle, flat = np.radians(degrees), _radius(lobe(even, 0, degrees))
    for incidence, colour in zip(SHOWN, ("tab:blue", "tab:red"), strict=True):
        radius = _radius(lobe(data, incidence, degrees))
        polar.plot(angle[::4], radius[::4], ".", color=colour, markersize=3, label=f"data, light from {incidence}°")
        polar.plot(angle, _radius(lobe(phong, incidence, degrees)), color=colour, linewidth=1, label="Phong")
        polar.fill_between(angle, flat, radius, color=colour, alpha=0.15, linewidth=0)
        polar.plot([-np.radians(incidence)] * 2, [0, RADII[-1] - RADII[0]], ":", color=colour, linewidth=1)
    polar.plot(angle, flat, "k--", linewidth=1, label="what a bake has")
    polar.set_theta_zero_location("N")
    polar.set_theta_direction(-1)
    polar.set_thetamin(-90)
    polar.set_thetamax(90)
    polar.set_ylim(0, RADII[-1] - RADII[0])
    polar.set_yticks([radius - RADII[0] for radius in RADII[1:]], [f"$10^{{{radius}}}$" for radius in RADII[1:]])
    polar.tick_params(labelsize=7)


def _radius(f: Float) -> Float:
    return np.asarray(np.maximum(np.log10(np.maximum(f, FLOOR)) - RADII[0], 0))


def _draw_reflectance(axes: plt.Axes, data: Measured, phong: Phong) -> None:
    """By angle of incidence: what is reflected, its constant in a bake, and the part that goes elsewhere."""
    degrees = np.arange(0, 86, 2.5)
    cosines = np.cos(np.radians(degrees))
    axes.plot(degrees, directional_reflectance(data, cosines) @ LUMINANCE, "k.", label="reflected, data")
    axes.plot(degrees, directional_reflectance(phong, cosines) @ LUMINANCE, "k-", label="reflected, Phong")
    axes.axhline(float(hemispherical_reflectance(data) @ LUMINANCE), color="k", linestyle="--", linewidth=1,
                 label="reflected, in a bake")
    axes.plot(degrees, directional_residual(data, cosines) @ LUMINANCE, color="tab:purple",
              label="goes elsewhere in a bake")
    axes.set_xlabel("angle of incidence, degrees")
    axes.set_ylim(0, 1.1)
    axes.grid(True, alpha=0.3)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--merl", type=Path, nargs="+", default=[], help="files in MERL's format")
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "brdf", help="path without .csv and .png")
    arguments = parser.parse_args()
    fits, lines = [], []
    for name, data in measured(arguments.merl):
        phong, fit_error = fit_phong(data)
        fits.append((name, data, phong))
        lines.append(row(name, data, phong, fit_error))
        print(*lines[-1])
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    with arguments.output.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *lines])
    draw(arguments.output.with_suffix(".png"), fits)


if __name__ == "__main__":
    main()
