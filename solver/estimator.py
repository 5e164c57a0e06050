"""How far a bake is from the truth, when all that is known of the truth is two noisy references.

With independent references r1 = truth + n1 and r2 = truth + n2, whose noise has mean zero,

    mean((ours - r1) (ours - r2)) = mean((ours - truth)^2)        in expectation,

so the references' noise adds nothing to the estimate: no floor. (The dual-buffer idea of Rousselle, Knaus and Zwicker
2012, used on the error itself.) The relative RMS error is its root over the mean of the reference on the same lumels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Bool = NDArray[np.bool_]

# Part of the lumels, those with the largest deviation, that is left out, for every program alike: a handful of lumels
# on sun edges behind thin occluders otherwise carries most of the mean square.
TRIMMED_FRACTION = 0.001
# References noisier than this many times the error to be shown make the trimming bite into noise.
NOISE_LIMIT = 3.0
# A two-sided interval of +-1.96 standard errors holds 95 %.
INTERVAL = 1.96


@dataclass(frozen=True)
class Score:
    """The error of a bake over one set of lumels; every number but the counts is a fraction of `mean`.

    lumels : how many count, after trimming;  trimmed : how many were left out.
    mean : mean of the reference over lumels and R, G, B, in the unit of the images.
    rms : relative RMS error, its reference noise taken out;  rms_low, rms_high : its 95 % interval (sampling of lumels
        and noise of the references).
    p95 : 95th percentile over lumels of the RMS over R, G, B of (ours - mean of the references). Holds their noise:
    p95_noise : what a perfect bake would show, from (first - second) / 2, which is spread as the mean's noise is.
    p95_clean : p95 with that taken out as if both were normal: the root of the difference of their squares.
    worst : deviation of the worst lumels, noise taken out (see `worst_deviation`); nothing trimmed.
    bias : mean of (ours - reference), signed;  bias_standard_error : from the spread over lumels.
    noise : relative RMS noise of *one* reference, from the difference of the two.
    rms_untrimmed : rms with nothing left out.
    """

    lumels: int
    trimmed: int
    mean: float
    rms: float
    rms_low: float
    rms_high: float
    p95: float
    p95_noise: float
    p95_clean: float
    worst: float
    bias: float
    bias_standard_error: float
    noise: float
    rms_untrimmed: float

    def is_clean(self) -> bool:
        """Whether the references are clean enough for the error shown (`NOISE_LIMIT`)."""
        return self.noise <= NOISE_LIMIT * self.rms


@dataclass(frozen=True)
class Counted:
    """Which lumels count, as masks over (rows, columns)."""

    inner: Bool
    edge: Bool


def counted_lumels(chart: NDArray[np.integer[Any]], first: Float, second: Float) -> Counted:
    """Sort the lumels of one image into inner ones, edge ones and those that do not count.

    Parameters
    ----------
    chart : (rows, columns) int, the chart that covers a texel's centre; -1 where none does.
    first, second : (rows, columns, 3), the two references. A lumel that is black in either does not count.

    Returns
    -------
    Counted : inner are lit lumels whose eight neighbours the same chart covers; edge are the other lit ones.
    """
    padded = np.pad(chart, 1, constant_values=-1)
    rows, columns = chart.shape
    inner = chart >= 0
    for row in range(3):
        for column in range(3):
            inner = inner & (padded[row : row + rows, column : column + columns] == chart)
    lit = (chart >= 0) & (first.sum(axis=2) > 0) & (second.sum(axis=2) > 0)
    return Counted(inner & lit, ~inner & lit)


def largest_deviations(ours: Float, first: Float, second: Float, fraction: float = TRIMMED_FRACTION) -> Bool:
    """Mask of the `fraction` of the lumels whose deviation from the mean reference is largest; all arrays (n, 3)."""
    count = int(np.ceil(fraction * len(ours)))
    left_out = np.zeros(len(ours), bool)
    if count:
        deviation = np.square(ours - (first + second) / 2).sum(axis=1)
        left_out[np.argpartition(deviation, len(ours) - count)[len(ours) - count :]] = True
    return left_out


def mean_square_error(ours: Float, first: Float, second: Float) -> tuple[float, float]:
    """Unbiased mean square error over lumels and channels, and its standard error; all arrays (n, 3)."""
    product = ((ours - first) * (ours - second)).mean(axis=1)
    if len(product) < 2:
        return float(product.mean()), float("inf")
    return float(product.mean()), float(product.std(ddof=1) / np.sqrt(len(product)))


def score(ours: Float, first: Float, second: Float, fraction: float = TRIMMED_FRACTION) -> Score:
    """The error of a bake against two independent references.

    Parameters
    ----------
    ours, first, second : (n, 3) values of the lumels that count, in one unit.
    fraction : part of the lumels left out, those with the largest deviation.

    Raises
    ------
    ValueError
        If no lumel counts, the shapes differ, or a value is not finite.
    """
    ours, first, second = (np.asarray(values, np.float64) for values in (ours, first, second))
    if not len(ours):
        raise ValueError("no lumel is lit in both references: nothing can be compared")
    if ours.shape != first.shape or ours.shape != second.shape or ours.shape[1:] != (3,):
        raise ValueError(f"lumels of shape {ours.shape}, {first.shape} and {second.shape}: give three of (n, 3)")
    for name, values in (("ours", ours), ("the first reference", first), ("the second reference", second)):
        if not np.isfinite(values).all():
            raise ValueError(f"{name} holds {np.count_nonzero(~np.isfinite(values))} values that are not finite")
    untrimmed = mean_square_error(ours, first, second)[0]
    worst = worst_deviation(ours, first, second, fraction)
    whole_mean = float((first + second).mean() / 2)
    left_out = largest_deviations(ours, first, second, fraction)
    ours, first, second = ours[~left_out], first[~left_out], second[~left_out]
    square, square_error = mean_square_error(ours, first, second)
    reference = (first + second) / 2
    deviation = ours - reference
    mean = float(reference.mean())
    signed = deviation.mean(axis=1)
    p95, p95_noise = _percentile(deviation), _percentile((first - second) / 2)
    return Score(
        lumels=len(ours),
        trimmed=int(left_out.sum()),
        mean=mean,
        rms=_root(square) / mean,
        rms_low=_root(square - INTERVAL * square_error) / mean,
        # No square is below zero: where it comes out there, chance made it so.
        rms_high=_root(max(square, 0.0) + INTERVAL * square_error) / mean,
        p95=p95 / mean,
        p95_noise=p95_noise / mean,
        p95_clean=_root(p95**2 - p95_noise**2) / mean,
        worst=worst / mean,
        bias=float(signed.mean()) / mean,
        bias_standard_error=float(signed.std() / np.sqrt(len(signed))) / mean,
        noise=_root(float(np.square(first - second).mean()) / 2) / mean,
        rms_untrimmed=_root(untrimmed) / whole_mean,
    )


def worst_deviation(ours: Float, first: Float, second: Float, fraction: float = TRIMMED_FRACTION) -> float:
    """Deviation (RMS over R, G, B) of the `fraction` of the lumels that are worst, at least one; all arrays (n, 3).

    One reference picks the lumels and the direction in which each deviates, the other, whose noise knows nothing of
    the choice, says how far: so the noise of what was picked adds nothing. Where noise picks lumels that are right,
    the result is below the truth. Both ways round, averaged.
    """
    count = max(1, int(np.ceil(fraction * len(ours))))
    means = []
    for picks, measures in ((first, second), (second, first)):
        picked, measured = ours - picks, ours - measures
        size = np.linalg.norm(picked, axis=1)
        rows = np.argpartition(size, len(size) - count)[len(size) - count:]
        along = picked[rows] / np.maximum(size[rows], 1e-300)[:, None]
        means.append(float((measured[rows] * along).sum(axis=1).mean()))
    return max(float(np.mean(means)), 0.0) / float(np.sqrt(3))


def noise_of(first: Float, second: Float) -> float:
    """Relative RMS noise of one reference, from two independent ones (n, 3): ||r1 - r2|| / sqrt(2) / mean."""
    return _root(float(np.square(first - second).mean()) / 2) / float((first + second).mean() / 2)


def _percentile(deviation: Float) -> float:
    return float(np.percentile(np.sqrt(np.square(deviation).mean(axis=1)), 95))


def _root(square: float) -> float:
    # The estimate of a square may fall below zero by chance when the bake agrees better than its noise can tell.
    return float(np.sqrt(max(square, 0.0)))
