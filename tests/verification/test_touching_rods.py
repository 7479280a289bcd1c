"""Rods that touch each other: rolling with its moment, the capstan, resting, collision; none interpenetrates."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.rod.dynamics.integrate import Integrator, Motion, Settings, dynamics
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Gravity, Hold, PointLoad, Rod
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.touch import Touch
from tests.rods import straight

G = 9810.0
STIFF = RodMaterial(young=1e6, poisson=0.3, density=1e-6)
EXPLICIT = Settings(integrator=Integrator.explicit)
A, B = 1.0, 3.0  # mm, radii of the roller and of what it rolls on


def _lying(name: str, radius: float, x: float, z: float, half: float = 1.0) -> Rod:
    """A stiff rod along y."""
    points = [(x, -half, z), (x, half, z)]
    return Rod(np.array(points), Section.circle(radius), STIFF, name=name)


def _rolls(step: float, duration: float, settings: Settings | None = None) -> tuple[Motion, np.ndarray, np.ndarray]:
    """A round rod released near the top of a round rod that is held; its angle from the top (s,), and gap (s,)."""
    angle = 0.1
    roller = _lying("roller", A, (A + B) * np.sin(angle), (A + B) * np.cos(angle))
    model = RodModel(
        [roller, _lying("base", B, 0.0, 0.0, 3.0)],
        supports=[Hold(("base", 0)), Hold(("base", 1))],
        loads=[Gravity()],
        touches=[Touch("roller", "base", friction=50.0)],
    )
    motion = dynamics(model, duration, step, settings=settings, sample_every=10)
    x = motion.x[:, 0]
    return motion, np.arctan2(x[:, 0], x[:, 2]), np.hypot(x[:, 0], x[:, 2]) - A - B


@pytest.mark.parametrize(("settings", "step", "tolerance"), [(None, 5e-5, 1e-5), (EXPLICIT, 1.5e-6, 1e-8)])
def test_a_round_rod_rolls_off_another(settings: Settings | None, step: float, tolerance: float) -> None:
    """With ``I = m a^2 / 2`` it rolls at ``v^2 = 4/3 g (a + b) (cos q0 - cos q)`` and leaves where cos q is 4/7 cos q0.

    Catches: friction at the axis instead of the surface (no moment: v^2 grows by a half), a normal that does not turn
    with the roller, penetration by drift.
    """
    motion, angle, gap = _rolls(step, 0.08, settings)
    bears = motion.touch_force[:, :, 0].sum(axis=1) > 0.0
    last = int(np.flatnonzero(bears)[-1])
    k = 3 * last // 4
    square = float((motion.v[k, 0, :3] ** 2).sum())
    assert square == pytest.approx(4.0 / 3.0 * G * (A + B) * (np.cos(0.1) - np.cos(angle[k])), rel=tolerance)
    assert motion.v[k, 0, 4] * A == pytest.approx(np.sqrt(square), rel=1e-9)
    turned = angle[last] - angle[last - 1]  # of one sample: where it leaves is known to that
    leaves = np.arccos(4.0 / 7.0 * np.cos(0.1))
    assert angle[last] - turned <= leaves <= angle[last] + turned
    assert gap[: last - 1].min() >= -1e-6 * (A + B)
    assert np.abs(gap[: last - 1]).max() <= 1e-6 * (A + B)


def test_book_closes_while_rolling() -> None:
    """Rolling friction does no work and the book explains the motion.

    Catches: work of the contact entered with one part's velocity alone.
    """
    motion, _, _ = _rolls(1e-4, 0.06)
    moved = motion.energy("kinetic").max()
    assert np.abs(motion.energy_error).max() <= 1e-6 * moved
    # friction at the end of a step against velocities within it: of the scheme's order
    assert np.abs(motion.energy("friction")).max() <= 1e-3 * moved


def _capstan(ratio: float, friction: float, n: int = 24, duration: float = 0.07) -> Motion:
    """A thin string over half a held drum, its far end pulled `ratio` times as hard; loads rise within 50 ms."""
    radius, thin = 1.0, 0.01
    R = radius + thin
    angle = np.linspace(0.0, np.pi, n + 1)
    legs = np.linspace(-1.0, 0.0, 4)[:-1]
    arc = np.stack([R * np.cos(angle), 0.0 * angle, R * np.sin(angle)], axis=1)
    points = np.concatenate([[(R, 0.0, z) for z in legs], arc, [(-R, 0.0, z) for z in legs[::-1]]])
    soft = RodMaterial(young=1e4, poisson=0.3, density=3e-5)
    string = Rod(points, Section.circle(thin), soft, name="string", damping_time=2e-3, natural_curvature=(0, 0, 0))

    def rises(t: float) -> float:
        return min(1.0, t / 0.05)

    model = RodModel(
        [string, _lying("drum", radius, 0.0, 0.0)],
        supports=[Hold(("drum", 0)), Hold(("drum", 1))],
        loads=[
            PointLoad(("string", 0), (0.0, 0.0, -0.1), history=rises),
            PointLoad(("string", -1), (0.0, 0.0, -0.1 * ratio), history=rises),
        ],
        touches=[Touch("string", [("drum", 0), ("drum", 1)], distance=R, friction=friction)],
    )
    return dynamics(model, duration, 2e-4, sample_every=25)


def test_a_string_holds_on_a_drum_up_to_the_capstan_ratio() -> None:
    """Tensions of a string over a drum differ by up to ``exp(mu q)`` (Euler 1769); here over a polygon's corners.

    Catches: friction in proportion to another node's pressure, kinetic friction where the string sticks.
    """
    friction, n = 0.2, 24
    corner = friction * np.tan(0.5 * np.pi / n)
    ratio = ((1.0 + corner) / (1.0 - corner)) ** n
    assert ratio == pytest.approx(np.exp(friction * np.pi), rel=2e-3)
    holds, slips = _capstan(0.98 * ratio, friction), _capstan(1.02 * ratio, friction, duration=0.015)
    assert np.abs(holds.v[-1, :, :3]).max() <= 1e-2
    assert np.abs(slips.v[-1, :, :3]).max() >= 1.0
    inside = np.hypot(holds.x[..., 0], holds.x[..., 2])[:, : n + 7]
    assert inside.min() >= 1.01 - 1e-8


def test_without_friction_a_string_presses_with_its_tension() -> None:
    """The normal forces of the corners of a string pulled with F at both ends sum up to ``2 n F sin(pi / 2n)``.

    Catches: normals that do not point from the drum's axis, forces shared among nodes twice.
    """
    n = 24
    motion = _capstan(1.0, 0.0, n)
    pressed = motion.touch_force[-1, :, 0].sum()
    # the string's own stiffness lifts it where it leaves the drum: E I / (F R^2) of the whole
    stiffness = 1e4 * np.pi / 4 * 0.01**4 / (0.1 * 1.01**2)
    assert pressed == pytest.approx(2.0 * n * 0.1 * np.sin(0.5 * np.pi / n), rel=5e-3 + 10 * stiffness)
    assert np.abs(motion.touch_force[-1, :, 1:]).max() == 0.0


@pytest.mark.parametrize("settings", [None, EXPLICIT], ids=["implicit", "explicit"])
def test_colliding_rods_keep_their_momentum(settings: Settings | None) -> None:
    """Two free rods that collide, rub and go on keep linear and angular momentum; the loss is in the book.

    Catches: a force on one part alone, an arm of friction that differs between the parts.
    """
    soft = RodMaterial(young=1e3, poisson=0.3, density=1e-6)
    one = Rod(straight(4, 4.0, (1.0, 0.3, 0.0)) + np.array([-2.0, -0.6, 1.21]), Section.circle(0.6), soft, name="one")
    two = Rod(straight(4, 4.0, (0.1, 1.0, 0.0)) - np.array([0.2, 2.0, 0.0]), Section.circle(0.6), soft, name="two")
    model = RodModel([one, two], touches=[Touch("one", "two", friction=0.3)])
    start = model.drawn()
    start.v[:5, :3] = (30.0, 20.0, -100.0)
    step = 1e-5 if settings is None else 2e-6
    motion = dynamics(model, 4e-3, step, start=start, settings=settings, sample_every=100)
    assert motion.touch_force[..., 0].max() > 0.0
    assert np.abs(motion.touch_force[..., 1:]).max() > 0.0
    mass = model.mass
    momentum, spin = motion.momentum, motion.angular_momentum
    assert np.abs(momentum - momentum[0]).max() <= 1e-10 * mass * 100.0
    # the arms of both parts meet in one point; implicit steps conserve angular momentum to second order
    bound = 1e-9 if settings is EXPLICIT else 1e-4
    assert np.abs(spin - spin[0]).max() <= bound * mass * 100.0 * 4.0
    lost = motion.energy("normal")[-1] + motion.energy("friction")[-1]
    assert lost < 0.0
    assert np.abs(motion.energy_error[-1]) <= 2e-2 * abs(lost)
