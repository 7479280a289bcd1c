"""Slow independent twins of the contact kernels, and Coulomb's law as inequalities.

Conventions are those of `friction.kernels`: rows normal, tangent 1, tangent 2; `mu` resists slip along +t1, -t1,
+t2, -t2. Nothing here is Newton, and no derivative is used.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def radii(x: Array, mu: Array) -> Array:
    """Radii of the quarter ellipse of friction ``x``, (2,): positive friction resists slip along -t."""
    return np.array([mu[1] if x[0] > 0 else mu[0], mu[3] if x[1] > 0 else mu[2]])


def nearest_admissible(z: Array, s: float, mu: Array) -> Array:
    """Point of ``s D`` nearest to ``z`` outside it: smallest distance along its edge, by search over angles."""
    low, high = -np.pi, np.pi
    for _ in range(30):
        angles = np.linspace(low, high, 801)
        edge = np.array([[np.cos(a), np.sin(a)] for a in angles])
        edge *= s * np.array([radii(e, mu) for e in edge])
        k = int(np.argmin(np.sum((edge - z) ** 2, axis=1)))
        width = (high - low) / 200
        low, high = angles[k] - width, angles[k] + width
    return edge[k]


def farthest(v: Array, mu: Array) -> float:
    """Largest ``v . x`` over D: its support function."""
    a, b = radii(v, mu)
    return float(np.hypot(a * v[0], b * v[1]))


def broken_law(W: Array, b: Array, mu: Array, p: Array) -> float:
    """By how much impulses break Signorini's and Coulomb's laws, relative to the velocity scale [1].

    Impulses are made velocities by the mobility of their point. Zero exactly where the laws hold: the farthest any
    friction can dissipate is what this one does.
    """
    w = b + (W @ p.ravel()).reshape(-1, 3)
    scale = max(np.abs(b[:, 1:]).max(), -b[:, 0].min())
    worst = 0.0
    for i in range(len(b)):
        block = W[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        normal = p[i, 0] * block[0, 0]
        tangential = p[i, 1:] * 0.5 * (block[1, 1] + block[2, 2])
        inside = p[i, 0] * radii(p[i, 1:], mu[i]) * 0.5 * (block[1, 1] + block[2, 2])
        worst = max(worst, -w[i, 0], -normal, min(w[i, 0], normal))
        outside = np.where(inside > 0.0, tangential / np.where(inside > 0.0, inside, 1.0), 0.0)
        if np.any((inside <= 0.0) & (np.abs(tangential) > 1e-12 * scale)):
            worst = np.inf
        worst = max(worst, (np.linalg.norm(outside) - 1.0) * np.abs(inside).max())
        if p[i, 0] > 0.0:
            worst = max(worst, farthest(-w[i, 1:], mu[i]) + w[i, 1:] @ p[i, 1:] / p[i, 0])
    return worst / scale


def projected_sweeps(W: Array, b: Array, friction: float, sweeps: int) -> Array:
    """Velocities by plain projected Gauss-Seidel, equal friction in all directions, (c, 3)."""
    p = np.zeros_like(b)
    for _ in range(sweeps):
        for i in range(len(b)):
            rows = slice(3 * i, 3 * i + 3)
            p[i, 0] = max(0.0, p[i, 0] - (b[i, 0] + W[3 * i] @ p.ravel()) / W[3 * i, 3 * i])
            wish = p[i, 1:] - (b[i] + W[rows] @ p.ravel())[1:] / max(W[3 * i + 1, 3 * i + 1], W[3 * i + 2, 3 * i + 2])
            size = float(np.linalg.norm(wish))
            most = friction * p[i, 0]
            p[i, 1:] = wish if size <= most else wish * (most / size)
    return b + (W @ p.ravel()).reshape(-1, 3)


def rigid_foot(corners: Array, mass: float, inertia: Array) -> tuple[Array, Array]:
    """Operator W (3c, 3c) [1/kg] of points (c, 3) of a free rigid body about its centre, and its Jacobian (3c, 6)."""
    H = np.zeros((3 * len(corners), 6))
    for i, (x, y, z) in enumerate(corners):
        H[3 * i] = (0.0, 0.0, 1.0, y, -x, 0.0)
        H[3 * i + 1] = (1.0, 0.0, 0.0, 0.0, z, -y)
        H[3 * i + 2] = (0.0, 1.0, 0.0, -z, 0.0, x)
    mobility = np.zeros((6, 6))
    mobility[:3, :3] = np.eye(3) / mass
    mobility[3:, 3:] = np.linalg.inv(inertia)
    return H @ mobility @ H.T, H
