"""Forces out of balance, and the tangent, of an assembly at given positions, directors, multipliers and loads."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.rod.arrays import Assembly
from fem_biobot.rod.assembly import kernels
from fem_biobot.rod.element.kernels import add_forces
from fem_biobot.rod.joint_stiffness import joint_stiffness
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.parts.kernels import add_gravity, add_loads
from fem_biobot.rod.rotation.kernels import turn

Array = NDArray[np.float64]

# an element that turns by more has no unique strain soon
LARGEST_TURN = 3.0
_EPS = float(np.finfo(float).eps)


class StepFailedError(Exception):
    """The step did not converge; says why in the words of the message."""


@dataclass(frozen=True, eq=False)
class Point:
    """Positions (n, 3), directors (n, 3, 3), and the joints' multipliers (j, 6)."""

    x: Array
    Q: Array
    multiplier: Array

    def moved(self, step: Array, change: Array) -> Point:
        """After increments of the nodes (n, 6), spatial, and of the multipliers (j, 6)."""
        Q = np.empty_like(self.Q)
        turn(self.Q, np.ascontiguousarray(step[:, 3:]), Q)
        return Point(self.x + step[:, :3], Q, self.multiplier + change)


@dataclass(frozen=True, eq=False)
class Conditions:
    """What acts: factors of the point loads (l,) and of gravity, and what drive adds to members' tension (k,) [mN]."""

    assembly: Assembly
    load_factor: Array
    gravity_factor: float
    pull: Array
    extent: float

    def everywhere_free(self) -> Conditions:
        """The same with no node held, to see what supports bear."""
        inertia = self.assembly.inertia
        free = inertia._replace(held=np.zeros_like(inertia.held))
        return replace(self, assembly=self.assembly._replace(inertia=free))


@dataclass(frozen=True, eq=False)
class Forces:
    """What acts at a point.

    Attributes
    ----------
    s, tension, lengths
        Resultants (m, 6), members' tensile forces (k,) and lengths (k,).
    force, value
        Sum of all forces on the nodes (n, 6) and the joints' gaps (j, 6).
    scale, floor
        Largest force that acts, and what rounding leaves of it in `force`; moments count by the model's extent [mN].
    """

    s: Array
    tension: Array
    lengths: Array
    force: Array
    value: Array
    scale: float
    floor: float


def conditions(model: RodModel, load: float, tension: float, drive: float, time: float) -> Conditions:
    """What acts on a model at factors of loads and tension; supports that loading moves are where `load` has them."""
    assembly = model.assembly
    if assembly.drag.velocity.any():
        raise ModelError("drag: velocity: found a medium that moves, expected one at rest outside `dynamics`")
    C = assembly.constraints
    if any(m.constraint >= 0 for m in model.built.moved):
        offset, frame = C.offset.copy(), C.frame.copy()
        for m in model.built.moved:
            if m.constraint >= 0:
                offset[m.constraint, 1] = m.place + load * np.array(m.hold.displacement)
                frame[m.constraint, 1] = turned(np.eye(3), load * np.array(m.hold.turn))
        assembly = assembly._replace(constraints=C._replace(offset=offset, frame=frame))
    points = np.concatenate([model.atlas.centre, *model.atlas.drawn.values()])
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    inertia = np.sqrt(max((np.trace(J) for J in assembly.inertia.J), default=0.0))
    mass = float(assembly.inertia.mass.max())
    if extent == 0.0:  # a single body: its radius of gyration
        extent = float(inertia / np.sqrt(mass)) if mass > 0.0 else 1.0
    active = assembly.activation
    assembly = assembly._replace(activation=active._replace(standing=tension * active.standing))
    pull = tension * (model.pull(drive) - model.pull(0.0))
    return Conditions(assembly, load * model.load_factors(time), load, pull, extent)


def of_state(state: RodState) -> tuple[Conditions, Point]:
    """What acted on a state, and where it is."""
    given = conditions(state.model, state.load, state.tension, state.drive, state.time)
    joints = len(given.assembly.constraints.rows)
    multiplier = state.multiplier if len(state.multiplier) == joints else np.zeros((joints, 6))
    return given, Point(state.x, state.Q, multiplier)


def turned(Q: Array, vector: Array) -> Array:
    """Directors (3, 3) turned by a spatial rotation vector."""
    out = np.empty((1, 3, 3))
    turn(np.ascontiguousarray(Q[None]), np.ascontiguousarray(vector[None]), out)
    return out[0]


