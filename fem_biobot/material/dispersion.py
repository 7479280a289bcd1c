"""Fibres that are not all parallel: densities of their directions, structure tensors, and integration over the angle.

The structure tensor ``H``, the mean of ``n x n`` over the directions n, is the cheap form: one tension along
``sqrt(H : C)``. Angular integration sums the tension of every direction, each at its own stretch, and is the reference.
Both give ``S = T H`` in the undeformed body, and at any deformation for constant second Piola tension. Otherwise they
differ by the spread of the stretches among the fibres: at a spread of 15 degrees by 1 % of the tension in a muscle that
has shortened to 0.7.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from enum import StrEnum
from functools import lru_cache

import numpy as np
from scipy.optimize import root_scalar

from fem_biobot.errors import ModelError
from fem_biobot.material.conventions import Convention
from fem_biobot.material.fibre_tension import FibreTension, check_tension, check_unit
from fem_biobot.material.force_length import CONSTANT, ForceLength
from fem_biobot.material.law import Array

# standard deviation of angles without any preference, uniform over 180 degrees [rad]
RANDOM_SPREAD = float(np.pi / np.sqrt(12.0))
_HALF_TURN = 0.5 * np.pi
# a density further out than this many times its width is less than rounding
_REACH = 9.0
# standard deviation of a normal distribution that is flat over half a turn up to rounding [rad]
_FLAT = 1e7
# directions of the integration: angles in a plane; angles times turns in space
_ANGLES, _POLAR, _TURNS = 48, 16, 24


class Density(StrEnum):
    """How directions are spread about their mean, given the standard deviation of the angle seen in a picture.

    * ``planar``: in the plane of the muscle, a normal distribution of the angle cut at +-90 degrees.
    * ``planar_von_mises``: in the plane, ``exp(b cos 2 angle)``.
    * ``solid``: in space, symmetric about the mean, ``exp(b cos 2 angle)`` per solid angle (Gasser, Ogden and Holzapfel
      2006); its projection on a plane through the mean direction, each fibre counted by the length seen, has the
      standard deviation given.
    """

    planar = "planar"
    planar_von_mises = "planar_von_mises"
    solid = "solid"


@dataclass(frozen=True)
class Dispersion:
    """Spread of fibre directions about ``a0``.

    Parameters
    ----------
    spread
        Standard deviation of the fibre angle in a picture of the muscle's plane [rad], at least 0 and below
        `RANDOM_SPREAD` (52 degrees), that of angles without preference.
    density
        See `Density`.
    normal
        Unit normal of the muscle's plane, (3,) [1]; only for the planar densities.
    """

    spread: float
    density: Density | str = Density.planar
    normal: Array | tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "density", Density(self.density))
        except ValueError:
            known = ", ".join(d.value for d in Density)
            raise ModelError(f"density: found {self.density!r}, expected one of {known}") from None
        if not 0.0 <= self.spread < RANDOM_SPREAD:
            raise ModelError(
                f"spread: found {np.degrees(self.spread):.4g} deg, expected at least 0 and below "
                f"{np.degrees(RANDOM_SPREAD):.2f} deg, that of random directions"
            )
        normal = np.array(self.normal, dtype=float)
        if normal.shape != (3,) or not abs(normal @ normal - 1.0) < 1e-10:
            raise ModelError(f"normal: found {normal.tolist()}, expected a unit vector of three components")
        normal.setflags(write=False)
        object.__setattr__(self, "normal", normal)

    @property
    def first_moment(self) -> float:
        """Mean of ``|cos|`` of the angle to the mean direction [1]: ``chi`` of Eq. 1 for a muscle along its pull."""
        return self._mean(np.cos)

    @property
    def second_moment(self) -> float:
        """Mean of ``cos^2`` [1]: the share of the tension that acts along the mean direction in a continuum."""
        return self._mean(lambda t: np.cos(t) ** 2)

    @property
    def across(self) -> float:
        """Share of the tension in each direction across in which fibres lie [1]: all in the plane, or half in space."""
        return (1.0 - self.second_moment) / (2.0 if self.density is Density.solid else 1.0)

    def _mean(self, value: Callable[[Array], Array]) -> float:
        if self.spread == 0.0:
            return 1.0
        angles, weights = _angles(str(self.density), self.spread)
        return float(weights @ value(angles))

    def structure(self, a0: Array) -> Array:
        """Structure tensor of unit directions `a0` (3, ...), (3, 3, ...) [1]; symmetric, trace one."""
        a0 = np.asarray(a0, dtype=float)
        along, across = self.second_moment, self.across
        dyad = np.einsum("i...,k...->ik...", a0, a0)
        if self.density is Density.solid:
            return across * np.eye(3).reshape((3, 3) + (1,) * (a0.ndim - 1)) + (along - across) * dyad
        t = self._side(a0)
        return along * dyad + across * np.einsum("i...,k...->ik...", t, t)

    def _side(self, a0: Array) -> Array:
        """Direction across the fibre in the muscle's plane, (3, ...)."""
        out = float(np.max(np.abs(np.einsum("i...,i->...", a0, np.asarray(self.normal)))))
        if out > 1e-6:
            raise ModelError(
                f"dispersion: found fibres out of the muscle's plane (by a sine of {out:.2g}), expected fibres in it "
                "for a planar density; the density solid has no plane"
            )
        return np.cross(np.asarray(self.normal), a0, axisb=0, axisc=0)

    def directions(self, a0: Array) -> tuple[Array, Array]:
        """Directions (3, k, ...) and weights (k,) of the integration about `a0` (3, ...); weights sum to one."""
        a0 = np.asarray(a0, dtype=float)
        if self.spread == 0.0:
            return a0[:, None], np.ones(1)
        angles, weights = _angles(str(self.density), self.spread)
        cos, sin = np.cos(angles), np.sin(angles)
        if self.density is not Density.solid:
            t = self._side(a0)
            return np.einsum("k,i...->ik...", cos, a0) + np.einsum("k,i...->ik...", sin, t), weights
        # any side will do, the density being symmetric about the fibre
        least = np.argmin(np.abs(a0), axis=0)
        t = np.cross(a0, np.moveaxis(np.eye(3)[least], -1, 0), axisa=0, axisb=0, axisc=0)
        t /= np.sqrt(np.einsum("i...,i...->...", t, t))
        other = np.cross(a0, t, axisa=0, axisb=0, axisc=0)
        turn = 2.0 * np.pi * (np.arange(_TURNS) + 0.5) / _TURNS
        n = np.einsum("k,m,i...->ikm...", cos, np.ones(_TURNS), a0)
        n += np.einsum("k,m,i...->ikm...", sin, np.cos(turn), t) + np.einsum(
            "k,m,i...->ikm...", sin, np.sin(turn), other
        )
        return n.reshape(3, -1, *a0.shape[1:]), np.repeat(weights / _TURNS, _TURNS)


