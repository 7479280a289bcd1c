"""Consistent mass matrix of a body, in the pattern of its tangent."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.records import numbers
from fem_biobot.solid.space import Array, Space, quadrature
from fem_biobot.solid.system import System


def mass_matrix(system: System, mesh: BodyMesh, densities: Mapping[str, float]) -> Array:
    """Upper triangle of ``int rho N_a N_b`` in local axes, held unknowns included [kg]; zero for pressures.

    Parameters
    ----------
    densities
        Mass per reference volume of every region [kg/mm^3], above 0.

    Raises
    ------
    ModelError
        A region without density, an unknown region, a density that is not above 0.
    """
    rho = density_of(mesh, densities)
    body, p = system.space, system.pattern
    n_basis = len(body.nodes)
    first, second = np.triu_indices(n_basis)
    unit = _unit_mass(body)[first, second]  # (pairs,)
    volume = 6.0 * body.dV.sum(axis=1)
    values = np.einsum("p,e,e->ep", unit, rho, volume)
    at, length = p.place[..., 0].astype(np.int64), np.abs(p.place[..., 1]).astype(np.int64)
    later = p.place[..., 1] < 0
    data = np.zeros(len(p.columns))
    if not system.turned.size:
        for i in range(3):
            place = at + i + i * length - i * (i + 1) // 2
            data += np.bincount(place.ravel(), weights=values.ravel(), minlength=len(data))
        return data
    low = np.where(later, body.nodes[second].T, body.nodes[first].T)
    high = np.where(later, body.nodes[first].T, body.nodes[second].T)
    own = np.where((system.turned >= 0)[:, None, None], np.moveaxis(system.held.axes, 2, 0)[system.turned], np.eye(3))
    turns = np.einsum("epik,epjk->epij", own[low], own[high])
    for i in range(3):
        for j in range(3):
            mine = (low != high) | (j == i)
            place = at + j + i * length - i * (i + 1) // 2
            weights = (values * turns[..., i, j])[mine]
            data += np.bincount(place[mine], weights=weights, minlength=len(data))
    return data


def _unit_mass(body: Space) -> Array:
    """``int N_a N_b`` on the unit tetrahedron of volume 1/6, (b, b)."""
    points, weights = quadrature(4 if body.quadratic else 2)
    values = [np.broadcast_to(body.shape.lbasis(points, b)[0], weights.shape) for b in range(len(body.nodes))]
    return np.einsum("aq,bq,q->ab", values, values, weights)


def density_of(mesh: BodyMesh, densities: Mapping[str, float]) -> Array:
    """Density of each element, (e,)."""
    for name in densities:
        if name not in mesh.regions:
            raise ModelError(f"densities: found region {name!r}, expected one of {', '.join(mesh.regions)}")
    rho = np.zeros(mesh.n_elements)
    for name, elements in mesh.regions.items():
        if name not in densities:
            raise ModelError(f"densities: found none for region {name!r}, expected one for every region")
        given = numbers(densities[name], f"densities[{name!r}]", "a finite density")
        if given.ndim or not given > 0.0:
            raise ModelError(f"densities[{name!r}]: found {densities[name]!r}, expected one number above 0 kg/mm^3")
        rho[elements] = float(given)
    return rho
