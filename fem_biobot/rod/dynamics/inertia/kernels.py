"""Compiled inertia of the nodes: momenta, velocities from momenta, kinetic energy; and copies of node arrays.

Angular momenta and velocities are spatial; `J` (n, 3, 3) [kg mm^2] is the inertia in the nodes' own frames.
"""

from __future__ import annotations

from fem_biobot.compile_cache import BORROWS, INNER, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.algebra.kernels import apply, matrix_of, product, transpose  # noqa: E402


@njit(**INNER, **BORROWS)
def clear(a):
    """Fill an array (i, j) with zeros."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            a[i, j] = 0.0


@njit(**INNER, **BORROWS)
def clear_blocks(a):
    """Fill an array (i, j, k) with zeros."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            for k in range(a.shape[2]):
                a[i, j, k] = 0.0


@njit(**INNER, **BORROWS)
def copy(a, to):
    """Copy an array (i, j)."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            to[i, j] = a[i, j]


@njit(**INNER, **BORROWS)
def copy_row(a, to):
    """Copy an array (i,)."""
    for i in range(a.shape[0]):
        to[i] = a[i]


@njit(**INNER, **BORROWS)
def copy_frames(a, to):
    """Copy directors (n, 3, 3)."""
    for i in range(a.shape[0]):
        for j in range(3):
            for k in range(3):
                to[i, j, k] = a[i, j, k]


@njit(**INNER, **BORROWS)
def spatial_matrix(J, Q, i):
    """``Q^T J Q`` of node `i`, a matrix tuple."""
    directors = matrix_of(Q, i)
    return product(transpose(directors), product(matrix_of(J, i), directors))


@njit(**KERNEL, **BORROWS)
def angular_momentum(J, Q, v, out):
    """Write the angular momentum of every node about its centre of mass, (n, 3) [kg mm^2/s]."""
    for i in range(J.shape[0]):
        directors = matrix_of(Q, i)
        body = apply(matrix_of(J, i), apply(directors, (v[i, 3], v[i, 4], v[i, 5])))
        spatial = apply(transpose(directors), body)
        for a in range(3):
            out[i, a] = spatial[a]


@njit(**INNER, **BORROWS)
def inverses(inertia, out):
    """Write the inverses of the free nodes' inertias, (n, 3, 3); held nodes get zeros, so that they never turn."""
    for i in range(inertia.mass.shape[0]):
        J = inertia.J[i]
        det = 0.0
        for a in range(3):
            b = (a + 1) % 3
            c = (a + 2) % 3
            for d in range(3):
                e = (d + 1) % 3
                f = (d + 2) % 3
                # cyclic cofactors carry their signs; the matrix is symmetric
                out[i, d, a] = J[b, e] * J[c, f] - J[b, f] * J[c, e]
            det += J[a, 0] * out[i, 0, a] / 3.0 + J[a, 1] * out[i, 1, a] / 3.0 + J[a, 2] * out[i, 2, a] / 3.0
        for a in range(3):
            for d in range(3):
                out[i, a, d] = out[i, a, d] / det if inertia.held[i] == 0 else 0.0


@njit(**INNER, **BORROWS)
def angular_velocity(inverse, Q, i, x, y, z):
    """Angular velocity, a tuple, of node `i` with the angular momentum (x, y, z)."""
    directors = matrix_of(Q, i)
    return apply(transpose(directors), apply(matrix_of(inverse, i), apply(directors, (x, y, z))))


@njit(**INNER, **BORROWS)
def spin_up(inverse, Q, spin, v):
    """Write the angular velocities of the nodes with angular momenta `spin` (n, 3) into `v` (n, 6)."""
    for i in range(spin.shape[0]):
        w = angular_velocity(inverse, Q, i, spin[i, 0], spin[i, 1], spin[i, 2])
        for a in range(3):
            v[i, 3 + a] = w[a]


@njit(**INNER, **BORROWS)
def kinetic_energy(mass, spin, v):
    """Of nodes with angular momenta `spin` (n, 3) and velocities `v` (n, 6) [uJ]."""
    total = 0.0
    for i in range(mass.shape[0]):
        for a in range(3):
            total += 0.5 * (mass[i] * v[i, a] * v[i, a] + spin[i, a] * v[i, 3 + a])
    return total


@njit(**INNER, **BORROWS)
def power_of(force, v):
    """Sum of ``force . v`` over the nodes of `v` (n, 6)."""
    total = 0.0
    for i in range(v.shape[0]):
        for c in range(6):
            total += force[i, c] * v[i, c]
    return total
