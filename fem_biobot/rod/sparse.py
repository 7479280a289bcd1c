"""The tangent of an assembly with its joints as one sparse symmetric-patterned matrix, and its factorisation.

Unknowns are the increments of the nodes and, with the sign changed, those of the joints' multipliers:

    [ K   G^T ] [ du  ]   [ out-of-balance force ]
    [ G   -d  ] [ -dl ] = [ minus the joints' gap ]

so that the matrix is symmetric where K is. `d` is a compliance of the joints far below any other: it bears joints that
say the same thing twice (a plane four-bar linkage of rigid bodies), and vanishes from converged states, since residuals
do not know it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags_array, eye_array
from scipy.sparse.linalg import splu

from fem_biobot.rod.arrays import Assembly
from fem_biobot.rod.system import System

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# compliance of a joint's row against the nodes it ties, in the scaled matrix
_COMPLIANCE = 1e-10
# stiffness of joints' rows against that of the nodes, where definiteness is looked at
_WEIGHT = 100.0
# stiffness that rounding may leave to a motion that costs nothing
_NEUTRAL = 2e-14


class SingularError(Exception):
    """The matrix has no inverse."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """Numbers of the unknowns and where the blocks' entries go.

    Attributes
    ----------
    index
        Number of each component of the nodes (first) and joints (after them), -1 where it is no unknown, (n + j, 6).
    joint
        Which unknowns are multipliers, (size,).
    source, entry, sign
        Entry of the matrix's data to which each value of the blocks and joints adds, and with which sign.
    rows, starts
        Compressed columns.
    n_joints
        Joints and partial supports.
    """

    index: Ints
    joint: NDArray[np.bool_]
    source: Ints
    entry: Ints
    sign: Array
    rows: Ints
    starts: Ints
    n_joints: int

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.joint)

    @cached_property
    def node_dofs(self) -> tuple[Ints, Ints]:
        """Node components that are unknowns, flat, and their numbers."""
        flat = self.index[: len(self.index) - self.n_joints].ravel()
        chosen = np.flatnonzero(flat >= 0)
        return chosen, flat[chosen]

    @cached_property
    def joint_dofs(self) -> tuple[Ints, Ints]:
        """Joint rows that are unknowns, flat, and their numbers."""
        flat = self.index[len(self.index) - self.n_joints :].ravel()
        chosen = np.flatnonzero(flat >= 0)
        return chosen, flat[chosen]

    def gather(self, nodes: Array, joints: Array) -> Array:
        """Vector of the unknowns from values at nodes (n, 6) and joints (j, 6)."""
        out = np.zeros(self.size)
        for values, (chosen, numbers) in ((nodes, self.node_dofs), (joints, self.joint_dofs)):
            out[numbers] = values.ravel()[chosen]
        return out

    def scatter(self, vector: Array) -> tuple[Array, Array]:
        """Values at nodes (n, 6) and joints (j, 6) from a vector; zero elsewhere."""
        n = len(self.index) - self.n_joints
        nodes, joints = np.zeros(6 * n), np.zeros(6 * self.n_joints)
        for values, (chosen, numbers) in ((nodes, self.node_dofs), (joints, self.joint_dofs)):
            values[chosen] = vector[numbers]
        return nodes.reshape(n, 6), joints.reshape(self.n_joints, 6)

    def matrix(self, blocks: Array, joint_blocks: Array) -> csc_matrix:
        """The matrix of blocks (b, 6, 6) and joints' geometric stiffness (j, 12, 12)."""
        values = np.concatenate([blocks.ravel(), joint_blocks.ravel()])
        data = np.bincount(self.entry, self.sign * values[self.source], minlength=len(self.rows))
        return csc_matrix((data, self.rows, self.starts), shape=(self.size, self.size))


