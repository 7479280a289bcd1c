"""Active strain: the tissue's natural state contracts, in place of an added stress; a comparison to active stress."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.fibre_tension import check_tension, check_unit
from fem_biobot.material.law import Array, Law, add_law, at_elements
from fem_biobot.material.natural_state import NaturalState, isochoric_contraction
from fem_biobot.material.volume import SplitLaw

_STEPS = 60


@dataclass(frozen=True)
class ActiveStrain:
    """What active strain adds to a passive law: ``psi_p(F F_a^-1) - psi_p(F)``.

    Parameters
    ----------
    tension
        Nominal tension that the contraction stands for [kPa], a number or one an element (e,): the natural fibre
        stretch is that to which it would shorten a free, incompressible body of the same passive law.
    a0
        Unit fibre direction in the reference body, (3,) or (3, e) [1].
    passive
        Passive law of the tissue. Its volumetric part, if it can be split off, plays no role: the contraction keeps the
        volume.

    Notes
    -----
    Ambrosi and Pezzuto (2012). For neo-Hooke, ``psi_p(F F_a^-1) = mu/2 (s I1 + (s^-2 - s) I4 - 3)`` at the natural
    stretch s: a fibre tension ``mu (s^-2 - s)`` of the second Piola kind, and a matrix softened by the factor s. The
    energy may be negative, being measured from the passive one.
    """

    tension: float | Array
    a0: Array
    passive: Law
    _factor: float = field(init=False, repr=False, compare=False, default=1.0)
    _known: dict[float, NaturalState] = field(init=False, repr=False, compare=False, default_factory=dict)
    _state: NaturalState | None = field(init=False, repr=False, compare=False, default=None)
    _rest: Law = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_tension(self.tension)
        check_unit(np.asarray(self.a0))
        rest = self.passive.split()[0] if isinstance(self.passive, SplitLaw) else self.passive
        object.__setattr__(self, "_rest", rest)
        object.__setattr__(self, "_state", self._contracted())

    def scaled(self, factor: float) -> ActiveStrain:
        """The law at a multiple of its tension, with the natural stretch of that."""
        other = copy(self)
        total = self._factor * factor
        object.__setattr__(other, "_factor", total)
        # a solver asks again and again for the tension of a step
        if total not in self._known:
            self._known.clear()
            self._known[total] = other._contracted()
        object.__setattr__(other, "_state", self._known[total])
        return other

    def over(self, passive: Law) -> ActiveStrain:
        """The same contraction of another passive law."""
        return ActiveStrain(self.tension, self.a0, passive).scaled(self._factor)

    def at(self, elements: np.ndarray) -> ActiveStrain:
        """The law of these elements only, (k,)."""
        other = copy(self)
        assert self._state is not None
        object.__setattr__(other, "_rest", at_elements(self._rest, elements))
        object.__setattr__(other, "_state", NaturalState(other._rest, self._state.at(elements).F0))
        return other

    @property
    def natural_stretch(self) -> Array:
        """Fibre stretch of the contracted natural state, () or (e,) [1]."""
        assert self._state is not None
        a0 = np.asarray(self.a0, dtype=float)
        F0 = self._state.F0
        return np.einsum("i...,ik...,k...->...", a0.reshape(a0.shape + (1,) * (F0.ndim - 1 - a0.ndim)), F0, a0)

    def _contracted(self) -> NaturalState:
        """Natural state at which the tension is balanced, by a safeguarded Newton iteration for all fibres at once."""
        a0 = np.asarray(self.a0, dtype=float)
        T = self._factor * np.asarray(self.tension, dtype=float)
        n = np.broadcast_shapes(a0.shape[1:], T.shape)
        a0 = np.broadcast_to(a0.reshape(a0.shape + (1,) * (len(n) - a0.ndim + 1)), (3, *n))
        if getattr(self._rest, "isotropic", False) and len(n):
            # the direction does not matter: one number for each tension
            values, place = np.unique(np.broadcast_to(T, n), return_inverse=True)
            along = np.repeat(np.eye(3)[:, :1], len(values), axis=1)
            s = self._balanced(values, along)[place]
        else:
            s = self._balanced(T, a0)
        if np.any(s < 2e-3):
            raise ModelError(f"tension: found {np.max(T):g} kPa, expected one that active strain of this law can carry")
        return NaturalState(self._rest, isochoric_contraction(s, a0))

    def _balanced(self, T: Array, a0: Array) -> Array:
        """Natural stretches (...) at which tensions (...) along `a0` (3, ...) are balanced."""
        n = a0.shape[1:]
        s, low, high = np.ones(n), np.full(n, 1e-3), np.ones(n)
        for _ in range(_STEPS):
            P, stiffness = self._pull(s, a0)
            r = P + T
            low, high = np.where(r < 0.0, s, low), np.where(r > 0.0, s, high)
            newton = s - r / np.where(stiffness > 0.0, stiffness, np.inf)
            inside = (newton > low) & (newton < high) & (stiffness > 0.0)
            following = np.where(r == 0.0, s, np.where(inside, newton, 0.5 * (low + high)))
            step, s = float(np.max(np.abs(following - s))), following
            if step < 1e-15:
                break
        return s

    def _pull(self, s: Array, a0: Array) -> tuple[Array, Array]:
        """Nominal stress along the fibre of the free, incompressible, uniaxial body and its slope, (...) [kPa]."""
        F = isochoric_contraction(s, a0)
        dyad = np.einsum("i...,k...->ik...", a0, a0)
        across = np.eye(3).reshape((3, 3) + (1,) * s.ndim) - dyad
        first = dyad - 0.5 * s**-1.5 * across
        P, A4 = self._rest.stress(F), self._rest.tangent(F)
        slope = np.einsum("ik...,ikjl...,jl...->...", first, A4, first)
        slope = slope + 0.75 * s**-2.5 * np.einsum("ik...,ik...->...", P, across)
        return np.einsum("ik...,ik...->...", P, first), slope

    def energy(self, F: Array) -> Array:
        """Energy that the contraction adds per reference volume, (...) [kPa]."""
        assert self._state is not None
        return self._state.energy(F) - self._rest.energy(F)

    def stress(self, F: Array) -> Array:
        """First Piola stress that it adds, (3, 3, ...) [kPa]."""
        assert self._state is not None
        return self._state.stress(F) - self._rest.stress(F)

    def tangent(self, F: Array) -> Array:
        """Its tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]."""
        assert self._state is not None
        return self._state.tangent(F) - self._rest.tangent(F)

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`; here fibres and tension are over ALL elements."""
        assert self._state is not None
        add_law(self._state, F, elements, S, D, psi)
        passive = [np.zeros_like(out) for out in (S, D, psi)]
        add_law(self._rest, F, elements, *passive)
        for out, added in zip((S, D, psi), passive, strict=True):
            out[..., elements, :] -= added[..., elements, :]