@lru_cache(maxsize=8)
def _gauss(n: int) -> tuple[Array, Array]:
    """Points and weights of Gauss' rule on (-1, 1)."""
    return np.polynomial.legendre.leggauss(n)


@lru_cache(maxsize=64)
def _angles(density: str, spread: float) -> tuple[Array, Array]:
    """Angles to the mean direction and weights, (k,): from -90 to 90 degrees in a plane, from 0 to 90 in space."""
    parameter = width_parameter(density, spread)
    x, w = _gauss(_POLAR if density == "solid" else _ANGLES)
    width = parameter if density == "planar" else 0.5 / np.sqrt(max(parameter, 1e-12))
    end = min(_HALF_TURN, _REACH * width)
    if density == "solid":
        angles, weights = 0.5 * end * (x + 1.0), w * np.sin(0.5 * end * (x + 1.0))
    else:
        angles, weights = end * x, w.copy()
    weights *= _density(density, parameter, angles)
    return angles, weights / weights.sum()


def _density(density: str, parameter: float, angle: Array) -> Array:
    """The density without its normalising constant, (...) [1]."""
    if density == "planar":
        return np.exp(-0.5 * (angle / parameter) ** 2)
    return np.exp(parameter * (np.cos(2.0 * angle) - 1.0))


@lru_cache(maxsize=64)
def width_parameter(density: str, spread: float) -> float:
    """Parameter of a density whose angles, as seen in a picture, have the standard deviation `spread` [rad].

    For ``planar`` the standard deviation of the uncut normal distribution [rad], else the concentration ``b`` [1]. By
    bisection of the standard deviation, which is monotonic in both.
    """
    # b is about 1 / (4 spread^2) for narrow densities
    low, high = (0.5 * spread, _FLAT) if density == "planar" else (1.0 / spread**2 + 1.0, 0.0)
    if picture_spread(density, high) <= spread:
        return high
    return float(
        root_scalar(lambda p: picture_spread(density, p) - spread, bracket=(low, high), xtol=1e-13, rtol=1e-13).root
    )


