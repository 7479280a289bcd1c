"""Which blocks an assembly's tangent has and where each part's contributions go, made once a model."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.arrays import Assembly, Contacts
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
        Nodes that can come into contact, with the ground or each other, (f,).
    number
        Number of each node among those, -1 for others, (n,).
    foot
        Number of each contact point's node among those, (c,); the ground's alone.
    """

    plan: Plan
    n_blocks: int
    element: Ints
    member: Ints
    joint: Ints
    touching: Ints
    number: Ints
    foot: Ints


def system(assembly: Assembly) -> System:
    """Plan of an assembly's block system."""
    n = len(assembly.inertia.mass)
    joints = [(int(a), int(b), n + j) for j, (a, b) in enumerate(assembly.constraints.nodes)]
    pairs = [(int(a), int(b)) for a, b in [*assembly.elements.nodes, *assembly.members.nodes] if a >= 0 and b >= 0]
    pairs += [(end, j) for a, b, j in joints for end in (a, b) if end >= 0]
    touching, number = _touching(assembly)
    made, place, count = plan(n + len(joints), pairs, [j for *_, j in joints], touching.tolist())

    def slot(i: int, j: int) -> int:
        return place[i, j] if i >= 0 and j >= 0 else -1

    def four(nodes: Ints) -> Ints:
        rows = [[slot(i, j) for i in pair for j in pair] for pair in nodes.tolist()]
        return np.array(rows, dtype=np.int64).reshape(len(nodes), 4)

    rows = [[slot(a, j), slot(j, a), slot(b, j), slot(j, b), slot(j, j)] for a, b, j in joints]
    return System(
        made,
        count,
        four(assembly.elements.nodes),
        four(assembly.members.nodes),
        np.array(rows, dtype=np.int64).reshape(len(joints), 5),
        touching,
        number,
        number[assembly.contacts.node],
    )


def _touching(assembly: Assembly) -> tuple[Ints, Ints]:
    """Nodes that can come into contact, and the number of every node among them or -1."""
    touches = assembly.touches
    touching = np.unique(np.concatenate([assembly.contacts.node, touches.node, touches.chain_node.ravel()]))
    number = np.full(len(assembly.inertia.mass), -1, dtype=np.int64)
    number[touching] = np.arange(len(touching))
    return touching.astype(np.int64), number


def without_ground(assembly: Assembly, found: System) -> tuple[Assembly, System]:
    """The same assembly where nothing stops contact points."""
    none: list[Any] = [np.ascontiguousarray(a[:0]) for a in assembly.contacts]
    assembly = assembly._replace(contacts=Contacts(*none))
    touching, number = _touching(assembly)
    return assembly, found._replace(touching=touching, number=number, foot=found.foot[:0].copy())
