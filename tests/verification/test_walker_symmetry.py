"""The walker under symmetries and on limiting grounds.

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

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.rod.contact.kernels import STICK
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Rigid
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.rest import contact_positions, stance
from fem_biobot.rod.walk import walk

DRIVE: dict[str, Any] = {"frequency": 2.0, "amplitude": 1.2, "duration": 5.0}


@cache
def wet() -> Design:
    """The junction bot under water."""
    return load_design("junction_bot").with_values({"ground.immersion": "submerged"})


@cache
def machine() -> RodModel:
    """Its model."""
    return reduce(wet())


@cache
def plain() -> Walk:
    """Its walk on its own ground."""
    return walk(machine(), ground=ground_of(wet()), **DRIVE)


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


def test_equal_pillars_go_nowhere() -> None:
    """A machine that is its own mirror image has no net step, though its feet slip half of the time.

    Catches: a contact point or mass on one side only, an order of contacts that favours one foot.
    """
    heights = {"skeleton.short_pillar_height": 3.1, "skeleton.long_pillar_height": 3.1}
    walked = walk(wet().with_values(heights), **DRIVE)
    assert np.abs(walked.advances).max() < 1e-9
    assert walked.slip_fraction_1 > 0.2
    assert walked.stroke_mm > 0.3


def test_the_mirrored_machine_walks_the_mirrored_path() -> None:
    """With its pillars exchanged it makes the same steps the other way.

    Catches: a preferred direction in contact, friction, the muscle or the reduction.
    """
    M = np.diag([-1.0, 1.0, 1.0])
    walked = walk(with_drawing(machine(), M), ground=ground_of(wet()), **DRIVE)
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
    ground, model = ground_of(wet()), machine()
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
    walked = walk(other, ground=ground_of(wet()), **DRIVE)
    assert np.abs(walked.position - plain().position).max() < 1e-6


def test_anchored_feet_go_nowhere() -> None:
    """With friction that always holds (C6), the feet's edges stay where they are and no stroke has a net step.

    Rest is demanded of velocities at the ends of steps: an edge about which its foot turns creeps by 1e-9 mm a stroke.
    Catches: creep of sticking points.
    """
    walked = walk(machine(), ground=Ground(50.0), **DRIVE)
    bears = walked.motion.contact_share[-1] > 0.0
    edges = contact_positions(machine(), walked.motion.x, walked.motion.Q)[:, bears]
    assert np.abs(edges - edges[0]).max() < 1e-7
    assert np.abs(walked.advances[4:]).max() < 1e-6
    assert (walked.motion.touch[:, bears] == STICK).all()


def test_one_way_feet_advance_by_what_they_open() -> None:
    """Feet that never slip back (C6): each stroke advances the machine by the swing of the distance of its edges.

    In closing the hind foot comes forward, in opening the fore foot. Driven slowly, half a stroke a second; inertia
    lets feet slide on by less than a thousandth.
    Catches: reverse friction against the wrong direction, an edge that slips back a little in every step.
    """
    ground = Ground(0.1, reverse_static_friction=50.0, reverse_kinetic_friction=50.0)
    walked = walk(machine(), ground=ground, frequency=0.5, amplitude=1.2, duration=8.0, step=2e-3, discard=1)
    edges = contact_positions(machine(), walked.motion.x, walked.motion.Q)[:, [0, 5], 0]
    begin = walked.times > 2.0
    opening = np.ptp(edges[begin, 1] - edges[begin, 0])
    assert opening > 0.3
    assert walked.step_mm == pytest.approx(opening, rel=2e-3)
    assert np.diff(edges, axis=0).min() > -1e-6
