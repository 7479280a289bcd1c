"""C6 and the invariance of a driven machine on a frictional ground.

Problem: a two-footed machine of unequal pillars is driven for some strokes; then the same turned, mirrored, renumbered,
    stiffened, with equal pillars, with held or one-way feet, without friction, with the other integrator.
Exact answer: the same path turned or mirrored; none at all; the stroke a cycle; see each test.
Measured: positions of the nodes and the centre of mass.
Tolerance: rounding grown by the machine's own sensitivity over the short runs compared; solver tolerance otherwise.
Cannot see: whether the path itself is right (order and closed forms are tested elsewhere).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.rod.dynamics.integrate import Integrator, Motion, Settings, dynamics
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Gravity, Hold, Muscle, Rigid, Rod
from fem_biobot.rod.section import RodMaterial, Section

Array = NDArray[np.float64]

RHO = 1.12e-6


def machine(
    heights: tuple[float, float] = (2.8, 3.4),
    turn: Array | None = None,
    *,
    young: float = 319.4,
    corners: Sequence[int] = (0, 1, 2, 3),
    supports: Sequence[Hold] = (),
    damping_time: float = 1e-4,
) -> RodModel:
    """Beam, two pillars of the given heights at -x and +x, a muscle; all turned by `turn` (3, 3)."""
    R = np.eye(3) if turn is None else turn
    top = max(heights)
    points = np.stack([np.linspace(-3.5, 3.5, 7), np.zeros(7), np.full(7, top)], axis=1) @ R.T
    material = RodMaterial(young=young, poisson=0.45, density=RHO)
    beam = Rod(points, Section.rectangle(0.68, 7.0), material, "beam", normal=(0.0, 0.0, 1.0))
    bodies, joints, contacts = [], [], []
    for name, x, height, node in (("left", -5.25, heights[0], 0), ("right", 5.25, heights[1], -1)):
        foot, size = top - height, np.array([3.5, 7.0, height + 0.34])
        mass = RHO * size.prod()
        J = mass / 12.0 * np.diag(size @ size - size**2)
        centre = tuple(R @ [x, 0.0, foot + 0.5 * size[2]])
        bodies.append(Body(centre, mass, R @ J @ R.T, name))
        joints.append(Rigid(("beam", node), (name, centre)))
        at = np.array([(x + a, b, foot) for a in (-1.75, 1.75) for b in (-3.5, 3.5)])[list(corners)]
        contacts.append(ContactPoints(name, at @ R.T))
    ends = [(name, tuple(R @ [x, 0.0, top - 2.0])) for name, x in (("left", -3.5), ("right", 3.5))]
    muscle = Muscle(ends[0], ends[1], 0.88, 10.0, 0.9, 2.7, mass=6e-6)  # type: ignore[arg-type]
    return RodModel([beam], joints, bodies, supports, [Gravity()], [muscle], contacts, damping_time)


def drive(t: float) -> float:
    """Four strokes a second."""
    return float(np.abs(np.sin(4.0 * np.pi * t)))


def walked(model: RodModel, duration: float = 0.6, step: float = 1e-3, **others: Any) -> Motion:
    """The driven motion on a ground of different friction at rest and in motion."""
    ground = others.pop("ground", Ground(0.42, 0.3))
    return dynamics(model, duration, step, ground=ground, drive=drive, sample_every=others.pop("every", 10), **others)


@pytest.fixture(scope="module")
def path() -> Motion:
    """Of the machine as drawn. It slides, sticks, lifts corners, and gets somewhere."""
    motion = walked(machine())
    assert set(np.unique(motion.touch)) == {0, 1, 2}
    assert abs(motion.centre_of_mass[-1, 0] - motion.centre_of_mass[0, 0]) > 0.05
    return motion


def test_a_turned_run_repeats(path: Motion) -> None:
    """Machine and ground turned about the vertical walk the turned path; one turned by the machine alone, too.

    Catches: a box of friction instead of a circle, world axes in a tolerance, frames that depend on the drawing.
    """
    c, s = np.cos(0.7), np.sin(0.7)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for forward in ((c, s, 0.0), (1.0, 0.0, 0.0)):
        motion = walked(machine(turn=R), ground=Ground(0.42, 0.3, forward=forward))
        early = motion.times <= 0.3
        assert np.abs(motion.x @ R - path.x)[early].max() <= 1e-9
        assert np.abs(motion.x @ R - path.x).max() <= 1e-6


def test_a_mirrored_machine_walks_the_mirrored_path(path: Motion) -> None:
    """Pillars exchanged: every node of the other end is where its image is, to 1e-6 mm.

    Catches: a preferred direction in contact, joints or members.
    """
    motion = walked(machine((3.4, 2.8)))
    assert np.abs(motion.centre_of_mass * [-1.0, 1.0, 1.0] - path.centre_of_mass).max() <= 1e-6
    image = path.x[:, ::-1] * [-1.0, 1.0, 1.0]
    assert np.abs(np.sort(motion.x, axis=1) - np.sort(image, axis=1)).max() <= 1e-6


def test_renumbered_corners_change_nothing(path: Motion) -> None:
    """Catches: a result that depends on the order in which corners are looked at."""
    motion = walked(machine(corners=(2, 0, 3, 1)))
    assert np.abs(motion.x - path.x).max() <= 1e-6
    # and each corner has the force it had; their sums have to
    np.testing.assert_allclose(motion.contact_force.sum(axis=1), path.contact_force.sum(axis=1), atol=1e-6)


def test_a_machine_symmetric_across_never_leaves_its_plane(path: Motion) -> None:
    """Catches: corner impulses that turn the machine or push it aside."""
    assert np.abs(path.x[..., 1]).max() <= 1e-9


@pytest.mark.parametrize("friction", [(0.42, 0.3), (0.2, 0.2)])
def test_equal_feet_go_nowhere(friction: tuple[float, float]) -> None:
    """Equal pillars under symmetric drive: the centre of mass stays where it was.

    Catches: an asymmetric decision of stick and slip.
    """
    motion = walked(machine((3.1, 3.1)), ground=Ground(*friction))
    assert np.abs(motion.centre_of_mass[:, 0]).max() <= 1e-9
    assert np.ptp(motion.x[:, 0, 0]) > 0.01  # the feet do move


def test_without_friction_the_centre_of_mass_stays() -> None:
    """Unequal pillars slide against each other about a centre of mass at rest.

    Catches: a horizontal force that does not come from friction.
    """
    motion = walked(machine(), ground=Ground(0.0, 0.0))
    moved = motion.centre_of_mass - motion.centre_of_mass[0]
    assert np.abs(moved[:, :2]).max() <= 1e-9
    assert np.ptp(motion.x[:, 0, 0]) > 0.1


def test_with_one_foot_held_nothing_gets_anywhere() -> None:
    """The machine is back after every stroke once the first has settled.

    Catches: a support that creeps.
    """
    foot = ("left", (-5.25, 0.0, 2.0))
    motion = walked(machine(supports=[Hold(foot)]), 1.0, every=250, ground=Ground(0.0, 0.0))  # type: ignore[arg-type]
    node = motion.model.atlas.node_of["left", 0]
    assert np.abs(motion.x[:, node] - motion.x[0, node]).max() == 0.0
    assert np.abs(motion.x[3:] - motion.x[2]).max() <= 2e-2


def test_perfect_one_way_feet_turn_the_stroke_into_progress() -> None:
    """Feet that slide easily forward and not at all backward, slow: each cycle moves the machine by its stroke.

    The pillars come closer by the stroke (the rear one slides) and part by it (the front one slides).
    Catches: forward and reverse friction exchanged, reverse friction that gives way.
    """
    ground = Ground(0.03, reverse_static_friction=50.0, reverse_kinetic_friction=50.0)
    slow = lambda t: float(np.sin(np.pi * t) ** 2)  # noqa: E731
    model = machine(
        (3.1, 3.1), corners=(0, 1), damping_time=5e-3
    )  # one edge a foot, or it would roll from edge to edge
    motion = dynamics(model, 4.0, 2e-3, ground=ground, drive=slow, sample_every=5)
    states = [motion.state(i) for i in range(len(motion.times))]
    left = np.array([s.at(("left", (-7.0, 1.0, 0.0)))[0] for s in states])
    right = np.array([s.at(("right", (3.5, 1.0, 0.0)))[0] for s in states])
    cycle = 100  # samples
    stroke = np.ptp((right - left)[2 * cycle :])
    moved = (left + right)[2 * cycle :: cycle] / 2.0
    assert stroke > 0.1
    np.testing.assert_allclose(np.diff(moved), stroke, rtol=0.01)
    # nothing slides back
    assert np.diff(left).min() >= -1e-3 * stroke
    assert np.diff(right).min() >= -1e-3 * stroke


def test_a_hundred_times_stiffer_machine_still_runs() -> None:
    """The same step does for a modulus 100 times larger: no step is halved more than now and then, the book closes.

    Catches: a step that follows the highest frequency.
    """
    motion = walked(machine(young=31940.0), 0.4)
    assert motion.halved <= 4
    assert motion.iterations <= 6 * motion.steps
    assert abs(motion.energy_error[-1]) <= 1e-2 * motion.energy("muscle")[-1]


def test_both_integrators_walk_the_same_path() -> None:
    """Two independent integrators from the same rest, 0.25 ms and 2 us: within a few 1e-3 of what moved.

    Equal friction at rest and in motion, and no drop at the beginning, because impacts and falling friction multiply
    differences. Catches: an error of either integrator that its own convergence does not show.
    """
    ground, model = Ground(0.3), machine(damping_time=2e-4)
    settled = dynamics(model, 1.0, ground=ground, sample_every=1000).state(-1)
    start = replace(settled, v=np.zeros_like(settled.v))
    implicit = walked(model, 0.25, 2.5e-4, every=200, ground=ground, start=start)
    settings = Settings(integrator=Integrator.explicit)
    explicit = walked(model, 0.25, 2e-6, every=25_000, ground=ground, start=start, settings=settings)
    np.testing.assert_allclose(implicit.times, explicit.times, rtol=1e-12)
    size = np.abs(explicit.x - explicit.x[0]).max()
    assert size > 0.1
    assert np.abs(implicit.x - explicit.x).max() <= 5e-3 * size
