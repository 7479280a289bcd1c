"""Surface terms that depend on the displacement: follower pressure and elastic foundation.

Each gives a nodal force and its derivative, block by block; `Scatter` adds the blocks to the matrix. The derivative of
a follower pressure is symmetric but for an integral along the edge of its surface (Schweizerhof and Ramm 1984), which
vanishes where the surface is closed or its edge is held.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import skfem
from numpy.typing import NDArray
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTri

from fem_biobot.errors import ModelError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.held import Held
from fem_biobot.solid.pattern import Pattern
from fem_biobot.solid.records import Foundation, Pressure, drive_name, numbers
from fem_biobot.solid.space import Array, Ints, Space

# a constant pressure on quadratic triangles is integrated exactly; a field deserves more
_DEGREE, _FIELD_DEGREE = 4, 6
# skew part of the pressures' stiffness, relative to its size, that counts as rounding
_SYMMETRIC = 1e-10
# epsilon[i, j, k], the permutation symbol
_EPSILON = np.array([[[(i - j) * (j - k) * (k - i) / 2 for k in range(3)] for j in range(3)] for i in range(3)])


@dataclass(frozen=True)
class Facets:
    """Facets of a surface, looking out of the body, with the basis at their quadrature points.

    Attributes
    ----------
    nodes
        Nodes of each facet, (b, f).
    values, slopes
        Basis (b, q) and its gradients on the unit triangle (b, 2, q).
    weights
        Quadrature weights on the unit triangle, (q,).
    """

    nodes: Ints
    values: Array
    slopes: Array
    weights: Array

    def tangents(self, x: Array) -> tuple[Array, Array]:
        """Derivatives of positions `x` (n, 3) by the two coordinates of the unit triangle, (f, q, 3) each."""
        corners = x[self.nodes]  # (b, f, 3)
        first, second = (np.einsum("bfi,bq->fqi", corners, self.slopes[:, d]) for d in range(2))
        return first, second

    def positions(self, x: Array) -> Array:
        """Positions of the quadrature points, (3, f, q)."""
        return np.einsum("bfi,bq->ifq", x[self.nodes], self.values)


def facets(mesh: BodyMesh, body: Space, name: str, what: str, degree: int) -> Facets:
    """Facets of a named part of the boundary; refuses a surface inside the body."""
    return facets_on(body, boundary(mesh, (name,), what), degree)


def facets_on(body: Space, triangles: Ints, degree: int) -> Facets:
    """Facets of triangles that look out of the body, (3, f)."""
    shape = skfem.ElementTriP2() if body.quadratic else skfem.ElementTriP1()
    local, weights = get_quadrature(RefTri, degree)
    nodes = body.surface_nodes(triangles)
    values = np.stack([np.broadcast_to(shape.lbasis(local, b)[0], weights.shape) for b in range(len(nodes))])
    slopes = np.stack([np.broadcast_to(shape.lbasis(local, b)[1], local.shape) for b in range(len(nodes))])
    return Facets(nodes, values, slopes, weights)


def boundary(mesh: BodyMesh, names: Sequence[str] | None, what: str) -> Ints:
    """Triangles of named parts of the boundary, each once, or of all of it, counter-clockwise from outside, (3, f)."""
    cells = mesh.cells
    # each face opposite to vertex 0, 1, 2, 3 of a positively oriented tetrahedron, looking out
    outer = np.concatenate([cells[list(k)] for k in ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))], axis=1)
    n = mesh.points.shape[1]

    def keys(t: Ints) -> Ints:
        low, middle, high = np.sort(t, axis=0)
        return (low * n + middle) * n + high

    known, first, count = np.unique(keys(outer), return_index=True, return_counts=True)
    if names is None:
        return outer[:, first[count == 1]]
    places = []
    for name in names:
        if name not in mesh.surfaces:
            raise ModelError(
                f"{what}: found no surface named {name!r}, expected one of {', '.join(mesh.surfaces) or 'none'}"
            )
        wanted = keys(mesh.surfaces[name])
        place = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
        if np.any(known[place] != wanted) or np.any(count[place] != 1):
            raise ModelError(f"{what} on {name!r}: found a surface inside the body, expected a part of its boundary")
        places.append(place)
    found = np.concatenate([np.zeros(0, dtype=np.int64), *places])
    return outer[:, first[found if len(places) == 1 else np.unique(found)]]


def node_areas(space: Space, points: Array, triangles: Ints) -> Array:
    """Share of each node in the area of a surface as drawn, (n,) [mm^2]: weights of the integral of a nodal field.

    Parameters
    ----------
    space
        Of the displacement.
    points, triangles
        Of the mesh, (3, v) [mm], and its corners on the surface, (3, f).
    """
    corners = points[:, triangles]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.linalg.norm(np.cross(one, two, axis=0), axis=0)
    nodes = space.surface_nodes(triangles)
    # of a quadratic field over a straight triangle the sides' middles carry all
    carrying = nodes[3:] if len(nodes) == 6 else nodes
    shares = np.bincount(carrying.ravel(), np.tile(area / 3.0, len(carrying)), minlength=space.n_nodes)
    return np.asarray(shares, dtype=np.float64)


class SurfaceTerm(Protocol):
    """Nodal force of a surface as a function of the displacement."""

    @property
    def facets(self) -> Facets:
        """Where it acts."""
        ...

    @property
    def name(self) -> str:
        """Name of the factor that drives it."""
        ...

    @property
    def by_load(self) -> bool:
        """Whether the load factor scales it."""
        ...

    def force(self, u: Array) -> Array:
        """Nodal force on the body at load factor 1, (n, 3) [mN]."""
        ...

    def blocks(self, u: Array) -> Array:
        """Minus its derivative, a stiffness, facet by facet, (b, b, 3, 3, f) [mN/mm]."""
        ...


@dataclass(frozen=True)
class FollowerPressure:
    """Pressure on the current surface: force ``-p n`` per current area."""

    facets: Facets
    X: Array
    pressure: Array  # (f, q) [kPa]
    name: str = ""
    by_load: bool = True

    def force(self, u: Array) -> Array:
        """See `SurfaceTerm`."""
        first, second = self.facets.tangents(self.X + u)
        push = -self.pressure[:, :, None] * np.cross(first, second)
        out = np.zeros_like(u)
        np.add.at(out, self.facets.nodes, np.einsum("bq,fqi,q->bfi", self.facets.values, push, self.facets.weights))
        return out

    def blocks(self, u: Array) -> Array:
        """See `SurfaceTerm`."""
        f = self.facets
        first, second = f.tangents(self.X + u)
        weight = self.pressure * f.weights
        turned = [np.einsum("ijk,fqk->ijfq", _EPSILON, tangent) for tangent in (second, first)]
        return np.einsum(
            "aq,bq,ijfq,fq->abijf", f.values, f.slopes[:, 0], turned[0], weight, optimize=True
        ) - np.einsum("aq,bq,ijfq,fq->abijf", f.values, f.slopes[:, 1], turned[1], weight, optimize=True)


@dataclass(frozen=True)
class ElasticFoundation:
    """Springs between a surface and where it was: force ``-k u`` per reference area."""

    facets: Facets
    stiffness: Array  # (b, b, 3, 3, f) [mN/mm]
    name: str = ""
    by_load: bool = False

    def force(self, u: Array) -> Array:
        """See `SurfaceTerm`."""
        out = np.zeros_like(u)
        np.add.at(out, self.facets.nodes, -np.einsum("abijf,bfj->afi", self.stiffness, u[self.facets.nodes]))
        return out

    def blocks(self, u: Array) -> Array:
        """See `SurfaceTerm`."""
        return self.stiffness


def follower_pressure(mesh: BodyMesh, body: Space, load: Pressure) -> FollowerPressure:
    """The record's pressure on its surface, evaluated at the reference positions."""
    what = f"pressure on {load.surface!r}"
    on = facets(mesh, body, load.surface, "pressure", _FIELD_DEGREE if callable(load.value) else _DEGREE)
    X = np.ascontiguousarray(body.points.T)
    shape = (on.nodes.shape[1], len(on.weights))
    if isinstance(load.value, Callable):
        at = on.positions(X).reshape(3, -1)
        found = numbers(load.value(at), f"{what}, a function")
        if found.shape != at.shape[1:]:
            raise ModelError(f"{what}: found shape {found.shape} from its function, expected ({at.shape[1]},)")
        value = found.reshape(shape)
    else:
        found = numbers(load.value, what, "a finite number")
        if found.ndim:
            raise ModelError(f"{what}: found {load.value!r}, expected one number or a function")
        value = np.broadcast_to(found, shape)
    return FollowerPressure(on, X, np.ascontiguousarray(value), drive_name(load))


