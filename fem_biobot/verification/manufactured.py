"""A finite-strain displacement chosen at will, with the body force and traction that make it an equilibrium.

Each component is a plane wave of its own, so gradient and second gradient are exact; ``Div P`` of the compressible
neo-Hooke law with nominal tension is written by the chain rule in ``F``, its inverse and the second gradient. Imports
nothing of the package.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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

    @property
    def _lame(self) -> tuple[float, float]:
        mu = self.young / (2.0 + 2.0 * self.poisson)
        return 2.0 * mu * self.poisson / (1.0 - 2.0 * self.poisson), mu

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
        lmbda, mu = self._lame
        F, G, ln_J, a, s = self._kinematics(X)
        return (
            mu * F + (lmbda * ln_J - mu) * G.swapaxes(0, 1) + self.tension / s * np.einsum("i...,k->ik...", a, self.a0)
        )

    def body_force(self, X: Array) -> Array:
        """``-Div P``, (3, ...) [mN/mm^3]."""
        lmbda, mu = self._lame
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
        return _kinematics(self.gradient(X), self.a0)


def _kinematics(H: Array, a0: Array) -> tuple[Array, Array, Array, Array, Array]:
    """``F``, its inverse, ``ln J``, ``F a0`` and the fibre stretch, from the displacement gradient."""
    F = H + np.eye(3).reshape((3, 3) + (1,) * (H.ndim - 2))
    cofactor = np.stack([np.cross(F[(i + 1) % 3], F[(i + 2) % 3], axis=0) for i in range(3)])
    J = np.einsum("k...,k...->...", F[0], cofactor[0])
    a = np.einsum("ik...,k->i...", F, a0)
    return F, cofactor.swapaxes(0, 1) / J, np.log(J), a, np.linalg.norm(a, axis=0)


@dataclass(frozen=True)
class ManufacturedMixed:
    """A displacement and a pressure chosen at will, of a body that hardly changes its volume, or not at all.

    Three maps one after the other: a stretch along x by ``1 + q'(x) / bulk``, a shear along x and one along y. So
    ``J = 1 + q'(x) / bulk`` exactly and the pressure ``bulk ln J`` stays finite as the bulk modulus grows; at infinite
    bulk modulus ``J = 1`` and the pressure is ``q'`` itself. Rest of the law: ``mu/2 (I1 - 3) - mu ln J``, with nominal
    tension. Functions of positions (3, ...) that may be complex.
    """

    mu: float
    bulk: float
    tension: float
    a0: Array

    def displacement(self, X: Array) -> Array:
        """(3, ...)."""
        x, y, z = X
        if np.isfinite(self.bulk):
            x = x + 3.0 * np.sin(1.3 * x + 0.2) / self.bulk
        x = x + 0.17 * np.sin(1.9 * y - 1.4 * z + 0.4)
        y = y + 0.21 * np.sin(1.6 * x + 1.7 * z - 0.7)
        return np.stack([x, y, z]) - X

    def _slope(self, X: Array) -> Array:
        """``q'``, (...)."""
        return 3.0 * 1.3 * np.cos(1.3 * X[0] + 0.2)

    def pressure(self, X: Array) -> Array:
        """(...) [kPa], positive in tension."""
        return self.bulk * np.log1p(self._slope(X) / self.bulk) if np.isfinite(self.bulk) else self._slope(X)

    def _derivative(self, function: Callable[[Array], Array], X: Array) -> Array:
        """By complex steps, exact to rounding: the new axis comes before those of the points."""
        h = 1e-30
        columns = []
        for k in range(3):
            Y = X.astype(complex)
            Y[k] += 1j * h
            columns.append(function(Y).imag / h)
        return np.stack(columns, axis=-X.ndim)

    def gradient(self, X: Array) -> Array:
        """``du_i/dX_k``, (3, 3, ...)."""
        return self._derivative(self.displacement, X)

    def stress(self, X: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        F, G, _, a, s = _kinematics(self.gradient(X), self.a0)
        return (
            self.mu * F
            + (self.pressure(X) - self.mu) * G.swapaxes(0, 1)
            + self.tension / s * np.einsum("i...,k->ik...", a, self.a0)
        )

    def _analytic_gradient(self, X: Array) -> Array:
        """``F`` as the product of the three maps' gradients, for complex positions."""
        x, y, z = X
        zero, one = 0.0 * x, 1.0 + 0.0 * x
        first = one
        if np.isfinite(self.bulk):
            first = 1.0 + self._slope(X) / self.bulk
            x = x + 3.0 * np.sin(1.3 * x + 0.2) / self.bulk
        shear = 0.17 * np.cos(1.9 * y - 1.4 * z + 0.4)
        x = x + 0.17 * np.sin(1.9 * y - 1.4 * z + 0.4)
        other = 0.21 * np.cos(1.6 * x + 1.7 * z - 0.7)
        F1 = np.stack([first, zero, zero, zero, one, zero, zero, zero, one]).reshape(3, 3, *x.shape)
        F2 = np.stack([one, 1.9 * shear, -1.4 * shear, zero, one, zero, zero, zero, one]).reshape(3, 3, *x.shape)
        F3 = np.stack([one, zero, zero, 1.6 * other, one, 1.7 * other, zero, zero, one]).reshape(3, 3, *x.shape)
        return np.einsum("ij...,jk...,kl...->il...", F3, F2, F1)

    def body_force(self, X: Array) -> Array:
        """``-Div P``, (3, ...) [mN/mm^3]; ``Div F^-T = -F^-T grad ln J`` by Piola's identity."""
        D2 = self._derivative(self._analytic_gradient, X)  # (3, 3, 3, ...)
        _, G, _, a, s = _kinematics(self.gradient(X), self.a0)
        slope_p = self._derivative(self.pressure, X)
        slope_ln_J = slope_p / self.bulk
        found = self.mu * np.einsum("ikk...->i...", D2)
        push = slope_p - (self.pressure(X) - self.mu) * slope_ln_J
        found = found + np.einsum("ki...,k...->i...", G, push)
        along = np.einsum("ilk...,l,k->i...", D2, self.a0, self.a0, optimize=True)
        across = along - a * np.einsum("i...,i...->...", a, along) / s**2
        return -(found + self.tension / s * across)
