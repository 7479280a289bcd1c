"""Finite rotations: exponential and logarithm of so(3), and updates of directors that stay orthonormal.

Rotation vectors are tuples of 3 [rad], matrices tuples of 9 by rows (see `rod.algebra`). All goes through the unit
quaternion ``(w, v) = (cos(phi/2), sin(phi/2) n)``, whose formulas lose no digits at any angle, so none needs a series.
"""

from __future__ import annotations

import math

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.algebra.kernels import add, add_outer, dot, matrix_of, multiple, product, skew, transpose  # noqa: E402


@njit(**KERNEL, **BORROWS)
def quaternion(R):
    """Unit quaternion ``w, v`` with ``w >= 0`` of a rotation matrix.

    Divides by the largest of the four components, so it is accurate at every angle (S. W. Shepperd 1978, Quaternion
    from rotation matrix). At exactly pi both signs of `v` are right, and the largest component is made positive.
    """
    trace = R[0] + R[4] + R[8]
    if trace >= R[0] and trace >= R[4] and trace >= R[8]:
        w = 0.5 * math.sqrt(1.0 + trace)
        f = 0.25 / w
        return w, (f * (R[7] - R[5]), f * (R[2] - R[6]), f * (R[3] - R[1]))
    if R[0] >= R[4] and R[0] >= R[8]:
        x = 0.5 * math.sqrt(1.0 + 2.0 * R[0] - trace)
        f = 0.25 / x
        w, y, z = f * (R[7] - R[5]), f * (R[1] + R[3]), f * (R[2] + R[6])
    elif R[4] >= R[8]:
        y = 0.5 * math.sqrt(1.0 + 2.0 * R[4] - trace)
        f = 0.25 / y
        w, x, z = f * (R[2] - R[6]), f * (R[1] + R[3]), f * (R[5] + R[7])
    else:
        z = 0.5 * math.sqrt(1.0 + 2.0 * R[8] - trace)
        f = 0.25 / z
        w, x, y = f * (R[3] - R[1]), f * (R[2] + R[6]), f * (R[5] + R[7])
    if w < 0.0:
        return -w, (-x, -y, -z)
    return w, (x, y, z)


@njit(**KERNEL, **BORROWS)
def angle_per_sine(w, v):
    """Factor that turns the `v` of a quaternion with ``w >= 0`` into its rotation vector, between 2 and pi."""
    s = math.sqrt(dot(v, v))
    if s == 0.0:
        return 2.0
    return 2.0 * math.atan2(s, w) / s


@njit(**KERNEL, **BORROWS)
def log(R):
    """Rotation vector of a rotation matrix, no longer than pi; inverse of `exp` below pi."""
    w, v = quaternion(R)
    f = angle_per_sine(w, v)
    return (f * v[0], f * v[1], f * v[2])


@njit(**KERNEL, **BORROWS)
def exp(phi):
    """Rotation matrix of a rotation vector of any length."""
    angle = math.sqrt(dot(phi, phi))
    f = 0.5
    if angle > 0.0:
        f = math.sin(0.5 * angle) / angle
    v = (f * phi[0], f * phi[1], f * phi[2])
    w = math.cos(0.5 * angle)
    # I + 2 w [v]x + 2 [v]x^2
    return add_outer(add(multiple(1.0 - 2.0 * dot(v, v)), 2.0 * w, skew(v)), 2.0, v, v)


@njit(**KERNEL, **BORROWS)
def turned(Q, dtheta):
    """Directors `Q` (rows, a matrix tuple) after the spatial rotation `dtheta`: ``Q exp(-[dtheta]x)``.

    One Newton step towards the nearest rotation follows the product, so that `Q` stays orthonormal to rounding however
    often it is updated; it removes stretch alone and turns nothing.
    """
    T = product(Q, transpose(exp(dtheta)))
    excess = add(product(T, transpose(T)), -1.0, multiple(1.0))
    return add(T, -0.5, product(excess, T))


@njit(**KERNEL, **BORROWS)
def turn(Q, dtheta, out):
    """Write the directors `Q` (n, 3, 3) [1] turned by the spatial vectors `dtheta` (n, 3) [rad]; `out` may be `Q`."""
    for n in range(Q.shape[0]):
        T = turned(matrix_of(Q, n), (dtheta[n, 0], dtheta[n, 1], dtheta[n, 2]))
        for i in range(3):
            for j in range(3):
                out[n, i, j] = T[3 * i + j]


@njit(**KERNEL, **BORROWS)
def rotation_between(Q_from, Q_to, out):
    """Write the spatial vectors (n, 3) [rad] that `turn` the directors `Q_from` into `Q_to`, (n, 3, 3), below pi."""
    for n in range(Q_from.shape[0]):
        phi = log(product(transpose(matrix_of(Q_to, n)), matrix_of(Q_from, n)))
        for i in range(3):
            out[n, i] = phi[i]
