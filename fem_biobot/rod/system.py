"""Which blocks an assembly's tangent has and where each part's contributions go, made once a model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.arrays import Assembly
from fem_biobot.rod.blocks.plan import Plan, plan

Ints = NDArray[np.int64]


class System(NamedTuple):
    """Block system of the nodes (first) and the joints (after them).

    Attributes
    ----------
    plan
        How it is eliminated.
    n_blocks
        Blocks with fill-in.
    element, member
        Blocks (aa, ab, ba, bb) of each element (m, 4) and member (k, 4); -1 where an end is the world.
    joint
        Blocks (a, joint), (joint, a), (b, joint), (joint, b), (joint, joint), (j, 5); -1 for the world.
    touching
        Nodes that carry contact points, (f,), and for each contact point its number among them, (c,).
    """

    plan: Plan
    n_blocks: int
    element: Ints
    member: Ints
    joint: Ints
    touching: Ints
    foot: Ints


def system(assembly: Assembly) -> System:
    """Plan of an assembly's block system."""
    n = len(assembly.inertia.mass)
    joints = [(int(a), int(b), n + j) for j, (a, b) in enumerate(assembly.constraints.nodes)]
    pairs = [(int(a), int(b)) for a, b in [*assembly.elements.nodes, *assembly.members.nodes] if a >= 0 and b >= 0]
    pairs += [(end, j) for a, b, j in joints for end in (a, b) if end >= 0]
    made, place, count = plan(n + len(joints), pairs, [j for *_, j in joints])

    def slot(i: int, j: int) -> int:
        return place[i, j] if i >= 0 and j >= 0 else -1

    def four(nodes: Ints) -> Ints:
        rows = [[slot(i, j) for i in pair for j in pair] for pair in nodes.tolist()]
        return np.array(rows, dtype=np.int64).reshape(len(nodes), 4)

    rows = [[slot(a, j), slot(j, a), slot(b, j), slot(j, b), slot(j, j)] for a, b, j in joints]
    touching, foot = np.unique(assembly.contacts.node, return_inverse=True)
    return System(
        made,
        count,
        four(assembly.elements.nodes),
        four(assembly.members.nodes),
        np.array(rows, dtype=np.int64).reshape(len(joints), 5),
        touching.astype(np.int64),
        foot.astype(np.int64).reshape(-1),
    )
