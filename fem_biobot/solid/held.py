"""Prescribed displacements: which unknowns are held, to what values, and in which axes of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from fem_biobot.errors import ModelError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.prescribed import Mover, Prescribed
from fem_biobot.solid.records import (
    Array,
    Fix,
    Foundation,
    Rotate,
    Step,
    Support,
    Symmetry,
    components,
    drive_name,
    numbers,
)
from fem_biobot.solid.space import Ints, Space


@dataclass(frozen=True)
class Held:
    """Held unknowns.

    Attributes
    ----------
    dofs
        Held unknowns, numbered 3 node + local axis, (k,).
    prescribed
        Displacement along each at a step.
    turned
        For every node the number of its own axes, or -1, (n,).
    axes
        Own axes as rows, (3, 3, m).
    """

    dofs: Ints
    prescribed: Prescribed
    turned: Ints
    axes: Array

    def at(self, step: float | Step) -> Array:
        """Displacement along each held unknown at a step, (k,) [mm]."""
        return self.prescribed.at(step)

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
    rows = _Rows()
    springs: list[tuple[Ints, Array]] = []
    for support in supports:
        if isinstance(support, Foundation):
            springs.extend(_spring_rows(mesh, body, support))
        else:
            rows.add(support, body, *_directions(mesh, body, support))
    dofs: list[int] = []
    combine, left = _Entries(), _Entries()
    turned = np.full(body.n_nodes, -1, dtype=np.int64)
    own_axes: list[Array] = []
    for node, mine in rows.of_node.items():
        C = np.array([rows.direction[r] for r in mine])
        along = np.abs(C) > 1.0 - 1e-12
        if np.all(along.any(axis=1)):  # every direction is a global axis
            for c in range(3):
                same = np.flatnonzero(along[:, c])
                if same.size:
                    combine.add(len(dofs), [mine[same[0]]], C[same[:1], c])
                    for other in same[1:]:
                        left.add(mine[other], [mine[other], mine[same[0]]], np.array([C[other, c], -C[same[0], c]]))
                    dofs.append(3 * node + c)
            continue
        _, sizes, Vt = np.linalg.svd(C)
        rank = int(np.sum(sizes > 1e-10))
        inverse = np.linalg.pinv(C, rcond=1e-10)
        for row, weights in zip(mine, C @ inverse - np.eye(len(mine)), strict=True):
            if np.abs(weights).max() > 1e-12:
                left.add(row, mine, weights)
        for c in range(rank):
            combine.add(len(dofs) + c, mine, Vt[c] @ inverse)
        turned[node] = len(own_axes)
        own_axes.append(Vt)
        dofs.extend(3 * node + c for c in range(rank))
    order = np.argsort(dofs)
    axes = np.stack(own_axes, axis=-1) if own_axes else np.zeros((3, 3, 1))
    n = len(rows.direction)
    prescribed = Prescribed(
        tuple(rows.movers),
        combine.matrix(len(dofs), n)[order],
        left.matrix(n, n),
        body.points[:, np.array(rows.node, dtype=np.int64)],
        float(np.ptp(mesh.points, axis=1).max()),
    )
    found = Held(
        np.array(dofs, dtype=np.int64)[order] if dofs else np.zeros(0, dtype=np.int64),
        prescribed.checked(),
        turned,
        np.ascontiguousarray(axes),
    )
    _refuse_rigid_motion(body, found, springs)
    return found


@dataclass
class _Rows:
    """Directions in which supports hold nodes, one after the other, and who asks what along them."""

    node: list[int] = field(default_factory=list)
    direction: list[Array] = field(default_factory=list)
    of_node: dict[int, list[int]] = field(default_factory=dict)
    movers: list[Mover] = field(default_factory=list)

    def add(
        self,
        support: Fix | Rotate | Symmetry,
        body: Space,
        nodes: Ints,
        axes: Array,
        which: Sequence[int],
        value: Array,
    ) -> None:
        first = len(self.node)
        for node in nodes:
            for c in which:
                self.of_node.setdefault(int(node), []).append(len(self.node))
                self.node.append(int(node))
                self.direction.append(axes[c])
        name = "" if isinstance(support, Symmetry) else drive_name(support)
        rows, values = np.arange(first, len(self.node)), np.ascontiguousarray(value.T).ravel()
        if isinstance(support, Rotate):
            X, along = np.repeat(body.points[:, nodes], len(which), axis=1), np.array(self.direction[first:]).T
            self.movers.append(Mover(name, rows, values, support, X, along))
        else:
            self.movers.append(Mover(name, rows, values))


class _Entries:
    """Entries of a sparse matrix, row by row."""

    def __init__(self) -> None:
        self._rows: list[int] = []
        self._columns: list[int] = []
        self._values: list[float] = []

    def add(self, row: int, columns: Sequence[int], values: Array) -> None:
        self._rows.extend([row] * len(columns))
        self._columns.extend(columns)
        self._values.extend(float(v) for v in values)

    def matrix(self, n_rows: int, n_columns: int) -> sparse.csr_matrix:
        return sparse.csr_matrix((self._values, (self._rows, self._columns)), shape=(n_rows, n_columns))


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


def _directions(
    mesh: BodyMesh, body: Space, support: Fix | Rotate | Symmetry
) -> tuple[Ints, Array, tuple[int, ...], Array]:
    """Nodes, axes (rows), the axes held, and the displacement along each at each node at factor 1, (held, nodes)."""
    if isinstance(support, Symmetry):
        nodes = place_nodes(mesh, body, support.surface)
        normal = _plane_normal(mesh, support.surface)
        return nodes, normal[None, :], (0,), np.zeros((1, len(nodes)))
    nodes = place_nodes(mesh, body, support.where)
    if isinstance(support, Rotate):
        axes, which = _screw_axes(support), (0, 1, 2)[: 2 if support.advance is None else 3]
        return nodes, axes, which, (axes @ support.displacement(body.points[:, nodes], 1.0))[list(which)]
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


def _screw_axes(support: Rotate) -> Array:
    """Two directions across the axis of a rotation, then the axis, as rows; global axes where they may be."""
    axis = np.asarray(support.axis, dtype=float) / np.linalg.norm(support.axis)
    c = int(np.argmax(np.abs(axis)))
    if support.advance is not None:
        return np.eye(3)
    if abs(axis[c]) > 1.0 - 1e-12:
        return np.eye(3)[[(c + 1) % 3, (c + 2) % 3, c]]
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis]).astype(np.float64)


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
