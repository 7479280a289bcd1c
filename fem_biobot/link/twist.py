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
from fem_biobot.solid.surfaces import node_areas

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
        weight = node_areas(system.space, model.mesh.points, model.mesh.surfaces[bond])
        arm = x - (x @ weight / weight.sum())[:, None]
        inertia = np.sum(weight * arm**2) * np.eye(3) - (weight * arm) @ arm.T
        force += sense * weight * np.cross(np.linalg.solve(inertia, axis), arm, axisb=0, axisc=0)
    right = np.zeros(system.n_dofs)
    right[: force.size] = system.to_local(np.ascontiguousarray(force.T)).ravel()
    right[system.held.dofs] = 0.0
    z = direct_solver(model).solve(newton_matrix(system, equilibrium_of(state)), right, _TOLERANCE)
    return float(np.sum(force.T * system.parts(z)[0]))
