"""The order in which the blocks of a sparse system are eliminated, and where everything lies, planned once a model."""

from __future__ import annotations

from collections.abc import Iterable
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


class Plan(NamedTuple):
    """Block LU without pivoting between blocks, for a pattern that is symmetric.

    Attributes
    ----------
    order
        Unknown that is eliminated at each stage, (n,).
    diagonal
        Where the diagonal block of each unknown lies, (n,).
    start
        Stage s has the neighbours ``start[s]:start[s + 1]``, (n + 1,).
    neighbour, lower, upper
        Later unknown i, and where the blocks (i, k) and (k, i) lie, (t,).
    update_start, update
        Stage s updates, for all its neighbours i and j in this order, the blocks (i, j) that lie at
        ``update[update_start[s]:]``.
    """

    order: Ints
    diagonal: Ints
    start: Ints
    neighbour: Ints
    lower: Ints
    upper: Ints
    update_start: Ints
    update: Ints


def plan(
    n_unknowns: int, pairs: Iterable[tuple[int, int]], last: Iterable[int] = (), kept: Iterable[int] = ()
) -> tuple[Plan, dict, int]:
    """Plan for blocks at the given pairs of unknowns, those that elimination fills in included.

    Parameters
    ----------
    n_unknowns
        Number of block rows.
    pairs
        Coupled unknowns; order and repetition do not matter.
    last
        Unknowns that may be eliminated only after all their neighbours outside `last` (multipliers, whose own block
        is zero until then).
    kept
        Unknowns that wait as long as others can be eliminated: what is solved for units at these alone then ends soon.

    Returns
    -------
    Plan, dict, int
        The plan, where the block of each (row, column) lies, and the number of blocks.
    """
    late, wait = set(last), set(kept)
    near: list[set[int]] = [set() for _ in range(n_unknowns)]
    for i, j in pairs:
        if i != j:
            near[i].add(j)
            near[j].add(i)
    place = {(i, i): i for i in range(n_unknowns)}
    left = set(range(n_unknowns))
    order, start, neighbour, lower, upper, update_start, update = [], [0], [], [], [], [], []

    def slot(i: int, j: int) -> int:
        return place.setdefault((i, j), len(place))

    # unknowns that may be eliminated, by the number of their neighbours when they came; outdated entries are skipped
    queue: list[tuple[bool, int, int]] = []

    def offer(i: int) -> None:
        if i not in late or not (near[i] - late):
            heappush(queue, (i in wait, len(near[i]), i))

    for i in range(n_unknowns):
        offer(i)
    while left:
        # fewest neighbours first keeps the fill-in of chains and trees at nothing; ties by number, so plans repeat
        _, size, k = heappop(queue)
        if k not in left or size != len(near[k]):
            continue
        left.remove(k)
        around = sorted(near[k])
        order.append(k)
        update_start.append(len(update))
        for i in around:
            neighbour.append(i)
            lower.append(slot(i, k))
            upper.append(slot(k, i))
        for i in around:
            near[i].discard(k)
            for j in around:
                update.append(slot(i, j))
                if i != j:
                    near[i].add(j)
        for i in around:
            offer(i)
        start.append(len(neighbour))

    def ints(values: list[int]) -> Ints:
        return np.array(values, dtype=np.int64)

    made = Plan(
        ints(order),
        np.arange(n_unknowns, dtype=np.int64),
        ints(start),
        ints(neighbour),
        ints(lower),
        ints(upper),
        ints(update_start),
        ints(update),
    )
    return made, place, len(place)
