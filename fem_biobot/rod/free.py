"""Motions of a model that no support, joint, stiffness or load resists, and how to name them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from fem_biobot.rod.balance import Conditions, Point, out_of_balance, tangent
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.sparse import Pattern

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FreeMotion:
    """A motion of rigid parts, (n, 6), its name, and whether it is a translation or pushed by the loads."""

    motion: Array
    name: str
    turns: bool
    pushed: bool


def free_motions(model: RodModel, given: Conditions, at: Point, pattern: Pattern) -> tuple[list[FreeMotion], bool]:
    """Motions of rigid parts without stiffness at a point, and whether the tangent there lacks stiffness.

    Parts are what elements tie together. A part's weight gives it stiffness against turning, as to a pendulum; the
    tangent knows it only once the weight has stretched the part.
    """
    parts = _parts(model)
    extent = given.extent
    n = model.n_nodes
    basis = np.zeros((6 * len(parts), n, 6))
    for p, nodes in enumerate(parts):
        arm = (at.x[nodes] - at.x[nodes].mean(axis=0)) / extent
        for c in range(3):
            basis[6 * p + c, nodes, c] = 1.0
            basis[6 * p + 3 + c, nodes, :3] = np.cross(np.eye(3)[c], arm)
            basis[6 * p + 3 + c, nodes, 3 + c] = 1.0 / extent
    forces = out_of_balance(model, given, at)
    nothing = np.zeros_like(forces.value)
    Z = np.array([pattern.gather(z, nothing) for z in basis]).T
    node, joint = ~pattern.joint, pattern.joint
    at, force = _borne(model, given, at, pattern, basis, Z)
    matrix = pattern.matrix(*tangent(model, given, at, forces.s, forces.tension, forces.lengths)).tocsr()
    K = matrix[node][:, node]
    H = Z[node].T @ (K @ Z[node])
    noise = float((np.abs(Z[node]).T @ (abs(K) @ np.abs(Z[node]))).max(initial=0.0))
    bare = H.copy()
    for p, nodes in enumerate(parts):
        # a turn t moves a node to second order by t x (t x r) / 2
        f, r = force[nodes, :3], at.x[nodes] - at.x[nodes].mean(axis=0)
        second = np.einsum("ni,ni->", f, r) * np.eye(3) - np.einsum("ni,nj->ij", f, r)
        H[6 * p + 3 : 6 * p + 6, 6 * p + 3 : 6 * p + 6] += 0.5 * (second + second.T) / extent**2
    rows = [matrix[joint][:, node] @ Z[node], basis[:, given.assembly.inertia.held == 1].reshape(len(basis), -1).T]
    bound = np.vstack(rows)
    sizes = np.linalg.norm(bound, axis=1)
    bound = bound[sizes > 1e-12] / sizes[sizes > 1e-12, None]
    allowed = null_space(bound, rcond=1e-9) if len(bound) else np.eye(len(basis))
    if allowed.shape[1] == 0:
        return [], False
    small = allowed.T @ H @ allowed
    values, vectors = np.linalg.eigh(0.5 * (small + small.T))
    zero = np.abs(values) <= 1e-12 * noise + 1e-9 * forces.scale / extent
    slack = np.abs(np.linalg.eigvalsh(allowed.T @ (0.5 * (bare + bare.T)) @ allowed)).min() <= 1e-12 * noise
    free = allowed @ vectors[:, zero]
    load = np.einsum("nc,znc->z", forces.force, basis)
    found = []
    for z in _tidy(free).T:
        motion = np.einsum("z,znc->nc", z, basis)
        turns = bool(np.linalg.norm(motion[:, 3:]) * extent > 1e-6 * np.linalg.norm(motion[:, :3]))
        # a part with one node may do nothing but turn
        turns = turns or not np.linalg.norm(motion[:, :3]) > 0.0
        pushed = abs(float(load @ z)) > 1e-9 * max(forces.scale, 1e-300) * float(np.linalg.norm(z))
        found.append(FreeMotion(motion, _name(model, parts, z), turns, pushed))
    return found, bool(slack)


def _borne(
    model: RodModel, given: Conditions, at: Point, pattern: Pattern, basis: Array, Z: Array
) -> tuple[Point, Array]:
    """The point with multipliers, and the forces on all nodes (n, 6) with those of supports, that balance rigid parts.

    Only in the sense of least squares, where parts are pushed along free motions.
    """
    free = given.everywhere_free()
    forces = out_of_balance(model, free, at)
    held = given.assembly.inertia.held == 1
    matrix = pattern.matrix(*tangent(model, given, at, forces.s, forces.tension, forces.lengths)).tocsr()
    node, joint = ~pattern.joint, pattern.joint
    G = matrix[joint][:, node] @ Z[node]
    rows = np.vstack([G, basis[:, held].reshape(len(basis), -1).T])
    load = np.einsum("nc,znc->z", forces.force, basis)
    if not len(rows):
        return at, forces.force
    found = np.linalg.lstsq(rows.T, -load, rcond=1e-10)[0]
    change = np.zeros(pattern.size)
    change[joint] = found[: len(G)]
    at = Point(at.x, at.Q, at.multiplier + pattern.scatter(change)[1])
    force = out_of_balance(model, free, at).force
    force[held] += found[len(G) :].reshape(-1, 6)
    return at, force


def _parts(model: RodModel) -> list[NDArray[np.int64]]:
    """Nodes that elements tie together."""
    root = np.arange(model.n_nodes)
    pairs = model.assembly.elements.nodes
    while True:  # few rounds: elements run along rods
        low = np.minimum(root[pairs[:, 0]], root[pairs[:, 1]]) if len(pairs) else root[:0]
        before = root.copy()
        np.minimum.at(root, pairs[:, 0], low)
        np.minimum.at(root, pairs[:, 1], low)
        root = root[root]
        if np.array_equal(root, before):
            return [np.flatnonzero(root == r) for r in np.unique(root)]


def _tidy(free: Array) -> Array:
    """The same motions combined so that each has as few components as can be (reduced echelon form)."""
    A = free.T.copy()
    row = 0
    # turns first, so that what is left are translations
    order = [c for c in range(A.shape[1]) if c % 6 > 2] + [c for c in range(A.shape[1]) if c % 6 < 3]
    for c in order:
        if row == len(A):
            break
        k = row + int(np.abs(A[row:, c]).argmax())
        if abs(A[k, c]) < 1e-7:
            continue
        A[[row, k]] = A[[k, row]]
        A[row] /= A[row, c]
        for i in range(len(A)):
            if i != row:
                A[i] -= A[i, c] * A[row]
        row += 1
    A[np.abs(A) < 1e-7] = 0.0
    return A.T


def _name(model: RodModel, parts: list[NDArray[np.int64]], z: Array) -> str:
    each = z.reshape(len(parts), 6)
    most = int(np.linalg.norm(each, axis=1).argmax())
    part = each[most]
    kind, v = ("rotation about", part[3:]) if np.linalg.norm(part[3:]) > 1e-6 else ("translation along", part[:3])
    v = v / np.linalg.norm(v)
    axis = "xyz"[int(np.abs(v).argmax())] if np.abs(v).max() > 1.0 - 1e-6 else "({:.3g}, {:.3g}, {:.3g})".format(*v)
    if len(parts) == 1:
        return f"{kind} {axis}"
    node = int(parts[most][0])
    name = next(key[0] for key, i in model.atlas.node_of.items() if i == node)
    return f"{kind} {axis} of {name!r}"
