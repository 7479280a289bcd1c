"""Torsion of the beam where it is bent: small couples on the skeleton about a state in which its bonds are pulled.

A wide plate that arches is stiffer against twist than a flat one: its sections warp along the arch, and what it is
bent and compressed by turns with them. So a small couple about the chord, opposite on the two bonds, acts where the
pulled bonds are, and the twist between them follows from the tangent there. Of an arch whose stretches of length ``s``
slope by ``q`` against the chord the flexibility is ``sum (cos^2 q / (G J) + sin^2 q / (E I_2)) s``.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.link.observed import Array, Points
from fem_biobot.link.parts import BONDS
from fem_biobot.solid.model import SolidState, equilibrium_of
from fem_biobot.solid.newton import newton_matrix
from fem_biobot.solid.solvers import direct_solver

_TOLERANCE = 1e-10


def torsion_at(state: SolidState, points: Points, size: Array, EI_lateral: float) -> float:
    """Torsion stiffness ``G J`` of a beam about a state of the skeleton [mN mm^2].

    Parameters
    ----------
    state
        A stable equilibrium of the skeleton, its bonds loaded or not.
    points
        Where the observed points are in it.
    size
        Reference length of each stretch of the beam, (m,) [mm].
    EI_lateral
        Bending stiffness across [mN mm^2].
    """
    chord = points.axis[-1] - points.axis[0]
    along = np.diff(points.axis, axis=0)
    cosine = along @ chord / (np.linalg.norm(chord) * np.linalg.norm(along, axis=1))
    sideways = float((1.0 - cosine**2) @ size) / EI_lateral
    return float(cosine**2 @ size) / (twist(state, chord / np.linalg.norm(chord)) - sideways)


def twist(state: SolidState, axis: Array) -> float:
    """Turn of the long bond against the short one about an axis by opposite unit couples about it [rad/uJ]."""
    model, system = state.model, state.model.system
    x, force = state.X + state.u, np.zeros_like(state.u)
    for bond, sense in zip(BONDS, (-1.0, 1.0), strict=True):
        weight = _areas(state, bond)
        arm = x - (x @ weight / weight.sum())[:, None]
        inertia = np.sum(weight * arm**2) * np.eye(3) - (weight * arm) @ arm.T
        force += sense * weight * np.cross(np.linalg.solve(inertia, axis), arm, axisb=0, axisc=0)
    right = np.zeros(system.n_dofs)
    right[: force.size] = system.to_local(np.ascontiguousarray(force.T)).ravel()
    right[system.held.dofs] = 0.0
    z = direct_solver(model).solve(newton_matrix(system, equilibrium_of(state)), right, _TOLERANCE)
    return float(np.sum(force.T * system.parts(z)[0]))


def _areas(state: SolidState, surface: str) -> Array:
    """Share of each node in the area of a surface as drawn, (n,) [mm^2]."""
    space, triangles = state.model.system.space, state.model.mesh.surfaces[surface]
    corners = state.model.mesh.points[:, triangles]
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.linalg.norm(np.cross(one, two, axis=0), axis=0)
    nodes = space.surface_nodes(triangles)
    # of a quadratic field over a straight triangle the sides' middles carry all
    carrying = nodes[3:] if len(nodes) == 6 else nodes
    found = np.zeros(space.n_nodes)
    np.add.at(found, carrying, np.broadcast_to(area / 3.0, carrying.shape))
    return found
