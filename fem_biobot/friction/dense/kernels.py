"""Compiled kernels for small dense systems in buffers that are larger than the system: nothing is allocated."""

from __future__ import annotations

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)


@njit(**KERNEL, **BORROWS)
def factor(A, n, exchanged):
    """Overwrite the leading n by n part of `A` with its L and U factors; `exchanged` gets the rows exchanged.

    Returns whether every pivot was finite and not zero.
    """
    for k in range(n):
        largest = abs(A[k, k])
        found = k
        for i in range(k + 1, n):
            size = abs(A[i, k])
            if size > largest:
                largest = size
                found = i
        exchanged[k] = found
        if not 0.0 < largest < 1e300:
            return False
        if found != k:
            for j in range(n):
                A[k, j], A[found, j] = A[found, j], A[k, j]
        inverse = 1.0 / A[k, k]
        pivot_row = A[k, k + 1 : n]
        for i in range(k + 1, n):
            if A[i, k] != 0.0:
                m = A[i, k] * inverse
                A[i, k] = m
                row = A[i, k + 1 : n]
                for j in range(row.size):
                    row[j] -= m * pivot_row[j]
    return True


@njit(**KERNEL, **BORROWS)
def substitute(A, n, exchanged, x):
    """Overwrite the first n entries of `x` with the solution of the factored system."""
    for k in range(n):
        found = exchanged[k]
        if found != k:
            x[k], x[found] = x[found], x[k]
    for i in range(n):
        total = x[i]
        for j in range(i):
            total -= A[i, j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        total = x[i]
        for j in range(i + 1, n):
            total -= A[i, j] * x[j]
        x[i] = total / A[i, i]
