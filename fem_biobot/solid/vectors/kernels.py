"""Compiled kernels of products of the symmetric matrix with vectors, and of vectors with vectors.

The matrix is the upper triangle of `solid.pattern`. Every kernel writes only to what its first line names.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

# places are unsigned: signed ones would be checked for counting from the end at every access
_ONE, _TWO, _THREE = (np.uint64(number) for number in (1, 2, 3))


@njit(cache=True, nogil=True, fastmath={"contract"})
def add_node_rows(begin, end, starts, columns, data, x, y):
    """Add to `y` what nodes `begin` to `end` of the upper triangle give ``A x``, also below the diagonal.

    For a symmetric matrix whose rows and columns are all nodes', three a node.

    By blocks of three rows and columns: one column number read for nine entries, and a third of the writes of a product
    by rows. `data` may be in single precision; the sums are not.
    """
    for a in range(begin, end):
        i = np.uint64(3 * a)
        first, second, third = np.uint64(starts[i]), np.uint64(starts[i + _ONE]), np.uint64(starts[i + _TWO])
        blocks = (second - first) // _THREE
        x0, x1, x2 = x[i], x[i + _ONE], x[i + _TWO]
        # the node's own block: rows of three, two and one
        y0 = data[first] * x0 + data[first + _ONE] * x1 + data[first + _TWO] * x2
        y1 = data[first + _ONE] * x0 + data[second] * x1 + data[second + _ONE] * x2
        y2 = data[first + _TWO] * x0 + data[second + _ONE] * x1 + data[third] * x2
        first += _THREE
        second += _TWO
        third += _ONE
        for _ in range(_ONE, blocks):
            j = np.uint64(columns[first])
            z0, z1, z2 = x[j], x[j + _ONE], x[j + _TWO]
            a00, a01, a02 = data[first], data[first + _ONE], data[first + _TWO]
            a10, a11, a12 = data[second], data[second + _ONE], data[second + _TWO]
            a20, a21, a22 = data[third], data[third + _ONE], data[third + _TWO]
            y0 += a00 * z0 + a01 * z1 + a02 * z2
            y1 += a10 * z0 + a11 * z1 + a12 * z2
            y2 += a20 * z0 + a21 * z1 + a22 * z2
            y[j] += a00 * x0 + a10 * x1 + a20 * x2
            y[j + _ONE] += a01 * x0 + a11 * x1 + a21 * x2
            y[j + _TWO] += a02 * x0 + a12 * x1 + a22 * x2
            first += _THREE
            second += _THREE
            third += _THREE
        y[i] += y0
        y[i + _ONE] += y1
        y[i + _TWO] += y2


@njit(cache=True, nogil=True)
def inner_product(x, y):
    """Inner product of two vectors."""
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i] * y[i]
    return total


@njit(cache=True, nogil=True)
def advance(alpha, p, Ap, x, r):
    """Write ``x += alpha p`` and ``r -= alpha Ap``; returns the squared norm of the new `r`."""
    total = 0.0
    for i in range(x.shape[0]):
        x[i] += alpha * p[i]
        r[i] -= alpha * Ap[i]
        total += r[i] * r[i]
    return total


@njit(cache=True, nogil=True)
def add_scaled(z, beta, p):
    """Write ``p = z + beta p``."""
    for i in range(p.shape[0]):
        p[i] = z[i] + beta * p[i]
