"""The numbers of a comparison: our error against two bakes by Cycles, and what Cycles itself shows for its time."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver import estimator, sampling_law
from ..solver.geometry import Geometry
from ..solver.lumels import barycentric_at, charts_of_triangles
from ..solver.mesh_faults import ALIKE, lying_on
from ..solver.raster import rasterise, to_texels
from ..solver.result import Bake
from ..solver.scene import Scene, surface_of_triangle

Float = NDArray[np.floating[Any]]
Bool = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Maps:
    """One page in all its versions, row 0 at the bottom.

    ours, first, second : (h, w, 3) float32, radiance: our bake, and Cycles' two.
    counted : which lumels count; not those that nobody sees, which show the light of others, and not those on which
        another face lies that faces the same way, which Cycles shades by chance.
    hidden, doubled : how many of those would have counted.
    surface : (h, w) int32, the object of each lumel, -1 for none.
    """

    name: str
    ours: Float
    first: Float
    second: Float
    counted: estimator.Counted
    hidden: int
    doubled: int
    surface: NDArray[np.int32]

    @property
    def cycles(self) -> Float:
        """The mean of Cycles' two bakes: all of its budget."""
        return np.asarray((self.first + self.second) / 2)


def layout_of(scene: Scene, bake: Bake) -> tuple[NDArray[np.int32], Float]:
    """(t,) page of each triangle, -1 for none, and (t, 3, 2) float32 coordinates of its corners there."""
    page = np.asarray(bake.page_of_surface, np.int32)[surface_of_triangle(scene)]
    layout = np.zeros((len(scene.triangles), 3, 2), np.float32)
    for item, uv in zip(scene.surfaces, bake.uv, strict=True):
        if uv is not None:
            layout[item.triangles] = uv
    return page, layout


def make_maps(scene: Scene, bake: Bake, halves: list[list[Float]], left_out: Bool) -> list[Maps]:
    """All pages; `halves` are Cycles' two bakes, each (h, w, 4) a page, without the triangles `left_out` (t,)."""
    page_of_triangle, layout = layout_of(scene, bake)
    chart, surface = charts_of_triangles(scene, bake.uv), surface_of_triangle(scene)
    geometry = Geometry(scene)
    maps = []
    for page, lightmap in enumerate(bake.lightmaps):
        height, width = lightmap.pixels.shape[:2]
        members = np.flatnonzero(page_of_triangle == page)
        owner = rasterise(layout[members], width, height).owner.reshape(height, width)
        there = owner >= 0
        first, second = (half[page] for half in halves)
        there &= (first[..., 3] > 0) & (second[..., 3] > 0)
        whose = np.where(there, members[owner], -1)
        counted = estimator.counted_lumels(np.where(there, chart[whose], -1), first[..., :3], second[..., :3])
        hidden = np.zeros_like(there) if lightmap.hidden is None else lightmap.hidden
        doubled = np.zeros_like(there)
        some = counted.inner | counted.edge
        texels = np.argwhere(some)[:, ::-1].astype(np.float64)
        weight, _ = barycentric_at(to_texels(layout[whose[some]], width, height), texels)
        places = geometry.point(whose[some], *weight.astype(np.float32).T)
        doubled[some] = lying_on(geometry, whose[some], places, np.flatnonzero(~left_out))[1] > ALIKE
        kept = ~(hidden | doubled)
        unseen, twice = (int((counted.inner & without).sum()) for without in (hidden, doubled & ~hidden))
        maps.append(Maps(lightmap.name, np.asarray(lightmap.pixels, np.float32), first[..., :3], second[..., :3],
                         estimator.Counted(counted.inner & kept, counted.edge & kept),
                         unseen, twice, np.where(there, surface[whose], -1).astype(np.int32)))
    return maps


def take(maps: list[Maps], which: str) -> tuple[Float, Float, Float]:
    """(n, 3) values of ours and of Cycles' two bakes at the `inner` or the `edge` lumels of all pages."""
    def values(name: str) -> Float:
        return np.concatenate([getattr(one, name)[getattr(one.counted, which)] for one in maps])

    return values("ours"), values("first"), values("second")


