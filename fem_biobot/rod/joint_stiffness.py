"""Geometric stiffness of joints: how the forces that a joint exerts change with the directions of its rows.

Without it a pendulum has no frequency and a loaded mechanism no stability. Few joints, so NumPy.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.arrays import Constraints

Array = NDArray[np.float64]


def joint_stiffness(constraints: Constraints, Q: Array, multiplier: Array) -> Array:
    """Minus the derivative of the joints' forces by the increments of their two nodes at fixed multipliers.

    Parameters
    ----------
    constraints, Q
        The joints, and the directors of the nodes (n, 3, 3) [1].
    multiplier
        What each row exerts on the joint's first part, (j, 6) [mN, uJ].

    Returns
    -------
    Array
        (j, 12, 12); rows and columns of the world are zero. Same as finite differences of `parts.kernels.constraint`.
    """
    out = np.zeros((len(constraints.rows), 12, 12))
    for j, (pair, held) in enumerate(zip(constraints.nodes, constraints.rows, strict=True)):
        force, couple = multiplier[j, :3] * held[:3], multiplier[j, 3:] * held[3:]
        for end, sign in ((0, -1.0), (1, 1.0)):
            if pair[end] >= 0:
                arm = Q[pair[end]].T @ constraints.offset[j, end]
                out[j, 6 * end + 3 : 6 * end + 6, 6 * end + 3 : 6 * end + 6] += sign * _turning(arm, force)
        A, B = (constraints.frame[j, end] @ (Q[pair[end]] if pair[end] >= 0 else np.eye(3)) for end in (0, 1))
        for c in np.flatnonzero(held[3:]):
            for weight, p, q in row_terms(held[3:], int(c)):
                # the row is weight A_p x B_q, on the first part; the opposite on the second
                by_first = weight * couple[c] * _turning(A[p], B[q])
                by_second = -weight * couple[c] * _turning(B[q], A[p])
                out[j, 3:6, 3:6] -= by_first
                out[j, 3:6, 9:12] -= by_second
                out[j, 9:12, 3:6] += by_first
                out[j, 9:12, 9:12] += by_second
        if pair[1] < 0:
            out[j, 6:] = 0.0
            out[j, :, 6:] = 0.0
    return out


def row_terms(held: NDArray[np.int64], c: int) -> list[tuple[float, int, int]]:
    """The rotation row `c` as a sum of ``weight A_p x B_q`` of both parts' axes; see `parts.kernels.constraint`."""
    if held.sum() == 2:
        f = int(np.flatnonzero(held == 0)[0])
        e = 3 - f - c
        return [(1.0 if (f + 1) % 3 == e else -1.0, f, e)]
    d, e = (c + 1) % 3, (c + 2) % 3
    return [(0.5, d, e), (-0.5, e, d)]


def _turning(a: Array, b: Array) -> Array:
    """Matrix of ``(t x a) x b`` by t."""
    return np.outer(a, b) - (a @ b) * np.eye(3)
