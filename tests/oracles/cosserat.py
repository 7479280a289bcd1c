"""Equilibrium of a cantilever rod as an ordinary differential equation in arc length, solved by shooting.

Independent of the elements: quaternions, an explicit Runge-Kutta method of order 8, and the moment at the clamp as the
unknown. Dead force at the tip and dead force per length; stiffnesses may be infinite.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

Array = NDArray[np.float64]


def _matrix(q: Array) -> Array:
    """Rotation matrix of a quaternion (w, x, y, z), columns the directors."""
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def cantilever_tip(
    length: float,
    stiffness: Sequence[float],
    tip_force: Sequence[float],
    *,
    per_length: Sequence[float] = (0.0, 0.0, 0.0),
    kappa0: Sequence[float] = (0.0, 0.0, 0.0),
    frame: Array | None = None,
    steps: int = 4,
    varying: Callable[[float], float] | None = None,
) -> Array:
    """Position of the tip, (3,), of a rod clamped at the origin.

    `stiffness` are GA1, GA2, EA, EI1, EI2, GJ; `frame` (3, 3) has the clamp's directors as rows; `varying` multiplies
    bending and torsion stiffness at an arc length.
    """
    C = np.array(stiffness, dtype=float)
    force, q, bent = (np.array(v, dtype=float) for v in (tip_force, per_length, kappa0))
    R0 = np.eye(3) if frame is None else np.array(frame, dtype=float).T
    e3 = np.array([0.0, 0.0, 1.0])

    def along(s: float, y: Array, load: float) -> Array:
        R = R0 @ _matrix(y[3:7])
        n = load * (force + q * (length - s))
        tangent = R @ (e3 + (R.T @ n) / C[:3])
        kappa = bent + (R.T @ y[7:]) / (C[3:] * (varying(s) if varying else 1.0))
        w, v = y[3], y[4:7]
        turn = 0.5 * np.concatenate([[-v @ kappa], w * kappa + np.cross(v, kappa)])
        return np.concatenate([tangent, turn, -np.cross(tangent, n)])

    def tip(moment: Array, load: float) -> Array:
        begin = np.concatenate([np.zeros(3), [1.0, 0.0, 0.0, 0.0], moment])
        return solve_ivp(along, (0.0, length), begin, "DOP853", rtol=1e-11, atol=1e-12 * length, args=(load,)).y[:, -1]

    moment = np.zeros(3)
    for load in np.linspace(0.0, 1.0, steps + 1)[1:]:
        scale = max(float(np.linalg.norm(force) + np.linalg.norm(q) * length), 1e-300) * length * load
        found = root(lambda m, at=load, by=scale: tip(m * by, at)[7:] / by, moment / scale, tol=1e-11)
        assert np.abs(found.fun).max() < 1e-9, found.message
        moment = found.x * scale
    return tip(moment, 1.0)[:3]


def follower_tip(length: float, bending: float, tip_force: Sequence[float]) -> Array:
    """Tip, along and across the clamp's tangent, (2,), of a plane inextensible cantilever whose tip force turns along.

    `tip_force` has components along and across the tip's tangent. Seen from the tip, where there is no moment, it is
    an initial value problem.
    """
    n = np.array(tip_force, dtype=float)

    def back(s: float, y: Array) -> Array:
        # y: position, turn and couple at the distance s from the tip, in the frame of the tip
        c, d = np.cos(y[2]), np.sin(y[2])
        return np.array([-c, -d, -y[3] / bending, c * n[1] - d * n[0]])

    end = solve_ivp(back, (0.0, length), np.zeros(4), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    c, d = np.cos(end[2]), np.sin(end[2])
    return -np.array([c * end[0] + d * end[1], -d * end[0] + c * end[1]])
