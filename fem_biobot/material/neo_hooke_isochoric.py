"""Neo-Hooke with shape and volume told apart."""

from __future__ import annotations

from dataclasses import dataclass

from fem_biobot.material.invariants import Scalars
from fem_biobot.material.isochoric import Isochoric
from fem_biobot.material.law import Array


@dataclass(frozen=True)
class NeoHookeIsochoric(Isochoric):
    """Neo-Hooke in isochoric and volumetric parts, ``mu/2 (J^(-2/3) I1 - 3) + bulk/4 (J^2 - 1 - 2 ln J)``.

    Parameters
    ----------
    young, poisson
        Small-strain Young's modulus [kPa] and Poisson's ratio [1], at least 0 and at most 0.5.

    Notes
    -----
    Simo and Taylor (1982); Bonet and Wood (2008), section 6.5. Differs from the coupled form in compression and in
    simple shear with free volume; the two are one law at constant volume.
    """

    young: float
    poisson: float

    def isochoric(self, bar: dict[int, Array]) -> Scalars:
        """Energy and derivatives by the invariants without volume."""
        half = 0.5 * self.mu
        return Scalars(half * (bar[1] - 3.0), {1: half}, {})
