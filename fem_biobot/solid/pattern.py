"""Sparsity of the tangent and the map from element pairs into it, made once per mesh.

Only the upper triangle is kept, by rows, three rows a node; constrained unknowns stay in the pattern (with a unit row),
so it never changes with the supports and its symbolic factorisation serves for every load step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Pattern:
    """Upper triangle of a symmetric block matrix with 3 by 3 blocks.

    Attributes
    ----------
    starts, columns
        Compressed rows of the scalar matrix, int32.
    place
        For each pair ``a <= b`` of an element's nodes, (e, b (b + 1) / 2, 2): where the first entry of its block is,
        and the length of the row it is in, negative where the later of the two has the lower number (the block is
        then that of the transpose).
    """

    starts: NDArray[np.int32]
    columns: NDArray[np.int32]
    place: NDArray[np.int32]

    @property
    def n_dofs(self) -> int:
        """Number of unknowns."""
        return len(self.starts) - 1


def pattern(nodes: Ints, n_nodes: int) -> Pattern:
    """Sparsity of the tangent of elements with the given nodes, (b, e)."""
    n_basis, n_elements = nodes.shape
    first, second = np.triu_indices(n_basis)
    low = np.minimum(nodes[first], nodes[second])
    high = np.maximum(nodes[first], nodes[second])
    graph = sparse.csr_matrix((np.ones(low.size, dtype=np.int8), (low.ravel(), high.ravel())), shape=(n_nodes, n_nodes))
    graph.sum_duplicates()
    graph.sort_indices()
    ptr, col = graph.indptr.astype(np.int64), graph.indices.astype(np.int64)
    # place of (low, high) in the sorted list of all pairs, then within its own row
    keys = np.repeat(np.arange(n_nodes), np.diff(ptr)) * n_nodes + col
    rank = np.searchsorted(keys, low.ravel() * n_nodes + high.ravel()) - ptr[low.ravel()]
    degree = np.diff(ptr)  # neighbours at or above the node, itself included
    lengths = np.stack([3 * degree, 3 * degree - 1, 3 * degree - 2], axis=1)
    starts = np.concatenate([[0], np.cumsum(lengths.ravel())])
    if starts[-1] >= np.iinfo(np.int32).max:
        raise MemoryError(f"tangent: {starts[-1]} entries exceed what 32-bit indices hold")
    row_length = lengths[low.ravel(), 0] * np.where(nodes[first].ravel() <= nodes[second].ravel(), 1, -1)
    place = np.stack([starts[:-1:3][low.ravel()] + 3 * rank, row_length])
    full = (3 * col[:, None] + np.arange(3)).ravel()
    columns = np.empty(starts[-1], dtype=np.int32)
    block_start = 3 * ptr
    for i in range(3):
        # row i of a node leaves out the first i columns of its own block
        own = np.repeat(starts[i:-1:3] - i - block_start[:-1], 3 * degree) + np.arange(len(full))
        keep = np.arange(len(full)) - np.repeat(block_start[:-1], 3 * degree) >= i
        columns[own[keep]] = full[keep]
    return Pattern(
        starts.astype(np.int32),
        columns,
        np.ascontiguousarray(
            np.moveaxis(place.reshape(2, len(first), n_elements), 0, -1).swapaxes(0, 1), dtype=np.int32
        ),
    )
