"""Free contraction of a block of compressible neo-Hooke under nominal tension: two scalar equations.

Along the fibre ``mu (s - 1/s) + lmbda ln(s t^2)/s + T = 0``, across it ``mu (t - 1/t) + lmbda ln(s t^2)/t = 0``.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq


def lame_over_mu(poisson: float) -> float:
    """``lmbda / mu``."""
    return 2.0 * poisson / (1.0 - 2.0 * poisson)


def across(s: float, poisson: float) -> float:
    """Stretch across the fibre that leaves the sides free, at stretch `s` along it."""
    ratio = lame_over_mu(poisson)
    return brentq(lambda t: t * t - 1.0 + ratio * np.log(s * t * t), 1e-3, 30.0, xtol=1e-15, rtol=1e-15)


def free_stretches(tension_over_mu: float, poisson: float) -> tuple[float, float]:
    """Stretches along and across the fibre."""
    ratio = lame_over_mu(poisson)

    def along(s: float) -> float:
        t = across(s, poisson)
        return s - 1.0 / s + ratio * np.log(s * t * t) / s + tension_over_mu

    s = brentq(along, 0.05, 1.0, xtol=1e-15, rtol=1e-15)
    return s, across(s, poisson)
