"""Nodal forces of dead loads: surface tractions and body forces, integrated with the basis of the space."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import skfem
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet, RefTri

from fem_biobot.errors import ModelError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.records import Array, BodyForce, Load, Pressure, Traction, drive_name, numbers
from fem_biobot.solid.space import Space
from fem_biobot.solid.surfaces import follower_pressure

# loads given as functions deserve a rule well above the degree of the basis
_DEGREE = 6


def dead_loads(mesh: BodyMesh, body: Space, loads: Sequence[Load]) -> tuple[tuple[str, Array], ...]:
    """Nodal forces of all loads but follower pressures at load factor 1, (n, 3) [mN], each with the name driving it."""
    found: dict[str, Array] = {}
    for load in loads:
        if not isinstance(load, Load):
            raise ModelError(f"loads: found {type(load).__name__}, expected Traction, Pressure or BodyForce")
        if isinstance(load, Pressure) and load.follower:
            continue
        force = found.setdefault(drive_name(load), np.zeros((body.n_nodes, 3)))
        if isinstance(load, Traction):
            _add_traction(mesh, body, load, force)
        elif isinstance(load, BodyForce):
            _add_body_force(mesh, body, load, force)
        else:
            force += follower_pressure(mesh, body, load).force(np.zeros_like(force))
    return tuple(found.items())


def _field(value: Callable[[Array], Array] | Sequence[float], X: Array, what: str) -> Array:
    """Vector at positions X, (3, ...)."""
    if callable(value):
        found = numbers(value(X.reshape(3, -1)), f"{what}, a function")
        if found.shape != (3, X[0].size):
            raise ModelError(f"{what}: found shape {found.shape} from its function, expected (3, {X[0].size})")
        found = found.reshape(X.shape)
    else:
        found = numbers(value, what, "a vector of three finite numbers")
        if found.shape != (3,):
            raise ModelError(f"{what}: found {value!r}, expected a vector of three numbers")
        found = np.broadcast_to(found.reshape((3,) + (1,) * (X.ndim - 1)), X.shape)
    return found


def _add_traction(mesh: BodyMesh, body: Space, load: Traction, force: Array) -> None:
    if load.surface not in mesh.surfaces:
        raise ModelError(
            f"traction: found no surface named {load.surface!r}, expected one of {', '.join(mesh.surfaces) or 'none'}"
        )
    triangles = mesh.surfaces[load.surface]
    nodes = body.surface_nodes(triangles)
    local, weights = get_quadrature(RefTri, _DEGREE)
    shape = skfem.ElementTriP2() if body.quadratic else skfem.ElementTriP1()
    N = np.stack([np.broadcast_to(shape.lbasis(local, b)[0], weights.shape) for b in range(len(nodes))])
    corners = mesh.points[:, triangles]  # (3, 3, f)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    twice_area = np.linalg.norm(normal, axis=0)
    X = np.einsum("ibf,bq->ifq", corners, np.stack([1.0 - local[0] - local[1], local[0], local[1]]))
    T = _field(load.value, X, f"traction on {load.surface!r}")
    parts = np.einsum("bq,ifq,q,f->bfi", N, T, weights, twice_area)
    np.add.at(force, nodes, parts)


def _add_body_force(mesh: BodyMesh, body: Space, load: BodyForce, force: Array) -> None:
    if load.region is not None and load.region not in mesh.regions:
        raise ModelError(f"body force: found region {load.region!r}, expected one of {', '.join(mesh.regions)}")
    elements = np.arange(body.nodes.shape[1]) if load.region is None else mesh.regions[load.region]
    local, weights = get_quadrature(RefTet, _DEGREE)
    shape = skfem.ElementTetP2() if body.quadratic else skfem.ElementTetP1()
    N = np.stack([np.broadcast_to(shape.lbasis(local, b)[0], weights.shape) for b in range(len(body.nodes))])
    corners = mesh.points[:, mesh.cells[:, elements]]  # (3, 4, e)
    X = np.einsum("ibe,bq->ieq", corners, np.stack([1.0 - local.sum(axis=0), *local]))
    f = _field(load.value, X, "body force")
    six_volumes = 6.0 * body.dV[elements].sum(axis=1)
    parts = np.einsum("bq,ieq,q,e->bei", N, f, weights, six_volumes)
    np.add.at(force, body.nodes[:, elements], parts)
