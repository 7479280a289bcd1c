"""Sparsity of the tangent and the map from element pairs into it, made once per mesh.

Only the upper triangle is kept, by rows, three rows a node; constrained unknowns stay in the pattern (with a unit row),
so it never changes with the supports and its symbolic factorisation serves for every load step. Pressure unknowns of
the mixed form come after all displacements, one row each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Pattern:
    """Upper triangle of a symmetric matrix: 3 by 3 blocks of nodes, then columns and rows of pressures.

    Attributes
    ----------
    starts, columns
        Compressed rows of the scalar matrix, int32.
    place
        For each pair ``a <= b`` of an element's nodes, (e, b (b + 1) / 2, 2): where the first entry of its block is,
        and the length of the row it is in, negative where the later of the two has the lower number (the block is
        then that of the transpose).
    coupling
        For each node of an element and each of its pressure nodes, (e, b, c): where the first of their three entries
        is; -1 in elements without pressure.
    compliance
        For each pair ``c <= d`` of an element's pressure nodes, (e, c (c + 1) / 2): where its entry is; -1 as above.
    n_pressures
        Number of pressure unknowns.
    """

    starts: NDArray[np.int32]
    columns: NDArray[np.int32]
    place: NDArray[np.int32]
    coupling: NDArray[np.int32]
    compliance: NDArray[np.int32]
    n_pressures: int

    @property
    def n_dofs(self) -> int:
        """Number of unknowns."""
        return len(self.starts) - 1

    def where(self, rows: Ints, columns: Ints) -> Ints:
        """Places of entries of the upper triangle, each of which must be in the pattern."""
        n = self.n_dofs
        keys = np.repeat(np.arange(n), np.diff(self.starts)) * n + self.columns
        return np.searchsorted(keys, rows * n + columns)


class _Graph:
    """Pairs (row, column) of numbers in compressed rows, each once and in order."""

    def __init__(self, rows: Ints, columns: Ints, shape: tuple[int, int]) -> None:
        graph = sparse.csr_matrix((np.ones(rows.size, dtype=np.int8), (rows.ravel(), columns.ravel())), shape=shape)
        graph.sum_duplicates()
        graph.sort_indices()
        self.starts, self.columns = graph.indptr.astype(np.int64), graph.indices.astype(np.int64)
        self.counts, self._width = np.diff(self.starts), shape[1]

    def rank(self, rows: Ints, columns: Ints) -> Ints:
        """Where in its row each of these pairs is."""
        keys = np.repeat(np.arange(len(self.counts)), self.counts) * self._width + self.columns
        return np.searchsorted(keys, rows * self._width + columns) - self.starts[rows]


def pattern(nodes: Ints, n_nodes: int, pressure_nodes: Ints | None = None, n_pressures: int = 0) -> Pattern:
    """Sparsity of the tangent.

    Parameters
    ----------
    nodes
        Nodes of each element, (b, e).
    n_nodes
        How many there are.
    pressure_nodes
        Pressure nodes of each element, (c, e), -1 throughout in elements without; none by default.
    n_pressures
        How many there are.
    """
    n_basis, n_elements = nodes.shape
    first, second = np.triu_indices(n_basis)
    low = np.minimum(nodes[first], nodes[second])
    high = np.maximum(nodes[first], nodes[second])
    graph = _Graph(low, high, (n_nodes, n_nodes))
    mixed = np.zeros(0, dtype=np.int64)
    pressures = np.zeros((0, 0), dtype=np.int64)
    if pressure_nodes is not None:
        mixed = np.flatnonzero(pressure_nodes[0] >= 0)
        pressures = pressure_nodes[:, mixed]
    n_values = len(pressures)
    beside, of = np.repeat(nodes[:, mixed], n_values, axis=0), np.tile(pressures, (n_basis, 1))  # (b c, mixed)
    coupled = _Graph(beside, of, (n_nodes, max(n_pressures, 1)))
    third, fourth = np.triu_indices(n_values)
    low_p, high_p = np.minimum(pressures[third], pressures[fourth]), np.maximum(pressures[third], pressures[fourth])
    own = _Graph(low_p, high_p, (n_pressures, max(n_pressures, 1)))
    # rows of a node: its blocks at or above it, then its pressures; row i leaves out the first i of its own block
    longest = 3 * graph.counts + coupled.counts
    lengths = np.stack([longest, longest - 1, longest - 2], axis=1)
    starts = np.concatenate([[0], np.cumsum(np.concatenate([lengths.ravel(), own.counts]))])
    if starts[-1] >= np.iinfo(np.int32).max:
        raise MemoryError(f"tangent: {starts[-1]} entries exceed what 32-bit indices hold")
    rank = graph.rank(low.ravel(), high.ravel())
    row_length = longest[low.ravel()] * np.where(nodes[first].ravel() <= nodes[second].ravel(), 1, -1)
    place = np.stack([starts[: 3 * n_nodes : 3][low.ravel()] + 3 * rank, row_length])
    place = np.moveaxis(place.reshape(2, len(first), n_elements), 0, -1).swapaxes(0, 1)
    columns = np.empty(starts[-1], dtype=np.int32)
    full = (3 * graph.columns[:, None] + np.arange(3)).ravel()
    block_start = 3 * graph.starts
    within = np.arange(len(full)) - np.repeat(block_start[:-1], 3 * graph.counts)
    within_p = np.arange(len(coupled.columns)) - np.repeat(coupled.starts[:-1], coupled.counts)
    for i in range(3):
        row_start = starts[i : 3 * n_nodes : 3] - i
        keep = within >= i
        columns[(np.repeat(row_start, 3 * graph.counts) + within)[keep]] = full[keep]
        columns[np.repeat(row_start + 3 * graph.counts, coupled.counts) + within_p] = 3 * n_nodes + coupled.columns
    columns[starts[3 * n_nodes] :] = 3 * n_nodes + own.columns
    place = np.ascontiguousarray(place, dtype=np.int32)
    coupling = np.full((n_elements, n_basis, n_values), -1, dtype=np.int32)
    where = starts[: 3 * n_nodes : 3][beside] + 3 * graph.counts[beside] + coupled.rank(beside, of)
    coupling[mixed] = np.moveaxis(where.reshape(n_basis, n_values, len(mixed)), -1, 0)
    compliance = np.full((n_elements, len(third)), -1, dtype=np.int32)
    compliance[mixed] = (starts[3 * n_nodes :][low_p] + own.rank(low_p, high_p)).T
    return Pattern(starts.astype(np.int32), columns, place, coupling, compliance, n_pressures)
