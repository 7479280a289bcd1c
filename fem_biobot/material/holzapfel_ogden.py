"""Fibres that stiffen exponentially in an isotropic matrix."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem_biobot.material.invariants import Scalars
from fem_biobot.material.isochoric import Isochoric, parameter
from fem_biobot.material.law import Array, OutsideLawError

_LARGEST = 460.0


@dataclass(frozen=True)
class HolzapfelOgden(Isochoric):
    """Fibre reinforcement ``k1 / (2 k2) (exp(k2 e^2) - 1)``, in tension only, of an isochoric neo-Hooke matrix.

    ``e = d (I1 - 3) + (1 - 3 d)(I4 - 1)`` of the whole strain, its change of volume included; the matrix is
    ``mu/2 (J^(-2/3) I1 - 3) + bulk/4 (J^2 - 1 - 2 ln J)``. Where ``e <= 0`` the fibres are slack.

    Parameters
    ----------
    young, poisson
        Moduli of the matrix alone: Young's modulus [kPa], Poisson's ratio [1]. They are those of the body in
        compression; in tension along the fibre ``4 k1 (1 - 2 d)^2`` and more is added, for volume along with length.
    a0
        Unit fibre direction in the reference body, (3,), or (3, e) over all elements [1].
    fibre_modulus
        ``k1`` [kPa]. The default of 18.472 kPa is ``a_f`` of NATIVE HEART muscle (Holzapfel and Ogden 2009, from shear
        tests of pig myocardium).
    fibre_exponent
        ``k2`` [1]; 16.026 is ``b_f`` of the same.
    fibre_dispersion
        ``d`` [1], 0 for parallel fibres to 1/3 for random ones; the ``kappa`` of Gasser, Ogden and Holzapfel (2006).

    Notes
    -----
    The fibre terms of Holzapfel and Ogden (2009), whose matrix is exponential and has sheets. Form and constants are
    those that fenicsx-pulse has too, which names the second row of the paper's Table 1 for them. The invariants of the
    whole strain are taken, since those without volume let fibres swell unstretched (Nolan et al. 2014). The stress is
    continuous where fibres become slack, its tangent is not. The exponent is refused beyond 460 with `OutsideLawError`.
    """

    isotropic: ClassVar[bool] = False

    young: float
    poisson: float
    a0: Array
    fibre_modulus: float = parameter(18.472, "kPa")
    fibre_exponent: float = parameter(16.026, "1", low_open=True)
    fibre_dispersion: float = parameter(0.0, "1", 0.0, 1.0 / 3.0)

    def isochoric(self, bar: dict[int, Array]) -> Scalars:
        """Energy and derivatives of the matrix by the invariants without volume."""
        half = 0.5 * self.mu
        return Scalars(half * (bar[1] - 3.0), {1: half}, {})

    def direct(self, full: dict[int, Array]) -> Scalars:
        """Energy and derivatives of the fibres by the invariants themselves."""
        k1, k2, d = self.fibre_modulus, self.fibre_exponent, self.fibre_dispersion
        e = np.maximum(d * (full[1] - 3.0) + (1.0 - 3.0 * d) * (full[4] - 1.0), 0.0)
        largest = float(k2 * np.max(e) ** 2) if e.size else 0.0
        if not largest < _LARGEST:
            text = f"Holzapfel-Ogden: found an exponent of {largest:.4g}, expected below {_LARGEST:g}"
            raise OutsideLawError(text, int(np.argmax(e)))
        grown = np.exp(k2 * e * e)
        slope = k1 * e * grown
        bend = np.where(e > 0.0, k1 * grown * (1.0 + 2.0 * k2 * e * e), 0.0)
        shares = {1: d, 4: 1.0 - 3.0 * d}
        second = {(a, b): bend * (shares[a] * shares[b]) for a, b in ((1, 1), (1, 4), (4, 4))}
        return Scalars(0.5 * k1 / k2 * np.expm1(k2 * e * e), {a: slope * share for a, share in shares.items()}, second)
