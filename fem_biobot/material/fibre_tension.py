"""The law of active tension: a stress along the fibres (or along a tensor of them), in any active-stress convention."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.conventions import POWER, Convention, convention_of
from fem_biobot.material.force_length import CONSTANT, ForceLength
from fem_biobot.material.law import PAIRS, Array, inverse, volume_ratio
from fem_biobot.material.tension.kernels import tension_points


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
class FibreTension:
    """Active tension along fibres, along a structure tensor of them, or partly across them.

    Parameters
    ----------
    tension
        ``T``, a number, one an element (e,) or one a point (e, q) [kPa]; at least 0.
    a0
        Unit fibre direction in the reference body, (3,), (3, e) or (3, e, q) [1].
    convention
        Which active stress, see `Convention`; `Convention.active_strain` is another law.
    force_length
        Dependence on the fibre stretch, part of the tangent.
    transverse
        Tension in every direction across the fibre, as a share of that along it, in [0, 1].
    structure
        Structure tensor ``H`` in place of ``a0 x a0``, symmetric, trace one, (3, 3), (3, 3, e) or (3, 3, e, q) [1].

    Notes
    -----
    With ``m = sqrt(H : C)``, the fibre stretch where H is ``a0 x a0``, and the convention's power p (1, 0, 2, 2) the
    stress is ``S = T f(m) m^-p H``, for ``cauchy`` times J. The transverse part is the same without f, of the tensor
    ``(I - H) / 2`` and the tension ``2 transverse T``: at rest ``S = T (H + transverse (I - H))``.

    Energy is zero in the undeformed body but stress is not: muscle pulls. ``cauchy`` has no energy and an unsymmetric
    tangent. `MuscleTension` makes it depend on the rate of shortening.
    """

    tension: float | Array
    a0: Array
    convention: Convention | str = Convention.nominal
    force_length: ForceLength = CONSTANT
    transverse: float = 0.0
    structure: Array | None = None
    _families: tuple[tuple[float, Array, ForceLength, Array], ...] = field(init=False, repr=False, compare=False)
    _factor: float = field(init=False, repr=False, compare=False, default=1.0)

    def __post_init__(self) -> None:
        convention = convention_of(self.convention)
        if convention is Convention.active_strain:
            raise ModelError("convention: found active_strain, expected an active stress for a tension along fibres")
        check_tension(self.tension)
        check_transverse(self.transverse, self.force_length)
        a0 = np.asarray(self.a0, dtype=float)
        check_unit(a0)
        H = np.einsum("i...,k...->ik...", a0, a0) if self.structure is None else np.asarray(self.structure, dtype=float)
        if self.structure is not None:
            check_structure(H)
        eye = np.eye(3).reshape((3, 3) + (1,) * (H.ndim - 2))
        families = [(1.0, H, self.force_length)]
        if self.transverse:
            families.append((2.0 * self.transverse, 0.5 * (eye - H), CONSTANT))
        prepared = tuple((w, _packed(h), curve, curve.pieces(POWER[convention])) for w, h, curve in families)
        object.__setattr__(self, "convention", convention)
        object.__setattr__(self, "_families", prepared)

    @property
    def symmetric(self) -> bool:
        """Whether the tension has an energy."""
        return self.convention is not Convention.cauchy

    def scaled(self, factor: float) -> FibreTension:
        """The law at a multiple of its tension."""
        other = copy(self)
        object.__setattr__(other, "_factor", self._factor * factor)
        return other

    def with_tension(self, tension: float | Array) -> FibreTension:
        """The same law with another tension, at factor 1."""
        other = copy(self)
        object.__setattr__(other, "tension", tension)
        object.__setattr__(other, "_factor", 1.0)
        return other

    def at(self, elements: np.ndarray) -> FibreTension:
        """The law of these elements only, (k,); the law itself where nothing differs between elements."""
        other = copy(self)
        families = tuple((w, H[:, elements] if H.shape[1] > 1 else H, f, p) for w, H, f, p in self._families)
        object.__setattr__(other, "_families", families)
        tension = np.asarray(self.tension, dtype=float)
        object.__setattr__(other, "tension", tension[elements] if tension.ndim else self.tension)
        return other

    def along(self, E: Array) -> Array:
        """``H : E`` of packed strains with their shears doubled, (6, ...) to (...) [1]."""
        H = self._families[0][1]
        for _ in range(
            3 - E.ndim
        ):  # points in one row, or a single one: the axis of quadrature points is of length one
            H = H[..., 0]
        return np.einsum("a...,a...->...", H, E)

    def structure_gradient(self, F: Array) -> Array:
        """Derivative ``F H`` of ``H : E`` by F, (3, 3, ...) [1]."""
        return np.einsum("im...,mk...->ik...", F, _unpacked(self.packed_structure, F.ndim - 2))

    @property
    def packed_structure(self) -> Array:
        """Its structure tensor, (6, e or 1, q or 1) [1], in the order of `material.law.PAIRS`."""
        return self._families[0][1]

    def _tension(self, n: int) -> Array:
        """Tension at full drive times the factor, with `n` point axes, (...) [kPa]."""
        T = self._factor * np.asarray(self.tension, dtype=float)
        return T.reshape(T.shape + (1,) * max(n - T.ndim, 0)) if T.ndim else T

    def _parts(self, F: Array) -> list[tuple[float, Array, Array, ForceLength]]:
        """Weight, structure tensor (3, 3, ...), its stretch and its curve, for each family."""
        found = []
        for weight, packed, curve, _ in self._families:
            H = _unpacked(packed, F.ndim - 2)
            found.append((weight, H, np.sqrt(np.einsum("ik...,il...,kl...->...", F, F, H)), curve))
        return found

    def energy(self, F: Array) -> Array:
        """Energy per reference volume, (...) [kPa]; refused for ``cauchy``, which has none."""
        if not self.symmetric:
            raise ModelError("convention: found cauchy, which has no energy, expected another active stress")
        volume_ratio(F)
        power = POWER[Convention(self.convention)]
        total = sum(weight * curve.energy(m, power) for weight, _, m, curve in self._parts(F))
        return self._tension(F.ndim - 2) * total

    def stress(self, F: Array) -> Array:
        """First Piola stress ``T f(m) m^-p (J) F H``, (3, 3, ...) [kPa]."""
        volume = volume_ratio(F)
        J = 1.0 if self.symmetric else volume
        power = POWER[Convention(self.convention)]
        total = np.zeros_like(F)
        for weight, H, m, curve in self._parts(F):
            total += weight * curve(m) * m**-power * np.einsum("im...,mk...->ik...", F, H)
        return self._tension(F.ndim - 2) * J * total

    def tangent(self, F: Array) -> Array:
        """Tangent ``dP/dF``, (3, 3, 3, 3, ...) [kPa]; without major symmetry for ``cauchy``."""
        volume = volume_ratio(F)
        J = 1.0 if self.symmetric else volume
        power = POWER[Convention(self.convention)]
        eye = np.eye(3)
        total = np.zeros((3, 3, *F.shape))
        for weight, H, m, curve in self._parts(F):
            FH = np.einsum("im...,mk...->ik...", F, H)
            f, slope = curve(m), curve.slope(m)
            first = weight * f * m**-power
            second = weight * (slope - power * f / m) * m ** (-power - 1.0)
            total += first * np.einsum("ij,kl...->ikjl...", eye, H * np.ones_like(m))
            total += second * np.einsum("ik...,jl...->ikjl...", FH, FH)
            if not self.symmetric:
                total += first * np.einsum("ik...,lj...->ikjl...", FH, inverse(F))
        return self._tension(F.ndim - 2) * J * total

    def add_second_piola(self, F: Array, elements: np.ndarray, S: Array, D: Array, psi: Array) -> None:
        """Compiled form over the points of `elements`; here tension and fibres are over ALL elements."""
        n_elements = F.shape[2]
        tension = np.asarray(self.tension, dtype=float)
        tension = np.ascontiguousarray(tension.reshape(tension.shape + (1,) * (2 - tension.ndim)))
        power = POWER[Convention(self.convention)]
        for weight, H, _, pieces in self._families:
            for name, count in (("tension", tension.shape[0]), ("a0", H.shape[1])):
                if count not in (1, n_elements):
                    raise ModelError(f"{name}: found values for {count} elements, expected 1 or {n_elements}")
            factor = weight * self._factor
            tension_points(F, elements, tension, factor, H, power, not self.symmetric, pieces, S, D, psi)


def _packed(H: Array) -> Array:
    """Structure tensor (3, 3), (3, 3, e) or (3, 3, e, q) as (6, e or 1, q or 1), C-contiguous."""
    six = np.stack([H[i, j] for i, j in PAIRS])
    return np.ascontiguousarray(six.reshape(six.shape + (1,) * (3 - six.ndim)))


def _unpacked(packed: Array, n: int) -> Array:
    """Back to (3, 3, ...) with `n` point axes."""
    H = np.empty((3, 3, *packed.shape[1:]))
    for a, (i, j) in enumerate(PAIRS):
        H[i, j] = H[j, i] = packed[a]
    if n < 2:  # points in one row, or a single one: the axis of quadrature points is of length one
        H = H[..., 0]
    if n < 1:
        H = H[..., 0]
    return H


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


def check_transverse(transverse: float, force_length: ForceLength) -> None:
    """Refuse a share across the fibre outside [0, 1], or one together with a dependence on the fibre's length."""
    if not 0.0 <= transverse <= 1.0:
        raise ModelError(f"transverse: found {transverse:g}, expected a share between 0 and 1")
    if transverse and not force_length.is_constant:
        raise ModelError(
            f"transverse: found {transverse:g} together with a force-length curve, expected one of the two "
            "(how tension across fibres depends on their length is not known)"
        )


def check_structure(H: Array) -> None:
    """Refuse what is no structure tensor: not symmetric, not of trace one, or not positive."""
    if H.shape[:2] != (3, 3) or H.ndim > 4:
        raise ModelError(f"structure: found shape {H.shape}, expected (3, 3), (3, 3, e) or (3, 3, e, q)")
    off = float(np.max(np.abs(np.einsum("ii...->...", H) - 1.0)))
    skew = float(np.max(np.abs(H - H.swapaxes(0, 1))))
    if not (off < 1e-10 and skew < 1e-10):
        raise ModelError(f"structure: found trace off 1 by {off:.2g}, skew {skew:.2g}, expected symmetric, trace 1")
    lowest = float(np.min(np.linalg.eigvalsh(np.moveaxis(H, (0, 1), (-2, -1)))))
    if lowest < -1e-10:
        raise ModelError(f"structure: found a negative eigenvalue {lowest:.2g}, expected a mean of dyads")
