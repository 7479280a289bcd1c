"""Vectors and 3 by 3 matrices as tuples of scalars: compiled code keeps them in registers and allocates nothing.

A vector is a tuple of 3, a matrix a tuple of 9 by rows. Every function returns a new tuple.
"""

from __future__ import annotations

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)


@njit(**KERNEL, **BORROWS)
def dot(a, b):
    """Inner product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(**KERNEL, **BORROWS)
def cross(a, b):
    """Vector product ``a x b``."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@njit(**KERNEL, **BORROWS)
def combine(s, a, t, b):
    """Vector ``s a + t b``."""
    return (s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2])


@njit(**KERNEL, **BORROWS)
def skew(a):
    """Matrix ``[a]x`` with ``[a]x b = a x b``."""
    return (0.0, -a[2], a[1], a[2], 0.0, -a[0], -a[1], a[0], 0.0)


@njit(**KERNEL, **BORROWS)
def apply(A, b):
    """Vector ``A b``."""
    return (
        A[0] * b[0] + A[1] * b[1] + A[2] * b[2],
        A[3] * b[0] + A[4] * b[1] + A[5] * b[2],
        A[6] * b[0] + A[7] * b[1] + A[8] * b[2],
    )


@njit(**KERNEL, **BORROWS)
def transpose(A):
    """Matrix ``A^T``."""
    return (A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8])


@njit(**KERNEL, **BORROWS)
def add(A, s, B):
    """Matrix ``A + s B``."""
    return (
        A[0] + s * B[0],
        A[1] + s * B[1],
        A[2] + s * B[2],
        A[3] + s * B[3],
        A[4] + s * B[4],
        A[5] + s * B[5],
        A[6] + s * B[6],
        A[7] + s * B[7],
        A[8] + s * B[8],
    )


@njit(**KERNEL, **BORROWS)
def add_outer(A, s, a, b):
    """Matrix ``A + s a b^T``."""
    x, y, z = s * a[0], s * a[1], s * a[2]
    return (
        A[0] + x * b[0],
        A[1] + x * b[1],
        A[2] + x * b[2],
        A[3] + y * b[0],
        A[4] + y * b[1],
        A[5] + y * b[2],
        A[6] + z * b[0],
        A[7] + z * b[1],
        A[8] + z * b[2],
    )


@njit(**KERNEL, **BORROWS)
def multiple(s):
    """Matrix ``s I``."""
    return (s, 0.0, 0.0, 0.0, s, 0.0, 0.0, 0.0, s)


@njit(**KERNEL, **BORROWS)
def scaled(s, A):
    """Matrix ``s A``."""
    return (s * A[0], s * A[1], s * A[2], s * A[3], s * A[4], s * A[5], s * A[6], s * A[7], s * A[8])


@njit(**KERNEL, **BORROWS)
def product(A, B):
    """Matrix ``A B``."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@njit(**KERNEL, **BORROWS)
def row_of(a, i):
    """Row `i` of an array (n, 3) as a vector."""
    return (a[i, 0], a[i, 1], a[i, 2])


@njit(**KERNEL, **BORROWS)
def matrix_of(a, i):
    """Entry `i` of an array (n, 3, 3) as a matrix."""
    return (
        a[i, 0, 0],
        a[i, 0, 1],
        a[i, 0, 2],
        a[i, 1, 0],
        a[i, 1, 1],
        a[i, 1, 2],
        a[i, 2, 0],
        a[i, 2, 1],
        a[i, 2, 2],
    )
