"""Skeletal muscle by its shears along and across the fibre."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.invariants import Scalars
from fem_biobot.material.isochoric import Isochoric, parameter
from fem_biobot.material.law import Array, OutsideLawError

# below this distance from 1 the square of the inverse hyperbolic cosine is summed as a series
_NEAR = 1e-2
_TERMS = 8


@dataclass(frozen=True)
class Blemker(Isochoric):
    """Passive law of Blemker, Pinsky and Delp, ``g1 B1^2 + g2 B2^2 + fibre(s) + bulk/4 (J^2 - 1 - 2 ln J)``.

    ``B1^2 = K5 / K4^2 - 1`` is the shear along the fibre, ``cosh B2 = (K1 K4 - K5) / (2 sqrt K4)`` that across it, and
    ``s = sqrt K4`` the fibre's stretch, all without volume. The fibre's tension is ``fibre_peak f(s / so) / so`` with
    ``f(x) = P1 (exp(P2 (x - 1)) - 1)`` beyond the optimal stretch so, a straight line beyond ``straight_stretch``, and
    nothing before; ``ground`` adds ``3/2 ground mu (ln s)^2``.

    Parameters
    ----------
    young, poisson
        Young's modulus [kPa] and Poisson's ratio [1] at small strain, of both shears (``g1 = g2 = mu/2``, the energy of
        a shear strain being ``mu/2 B^2``), and with ``ground = 1`` of the whole body while its fibres are slack.
    a0
        Unit fibre direction in the reference body, (3,), or (3, e) over all elements [1].
    ground
        Stiffness of a slack fibre over that of the isotropic body [1]. 0 is the paper's muscle, which does not resist
        its own shortening at all: active tension then needs a force-length curve (or a skeleton) to come to rest. A
        term of this kind is in FEBio's form of the law too.
    fibre_peak
        Largest active tension of the muscle, which scales its passive one too [kPa]. The default of 300 kPa is of
        NATIVE SKELETAL muscle; engineered tissue reaches about a thirtieth of it.
    fibre_onset, fibre_exponent
        ``P1`` and ``P2`` [1], 0.05 and 6.6 for NATIVE SKELETAL muscle.
    optimal_stretch
        Fibre stretch of greatest active force, where the passive one begins [1].
    straight_stretch
        Fibre stretch beyond which the fibre's tension rises in a straight line [1], 1.4 in the paper; above the former.

    Notes
    -----
    Blemker, Pinsky and Delp, J. Biomech. 38 (2005), 657; invariants of Criscione et al. (2001). The constants are those
    that ArtiSynth's muscle materials quote from the paper (1.4, 1, 3e5 Pa, 0.05,
    6.6; read there, not in the paper). Its own moduli (g1 = g2 = 0.5 kPa) are not defaults here.
    The active tension of the paper is `ActiveStress` with the curve ``blemker_2005``.

    Limit: the energy of the shear along the fibre is not elliptic where fibres are shortened and sheared at once (by a
    quarter, say, and by 20 degrees): a body there may prefer to kink, and the solver says that the tangent is not
    positive definite.
    """

    isotropic: ClassVar[bool] = False

    young: float
    poisson: float
    a0: Array
    ground: float = parameter(1.0, "1")
    fibre_peak: float = parameter(300.0, "kPa")
    fibre_onset: float = parameter(0.05, "1")
    fibre_exponent: float = parameter(6.6, "1", low_open=True)
    optimal_stretch: float = parameter(1.0, "1", low_open=True)
    straight_stretch: float = parameter(1.4, "1", low_open=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.straight_stretch > self.optimal_stretch:
            raise ModelError(
                f"straight_stretch: found {self.straight_stretch:g}, expected above optimal_stretch "
                f"({self.optimal_stretch:g})"
            )
        if not self.fibre_exponent * (self.straight_stretch / self.optimal_stretch - 1.0) < 500.0:
            raise ModelError(f"fibre_exponent: found {self.fibre_exponent:g}, expected one whose exponential is finite")

    def isochoric(self, bar: dict[int, Array]) -> Scalars:
        """Energy and derivatives by the invariants without volume."""
        K1, K4, K5 = bar[1], bar[4], bar[5]
        g = 0.5 * self.mu
        root, cube = np.sqrt(K4), K4 * K4 * K4
        y = 0.5 * (K1 * K4 - K5) / root
        area, area1, area2 = _squared_arcosh(y)
        # derivatives of y
        y1, y4, y5 = 0.5 * root, 0.25 * (K1 * K4 + K5) / (K4 * root), -0.5 / root
        y14, y44, y45 = 0.25 / root, -0.125 * (K1 * K4 + 3.0 * K5) / (K4 * K4 * root), 0.25 / (K4 * root)
        pull, pull1, pull2 = self._fibre(root)
        first = {
            1: g * area1 * y1,
            4: g * (area1 * y4 - 2.0 * K5 / cube) + 0.5 * pull1 / root,
            5: g * (area1 * y5 + 1.0 / (K4 * K4)),
        }
        second = {
            (1, 1): g * area2 * y1 * y1,
            (1, 4): g * (area2 * y1 * y4 + area1 * y14),
            (1, 5): g * area2 * y1 * y5,
            (4, 4): g * (area2 * y4 * y4 + area1 * y44 + 6.0 * K5 / (cube * K4)) + 0.25 * (pull2 - pull1 / root) / K4,
            (4, 5): g * (area2 * y4 * y5 + area1 * y45 - 2.0 / cube),
            (5, 5): g * area2 * y5 * y5,
        }
        return Scalars(g * (K5 / K4**2 - 1.0 + area) + pull, first, second)

    def _fibre(self, s: Array) -> tuple[Array, Array, Array]:
        """Energy of the fibre's stretch, its tension and stiffness, (...) [kPa]."""
        p1, p2, x = self.fibre_onset, self.fibre_exponent, s / self.optimal_stretch
        end = self.straight_stretch / self.optimal_stretch
        curved = np.clip(x, 1.0, end) - 1.0
        beyond = np.maximum(x - end, 0.0)
        grown = p1 * np.exp(p2 * curved)
        # the straight line goes on with the tension and the slope reached
        force = grown - p1 + p2 * grown * beyond
        work = (grown - p1) / p2 - p1 * curved + beyond * (grown - p1 + 0.5 * p2 * grown * beyond)
        stiffness = np.where(x > 1.0, p2 * grown, 0.0)
        slack, ln_s = 1.5 * self.ground * self.mu, np.log(s)
        peak, so = self.fibre_peak, self.optimal_stretch
        return (
            peak * work + slack * ln_s**2,
            peak * force / so + 2.0 * slack * ln_s / s,
            peak * stiffness / so**2 + 2.0 * slack * (1.0 - ln_s) / s**2,
        )


