"""Compiled active tension of muscles: standing and stimulated, the latter with factors of stretch and its rate."""

from __future__ import annotations

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)


@njit(**KERNEL, **BORROWS)
def factor(activation, q, x):
    """Value and slope of the curve `q` at `x`; its end values outside its limits, and 1 without a curve (-1)."""
    if q < 0:
        return 1.0, 0.0
    table = activation.table
    last = table.shape[1] - 1
    z = (x - activation.low[q]) / activation.spacing[q]
    if z <= 0.0:
        return table[q, 0, 0], 0.0
    if z >= last:
        return table[q, last, 0], 0.0
    i = int(z)
    t = z - i
    # cubic with values and slopes (times the spacing) of both knots
    a = table[q, i, 0]
    b = table[q, i + 1, 0] - a
    c = table[q, i, 1]
    d = table[q, i + 1, 1]
    p = 3.0 * b - 2.0 * c - d
    s = c + d - 2.0 * b
    return a + t * (c + t * (p + t * s)), (c + t * (2.0 * p + 3.0 * t * s)) / activation.spacing[q]


@njit(**KERNEL, **BORROWS)
def active_tension(activation, k, rest, before, after, weight, rate, pull):
    """Active force of a member, and its slopes by length and by rate of length.

    `before` and `after` are lengths, `rate` one over the time between them; the factor of stretch is averaged with
    `weight` on the end. The first slope lacks `weight`: that of the averaged force by the length `after` is
    ``weight`` times it, plus ``rate`` times the second. `pull` is the stimulated force at factors 1.
    """
    by_length, slope = factor(activation, activation.curve[k, 0], after / rest)
    if weight < 1.0:
        old, _ = factor(activation, activation.curve[k, 0], before / rest)
        by_length = old + weight * (by_length - old)
    by_rate, lag = factor(activation, activation.curve[k, 1], rate * (after - before) / rest)
    force = activation.standing[k] + pull * by_length * by_rate
    return force, pull * by_rate * slope / rest, pull * by_length * lag / rest
