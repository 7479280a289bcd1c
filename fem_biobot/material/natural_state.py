"""A passive law whose stress-free state is not the reference body: tissue that has remodelled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.kernels import pull_back_points
from fem_biobot.material.law import Array, Law, add_law, at_elements, inverse, is_symmetric, volume_ratio
from fem_biobot.material.volume import SplitLaw, Volumetric

# how far the volume of a natural state may be off by rounding, as a share of it
_SAME_VOLUME = 1e-9


@dataclass(frozen=True)
class NaturalState:
    """A law measured from another stress-free state: ``psi(F) = det F0 psi_law(F F0^-1)``.

    Parameters
    ----------
    law
        The law of the tissue in its own natural state.
    F0
        Gradient of the natural state with respect to the reference body, (3, 3) or (3, 3, e) [1], positive determinant.

    Notes
    -----
    The multiplicative split of growth (Rodriguez, Hoger and McCulloch 1994). `F0` need not be compatible.
    """

    law: Law
    F0: Array

    def __post_init__(self) -> None:
        F0 = np.array(self.F0, dtype=float)
        if F0.shape[:2] != (3, 3) or F0.ndim not in (2, 3):
            raise ModelError(f"F0: found shape {F0.shape}, expected (3, 3) or (3, 3, e)")
        volume_ratio(F0)
        if not is_symmetric(self.law):
            raise ModelError(f"NaturalState: found {type(self.law).__name__}, expected a law that has an energy")
        F0.setflags(write=False)
        object.__setattr__(self, "F0", F0)

    def at(self, elements: np.ndarray) -> NaturalState:
        """The law with the natural states of these elements only, (k,)."""
        F0 = self.F0 if self.F0.ndim == 2 else self.F0[:, :, elements]
        return NaturalState(at_elements(self.law, elements), F0)

    def split(self) -> tuple[NaturalState, Volumetric]:
        """The state of the law without its volumetric energy, and that energy.

        Refuses a law that cannot be split, and a state of another volume than the reference body's: the pressure of
        the mixed element measures volume from there.
        """
        if not isinstance(self.law, SplitLaw):
            raise ModelError(f"NaturalState: found {type(self.law).__name__} inside, expected a law with split")
        change = float(np.max(np.abs(volume_ratio(self.F0) - 1.0)))
        if not change <= _SAME_VOLUME:
            raise ModelError(f"F0: found det F0 off 1 by {change:.3g}, expected 1 everywhere for the mixed element")
        rest, volumetric = self.law.split()
        return NaturalState(rest, self.F0), volumetric

    def _inverse(self, F: Array) -> tuple[Array, Array]:
        F0 = self.F0.reshape(self.F0.shape + (1,) * (F.ndim - self.F0.ndim))
        return inverse(F0), volume_ratio(F0)

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]."""
        G, volume = self._inverse(F)
        return volume * self.law.energy(np.einsum("im...,mk...->ik...", F, G))

    def stress(self, F: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        G, volume = self._inverse(F)
        P = self.law.stress(np.einsum("im...,mk...->ik...", F, G))
        return volume * np.einsum("im...,km...->ik...", P, G)

    def tangent(self, F: Array) -> Array:
        """Tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]."""
        G, volume = self._inverse(F)
        A4 = self.law.tangent(np.einsum("im...,mk...->ik...", F, G))
        return volume * np.einsum("imjn...,km...,ln...->ikjl...", A4, G, G)

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`; here `F0` is (3, 3) or (3, 3, e) over ALL elements."""
        n_elements = F.shape[2]
        F0 = self.F0 if self.F0.ndim == 3 else self.F0[:, :, None]
        G = np.broadcast_to(inverse(F0), (3, 3, n_elements))
        volume = np.broadcast_to(volume_ratio(F0), (n_elements,))
        F_e = np.einsum("imeq,mke->ikeq", F, G)
        S_e, D_e, psi_e = np.zeros_like(S), np.zeros_like(D), np.zeros_like(psi)
        add_law(self.law, F_e, elements, S_e, D_e, psi_e)
        pull_back_points(G, elements, volume, S_e, D_e, psi_e, S, D, psi)


def isochoric_contraction(stretch: Array | float, a0: Array) -> Array:
    """Volume-preserving natural state contracted to `stretch` along `a0`.

    ``F0 = s a0 x a0 + s^(-1/2) (I - a0 x a0)``; `stretch` (...) [1], `a0` (3, ...) [1]; returns (3, 3, ...) [1].
    """
    s = np.asarray(stretch, dtype=float)
    if np.any(s <= 0.0):
        raise ModelError(f"natural stretch: found {np.min(s):g}, expected above 0")
    dyad = np.einsum("i...,k...->ik...", a0, a0)
    eye = np.eye(3).reshape((3, 3) + (1,) * (a0.ndim - 1))
    return s * dyad + (eye - dyad) / np.sqrt(s)
