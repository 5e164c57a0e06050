"""Which samples of a mesh lie side by side: found by walks over its triangles.

From every sample a walk goes each of eight ways, a sample's spacing far, straight on over the edges inside of a smooth
part: each triangle is turned about the edge into the plane of the one before (a straightest geodesic, Polthier &
Schmies 1998). The sample in whose part it ends lies beside, and its way that points most nearly the same leads on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .across import WAYS
from .components import shared_edges
from .corner_samples import CornerSamples
from .neighbours import Neighbours, hops
from .parallel import Run, shares

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Edges that a walk crosses at most.
MOST_CROSSED = 8
# A walk leaves the sample's own part, by so much of the way to its border: thin parts are longer than wide.
BEYOND_OWN = 1.3
# A sample whose middle lies further than this from where a walk ended is not beside, lengths of the walk.
ASTRAY = 1.0
# Samples whose walks a thread goes at once: eight of some 300 bytes each.
CHUNK = 2**14
_LENGTHS = np.linalg.norm(WAYS, axis=1)
_DIRECTIONS = WAYS / _LENGTHS[:, None]
# A triangle's side s runs from corner s to the next, and lies across from corner s + 2.
_ACROSS = np.array([2, 0, 1])


class SampleNeighbours(Neighbours):
    """Samples beside each other on a mesh.

    Parameters
    ----------
    beside : (n, 8) int32, where each of the eight ways leads; -1 for nowhere.
    onward : (n, 8) int8, by which way it goes on there.
    """

    def __init__(self, beside: NDArray[np.int32], onward: NDArray[np.int8]) -> None:
        super().__init__()
        self._beside, self._onward = beside, onward

    def inner(self) -> NDArray[np.bool_]:
        return np.ones(len(self._beside), np.bool_)

    def _reached(self, step: int) -> NDArray[np.int32]:
        out = np.empty_like(self._beside)
        rows = np.arange(len(out))
        for way in range(len(WAYS)):
            out[:, way] = hops(self._beside, self._onward, step, rows, np.full(len(out), way))
        return out


def sample_neighbours(corners: Float, node: Int, samples: CornerSamples, run: Run) -> SampleNeighbours:
    """The neighbours of samples on a mesh.

    Parameters
    ----------
    corners : (t, 3, 3) metres.
    node : (t, 3) int, the same for corners that belong together: over edges that join two triangles' nodes light goes
        on.
    """
    mesh = _FlatMesh.of(corners, node, samples.cuts > 0)
    beside, onward = np.empty((len(samples), len(WAYS)), np.int32), np.empty((len(samples), len(WAYS)), np.int8)

    def work(part: slice) -> None:
        beside[part], onward[part] = _walked(mesh, samples, np.arange(part.start, part.stop))

    run.map(work, shares(len(samples), CHUNK))
    return SampleNeighbours(beside, onward)


@dataclass(frozen=True, eq=False)
class _FlatMesh:
    """Triangles laid flat, each in a frame of its own: corner 0 at the origin, corner 1 on the x axis.

    length : (t,) x of corner 1;  third : (t, 2) corner 2.
    beyond : (t, 3) the triangle beyond each side, -1 for none;  entry : (t, 3) which of its sides that is.
    turn, shift : (t, 3, 2, 2) and (t, 3, 2), from a triangle's frame to that of the one beyond.
    """

    length: Float
    third: Float
    beyond: Int
    entry: Int
    turn: Float
    shift: Float

    @classmethod
    def of(cls, corners: Float, node: Int, usable: NDArray[np.bool_]) -> _FlatMesh:
        """The mesh of corners (t, 3, 3), whose triangles hang together where two of their nodes are the same."""
        sides = corners[:, 1:] - corners[:, :1]
        length = np.linalg.norm(sides[:, 0], axis=1)
        usable = usable & (length > 0)
        along = sides[:, 0] / np.where(usable, length, 1)[:, None]
        x = (sides[:, 1] * along).sum(axis=1)
        third = np.column_stack([x, np.linalg.norm(sides[:, 1] - x[:, None] * along, axis=1)])
        usable &= third[:, 1] > 0
        length, third = np.where(usable, length, 1), np.where(usable[:, None], third, 1)
        flat = np.zeros((len(corners), 3, 2))
        flat[:, 1, 0], flat[:, 2] = length, third
        first, second, side, other = shared_edges(node)
        both = usable[first] & usable[second]
        first, second, side, other = first[both], second[both], side[both], other[both]
        beyond, entry = np.full(node.shape, -1), np.zeros(node.shape, np.int64)
        turn, shift = np.zeros((*node.shape, 2, 2)), np.zeros((*node.shape, 2))
        for (a, a_side), (b, b_side) in (((first, side), (second, other)), ((second, other), (first, side))):
            beyond[a, a_side], entry[a, a_side] = b, b_side
            turn[a, a_side], shift[a, a_side] = _unfolding(flat[a], a_side, node[a], flat[b], b_side, node[b])
        return cls(length, third, beyond, entry, turn, shift)

    def points(self, triangle: Int, weight: Float) -> Float:
        """(n, 2) places in their triangles' frames, of weights (n, 2) of corners 1 and 2."""
        return np.asarray(weight[:, :1] * np.column_stack([self.length[triangle], np.zeros(len(triangle))])
                          + weight[:, 1:] * self.third[triangle])

    def weights(self, triangle: Int, points: Float) -> Float:
        """(n, 3) weights of the corners at places (n, 2)."""
        third = self.third[triangle]
        v = points[:, 1] / third[:, 1]
        u = (points[:, 0] - v * third[:, 0]) / self.length[triangle]
        return np.column_stack([1 - u - v, u, v])


