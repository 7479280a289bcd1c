"""The active tension of muscle along its fibres, and the conventions in which it can be stated."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.kernels import nominal_tension_points
from fem_biobot.material.law import Array, volume_ratio


class Convention(StrEnum):
    """What a number called active tension multiplies.

    * ``nominal``: ``psi_a = T (stretch - 1)``, ``P_a = T a x a0`` with the current unit fibre ``a``. The force through
      a strip is ``T`` times its REFERENCE area, whatever the stretch, as in Eq. 1 and 2 of Pagan-Diaz et al. (2018).
      The constant second Piola tension of the cardiac literature, ``S = T a0 x a0``, would give ``T`` times the
      reference area times the stretch: 40 % less force at a stretch of 0.6.
    """

    nominal = "nominal"


def fibre_stretch(F: Array, a0: Array) -> Array:
    """Stretch of the reference fibre direction.

    Parameters
    ----------
    F
        Deformation gradient, (3, 3, ...) [1].
    a0
        Unit fibre direction in the reference body, (3, ...) [1].

    Returns
    -------
    Array
        Length of ``F a0``, (...) [1]. One in the undeformed body; positive wherever det F is.

    Notes
    -----
    Insensitive to the sign of `a0` and to any rotation applied after `F`.
    """
    a = np.einsum("ik...,k...->i...", F, a0)
    return np.sqrt(np.einsum("i...,i...->...", a, a))


@dataclass(frozen=True)
class NominalTension:
    """Law of the nominal active tension, ``psi_a = T (stretch - 1)``.

    Parameters
    ----------
    tension
        ``T``, a number or an array over the points [kPa]; at least 0.
    a0
        Unit fibre direction in the reference body, (3, ...) [1].

    Notes
    -----
    Its energy is zero in the undeformed body but its stress is not: muscle pulls. The material tangent along the fibre
    is negative (``-T / stretch^3``); a passive law must outweigh it across the fibre, never along it, because ``P_a``
    itself does not change with the stretch. No force-length or force-velocity dependence.
    """

    tension: float | Array
    a0: Array

    def __post_init__(self) -> None:
        check_tension(self.tension)
        check_unit(np.asarray(self.a0))

    def _fibres(self, F: Array) -> Array:
        a0 = np.asarray(self.a0, dtype=float)
        return a0.reshape(a0.shape + (1,) * (F.ndim - 1 - a0.ndim))

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]."""
        volume_ratio(F)
        return self.tension * (fibre_stretch(F, self._fibres(F)) - 1.0)

    def stress(self, F: Array) -> Array:
        """First Piola stress ``T a x a0``, (3, 3, ...) [kPa]."""
        volume_ratio(F)
        a0 = self._fibres(F)
        a = np.einsum("ik...,k...->i...", F, a0) / fibre_stretch(F, a0)
        return self.tension * np.einsum("i...,k...->ik...", a, a0 * np.ones_like(a))

    def tangent(self, F: Array) -> Array:
        """Tangent ``T/stretch (I - a x a) x (a0 x a0)``, (3, 3, 3, 3, ...) [kPa]."""
        volume_ratio(F)
        a0 = self._fibres(F)
        stretch = fibre_stretch(F, a0)
        a = np.einsum("ik...,k...->i...", F, a0) / stretch
        eye = np.eye(3).reshape((3, 3) + (1,) * (F.ndim - 2))
        across = eye - np.einsum("i...,j...->ij...", a, a)
        along = np.einsum("k...,l...->kl...", a0, a0) * np.ones_like(stretch)
        return self.tension / stretch * np.einsum("ij...,kl...->ikjl...", across, along)

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`; here `a0` is (3,), (3, e) or (3, e, q) over ALL elements."""
        points = F.shape[2:]
        tension = np.broadcast_to(self.tension, points)
        nominal_tension_points(F, elements, tension, np.broadcast_to(self._fibres(F), (3, *points)), S, D, psi)


@dataclass(frozen=True)
class ActiveStress:
    """Active tension of one region, at full drive.

    Parameters
    ----------
    tension
        Tension at step factor 1 [kPa], a number or one value an element of the region, (e,); at least 0.
    a0
        Unit fibre direction in the reference body: one vector (3,), or one an element of the region, (3, e) [1].
    convention
        See `Convention`.
    """

    tension: float | Array
    a0: Array
    convention: Convention = Convention.nominal

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "convention", Convention(self.convention))
        except ValueError:
            known = ", ".join(c.value for c in Convention)
            raise ModelError(f"convention: found {self.convention!r}, expected one of {known}") from None
        a0 = np.array(self.a0, dtype=float)
        if a0.ndim not in (1, 2) or a0.shape[0] != 3:
            raise ModelError(f"a0: found shape {a0.shape}, expected (3,) or (3, e)")
        check_unit(a0)
        check_tension(self.tension)
        a0.setflags(write=False)
        object.__setattr__(self, "a0", a0)


def check_unit(a0: Array) -> None:
    """Refuse fibre directions that are not of unit length."""
    worst = float(np.max(np.abs(np.einsum("i...,i...->...", a0, a0) - 1.0))) if a0.size else 0.0
    if not worst < 1e-10:
        raise ModelError(f"a0: found a length that differs from 1 by {worst / 2:.2g}, expected unit vectors")


def check_tension(tension: float | Array) -> None:
    """Refuse a tension that pushes, or is not a number."""
    values = np.asarray(tension, dtype=float)
    if not np.all(np.isfinite(values)) or np.any(values < 0.0):
        raise ModelError(f"tension: found {np.min(values):g} kPa, expected finite and at least 0 kPa (muscle pulls)")
