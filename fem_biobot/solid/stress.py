"""Stresses of a state at its quadrature points, and how they are carried to elements and places in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_biobot.material.active import ActiveLaw
from fem_biobot.material.force_velocity import Straining
from fem_biobot.material.law import PAIRS, Array, Law, at_elements, inverse, volume_ratio
from fem_biobot.material.muscle_tension import MuscleTension
from fem_biobot.material.volume import volume_measure
from fem_biobot.solid.dynamics.strain import green_lagrange, strain_change
from fem_biobot.solid.mixed.pressure import PressureField
from fem_biobot.solid.model import SolidState
from fem_biobot.solid.space import Ints
from fem_biobot.solid.system import Points, System


def second_piola_stress(points: Points) -> Array:
    """Second Piola stress in full, (3, 3, e, q) [kPa], symmetric."""
    S = np.empty((3, 3, *points.psi.shape))
    for a, (i, j) in enumerate(PAIRS):
        S[i, j] = S[j, i] = points.S[a]
    return S


def first_piola_stress(points: Points) -> Array:
    """First Piola stress ``P = F S``, (3, 3, e, q) [kPa]: force per reference area."""
    return np.einsum("im...,mk...->ik...", points.F, second_piola_stress(points))


def cauchy_stress(points: Points) -> Array:
    """Cauchy stress ``P F^T / J``, (3, 3, e, q) [kPa], symmetric: force per current area."""
    return np.einsum("ik...,jk...->ij...", first_piola_stress(points), points.F) / volume_ratio(points.F)


def von_mises(sigma: Array) -> Array:
    """Von Mises equivalent of a Cauchy stress (3, 3, ...) [kPa], (...) [kPa]."""
    trace = np.einsum("ii...->...", sigma)
    square = np.einsum("ij...,ij...->...", sigma, sigma)
    return np.sqrt(np.maximum(1.5 * (square - trace**2 / 3.0), 0.0))


def fibre_stress(state: SolidState, sigma: Array) -> Array:
    """Cauchy stress along the current fibre, ``a . sigma a``, (e, q) [kPa]; not a number where there are no fibres.

    Passive and active part together: what the tissue carries along its fibres.
    """
    out = np.full(sigma.shape[2:], np.nan)
    for c in state.model.system.contractions:
        a = np.einsum("ik...,k...->i...", state.F[:, :, c.elements], c.a0[:, c.elements])
        a /= np.sqrt(np.einsum("i...,i...->...", a, a))
        out[c.elements] = np.einsum("i...,ij...,j...->...", a, sigma[:, :, c.elements], a)
    return out


def element_mean(system: System, values: Array) -> Array:
    """Volume mean over each element of a field at the quadrature points, (..., e, q) to (..., e)."""
    dV = system.space.dV
    return np.einsum("...eq,eq->...e", values, dV) / dV.sum(axis=1)


@dataclass(frozen=True)
class Probe:
    """A cloud of reference positions located in a mesh once, to average fields over it again and again.

    Attributes
    ----------
    elements
        Element of each position, (k,).
    slopes
        Gradients of the element's basis there, (b, 3, k) [1/mm].
    barycentric
        Barycentric coordinates in the element, (4, k).
    """

    elements: Ints
    slopes: Array
    barycentric: Array

    def deformation_gradient(self, state: SolidState) -> Array:
        """``F`` at the positions, (3, 3, k) [1].

        An element far out of shape may be inverted at its nodes though not at its quadrature points; there the nearest
        of those stands in, so that laws can be evaluated.
        """
        space = state.model.system.space
        u = state.u[:, space.nodes[:, self.elements]]
        F = np.eye(3)[:, :, None] + np.einsum("ibk,bdk->idk", u, self.slopes)
        inverted = np.flatnonzero(np.linalg.det(np.moveaxis(F, -1, 0)) <= 0.0)
        apart = self.barycentric[:, inverted, None] - space.corner_values[:, None, :]
        nearest = np.argmin(np.einsum("cnq,cnq->nq", apart, apart), axis=1)
        F[:, :, inverted] = state.F[:, :, self.elements[inverted], nearest]
        return F

    def cauchy_stress(self, state: SolidState) -> Array:
        """Cauchy stress of the elements' own laws at the positions, (3, 3, k) [kPa]."""
        return self._cauchy(state, self.deformation_gradient(state))

    def fibre_fields(self, state: SolidState) -> tuple[Array, Array]:
        """Fibre stretch [1] and Cauchy stress along the fibre [kPa] at the positions, (k,); zero without fibres."""
        F = self.deformation_gradient(state)
        sigma = self._cauchy(state, F)
        stretch, stress = np.zeros(F.shape[2]), np.zeros(F.shape[2])
        for c in state.model.system.contractions:
            mine = np.isin(self.elements, c.elements)
            a = np.einsum("ikn,kn->in", F[:, :, mine], c.a0[:, self.elements[mine], 0])
            stretch[mine] = np.sqrt(np.einsum("in,in->n", a, a))
            stress[mine] = np.einsum("in,ijn,jn->n", a, sigma[:, :, mine], a) / stretch[mine] ** 2
        return stretch, stress

    def _cauchy(self, state: SolidState, F: Array) -> Array:
        system = state.model.system
        P = np.zeros_like(F)
        for law, elements in system.laws:
            mine = np.isin(self.elements, elements)
            if mine.any():
                P[:, :, mine] += at_elements(law, self.elements[mine]).stress(F[:, :, mine])
        if system.mixed is not None and state.pressure is not None:
            self._add_pressure(system.mixed.field, state.pressure, F, P)
        for c in system.contractions:
            mine = np.isin(self.elements, c.elements)
            if mine.any():
                tension = _tension_at(c.law_at(state.step), self.elements[mine], self._positions(system, mine))
                if state.straining is not None and isinstance(tension, MuscleTension):
                    tension = tension.straining(self._straining(state, F, mine))
                P[:, :, mine] += tension.stress(F[:, :, mine])
        return np.einsum("ikn,jkn->ijn", P, F) / volume_ratio(F)

    def _straining(self, state: SolidState, F: Array, mine: np.ndarray) -> Straining:
        """How some of the positions are being strained."""
        assert state.velocity is not None
        v = state.velocity[:, state.model.system.space.nodes[:, self.elements[mine]]]
        dF = np.einsum("ibk,bdk->idk", v, self.slopes[:, :, mine])
        return Straining(green_lagrange(F[:, :, mine]), strain_change(F[:, :, mine], dF), 0.0)

    def _positions(self, system: System, mine: np.ndarray) -> Array:
        """Reference positions of some of the probe's points, (3, k) [mm]."""
        corners = system.space.points[:, system.space.nodes[:4, self.elements[mine]]]
        return np.einsum("ick,ck->ik", corners, self.barycentric[:, mine])

    def _add_pressure(self, field: PressureField, pressure: Array, F: Array, P: Array) -> None:
        """Add the first Piola stress ``p dg/dF`` of the mixed form, in place."""
        for part in field.parts:
            mine = np.isin(self.elements, part.elements)
            if mine.any():
                p = np.einsum("cn,cn->n", self.barycentric[:, mine], pressure[field.nodes[:, self.elements[mine]]])
                J = volume_ratio(F[:, :, mine])
                slope = volume_measure(J, part.measure)[1]
                P[:, :, mine] += p * slope * J * inverse(F[:, :, mine]).swapaxes(0, 1)