def _unfolding(flat: Float, side: Int, node: Int, other: Float, other_side: Int, other_node: Int
               ) -> tuple[Float, Float]:
    """Turn (n, 2, 2) and shift (n, 2) from triangles' frames to others', about a side of both."""
    every = np.arange(len(flat))
    start, end = (flat[every, (side + step) % 3] for step in (0, 1))
    p, q = (other[every, (other_side + step) % 3] for step in (0, 1))
    # Sides usually run against each other.
    against = node[every, side] != other_node[every, other_side]
    p, q = np.where(against[:, None], q, p), np.where(against[:, None], p, q)
    along, ahead = _units(end - start), _units(q - p)
    out = _square(along, flat[every, (side + 2) % 3] - start, -1)
    inward = _square(ahead, other[every, (other_side + 2) % 3] - p, 1)
    turn = ahead[:, :, None] * along[:, None] + inward[:, :, None] * out[:, None]
    return np.asarray(turn), np.asarray(p - np.einsum("nij,nj->ni", turn, start))


def _units(ways: Float) -> Float:
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))


def _square(along: Float, towards: Float, sign: int) -> Float:
    """Unit vectors square to `along`, on the side of `towards`, or with sign -1 on the other one."""
    square = np.column_stack([-along[:, 1], along[:, 0]])
    facing = np.einsum("nc,nc->n", square, towards) >= 0
    return np.asarray(np.where(facing[:, None], square, -square) * sign)


def _walked(mesh: _FlatMesh, samples: CornerSamples, rows: Int) -> tuple[Int, Int]:
    """Where walks of some samples end, and by which way they go on there, (m, 8) each."""
    sample, way = (a.ravel() for a in np.meshgrid(rows, np.arange(len(WAYS)), indexing="ij"))
    triangle = samples.triangle[sample]
    start, direction = mesh.points(triangle, samples.weight[sample]), _DIRECTIONS[way]
    length = np.maximum(np.sqrt(samples.area[sample]) * _LENGTHS[way],
                        BEYOND_OWN * _to_border(mesh, samples, sample, direction))
    target = start + length[:, None] * direction
    end, ahead = np.full(len(sample), -1), np.zeros(len(sample), np.int64)
    entered = np.full(len(sample), -1)
    walk = np.arange(len(sample))
    for _ in range(MOST_CROSSED + 1):
        before, after = mesh.weights(triangle, start)[:, _ACROSS], mesh.weights(triangle, target)[:, _ACROSS]
        leaving = (after < 0) & (np.arange(3) != entered[:, None])
        arrived = ~leaving.any(axis=1)
        here = np.flatnonzero(arrived)
        end[walk[here]], ahead[walk[here]] = _arrival(mesh, samples, triangle[here], target[here], direction[here],
                                                      length[walk[here]])
        there = np.maximum(before, 0)
        part = np.where(leaving, there / np.where(leaving, there - after, 1), np.inf)
        side = part.argmin(axis=1)
        going = np.flatnonzero(~arrived & (mesh.beyond[triangle, side] >= 0))
        if not len(going):
            break
        walk, triangle, side = walk[going], triangle[going], side[going]
        turn, shift = mesh.turn[triangle, side], mesh.shift[triangle, side]
        start, target = (np.einsum("nij,nj->ni", turn, points[going]) + shift for points in (start, target))
        direction = np.einsum("nij,nj->ni", turn, direction[going])
        triangle, entered = mesh.beyond[triangle, side], mesh.entry[triangle, side]
    end[end == sample] = -1
    return end.reshape(len(rows), -1), ahead.reshape(len(rows), -1)


def _to_border(mesh: _FlatMesh, samples: CornerSamples, sample: Int, direction: Float) -> Float:
    """(n,) metres from samples to the border of their parts, along directions (n, 2)."""
    triangle = samples.triangle[sample]
    change = mesh.weights(triangle, direction) - mesh.weights(triangle, np.zeros_like(direction))
    change *= samples.cuts[triangle, None]
    change = np.where(samples.mirrored[sample, None], -change, change)
    # In its part a sample has a weight of 1/3 of each corner.
    return np.asarray(1 / (3 * np.maximum(-change.min(axis=1), 1e-300)))


def _arrival(mesh: _FlatMesh, samples: CornerSamples, triangle: Int, target: Float, direction: Float,
             length: Float) -> tuple[Int, Int]:
    """The samples at the ends of walks, -1 for none near, and which ways go on there."""
    found = samples.at(triangle, mesh.weights(triangle, target)[:, 1:])
    astray = np.linalg.norm(mesh.points(triangle, samples.weight[found]) - target, axis=1)
    return np.where(astray <= ASTRAY * length, found, -1), (direction @ _DIRECTIONS.T).argmax(axis=1)
