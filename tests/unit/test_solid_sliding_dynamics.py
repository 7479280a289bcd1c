"""Motion of bodies whose parts slide on each other: slopes, free pairs, rest, the book of energies, going on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fem_biobot import BodyMesh, Fix, SolidModel, SolidMotion, Traction, solve
from fem_biobot.ensembles import Nudge, generator_of
from fem_biobot.errors import ModelError, SolveError
from fem_biobot.friction.ground import Ground
from fem_biobot.material.neo_hooke import NeoHooke
from fem_biobot.solid.dynamics.body import moving_body
from fem_biobot.solid.dynamics.integrate import rigid_velocity, solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidCheckpoint, joined
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.dynamics.sliding import SlidingStepper
from fem_biobot.solid.ensemble import nudged
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.interface.state import LIFTED, SLIP, STICK
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Support
from fem_biobot.solid.standing import Standing
from tests.helpers import box_mesh

G = 9810.0
DENSITY = {"slider": 1.1e-6, "base": 1.3e-6}
EULER, SOFT = Scheme.backward_euler, Scheme.soft_landing
TOP, BASE = (1.0, 0.8, 0.5), (3.0, 2.4, 0.4)


def pair_of_blocks(cells: int = 1) -> BodyMesh:
    """A block in the middle of a flat, longer one's upper face, on nodes of its own."""
    base, top = box_mesh((3 * cells, 3 * cells, 1), BASE, names=("base",)), box_mesh((cells, cells, 1), TOP)
    n, e = base.n_vertices, base.n_elements
    points = np.hstack([base.points, top.points + np.array([[1.0], [0.8], [0.4]])])
    surfaces = {"under": base.surfaces["z0"], "bearing": base.surfaces["z1"]}
    surfaces |= {"sole": top.surfaces["z0"] + n, "lid": top.surfaces["z1"] + n}
    regions = {"base": base.regions["base"], "slider": top.regions["muscle"] + e}
    return BodyMesh(points, np.hstack([base.cells, top.cells + n]), regions, surfaces)


def blocks(friction: float, *supports: Support, loads: Any = (), element: str = "P1", cells: int = 1) -> SolidModel:
    laws = {"slider": NeoHooke(40.0, 0.3), "base": NeoHooke(60.0, 0.3)}
    sliding = Sliding("bearing", "sole", friction, axis=(0.0, 1.0, 0.0))
    return SolidModel(pair_of_blocks(cells), laws, {}, supports, loads, element, sliding=sliding)


def on_slope(angle: float, friction: float, duration: float, step: float = 1e-3, **more: Any) -> SolidMotion:
    element = more.pop("element", "P1")
    given: dict[str, Any] = {"damping_time": 1e-3, **more}
    return solid_dynamics(
        blocks(friction, Fix("under"), element=element), duration, step, densities=DENSITY,
        gravity=(G * np.sin(angle), 0.0, -G * np.cos(angle)), **given,
    )  # fmt: skip


def slider_nodes(motion: SolidMotion) -> np.ndarray:
    """Nodes of the upper block."""
    return np.unique(motion.body.system.space.nodes[:, motion.body.model.mesh.regions["slider"]])


def slider_speed(motion: SolidMotion) -> np.ndarray:
    """Mean velocity of the upper block along x between samples, (s - 1,) [mm/s]."""
    nodes = slider_nodes(motion)
    mass = motion.body.node_mass[nodes]
    return np.diff(motion.u[:, 0, nodes] @ mass / mass.sum()) / np.diff(motion.times)


@pytest.mark.parametrize(("element", "scheme"), [("P1", EULER), ("P2", SOFT)])
def test_a_block_slides_down_another_as_a_rigid_one(element: str, scheme: Scheme) -> None:
    """On a slope of 30 degrees it accelerates at g (sin a - mu cos a) within 0.5 %, and rubs all the while.

    Catches: friction of the last step's pressure, slip measured from the undeformed place, a cone per node.
    """
    angle, mu = np.radians(30.0), 0.3
    motion = on_slope(angle, mu, 0.02, 5e-4, element=element, settings=DynamicsSettings(scheme))
    v, t = slider_speed(motion), 0.5 * (motion.times[1:] + motion.times[:-1])
    half = len(v) // 2
    found = (v[-1] - v[half]) / (t[-1] - t[half])
    assert found == pytest.approx(G * (np.sin(angle) - mu * np.cos(angle)), rel=5e-3)
    last = motion.between[-1].state
    assert set(last[last != LIFTED]) == {SLIP}