def _tension_at(law: ActiveLaw, elements: Ints, X: Array) -> Law:
    """The law of a tension at positions (3, k) [mm] in these elements."""
    return law.at_positions(elements, X) if isinstance(law, MuscleTension) else at_elements(law, elements)


def probe(system: System, X: Array) -> Probe:
    """Locate positions (3, k) [mm]; those outside the body are left out."""
    space = system.space
    corners = space.points[:, space.nodes[:4]]
    low, high = corners.min(axis=1), corners.max(axis=1)
    margin = 1e-9 * np.ptp(space.points, axis=1).max()
    near = np.flatnonzero(
        np.all((low <= X.max(axis=1)[:, None] + margin) & (high >= X.min(axis=1)[:, None] - margin), axis=0)
    )
    found = np.full(X.shape[1], -1)
    best = np.full(X.shape[1], -np.inf)
    for e in near:
        local = space.to_reference[:, :, e] @ (X - corners[:, 0, e][:, None])
        inside = np.minimum(local.min(axis=0), 1.0 - local.sum(axis=0))
        better = inside > best
        best[better] = inside[better]
        found[better] = e
    kept = best > -1e-9
    elements = found[kept]
    xi = np.einsum("ijk,jk->ik", space.to_reference[:, :, elements], X[:, kept] - corners[:, 0, elements])
    slopes = np.stack([np.broadcast_to(space.shape.lbasis(xi, b)[1], xi.shape) for b in range(len(space.nodes))])
    barycentric = np.concatenate([1.0 - xi.sum(axis=0, keepdims=True), xi])
    return Probe(elements, np.einsum("bjk,jik->bik", slopes, space.to_reference[:, :, elements]), barycentric)


def node_probe(system: System) -> Probe:
    """All nodes of all elements, element by element (e b,): each element is asked for itself at its own nodes."""
    space = system.space
    n_basis, n_elements = space.nodes.shape
    xi = np.array([[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=float)
    if n_basis == 10:
        sides = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
        xi = np.concatenate([xi, np.stack([xi[:, list(side)].mean(axis=1) for side in sides], axis=1)], axis=1)
    slopes = np.stack([np.broadcast_to(space.shape.lbasis(xi, b)[1], xi.shape) for b in range(n_basis)])  # (b, 3, node)
    global_slopes = np.einsum("bjk,jie->biek", slopes, space.to_reference).reshape(n_basis, 3, -1)
    barycentric = np.tile(np.concatenate([1.0 - xi.sum(axis=0, keepdims=True), xi]), n_elements)
    return Probe(np.repeat(np.arange(n_elements), n_basis), np.ascontiguousarray(global_slopes), barycentric)


def ball(centre: Array, radius: float, across: int = 20) -> Array:
    """Evenly spaced positions in a ball, (3, k) [mm]; independent of any mesh."""
    ticks = (np.arange(across) + 0.5) / across * 2.0 - 1.0
    grid = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij")).reshape(3, -1)
    return centre[:, None] + radius * grid[:, np.einsum("ik,ik->k", grid, grid) <= 1.0]
