"""Compiled kernel of one contact point alone: its frictional problem with three unknowns, solved to rounding.

The three cases are tried in turn: no impulse, stick (a 3 by 3 system), slip. In slip, friction lies on the edge of its
set where the outward normal is some ``n(phi)`` and the point moves along ``-n``: one equation in the angle phi,
solved in a bracket found by walking away from the direction in which the sticking impulse leaves the set.
"""

from __future__ import annotations

import math

import numpy as np

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.friction.friction_set.kernels import admissible, farthest, project  # noqa: E402

_SMALLEST_RADIUS = 1e-8  # relative to the largest: below it the edge turns faster than its angle can be resolved
_SECTORS = 16
_EPS = 2.0**-52


@njit(**KERNEL, **BORROWS)
def _slip(phi, B, q0, q1, q2, m0, m1, m2, m3):
    """Impulse of a point that slips along ``-n(phi)``, and sine and cosine (times speed) of what it misses by."""
    n1 = math.cos(phi)
    n2 = math.sin(phi)
    d1, d2 = farthest(n1, n2, m0, m1, m2, m3)
    resistance = B[0, 0] + B[0, 1] * d1 + B[0, 2] * d2
    if resistance <= 0.0:  # friction presses the point down faster than the normal impulse lifts it
        return 0.0, d1, d2, np.nan, np.nan
    pn = -q0 / resistance
    v1 = -(q1 + pn * (B[1, 0] + B[1, 1] * d1 + B[1, 2] * d2))
    v2 = -(q2 + pn * (B[2, 0] + B[2, 1] * d1 + B[2, 2] * d2))
    return pn, d1, d2, n1 * v2 - n2 * v1, n1 * v1 + n2 * v2


@njit(**KERNEL, **BORROWS)
def solve_point(B, q0, q1, q2, m0, m1, m2, m3):
    """Impulse ``p`` of one point with ``w = q + B p`` (3 by 3), and whether it was found."""
    if q0 >= 0.0:
        return 0.0, 0.0, 0.0, True
    largest = max(m0, m1, m2, m3)
    if largest <= 0.0:
        return -q0 / B[0, 0], 0.0, 0.0, B[0, 0] > 0.0
    # stick: Cramer's rule on the 3 by 3 block
    c00 = B[1, 1] * B[2, 2] - B[1, 2] * B[2, 1]
    c01 = B[1, 2] * B[2, 0] - B[1, 0] * B[2, 2]
    c02 = B[1, 0] * B[2, 1] - B[1, 1] * B[2, 0]
    det = B[0, 0] * c00 + B[0, 1] * c01 + B[0, 2] * c02
    phi = math.atan2(-q2, -q1)
    if det > 0.0:
        p0 = -(c00 * q0 + (B[0, 2] * B[2, 1] - B[0, 1] * B[2, 2]) * q1 + (B[0, 1] * B[1, 2] - B[0, 2] * B[1, 1]) * q2)
        p1 = -(c01 * q0 + (B[0, 0] * B[2, 2] - B[0, 2] * B[2, 0]) * q1 + (B[0, 2] * B[1, 0] - B[0, 0] * B[1, 2]) * q2)
        p2 = -(c02 * q0 + (B[0, 1] * B[2, 0] - B[0, 0] * B[2, 1]) * q1 + (B[0, 0] * B[1, 1] - B[0, 1] * B[1, 0]) * q2)
        p0, p1, p2 = p0 / det, p1 / det, p2 / det
        if p0 >= 0.0 and admissible(p1, p2, p0, m0, m1, m2, m3):
            return p0, p1, p2, True
        if p0 > 0.0:
            x1, x2, _, _, _ = project(p1, p2, p0, m0, m1, m2, m3)
            if x1 != p1 or x2 != p2:
                phi = math.atan2(p2 - x2, p1 - x1)
    least = _SMALLEST_RADIUS * largest
    m0, m1, m2, m3 = max(m0, least), max(m1, least), max(m2, least), max(m3, least)
    # a root where the miss falls through zero and the motion is along -n; walk to where the sign of the miss changes
    pn, d1, d2, miss, toward = _slip(phi, B, q0, q1, q2, m0, m1, m2, m3)
    forward = 1.0 if miss > 0.0 else -1.0
    width = 2.0 * math.pi / _SECTORS
    low, miss_low, toward_low = phi, miss, toward
    for _ in range(_SECTORS):
        high = low + forward * width
        pn, d1, d2, miss_high, toward_high = _slip(high, B, q0, q1, q2, m0, m1, m2, m3)
        if miss_low * forward >= 0.0 and miss_high * forward <= 0.0 and toward_low + toward_high > 0.0:
            break
        low, miss_low, toward_low = high, miss_high, toward_high
    else:
        return 0.0, 0.0, 0.0, False
    # false position (Illinois), which stays in the bracket
    side = 0
    f_low, f_high = miss_low, miss_high
    for _ in range(100):
        if f_low == f_high or abs(high - low) <= 4.0 * _EPS * (abs(low) + abs(high)):
            break
        middle = low - f_low * (high - low) / (f_high - f_low)
        pn, d1, d2, miss, toward = _slip(middle, B, q0, q1, q2, m0, m1, m2, m3)
        if miss * forward > 0.0:
            low, f_low = middle, miss
            if side == -1:
                f_high *= 0.5
            side = -1
        elif miss * forward < 0.0:
            high, f_high = middle, miss
            if side == 1:
                f_low *= 0.5
            side = 1
        else:
            break
        if abs(miss) <= 4.0 * _EPS * abs(toward):
            break
    return pn, pn * d1, pn * d2, pn > 0.0
