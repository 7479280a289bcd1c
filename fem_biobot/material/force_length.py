"""How active tension depends on the length of the fibre: named curves, each with its source.

A curve is made of parabolas, so that the energy of the tension has a closed form in every convention.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array


@dataclass(frozen=True, eq=False)
class ForceLength:
    """Share ``f`` of the tension at a fibre stretch, continuous and piecewise quadratic.

    Attributes
    ----------
    starts
        Stretch where each piece begins, rising, the first 0, (k,) [1]; the last piece has no end.
    coefficients
        ``f = c0 + c1 s + c2 s^2`` of the stretch s on each piece, (k, 3) [1].
    source
        Where the curve is from.

    Notes
    -----
    Given as a static curve of isometric tension. Engineered tissue has been measured at few lengths; the named curves
    are of native vertebrate muscle. Where a curve falls with length its tangent along the fibre is negative, so that a
    free fibre is stable there only if the passive law outweighs it.
    """

    starts: Array
    coefficients: Array
    source: str = ""

    def __post_init__(self) -> None:
        starts = np.array(self.starts, dtype=float)
        coefficients = np.array(self.coefficients, dtype=float)
        if starts.ndim != 1 or not starts.size or starts[0] != 0.0 or np.any(np.diff(starts) <= 0.0):
            raise ModelError(f"force_length.starts: found {starts.tolist()}, expected stretches rising from 0")
        if coefficients.shape != (len(starts), 3) or not np.all(np.isfinite(coefficients)):
            raise ModelError(
                f"force_length.coefficients: found shape {coefficients.shape}, expected {len(starts)} by 3"
            )
        for s, (left, right) in zip(starts[1:], pairwise(coefficients), strict=True):
            jump = abs(float((right - left) @ np.array([1.0, s, s * s])))
            if jump > 1e-9:
                raise ModelError(f"force_length: found a jump of {jump:.3g} at a stretch of {s:g}, expected none")
        for name, value in (("starts", starts), ("coefficients", coefficients)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def is_constant(self) -> bool:
        """Whether the tension does not depend on the length at all."""
        return bool(np.all(self.coefficients == np.array([1.0, 0.0, 0.0])))

    def __call__(self, stretch: Array | float) -> Array:
        """The share of the tension at a stretch, (...) [1]."""
        return self._at(stretch)[0]

    def slope(self, stretch: Array | float) -> Array:
        """Its derivative, (...) [1]; that of the longer side at a corner."""
        return self._at(stretch)[1]

    def _at(self, stretch: Array | float) -> tuple[Array, Array]:
        s = np.asarray(stretch, dtype=float)
        c0, c1, c2 = np.moveaxis(self.coefficients[np.searchsorted(self.starts, s, side="right") - 1], -1, 0)
        return c0 + s * (c1 + s * c2), c1 + 2.0 * s * c2

    def scaled(self, optimal_stretch: float) -> ForceLength:
        """The curve with the length of greatest force at another stretch: ``f(s / optimal_stretch)``."""
        if not (np.isfinite(optimal_stretch) and optimal_stretch > 0.0):
            raise ModelError(f"optimal stretch: found {optimal_stretch:g}, expected above 0")
        powers = optimal_stretch ** -np.arange(3.0)
        return ForceLength(self.starts * optimal_stretch, self.coefficients * powers, self.source)

    def pieces(self, power: int) -> Array:
        """Rows (start, c0, c1, c2, constant) for the kernel, (k, 5).

        ``constant`` plus the antiderivative of ``f(s) s^(1 - power)`` on the piece is the energy of unit tension, zero
        at a stretch of 1 and continuous.
        """
        rows = np.column_stack([self.starts, self.coefficients, np.zeros(len(self.starts))])
        home = int(np.searchsorted(self.starts, 1.0, side="right") - 1)
        rows[home, 4] = -_antiderivative(rows[home, 1:4], 1.0, power)
        for k in range(home + 1, len(rows)):
            at = rows[k, 0]
            before = rows[k - 1, 4] + _antiderivative(rows[k - 1, 1:4], at, power)
            rows[k, 4] = before - _antiderivative(rows[k, 1:4], at, power)
        for k in range(home - 1, -1, -1):
            at = rows[k + 1, 0]
            after = rows[k + 1, 4] + _antiderivative(rows[k + 1, 1:4], at, power)
            rows[k, 4] = after - _antiderivative(rows[k, 1:4], at, power)
        return rows

    def energy(self, stretch: Array, power: int) -> Array:
        """Energy of unit tension ``int_1^s f(x) x^(1 - power) dx``, (...) [1]."""
        rows = self.pieces(power)
        chosen = rows[np.searchsorted(self.starts, stretch, side="right") - 1]
        return chosen[..., 4] + _antiderivative(np.moveaxis(chosen[..., 1:4], -1, 0), stretch, power)


def _antiderivative(c: Array, s: Array | float, power: int) -> Array:
    """Antiderivative of ``(c0 + c1 s + c2 s^2) s^(1 - power)`` without constant."""
    total = np.zeros_like(np.asarray(s, dtype=float))
    for k in range(3):
        exponent = k + 2 - power
        total = total + c[k] * (np.log(s) if exponent == 0 else np.asarray(s) ** exponent / exponent)
    return total


def _blemker_2005() -> ForceLength:
    """Parabolas 9 (s - 0.4)^2, 1 - 4 (1 - s)^2, 9 (s - 1.6)^2 with corners at 0.6 and 1.4; no force outside."""
    parabola = np.array([9.0 * 0.16, -9.0 * 0.8, 9.0])
    other = np.array([9.0 * 2.56, -9.0 * 3.2, 9.0])
    nothing = np.zeros(3)
    return ForceLength(
        np.array([0.0, 0.4, 0.6, 1.4, 1.6]),
        np.array([nothing, parabola, [-3.0, 8.0, -4.0], other, nothing]),
        "Blemker, Pinsky and Delp (2005), after Zajac (1989): native skeletal muscle",
    )


def _gordon_1966() -> ForceLength:
    """Straight lines between sarcomere lengths of 1.27, 1.67, 2.0, 2.25 and 3.65 um, over 2.125 um.

    Corner points as text books quote them, not read from the paper's own figure. Its abstract puts the plateau between
    2.05 and 2.2 um and the break of the rising limb at about 1.67 um.
    """
    length = np.array([1.27, 1.67, 2.0, 2.25, 3.65]) / 2.125
    share = np.array([0.0, 0.84, 1.0, 1.0, 0.0])
    slopes = np.diff(share) / np.diff(length)
    lines = [[f - slope * s, slope, 0.0] for s, f, slope in zip(length[:-1], share[:-1], slopes, strict=True)]
    return ForceLength(
        np.concatenate([[0.0], length]),
        np.array([[0.0, 0.0, 0.0], *lines, [0.0, 0.0, 0.0]]),
        "Gordon, Huxley and Julian (1966), corner points as usually quoted: single fibres of frog",
    )


CONSTANT = ForceLength(np.zeros(1), np.array([[1.0, 0.0, 0.0]]), "no dependence on length")

# every curve that a design can name
FORCE_LENGTH: dict[str, Callable[[], ForceLength]] = {
    "none": lambda: CONSTANT,
    "blemker_2005": _blemker_2005,
    "gordon_1966": _gordon_1966,
}


def force_length(name: str, optimal_stretch: float = 1.0) -> ForceLength:
    """Curve of a name with its greatest force at `optimal_stretch` [1]; refuses an unknown name."""
    if name not in FORCE_LENGTH:
        raise ModelError(f"force_length: found {name!r}, expected one of {', '.join(FORCE_LENGTH)}")
    return FORCE_LENGTH[name]().scaled(optimal_stretch)
