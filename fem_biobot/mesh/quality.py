"""Shape of tetrahedra: one number per element and its summary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.mesh.facets import EDGES, FACES, signed_volumes

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class MeshQuality:
    """Shape of the elements of a mesh.

    Attributes
    ----------
    minimum, mean
        Of the radius ratio [1].
    share_below_tenth
        Share of the elements with a radius ratio below 0.1 [1].
    worst
        Index of the worst element.
    shortest_edge, longest_edge
        [mm].
    """

    minimum: float
    mean: float
    share_below_tenth: float
    worst: int
    shortest_edge: float
    longest_edge: float


def radius_ratio(points: Array, cells: Ints) -> Array:
    """Three times the inscribed over the circumscribed sphere's radius, (e,) [1].

    One for the regular tetrahedron, zero for a flat one, negative for an inverted one. Gmsh calls it gamma.
    """
    volume = signed_volumes(points, cells)
    area = np.zeros_like(volume)
    for i, j, k in FACES.T:
        a = points[:, cells[i]]
        area += 0.5 * np.linalg.norm(np.cross(points[:, cells[j]] - a, points[:, cells[k]] - a, axis=0), axis=0)
    length = [np.linalg.norm(points[:, cells[j]] - points[:, cells[i]], axis=0) for i, j in EDGES.T]
    # products of opposite edges; the circumradius is the root of this over 24 volumes
    p, q, r = length[0] * length[5], length[1] * length[4], length[2] * length[3]
    root = np.sqrt(np.maximum((p + q + r) * (p + q - r) * (p - q + r) * (-p + q + r), 0.0))
    below = area * root
    return np.divide(216.0 * volume**2 * np.sign(volume), below, out=np.zeros_like(volume), where=below > 0)


def quality(points: Array, cells: Ints) -> MeshQuality:
    """Summary of the radius ratio and of the edge lengths."""
    ratio = radius_ratio(points, cells)
    worst = int(ratio.argmin())
    lengths = [np.linalg.norm(points[:, cells[j]] - points[:, cells[i]], axis=0) for i, j in EDGES.T]
    return MeshQuality(
        float(ratio[worst]),
        float(ratio.mean()),
        float((ratio < 0.1).mean()),
        worst,
        float(min(length.min() for length in lengths)),
        float(max(length.max() for length in lengths)),
    )
