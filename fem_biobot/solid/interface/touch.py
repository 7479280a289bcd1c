"""Which points of two sliding surfaces meet where, and the forces and gaps that follow from tractions there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array
from fem_biobot.solid.interface import kernels
from fem_biobot.solid.interface.rays import kernels as rays
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.interface.state import Touch
from fem_biobot.solid.interface.surface import Surfaces
from fem_biobot.solid.space import Ints

# beyond its sides, in local coordinates, up to which a point keeps its opposite facet: so pairs do not flicker
_MARGIN = 0.05
# share of a multiplier's area below which it is left out: the other surface's rim covers next to none of it
_LEAST_COVER = 0.02


class Pairing(NamedTuple):
    """Which quadrature points are in contact, and with which facets.

    Attributes
    ----------
    point, facet, at
        Points, opposite facets now, place and gap, (h,), (h,), (h, 3).
    facet0, at0
        Facets and places that were opposite when the step began.
    pair, pair0
        Number of each point's pair of facets, (h,).
    nodes, nodes0
        Nodes of the pairs, bearing facet's first, (2b, g).
    corners, corners0
        Multipliers of the pairs' bearing facets, (3, g).
    cover
        Area over which each multiplier meets the other surface, (c,) [mm^2].
    """

    point: Ints
    facet: Ints
    at: Array
    facet0: Ints
    at0: Array
    pair: Ints
    pair0: Ints
    nodes: Ints
    nodes0: Ints
    corners: Ints
    corners0: Ints
    cover: Array


class Terms(NamedTuple):
    """What a contact adds to the equations at a trial: see `kernels.meet`; `gaps` are means."""

    force: Array
    gaps: Array
    K: Array
    C: Array
    D: Array
    D0: Array


class Contact:
    """One sliding contact of a system of equations."""

    def __init__(self, surfaces: Surfaces, sliding: Sliding, X: Array) -> None:
        self.surfaces, self.sliding = surfaces, sliding
        self.X = X  # (n, 3)
        around, axial = sliding.radii
        self.radii = np.tile([around, around, axial, axial], (self.count, 1))
        self.part = np.repeat(surfaces.part, surfaces.weights.shape[1])

    @property
    def count(self) -> int:
        """Number of multipliers."""
        return len(self.surfaces.vertex)

    def begun(self) -> Touch:
        """Surfaces that lie against each other without pressing."""
        none = np.zeros((self.count, 3))
        points = self.surfaces.weights.size
        facet, at = np.full(points, -1, dtype=np.int64), np.zeros((points, 3))
        self._locate(self.X, facet, at)
        if not np.any(facet >= 0):
            raise ModelError("sliding: found no points of the two surfaces opposite to each other, expected some")
        return Touch(none, np.zeros(self.count, dtype=np.int64), none.copy(), facet, at)

    def frames(self, x: Array) -> tuple[Array, Array]:
        """Quadrature points (p, 3) [mm] of the bearing surface and their frames (p, 3, 3): rows n, a1, a2."""
        s = self.surfaces
        points = np.empty((*s.weights.shape, 3))
        basis = np.empty((*s.weights.shape, 3, 3))
        kernels.frames(s.values, s.slopes, x, s.nodes, s.across, points, basis)
        return points.reshape(-1, 3), basis.reshape(-1, 3, 3)

    def _locate(self, x: Array, facet: Ints, at: Array) -> None:
        points, basis = self.frames(x)
        normals = np.ascontiguousarray(basis[:, 0])
        rays.locate(points, normals, self.part, x, self.surfaces.other, self.surfaces.other_part, _MARGIN, facet, at)

    def paired(self, u: Array, before: Touch, now: Pairing | None = None) -> Pairing:
        """The pairs at a displacement (n, 3), where slip is measured from what was opposite `before`.

        Points that meet the other surface only now are measured from where they met first.
        """
        facet, at = before.facet.copy(), before.at.copy()
        facet0, at0 = before.facet.copy(), before.at.copy()
        if now is not None:
            facet[:] = -1
            for mine, theirs in ((facet, now.facet), (facet0, now.facet0)):
                mine[now.point] = theirs
            at[now.point], at0[now.point] = now.at, now.at0
        self._locate(np.ascontiguousarray(self.X + u), facet, at)
        fresh = (facet0 < 0) & (facet >= 0)
        facet0[fresh], at0[fresh] = facet[fresh], at[fresh]
        s = self.surfaces
        f, k = s.weights.shape
        cover = np.zeros(self.count)
        met = facet >= 0
        share = np.where(met.reshape(f, k), s.weights, 0.0) @ s.hats.T  # (f, 3)
        np.add.at(cover, s.corners, share.T)
        cover[cover < _LEAST_COVER * s.area] = 0.0
        point = np.flatnonzero(met)
        own = point // k
        pair, nodes, corners = self._pairs(own, facet[point])
        pair0, nodes0, corners0 = self._pairs(own, facet0[point])
        return Pairing(
            point, facet[point], at[point], facet0[point], at0[point], pair, pair0, nodes, nodes0, corners, corners0,
            cover,
        )  # fmt: skip

    def _pairs(self, own: Ints, other: Ints) -> tuple[Ints, Ints, Ints]:
        s = self.surfaces
        count = s.other.shape[1]
        keys, pair = np.unique(own * count + other, return_inverse=True)
        mine, theirs = keys // count, keys % count
        nodes = np.concatenate([s.nodes[:, mine], s.other[:, theirs]])
        return pair.astype(np.int64), np.ascontiguousarray(nodes), np.ascontiguousarray(s.corners[:, mine])

    def moved(self, u: Array, pairing: Pairing) -> tuple[Pairing, int]:
        """The same pairs with their places at another displacement, and how many points could not be followed."""
        x = np.ascontiguousarray(self.X + u)
        points, basis = self.frames(x)
        at = pairing.at.copy()
        normals = np.ascontiguousarray(basis[pairing.point, 0])
        lost = rays.follow(points[pairing.point], normals, x, self.surfaces.other, pairing.facet, at)
        return pairing._replace(at=at), int(lost)

    def terms(self, u: Array, traction: Array, pairing: Pairing, *, derive: bool = True) -> Terms:
        """Forces and mean gaps of the pairs, and their derivatives."""
        s = self.surfaces
        x = np.ascontiguousarray(self.X + u)
        g, g0, b = (pairing.nodes.shape[1], pairing.nodes0.shape[1], len(pairing.nodes)) if derive else (0, 0, 0)
        force, gaps = np.zeros_like(x), np.zeros((self.count, 3))
        K, C = np.zeros((g, b, b, 3, 3)), np.zeros((g, b, 3, 3, 3))
        D, D0 = np.zeros((g, 3, b, 3)), np.zeros((g0, 3, 2, b, 3))
        kernels.meet(
            s.values, s.slopes, s.hats, s.weights, x, s.nodes, s.across, s.corners, s.other, pairing.point,
            pairing.facet, pairing.at, pairing.facet0, pairing.at0, pairing.pair, pairing.pair0, traction,
            force, gaps, K, C, D, D0,
        )  # fmt: skip
        covered = pairing.cover > 0.0
        gaps[covered] /= pairing.cover[covered, None]
        gaps[~covered] = 0.0
        return Terms(force, gaps, K, C, D, D0)

    def touch(self, traction: Array, state: Ints, gaps: Array, pairing: Pairing) -> Touch:
        """The state of the contact that a step ends with."""
        facet = np.full(self.surfaces.weights.size, -1, dtype=np.int64)
        at = np.zeros((facet.size, 3))
        facet[pairing.point], at[pairing.point] = pairing.facet, pairing.at
        return Touch(traction, state, gaps, facet, at)
