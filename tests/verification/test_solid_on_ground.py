"""Deformable bodies on a frictional ground: slopes, sliding, a belt, landing, pressure, symmetric machines.

Problem: blocks that slide, stick, fall and are pressed, and slabs with muscle that walk on two feet.
Exact answers: closed forms of uniform and harmonic motion (C1, C4, C5 of the cases), equal pressure, symmetry.
Measured: what `solid_dynamics` makes of them with backward Euler.
Tolerance: order one, so times within some steps and lengths within some steps times the speed; uniform acceleration,
    rest, equal pressure and symmetry up to the tolerance of the steps.
Cannot see: friction that weakens from a rim inward, which rigid bodies do not have.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.friction.ground import Ground
from fem_biobot.friction.kernels import LIFTED, SLIP, STICK
from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.dynamics.integrate import solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidMotion
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.records import Fix, Foundation, Traction
from fem_biobot.verification.solid_moving import (
    ANGLE,
    DENSITY,
    EULER,
    HEIGHT,
    PRESSURE,
    SIZE,
    SLIDING,
    SOFT,
    G,
    acceleration,
    block,
    falling,
    lowest,
    on_slope,
    pressed,
    unevenness,
)
from tests.helpers import box_mesh, on_three_corners


@pytest.mark.parametrize("scheme", [EULER, SOFT])
@pytest.mark.parametrize("element", ["P2", "P1"])
def test_a_block_on_a_slope_of_30_degrees_accelerates_as_a_rigid_one(element: str, scheme: Scheme) -> None:
    """At g (sin a - mu cos a) within 0.5 %, a block of a millimetre.

    Catches: friction of a velocity threshold, penalties that let it sink, friction once for each node of a facet.
    """
    found = on_slope(ANGLE, SLIDING, 0.04, 1e-3, element, scheme)
    assert acceleration(found) == pytest.approx(G * (np.sin(ANGLE) - SLIDING * np.cos(ANGLE)), rel=5e-3)
    assert np.all(found.touch[-1][found.contact_force[-1, :, 0] > 0.0] == SLIP)


@pytest.mark.parametrize(("share", "slides"), [(0.998, False), (1.002, True)])
def test_a_block_starts_to_slide_where_the_slope_is_its_friction(share: float, slides: bool) -> None:
    """Just below tan a = mu it rests on some points that stick, just above it goes on sliding.

    Catches: friction on the normal force of another step, cones that are boxes.
    """
    mu = 0.4
    found = on_slope(np.arctan(share * mu), mu, 0.3, 5e-3)
    speed = found.momentum[-1, 0] / found.body.total_mass
    expected = 0.3 * G * mu * (share - 1.0) * np.cos(np.arctan(mu))
    if slides:
        assert speed == pytest.approx(expected, rel=0.2)
    else:
        assert abs(speed) < 1e-9


def test_a_block_below_its_friction_does_not_creep() -> None:
    """In ten seconds at nine tenths of the slope on which it would slide it moves by less than 1e-9 mm.

    Catches: regularised friction, stick that drifts by a share of each step.
    """
    found = on_slope(np.arctan(0.9 * 0.5), 0.5, 10.0, 0.02)
    late = found.times >= 1.0
    assert np.abs(found.u[late] - found.u[-1]).max() < 1e-9
    assert np.any(found.touch[-1] == STICK)


def test_c1_a_sliding_solid_block_stops_and_rests() -> None:
    """C1: 5 m/s on mu = 0.5 ends after 2.548420 m and 1.019368 s, whatever the block is made of.

    Catches: kinetic friction that reverses, a block that never comes to rest.
    """
    step = 2e-3
    found = solid_dynamics(
        block("P1", 2e3), 1.2, step, densities=DENSITY, gravity=(0.0, 0.0, -G), free=True, ground=Ground(0.5),
        feet=["z0"], velocity=(5000.0, 0.0, 0.0), damping_time=1e-3,
    )  # fmt: skip
    x = found.centre_of_mass[:, 0] - found.centre_of_mass[0, 0]
    v = found.momentum[:, 0] / found.body.total_mass
    stopped = found.times[int(np.argmax(np.abs(v) < 1.0))]
    assert stopped == pytest.approx(1.019368, abs=3.0 * step)
    # backward Euler moves by the velocity at the end of each step: v h / 2 short
    assert x[-1] == pytest.approx(2548.420 - 0.5 * 5000.0 * step, abs=1.0)
    assert abs(x[-1] - x[-20]) < 1e-9


@pytest.mark.parametrize(("scheme", "steps"), [(EULER, 10.0), (SOFT, 6.0)])
def test_c4_a_solid_block_sticks_and_slips_on_a_belt(scheme: Scheme, steps: float) -> None:
    """C4: m = k = 1, N = 10, mu_s 0.5, mu_k 0.3, belt at 3: between -0.6056 and 6.6056 with a period of 6.4405.

    Catches: friction opposed to the velocity over the ground instead of over the belt, static friction in slip.
    """
    size = (1.0, 1.0, 0.02)
    # spring and push act on the sole, so that they load its points as friction does, all of them alike
    model = SolidModel(
        box_mesh(1, size), {"muscle": NeoHooke(1e6, 0.0)},
        supports=[*on_three_corners(size), Foundation("z0", 0.0, 1.0)], loads=[Traction("z0", (0.0, 0.0, -10.0))],
        element="P1",
    )  # fmt: skip
    step = 0.01
    found = solid_dynamics(
        model, 14.5, step, densities={"muscle": 50.0}, free=True,
        ground=Ground(0.5, 0.3, velocity=(3.0, 0.0, 0.0)), feet=["z0"], velocity=(3.0, 0.0, 0.0),
        settings=DynamicsSettings(scheme),
    )  # fmt: skip
    x = found.centre_of_mass[:, 0] - 0.5
    late = found.times > 7.0
    assert x[late].max() == pytest.approx(6.6055512755, abs=steps * step)
    assert x[late].min() == pytest.approx(-0.6055512755, abs=steps * step)
    up = np.flatnonzero((x[:-1] < 3.0) & (x[1:] >= 3.0))
    assert np.diff(found.times[up])[-1] == pytest.approx(6.4405134335, abs=steps * step)


def test_a_block_pressed_on_the_ground_has_equal_pressure_to_rounding() -> None:
    """Contact patch test: under an even push on its top every side of every facet bears its share of the area.

    Catches: forces lumped against the shape functions, corners of quadratic facets that pull or bear.
    """
    found = pressed()
    assert unevenness(found) <= 1e-8 * PRESSURE
    feet, force = found.feet, found.contact_force[-1, :, 0]
    assert feet is not None
    sides = feet.area > 0.0
    assert feet.area.sum() == pytest.approx(SIZE[0] * SIZE[1], rel=1e-12)
    assert np.abs(force[~sides]).max() <= 1e-8 * force.max()


@pytest.mark.parametrize("scheme", [EULER, SOFT])
def test_a_falling_block_hits_with_its_energy_and_stays_out_of_the_ground(scheme: Scheme) -> None:
    """Turned so that a corner comes first: no contact point is ever 1e-9 mm inside; what the fall gave is accounted.

    Catches: impacts that give energy, contact on velocities that lets positions sink, a book that does not close.
    """
    found = falling(scheme)
    assert lowest(found).min() >= -1e-9
    landed = int(np.argmax(found.contact_force[:, :, 0].sum(axis=1) > 0.0))
    assert found.times[landed] == pytest.approx(np.sqrt(2.0 * HEIGHT / G), abs=1e-3)
    fallen = found.energy("kinetic")[landed - 1]
    assert fallen == pytest.approx(found.body.total_mass * G * HEIGHT, rel=0.1)
    stored = found.book[:, :3].sum(axis=1)
    assert np.all(np.diff(stored) <= 1e-9 * fallen)
    assert np.abs(found.energy_error).max() <= 1e-6 * fallen
    assert found.energy("friction")[-1] < 0.0


def _walker(mirror: bool, equal: bool) -> SolidModel:
    """A slab with a muscle below, on two feet; symmetric, or with a longer foot at one end."""
    half = box_mesh((3, 1, 2), (3.0, 0.8, 0.6), layers=(0.5, 1.0), names=("muscle", "skeleton"), shift=0.0)
    flip = np.array([[-1.0], [1.0], [1.0]])
    n = half.points.shape[1]
    points = np.concatenate([half.points, half.points * flip], axis=1)
    cells = np.concatenate([half.cells, half.cells[[0, 1, 3, 2]] + n], axis=1)
    faces = np.concatenate([half.surfaces["z0"], half.surfaces["z0"][[0, 2, 1]] + n], axis=1)
    regions = {k: np.concatenate([v, v + half.n_elements]) for k, v in half.regions.items()}
    unique, first, back = np.unique(np.round(points, 9), axis=1, return_index=True, return_inverse=True)
    points, back = points[:, first], back.ravel()
    cells, faces = back[cells], back[faces]
    if mirror:
        points, cells, faces = points * flip, cells[[0, 1, 3, 2]], faces[[0, 2, 1]]
    middle = points[0, faces].mean(axis=0) * (-1.0 if mirror else 1.0)
    feet = {"back": faces[:, middle < (-2.0 if equal else -1.0)], "front": faces[:, middle > 2.0]}
    mesh = BodyMesh(points, cells, regions, feet).checked()
    assert unique.shape == points.shape
    corners = [points[:, np.argmin(np.abs(points.T - np.array(p)).sum(axis=1))] for p in
               ((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (0.0, 0.8, 0.0))]  # fmt: skip
    supports = [Fix(tuple(map(float, p)), c) for p, c in zip(corners, ("xyz", "yz", "z"), strict=True)]  # type: ignore[arg-type]
    laws = {"muscle": NeoHooke(10.0, 0.3), "skeleton": NeoHooke(60.0, 0.3)}
    active = {"muscle": ActiveStress(6.0, np.array([1.0, 0.0, 0.0]))}
    return SolidModel(mesh, laws, active, supports, element="P1")


def _walked(mirror: bool, equal: bool) -> SolidMotion:
    return solid_dynamics(
        _walker(mirror, equal), 0.2, 2e-3, densities={"muscle": 1e-6, "skeleton": 1.2e-6}, gravity=(0.0, 0.0, -G),
        free=True, ground=Ground(0.4, 0.25), feet=["back", "front"], damping_time=5e-4,
        drive=lambda t: np.sin(np.pi * 10.0 * t) ** 2, settings=DynamicsSettings(tolerance=1e-10),
    )  # fmt: skip


def test_a_symmetric_machine_goes_nowhere() -> None:
    """Equal feet under a symmetric drive: its strokes slide the feet, and the middle stays where it is.

    Catches: a sweep over the contact points that favours those solved first, friction with a sense of its own.
    """
    found = _walked(mirror=False, equal=True)
    stroke = np.ptp(found.u[:, 0].max(axis=1))
    moved = found.centre_of_mass[:, 0] - found.centre_of_mass[0, 0]
    assert stroke > 1e-2
    assert np.any(found.touch == SLIP)
    assert np.any(found.touch == LIFTED)
    assert np.abs(moved).max() <= 1e-7 * stroke


def test_a_mirrored_machine_goes_the_mirrored_way() -> None:
    """Feet of different length: it walks, and its mirror image walks as far the other way.

    Catches: axes of the ground mixed up, an order of points that matters.
    """
    one, other = _walked(mirror=False, equal=False), _walked(mirror=True, equal=False)
    first, second = (m.centre_of_mass - m.centre_of_mass[0] for m in (one, other))
    assert np.abs(first[:, 0]).max() > 1e-3
    np.testing.assert_allclose(second[:, 0], -first[:, 0], rtol=0.0, atol=1e-6 * np.abs(first).max())
    np.testing.assert_allclose(second[:, 1:], first[:, 1:], rtol=0.0, atol=1e-6 * np.abs(first).max())
