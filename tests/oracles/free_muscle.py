"""Free contraction of a block of neo-Hooke under active tension in any convention: scalar equations.

Compressible, along the fibre ``mu (s - 1/s) + lmbda ln(s t^2)/s + T p(s, t) = 0``, across it
``mu (t - 1/t) + lmbda ln(s t^2)/t = 0``, with the traction ``T p`` per reference area: ``p = 1`` nominal, ``s`` second
Piola, ``1/s`` Kirchhoff, ``t^2`` Cauchy (the current area over the reference one). Incompressible, ``t^2 = 1/s``:
``mu (s - s^-2) + T p = 0``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

TRACTION: dict[str, Callable[[float, float], float]] = {
    "nominal": lambda s, t: 1.0,
    "second_piola": lambda s, t: s,
    "kirchhoff": lambda s, t: 1.0 / s,
    "cauchy": lambda s, t: t * t,
}


def lame_over_mu(poisson: float) -> float:
    """``lmbda / mu``."""
    return 2.0 * poisson / (1.0 - 2.0 * poisson)


def across(s: float, poisson: float) -> float:
    """Stretch across the fibre that leaves the sides free, at stretch `s` along it."""
    ratio = lame_over_mu(poisson)
    return brentq(lambda t: t * t - 1.0 + ratio * np.log(s * t * t), 1e-3, 30.0, xtol=1e-15, rtol=1e-15)


def along(s: float, t: float, poisson: float) -> float:
    """Passive nominal stress along the fibre over mu."""
    return s - 1.0 / s + lame_over_mu(poisson) * np.log(s * t * t) / s


def free_stretches(
    tension_over_mu: float,
    poisson: float,
    convention: str = "nominal",
    share: Callable[[float], float] = lambda s: 1.0,
) -> tuple[float, float]:
    """Stretches along and across the fibre; `share` of the tension by the fibre stretch."""
    traction = TRACTION[convention]

    def pull(s: float) -> float:
        t = across(s, poisson)
        return along(s, t, poisson) + tension_over_mu * share(s) * traction(s, t)

    s = brentq(pull, 0.05, 1.0, xtol=1e-15, rtol=1e-15)
    return s, across(s, poisson)


def incompressible_stretch(tension_over_mu: float, convention: str = "nominal") -> float:
    """Stretch along the fibre at constant volume."""
    traction = TRACTION[convention]
    return brentq(lambda s: s - s**-2 + tension_over_mu * traction(s, s**-0.5), 0.05, 1.0, xtol=1e-15, rtol=1e-15)
