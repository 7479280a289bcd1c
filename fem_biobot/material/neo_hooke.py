"""Compressible neo-Hooke in its coupled form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fem_biobot.material.kernels import neo_hooke_points
from fem_biobot.material.law import Array, inverse, lame, volume_ratio
from fem_biobot.material.volume import LOG, Volumetric, check_compressible


@dataclass(frozen=True)
class NeoHooke:
    """Compressible neo-Hooke, ``psi = mu/2 (I1 - 3) - mu ln J + lmbda/2 (ln J)^2``.

    Parameters
    ----------
    young, poisson
        Small-strain Young's modulus [kPa] and Poisson's ratio [1], at least 0 and at most 0.5; at 0.5 exactly the law
        can only be split (the mixed element P2-P1).

    Notes
    -----
    Bonet and Wood, Nonlinear Continuum Mechanics for Finite Element Analysis (2008), section 6.4.3. Its volumetric term
    is not convex beyond ``J = e``; gels and tissue stay far below. No stiffening of the network at large stretch.
    """

    young: float
    poisson: float
    isotropic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        lame(self.young, self.poisson)

    @property
    def mu(self) -> float:
        """Shear modulus [kPa]."""
        return lame(self.young, self.poisson)[1]

    @property
    def lmbda(self) -> float:
        """Lame's first constant [kPa]."""
        return lame(self.young, self.poisson)[0]

    def split(self) -> tuple[NeoHooke, Volumetric]:
        """The law without its volumetric energy, ``mu/2 (I1 - 3) - mu ln J``, and ``lmbda/2 (ln J)^2``."""
        # a coupled neo-Hooke without Poisson's effect has no second term, and E = 2 mu
        return NeoHooke(2.0 * self.mu, 0.0), Volumetric(self.lmbda, LOG)

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]."""
        check_compressible(self.lmbda)
        ln_J = np.log(volume_ratio(F))
        I1 = np.einsum("ik...,ik...->...", F, F)
        return 0.5 * self.mu * (I1 - 3.0) - self.mu * ln_J + 0.5 * self.lmbda * ln_J**2

    def stress(self, F: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        check_compressible(self.lmbda)
        ln_J = np.log(volume_ratio(F))
        return self.mu * F + (self.lmbda * ln_J - self.mu) * inverse(F).swapaxes(0, 1)

    def tangent(self, F: Array) -> Array:
        """Tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]; has major symmetry."""
        check_compressible(self.lmbda)
        ln_J = np.log(volume_ratio(F))
        g = inverse(F)  # d ln J / dF[i, k] = g[k, i]
        eye = np.eye(3)
        identity = np.einsum("ij,kl->ikjl", eye, eye).reshape((3, 3, 3, 3) + (1,) * (F.ndim - 2))
        return (
            self.mu * identity
            + self.lmbda * np.einsum("ki...,lj...->ikjl...", g, g)
            + (self.mu - self.lmbda * ln_J) * np.einsum("kj...,li...->ikjl...", g, g)
        )

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form: adds ``S``, ``dS/dE`` and energy at all points of `elements` (see `material.kernels`)."""
        check_compressible(self.lmbda)
        neo_hooke_points(F, elements, self.mu, self.lmbda, S, D, psi)
