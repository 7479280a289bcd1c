"""Rest of a machine: the shape its muscles bend it to when it floats, and how it stands when put on the ground.

A drawing has straight beams and soles at different heights; a machine that walks begins bent by its standing tension,
on its feet. The shape is static; how it stands is found by damped motion, since feet that stick leave more than one
answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.rod.build import Member
from fem_biobot.rod.dynamics.integrate import Checkpoint, dynamics
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Gravity
from fem_biobot.rod.statics import statics

Array = NDArray[np.float64]

_SETTLE_STEP, _SETTLE_SLICE, _SETTLE_DAMPING = 2e-3, 0.1, 5e-3
_LONGEST_SETTLING = 20.0  # s
# energy of motion relative to the weight's work over a micrometre, below which a machine stands
_STILL = 1e-9


def floating(model: RodModel, *, drive: float = 0.0, members: Sequence[Member] | None = None) -> RodState:
    """Shape that the machine takes when it floats free: static equilibrium without weight and ground.

    Parameters
    ----------
    model
        A machine.
    drive
        Of its muscles [1]; with 0 their standing tension acts alone.
    members
        In place of the model's.

    Returns
    -------
    RodState
        Centre of mass and mean orientation as drawn; of a model of its own, with the nodes of `model`.

    Raises
    ------
    SolveError
        A shape that is not found: muscles too strong for the beam.
    """
    weightless = [load for load in model.loads if not isinstance(load, Gravity)]
    pulling = model.members if members is None else members
    free = RodModel(model.rods, model.joints, model.bodies, model.supports, weightless, pulling)
    shape = statics(free, [1.0], drive=drive, free="hold").last
    # the mean turn of the parts, by polar decomposition, is taken back
    mass = free.assembly.inertia.mass
    U, _, V = np.linalg.svd(np.einsum("n,nij->ij", mass, shape.Q))
    turn = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    return replace(shape, x=(shape.x - shape.centre_of_mass) @ turn.T + free.drawn().centre_of_mass, Q=shape.Q @ turn.T)


@dataclass(frozen=True, eq=False)
class Stance:
    """A machine standing on the ground with its standing tension.

    Attributes
    ----------
    state
        At rest, of the machine's own model.
    time
        That settling took, in a motion with more damping than the machine's own [s].
    kinetic_energy
        Left when it was called still [uJ].
    tilt
        About the lateral axis, from the floating shape to the standing one as it was put down [rad].
    """

    state: RodState
    time: float
    kinetic_energy: float
    tilt: float


def contact_positions(model: RodModel, x: Array, Q: Array) -> Array:
    """Positions of the contact points, (..., c, 3) [mm], for nodes (..., n, 3) and directors (..., n, 3, 3)."""
    contacts = model.assembly.contacts
    return x[..., contacts.node, :] + np.einsum("...cji,cj->...ci", Q[..., contacts.node, :, :], contacts.offset)


def _refuse_footless(model: RodModel) -> None:
    if not model.contacts:
        raise ModelError("model: found no contact points, expected feet for a walk (contacts=[ContactPoints(...)])")


def placed(model: RodModel, shape: RodState, ground: Ground) -> tuple[RodState, float]:
    """A shape turned about the lateral axis and lowered until feet on both sides of its weight touch the ground.

    Returns the state, at rest, and the angle [rad]. The centre of mass keeps its place along the ground. Points of the
    feet are taken as sharp; the plane's tilt is left to the settling.
    """
    _refuse_footless(model)
    points = contact_positions(model, shape.x, shape.Q)
    radius = model.assembly.contacts.radius
    mass = model.assembly.inertia.mass
    centre = mass @ shape.x / mass.sum()
    tilt = _support_angle(points - centre)
    c, s = np.cos(tilt), np.sin(tilt)
    turn = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    x = (shape.x - centre) @ turn.T
    Q = shape.Q @ turn.T
    normal = ground.axes[0]
    heights = contact_positions(model, x, Q) @ normal - radius
    # along the plane the centre of mass stays where it was drawn
    lift = ground.height - heights.min()
    drawn = mass @ model.built.x / mass.sum()
    across = drawn - normal * (drawn @ normal)
    return RodState(model, x + across + lift * normal, Q), float(tilt)


def _support_angle(points: Array) -> float:
    """Turn about y with which the lowest points on both sides of the centre of mass, at the origin, are level [rad].

    Of all pairs of a point behind and a point before it, the lowest line under the origin carries it.
    """
    behind, before = points[points[:, 0] < 0.0], points[points[:, 0] > 0.0]
    if not len(behind) or not len(before):
        return 0.0
    dx = before[None, :, 0] - behind[:, None, 0]
    dz = before[None, :, 2] - behind[:, None, 2]
    height = behind[:, None, 2] - behind[:, None, 0] * dz / dx
    i, k = np.unravel_index(int(height.argmin()), height.shape)
    # a turn by `tilt` lowers points before the origin: z' = z cos - x sin
    return float(np.arctan2(dz[i, k], dx[i, k]))


def stance(model: RodModel, ground: Ground) -> Stance:
    """How a machine stands: its floating shape, put on the ground and left to settle with more damping than its own.

    A machine with touches has no floating shape, since statics does not know of them: it falls and settles as drawn.

    Raises
    ------
    ModelError
        A model without contact points.
    SolveError
        A machine that does not come to rest within 20 s, or falls; `best` is the last `RodState`.
    """
    _refuse_footless(model)
    if model.touches:
        start, tilt = model.drawn(), 0.0
    else:
        start, tilt = placed(model, floating(model), ground)
    heavy = _damped(model)
    weight = float(np.linalg.norm(model.assembly.gravity)) * model.mass
    still = _STILL * max(weight, 1e-12) * 1e-3
    slices, state = 0, start
    begin: RodState | Checkpoint = RodState(heavy, start.x, start.Q)
    while True:
        try:
            motion = dynamics(heavy, _SETTLE_SLICE, _SETTLE_STEP, ground=ground, start=begin)
        except SolveError as error:
            raise SolveError(f"stance: {error}", best=state, reason=error.reason) from None
        begin, state = motion.final, motion.state(-1)
        slices += 1
        time = slices * _SETTLE_SLICE
        energy = float(motion.energy("kinetic")[len(motion.times) // 2 :].max())
        if energy <= still:
            return Stance(RodState(model, state.x, state.Q), time, energy, tilt)
        if time >= _LONGEST_SETTLING or not np.isfinite(energy):
            raise SolveError(
                f"stance: after {time:g} s the machine still moves with {energy:.3g} uJ, expected it to stand",
                best=state,
                reason="the machine does not come to rest",
            )


def _damped(model: RodModel) -> RodModel:
    """The same machine with more damping, for settling alone."""
    rods = [
        replace(rod, damping_time=max(_SETTLE_DAMPING, rod.damping_time or model.damping_time)) for rod in model.rods
    ]
    parts = (model.joints, model.bodies, model.supports, model.loads, model.members, model.contacts)
    return RodModel(rods, *parts, touches=model.touches, landmarks=model.landmarks)
