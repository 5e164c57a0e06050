"""Charts that lie in one plane keep their true shape: most charts of a building do."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .charts import Charts
from .triangle_normals import normals, unit

Float = NDArray[np.floating[Any]]

# A chart is planar if no triangle turns further from its mean normal than this cosine (1.8 degrees): lying in the plane
# then costs it .05 % of its area at most.
PLANAR_COSINE = 0.9995


def bent(positions: Float, charts: Charts) -> NDArray[np.bool_]:
    """(k,) bool: whether a chart leaves its plane. positions : (t, 3, 3), metres."""
    normal = normals(positions)
    mean = _mean_normals(normal, charts)
    length = np.linalg.norm(normal, axis=1)
    bent = np.zeros(charts.count, bool)
    bent[charts.chart[(normal * mean[charts.chart]).sum(axis=1) < PLANAR_COSINE * length]] = True
    return bent


def lay_flat(positions: Float, charts: Charts, some: NDArray[np.bool_]) -> Charts:
    """Lay some charts (k,) into the plane across their mean normal, one of their longest sides along u."""
    chosen = np.flatnonzero(some[charts.chart])
    mean = _mean_normals(normals(positions), charts)
    edge = np.roll(positions, -1, axis=1) - positions
    longest = edge[np.arange(len(edge)), (edge**2).sum(axis=2).argmax(axis=1)]
    # Directions in the plane: along the longest side of any of the triangles, and square to it.
    along = np.zeros((charts.count, 3))
    along[charts.chart] = longest
    along = unit(along - (along * mean).sum(axis=1, keepdims=True) * mean)
    across = np.cross(mean, along)
    first = np.zeros((charts.count, 3))
    first[charts.chart] = positions[:, 0]
    own = charts.chart[chosen]
    relative = positions[chosen] - first[own][:, None]
    uv = charts.uv.copy()
    uv[chosen] = np.stack([np.einsum("tcx,tx->tc", relative, along[own]),
                           np.einsum("tcx,tx->tc", relative, across[own])], axis=2)
    return replace(charts, uv=uv)


def _mean_normals(normal: Float, charts: Charts) -> Float:
    """(k, 3) unit normals of the charts, weighted by area."""
    return unit(np.stack([np.bincount(charts.chart, normal[:, axis], charts.count) for axis in range(3)], axis=1))
