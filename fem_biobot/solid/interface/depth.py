"""How deep points lie below a surface: the distance to the nearest place of it, whatever way they were found.

Along the normal of a side a point just beside a sharp edge finds the other surface far away where that has gone round
the edge, though next to nothing overlaps there; the nearest place of the surface is on the edge's other side then.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from fem_biobot.material.law import Array
from fem_biobot.solid.space import Ints

# corners of the flat triangles that stand for a facet of six nodes, its corners first, then middles of 01, 12, 02
_PIECES = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]).T


def distances(points: Array, reach: Array, x: Array, nodes: Ints) -> Array:
    """Distances of points to the nearest place of a surface, (p,) [mm].

    Parameters
    ----------
    points
        (p, 3) [mm].
    reach
        Of each point, the distance to some place of the surface, (p,) [mm].
    x, nodes
        Positions of the nodes (n, 3) [mm], and those of the facets, (b, f) with three or six; of six, facets are four
        flat triangles, which leaves out the bulge of their sides between the nodes.
    """
    triangles = nodes if len(nodes) == 3 else nodes[_PIECES].reshape(3, -1)
    corners = x[triangles]  # (3, t, 3)
    centres = corners.mean(axis=0)
    radius = np.linalg.norm(corners - centres, axis=2).max(axis=0)
    # by size, so that a large triangle somewhere does not make every search a wide one
    found = np.array(reach, dtype=float)
    for group in np.array_split(np.argsort(radius), min(8, len(radius))):
        near = KDTree(centres[group]).query_ball_point(points, found + radius[group].max())
        which = np.repeat(np.arange(len(points)), [len(each) for each in near])
        if len(which):
            those = group[np.concatenate([np.asarray(each, dtype=np.int64) for each in near if each])]
            np.minimum.at(found, which, _to_triangles(points[which], corners[:, those]))
    return found


def _to_triangles(p: Array, corners: Array) -> Array:
    """Distance of each point (k, 3) to its own triangle, (3, k, 3): to its inside, or to the nearest of its sides."""
    best = np.full(len(p), np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        side = corners[b] - corners[a]
        share = np.clip(((p - corners[a]) * side).sum(axis=1) / (side * side).sum(axis=1), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(p - corners[a] - share[:, None] * side, axis=1))
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    inside = np.ones(len(p), dtype=bool)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        inside &= (np.cross(corners[b] - corners[a], p - corners[a]) * normal).sum(axis=1) >= 0.0
    height = np.abs(((p - corners[0]) * normal).sum(axis=1))
    return np.where(inside, height, best)
