"""Tension in two parts: the standing one, and the stimulated one that length and activation decide on.

What stimulation adds depends on the fibre's length (force-length curves are measured on it, the resting force taken
off) and need not be the same everywhere or at all times; the standing tension of compacted tissue is there without it.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.fibre_tension import FibreTension
from fem_biobot.material.law import Array

# share of the stimulated tension at reference positions (3, k) [mm] and an instant [s], (k,) [1]
Activation = Callable[[Array, float], Array]


@dataclass(frozen=True)
class MuscleTension:
    """Standing and stimulated tension of one region.

    Parameters
    ----------
    stimulated
        The law of the stimulated part, with its curve; its tension is that of both parts at full drive.
    standing
        The law of the standing part, without a curve; its tension is the standing one [kPa].
    activation
        Share of the stimulated part over space and time; 1 everywhere by default.
    X
        Reference positions of the points, (3, e, q) or (3, k) [mm]; for an activation.
    elements
        Elements of the muscle, where alone the activation is asked for, where `X` is of ALL elements; else None.

    Notes
    -----
    At the factor c of its tension ``T`` the standing part comes first, ``min(c T, T_standing)``, and what is left is
    stimulated: ``T = min(c T, T_standing) + f(stretch) a(X, t) max(c T - T_standing, 0)``.
    """

    stimulated: FibreTension
    standing: FibreTension
    activation: Activation | None = None
    X: Array | None = None
    elements: np.ndarray | None = None
    _factor: float = field(init=False, repr=False, compare=False, default=1.0)
    _time: float = field(init=False, repr=False, compare=False, default=0.0)
    _known: dict[float, Array] = field(init=False, repr=False, compare=False, default_factory=dict)

    @property
    def symmetric(self) -> bool:
        """Whether the tension has an energy."""
        return self.stimulated.symmetric

    def scaled(self, factor: float) -> MuscleTension:
        """The law at a multiple of its tension."""
        other = copy(self)
        object.__setattr__(other, "_factor", self._factor * factor)
        return other

    def at_time(self, time: float) -> MuscleTension:
        """The law at an instant [s]."""
        other = copy(self)
        object.__setattr__(other, "_time", time)
        return other

    def at(self, elements: np.ndarray) -> MuscleTension:
        """The law of these elements only, (k,)."""
        return self._placed(elements, None if self.X is None else self.X[:, elements])

    def at_positions(self, elements: np.ndarray, X: Array) -> MuscleTension:
        """The law at other positions (3, k) [mm], each in one of these elements, (k,)."""
        return self._placed(elements, X)

    def _placed(self, elements: np.ndarray, X: Array | None) -> MuscleTension:
        other = MuscleTension(self.stimulated.at(elements), self.standing.at(elements), self.activation, X)
        object.__setattr__(other, "_factor", self._factor)
        object.__setattr__(other, "_time", self._time)
        return other

    def shares(self) -> Array | float:
        """Activation at the points, (e, q) or (k,) [1]; evaluated once for each instant."""
        if self.activation is None:
            return 1.0
        if self._time not in self._known:
            if len(self._known) > 3:  # a solver asks again and again for the instant of a step
                self._known.clear()
            self._known[self._time] = self._asked(self.activation)
        return self._known[self._time]

    def _asked(self, activation: Activation) -> Array:
        if self.X is None:
            raise ModelError("activation: found no positions, expected those of the points at which it is asked for")
        if self.elements is None:
            return activation_at(activation, self.X, self._time)
        found = np.zeros(self.X.shape[1:])
        found[self.elements] = activation_at(activation, self.X[:, self.elements], self._time)
        return found

    def tensions(self) -> tuple[Array, Array]:
        """Standing and stimulated tension, the curve left out, (...) [kPa]."""
        n = 0 if self.X is None else self.X.ndim - 1
        whole, standing = (_over_points(law.tension, n) for law in (self.stimulated, self.standing))
        whole = self._factor * whole
        kept = np.minimum(whole, standing)
        return kept, (whole - kept) * self.shares()

    def parts(self) -> tuple[FibreTension, FibreTension]:
        """The laws of the standing and of the stimulated part as they act now."""
        kept, added = self.tensions()
        return self.standing.with_tension(kept), self.stimulated.with_tension(added)

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]; refused for ``cauchy``."""
        one, two = self.parts()
        return one.energy(F) + two.energy(F)

    def stress(self, F: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        one, two = self.parts()
        return one.stress(F) + two.stress(F)

    def tangent(self, F: Array) -> Array:
        """Tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]."""
        one, two = self.parts()
        return one.tangent(F) + two.tangent(F)

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`."""
        for part in self.parts():
            part.add_second_piola(F, elements, S, D, psi)


def activation_at(activation: Activation, X: Array, time: float) -> Array:
    """Values of an activation at positions (3, ...) and an instant, (...) [1]; refuses what is no share."""
    found = np.asarray(activation(X.reshape(3, -1), time))
    if found.dtype.kind not in "iufb" or found.shape != (X[0].size,):
        raise ModelError(f"activation: found shape {found.shape} of {found.dtype}, expected ({X[0].size},) numbers")
    found = found.astype(float)
    if not np.all(np.isfinite(found)) or np.any(found < 0.0):
        worst = int(np.argmin(np.where(np.isfinite(found), found, -np.inf)))
        x, y, z = X.reshape(3, -1)[:, worst]
        raise ModelError(
            f"activation: found {found[worst]:g} at ({x:.4g}, {y:.4g}, {z:.4g}) mm, {time:.4g} s, "
            "expected finite and at least 0"
        )
    return found.reshape(X.shape[1:])


def _over_points(tension: float | Array, n: int) -> Array:
    """Tension with `n` point axes."""
    T = np.asarray(tension, dtype=float)
    return T.reshape(T.shape + (1,) * max(n - T.ndim, 0)) if T.ndim else T