def test_friction_turns_with_the_motion() -> None:
    """Thrown up the slope a block is slowed by g (sin a + mu cos a), and falls back by g (sin a - mu cos a) at once.

    Above the place where it began. Catches: slip measured from where the motion began, not the step.
    """
    angle, mu = np.radians(30.0), 0.3
    model = blocks(mu, Fix("under"))
    v = np.zeros_like(model.system.space.points)
    v[0, np.unique(model.system.space.nodes[:, model.mesh.regions["slider"]])] = -60.0
    motion = on_slope(angle, mu, 0.016, 5e-4, velocity=v)
    speed, t = slider_speed(motion), 0.5 * (motion.times[1:] + motion.times[:-1])
    turned = 60.0 / (G * (np.sin(angle) + mu * np.cos(angle)))
    for inside, sign in (((t > 2e-3) & (t < turned - 1e-3), 1.0), (t > turned + 2e-3, -1.0)):
        found = np.polyfit(t[inside], speed[inside], 1)[0]
        assert found == pytest.approx(G * (np.sin(angle) + sign * mu * np.cos(angle)), rel=0.02)
    assert motion.u[-1, 0, slider_nodes(motion)].max() < 0.0


def test_surfaces_that_slide_move_by_backward_euler() -> None:
    """Of the middle rule's weights theirs alone are one, so that parts that meet do not bounce.

    Catches: a scheme that gives sliding surfaces the velocity of the middle.
    """
    body = moving_body(blocks(0.3, Fix("under")), DENSITY)
    settings = DynamicsSettings(SOFT)
    weights = SlidingStepper(body, None, settings).weights(1e-3).ravel()
    assert body.joint is not None
    assert np.all(weights[body.joint.nodes] == 1.0)
    assert np.all(np.delete(weights, body.joint.nodes) == settings.theta(1e-3))
    assert settings.theta(1e-3) < 0.6


def test_a_block_below_its_friction_stays_where_it_is() -> None:
    """At nine tenths of the slope on which it would slide it does not creep in 0.4 s.

    Catches: friction regularised by a velocity, stick that drifts by a share of each step.
    """
    motion = on_slope(np.arctan(0.9 * 0.5), 0.5, 0.4, 5e-3)
    late = motion.times >= 0.2
    assert np.ptp(motion.u[late], axis=0).max() < 1e-7
    state = motion.between[-1].state
    assert np.any(state == STICK)


def test_friction_between_parts_is_an_entry_of_the_book() -> None:
    """Sliding down, it takes mu N times the way, and normal forces nothing; what is left unexplained is rounding.

    The way is that of the upper block's sole over the base. Catches: work of one side only, of the traction at the
    step's beginning, friction entered with the pressure.
    """
    angle, mu = np.radians(30.0), 0.3
    motion = on_slope(angle, mu, 0.02, 5e-4, settings=DynamicsSettings(tolerance=1e-11))
    normal = motion.body.node_mass[slider_nodes(motion)].sum() * G * np.cos(angle)
    half = len(motion.times) // 2
    sole = np.unique(motion.body.model.mesh.surfaces["sole"])
    way = np.diff(motion.u[[half, -1]][:, 0, sole].mean(axis=1))[0]
    rubbed = np.diff(motion.energy("rubbing")[[half, -1]])[0]
    assert rubbed == pytest.approx(-mu * normal * way, rel=0.01)
    lost = abs(motion.energy("rubbing")[-1])
    assert abs(motion.energy("pressing")[-1]) < 0.01 * lost
    assert np.abs(motion.energy_error).max() < 1e-8 * lost


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_a_free_pair_keeps_its_momentum(friction: float) -> None:
    """Parts that collide and slide in flight change neither momentum nor, but for gaps, angular momentum.

    Backward Euler loses ``h v1 x M v0`` of it in each step on its own, which is taken off. Friction ``T`` at points
    with gaps g turns by the sum of ``g |T|`` at most, and no more is allowed; without friction nothing.
    Catches: forces where the step began, forces on one side only.
    """
    model, h = blocks(friction, Fix("under")), 2e-4
    v = rigid_velocity(model, (5.0, -10.0, 2.0), (4.0, 2.0, -5.0), (0.3, 0.2, 0.1))
    v[:, np.unique(model.system.space.nodes[:, model.mesh.regions["slider"]])] += np.array([[60.0], [20.0], [-80.0]])
    motion = solid_dynamics(
        model, 20 * h, h, densities=DENSITY, free=True, velocity=v, damping_time=1e-3,
        settings=DynamicsSettings(tolerance=1e-12),
    )  # fmt: skip
    assert max(b.traction[:, 0].max() for b in motion.between) > 0.1
    p, body = motion.momentum, motion.body
    assert np.abs(p - p[0]).max() < 1e-9 * np.linalg.norm(p[0])
    assert body.joint is not None
    lost, most, before = np.zeros(3), 0.0, v.T
    for k, between in enumerate(motion.between[1:], 1):
        after = (motion.u[k] - motion.u[k - 1]).T / h
        lost += h * np.cross(after, body.momentum_of(before)).sum(axis=0)
        before = after
        gap = np.abs(between.at[between.facet >= 0, 2]).max(initial=0.0)
        most += h * gap * float(np.hypot(*between.traction[:, 1:].T) @ body.joint.contact.surfaces.area)
    spin = motion.angular_momentum
    scale = np.linalg.norm(spin[0])
    assert np.linalg.norm(spin[-1] - spin[0] - lost) <= most + 1e-9 * scale
    assert np.linalg.norm(lost) > 1e-6 * scale
    assert most < 0.05 * scale


