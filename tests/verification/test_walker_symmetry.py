"""The walker under symmetries and on limiting grounds, beyond the rows of C6.

Problem: the reduced junction bot, submerged so that its feet slip, driven for ten strokes and more.
Answer: exact; equal pillars go nowhere, mirrored and turned machines walk mirrored and turned paths, ice moves
no centre of mass, anchored feet no machine, one-way feet advance by what they open (C6).
Measured: the path of the centre of mass, the advance per stroke, the contact points.
Tolerance: 1e-6 mm for paths, or the bound that the case itself gives; what Newton leaves is far below.
Cannot see: whether the law of friction or the masses are right.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from fem_biobot.friction.kernels import STICK
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Rigid
from fem_biobot.rod.reduce import ground_of
from fem_biobot.rod.rest import contact_positions, stance
from fem_biobot.rod.walk import walk
from fem_biobot.verification.walker import (
    AMPLITUDE,
    DURATION,
    FREQUENCY,
    anchored_walk,
    equal_walk,
    inner_edges,
    machine,
    one_way_walk,
    opening,
    submerged,
)

DRIVE: dict[str, Any] = {"frequency": FREQUENCY, "amplitude": AMPLITUDE, "duration": DURATION}


@cache
def plain() -> Walk:
    """Its walk on its own ground."""
    return walk(machine(), ground=ground_of(submerged()), **DRIVE)


def with_drawing(model: RodModel, M: np.ndarray) -> RodModel:
    """The model drawn after the linear map `M` of space, a rotation or reflection."""

    def moved(place: Any) -> Any:
        return (place[0], tuple(M @ np.array(place[1]))) if isinstance(place[1], tuple) else place

    return RodModel(
        [replace(rod, points=rod.points @ M.T, normal=tuple(M @ np.array(rod.normal))) for rod in model.rods],
        [Rigid(moved(joint.a), moved(joint.b)) for joint in model.joints],
        [replace(b, centre=tuple(M @ np.array(b.centre)), inertia=M @ b.inertia @ M.T) for b in model.bodies],
        loads=model.loads,
        members=[replace(muscle, a=moved(muscle.a), b=moved(muscle.b)) for muscle in model.members],
        contacts=[replace(group, points=group.points @ M.T) for group in model.contacts],
        damping_time=model.damping_time,
    )


def test_the_mirrored_machine_walks_the_mirrored_path() -> None:
    """With its pillars exchanged it makes the same steps the other way.

    Catches: a preferred direction in contact, friction, the muscle or the reduction.
    """
    M = np.diag([-1.0, 1.0, 1.0])
    walked = walk(with_drawing(machine(), M), ground=ground_of(submerged()), **DRIVE)
    assert np.abs(walked.position @ M - plain().position).max() < 1e-6
    assert np.abs(plain().advances).max() > 1e-3


@pytest.mark.parametrize("where", ["start", "drawing"])
def test_the_turned_machine_walks_the_turned_path(where: str) -> None:
    """Turned about the vertical, as it starts or as it is drawn, it walks the turned path; directions in the plane of
    isotropic friction do not matter.

    Catches: friction in a box instead of a circle, drawing axes used for present ones.
    """
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    ground, model = ground_of(submerged()), machine()
    still = stance(model, ground).state
    if where == "start":
        start = RodState(model, still.x @ R.T, still.Q @ R.T)
    else:
        model = with_drawing(model, R)
        # directors of the turned drawing are the identity there
        start = RodState(model, still.x @ R.T, np.array([R @ Q @ R.T for Q in still.Q]))
    walked = walk(model, ground=ground, start=start, **DRIVE)
    assert np.abs(walked.position - plain().position @ R.T).max() < 1e-6
    along = walk(model, ground=replace(ground, forward=tuple(R[:, 0])), start=start, **DRIVE)
    np.testing.assert_allclose(along.advances, plain().advances, atol=1e-6)


def test_ice_moves_no_centre_of_mass() -> None:
    """Without friction nothing pushes the machine along, however it works.

    Catches: momentum that the integrator loses or gains, a tangential part of the normal impulse.
    """
    walked = walk(machine(), ground=Ground(0.0, 0.0), **DRIVE)
    assert np.abs(walked.position[:, :2] - walked.position[0, :2]).max() < 1e-9
    assert walked.stroke_mm > 0.3


def test_renumbered_corners_change_nothing() -> None:
    """The order of the corners of a foot is no physics.

    Catches: a sweep over contact points that depends on their order and stops early.
    """
    model = machine()
    groups = [
        replace(g, points=g.points[order])
        for g, order in zip(model.contacts, ([3, 1, 0, 2], [1, 2, 3, 0]), strict=True)
    ]
    other = RodModel(model.rods, model.joints, model.bodies, (), model.loads, model.members, groups, model.damping_time)
    walked = walk(other, ground=ground_of(submerged()), **DRIVE)
    assert np.abs(walked.position - plain().position).max() < 1e-6


def test_equal_pillars_do_work() -> None:
    """The machine whose net step is none (a row of the table) slips and opens all the same.

    Catches: a symmetry of nothing.
    """
    assert equal_walk().slip_fraction_1 > 0.2
    assert equal_walk().stroke_mm > 0.3


def test_anchored_feet_stay_on_their_edges() -> None:
    """With friction that always holds, every corner that bears sticks, and stays where it is.

    Rest is demanded of velocities at the ends of steps: an edge about which its foot turns creeps by 1e-9 mm a stroke.
    Catches: creep of sticking points.
    """
    walked = anchored_walk()
    bears = walked.motion.contact_share[-1] > 0.0
    edges = contact_positions(machine(), walked.motion.x, walked.motion.Q)[:, bears]
    assert np.abs(edges - edges[0]).max() < 1e-7
    assert (walked.motion.touch[:, bears] == STICK).all()


def test_one_way_feet_never_go_back() -> None:
    """Feet that cannot slip back open by a third of a millimetre and more, and none of their edges ever returns.

    Catches: reverse friction against the wrong direction, an edge that slips back a little in every step.
    """
    walked = one_way_walk()
    assert opening(walked) > 0.3
    assert np.diff(inner_edges(walked), axis=0).min() > -1e-6
