"""Which elements spoil a number: the influence of forces on a measure, and the share of each element in its error.

A measure J is a function of the displacement; its influence z solves ``K z = dJ/du`` at an equilibrium. The error of J
on a mesh is to first order the work of the equilibrium's own error in the influence's, so an element matters where both
the stress and the influence are badly resolved, and not where one of them is.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array
from fem_biobot.solid.model import SolidState, equilibrium_of
from fem_biobot.solid.newton import newton_matrix
from fem_biobot.solid.solvers import direct_solver
from fem_biobot.solid.space import Ints, Space
from fem_biobot.solid.stress import first_piola_stress

_TOLERANCE = 1e-10


def influence(state: SolidState, gradient: Array) -> Array:
    """Displacement z of the nodes, (3, n), with ``K z = dJ/du`` at an equilibrium.

    Parameters
    ----------
    state
        A stable equilibrium; laws and loads with a potential, displacements alone as unknowns.
    gradient
        ``dJ/du`` of the measure J at the nodes, (3, n); what the supports hold is left out.

    Returns
    -------
    Array
        Unit of J per mN. A small force f at the nodes changes the measure by ``z . f``.

    Raises
    ------
    ModelError
        Parts that slide on each other, a mixed form, or forces without a potential.
    """
    model = state.model
    system = model.system
    if model.sliding is not None:
        raise ModelError("influence: found parts that slide on each other, expected all parts bonded")
    if system.mixed is not None or not system.symmetric:
        what = "element P2-P1" if system.mixed is not None else "a law or a load without a potential"
        raise ModelError(f"influence: found {what}, expected displacements alone and forces with a potential")
    right = system.to_local(np.ascontiguousarray(gradient.T)).ravel()
    right[system.held.dofs] = 0.0
    z = direct_solver(model).solve(newton_matrix(system, equilibrium_of(state)), right, _TOLERANCE)
    return np.ascontiguousarray(system.parts(z)[0].T)


def error_shares(state: SolidState, z: Array) -> Array:
    """Share of each element in the error of a measure, (e,) [unit of the measure]; their sum estimates the error.

    Parameters
    ----------
    state
        The equilibrium.
    z
        Influence of the measure, from `influence`.

    Notes
    -----
    ``int (P - P*) : (grad z - grad z*) dV`` with the recovered fields P*, grad z* in place of the exact ones: the
    values of the elements' own linear fields at the vertices, averaged over the elements of one region (Zienkiewicz
    and Zhu 1987 for the recovery; Becker and Rannacher 2001 for the product). The sum is what the measure gains on an
    infinitely fine mesh, to first order; recovery sees about half of it at re-entrant corners.
    """
    system = state.model.system
    P = first_piola_stress(state.points)
    G = system.deformation_gradient(np.ascontiguousarray(z.T)) - np.eye(3)[:, :, None, None]
    regions = state.model.mesh.region_of()
    fields = (values - recovered(system.space, values, regions) for values in (P, G))
    first, second = fields
    return np.einsum("ikeq,ikeq,eq->e", first, second, system.space.dV)


def recovered(space: Space, values: Array, regions: Ints) -> Array:
    """A continuous field from one that jumps, (..., e, q): linear between the means at the vertices of each region."""
    lead, (n_elements, n_points) = values.shape[:-2], values.shape[-2:]
    flat = values.reshape(-1, n_elements, n_points)
    # the element's own linear field at its corners, constant where there are not enough points for one
    enough = n_points >= 4
    to_corners = np.linalg.pinv(space.corner_values) if enough else np.full((n_points, 4), 1.0 / n_points)
    corners = flat @ to_corners  # (k, e, 4)
    # a vertex of two regions is two
    vertices = (space.nodes[:4] + space.n_nodes * regions[None, :]).ravel()
    weights = np.broadcast_to(space.dV.sum(axis=1), (4, n_elements)).ravel()
    count = space.n_nodes * (int(regions.max()) + 1)
    total = np.bincount(vertices, weights, count)
    out = np.empty_like(flat)
    for k, own in enumerate(corners):
        mean = np.bincount(vertices, weights * own.T.ravel(), count) / np.where(total > 0.0, total, 1.0)
        out[k] = mean[vertices].reshape(4, n_elements).T @ space.corner_values
    return out.reshape(*lead, n_elements, n_points)