@pytest.mark.parametrize("scheme", [EULER, SOFT])
def test_a_pair_on_the_ground_has_the_momentum_of_its_forces(scheme: Scheme) -> None:
    """Thrown onto the ground, both blocks slide: what their momentum changes by is weight and forces of the foot.

    The upper one is faster and drags the lower. All forces are balanced to 1e-11 of the largest in a step, of about
    1 mN, at some hundred unknowns; the weight is 0.04 mN. Catches: forces of the ground or between parts on one side
    only or of another instant, friction of one entered with the other's.
    """
    model, h = blocks(0.3, Fix("under")), 5e-4
    v = np.zeros_like(model.system.space.points)
    v[:] = np.array([[20.0], [3.0], [-2.0]])
    v[0, np.unique(model.system.space.nodes[:, model.mesh.regions["slider"]])] += 40.0
    motion = solid_dynamics(
        model, 40 * h, h, densities=DENSITY, free=True, velocity=v, damping_time=1e-3, gravity=(0.0, 0.0, -G),
        ground=Ground(0.05, 0.02), feet=["under"], settings=DynamicsSettings(scheme, tolerance=1e-11),
    )  # fmt: skip
    assert motion.ground is not None
    weight, foot = motion.body.weight.sum(axis=0), motion.foot_force(0) @ motion.ground.axes
    changed = np.diff(motion.momentum, axis=0) / np.diff(motion.times)[:, None]
    np.testing.assert_allclose(changed, weight + foot[1:], atol=1e-7 * float(np.linalg.norm(weight)))
    rubbed, dragged = motion.energy("rubbing")[-1], motion.energy("friction")[-1]
    assert rubbed < -1e-5
    assert dragged < -1e-5
    assert np.abs(motion.energy_error).max() < 1e-7 * abs(rubbed + dragged)


def test_blocks_without_any_force_stay_at_rest() -> None:
    """No weight, no motion, nothing pressed: a step ends where it began, as of bonded bodies.

    Catches: a share of no forces, a residual that is then no number.
    """
    motion = solid_dynamics(blocks(0.3, Fix("under")), 3e-3, 1e-3, densities=DENSITY)
    assert motion.halved == 0
    assert np.abs(motion.u).max() == 0.0
    assert motion.largest_residual == 0.0


def test_a_nudged_start_keeps_what_is_between_the_parts() -> None:
    """Tractions and places of slip stay; the pair goes on from it with the velocity it was given.

    Catches: a start of bonded parts, refused as the checkpoint of another body.
    """
    motion = on_slope(0.1, 0.3, 2e-3)
    still = motion.final.state
    start = nudged(motion.body, Standing(motion.final, 0.0, 0.0, 0.0), Nudge(0.03, 1.3, 0.7), generator_of(3, 0))
    assert start.state.between is still.between
    assert np.abs(still.change).max() > 0.0
    assert np.abs(start.state.change).max() == 0.0
    # supports take the lower block back; the start alone is asked for here
    assert np.ptp(start.state.u - still.u, axis=0).max() < 1e-12
    assert np.abs(start.state.u - still.u).max() > 1e-4
    free = solid_dynamics(blocks(0.3, Fix("under")), 1e-3, 1e-3, densities=DENSITY, free=True, start=start)
    moved = motion.body.momentum_of(start.state.v).sum(axis=0)
    np.testing.assert_allclose(free.momentum[-1], moved, atol=1e-7 * float(np.linalg.norm(moved)))


