"""Sharing elements among threads so that no two write to the same node: slabs side by side, then what lies between.

The kernels release Python's lock, so plain threads run them side by side; a node's contributions are added in an order
that does not depend on which thread is faster, so results repeat to the last bit.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import TypeVar

import numpy as np

from fem_biobot.solid.space import Array, Ints

Part = TypeVar("Part")

# slabs thinner than this many elements are not worth a thread
_FEWEST = 500
_MOST_THREADS = 4


@dataclass(frozen=True)
class Shares:
    """Elements of each slab that touch no other slab, and the rest; ascending, so that their data are read in order."""

    slabs: tuple[Ints, ...]
    rest: Ints

    def run(self, work: Callable[[Ints], None]) -> None:
        """Do `work` on all elements, slabs at the same time, the rest after them."""
        run_parts(work, self.slabs)
        if self.rest.size:
            work(self.rest)


def run_parts(work: Callable[[Part], None], parts: Sequence[Part]) -> None:
    """Do `work` on all parts at the same time; an exception in one of them is raised here."""
    if len(parts) == 1:
        work(parts[0])
    else:
        list(_pool().map(work, parts))


def split(elements: Ints) -> tuple[Ints, ...]:
    """Elements in as many equal parts as are worth a thread each; for work that writes to its own elements only."""
    count = max(1, min(usable_threads(), len(elements) // _FEWEST))
    return tuple(np.array_split(elements, count))


def shares(nodes: Ints, points: Array, threads: int | None = None) -> Shares:
    """Slabs of elements across the longest extent of the body.

    Parameters
    ----------
    nodes
        Nodes of each element, (b, e).
    points
        Node positions, (3, n) [mm].
    threads
        How many slabs; by default as many as processors may be used, at most four.
    """
    n_elements = nodes.shape[1]
    threads = usable_threads() if threads is None else threads
    count = max(1, min(threads, n_elements // _FEWEST))
    if count == 1:
        return Shares((np.arange(n_elements),), np.zeros(0, dtype=np.int64))
    axis = int(np.argmax(np.ptp(points, axis=1)))
    order = np.argsort(points[axis, nodes].mean(axis=0), kind="stable")
    slab_of = np.empty(n_elements, dtype=np.int64)
    slab_of[order] = np.arange(n_elements) * count // n_elements
    first = np.full(points.shape[1], count)
    last = np.full(points.shape[1], -1)
    # written out in full: numpy's in-place minimum reads past a value array that it has to broadcast
    touched, by = nodes.ravel(), np.tile(slab_of, len(nodes))
    np.minimum.at(first, touched, by)
    np.maximum.at(last, touched, by)
    between = np.any((first != last)[nodes], axis=0)
    slabs = tuple(np.flatnonzero((slab_of == k) & ~between) for k in range(count))
    return Shares(slabs, np.flatnonzero(between))


@cache
def usable_threads() -> int:
    """Processors that this process may use, at most four, and no more than ``OMP_NUM_THREADS`` asks for."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, min(_MOST_THREADS, usable, int(asked) if asked.isdecimal() else usable))


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_MOST_THREADS, thread_name_prefix="assembly")
