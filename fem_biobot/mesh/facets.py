"""Facets of a tetrahedral mesh: which triangles there are, whose they are, and which way they look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Array = NDArray[np.float64]

# outward faces of a positively oriented tetrahedron
FACES = np.array([[0, 0, 0, 1], [2, 1, 3, 2], [1, 3, 2, 3]])
EDGES = np.array([[0, 0, 0, 1, 1, 2], [1, 2, 3, 2, 3, 3]])


@dataclass(frozen=True)
class Facets:
    """All different triangles of a mesh.

    Attributes
    ----------
    triples
        Vertices, (3, f), with the normal out of the first element.
    elements
        The one or two elements at each facet, (2, f); the second is -1 on the boundary.
    crowded
        Facets that more than two elements share (a defect), indices.
    """

    triples: Ints
    elements: Ints
    crowded: Ints

    @property
    def boundary(self) -> Ints:
        """Indices of the facets with one element only."""
        return np.flatnonzero(self.elements[1] < 0)


def row_keys(rows: Ints, n: int) -> Ints:
    """One integer per column of `rows` (k, m), the same for the same set of vertices below `n`."""
    ordered = np.sort(rows, axis=0)
    if float(n) ** len(ordered) < 2**62:
        key = np.zeros(ordered.shape[1], dtype=np.int64)
        for row in ordered:
            key = key * n + row
        return key
    # too many vertices to pack: number the different columns instead
    return np.unique(ordered, axis=1, return_inverse=True)[1].reshape(-1).astype(np.int64)


def facets(cells: Ints) -> Facets:
    """Facets of the tetrahedra `cells` (4, e)."""
    e = cells.shape[1]
    triples = cells[FACES].transpose(0, 2, 1).reshape(3, 4 * e)
    keys = row_keys(triples, int(cells.max()) + 1)
    order = np.argsort(keys, kind="stable")
    first = np.flatnonzero(np.r_[True, np.diff(keys[order]) != 0])
    count = np.diff(np.r_[first, keys.size])
    second = np.full(first.size, -1, dtype=np.int64)
    shared = count > 1
    second[shared] = order[first[shared] + 1] // 4
    pair = np.stack([order[first] // 4, second])
    return Facets(triples[:, order[first]], pair, np.flatnonzero(count > 2))


def edges(cells: Ints) -> Ints:
    """Different edges of the tetrahedra, (2, k), lower vertex first."""
    n = int(cells.max()) + 1
    pairs = np.sort(cells[EDGES].reshape(2, -1), axis=0)
    packed = np.unique(pairs[0] * n + pairs[1])
    return np.stack([packed // n, packed % n])


def signed_volumes(points: Array, cells: Ints) -> Array:
    """Volumes of the tetrahedra, (e,) [mm^3]; negative where the vertices are numbered the wrong way round."""
    a, b, c, d = (points[:, row] for row in cells)
    u, v, w = b - a, c - a, d - a
    return (
        u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0])
    ) / 6.0