def elastic_foundation(mesh: BodyMesh, body: Space, support: Foundation) -> ElasticFoundation:
    """The record's springs on its surface, along and across its reference normal."""
    on = facets(mesh, body, support.surface, "foundation", _DEGREE)
    first, second = on.tangents(np.ascontiguousarray(body.points.T))
    normal = np.cross(first, second)
    area = np.linalg.norm(normal, axis=-1)
    normal /= area[:, :, None]
    along = np.einsum("fqi,fqj->ijfq", normal, normal)
    eye = np.eye(3)[:, :, None, None]
    k = support.normal * along + support.tangential * (eye - along)
    stiffness = np.einsum("aq,bq,ijfq,fq,q->abijf", on.values, on.values, k, area, on.weights, optimize=True)
    return ElasticFoundation(on, stiffness)


@dataclass(frozen=True)
class Scatter:
    """Where the blocks of a surface's facets go in the matrix.

    Attributes
    ----------
    axes
        Own axes of the facets' nodes as rows, (b, f, 3, 3), or None where all are the global ones.
    places
        Entries of the upper triangle that are touched, each once, (k,).
    place
        For each entry of the blocks, which of these; flat.
    even, odd
        Its share in the symmetric and in the skew part there: one half, except on the diagonal.
    """

    axes: Array | None
    places: Ints
    place: Ints
    even: Array
    odd: Array

    def parts(self, blocks: Array) -> tuple[Array, Array]:
        """Symmetric and skew part of the blocks' sum at `places`, (k,) each."""
        if self.axes is not None:
            blocks = np.einsum("afik,abklf,bfjl->abijf", self.axes, blocks, self.axes, optimize=True)
        flat, count = blocks.ravel(), len(self.places)
        even, odd = (
            np.asarray(np.bincount(self.place, weights=flat * share, minlength=count), dtype=np.float64)
            for share in (self.even, self.odd)
        )
        return even, odd


