"""All methods by name, behind one signature: form_factor(a, b, samples, occluders=(), seed=0) -> float."""

from __future__ import annotations

from collections.abc import Callable

from . import centroid, disc_to_point, double_contour, exact, hemicube, monte_carlo_rays, qmc_rays

Method = Callable[..., float]

METHODS: dict[str, Method] = {
    "centroid": centroid.form_factor,
    "disc to point": disc_to_point.form_factor,
    "double contour": double_contour.form_factor,
    "hemicube": hemicube.form_factor,
    "Monte Carlo rays": monte_carlo_rays.form_factor,
    "QMC rays": qmc_rays.form_factor,
    "ours": exact.form_factor,
}
NO_OCCLUDERS = {"double contour"}
# One run is enough: the answer doesn't depend on the samples.
ONE_SIZE = {"ours"}
# The seed matters: the error shown is the RMS over several.
RANDOM = {"Monte Carlo rays", "QMC rays"}
