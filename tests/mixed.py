"""Laws that split, for tests of the mixed form, and their volumetric energy written plainly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.material import NeoHooke
from fem_biobot.material.law import Law
from fem_biobot.material.volume import LINEAR, LOG, QUADRATIC, Volumetric

Array = NDArray[np.float64]
MEASURES = {"log": LOG, "linear": LINEAR, "quadratic": QUADRATIC}


@dataclass(frozen=True)
class Split:
    """A law with the volumetric energy ``bulk/2 g(J)^2`` beside it; evaluated whole it is the law alone."""

    law: Law
    bulk: float
    measure: int = LOG

    def split(self) -> tuple[Law, Volumetric]:
        return self.law, Volumetric(self.bulk, self.measure)

    def energy(self, F: Array) -> Array:
        return self.law.energy(F)

    def stress(self, F: Array) -> Array:
        return self.law.stress(F)

    def tangent(self, F: Array) -> Array:
        return self.law.tangent(F)


def rest(mu: float) -> NeoHooke:
    """``mu/2 (I1 - 3) - mu ln J``."""
    return NeoHooke(2.0 * mu, 0.0)


def plain_measure(J: Array, measure: int) -> tuple[Array, Array, Array]:
    """``g``, ``g'``, ``g''`` by the closed forms of their definitions; not for J near 1."""
    if measure == LOG:
        return np.log(J), 1.0 / J, -(J**-2.0)
    if measure == LINEAR:
        return J - 1.0, J**0, 0.0 * J
    g = np.sign(J - 1.0) * np.sqrt(0.5 * (J**2 - 1.0) - np.log(J))
    # 2 g g' = J - 1/J, 2 g'^2 + 2 g g'' = 1 + 1/J^2
    slope = 0.5 * (J - 1.0 / J) / g
    return g, slope, (0.5 * (1.0 + J**-2.0) - slope**2) / g