def scatter(on: Facets, sparsity: Pattern, found: Held) -> Scatter:
    """Make the map for the facets of one surface."""
    own = found.turned[on.nodes]  # (b, f)
    axes = None
    if np.any(own >= 0):
        axes = np.where((own >= 0)[..., None, None], np.moveaxis(found.axes, 2, 0)[np.maximum(own, 0)], np.eye(3))
    dofs = 3 * on.nodes[:, None, :] + np.arange(3)[:, None]  # (b, 3, f)
    b, f = on.nodes.shape
    rows = np.broadcast_to(dofs[:, None, :, None, :], (b, b, 3, 3, f)).ravel()
    columns = np.broadcast_to(dofs[None, :, None, :, :], (b, b, 3, 3, f)).ravel()
    places, place = np.unique(sparsity.where(np.minimum(rows, columns), np.maximum(rows, columns)), return_inverse=True)
    even = np.where(rows == columns, 1.0, 0.5)
    odd = 0.5 * np.sign(columns - rows)
    return Scatter(axes, places, place.ravel(), even, odd)


def are_symmetric(
    terms: Sequence[tuple[FollowerPressure, Scatter]], n_entries: int, blocked: NDArray[np.int64], found: Held
) -> bool:
    """Whether the sum of all pressures' stiffnesses is symmetric but for held unknowns.

    Tried at a generic displacement that obeys the supports: constant pressures with held edges are so at every one.
    """
    even, odd = np.zeros(n_entries), np.zeros(n_entries)
    for term, to in terms:
        size = np.ptp(term.X, axis=0).max()
        u = 0.1 * size * np.sin(3.0 * term.X[:, ::-1] / size + [0.3, 1.1, 2.0])
        local = found.to_local(u).flatten()
        local[found.dofs] = 0.0
        u = found.to_global(local.reshape(-1, 3))
        for whole, part in zip((even, odd), to.parts(term.blocks(u)), strict=True):
            whole[to.places] += part
    odd[blocked] = 0.0
    return bool(np.linalg.norm(odd) <= _SYMMETRIC * np.linalg.norm(even))
