"""Exact radiosity of two equal plates that face each other, by Nystroem's method: a twin that shares nothing with ours.

    B(x) = E + rho sum_k w_k K(x, x_k) B(x_k)

at Gauss nodes x_k, solved by LU; the same sum then gives B anywhere. The plates are well apart, so K is smooth and the
digits grow with every node (Atkinson 1997, The Numerical Solution of Integral Equations of the Second Kind, chapter 4).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

Float = np.ndarray
Kernel = Callable[[Float, Float], Float]


def gauss(low: float, high: float, count: int) -> tuple[Float, Float]:
    """Gauss-Legendre nodes and weights (count,) between two bounds."""
    node, weight = np.polynomial.legendre.leggauss(count)
    return low + (high - low) * (node + 1) / 2, (high - low) * weight / 2


def radiosity(kernel: Kernel, nodes: Float, weights: Float, reflectance: float,
              exitance: float = 1.0) -> Callable[[Float], Float]:
    """B(x) W/m2 of plates that both emit `exitance` W/m2; `kernel(x, y)` is (len(x), len(y)), per unit of weight."""
    matrix = np.eye(len(weights)) - reflectance * kernel(nodes, nodes) * weights
    solved = np.linalg.solve(matrix, np.full(len(weights), exitance))
    return lambda x: exitance + reflectance * (kernel(x, nodes) * weights) @ solved


def discs(r: Float, s: Float, gap: float = 1.0) -> Float:
    """From radius r on one disc to rings of radius s on the other: cos cos' / (pi d^2), integrated over the azimuth."""
    a = r[:, None] ** 2 + s**2 + gap**2
    return np.asarray(2 * gap**2 * a / (a**2 - 4 * r[:, None] ** 2 * s**2) ** 1.5 * s)


def endless_strips(x: Float, y: Float, gap: float = 1.0) -> Float:
    """From x across one strip to lines at y across the other: cos cos' / (2 d)."""
    return np.asarray(gap**2 / 2 / ((x[:, None] - y) ** 2 + gap**2) ** 1.5)


def rectangles(x: Float, y: Float, gap: float = 1.0) -> Float:
    """From points x (n, 2) on one plate to points y (m, 2) on the other: cos cos' / (pi d^2)."""
    return np.asarray(gap**2 / np.pi / (((x[:, None] - y) ** 2).sum(axis=2) + gap**2) ** 2)


def rectangle_nodes(width: float, length: float, across: int, along: int) -> tuple[Float, Float]:
    """Gauss nodes (n, 2) and weights (n,) of a plate [0, width] x [-length / 2, length / 2]."""
    x, wx = gauss(0, width, across)
    y, wy = gauss(-length / 2, length / 2, along)
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2), np.outer(wx, wy).reshape(-1)
