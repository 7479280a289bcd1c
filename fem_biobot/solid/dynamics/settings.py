"""Settings of the solid's time integrators."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fem_biobot.errors import ModelError


class Scheme(StrEnum):
    """How a step from 0 to 1 is made; h is its length, M the mass, f the forces, ``du = u1 - u0``.

    * ``backward_euler``: ``M (du/h - v0)/h = f(u1)``, ``v1 = du/h``. Order one, takes energy from fast motions (its own
      entry of the book), whatever the step; impacts are inelastic. The one for contact.
    * ``energy_momentum``: ``M (v1 - v0)/h = f``, ``v1 = 2 du/h - v0``, with the internal force of the mean gradient
      ``(F0 + F1)/2`` and the stress of the mean strain, corrected along the change of strain so that its work is the
      change of the strain energy (Gonzalez 2000). Order two; keeps momentum and angular momentum, and without viscosity
      energy, up to the tolerance. For smooth motion.
    * ``soft_landing``: as the one before without the correction, with ``theta = 1/2 + dissipation h`` in place of one
      half, ``v1 = (du/h - (1 - theta) v0) / theta``, for all nodes but those of the feet and of surfaces that slide on
      each other, which move by backward Euler, ``v1 = du/h``. What touches neither bounces nor chatters, and the body's
      own swinging is not damped as backward Euler damps it. Order two where nothing touches, one with contact, with a
      small constant.
    """

    backward_euler = "backward_euler"
    energy_momentum = "energy_momentum"
    soft_landing = "soft_landing"


@dataclass(frozen=True)
class DynamicsSettings:
    """Of the time integrators.

    Attributes
    ----------
    scheme
        See `Scheme`.
    tolerance
        Norm of the unbalanced force over the norm of the summed sizes of all forces [1].
    dissipation
        ``soft_landing`` only: c in ``theta = 1/2 + c h`` [1/s], at most 1; fast modes are damped with it.
    max_iterations
        Newton iterations in a step before it is given up (and halved).
    halvings
        How often a step that fails is halved before the motion is given up.
    """

    scheme: Scheme = Scheme.backward_euler
    tolerance: float = 1e-8
    dissipation: float = 20.0
    max_iterations: int = 30
    halvings: int = 8

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "scheme", Scheme(self.scheme))
        except ValueError:
            raise ModelError(f"settings: scheme: found {self.scheme!r}, expected {' or '.join(Scheme)}") from None
        good = isinstance(self.tolerance, int | float | np.floating) and not isinstance(self.tolerance, bool)
        if not good or not 1e-13 <= self.tolerance <= 1e-3:
            raise ModelError(f"settings: tolerance: found {self.tolerance!r}, expected a number from 1e-13 to 1e-3")
        good = isinstance(self.dissipation, int | float | np.floating) and not isinstance(self.dissipation, bool)
        if not good or not 0.0 <= self.dissipation < np.inf:
            raise ModelError(f"settings: dissipation: found {self.dissipation!r}, expected a number of at least 0 1/s")
        for key, low, high in (("max_iterations", 1, 1000), ("halvings", 0, 30)):
            value = getattr(self, key)
            if not isinstance(value, int | np.integer) or isinstance(value, bool) or not low <= value <= high:
                raise ModelError(f"settings: {key}: found {value!r}, expected a whole number from {low} to {high}")

    def theta(self, h: float) -> float:
        """Weight of the end of a step of length h [s] in what acts over it [1]."""
        if self.scheme is Scheme.backward_euler:
            return 1.0
        return 0.5 if self.scheme is Scheme.energy_momentum else min(0.5 + self.dissipation * h, 1.0)
