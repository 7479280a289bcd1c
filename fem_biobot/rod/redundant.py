"""Joints that say the same thing twice: which rows, and the compliance that lets time steps bear them.

A closed ring of rigid parts often has more rows than motions to hold: a plane four-bar linkage of hinges has three too
many. Their multipliers are then not unique, though the motion is, and the matrix of a step is singular. Worse, a ring
that moves by its proportions alone (Bennett's) is locked as soon as it is ever so little off them, as it is by the gaps
of third order that a step leaves. The rows concerned are therefore held by a stiff dashpot: their velocity of closing
may miss by a compliance times their impulse. The gap that stays is ``1e-4 h^2 a`` for a joint that holds back the
acceleration a of its parts, second order in the step h.

Statics bears such rings by itself, see `rod.sparse`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.arrays import Constraints, Inertia
from fem_biobot.rod.parts.kernels import constraint

Array = NDArray[np.float64]

# against the mobility of a row's parts; below 1e-6 rings in space lock
_SOFT = 1e-4
# singular value of the scaled rows, over the largest, below which rows depend on each other
_DEPENDENT = 1e-9


def softness(constraints: Constraints, inertia: Inertia, x: Array) -> Constraints:
    """The constraints with the compliances (j, 6) of rows that depend on each other as drawn, zero for all others.

    Velocity by impulse [1/kg, 1/(kg mm^2)]: a ten-thousandth of what the row's parts have alone.
    """
    if not _looped(constraints, inertia):
        return constraints
    n = len(x)
    mobility = np.zeros((n, 6, 6))
    total, largest = max(float(inertia.mass.sum()), 1e-300), max(float(np.abs(inertia.J).max()), 1e-300)
    for i in np.flatnonzero(inertia.held == 0):
        # a part without mass moves at least as easily as everything together
        moments, axes = np.linalg.eigh(inertia.J[i])
        mobility[i, :3, :3] = np.eye(3) / (inertia.mass[i] or total)
        mobility[i, 3:, 3:] = axes @ np.diag(1.0 / np.where(moments > 0.0, moments, largest)) @ axes.T
    frames, value, block = np.tile(np.eye(3), (n, 1, 1)), np.zeros(6), np.zeros((6, 12))
    places = [(j, int(r)) for j in range(len(constraints.rows)) for r in np.flatnonzero(constraints.rows[j])]
    rows = np.zeros((len(places), n, 6))
    for j, pair in enumerate(constraints.nodes):
        constraint(constraints, j, x, frames, value, block)
        for number, (at, r) in enumerate(places):
            if at == j:
                for end, i in enumerate(pair):
                    if i >= 0:
                        rows[number, i] += block[r, 6 * end : 6 * end + 6]
    alone = np.einsum("pia,iab,pib->p", rows, mobility, rows)
    roots = np.array([np.linalg.cholesky(m) if m.any() else m for m in mobility])
    size = np.sqrt(np.where(alone > 0.0, alone, 1.0))
    scaled = np.einsum("pia,iab->pib", rows, roots).reshape(len(places), -1) / size[:, None]
    left, values, _ = np.linalg.svd(scaled, full_matrices=True)
    rank = int((values > _DEPENDENT * values.max(initial=0.0)).sum())
    concerned = np.abs(left[:, rank:]).max(axis=1, initial=0.0) > 1e-6
    soft = np.zeros((len(constraints.rows), 6))
    for (j, r), mobile, shared in zip(places, alone, concerned, strict=True):
        if shared:
            soft[j, r] = _SOFT * (mobile if mobile > 0.0 else 1.0 / total)
    return constraints._replace(soft=soft)


def _looped(constraints: Constraints, inertia: Inertia) -> bool:
    """Whether joints lead back to where they began; held nodes are the world. Without a loop no row is redundant."""
    world = len(inertia.mass)
    root = list(range(world + 1))

    def find(i: int) -> int:
        while root[i] != i:
            i = root[i]
        return i

    for pair in constraints.nodes:
        a, b = (find(world if i < 0 or inertia.held[i] == 1 else int(i)) for i in pair)
        if a == b:
            return True
        root[a] = b
    return False
