"""The transversely isotropic exponential of heart muscle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem_biobot.material.invariants import Scalars
from fem_biobot.material.isochoric import Isochoric, parameter
from fem_biobot.material.law import Array, OutsideLawError

# beyond this exponent the stress is above 10^200 times the modulus
_LARGEST = 460.0


@dataclass(frozen=True)
class Guccione(Isochoric):
    """Guccione-Costa exponential, ``c/2 (exp Q - 1) + bulk/4 (J^2 - 1 - 2 ln J)``.

    ``Q = bf e_ff^2 + bt (e_ss^2 + e_nn^2 + 2 e_sn^2) + 2 bfs (e_fs^2 + e_fn^2)`` of the Green-Lagrange strain e without
    volume, in axes of which f is the fibre.

    Parameters
    ----------
    young, poisson
        Young's modulus [kPa] and Poisson's ratio [1] of the isotropic body that resists shear across the fibres as this
        one does at small strain: ``mu = c bt / 2`` is the shear modulus between two directions across. Along the fibre
        the modulus is larger by what follows from the exponents; the body is isotropic where all three are equal.
    a0
        Unit fibre direction in the reference body, (3,), or (3, e) over all elements [1].
    exponent_fibre, exponent_across, exponent_shear
        ``bf``, ``bt``, ``bfs`` [1]. The defaults 8, 2, 4 are of NATIVE HEART muscle (the first problem of Land et al.
        2015, there with c = 2 kPa, which is case S12 of the verification).

    Notes
    -----
    Guccione, McCulloch and Waldman (1991); Costa, Holmes and McCulloch (2001), whose orthotropic form this is for
    ``b_ss = b_nn = b_ns``. Written in ``J^(-1/3) F``, as usual for nearly incompressible tissue. The constants were
    not checked against the benchmark's own page. The exponent is
    refused beyond 460 with `OutsideLawError`.
    """

    isotropic: ClassVar[bool] = False

    young: float
    poisson: float
    a0: Array
    exponent_fibre: float = parameter(8.0, "1", low_open=True)
    exponent_across: float = parameter(2.0, "1", low_open=True)
    exponent_shear: float = parameter(4.0, "1", low_open=True)

    def isochoric(self, bar: dict[int, Array]) -> Scalars:
        """Energy and derivatives by the invariants without volume.

        With ``u = e_ff = (K4 - 1)/2``, ``v = |e a0|^2 = (K5 - 2 K4 + 1)/4`` and
        ``w = e : e = (K1^2 - 2 K2 - 2 K1 + 3)/4`` the exponent is ``Q = alpha u^2 + beta v + bt w``.
        """
        bf, bt, bfs = self.exponent_fibre, self.exponent_across, self.exponent_shear
        alpha, beta = bf - 2.0 * bfs + bt, 2.0 * (bfs - bt)
        u = 0.5 * (bar[4] - 1.0)
        v = 0.25 * (bar[5] - 2.0 * bar[4] + 1.0)
        w = 0.25 * (bar[1] * (bar[1] - 2.0) - 2.0 * bar[2] + 3.0)
        Q = alpha * u * u + beta * v + bt * w
        largest = float(np.max(Q)) if Q.size else 0.0
        if not largest < _LARGEST:
            text = f"Guccione: found an exponent of {largest:.4g}, expected below {_LARGEST:g}"
            raise OutsideLawError(text, int(np.argmax(Q)))
        slopes = {1: 0.5 * bt * (bar[1] - 1.0), 2: -0.5 * bt, 4: alpha * u - 0.5 * beta, 5: 0.25 * beta}
        bends = {(1, 1): 0.5 * bt, (4, 4): 0.5 * alpha}
        c = self.mu / bt  # half of the paper's 2 mu / bt
        grown = c * np.exp(Q)
        numbers = (1, 2, 4, 5)
        second = {
            (a, b): grown * (slopes[a] * slopes[b] + bends.get((a, b), 0.0)) for a in numbers for b in numbers if a <= b
        }
        return Scalars(c * np.expm1(Q), {a: grown * slopes[a] for a in numbers}, second)
