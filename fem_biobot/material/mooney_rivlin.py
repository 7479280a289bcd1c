"""Mooney-Rivlin."""

from __future__ import annotations

from dataclasses import dataclass

from fem_biobot.material.invariants import Scalars
from fem_biobot.material.isochoric import Isochoric, parameter
from fem_biobot.material.law import Array


@dataclass(frozen=True)
class MooneyRivlin(Isochoric):
    """Mooney-Rivlin, ``c1 (K1 - 3) + c2 (K2 - 3) + bulk/4 (J^2 - 1 - 2 ln J)`` in the invariants K without volume.

    Parameters
    ----------
    young, poisson
        Small-strain Young's modulus [kPa] and Poisson's ratio [1], at least 0 and at most 0.5; ``mu = 2 (c1 + c2)``.
    second_share
        ``c2 / (c1 + c2)`` [1], between 0 and 1. The default of 0.1 is an assumption, of the size that Rivlin and
        Saunders (1951) found for rubber; it falls as a network swells (Treloar 1975), so that a gel has less.

    Notes
    -----
    Mooney (1940), Rivlin (1948). Describes stretch to about 2; no stiffening at the chains' limit.
    """

    young: float
    poisson: float
    second_share: float = parameter(0.1, "1", 0.0, 1.0)

    def isochoric(self, bar: dict[int, Array]) -> Scalars:
        """Energy and derivatives by the invariants without volume."""
        c2 = 0.5 * self.mu * self.second_share
        c1 = 0.5 * self.mu - c2
        return Scalars(c1 * (bar[1] - 3.0) + c2 * (bar[2] - 3.0), {1: c1, 2: c2}, {})