def test_a_damped_pair_settles_where_the_static_solver_has_it() -> None:
    """Pressed and held on its lid, without friction, the upper block ends as the static contact solution.

    Catches: contact forces that the scheme weighs, a gap at another instant than the force.
    """
    model = blocks(0.0, Fix("under"), Fix("lid", "xy"), loads=[Traction("lid", (0.0, 0.0, -3.0))])
    found = solid_dynamics(
        model, 0.4, 0.02, densities=DENSITY, damping_time=2e-3, settings=DynamicsSettings(tolerance=1e-12)
    )
    wanted = solve(model, [1.0], settings=NewtonSettings(tolerance=1e-13)).last
    assert np.abs(wanted.u).max() > 0.02
    np.testing.assert_allclose(found.u[-1], wanted.u, atol=1e-8)
    assert wanted.touch is not None
    np.testing.assert_allclose(found.between[-1].traction, wanted.touch.traction, atol=1e-5)


def test_sliding_goes_on_from_its_checkpoint() -> None:
    """Two runs in a row repeat a run of the same two parts from a file, bit by bit.

    Catches: the places that slip is measured from forgotten, tractions found anew.
    """
    first = on_slope(np.radians(30.0), 0.3, 5e-3)
    second = on_slope(np.radians(30.0), 0.3, 5e-3, start=first.final)
    again = on_slope(np.radians(30.0), 0.3, 5e-3, start=SolidCheckpoint.from_arrays(first.final.arrays()))
    assert np.array_equal(again.u, second.u)
    assert np.array_equal(again.book, second.book)
    for one, other in zip(again.between, second.between, strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))
    whole = joined([first, second])
    assert len(whole.between) == len(whole.times)
    assert whole.state(-1).touch is second.between[-1]


def test_starts_and_schemes_that_do_not_fit_are_refused() -> None:
    """A scheme whose parts bounce, a checkpoint of bonded parts, a state of a contact with other points.

    Catches: contact in a scheme that gives it energy, a state taken over point by point.
    """
    with pytest.raises(ModelError, match="scheme: found energy_momentum with parts that slide"):
        on_slope(0.1, 0.3, 1e-3, settings=DynamicsSettings(Scheme.energy_momentum))
    motion = on_slope(0.1, 0.3, 1e-3)
    bonded = replace(motion.final, state=motion.final.state._replace(between=None))
    with pytest.raises(ModelError, match="checkpoint of another body"):
        on_slope(0.1, 0.3, 1e-3, start=bonded)
    between = motion.between[-1]
    fewer = replace(motion.state(-1), touch=between._replace(state=between.state[1:]))
    with pytest.raises(ModelError, match="parts that slide otherwise"):
        on_slope(0.1, 0.3, 1e-3, start=fewer)


def test_a_step_that_parts_do_not_end_is_halved_and_told() -> None:
    """One iteration is never enough: the failure says what was missed between the parts.

    Catches: the last iterate taken for an answer.
    """
    with pytest.raises(SolveError, match="no convergence of parts that slide on each other"):
        on_slope(0.5, 0.3, 1e-3, settings=DynamicsSettings(max_iterations=1, halvings=0))


@pytest.mark.parametrize("bad", [1, 5])
def test_a_change_that_gives_no_number_is_shortened(bad: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the whole change misses by no number, half of it is taken; where all parts of it do, the step is given up.

    Catches: no number taken for the best, since nothing is smaller.
    """
    whole = SlidingStepper._trial
    told: list[int] = []

    def trial(stepper: SlidingStepper, *given: Any) -> Any:
        told.append(0)
        found = whole(stepper, *given)
        # the first is where the iteration begins
        return found._replace(off=np.nan) if 1 < len(told) <= 1 + bad else found

    monkeypatch.setattr(SlidingStepper, "_trial", trial)
    settings = DynamicsSettings(halvings=0)
    if bad == 5:
        with pytest.raises(SolveError, match="not a number"):
            on_slope(0.5, 0.3, 1e-3, settings=settings)
        return
    motion = on_slope(0.5, 0.3, 1e-3, settings=settings)
    assert motion.steps == 1
    assert motion.largest_residual <= settings.tolerance
