"""The longest step with which explicit steps stay bounded.

With ``q`` at the half steps, a mode of angular frequency w and Kelvin-Voigt time tau obeys

    q2 - 2 q1 + q0 = -(h w)^2 (q1 + tau (q1 - q0) / h),   bounded while  (h w)^2 + 2 h w^2 tau < 4

(both roots within the unit circle). Drag of the rate g, taken at ``v1 + (v1 - v0) / 2``, adds ``4 h g`` to the left
side. For an assembly the left side is the largest eigenvalue of its tangent, with each element's stiffness multiplied
by ``1 + 2 tau / h`` and the drag's by ``4 / h``, over its masses; joints take directions away.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, eigsh

from fem_biobot.rod.arrays import Assembly
from fem_biobot.rod.assembly.kernels import add_stiffness, measure, resultants, tensions
from fem_biobot.rod.drag.kernels import add_drag_tangents
from fem_biobot.rod.dynamics.arrays import State
from fem_biobot.rod.parts.kernels import constraint
from fem_biobot.rod.system import System

Array = NDArray[np.float64]

_DENSE = 60  # unknowns up to which all eigenvalues are found
_ROUNDS = 20


def longest_step(assembly: Assembly, system: System, state: State, pull: Array, wanted: float) -> float:
    """Limit of the step at a state with `pull` added by the drive (k,) [s]; `wanted` if that is below it."""
    step = wanted
    if not len(assembly.damping) and not len(assembly.members.law) and not len(assembly.drag.node):
        return step
    for _ in range(_ROUNDS):
        slow, value = _modes(assembly, system, state, pull, step)
        if value <= 4.0:
            return step
        # the stiffest mode: a h^2 + 2 b h = 4
        a = slow / step**2
        b = 0.5 * (value - slow) / step
        step = (np.sqrt(b * b + 4.0 * a) - b) / a if a > 0.0 else 2.0 / b
        step *= 1.0 - 1e-6
    return step


def _modes(assembly: Assembly, system: System, state: State, pull: Array, h: float) -> tuple[float, float]:
    """Elastic part and whole of the largest eigenvalue of ``h^2 M^-1 K`` with damping."""
    damped = _operator(assembly, system, state, pull, h, 1.0)
    size = state.v.size
    if size <= _DENSE:
        values, vectors = np.linalg.eigh(np.array([damped(row) for row in np.eye(size)]))
    else:
        first = 1.0 + np.cos(7.0 * np.arange(size))  # the same in every run
        whole: Any = LinearOperator((size, size), matvec=damped, dtype=np.float64)  # type: ignore[call-arg]
        settings: dict[str, Any] = {"k": 1, "which": "LA", "tol": 1e-4, "v0": first, "maxiter": 20 * size}
        values, vectors = eigsh(whole, **settings)
    mode = vectors[:, -1]
    return max(float(mode @ _operator(assembly, system, state, pull, h, 0.0)(mode)), 0.0), float(values[-1])


def _operator(
    assembly: Assembly, system: System, state: State, pull: Array, h: float, damping: float
) -> Callable[[Array], Array]:
    """Product with the symmetric part of ``h^2 M^-1/2 K M^-T/2`` of the free motions; `damping` is a factor on that."""
    n, m, k = len(state.x), len(assembly.damping), len(assembly.members.law)
    strain, lengths, s, tension = np.zeros((m, 6)), np.zeros(k), np.zeros((m, 6)), np.zeros(k)
    slopes = np.zeros((k, 2))
    measure(assembly, state.x, state.Q, strain, lengths)
    resultants(assembly, strain, strain, 1.0, 0.0, s)
    tensions(assembly.members, assembly.activation, lengths, lengths, 1.0, 0.0, pull, tension, np.zeros(k), slopes)
    rate = 2.0 * damping / h
    blocks = np.zeros((system.n_blocks, 6, 6))
    add_stiffness(
        assembly, system, state.x, state.Q, s, 1.0 + rate * assembly.damping, tension, slopes, lengths, 1.0, rate,
        np.zeros(len(assembly.loads.node)), h * h, blocks,
    )  # fmt: skip
    add_drag_tangents(
        assembly.drag, assembly.inertia.held, system.plan.diagonal, state.Q, state.v, 4.0 * damping * h, 0.0, blocks
    )
    root = np.zeros((n, 6, 6))  # of the inverse masses: M^-1 = root root^T
    for i in range(n):
        if assembly.inertia.held[i] == 0:
            J = state.Q[i].T @ assembly.inertia.J[i] @ state.Q[i]
            root[i, :3, :3] = np.eye(3) / np.sqrt(assembly.inertia.mass[i])
            root[i, 3:, 3:] = np.linalg.inv(np.linalg.cholesky(J)).T
    place = {int(system.plan.diagonal[i]): (i, i) for i in range(n)}
    for slots, nodes in ((system.element, assembly.elements.nodes), (system.member, assembly.members.nodes)):
        for four, (a, b) in zip(slots, nodes, strict=True):
            place |= {int(t): pair for t, pair in zip(four, ((a, a), (a, b), (b, a), (b, b)), strict=True) if t >= 0}
    slot = np.array(list(place), dtype=np.int64)
    row, column = np.array(list(place.values()), dtype=np.int64).T
    scaled = np.einsum("tji,tjk,tkl->til", root[row], blocks[slot], root[column])
    kept = _kept(assembly, state, root)

    def product(y: Array) -> Array:
        z = _project(kept, np.asarray(y).reshape(-1)).reshape(n, 6)
        out = np.zeros((n, 6))
        np.add.at(out, row, 0.5 * np.einsum("tij,tj->ti", scaled, z[column]))
        np.add.at(out, column, 0.5 * np.einsum("tji,tj->ti", scaled, z[row]))
        return _project(kept, out.reshape(-1))

    return product


def _kept(assembly: Assembly, state: State, root: Array) -> Array:
    """Orthonormal directions that joints forbid, (r, 6 n)."""
    n = len(state.x)
    found, value, rows = [], np.zeros(6), np.zeros((6, 12))
    for j, pair in enumerate(assembly.constraints.nodes):
        constraint(assembly.constraints, j, state.x, state.Q, value, rows)
        for r in np.flatnonzero(assembly.constraints.rows[j]):
            line = np.zeros((n, 6))
            for end, i in enumerate(pair):
                if i >= 0:
                    line[i] += root[i].T @ rows[r, 6 * end : 6 * end + 6]
            found.append(line.reshape(-1))
    if not found:
        return np.zeros((0, 6 * n))
    _, sizes, directions = np.linalg.svd(np.array(found), full_matrices=False)
    return directions[sizes > 1e-10 * sizes.max()]


def _project(kept: Array, y: Array) -> Array:
    return y - kept.T @ (kept @ y)
