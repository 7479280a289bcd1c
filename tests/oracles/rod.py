"""Rod element by matrix functions: strains as the logarithm of the rigid motion between its ends, in 4 by 4 matrices.

Slow and independent of the compiled element: no rotation vector, no middle frame, no closed form of any Jacobian.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, expm_frechet, logm

from fem_biobot.rod.element.arrays import Elements

Array = NDArray[np.float64]


def hat(twist: Array) -> Array:
    """Matrix (4, 4) of a twist: translation, then turn."""
    v, (x, y, z) = twist[:3], twist[3:]
    return np.block([[np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), v[:, None]], [np.zeros((1, 4))]])


def vee(X: Array) -> Array:
    """Twist of a matrix (4, 4); inverse of `hat`."""
    return np.array([*X[:3, 3], X[2, 1], X[0, 2], X[1, 0]])


def motion(strain: Array, length: float) -> Array:
    """Rigid motion (4, 4) along a rod of constant `strain` (6,), seen from its start."""
    return expm(length * hat(strain + np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])))


def end_frame(elements: Elements, e: int, i: int, x: Array, Q: Array) -> Array:
    """Frame (4, 4) of an element's end: directors as columns, position."""
    node = elements.nodes[e, i]
    g = np.eye(4)
    g[:3, :3] = (elements.turn[e, i] @ Q[node]).T
    g[:3, 3] = x[node] + Q[node].T @ elements.offset[e, i]
    return g


def strains(elements: Elements, x: Array, Q: Array) -> Array:
    """Strains (m, 6) of all elements."""
    out = []
    for e, length in enumerate(elements.length):
        relative = np.linalg.inv(end_frame(elements, e, 0, x, Q)) @ end_frame(elements, e, 1, x, Q)
        twist = vee(np.real(logm(relative))) / length
        strain = twist - np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        strain[2] += 0.5 * elements.sway[e] @ (strain[:2] - elements.eps0[e, :2]) ** 2
        out.append(strain)
    return np.array(out)


def forces(elements: Elements, x: Array, Q: Array, s: Array) -> Array:
    """Internal forces and moments on the nodes, (n, 6), for resultants `s` (m, 6), by virtual power."""
    out = np.zeros((len(x), 6))
    for e in range(len(elements.length)):
        ends = [end_frame(elements, e, i, x, Q) for i in (0, 1)]
        back = np.linalg.inv(ends[0]) @ ends[1]
        X = np.real(logm(back))
        # columns: change of the motion, in its own frame, for each component of the twist
        slope = np.stack([vee(np.linalg.inv(back) @ _slope(X, k)) for k in range(6)], axis=1)
        by_twist = np.eye(6)  # of the strains
        by_twist[2, :2] = elements.sway[e] * (vee(X)[:2] / elements.length[e] - elements.eps0[e, :2])
        for i, sign in enumerate((-1.0, 1.0)):
            node = elements.nodes[e, i]
            for k in range(6):
                move = np.zeros((4, 4))  # of the node: spatial displacement, or spatial turn about the node
                if k < 3:
                    move[k, 3] = 1.0
                else:
                    move = hat(np.eye(6)[k])
                    move[:3, 3] = -move[:3, :3] @ x[node]
                own = vee(np.linalg.inv(ends[1]) @ move @ ends[1])
                out[node, k] += sign * s[e] @ by_twist @ np.linalg.solve(slope, own)
    return out


def _slope(X: Array, k: int) -> Array:
    return expm_frechet(X, hat(np.eye(6)[k]), compute_expm=False)