def _squared_arcosh(y: Array) -> tuple[Array, Array, Array]:
    """``arcosh(y)^2`` and its first two derivatives, smooth through y = 1, (...) [1].

    It solves ``(y^2 - 1) a'' + y a' = 2``, which gives the series in ``y - 1`` and the second derivative.
    """
    x = y - 1.0
    near = np.abs(x) < _NEAR
    # below 1 by rounding only; further down there is no such deformation
    if np.any(~near & (x < 0.0)):
        text = f"Blemker: found a shear across the fibre of cosine {np.min(y):.4g}, expected at least 1"
        raise OutsideLawError(text, int(np.argmin(y)))
    far = np.where(near, 1.0, x)
    root = np.sqrt(far * (far + 2.0))
    angle = np.arccosh(1.0 + far)
    slope = 2.0 * angle / root
    bend = (2.0 - (1.0 + far) * slope) / (root * root)
    a, a1, a2 = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    coefficients = [2.0]
    for n in range(1, _TERMS):
        coefficients.append(-coefficients[-1] * n * n / ((n + 1.0) * (2.0 * n + 1.0)))
    for c in reversed([0.0, *coefficients]):
        a2 = a2 * x + 2.0 * a1
        a1 = a1 * x + a
        a = a * x + c
    return np.where(near, a, angle**2), np.where(near, a1, slope), np.where(near, a2, bend)
