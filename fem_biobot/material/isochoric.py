"""What laws of the form ``W(invariants without volume) + bulk/2 g(J)^2`` share: tensors, compiled form, splitting.

A law of this family is a frozen dataclass with the fields ``young`` and ``poisson``, in a law with fibres also ``a0``,
and its own parameters (made with `parameter`, which makes them keys of a design). It says its energy's derivatives in
`isochoric`, and may add a part in the full invariants in `direct`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np

import fem_biobot.material.invariants as algebra
from fem_biobot.errors import ModelError
from fem_biobot.material.fibre_tension import check_unit
from fem_biobot.material.hyperelastic.kernels import add_invariant_points, invariants
from fem_biobot.material.invariants import Derivatives, Scalars
from fem_biobot.material.law import Array, Law, OutsideLawError, lame
from fem_biobot.material.volume import QUADRATIC, Volumetric, check_compressible

_NO_FIBRES = np.zeros((3, 0))
_NO_FIBRES.setflags(write=False)  # as those of laws that have them, so that the kernels are compiled once


@dataclass(frozen=True)
class Range:
    """Unit of a parameter and the interval it lies in."""

    unit: str
    low: float
    high: float
    low_open: bool

    def check(self, name: str, value: float) -> None:
        """Refuse a value outside, by the parameter's name."""
        inside = value > self.low if self.low_open else value >= self.low
        if not (np.isfinite(value) and inside and value <= self.high):
            low = f"above {self.low:g}" if self.low_open else f"at least {self.low:g}"
            high = f" and at most {self.high:g}" if np.isfinite(self.high) else ""
            unit = "" if self.unit == "1" else f" {self.unit}"
            raise ModelError(f"{name}: found {value:g}{unit}, expected {low}{high}{unit}")


def parameter(default: float, unit: str, low: float = 0.0, high: float = np.inf, *, low_open: bool = False) -> Any:
    """Field of a law's own parameter: its default, coherent unit and interval."""
    return field(default=default, kw_only=True, metadata={"range": Range(unit, low, high, low_open)})


class Isochoric(ABC):
    """Base of the laws ``W(J^(-1/3) F) + bulk/2 g(J)^2`` with the quadratic measure, ``bulk/4 (J^2 - 1 - 2 ln J)``.

    ``mu = E / (2 (1 + nu))`` and ``bulk = E / (3 (1 - 2 nu))`` from the two moduli; the isochoric part is stress-free
    in the undeformed body.
    """

    isotropic: ClassVar[bool] = True

    young: float
    poisson: float
    a0: Array  # of laws with fibres

    def __post_init__(self) -> None:
        lame(self.young, self.poisson)
        for f in fields(self):  # type: ignore[arg-type]  (concrete laws are dataclasses)
            if "range" in f.metadata:
                f.metadata["range"].check(f.name, getattr(self, f.name))
        if not self.isotropic:
            a0 = np.array(self.a0, dtype=float)
            if a0.ndim not in (1, 2) or a0.shape[0] != 3:
                raise ModelError(f"a0: found shape {a0.shape}, expected (3,) or (3, e)")
            check_unit(a0)
            a0 = np.ascontiguousarray(a0)
            a0.setflags(write=False)
            object.__setattr__(self, "a0", a0)

    @property
    def mu(self) -> float:
        """Shear modulus [kPa]."""
        return lame(self.young, self.poisson)[1]

    @property
    def bulk(self) -> float:
        """Bulk modulus [kPa]; inf at a Poisson's ratio of 0.5."""
        lmbda, mu = lame(self.young, self.poisson)
        return lmbda + 2.0 * mu / 3.0

    @abstractmethod
    def isochoric(self, bar: dict[int, Array]) -> Scalars:
        """Energy and derivatives by the invariants without volume, given by their number."""

    def direct(self, full: dict[int, Array]) -> Scalars | None:
        """Part in the invariants themselves; none unless a law says so."""
        return None

    def fibres(self, F: Array) -> Array | None:
        """Fibres with as many point axes as ``F``; None without fibres."""
        if self.isotropic:
            return None
        return self.a0.reshape(self.a0.shape + (1,) * (F.ndim - 1 - self.a0.ndim))

    def at(self, elements: np.ndarray) -> Isochoric:
        """The law of these elements only, (k,)."""
        if self.isotropic or self.a0.ndim == 1:
            return self
        return replace(self, a0=self.a0[:, elements])  # type: ignore[type-var]

    def split(self) -> tuple[IsochoricPart, Volumetric]:
        """The isochoric part (with what is written in the full invariants), and ``bulk/2 g(J)^2``."""
        return IsochoricPart(self), Volumetric(self.bulk, QUADRATIC)

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]."""
        check_compressible(self.bulk)
        return _derivatives(self, algebra.invariants(F, self.fibres(F)), self.bulk).energy

    def stress(self, F: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        check_compressible(self.bulk)
        return _stress(self, F, self.bulk)

    def tangent(self, F: Array) -> Array:
        """Tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]; has major symmetry."""
        check_compressible(self.bulk)
        return _tangent(self, F, self.bulk)

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`; here `a0` is (3,) or (3, e) over ALL elements."""
        check_compressible(self.bulk)
        _add(self, F, elements, self.bulk, S, D, psi)


