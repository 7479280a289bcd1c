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
        Of the ground on each contact point in the last step: normal and two tangential, (c, 3) [mN s].
    touch
        Of the points: lifted, sticking or slipping as in `rod.contact.kernels`, (c,).
    slide
        Tangential velocity of the points that slip, (c, 2) [mm/s].
    joint
        Impulses of the joints in the last step, (j, 6).
    strain, lengths
        Element strains (m, 6) and member lengths (k,).
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
    """The ground: normal and tangents (rows, 3, 3), height [mm], velocity (3,), coefficients of each point against slip
    along +t1, -t1, +t2, -t2 while it sticks and while it slips, (c, 4)."""

    axes: Array
    height: float
    velocity: Array
    static: Array
    kinetic: Array


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
    rows: Array  # (c, 3, 6) velocities of the contact points by those of their nodes, at the end
    push: Array  # (c, 3, 6) the same at theta, where impulses act
    p: Array  # (c, 3)
    w: Array  # (c, 3)
    b: Array  # (c, 3)
    touch: Ints
    W: Array  # (3 c, 3 c)
    compliance: Array  # (6 f, 6 f) of the nodes that touch
    response: Array  # (6 f, 3 c)


def copied(state: State) -> State:
    """A state of its own."""
    arrays: list[Any] = [np.array(a) for a in state]
    return State(*arrays)


def work_for(state: State, n_blocks: int, n_touching: int) -> Work:
    """Room for the steps of an assembly in the given state."""
    n, c, j, m, k = (len(a) for a in (state.x, state.impulse, state.joint, state.strain, state.lengths))
    f = 6 * n_touching
    node, vector = (n, 6), (n + j, 6)
    shapes: list[Any] = [
        *(np.zeros(s) for s in ((n, 3), (n, 3, 3), (n, 3), (n, 3, 3), node, node, (n, 3))),
        *(np.zeros(s) for s in ((m, 6), (k,), (m, 6), (m,), (k,), node, node, (n, 3), (n, 3), vector, vector, vector)),
        *(np.zeros(s) for s in ((n_blocks, 6, 6), (j, 6), (j, 6), (j, 6), (c,), (c, 3, 6), (c, 3, 6), (c, 3), (c, 3))),
        np.zeros((c, 3)),
        np.zeros(c, dtype=np.int64),
        *(np.zeros(s) for s in ((3 * c, 3 * c), (f, f), (f, 3 * c))),
    ]
    return Work(*shapes)
