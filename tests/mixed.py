"""Laws that split, for tests of the mixed form, and their volumetric energy written plainly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.material import NeoHooke
from fem_biobot.material.law import Law, inverse, volume_ratio
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


@dataclass(frozen=True)
class IsochoricNeoHooke:
    """``mu/2 (J^(-2/3) I1 - 3) + bulk/4 (J^2 - 1 - 2 ln J)``, as a user would write it: no compiled form."""

    mu: float
    bulk: float

    def split(self) -> tuple[Law, Volumetric]:
        return IsochoricNeoHooke(self.mu, 0.0), Volumetric(self.bulk, QUADRATIC)

    def energy(self, F: Array) -> Array:
        J = volume_ratio(F)
        I1 = np.einsum("ik...,ik...->...", F, F)
        return 0.5 * self.mu * (J ** (-2.0 / 3.0) * I1 - 3.0) + 0.25 * self.bulk * (J**2 - 1.0 - 2.0 * np.log(J))

    def stress(self, F: Array) -> Array:
        J = volume_ratio(F)
        I1, G = np.einsum("ik...,ik...->...", F, F), inverse(F).swapaxes(0, 1)
        return self.mu * J ** (-2.0 / 3.0) * (F - I1 / 3.0 * G) + 0.5 * self.bulk * (J**2 - 1.0) * G

    def tangent(self, F: Array) -> Array:
        J = volume_ratio(F)
        I1, g = np.einsum("ik...,ik...->...", F, F), inverse(F)
        G, m = g.swapaxes(0, 1), self.mu * J ** (-2.0 / 3.0)
        eye = np.einsum("ij,kl->ikjl", np.eye(3), np.eye(3)).reshape((3, 3, 3, 3) + (1,) * (F.ndim - 2))
        GG, FG = np.einsum("ik...,jl...->ikjl...", G, G), np.einsum("ik...,jl...->ikjl...", F, G)
        GF, turned = np.einsum("ik...,jl...->ikjl...", G, F), np.einsum("kj...,li...->ikjl...", g, g)
        isochoric = eye - 2.0 / 3.0 * (FG + GF) + I1 * (2.0 / 9.0 * GG + turned / 3.0)
        return m * isochoric + self.bulk * J**2 * GG - 0.5 * self.bulk * (J**2 - 1.0) * turned