def out_of_balance(model: RodModel, given: Conditions, at: Point) -> Forces:
    """Forces at a point; raises `StepFailedError` where an element is wound up or a number is lost."""
    A = given.assembly
    n, m, k, j = len(at.x), len(A.damping), len(A.members.law), len(A.constraints.rows)
    strain, s = np.zeros((m, 6)), np.zeros((m, 6))
    lengths, tension, active, slopes = np.zeros(k), np.zeros(k), np.zeros(k), np.zeros((k, 2))
    largest = kernels.measure(A, at.x, at.Q, strain, lengths)
    if not largest <= LARGEST_TURN:
        raise StepFailedError(f"an element turns by more than {LARGEST_TURN:g} rad between its ends; take a finer rod")
    kernels.resultants(A, strain, strain, 1.0, 0.0, s)
    kernels.tensions(A.members, A.activation, lengths, lengths, 1.0, 0.0, given.pull, tension, active, slopes)
    force, value, outside = np.zeros((n, 6)), np.zeros((j, 6)), np.zeros((n, 6))
    kernels.add_all_forces(A, at.x, at.Q, s, tension, given.load_factor, given.gravity_factor, force)
    held = A.inertia.held
    kernels.joint_gaps(A.constraints, held, at.x, at.Q, np.zeros((n, 6)), value, np.zeros((j, 6)))
    kernels.add_joint_forces(A.constraints, held, at.x, at.Q, at.multiplier, force)
    add_loads(A.loads, given.load_factor, at.Q, outside)
    add_gravity(A.inertia, A.gravity, given.gravity_factor, outside)
    if not (np.isfinite(force).all() and np.isfinite(value).all()):
        raise StepFailedError("the forces are not numbers (a member of no length?)")
    weights = np.array([1.0, 1.0, 1.0, *[1.0 / given.extent] * 3])
    sizes = (np.abs(a * weights).max(initial=0.0) for a in (s, outside, at.multiplier))
    scale = max(float(np.abs(tension).max(initial=0.0)), *map(float, sizes))
    far = 1.0 + np.abs(at.x).max() / A.elements.length if m else np.ones(0)
    C = A.elements.stiffness
    soft = (
        C[:, :3].max(axis=1, initial=0.0) * far + C[:, 3:].max(axis=1, initial=0.0) / A.elements.length / given.extent
    )
    reach = 1.0 + np.abs(at.x).max() / np.maximum(lengths, 1e-300)
    springs = np.where(A.members.law == 0, A.members.stiffness * lengths, A.members.stiffness)
    floor = 8.0 * _EPS * max(float(soft.max(initial=0.0)), float((springs * reach).max(initial=0.0)), scale)
    return Forces(s, tension, lengths, force, value, scale, floor)


def tangent(
    model: RodModel, given: Conditions, at: Point, s: Array, tension: Array, lengths: Array
) -> tuple[Array, Array]:
    """Blocks of the tangent (b, 6, 6) with the joints' rows, and the joints' geometric stiffness (j, 12, 12).

    `s` (m, 6) and `tension` (k,) are the forces of the geometric parts.
    """
    A, system = given.assembly, model.system
    blocks = np.zeros((system.n_blocks, 6, 6))
    k = len(lengths)
    slopes, ones = np.zeros((k, 2)), np.ones(len(A.damping))
    kernels.tensions(A.members, A.activation, lengths, lengths, 1.0, 0.0, given.pull, np.zeros(k), np.zeros(k), slopes)
    kernels.add_stiffness(
        A, system, at.x, at.Q, s, ones, tension, slopes, lengths, 1.0, 0.0, given.load_factor, 1.0, blocks
    )
    kernels.joint_blocks(A.constraints, A.inertia.held, system.joint, at.x, at.Q, 0.0, blocks)
    return blocks, joint_stiffness(A.constraints, at.Q, at.multiplier)


def strain_change(given: Conditions, at: Point, step: Array) -> Array:
    """Linear change of the elements' strains with increments of the nodes (n, 6), (m, 6).

    Read off the forces that unit resultants exert: they are the transpose of the strains' derivative.
    """
    E = given.assembly.elements
    m = len(E.length)
    apart = E._replace(nodes=np.arange(2 * m, dtype=np.int64).reshape(m, 2))
    flat = E.nodes.ravel()
    x, Q, move = at.x[flat], np.ascontiguousarray(at.Q[flat]), step[flat]
    out = np.empty((m, 6))
    for i in range(6):
        s, force = np.zeros((m, 6)), np.zeros((2 * m, 6))
        s[:, i] = 1.0
        add_forces(apart, x, Q, s, force)
        out[:, i] = (force * move).sum(axis=1).reshape(m, 2).sum(axis=1) / E.length
    return out
