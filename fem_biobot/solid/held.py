"""Prescribed displacements: which unknowns are held, to what values, and in which axes of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.records import Array, Fix, Foundation, Support, Symmetry, components, numbers
from fem_biobot.solid.space import Ints, Space


@dataclass(frozen=True)
class Held:
    """Held unknowns.

    Attributes
    ----------
    dofs
        Held unknowns, numbered 3 node + local axis, (k,).
    values
        Displacement along each at load factor 1, (k,) [mm].
    turned
        For every node the number of its own axes, or -1, (n,).
    axes
        Own axes as rows, (3, 3, m).
    """

    dofs: Ints
    values: Array
    turned: Ints
    axes: Array

    def to_local(self, v: Array) -> Array:
        """Global components (n, 3) to local ones."""
        return self._turn(v, "ijm,mj->mi")

    def to_global(self, v: Array) -> Array:
        """Local components (n, 3) to global ones."""
        return self._turn(v, "jim,mj->mi")

    def _turn(self, v: Array, rule: str) -> Array:
        own = np.flatnonzero(self.turned >= 0)
        if not own.size:
            return v
        out = v.copy()
        out[own] = np.einsum(rule, self.axes[:, :, self.turned[own]], v[own])
        return out


def held(mesh: BodyMesh, body: Space, supports: Sequence[Support]) -> Held:
    """Combine all supports, node by node.

    Each support contributes directions and values; a node may be held by several, also along oblique directions.

    Raises
    ------
    ModelError
        Unknown place, contradicting values at a node, a surface that is not plane under `Symmetry`, or supports that
        leave a rigid motion free.
    """
    directions: dict[int, list[tuple[Array, float]]] = {}
    springs: list[tuple[Ints, Array]] = []
    for support in supports:
        if isinstance(support, Foundation):
            springs.extend(_spring_rows(mesh, body, support))
            continue
        nodes, axes, which, values = _directions(mesh, body, support)
        for column, node in enumerate(nodes):
            rows = directions.setdefault(int(node), [])
            rows.extend((axes[c], values[row, column]) for row, c in enumerate(which))
    dofs: list[int] = []
    targets: list[float] = []
    turned = np.full(body.n_nodes, -1, dtype=np.int64)
    own_axes: list[Array] = []
    for node, rows in directions.items():
        C = np.array([d for d, _ in rows])
        v = np.array([x for _, x in rows])
        along = np.abs(C) > 1.0 - 1e-12
        if np.all(along.any(axis=1)):  # every direction is a global axis
            for c in range(3):
                mine = along[:, c]
                if mine.any():
                    wanted = v[mine] * C[mine, c]
                    _agree(mesh, body, node, wanted)
                    dofs.append(3 * node + c)
                    targets.append(float(wanted[0]))
            continue
        _, sizes, Vt = np.linalg.svd(C)
        rank = int(np.sum(sizes > 1e-10))
        solution, *_ = np.linalg.lstsq(C, v, rcond=None)
        _agree(mesh, body, node, C @ solution - v, zero=True)
        turned[node] = len(own_axes)
        own_axes.append(Vt)
        dofs.extend(3 * node + c for c in range(rank))
        targets.extend(float(x) for x in (Vt @ solution)[:rank])
    order = np.argsort(dofs)
    axes = np.stack(own_axes, axis=-1) if own_axes else np.zeros((3, 3, 1))
    found = Held(
        np.array(dofs, dtype=np.int64)[order] if dofs else np.zeros(0, dtype=np.int64),
        np.array(targets, dtype=float)[order] if dofs else np.zeros(0),
        turned,
        np.ascontiguousarray(axes),
    )
    _refuse_rigid_motion(body, found, springs)
    return found


def _spring_rows(mesh: BodyMesh, body: Space, support: Foundation) -> list[tuple[Ints, Array]]:
    """Nodes of a foundation and directions (k, 3) in which its springs hold them, facet by facet."""
    if support.surface not in mesh.surfaces:
        known = ", ".join(mesh.surfaces) or "none"
        raise ModelError(f"foundation: found no surface named {support.surface!r}, expected one of {known}")
    nodes = place_nodes(mesh, body, support.surface)
    if support.normal > 0.0 and support.tangential > 0.0:
        return [(nodes, np.repeat(axis[None], len(nodes), axis=0)) for axis in np.eye(3)]
    triangles = mesh.surfaces[support.surface]
    corners = mesh.points[:, triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
    normal = np.tile((normal / np.linalg.norm(normal, axis=0)).T, (3, 1))
    at = triangles.ravel()
    if support.normal > 0.0:
        return [(at, normal)]
    if support.tangential > 0.0:
        return [(at, np.cross(normal, axis)) for axis in np.eye(3)]
    return []


def _directions(mesh: BodyMesh, body: Space, support: Fix | Symmetry) -> tuple[Ints, Array, tuple[int, ...], Array]:
    """Nodes, axes (rows), the axes held, and the displacement along each at each node, (held, nodes)."""
    if isinstance(support, Symmetry):
        nodes = place_nodes(mesh, body, support.surface)
        normal = _plane_normal(mesh, support.surface)
        return nodes, normal[None, :], (0,), np.zeros((1, len(nodes)))
    nodes = place_nodes(mesh, body, support.where)
    which = components(support.components)
    axes = np.eye(3) if support.axes is None else np.asarray(support.axes, dtype=float)
    if callable(support.value):
        prescribed = numbers(support.value(body.points[:, nodes]), "value, a function", "finite displacements")
        if prescribed.shape != (3, len(nodes)):
            raise ModelError(f"value: found shape {prescribed.shape}, expected (3, {len(nodes)})")
        return nodes, axes, which, (axes @ prescribed)[list(which)]
    expected = f"one finite number or one for each of {len(which)} components"
    value = np.atleast_1d(numbers(support.value, "value", expected))
    if value.shape not in ((1,), (len(which),)):
        raise ModelError(f"value: found {support.value!r}, expected {expected}")
    return nodes, axes, which, np.broadcast_to(value[:, None], (len(which), len(nodes)))


def place_nodes(mesh: BodyMesh, body: Space, where: str | tuple[float, float, float]) -> Ints:
    """Nodes of a named surface, a named landmark, or the vertex at a position (to 1e-6 of the body's size)."""
    if isinstance(where, str):
        if where in mesh.surfaces:
            return np.unique(body.surface_nodes(mesh.surfaces[where]))
        if where in mesh.landmarks:
            return np.array([mesh.landmarks[where]], dtype=np.int64)
        known = ", ".join([*mesh.surfaces, *mesh.landmarks]) or "none (the mesh names no surface and no point)"
        raise ModelError(f"support or load: found no surface or point named {where!r}, expected one of {known}")
    expected = "a surface's or point's name or a position of three finite numbers"
    position = numbers(where, "support or load", expected)
    if position.shape != (3,):
        raise ModelError(f"support or load: found {where!r}, expected {expected}")
    distance = np.linalg.norm(mesh.points - position[:, None], axis=0)
    nearest = int(np.argmin(distance))
    if distance[nearest] > 1e-6 * np.ptp(mesh.points, axis=1).max():
        raise ModelError(
            f"point {tuple(where)} mm: found no vertex (nearest {distance[nearest]:.3g} mm away), expected a vertex"
        )
    return np.array([nearest], dtype=np.int64)


def _plane_normal(mesh: BodyMesh, name: str) -> Array:
    if name not in mesh.surfaces:
        raise ModelError(
            f"symmetry: found no surface named {name!r}, expected one of {', '.join(mesh.surfaces) or 'none'}"
        )
    corners = mesh.points[:, mesh.surfaces[name]]  # (3, 3, f)
    points = corners.reshape(3, -1)
    centred = points - points.mean(axis=1, keepdims=True)
    axes, sizes, _ = np.linalg.svd(centred, full_matrices=False)
    if sizes[2] > 1e-8 * sizes[0]:
        raise ModelError(f"symmetry: found surface {name!r} not plane, expected a plane")
    normal = axes[:, 2]
    # an axis-parallel plane keeps its unknowns in the global axes, exactly
    c = int(np.argmax(np.abs(normal)))
    return np.eye(3)[c] if abs(normal[c]) > 1.0 - 1e-12 else normal


def _agree(mesh: BodyMesh, body: Space, node: int, values: Array, zero: bool = False) -> None:
    scale = np.ptp(mesh.points, axis=1).max()
    gap = np.abs(values).max() if zero else np.ptp(values)
    if gap > 1e-9 * scale:
        x, y, z = body.points[:, node]
        raise ModelError(
            f"supports: found contradicting displacements at ({x:.4g}, {y:.4g}, {z:.4g}) mm, expected one value"
        )


def _refuse_rigid_motion(body: Space, found: Held, springs: list[tuple[Ints, Array]]) -> None:
    """Six rigid motions must be held: the rows of held unknowns and springs in the rigid modes have rank 6."""
    if not found.dofs.size and not springs:
        raise ModelError(
            "supports: found none, expected the body held against its six rigid motions (such as Fix on three points)"
        )
    nodes, c = found.dofs // 3, found.dofs % 3
    direction = np.eye(3)[c]
    own = found.turned[nodes] >= 0
    direction[own] = found.axes[c[own], :, found.turned[nodes[own]]]
    nodes = np.concatenate([nodes, *(at for at, _ in springs)])
    direction = np.concatenate([direction, *(along for _, along in springs)])
    size = np.ptp(body.points, axis=1).max()
    arm = (body.points[:, nodes] - body.points.mean(axis=1, keepdims=True)).T / size
    modes = np.concatenate([direction, np.cross(arm, direction)], axis=1)
    free = 6 - int(np.linalg.matrix_rank(modes, tol=1e-8 * np.sqrt(len(modes))))
    if free:
        raise ModelError(f"supports: found {free} rigid motion(s) left free, expected the body held against all six")
