"""What a verification case says before it is computed, what it finds, and the rows that follow. Plain data, no physics.

A `Case` states its `Claim`s beforehand: quantity, known answer, tolerance, source. Its function computes the same
quantities through the package's public interface; each makes a `Row`, which passes or fails.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Claim:
    """A quantity whose value is known.

    Parameters
    ----------
    quantity
        What it is, in words; unique in its case.
    reference
        The known answer.
    tolerance
        Largest error accepted, in the unit of the answer. None for a number that is shown and not judged.
    unit
        ``"1"`` for a pure number.
    source
        Where the answer comes from: author and year with the equation, or the formula itself.

    Raises
    ------
    ModelError
        A reference that is not finite, a tolerance that is not above zero, or an empty text.
    """

    quantity: str
    reference: float
    tolerance: float | None
    unit: str
    source: str

    def __post_init__(self) -> None:
        for what in ("quantity", "unit", "source"):
            if not getattr(self, what).strip():
                raise ModelError(f"claim {self.quantity!r}: {what}: found nothing, expected words")
        if not math.isfinite(self.reference):
            raise ModelError(f"claim {self.quantity!r}: reference: found {self.reference}, expected a finite number")
        if self.tolerance is not None and not 0.0 < self.tolerance < math.inf:
            raise ModelError(
                f"claim {self.quantity!r}: tolerance: found {self.tolerance}, expected a finite number above 0, or None"
            )


@dataclass(frozen=True)
class Row:
    """A claim and what was computed."""

    case: str
    claim: Claim
    ours: float

    @property
    def error(self) -> float:
        """``|ours - reference|``, in the unit of the claim; not a number where ours is none."""
        return abs(self.ours - self.claim.reference)

    @property
    def passed(self) -> bool | None:
        """Whether the error is within the tolerance (what is not a number is not); None where nothing is judged."""
        # a plain truth value, whatever the numbers are: numpy's False is not False
        return None if self.claim.tolerance is None else bool(self.error <= self.claim.tolerance)

    @property
    def verdict(self) -> str:
        """``pass``, ``fail`` or ``shown``."""
        return "shown" if self.passed is None else "pass" if self.passed else "fail"


@dataclass(frozen=True, eq=False)
class Curve:
    """One line of a graph, or points in it.

    Attributes
    ----------
    name
        For the legend.
    x, y
        (k,) each, finite.
    known
        Whether it is the known answer, or ours.
    joined
        Whether a line goes through its points; by default through those of the known answer.
    """

    name: str
    x: ArrayLike
    y: ArrayLike
    known: bool = False
    joined: bool | None = None


@dataclass(frozen=True)
class Graph:
    """The picture of a case: known curves and ours.

    Attributes
    ----------
    x, y
        Labels of the axes, with units.
    curves
        In order of drawing.
    logarithmic
        Which axes: none, the first, or both.
    equal
        Whether a millimetre is as long along both axes, for shapes.
    """

    x: str
    y: str
    curves: tuple[Curve, ...]
    logarithmic: Literal["", "x", "xy"] = ""
    equal: bool = False


@dataclass(frozen=True)
class Finding:
    """What a case computed: one value for each claim, in their order, and the picture if it has one."""

    values: tuple[float, ...]
    graph: Graph | None = None

    @classmethod
    def of(cls, values: Iterable[Any], graph: Graph | None = None) -> Finding:
        """From numbers of any kind."""
        return cls(tuple(float(value) for value in values), graph)


@dataclass(frozen=True)
class Case:
    """One verification case.

    Attributes
    ----------
    id
        Such as ``S1``.
    title
        One line.
    claims
        What is known.
    compute
        Computes it, through the public interface. Its docstring says what it measures, why the tolerances are what
        they are, what it cannot see, and which faults it catches.
    """

    id: str
    title: str
    claims: tuple[Claim, ...]
    compute: Callable[[], Finding]

    def __post_init__(self) -> None:
        names = [claim.quantity for claim in self.claims]
        if not names or len(set(names)) != len(names):
            raise ModelError(f"case {self.id}: found the quantities {names}, expected at least one, each once")

    def rows(self, finding: Finding) -> tuple[Row, ...]:
        """The claims beside what was found; refuses a finding with more or fewer values than claims."""
        if len(finding.values) != len(self.claims):
            raise ModelError(
                f"case {self.id}: found {len(finding.values)} values, expected {len(self.claims)}, one for each claim"
            )
        return tuple(Row(self.id, claim, value) for claim, value in zip(self.claims, finding.values, strict=True))


def worst(values: ArrayLike, reference: float) -> float:
    """The value farthest from a reference, of many that should equal it; not a number if one of them is none."""
    flat = np.asarray(values, dtype=float).ravel()
    # argmax returns the first that is not a number, if there is one
    return float(flat[int(np.argmax(np.abs(flat - reference)))])


def order(sizes: ArrayLike, errors: ArrayLike) -> float:
    """Least-squares rate at which errors fall with the size, in logarithms."""
    return float(np.polyfit(np.log(np.asarray(sizes, dtype=float)), np.log(np.asarray(errors, dtype=float)), 1)[0])


def extrapolated(coarse: ArrayLike, fine: ArrayLike, rate: float = 2.0) -> Array:
    """Limit of values whose error falls with the power `rate` of a size that was halved (Richardson 1911)."""
    a, b = np.asarray(coarse, dtype=float), np.asarray(fine, dtype=float)
    return b + (b - a) / (2.0**rate - 1.0)


def observed_order(coarse: ArrayLike, middle: ArrayLike, fine: ArrayLike) -> float:
    """Order at which values settle as a size is halved twice, from their differences alone (no limit is assumed)."""
    a, b, c = (np.asarray(value, dtype=float) for value in (coarse, middle, fine))
    return float(np.log2(np.linalg.norm(a - b) / np.linalg.norm(b - c)))
