"""Tension in two parts: the standing one, and the stimulated one that length, its rate and activation decide on.

What stimulation adds depends on the fibre's length and on how fast that changes (such curves are measured on it, the
resting force taken off) and need not be the same everywhere or at all times; the standing tension of compacted tissue
is there without it.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.fibre_tension import FibreTension
from fem_biobot.material.force_velocity import ForceVelocity, Straining
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
    force_velocity
        Dependence of the stimulated part on the rate of the fibre's stretch; none by default.

    Notes
    -----
    At the factor c of its tension ``T`` the standing part comes first, ``min(c T, T_standing)``, and what is left is
    stimulated: ``T = min(c T, T_standing) + f(stretch) g(rate) a(X, t) max(c T - T_standing, 0)``.

    The rate over a step of length h is that of the fibre's stretch ``m``, ``(m_end - m_begin) / h``; with it the
    tangent has ``T f g' / (h m_end) H`` more along ``H``: symmetric like the rest, though the tension has no energy.
    At rest ``g = 1``.
    """

    stimulated: FibreTension
    standing: FibreTension
    activation: Activation | None = None
    X: Array | None = None
    elements: np.ndarray | None = None
    force_velocity: ForceVelocity | None = None
    _factor: float = field(init=False, repr=False, compare=False, default=1.0)
    _time: float = field(init=False, repr=False, compare=False, default=0.0)
    _straining: Straining | None = field(init=False, repr=False, compare=False, default=None)
    _known: dict[float, Array] = field(init=False, repr=False, compare=False, default_factory=dict)

    @property
    def symmetric(self) -> bool:
        """Whether its tangent is, as that of a tension with an energy."""
        return self.stimulated.symmetric

    @property
    def is_plain(self) -> bool:
        """Whether both parts at rest are one tension in proportion to the factor."""
        return self.activation is None and self.stimulated.force_length.is_constant

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

    def straining(self, found: Straining) -> MuscleTension:
        """The law while the body is strained like that; the law itself where the rate does not matter."""
        if self.force_velocity is None:
            return self
        other = copy(self)
        object.__setattr__(other, "_straining", found)
        return other

    def at(self, elements: np.ndarray) -> MuscleTension:
        """The law of these elements only, (k,)."""
        other = self._placed(elements, None if self.X is None else self.X[:, elements])
        return other if self._straining is None else other.straining(self._straining.at(elements))

    def at_positions(self, elements: np.ndarray, X: Array) -> MuscleTension:
        """The law at other positions (3, k) [mm], each in one of these elements, (k,), at rest."""
        return self._placed(elements, X)

    def _placed(self, elements: np.ndarray, X: Array | None) -> MuscleTension:
        other = MuscleTension(
            self.stimulated.at(elements), self.standing.at(elements), self.activation, X, None, self.force_velocity
        )
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

    def _moving(self) -> tuple[Array, Array]:
        """Share of the isometric tension, and its derivative by the strain along the fibres, (...) [1]."""
        law, s = self.force_velocity, self._straining
        assert law is not None
        assert s is not None
        fibres = self.stimulated
        begin = np.sqrt(1.0 + 2.0 * fibres.along(s.strain))
        change = fibres.along(s.rate)
        end = np.sqrt(1.0 + 2.0 * fibres.along(s.strain + s.time * s.rate))
        # the difference of the stretches over the time, without their cancellation
        rate = 2.0 * change / (begin + end)
        by_strain = law.slope(rate) / (s.share * s.time * end) if s.time > 0.0 else np.zeros_like(rate)
        return law(rate), by_strain

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]; refused for ``cauchy``, and where the rate matters."""
        if self._straining is not None:
            raise ModelError("force_velocity: found a tension that depends on the rate, which has no energy")
        one, two = self.parts()
        return one.energy(F) + two.energy(F)

    def stress(self, F: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        one, two = self.parts()
        if self._straining is not None:
            two = two.with_tension(_over_points(two.tension, F.ndim - 2) * self._moving()[0])
        return one.stress(F) + two.stress(F)

    def tangent(self, F: Array) -> Array:
        """Tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]."""
        one, two = self.parts()
        if self._straining is None:
            return one.tangent(F) + two.tangent(F)
        share, by_strain = self._moving()
        isometric = _over_points(two.tension, F.ndim - 2)
        along = two.with_tension(isometric * by_strain).stress(F)
        towards = two.with_tension(1.0).structure_gradient(F)
        lagging = np.einsum("ik...,jl...->ikjl...", along, towards)
        return one.tangent(F) + two.with_tension(isometric * share).tangent(F) + lagging

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`."""
        standing, stimulated = self.parts()
        standing.add_second_piola(F, elements, S, D, psi)
        if self._straining is None:
            stimulated.add_second_piola(F, elements, S, D, psi)
            return
        share, by_strain = self.at(elements)._moving()
        isometric = np.broadcast_to(_over_points(stimulated.tension, 2), psi.shape)
        nothing = np.zeros_like(psi)  # there is no energy

        def times(factor: Array) -> FibreTension:
            tension = np.zeros(psi.shape)
            tension[elements] = isometric[elements] * factor
            return stimulated.with_tension(tension)

        times(share).add_second_piola(F, elements, S, D, nothing)
        if not len(D):
            return
        lagging = np.zeros_like(S)
        times(by_strain).add_second_piola(F, elements, lagging, D[:0], nothing)
        H = stimulated.packed_structure
        H = H[:, elements] if H.shape[1] > 1 else H
        entry = 0
        for a in range(6):
            for b in range(0 if len(D) == 36 else a, 6):
                D[entry, elements] += lagging[a, elements] * H[b]
                entry += 1


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