@dataclass(frozen=True)
class IsochoricPart:
    """A law of the family without its volumetric energy."""

    law: Isochoric

    @property
    def isotropic(self) -> bool:
        """Whether the law knows no direction."""
        return self.law.isotropic

    def at(self, elements: np.ndarray) -> Law:
        """The law of these elements only, (k,)."""
        return IsochoricPart(self.law.at(elements))

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]."""
        return _derivatives(self.law, algebra.invariants(F, self.law.fibres(F)), 0.0).energy

    def stress(self, F: Array) -> Array:
        """First Piola stress, (3, 3, ...) [kPa]."""
        return _stress(self.law, F, 0.0)

    def tangent(self, F: Array) -> Array:
        """Tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]; has major symmetry."""
        return _tangent(self.law, F, 0.0)

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`."""
        _add(self.law, F, elements, 0.0, S, D, psi)


def _derivatives(law: Isochoric, values: Array, bulk: float) -> Derivatives:
    """Energy and derivatives by the invariants (n, ...) of a law with this bulk modulus."""
    J = values[-1]
    zero = np.zeros_like(J)
    volumetric = (zero, zero, zero)
    if bulk:
        half = 0.5 * bulk
        volumetric = (half * (0.5 * (J * J - 1.0) - np.log(J)), half * (J - 1.0 / J), half * (1.0 + 1.0 / (J * J)))
    full = dict(zip(algebra.order(not law.isotropic), values, strict=False))
    return algebra.assembled(values, law.isochoric(algebra.without_volume(values)), law.direct(full), volumetric)


def _stress(law: Isochoric, F: Array, bulk: float) -> Array:
    a0 = law.fibres(F)
    return algebra.first_piola(F, a0, _derivatives(law, algebra.invariants(F, a0), bulk))


def _tangent(law: Isochoric, F: Array, bulk: float) -> Array:
    a0 = law.fibres(F)
    return algebra.tangent(F, a0, _derivatives(law, algebra.invariants(F, a0), bulk))


def _add(law: Isochoric, F: Array, elements: np.ndarray, bulk: float, S: Array, D: Array, psi: Array) -> None:
    a0 = _NO_FIBRES
    if not law.isotropic:
        a0 = law.a0.reshape(3, -1)
        if a0.shape[1] not in (1, F.shape[2]):
            raise ModelError(f"a0: found fibres of {a0.shape[1]} elements, expected 1 or {F.shape[2]}")
    values = np.empty((3 if law.isotropic else 5, len(elements), F.shape[3]))
    invariants(F, elements, a0, values)
    try:
        found = _derivatives(law, values, bulk)
    except OutsideLawError as error:
        if error.point is not None:
            error.element = int(elements[error.point // F.shape[3]])
        raise
    add_invariant_points(F, elements, a0, found.energy, found.first, found.second, S, D, psi)
