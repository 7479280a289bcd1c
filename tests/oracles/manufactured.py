"""A finite-strain displacement chosen at will, with the body force and traction that make it an equilibrium.

Each component is a plane wave of its own, so gradient and second gradient are exact; ``Div P`` of the compressible
neo-Hooke law with nominal tension is written by the chain rule in ``F``, its inverse and the second gradient.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.oracles.laws import lame

Array = NDArray[np.float64]

WAVES = np.array([[2.1, -1.3, 0.9], [0.8, 1.9, -1.4], [-1.1, 1.2, 2.0]])  # rows k_i [1/mm]
AMPLITUDES = np.array([0.17, -0.2, 0.16])
PHASES = np.array([0.4, 1.1, -0.7])


@dataclass(frozen=True)
class Manufactured:
    """``u_i = A_i sin(k_i . X + phi_i)``; positions are (3, k)."""

    young: float
    poisson: float
    tension: float
    a0: Array

    def _phase(self, X: Array) -> Array:
        return np.einsum("ik,k...->i...", WAVES, X) + PHASES.reshape((3,) + (1,) * (X.ndim - 1))

    def displacement(self, X: Array) -> Array:
        """(3, ...)."""
        return np.einsum("i,i...->i...", AMPLITUDES, np.sin(self._phase(X)))

    def gradient(self, X: Array) -> Array:
        """``du_i/dX_k``, (3, 3, ...)."""
        return np.einsum("i,ik,i...->ik...", AMPLITUDES, WAVES, np.cos(self._phase(X)), optimize=True)

    def second_gradient(self, X: Array) -> Array:
        """``d2u_i/dX_k dX_l``, (3, 3, 3, ...)."""
        return -np.einsum("i,ik,il,i...->ikl...", AMPLITUDES, WAVES, WAVES, np.sin(self._phase(X)), optimize=True)

    def stress(self, X: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        lmbda, mu = lame(self.young, self.poisson)
        F, G, ln_J, a, s = self._kinematics(X)
        return (
            mu * F + (lmbda * ln_J - mu) * G.swapaxes(0, 1) + self.tension / s * np.einsum("i...,k->ik...", a, self.a0)
        )

    def body_force(self, X: Array) -> Array:
        """``-Div P``, (3, ...) [mN/mm^3]."""
        lmbda, mu = lame(self.young, self.poisson)
        _, G, ln_J, a, s = self._kinematics(X)
        D2 = self.second_gradient(X)
        slope_ln_J = np.einsum("lj...,jlm...->m...", G, D2)
        found = mu * np.einsum("ikk...->i...", D2)
        found = found + lmbda * np.einsum("k...,ki...->i...", slope_ln_J, G)
        found = found - (lmbda * ln_J - mu) * np.einsum("kj...,jlk...,li...->i...", G, D2, G, optimize=True)
        along = np.einsum("ilk...,l,k->i...", D2, self.a0, self.a0, optimize=True)
        across = along - a * np.einsum("i...,i...->...", a, along) / s**2
        return -(found + self.tension / s * across)

    def _kinematics(self, X: Array) -> tuple[Array, Array, Array, Array, Array]:
        F = self.gradient(X) + np.eye(3).reshape((3, 3) + (1,) * (X.ndim - 1))
        cofactor = np.stack([np.cross(F[(i + 1) % 3], F[(i + 2) % 3], axis=0) for i in range(3)])
        J = np.einsum("k...,k...->...", F[0], cofactor[0])
        a = np.einsum("ik...,k->i...", F, self.a0)
        return F, cofactor.swapaxes(0, 1) / J, np.log(J), a, np.linalg.norm(a, axis=0)
