"""What a sliding contact says in a state: the footprint of its pressure, and the forces on each part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array
from fem_biobot.solid.interface.depth import distances
from fem_biobot.solid.interface.rays import kernels as rays
from fem_biobot.solid.interface.state import LIFTED, Ints, Touch
from fem_biobot.solid.interface.touch import Contact
from fem_biobot.solid.state import SolidState


@dataclass(frozen=True, eq=False)
class Footprint:
    """Fields on the bearing surface; corners of its facets have a point on each smooth side.

    Attributes
    ----------
    points
        Where the points are now, (3, c) [mm].
    triangles
        Of the facets' corners, (3, f).
    pressure
        Of the body on the surface, per reference area, (c,) [kPa].
    friction
        Friction on the surface, per reference area, (3, c) [kPa].
    gap
        Mean gap about each point, (c,) [mm]; zero where nothing lies opposite.
    slip
        Slip of the body in the last step, mean about each point, (3, c) [mm].
    state
        0 lifted or bare, 1 sticks, 2 slips, (c,).
    cover
        Share of the surface about each point that has the body opposite to it, (c,) [1].
    """

    points: Array
    triangles: Ints
    pressure: Array
    friction: Array
    gap: Array
    slip: Array
    state: Ints
    cover: Array


@dataclass(frozen=True)
class PartForce:
    """What one part of a contact, such as a pillar, bears.

    Attributes
    ----------
    force
        Of the body on it, (3,) [mN].
    pressing, rubbing
        Integrals of the pressure and of the size of the friction [mN].
    area
        That presses, of the reference surface [mm^2].
    max_pressure
        Largest at a point [kPa].
    slid
        Farthest that a pressed place of the body has come along the surface since the undeformed state [mm].
    overlap
        Deepest that single points of the body lie below the surface, to its nearest place [mm]: what the mesh does not
        resolve.
    """

    force: Array
    pressing: float
    rubbing: float
    area: float
    max_pressure: float
    slid: float
    overlap: float


def footprint(state: SolidState) -> Footprint:
    """Fields of a state's contact; refuses a state without one (`ModelError`)."""
    contact, touch = _contact(state)
    s = contact.surfaces
    u = np.ascontiguousarray(state.u.T)
    _, basis = contact.frames(np.ascontiguousarray(contact.X + u))
    frames = np.zeros((contact.count, 3, 3))
    shares = np.einsum("fk,ck,fkij->cfij", s.weights, s.hats, basis.reshape(*s.weights.shape, 3, 3))
    np.add.at(frames, s.corners, shares)
    frames /= np.linalg.norm(frames, axis=2, keepdims=True)
    t, cover = touch.traction, contact.paired(u, touch).cover / s.area
    return Footprint(
        (contact.X + u)[s.vertex].T,
        s.corners,
        t[:, 0].copy(),
        -np.einsum("cs,csi->ic", t[:, 1:], frames[:, 1:]),
        touch.gaps[:, 0].copy(),
        np.einsum("cs,csi->ic", np.where(touch.state[:, None] == LIFTED, 0.0, touch.gaps[:, 1:]), frames[:, 1:]),
        touch.state,
        cover,
    )


def part_forces(state: SolidState) -> list[PartForce]:
    """Forces of a state's contact on each part, in the order of their mean x; refuses a state without a contact."""
    contact, touch = _contact(state)
    s = contact.surfaces
    u = np.ascontiguousarray(state.u.T)
    x = np.ascontiguousarray(contact.X + u)
    points, basis = contact.frames(x)
    met = touch.facet >= 0
    tractions = np.einsum("ck,cfs->fks", s.hats, touch.traction[s.corners]).reshape(-1, 3)
    weight = np.where(met, s.weights.ravel(), 0.0)
    forces = -weight[:, None] * np.einsum("ps,psi->pi", tractions, basis)
    pressed = met & (tractions[:, 0] > 0.0)
    away = np.zeros(len(points))
    away[met] = np.linalg.norm(_places(contact, touch)[met] - contact.frames(contact.X)[0][met], axis=1)
    found = []
    for part in range(s.n_parts):
        own = contact.part == part
        below = np.flatnonzero(own & met & (touch.at[:, 2] < 0.0))
        gap = touch.at[below, 2]
        depth = distances(points[below] + gap[:, None] * basis[below, 0], -gap, x, s.nodes[:, s.part == part])
        corners = np.unique(s.corners[:, s.part == part])
        found.append(
            PartForce(
                forces[own].sum(axis=0),
                float(weight[own] @ tractions[own, 0]),
                float(weight[own] @ np.hypot(tractions[own, 1], tractions[own, 2])),
                float(weight[own & pressed].sum()),
                float(touch.traction[corners, 0].max()),
                float(away[own & pressed].max(initial=0.0)),
                float(depth.max(initial=0.0)),
            )
        )
    return found


def _places(contact: Contact, touch: Touch) -> Array:
    """Where the material opposite to each quadrature point was in the undeformed state, (p, 3) [mm]."""
    other = contact.surfaces.other
    out, N, D = np.zeros((len(touch.facet), 3)), np.empty(6), np.empty((6, 2))
    for q in np.flatnonzero(touch.facet >= 0):
        rays.basis(len(other), touch.at[q, 0], touch.at[q, 1], N, D)
        out[q] = N[: len(other)] @ contact.X[other[:, touch.facet[q]]]
    return out


def _contact(state: SolidState) -> tuple[Contact, Touch]:
    slide = state.model.slide
    if slide is None or state.touch is None:
        raise ModelError("contact: found a state without one, expected one of a model whose parts slide on each other")
    return slide.contact, state.touch
