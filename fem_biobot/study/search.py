"""The inverse question: which value of a key, or which two of two keys, give a stroke or a force that is wanted.

Every design tried is a row. One key: values over its range, then Brent's method in every interval in which the wanted
number is crossed. Two keys and one target: the same for several values of the second key, a line of designs that all
do it. Two keys and two targets: least squares within the ranges from the best of a coarse grid.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np
from scipy.optimize import brentq, least_squares

from fem_biobot.design import Design, keys, unknown_key
from fem_biobot.errors import BiobotError, DesignError
from fem_biobot.study.reporter import Reporter
from fem_biobot.study.search_models import QUANTITIES, Answer, Model, answer
from fem_biobot.units import format_quantity, parse_quantity, shown

# of the range, at which a crossing is known
_TOLERANCE = 1e-4
# relative, at which two targets are met
_MET = 1e-3
# step of difference quotients over the range: the solid's numbers scatter with its meshes
_STEPS = {Model.rod: 1e-3, Model.solid: 0.05}
_MOST_POINTS = 100


@dataclass(frozen=True)
class Range:
    """A key and the values that it may take, in coherent units."""

    key: str
    low: float
    high: float

    def told(self, value: float, digits: int = 6) -> str:
        """A value with its unit."""
        quantity = keys()[self.key].quantity
        assert quantity is not None
        return format_quantity(value, quantity.unit, digits=digits)


@dataclass(frozen=True)
class Target:
    """A number that is wanted, in its coherent unit."""

    quantity: str
    value: float

    @property
    def unit(self) -> str:
        """Coherent unit."""
        return QUANTITIES[self.quantity][0]


@dataclass(frozen=True)
class SearchPlan:
    """What is sought.

    Attributes
    ----------
    vary
        One key or two.
    targets
        One, or with two keys up to two.
    model
        Who answers.
    points
        Values of each key that are tried before any is refined.
    """

    vary: tuple[Range, ...]
    targets: tuple[Target, ...]
    model: Model = Model.rod
    points: int = 5

    def __post_init__(self) -> None:
        if not 1 <= len(self.vary) <= 2:
            raise DesignError(f"--vary: found {len(self.vary)} keys, expected one or two")
        if not 1 <= len(self.targets) <= len(self.vary):
            raise DesignError(
                f"--target: found {len(self.targets)} with {len(self.vary)} keys, expected one, or two with two keys"
            )
        for what, names in (
            ("--vary", [each.key for each in self.vary]),
            ("--target", [each.quantity for each in self.targets]),
        ):
            if len(set(names)) < len(names):
                raise DesignError(f"{what}: found {names[0]} twice, expected it once")
        if not 2 <= self.points <= _MOST_POINTS:
            raise DesignError(f"--points: found {self.points}, expected between 2 and {_MOST_POINTS}")

    @property
    def text(self) -> str:
        """In a line, as the identity of a result."""
        vary = ", ".join(f"{r.key} {r.low!r} to {r.high!r}" for r in self.vary)
        targets = ", ".join(f"{t.quantity} {t.value!r} {t.unit}" for t in self.targets)
        return f"{self.model.value}; {vary}; {targets}; {self.points} points"


@dataclass(frozen=True)
class Tried:
    """One design that was tried: values of the keys, and what it answered."""

    values: tuple[float, ...]
    answer: Answer


@dataclass(frozen=True)
class Solution:
    """Values that give what is wanted.

    Attributes
    ----------
    values
        Of the keys.
    bracket
        Values of the first key next to it, on either side of the target; none where two targets are met.
    answer
        What the design there answers.
    """

    values: tuple[float, ...]
    bracket: tuple[float, float] | None
    answer: Answer


@dataclass
class Search:
    """A search under way: what was tried, in order."""

    design: Design
    plan: SearchPlan
    reporter: Reporter
    tried: list[Tried] = field(default_factory=list)

    def ask(self, values: Sequence[float]) -> Answer:
        """Answer of the design with these values; each is asked once."""
        wanted = tuple(float(v) for v in values)
        for old in self.tried:
            if old.values == wanted:
                return old.answer
        named = dict(zip((r.key for r in self.plan.vary), wanted, strict=True))
        try:
            found = answer(self.design.with_values(named), self.plan.model)
        except DesignError as error:
            found = Answer({}, str(error))
        self.tried.append(Tried(wanted, found))
        told = ", ".join(r.told(v, 4) for r, v in zip(self.plan.vary, wanted, strict=True))
        says = ", ".join(
            f"{t.quantity} {found.numbers[t.quantity]:.4g} {t.unit}" for t in self.plan.targets if found.numbers
        )
        self.reporter.advance(f"{told}: {says or found.reason}")
        return found


def parse_range(text: str) -> Range:
    """``skeleton.beam_thickness=0.4mm..1mm``."""
    name, equals, ends = text.partition("=")
    name = name.strip()
    low, dots, high = ends.partition("..")
    if not (equals and dots):
        raise DesignError(f"--vary: found {shown(text)}, expected KEY=FROM..TO, such as muscle.theta=60deg..90deg")
    if name not in keys():
        raise DesignError(f"--vary: {unknown_key(name)}")
    quantity = keys()[name].quantity
    if quantity is None:
        raise DesignError(f"--vary: found {name}, expected a key that is a quantity")
    a, b = (parse_quantity(end.strip(), quantity.unit, f"--vary {name}") for end in (low, high))
    if not a < b:
        raise DesignError(f"--vary {name}: found {shown(ends)}, expected a range that rises")
    return Range(name, a, b)


def parse_target(text: str) -> Target:
    """``stroke=0.5mm``."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals or name not in QUANTITIES:
        raise DesignError(
            f"--target: found {shown(text)}, expected one of: {', '.join(QUANTITIES)}, such as stroke=0.5mm"
        )
    unit = QUANTITIES[name][0]
    return Target(name, parse_quantity(value, unit, f"--target {name}"))