def pattern(assembly: Assembly, system: System) -> Pattern:
    """Pattern of an assembly; unknowns stand in the order in which the plan eliminates them."""
    n, joints = len(assembly.inertia.mass), len(assembly.constraints.rows)
    wanted = np.vstack([np.tile(assembly.inertia.held[:, None] == 0, (1, 6)), assembly.constraints.rows == 1])
    index = np.full((n + joints, 6), -1, dtype=np.int64)
    size = 0
    for unknown in system.plan.order:
        for c in np.flatnonzero(wanted[unknown]):
            index[unknown, c] = size
            size += 1
    slots: dict[int, tuple[int, int]] = {int(system.plan.diagonal[i]): (i, i) for i in range(n + joints)}
    for pairs, places in ((assembly.elements.nodes, system.element), (assembly.members.nodes, system.member)):
        for (a, b), (aa, ab, ba, bb) in zip(pairs.tolist(), places.tolist(), strict=True):
            slots.update({aa: (a, a), ab: (a, b), ba: (b, a), bb: (b, b)})
    for j, ((a, b), (aj, ja, bj, jb, jj)) in enumerate(
        zip(assembly.constraints.nodes.tolist(), system.joint.tolist(), strict=True)
    ):
        slots.update({aj: (a, n + j), ja: (n + j, a), bj: (b, n + j), jb: (n + j, b), jj: (n + j, n + j)})
    slots.pop(-1, None)
    place = np.array(list(slots), dtype=np.int64)
    of = np.array(list(slots.values()), dtype=np.int64).reshape(-1, 2)
    row = np.repeat(index[of[:, 0]], 6, axis=1).ravel()
    column = np.tile(index[of[:, 1]], (1, 6)).ravel()
    source = (36 * place[:, None] + np.arange(36)).ravel()
    if joints:
        ends = assembly.constraints.nodes
        both = np.where(ends[:, :, None] >= 0, index[ends], -1).reshape(joints, 12)
        row = np.concatenate([row, np.repeat(both, 12, axis=1).ravel()])
        column = np.concatenate([column, np.tile(both, (1, 12)).ravel()])
        source = np.concatenate([source, 36 * system.n_blocks + np.arange(144 * joints)])
    keep = (row >= 0) & (column >= 0)
    row, column, source = row[keep], column[keep], source[keep]
    is_joint = np.zeros(size, dtype=bool)
    numbers = index[n:]
    is_joint[numbers[numbers >= 0]] = True
    key, entry = np.unique(column * size + row, return_inverse=True)
    starts = np.searchsorted(key, size * np.arange(size + 1))
    # joints' columns change their sign with the unknown
    sign = np.where(is_joint[column] & ~is_joint[row], -1.0, 1.0)
    return Pattern(index, is_joint, source, entry.reshape(-1), sign, key % max(size, 1), starts, joints)


class Factors:
    """LU factors of a scaled matrix from `Pattern.matrix`, with `joint` (size,) telling which unknowns are multipliers.

    Raises `SingularError` where there are none.
    """

    def __init__(self, matrix: csc_matrix, joint: NDArray[np.bool_]) -> None:
        if len(joint) == 0:
            self._scale = np.ones(0)
            return
        scaled, self._scale = _scaled(matrix, joint)
        self._exact = scaled if joint.any() else None
        if joint.any():
            scaled = (scaled - diags_array(_COMPLIANCE * joint)).tocsc()
            scaled.sort_indices()
        try:
            self._lu = splu(scaled, permc_spec="NATURAL", diag_pivot_thresh=0.1)
        except RuntimeError:
            raise SingularError from None

    def solve(self, b: Array) -> Array:
        """Solution for right-hand sides (size,) or (size, k)."""
        if len(self._scale) == 0:
            return b.copy()
        scale = self._scale if b.ndim == 1 else self._scale[:, None]
        x = self._lu.solve(np.ascontiguousarray(scale * b))
        if self._exact is not None:
            # once more, without the joints' compliance
            x += self._lu.solve(np.ascontiguousarray(scale * b - self._exact @ x))
        x = scale * x
        if not np.isfinite(x).all():
            raise SingularError
        return x


def negative_motions(matrix: csc_matrix, joint: NDArray[np.bool_]) -> int:
    """Number of independent motions, among those that joints allow, along which a symmetric stiffness is negative.

    By the signs of the pivots of ``K + w G^T G``, which is positive exactly where K is on the joints' motions once the
    weight w exceeds what is negative in K. Motions that cost nothing are not counted.
    """
    if joint.all():
        return 0
    scaled, _ = _scaled(matrix, joint)
    G = scaled[joint][:, ~joint]
    K = (scaled[~joint][:, ~joint] + _WEIGHT * (G.T @ G) + _NEUTRAL * eye_array(G.shape[1])).tocsc()
    try:
        lu = splu(K, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        raise SingularError from None
    return int(np.count_nonzero(lu.U.diagonal() < 0.0))


def _scaled(matrix: csc_matrix, joint: NDArray[np.bool_]) -> tuple[csc_matrix, Array]:
    """The matrix with rows and columns scaled alike, to units on the diagonal and in joints' rows, and the scales."""
    size = len(joint)
    if not np.isfinite(matrix.data).all():
        raise SingularError
    nodes = np.abs(matrix.diagonal())[~joint]
    top = float(nodes.max(initial=0.0))
    scale = np.ones(size)
    # parts without any stiffness of their own are scaled as the stiffest
    scale[~joint] = 1.0 / np.sqrt(np.where(nodes > 1e-14 * top, nodes, top if top > 0.0 else 1.0))
    columns = np.repeat(np.arange(size), np.diff(matrix.indptr))
    data = matrix.data * scale[matrix.indices] * scale[columns]
    across = joint[matrix.indices] & ~joint[columns]
    rows = np.sqrt(np.bincount(matrix.indices[across], data[across] ** 2, minlength=size))
    scale[joint] = 1.0 / np.where(rows[joint] > 0.0, rows[joint], 1.0)
    data = matrix.data * scale[matrix.indices] * scale[columns]
    return csc_matrix((data, matrix.indices, matrix.indptr), shape=(size, size)), scale
