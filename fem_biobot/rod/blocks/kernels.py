"""Compiled block LU: factorisation in place and solution, both along a plan made by `rod.blocks.plan`."""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ALLOCATES, BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_AT_ONCE = 4  # nodes whose columns are solved together


@njit(**KERNEL, **ALLOCATES)
def invert(A):
    """Replace a 6 by 6 matrix by its inverse (Gauss-Jordan, rows pivoted); False if it is singular."""
    pivots = np.empty(6, dtype=np.int64)
    for k in range(6):
        row = k
        for i in range(k + 1, 6):
            if abs(A[i, k]) > abs(A[row, k]):
                row = i
        pivots[k] = row
        if not abs(A[row, k]) > 0.0:
            return False
        if row != k:
            for j in range(6):
                A[k, j], A[row, j] = A[row, j], A[k, j]
        scale = 1.0 / A[k, k]
        A[k, k] = 1.0
        for j in range(6):
            A[k, j] *= scale
        for i in range(6):
            if i != k:
                factor = A[i, k]
                A[i, k] = 0.0
                for j in range(6):
                    A[i, j] -= factor * A[k, j]
    for k in range(5, -1, -1):
        row = pivots[k]
        if row != k:
            for i in range(6):
                A[i, k], A[i, row] = A[i, row], A[i, k]
    return True


@njit(**KERNEL, **ALLOCATES)
def factor(plan, blocks):
    """Factorise `blocks` (t, 6, 6) in place: inverted diagonal blocks, ``L`` below, ``U`` above; False if singular."""
    product = np.empty((6, 6))
    for s in range(plan.order.shape[0]):
        D = blocks[plan.diagonal[plan.order[s]]]
        if not invert(D):
            return False
        first = plan.start[s]
        count = plan.start[s + 1] - first
        for a in range(count):
            L = blocks[plan.lower[first + a]]
            for i in range(6):
                for j in range(6):
                    product[i, j] = 0.0
                for k in range(6):
                    value = L[i, k]
                    for j in range(6):
                        product[i, j] += value * D[k, j]
            L[:, :] = product
        for a in range(count):
            L = blocks[plan.lower[first + a]]
            for b in range(count):
                U = blocks[plan.upper[first + b]]
                B = blocks[plan.update[plan.update_start[s] + a * count + b]]
                for i in range(6):
                    for k in range(6):
                        value = L[i, k]
                        for j in range(6):
                            B[i, j] -= value * U[k, j]
    return True


@njit(**KERNEL, **ALLOCATES)
def solve(plan, blocks, b):
    """Replace `b` (n, 6) by the solution of the factorised system."""
    y = np.empty(6)
    n = plan.order.shape[0]
    for s in range(n):
        k = plan.order[s]
        for t in range(plan.start[s], plan.start[s + 1]):
            L = blocks[plan.lower[t]]
            i = plan.neighbour[t]
            for r in range(6):
                total = 0.0
                for c in range(6):
                    total += L[r, c] * b[k, c]
                b[i, r] -= total
    for s in range(n - 1, -1, -1):
        k = plan.order[s]
        for t in range(plan.start[s], plan.start[s + 1]):
            U = blocks[plan.upper[t]]
            i = plan.neighbour[t]
            for r in range(6):
                total = 0.0
                for c in range(6):
                    total += U[r, c] * b[i, c]
                b[k, r] -= total
        D = blocks[plan.diagonal[k]]
        for r in range(6):
            total = 0.0
            for c in range(6):
                total += D[r, c] * b[k, c]
            y[r] = total
        for r in range(6):
            b[k, r] = y[r]


@njit(**KERNEL, **BORROWS)
def _solve_lanes(plan, blocks, b, y, reached):
    """As `solve` for several right sides at once, `b` (n, 6, w); `y` (6, w) is scratch.

    Each block is read once for all of them, and the innermost loop runs along them. `reached` (n,) marks unknowns whose
    right side is not zero; others are marked where it ceases to be. Where none of these is, nothing is solved: rows
    that are not marked in the end keep their zeros, which are not the solution there.
    """
    n = plan.order.shape[0]
    w = b.shape[2]
    for s in range(n):
        k = plan.order[s]
        if not reached[k]:
            continue
        for t in range(plan.start[s], plan.start[s + 1]):
            L = blocks[plan.lower[t]]
            i = plan.neighbour[t]
            reached[i] = True
            for r in range(6):
                for c in range(6):
                    value = L[r, c]
                    for j in range(w):
                        b[i, r, j] -= value * b[k, c, j]
    for s in range(n - 1, -1, -1):
        k = plan.order[s]
        if not reached[k]:
            continue
        for t in range(plan.start[s], plan.start[s + 1]):
            U = blocks[plan.upper[t]]
            i = plan.neighbour[t]
            for r in range(6):
                for c in range(6):
                    value = U[r, c]
                    for j in range(w):
                        b[k, r, j] -= value * b[i, c, j]
        D = blocks[plan.diagonal[k]]
        for r in range(6):
            for j in range(w):
                y[r, j] = 0.0
            for c in range(6):
                value = D[r, c]
                for j in range(w):
                    y[r, j] += value * b[k, c, j]
        for r in range(6):
            for j in range(w):
                b[k, r, j] = y[r, j]


@njit(**KERNEL, **ALLOCATES)
def compliance(plan, blocks, nodes, out):
    """Write the factorised system's solutions at `nodes` (f,) for units there, a row for each unit, (6 f, 6 f)."""
    count = nodes.shape[0]
    most = max(1, min(count, _AT_ONCE))
    b = np.empty((plan.order.shape[0], 6, 6 * most))
    y = np.empty((6, 6 * most))
    reached = np.empty(plan.order.shape[0], dtype=np.bool_)
    for first in range(0, count, most):
        here = min(most, count - first)
        b[:] = 0.0
        # solutions at these nodes depend on what is eliminated after them alone, and so do those they cause
        reached[:] = False
        for f in range(count):
            reached[nodes[f]] = True
        for f in range(here):
            for c in range(6):
                b[nodes[first + f], c, 6 * f + c] = 1.0
        _solve_lanes(plan, blocks, b, y, reached)
        for j in range(6 * here):
            for other in range(count):
                for r in range(6):
                    out[6 * first + j, 6 * other + r] = b[nodes[other], r, j]
