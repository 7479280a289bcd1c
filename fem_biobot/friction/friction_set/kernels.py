"""Compiled kernels of the set of admissible friction: four quarter ellipses, possibly of four different radii.

With `s` the normal impulse, friction ``x`` is admissible when ``(x1/a)^2 + (x2/b)^2 <= s^2``, where ``a`` is ``m1``
for positive ``x1`` (slip along -t1) and ``m0`` for negative ``x1`` (slip along +t1), and ``b`` likewise ``m3`` or
``m2``. The set is convex, and the nearest admissible point lies in the quadrant of the point projected, so that only
one ellipse matters at a time. Radii may be zero: the set is then a half ellipse, a segment or the origin.
"""

from __future__ import annotations

import math

from fem_biobot.compile_cache import BORROWS, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

_EPS = 2.0**-52
_MOST_ITERATIONS = 60


@njit(**KERNEL, **BORROWS)
def nearest_on_ellipse(z1, z2, a, b):
    """Multiplier ``t`` of the point ``a^2 z1 / (t + a^2), b^2 z2 / (t + b^2)`` of an ellipse nearest to one outside.

    Newton on ``1/|u(t)| - 1``, ``u = (a z1 / (t + a^2), b z2 / (t + b^2))``, which is increasing and concave in t, so
    that iterates from the left approach the root monotonically: nothing to bracket.
    """
    t = max(0.0, a * abs(z1) - a * a, b * abs(z2) - b * b)
    for _ in range(_MOST_ITERATIONS):
        k1 = 1.0 / (t + a * a)
        k2 = 1.0 / (t + b * b)
        u1 = a * z1 * k1
        u2 = b * z2 * k2
        square = u1 * u1 + u2 * u2
        over = math.sqrt(square) - 1.0
        if over <= 2.0 * _EPS:
            break
        step = over * square / (u1 * u1 * k1 + u2 * u2 * k2)
        t += step
        if step <= _EPS * t:
            break
    return t


@njit(**KERNEL, **BORROWS)
def project(z1, z2, s, m0, m1, m2, m3):
    """Nearest admissible friction to ``z`` and its derivative with respect to ``z``, at normal impulse ``s >= 0``.

    Returns ``x1, x2, A11, A12, A22``. The map is homogeneous in (z, s), so its derivative with respect to s is
    ``(x - A z) / s``. Same as `nearest_admissible` in tests/oracles.
    """
    a = s * (m1 if z1 > 0.0 else m0)
    b = s * (m3 if z2 > 0.0 else m2)
    if a <= 0.0 and b <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    if a <= 0.0:
        if abs(z2) <= b:
            return 0.0, z2, 0.0, 0.0, 1.0
        return 0.0, math.copysign(b, z2), 0.0, 0.0, 0.0
    if b <= 0.0:
        if abs(z1) <= a:
            return z1, 0.0, 1.0, 0.0, 0.0
        return math.copysign(a, z1), 0.0, 0.0, 0.0, 0.0
    u1 = z1 / a
    u2 = z2 / b
    if u1 * u1 + u2 * u2 <= 1.0:
        return z1, z2, 1.0, 0.0, 1.0
    if a == b:
        size = math.hypot(z1, z2)
        e1 = z1 / size
        e2 = z2 / size
        k = a / size
        return a * e1, a * e2, k * e2 * e2, -k * e1 * e2, k * e1 * e1
    t = nearest_on_ellipse(z1, z2, a, b)
    # x + t n = z with n = x / radius^2; on the ellipse n . dx = 0
    k1 = a * a / (t + a * a)
    k2 = b * b / (t + b * b)
    x1 = k1 * z1
    x2 = k2 * z2
    n1 = x1 / (a * a)
    n2 = x2 / (b * b)
    c1 = k1 * n1
    c2 = k2 * n2
    along = c1 * n1 + c2 * n2
    return x1, x2, k1 - c1 * c1 / along, -c1 * c2 / along, k2 - c2 * c2 / along


@njit(**KERNEL, **BORROWS)
def admissible(x1, x2, s, m0, m1, m2, m3):
    """Whether friction ``x`` is admissible at normal impulse ``s``."""
    a = s * (m1 if x1 > 0.0 else m0)
    b = s * (m3 if x2 > 0.0 else m2)
    if (a <= 0.0 and x1 != 0.0) or (b <= 0.0 and x2 != 0.0):
        return False
    u1 = x1 / a if a > 0.0 else 0.0
    u2 = x2 / b if b > 0.0 else 0.0
    return u1 * u1 + u2 * u2 <= 1.0


@njit(**KERNEL, **BORROWS)
def farthest(n1, n2, m0, m1, m2, m3):
    """Admissible friction at unit normal impulse that is farthest along ``n``: that which resists slip along -n."""
    a = m1 if n1 > 0.0 else m0
    b = m3 if n2 > 0.0 else m2
    size = math.hypot(a * n1, b * n2)
    if size <= 0.0:
        return 0.0, 0.0
    return a * a * n1 / size, b * b * n2 / size