def numbers(maps: list[Maps], names: list[str], seconds: float, about: dict[str, Any]) -> dict[str, Any]:
    """What the report says of error and time.

    Parameters
    ----------
    maps : the pages.
    names : of the scene's surfaces.
    seconds : of our bake.
    about : what Cycles' part said of itself.

    Raises
    ------
    ValueError
        If no lumel is lit.
    """
    inner = take(maps, "inner")
    score = estimator.score(*inner)
    edge = take(maps, "edge")
    edges = estimator.score(*edge) if len(edge[0]) else None
    cycles_seconds = float(sum(about["seconds"]))
    # The mean of both halves has all samples: its noise is that of one over the root of two.
    noise = score.noise / math.sqrt(2)
    return {
        "lumels": {"counted": score.lumels, "left_out": score.trimmed, "edge": len(edge[0]),
                   "hidden": sum(one.hidden for one in maps), "doubled": sum(one.doubled for one in maps),
                   "mean_radiance": score.mean},
        "ours": {"seconds": seconds, **_error(score), "edge_rms": edges.rms if edges else None},
        "cycles": {"seconds": cycles_seconds, "samples": 2 * about["samples"], "rms": noise, "half_rms": score.noise,
                   "bounces": about["bounces"], "bakes": 2, "edge_rms": edges.noise / math.sqrt(2) if edges else None},
        "clean": score.is_clean(),
        "equal_error": _equal_error(score, seconds, about),
        "objects": _by_object(maps, names, score.mean),
        "worst_lumel": _worst(maps, names, score.mean),
    }


def _error(score: estimator.Score) -> dict[str, float]:
    known = asdict(score)
    return {name: known[name] for name in ("rms", "rms_low", "rms_high", "p95", "p95_noise", "p95_clean", "worst",
                                           "bias", "bias_standard_error", "rms_untrimmed")}


def _equal_error(score: estimator.Score, seconds: float, about: dict[str, Any]) -> dict[str, Any] | None:
    """Cycles' time at our error, by the law of its noise; None where ours is below what can be told."""
    if score.rms <= 0 or score.noise <= 0:
        return None
    count, took = about["samples"], about["seconds"]
    samples = [*about["pilot_samples"], count, count]
    law = sampling_law.fit(samples, [*about["pilot_seconds"], *took],
                           [score.noise * math.sqrt(count / some) for some in samples])
    theirs = law.seconds_at(score.rms)
    return {"rms": score.rms, "cycles_samples": law.samples_at(score.rms), "cycles_seconds": theirs,
            "cycles_overhead": law.overhead, "cycles_seconds_per_sample": law.per_sample,
            "factor": theirs / seconds if seconds > 0 else None, "measured": law.is_measured_at(score.rms)}


def _by_object(maps: list[Maps], names: list[str], mean: float) -> list[dict[str, Any]]:
    """RMS (noise taken out, nothing left out) and bias of each object, in parts of the scene's mean."""
    surface = np.concatenate([one.surface[one.counted.inner] for one in maps])
    ours, first, second = take(maps, "inner")
    square = ((ours - first) * (ours - second)).mean(axis=1)
    bias = (ours - (first + second) / 2).mean(axis=1)
    count = np.bincount(surface, minlength=len(names))
    squares, biases = (np.bincount(surface, values, len(names)) for values in (square, bias))
    return [{"object": names[index], "lumels": int(count[index]),
             "rms": math.sqrt(max(squares[index] / count[index], 0.0)) / mean,
             "bias": float(biases[index] / count[index]) / mean}
            for index in np.argsort(-squares) if count[index]]


def _worst(maps: list[Maps], names: list[str], mean: float) -> dict[str, Any]:
    """The lumel that deviates most from Cycles' mean, noise and all."""
    found: dict[str, Any] = {"deviation": -1.0}
    for one in maps:
        deviation = np.where(one.counted.inner, np.square(one.ours - one.cycles).mean(axis=2), -1)
        row, column = np.unravel_index(int(np.argmax(deviation)), deviation.shape)
        size = math.sqrt(max(float(deviation[row, column]), 0.0)) / mean
        if size > found["deviation"] and deviation[row, column] >= 0:
            found = {"deviation": size, "object": names[one.surface[row, column]], "image": one.name,
                     "pixel": [int(column), int(row)]}
    return found
