"""Gaits between which a walk changes, told apart stroke by stroke: groups of strokes that end with one that fails.

Where static friction is above kinetic a walk may repeat a short group of strokes for a while, leave it, make a longer
one and come back. A mean over the whole walk mixes them, and two meshes that walk alike but change at other times seem
to differ. Here every group counts for its own kind, and the walks, which are independent, give the intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GroupGait:
    """Groups of one kind in all walks.

    Attributes
    ----------
    length
        Strokes in a group; None for groups of all other lengths together.
    groups
        How many there are.
    advance_mm, reach_mm
        Mean advance per stroke, and half of its 95 % interval (Student, of the walks' own means about it); not a number
        for less than two walks that have such groups.
    settled, settled_mm
        Groups with one of their length before and after, and the median of their means [mm]: the gait itself, without
        what leads to it and away (a walk leaves a gait slowly, which a mean would see). Not a number without any.
    share, share_interval
        Share of the strokes, mean of the walks, with its 95 % interval (Student) within 0 and 1 [1].
    """

    length: int | None
    groups: int
    advance_mm: float
    reach_mm: float
    settled: int
    settled_mm: float
    share: float
    share_interval: tuple[float, float]


def stroke_groups(advances: Array, *, discard: int = 0, limit: float = 0.0) -> list[Array]:
    """Whole groups of the strokes of a walk, each up to one that advances by less than `limit` [mm].

    Parameters
    ----------
    advances
        Of the strokes, (k,) [mm].
    discard
        Strokes left out at the beginning; what follows them up to the first that fails is no whole group, either.

    Returns
    -------
    list of Array
        Advances of each group [mm], in order.
    """
    fails = [k for k in range(discard, len(advances)) if advances[k] < limit]
    return [np.array(advances[a + 1 : b + 1]) for a, b in pairwise(fails)]


def group_gaits(walks: Sequence[Array], *, discard: int = 0, limit: float = 0.0) -> tuple[GroupGait, ...]:
    """Groups of the most frequent length, and all others, in walks of which each gives the advances of its strokes.

    Parameters
    ----------
    walks
        Advances per stroke, (k,) each [mm].
    discard, limit
        As in `stroke_groups`.

    Returns
    -------
    tuple of GroupGait
        One or two; none without any whole group.

    Raises
    ------
    ModelError
        No walk.
    """
    if not walks:
        raise ModelError("group_gaits: walks: found none, expected at least one")
    grouped = [stroke_groups(np.asarray(walk), discard=discard, limit=limit) for walk in walks]
    grouped = [groups for groups in grouped if groups]
    lengths = [len(group) for groups in grouped for group in groups]
    if not lengths:
        return ()
    usual = int(np.bincount(lengths).argmax())
    found = [_gait(grouped, usual, same=True)]
    if any(length != usual for length in lengths):
        found.append(_gait(grouped, usual, same=False))
    return tuple(found)


def _gait(walks: list[list[Array]], length: int, *, same: bool) -> GroupGait:
    mine = [[g for g in groups if (len(g) == length) is same] for groups in walks]
    sums = np.array([sum(float(g.sum()) for g in groups) for groups in mine])
    counts = np.array([sum(len(g) for g in groups) for groups in mine], dtype=float)
    mean = float(sums.sum() / counts.sum())
    # a ratio's interval, from what each walk leaves of it
    left, has = sums - mean * counts, int((counts > 0).sum())
    reach = math.nan
    if has > 1:
        spread = math.sqrt(float(left @ left) * has / (has - 1))
        reach = float(stdtrit(has - 1, 0.975)) * spread / float(counts.sum())
    inside = [
        g
        for groups in walks
        for before, g, after in zip(groups, groups[1:], groups[2:], strict=False)
        if same and len(before) == len(g) == len(after) == length
    ]
    shares = counts / np.array([sum(len(g) for g in groups) for groups in walks])
    n, share = len(shares), float(shares.mean())
    half = float(stdtrit(n - 1, 0.975)) * float(shares.std(ddof=1)) / math.sqrt(n) if n > 1 else 1.0
    return GroupGait(
        length if same else None,
        sum(len(groups) for groups in mine),
        mean,
        reach,
        len(inside),
        float(np.median([g.mean() for g in inside])) if inside else math.nan,
        share,
        (max(0.0, share - half), min(1.0, share + half)),
    )
