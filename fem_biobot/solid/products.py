"""Product of the symmetric matrix with a vector, its rows shared among threads."""

from __future__ import annotations

from typing import Any

import numpy as np

from fem_biobot.solid.sharing import run_parts, usable_threads
from fem_biobot.solid.space import Array
from fem_biobot.solid.vectors.kernels import add_node_rows

# entries of the matrix that are worth a thread: half a millisecond
_FEWEST = 500_000


def write_node_product(starts: Any, columns: Any, data: Any, x: Array, y: Array) -> None:
    """Write ``y = A x`` for a symmetric matrix whose rows and columns are all nodes', three a node.

    Parameters
    ----------
    starts, columns, data
        Upper triangle as in `solid.pattern`; `data` may be in single precision, the sums are not.
    x, y
        Vectors (dofs,).

    Notes
    -----
    A row of the upper triangle writes to what lies at or after it. Every thread sums into a vector of its own, and
    these are added in order, so that the result repeats to the last bit with as many threads.
    """
    y[:] = 0.0
    n_nodes = len(y) // 3
    count = max(1, min(usable_threads(), len(data) // _FEWEST))
    if count == 1:
        add_node_rows(0, n_nodes, starts, columns, data, x, y)
        return
    # as many entries for each
    bounds = np.searchsorted(starts[::3], np.arange(1, count) * len(data) // count)
    firsts, lasts = np.concatenate([[0], bounds]), np.concatenate([bounds, [n_nodes]])
    sums = [y, *(np.zeros_like(y) for _ in bounds)]

    def add(k: int) -> None:
        add_node_rows(int(firsts[k]), int(lasts[k]), starts, columns, data, x, sums[k])

    run_parts(add, range(count))
    for first, part in zip(firsts[1:], sums[1:], strict=True):
        y[3 * first :] += part[3 * first :]
