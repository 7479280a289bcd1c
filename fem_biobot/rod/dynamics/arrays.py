"""Arrays that a time integrator reads and writes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class State(NamedTuple):
    """Where an assembly is and how it moves; written by the integrators.

    Attributes
    ----------
    x, Q
        Positions (n, 3) [mm] and directors (rows, n, 3, 3) [1] of the nodes.
    v
        Velocity and angular velocity in world axes, (n, 6) [mm/s, rad/s].
    change
        Change of `v` in the last step, per time, from which the next is guessed, (n, 6).
    impulse
        Of each contact in the last step: normal and two tangential, (c, 3) [mN s]. The ground's contact points come
        first, then the nodes that touch other parts.
    touch
        Of the points: lifted, sticking or slipping as in `friction.kernels`, (c,).
    slide
        Tangential velocity of the points that slip, (c, 2) [mm/s].
    joint
        Impulses of the joints in the last step, (j, 6).
    strain, lengths
        Element strains (m, 6) and member lengths (k,).
    alert
        Steps to come that are divided because contact has changed, (1,); where the step adapts the level of its parts
        and how many of them there are since a change, see `rod.dynamics.adaptive.kernels`.
    length
        Of the last step or part of one, (1,) [s]; 0 before any.
    """

    x: Array
    Q: Array
    v: Array
    change: Array
    impulse: Array
    touch: Ints
    slide: Array
    joint: Array
    strain: Array
    lengths: Array
    alert: Ints
    length: Array


# entries of the energy book, in this order [uJ]; the first three are states, the others sums over time
BOOK = (
    "kinetic",
    "elastic",
    "weight",
    "muscle",
    "loads",
    "damping",
    "friction",
    "normal",
    "joints",
    "integrator",
    "drag",
)


class Plane(NamedTuple):
    """The ground: normal and tangents (rows, 3, 3), height [mm], velocity (3,), coefficients of each contact against
    slip along +t1, -t1, +t2, -t2 while it sticks and while it slips, (c, 4)."""

    axes: Array
    height: float
    velocity: Array
    static: Array
    kinetic: Array


class Near(NamedTuple):
    """The contact problem: those contacts that are near enough to matter, in front of arrays for all of them.

    `order` (c,) are their numbers, `number` (1,) how many; `W` (9 c^2,) velocity by impulse; the others as in
    `friction.kernels.solve_friction`.
    """

    order: Ints
    number: Ints
    W: Array
    b: Array
    p: Array
    w: Array
    static: Array
    kinetic: Array
    touch: Ints
    slide: Array


class Work(NamedTuple):
    """Room for a step: its end, what led there, and scratch. Shapes as in `State` and `System`."""

    x1: Array
    Q1: Array
    xm: Array
    Qm: Array
    v1: Array
    vm: Array
    angle: Array  # (n, 3) rotation vectors
    strain: Array
    lengths: Array
    s: Array  # (m, 6) resultants
    gain: Array  # (m,) factor on stiffness by damping
    tension: Array  # (k,)
    active: Array  # (k,) part of it that muscles add to their passive resistance
    slopes: Array  # (k, 2) of that by length and by rate of length
    force: Array  # (n, 6)
    drag: Array  # (n, 6)
    spin: Array  # (n, 3) angular momenta at the end, and at the beginning
    spin0: Array
    rhs: Array  # (n + j, 6)
    free: Array  # (n + j, 6)
    column: Array  # (n + j, 6)
    blocks: Array  # (t, 6, 6)
    joint1: Array  # (j, 6)
    joint_gap: Array
    joint_rate: Array
    gap: Array  # (c,)
    rows: Array  # (c, 3, e, 6) velocities of the contacts by those of e nodes, at the end
    ends: Ints  # (c, e) those nodes, or -1
    push: Array  # (c, 3, e, 6) the same at theta, where impulses act
    push_ends: Ints
    p: Array  # (c, 3)
    touch: Ints  # (c,)
    operator: Array  # (3, 3), an example of the operator that the contact solver takes
    near: Near
    settled: Ints  # (c,) lifted, sticking or slipping at the end, and how it slides (c, 2)
    slid: Array
    kept: State  # where a step that is divided began, and its sums
    kept_book: Array
    kept_tally: Array
    compliance: Array  # (6 f, 6 f) of the nodes that can come into contact; a row is what a unit there does to all
    response: Array  # (3, 6 f)


def copied(state: State) -> State:
    """A state of its own."""
    arrays: list[Any] = [np.array(a) for a in state]
    return State(*arrays)


def work_for(state: State, n_blocks: int, n_touching: int, n_touches: int) -> Work:
    """Room for the steps of an assembly in the given state."""
    n, c, j, m, k = (len(a) for a in (state.x, state.impulse, state.joint, state.strain, state.lengths))
    f, e = 6 * n_touching, 3 if n_touches else 1
    node, vector, vectors = (n, 6), (n + j, 6), (c, 3)

    def rows() -> tuple[Array, Ints]:
        return np.zeros((c, 3, e, 6)), np.full((c, e), -1, dtype=np.int64)

    def whole(*shape: int) -> Ints:
        return np.zeros(shape, dtype=np.int64)

    b, p, w = (np.zeros(vectors) for _ in range(3))
    near = Near(
        whole(c), whole(1), np.zeros(9 * c * c), b, p, w, np.zeros((c, 4)), np.zeros((c, 4)), whole(c), np.zeros((c, 2))
    )
    shapes: list[Any] = [
        *(np.zeros(s) for s in ((n, 3), (n, 3, 3), (n, 3), (n, 3, 3), node, node, (n, 3))),
        *(np.zeros(s) for s in ((m, 6), (k,), (m, 6), (m,), (k,), (k,), (k, 2), node, node, (n, 3), (n, 3))),
        *(np.zeros(s) for s in (vector, vector, vector, (n_blocks, 6, 6), (j, 6), (j, 6), (j, 6), (c,))),
        *(a for _ in range(2) for a in rows()),
        np.zeros(vectors),
        whole(c),
        np.zeros((3, 3)),
        near,
        whole(c),
        np.zeros((c, 2)),
        copied(state),
        np.zeros(len(BOOK)),
        np.zeros((c, 5)),
        np.zeros((f, f)),
        np.zeros((3, f)),
    ]
    return Work(*shapes)