def picture_spread(density: str, parameter: float) -> float:
    """Standard deviation of the angle seen in a picture [rad], of a density with this `width_parameter`."""
    x, w = _gauss(96)
    width = parameter if density == "planar" else 0.5 / np.sqrt(max(parameter, 1e-12))
    end = min(_HALF_TURN, _REACH * width)
    if density != "solid":
        angles = end * x
        weights = w * _density(density, parameter, angles)
        return float(np.sqrt(weights @ angles**2 / weights.sum()))
    polar = 0.5 * end * (x + 1.0)
    turn = 2.0 * np.pi * (np.arange(96) + 0.5) / 96
    along, side = np.cos(polar)[:, None], np.sin(polar)[:, None] * np.cos(turn)
    length = np.hypot(along, side)
    weights = (w * np.sin(polar) * _density(density, parameter, polar))[:, None] * length
    return float(np.sqrt(np.sum(weights * np.arctan2(side, along) ** 2) / weights.sum()))


@dataclass(frozen=True)
class AngularTension:
    """Active tension summed over all directions of a dispersion, each at its own stretch.

    Parameters
    ----------
    tension, a0, convention, force_length
        As of `FibreTension`.
    dispersion
        Spread of the directions.

    Notes
    -----
    The reference for the structure tensor. It costs as many evaluations as there are directions (48 in a plane, 384 in
    space) and keeps each of them for every element: for small meshes.
    """

    tension: float | Array
    a0: Array
    dispersion: Dispersion
    convention: Convention | str = Convention.nominal
    force_length: ForceLength = CONSTANT
    _members: tuple[FibreTension, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_tension(self.tension)
        check_unit(np.asarray(self.a0))
        directions, weights = self.dispersion.directions(np.asarray(self.a0, dtype=float))
        object.__setattr__(
            self,
            "_members",
            tuple(
                FibreTension(self.tension, directions[:, k], self.convention, self.force_length).scaled(float(w))
                for k, w in enumerate(weights)
            ),
        )

    @property
    def symmetric(self) -> bool:
        """Whether the tension has an energy."""
        return self._members[0].symmetric

    def _with(self, members: tuple[FibreTension, ...]) -> AngularTension:
        other = copy(self)
        object.__setattr__(other, "_members", members)
        return other

    def scaled(self, factor: float) -> AngularTension:
        """The law at a multiple of its tension."""
        return self._with(tuple(m.scaled(factor) for m in self._members))

    def at(self, elements: np.ndarray) -> AngularTension:
        """The law of these elements only, (k,)."""
        return self._with(tuple(m.at(elements) for m in self._members))

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]; refused for ``cauchy``."""
        return np.sum([m.energy(F) for m in self._members], axis=0)

    def stress(self, F: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        total = np.zeros_like(F)
        for member in self._members:
            total += member.stress(F)
        return total

    def tangent(self, F: Array) -> Array:
        """Tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]."""
        total = np.zeros((3, 3, *F.shape))
        for member in self._members:
            total += member.tangent(F)
        return total

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`; here tension and fibres are over ALL elements."""
        for member in self._members:
            member.add_second_piola(F, elements, S, D, psi)
