"""At which case's states each solve of a sweep begins: trees over the cases, made from the sweep's file alone.

Cases of one mesh are put in an order in which each next one is as far from all before it as can be, so that the first
few cover the range of the keys evenly and later ones fill in between. The first few begin from the undeformed body; a
later one begins at the nearest before it. The order of the file, of workers or of ends decides nothing, so rows do not
depend on them either.

Trees are shallow and wide, so that workers seldom wait: of n cases on one mesh about the root of n begin from the
undeformed body, and the rest is a few steps deep (a grid of 4 x 4: 1, of 8 x 8: 3; a Latin hypercube in three keys, by
its seed: about 4 with 64 points, 7 with 1 000, 9 with 4 096). Time to make them goes with the square of n.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.mesh.store import stored_file
from fem_biobot.study.sweep_file import Case

# distances nearer than this are equal: rounding must not choose
_DIGITS = 9


@dataclass(frozen=True)
class Forest:
    """Who begins where.

    Attributes
    ----------
    rank
        Key of a case to its place in the order; parents stand before their children.
    parent
        Key of a case to that of the case at whose states it begins; cases that begin by themselves are not in it.
    """

    rank: Mapping[str, int] = field(default_factory=dict)
    parent: Mapping[str, str] = field(default_factory=dict)

    def depth(self) -> int:
        """Most cases that one begins after, one after the other."""
        depths: dict[str, int] = {}
        for key in sorted(self.rank, key=self.rank.__getitem__):
            depths[key] = depths[self.parent[key]] + 1 if key in self.parent else 0
        return max(depths.values(), default=0)


def forest(cases: Sequence[Case]) -> Forest:
    """Trees over the cases that have a design, one or more for each mesh."""
    groups: dict[Any, dict[str, Case]] = {}
    for case in cases:
        if case.design is not None and (shared := _shared(case.design)) is not None:
            groups.setdefault(shared, {}).setdefault(case.key, case)
    rank: dict[str, int] = {}
    parent: dict[str, str] = {}
    for group in groups.values():
        names = list(group)
        order, nearest = _spread(_coordinates(list(group.values())))
        alone = math.ceil(math.sqrt(len(names)))
        for place, number in enumerate(order):
            rank[names[number]] = len(rank)
            if place >= alone:
                parent[names[number]] = names[nearest[number]]
    return Forest(rank, parent)


def _shared(design: Design) -> tuple[Any, ...] | None:
    """What designs must have in common to have states of one kind; None where states hang on their path."""
    muscle = design.muscle
    if muscle is not None and muscle.attachment == "contact":
        return None
    return stored_file(design, Path()), design.mesh.element


def _coordinates(cases: Sequence[Case]) -> np.ndarray:
    """Cases as points, (cases, columns): each key over its range [1]; words are equal, or one apart."""
    columns: list[np.ndarray] = []
    for key in cases[0].values:
        values = [case.values[key] for case in cases]
        if any(isinstance(value, str) for value in values):
            words = sorted(set(map(str, values)))
            columns += [np.array([math.sqrt(0.5) * (str(value) == word) for value in values]) for word in words]
            continue
        numbers = np.array(values, dtype=float)
        reach = np.ptp(numbers)
        columns.append((numbers - numbers.min()) / reach if reach > 0.0 else np.zeros_like(numbers))
    return np.column_stack(columns)


def _spread(points: np.ndarray) -> tuple[list[int], np.ndarray]:
    """Order of points, each as far from those before it as can be, and for each the nearest before it, (n,).

    The farthest-point order of Gonzalez (1985), begun in the middle; what is equal goes by number.
    """
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    first = int(np.argmin(_distance(points, middle)))
    order, nearest = [first], np.full(len(points), first)
    far = _distance(points, points[first])
    waiting = np.ones(len(points), dtype=bool)
    waiting[first] = False
    while waiting.any():
        following = int(np.argmax(np.where(waiting, far, -1.0)))
        order.append(following)
        waiting[following] = False
        there = _distance(points, points[following])
        closer = waiting & (there < far)
        far[closer], nearest[closer] = there[closer], following
    return order, nearest


def _distance(points: np.ndarray, point: np.ndarray) -> np.ndarray:
    return np.round(np.linalg.norm(points - point, axis=1), _DIGITS)
