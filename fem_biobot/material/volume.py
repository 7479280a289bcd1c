"""The volumetric part of a law, told apart so that a mixed element can carry it by a pressure field.

A law that allows for near incompressibility has the form ``psi(F) = psi_rest(F) + bulk/2 g(J)^2`` with a measure
``g(J)`` of the change of volume; `SplitLaw.split` returns the two parts. The mixed element replaces the second by
``p g(J) - p^2 / (2 bulk)``, which has a meaning at ``bulk = inf`` too: there it demands ``g(J) = 0``, that is J = 1.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array, Law

# measures of the change of volume; see `volume_measure`
LOG, LINEAR, QUADRATIC = 0, 1, 2

# Below this distance from J = 1 the quadratic measure is summed as a series, since its closed form is a difference of
# nearly equal numbers; beyond, what is lost stays below 1e-13 also in the second derivative.
_NEAR = 0.2
_TERMS = 26


class Volumetric(NamedTuple):
    """Volumetric energy ``bulk/2 g(J)^2`` per reference volume.

    Attributes
    ----------
    bulk
        Modulus [kPa] at ``J = 1``, where every measure has the slope 1; inf for an incompressible body. What a law
        splits off: its bulk modulus, but Lame's first constant for a coupled law (0 at a Poisson's ratio of 0).
    measure
        Which ``g(J)``: `LOG`, `LINEAR` or `QUADRATIC`; see `volume_measure`.
    """

    bulk: float  # kPa, inf allowed
    measure: int

    def energy(self, J: Array) -> Array:
        """Energy per reference volume, (...) [kPa]; refuses an infinite modulus."""
        check_compressible(self.bulk)
        return 0.5 * self.bulk * volume_measure(J, self.measure)[0] ** 2


@runtime_checkable
class SplitLaw(Law, Protocol):
    """A law that can tell its volumetric energy from the rest.

    `split` returns the law without it, which has the protocol of any law (`add_second_piola` included) and a finite
    energy at any modulus, and the volumetric part. Made with a Poisson's ratio of 0.5 such a law has an infinite
    modulus: it splits, and its own `energy`, `stress` and `tangent` are refused.
    """

    def split(self) -> tuple[Law, Volumetric]: ...


def check_compressible(bulk: float) -> None:
    """Refuse an infinite modulus where stresses are to follow from displacements alone."""
    if not math.isfinite(bulk):
        raise ModelError("poisson: found 0.5, an incompressible law, which needs the mixed element P2-P1")


def volume_measure(J: Array, measure: int) -> tuple[Array, Array, Array]:
    """Measure of the change of volume and its first two derivatives.

    Parameters
    ----------
    J
        Volume ratio, (...) [1], above 0.
    measure
        * `LOG`: ``g = ln J``; the energy ``(ln J)^2`` is not convex beyond ``J = e``.
        * `LINEAR`: ``g = J - 1``; stays finite where a point is crushed to nothing.
        * `QUADRATIC`: ``g = sign(J - 1) sqrt((J^2 - 1 - 2 ln J) / 2)``; convex, infinite at 0 and at infinity.

    Returns
    -------
    tuple
        ``g``, ``dg/dJ``, ``d2g/dJ2``, (...) [1] each. All measures have ``g(1) = 0`` and ``g'(1) = 1``.
    """
    J = np.asarray(J, dtype=np.float64)
    if measure == LOG:
        return np.log(J), 1.0 / J, -1.0 / J**2
    if measure == LINEAR:
        return J - 1.0, np.ones_like(J), np.zeros_like(J)
    if measure != QUADRATIC:
        raise ModelError(f"measure: found {measure!r}, expected LOG (0), LINEAR (1) or QUADRATIC (2)")
    # with x = J - 1: g = x r, r^2 = 1/2 + h, h = (x - ln(1 + x)) / x^2 = sum (-x)^k / (k + 2)
    x = J - 1.0
    h, h1, h2 = _series(np.where(np.abs(x) < _NEAR, x, 0.0))
    far = np.where(np.abs(x) < _NEAR, 1.0, x)
    far_h = (far - np.log1p(far)) / far**2
    far_h1 = (1.0 / (1.0 + far) - 2.0 * far_h) / far
    far_h2 = -(1.0 / (1.0 + far) ** 2 + 3.0 * far_h1) / far
    near = np.abs(x) < _NEAR
    h, h1, h2 = np.where(near, h, far_h), np.where(near, h1, far_h1), np.where(near, h2, far_h2)
    r = np.sqrt(0.5 + h)
    r1 = 0.5 * h1 / r
    r2 = 0.5 * h2 / r - 0.25 * h1**2 / r**3
    return x * r, r + x * r1, 2.0 * r1 + x * r2


def _series(x: Array) -> tuple[Array, Array, Array]:
    """Sum over k of ``(-x)^k / (k + 2)`` and its first two derivatives, by Horner's rule."""
    value, first, second = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for k in range(_TERMS, -1, -1):
        second = second * x + 2.0 * first
        first = first * x + value
        value = value * x + (-1.0) ** k / (k + 2.0)
    return value, first, second
