"""The two surfaces of a sliding contact: quadrature points, multipliers and directions of one, facets of the other.

Multipliers sit at the corners of the bearing surface's facets, on each smooth side of its own, so that both faces of a
sharp edge press with their own normals. On quadratic elements the linear multipliers are fewer than the nodes, and the
pair is stable: pressures do not oscillate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.unbonded import connected, smooth_patches
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.space import Ints, Space
from fem_biobot.solid.surfaces import facets

# where the surfaces do not match, facets of many pieces meet: more points than the products of the basis ask for
_DEGREE = 6


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Both surfaces of a contact.

    Attributes
    ----------
    nodes
        Of the bearing facets, (b, f).
    values, slopes, hats
        Basis (b, k), its gradients (b, 2, k) and the linear one (3, k) at the quadrature points of a facet.
    weights
        Reference areas of the quadrature points, (f, k) [mm^2].
    across
        Weights of a facet's tangents in its direction around the body, (2, f).
    corners
        Multiplier of each corner, (3, f).
    vertex, side
        Vertex and smooth side of each multiplier, (c,).
    area
        Integral of each multiplier's function, (c,) [mm^2].
    part
        Which part of the contact (which pillar) a facet belongs to, (f,); -1 for none.
    other, other_part
        Nodes of the other surface's facets, (b, F), and their part, (F,).
    n_parts
        How many parts there are, in the order of the bearing facets' mean x.
    """

    nodes: Ints
    values: Array
    slopes: Array
    hats: Array
    weights: Array
    across: Array
    corners: Ints
    vertex: Ints
    side: Ints
    area: Array
    part: Ints
    other: Ints
    other_part: Ints
    n_parts: int


def surfaces_of(mesh: BodyMesh, body: Space, sliding: Sliding) -> Surfaces:
    """Both surfaces of a contact.

    Raises
    ------
    ModelError
        An unknown surface, one inside the body, or two that share nodes or nowhere touch.
    """
    on = facets(mesh, body, sliding.bearing, "sliding", _DEGREE)
    other = facets(mesh, body, sliding.body, "sliding", _DEGREE).nodes
    if np.intersect1d(on.nodes, other).size:
        raise ModelError(
            f"sliding: found {sliding.bearing!r} and {sliding.body!r} sharing nodes, expected surfaces with nodes of "
            "their own"
        )
    X = mesh.points
    triangles = on.nodes[:3]
    t1, t2 = X[:, triangles[1]] - X[:, triangles[0]], X[:, triangles[2]] - X[:, triangles[0]]
    normal = np.cross(t1, t2, axis=0)
    twice = np.linalg.norm(normal, axis=0)
    side = smooth_patches(X, triangles)
    pairs = np.stack([np.broadcast_to(side, triangles.shape).ravel(), triangles.ravel()])
    own, place = np.unique(pairs, axis=1, return_inverse=True)
    corners = place.reshape(triangles.shape)
    area = np.asarray(np.bincount(corners.ravel(), weights=np.tile(twice / 6.0, 3)), dtype=np.float64)
    part, other_part, n_parts = _parts(X, triangles, other[:3])
    return Surfaces(
        on.nodes,
        np.ascontiguousarray(on.values),
        np.ascontiguousarray(on.slopes),
        _hats(on.values),
        np.ascontiguousarray(twice[:, None] * on.weights),
        _across(normal / twice, t1, t2, np.asarray(sliding.axis, dtype=float)),
        corners.astype(np.int64),
        own[1],
        own[0],
        area,
        part,
        other,
        other_part,
        n_parts,
    )


def _hats(values: Array) -> Array:
    """Linear functions (3, k) from the values of the basis (b, k): its corners', and half of the sides' beside them."""
    if len(values) == 3:
        return np.ascontiguousarray(values)
    a, b, c = values[3:]
    return np.ascontiguousarray(values[:3] + 0.5 * np.stack([a + c, a + b, b + c]))


def _across(normal: Array, t1: Array, t2: Array, axis: Array) -> Array:
    """Weights of the tangents, (2, f), that make the direction around `axis` in each facet."""
    axis = axis / np.linalg.norm(axis)
    around = np.cross(axis, normal, axis=0)
    level = np.linalg.norm(around, axis=0) < 1e-6
    around[:, level] = t1[:, level]
    metric = np.array([[(p * q).sum(axis=0) for q in (t1, t2)] for p in (t1, t2)])
    along = np.stack([(around * t).sum(axis=0) for t in (t1, t2)])
    return np.ascontiguousarray(np.linalg.solve(np.moveaxis(metric, 2, 0), along.T[:, :, None])[:, :, 0].T)


def _parts(X: Array, triangles: Ints, other: Ints) -> tuple[Ints, Ints, int]:
    """Parts of both surfaces that lie against each other, joined where one touches several of the other."""
    n_one, one = connected(triangles)
    n_two, two = connected(other)
    near, far = np.unique(triangles), np.unique(other)
    size = float(np.ptp(X, axis=1).max())
    found = KDTree(X[:, far].T).query(X[:, near].T)
    distance, match = np.asarray(found[0]), np.asarray(found[1])
    label = np.full(X.shape[1], -1)
    group = np.arange(n_one + n_two)

    def root(k: int) -> int:
        while group[k] != k:
            k = int(group[k])
        return k

    label[triangles] = one
    label[other] = n_one + two
    for vertex, m in zip(near[distance < 1e-9 * size], match[distance < 1e-9 * size], strict=True):
        group[root(int(label[vertex]))] = root(int(label[far[m]]))
    roots = np.array([root(k) for k in range(n_one + n_two)])
    touching = np.intersect1d(roots[:n_one], roots[n_one:])
    if not touching.size:
        raise ModelError("sliding: found surfaces without a common position, expected two that touch where they begin")
    centre = X[0, triangles].mean(axis=0)
    touching = touching[np.argsort([float(centre[roots[one] == r].mean()) for r in touching])]
    number = np.full(n_one + n_two, -1)
    number[touching] = np.arange(touching.size)
    return number[roots[one]], number[roots[n_one + two]], int(touching.size)