def search(design: Design, plan: SearchPlan, reporter: Reporter) -> tuple[list[Solution], list[Tried]]:
    """Designs in the ranges of a plan that give what it wants, and every design that was tried.

    No solution means that none was crossed between the values tried; what they gave tells how near they came.
    """
    reporter.stage(f"{plan.model.value}: designs tried")
    under_way = Search(design, plan, reporter)
    if len(plan.targets) == 2:
        found = _both(under_way)
    elif len(plan.vary) == 2:
        second = plan.vary[1]
        found = []
        for value in np.linspace(second.low, second.high, plan.points):
            found += _crossings(under_way, (float(value),))
    else:
        found = _crossings(under_way, ())
    return found, under_way.tried


def _crossings(under_way: Search, rest: tuple[float, ...]) -> list[Solution]:
    """Values of the first key at which the target is crossed, the other key fixed."""
    plan = under_way.plan
    first, target = plan.vary[0], plan.targets[0]

    def over(value: float) -> float:
        """How far above the target; not a number where the design fails."""
        numbers = under_way.ask((value, *rest)).numbers
        return numbers[target.quantity] - target.value if numbers else float("nan")

    at = [float(v) for v in np.linspace(first.low, first.high, plan.points)]
    have = [(v, over(v)) for v in at]
    found = [_solution(under_way, v, rest, over) for v, f in have if f == 0.0]
    for (a, fa), (b, fb) in pairwise(have):
        if not fa * fb < 0.0:
            continue
        value = _refined(over, a, b, _TOLERANCE * (first.high - first.low))
        if value is not None:
            found.append(_solution(under_way, value, rest, over))
    return found


class _FailedInsideError(BiobotError):
    """A design between two that have an equilibrium has none."""


def _refined(over: Callable[[float], float], a: float, b: float, tolerance: float) -> float | None:
    """Where a function is zero between two values; None where designs between them fail."""

    def inside(value: float) -> float:
        found = over(value)
        if np.isnan(found):
            raise _FailedInsideError(f"{value:g}")
        return found

    try:
        root: float = brentq(inside, a, b, xtol=tolerance)  # pyright: ignore[reportAssignmentType]
    except _FailedInsideError:
        return None
    return float(root)


def _solution(under_way: Search, value: float, rest: tuple[float, ...], over: Callable[[float], float]) -> Solution:
    """A crossing with the nearest values tried on either side."""
    values = (value, *rest)
    there = over(value)
    tried = [(t.values[0], over(t.values[0])) for t in under_way.tried if t.values[1:] == rest and t.answer.numbers]
    other = [v for v, f in tried if f * there < 0.0]
    nearest = min(other, key=lambda v: abs(v - value), default=value)
    low, high = min(value, nearest), max(value, nearest)
    return Solution(values, (low, high), under_way.ask(values))


def _both(under_way: Search) -> list[Solution]:
    """Two keys for two targets."""
    plan = under_way.plan
    low, high = (np.array([getattr(r, end) for r in plan.vary]) for end in ("low", "high"))

    def off(shares: np.ndarray) -> np.ndarray:
        """Relative distances from the targets; far off where the design fails."""
        numbers = under_way.ask((low + shares * (high - low)).tolist()).numbers
        if not numbers:
            return np.full(2, 10.0)
        return np.array([(numbers[t.quantity] - t.value) / _scale(t) for t in plan.targets])

    grid = [np.array(shares) for shares in product(np.linspace(0.0, 1.0, plan.points), repeat=2)]
    start = min(grid, key=lambda shares: float(np.abs(off(shares)).max()))
    inside = np.clip(start, 1e-6, 1.0 - 1e-6)
    step = _STEPS[plan.model]
    best = least_squares(off, inside, bounds=(0.0, 1.0), diff_step=step, xtol=1e-8, ftol=1e-12, max_nfev=30).x
    if np.abs(off(best)).max() > _MET:
        return []
    values = tuple(float(v) for v in low + best * (high - low))
    return [Solution(values, None, under_way.ask(values))]


def _scale(target: Target) -> float:
    return abs(target.value) or 1.0


def nearest_try(tried: Sequence[Tried], targets: Sequence[Target]) -> Tried | None:
    """Of all that was tried, what came nearest to the targets; None where every design failed."""

    def off(each: Tried) -> float:
        return max(abs(each.answer.numbers[t.quantity] - t.value) / _scale(t) for t in targets)

    return min((each for each in tried if each.answer.numbers), key=off, default=None)


def reached(tried: Sequence[Tried], quantity: str) -> tuple[float, float] | None:
    """Least and most that was reached of a quantity; None where every design failed."""
    values = [each.answer.numbers[quantity] for each in tried if each.answer.numbers]
    return (min(values), max(values)) if values else None


def closest_to(solutions: Sequence[Solution], design: Design, vary: Sequence[Range]) -> Solution | None:
    """Of several solutions the one that changes a design least, measured in the ranges; None where there is none."""

    def change(each: Solution) -> float:
        own: Mapping[str, float] = {r.key: design.value(r.key) for r in vary}
        return sum(((v - own[r.key]) / (r.high - r.low)) ** 2 for v, r in zip(each.values, vary, strict=True))

    return min(solutions, key=change, default=None)
