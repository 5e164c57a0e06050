"""A path tracer's curve: seconds and error by samples, so that its time at any error can be told."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class CyclesLaw:
    """seconds = overhead + per_sample N and error = one_sample / sqrt(N), fitted to `fewest` to `most` samples.

    The law of the error is Monte Carlo's own; `spread` tells how well the points keep it (largest over smallest of
    error sqrt(N)).
    """

    overhead: float
    per_sample: float
    one_sample: float
    spread: float
    fewest: int
    most: int

    def samples_at(self, error: float) -> float:
        """Samples at which Cycles' error is `error`."""
        return (self.one_sample / error) ** 2

    def seconds_at(self, error: float) -> float:
        """Seconds at which Cycles' error is `error`."""
        return self.overhead + self.per_sample * self.samples_at(error)

    def is_measured_at(self, error: float) -> bool:
        """Whether that lies between measured points; else it is the law that speaks, not a measurement."""
        return self.fewest <= self.samples_at(error) <= self.most


def fit(samples: list[int], seconds: list[float], errors: list[float]) -> CyclesLaw:
    """Fit the law to at least one bake; with one, the overhead counts as none.

    Raises
    ------
    ValueError
        If there is no point, or an error that is not above zero.
    """
    if not samples or min(errors) <= 0:
        raise ValueError(
            f"no law of Cycles' error from samples {samples} and errors {errors}: time other sample counts"
        )
    count, time, error = (np.asarray(values, np.float64) for values in (samples, seconds, errors))
    if len(np.unique(count)) > 1:
        # Relative residuals: a bake of a second weighs as much as one of a minute.
        design = np.stack([np.ones_like(count), count], axis=1) / time[:, None]
        overhead, per_sample = np.linalg.lstsq(design, np.ones_like(time), rcond=None)[0]
    else:
        overhead, per_sample = 0.0, float((time / count).mean())
    if overhead < 0 or per_sample <= 0:
        overhead, per_sample = 0.0, float(np.exp(np.log(time / count).mean()))
    constant = error * np.sqrt(count)
    return CyclesLaw(
        float(overhead),
        float(per_sample),
        float(np.exp(np.log(constant).mean())),
        float(constant.max() / constant.min()),
        int(count.min()),
        int(count.max()),
    )
