"""Array work on triangulated surfaces for drawing: edges worth a line, normals worth shading with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def triangle_normals(points: Array, triangles: Ints) -> Array:
    """Normals of length twice the area, (3, f) [mm^2], pointing outward for counter-clockwise triangles."""
    a, b, c = points[:, triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a, axis=0)


def _unit(vectors: Array) -> Array:
    """The same directions with length one; zero stays zero."""
    length = np.linalg.norm(vectors, axis=0)
    return vectors / np.where(length > 0.0, length, 1.0)


def feature_edges(
    points: Array, triangles: Ints, *, node_map: Ints | None = None, group: Ints | None = None, angle: float = 0.5
) -> Ints:
    """Edges at which the surface bends sharply, ends, or passes from one group to another.

    Parameters
    ----------
    points, triangles
        Surface, (3, n) [mm] and (3, f); take the undeformed one, whose faces are plane.
    node_map
        Node that stands for each node, (n,), where nodes are doubled (`fem_biobot.vtk.split_by_region`).
    group
        Group of each triangle, (f,), such as its region.
    angle
        Least angle between two neighbours' normals [rad].

    Returns
    -------
    Ints
        Node pairs, (2, s), in the numbering of `triangles`.
    """
    n_triangles = triangles.shape[1]
    pairs = np.hstack([triangles[[0, 1]], triangles[[1, 2]], triangles[[2, 0]]])
    key = np.sort(pairs if node_map is None else node_map[pairs], axis=0)
    owner = np.tile(np.arange(n_triangles), 3)
    order = np.lexsort(key)
    key, owner, pairs = key[:, order], owner[order], pairs[:, order]
    new = np.ones(order.size, dtype=bool)
    new[1:] = (key[:, 1:] != key[:, :-1]).any(axis=0)
    start = np.flatnonzero(new)
    count = np.diff(np.append(start, order.size))
    normal = _unit(triangle_normals(points, triangles))
    two = count == 2
    first, second = owner[start[two]], owner[start[two] + 1]
    sharp = (normal[:, first] * normal[:, second]).sum(axis=0) < np.cos(angle)
    if group is not None:
        sharp |= group[first] != group[second]
    keep = np.ones(start.size, dtype=bool)
    keep[two] = sharp
    return pairs[:, start[keep]]


def corner_normals(points: Array, triangles: Ints, *, angle: float = 0.6) -> Array:
    """Normals for smooth shading that keep sharp edges sharp.

    Parameters
    ----------
    points, triangles
        Surface, (3, n) [mm] and (3, f).
    angle
        Neighbours whose normals differ by more do not smooth each other [rad].

    Returns
    -------
    Array
        Unit normal of each triangle at each of its corners, (3, 3, f): component, corner, triangle. Area-weighted mean
        over the triangles around the corner.
    """
    normal = triangle_normals(points, triangles)
    unit = _unit(normal)
    n_triangles = triangles.shape[1]
    nodes = triangles.ravel()  # corner c of triangle t at c * f + t
    order = np.argsort(nodes, kind="stable")
    counts = np.bincount(nodes, minlength=points.shape[1])
    start = np.concatenate([[0], np.cumsum(counts)[:-1]])
    around = counts[nodes]  # triangles around each corner's node
    mine = np.repeat(np.arange(nodes.size), around)
    offset = np.arange(mine.size) - np.repeat(np.cumsum(around) - around, around)
    other = order[start[nodes[mine]] + offset] % n_triangles
    alike = (unit[:, mine % n_triangles] * unit[:, other]).sum(axis=0) >= np.cos(angle)
    mine, other = mine[alike], other[alike]
    total = np.array([np.bincount(mine, row[other], nodes.size) for row in normal], dtype=float)
    return _unit(total).reshape(3, 3, n_triangles)
