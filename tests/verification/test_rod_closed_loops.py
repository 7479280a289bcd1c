"""Closed rings of rigid parts whose joints say more than they must.

Problem: a plane four-bar linkage of four hinges (three rows too many) swings under its weight; Bennett's linkage, four
    hinges askew in space that move by their proportions alone, is thrown.
Exact answer: the same four-bar held by independent rows; Bennett's relation of its angles.
Measured: positions, gaps of the joints, angles, energy.
Tolerance: the solver's where two models are the same; gaps and energy fall with the square of the step or faster.
Cannot see: the forces in such joints, which mechanics leaves open.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.rod.dynamics.integrate import Integrator, Motion, Settings, dynamics
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Gravity, Hinge, Hold, Rigid, Rod, Spherical
from fem_biobot.rod.section import RodMaterial, Section
from tests.rods import straight

Array = NDArray[np.float64]

CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 3.0], [5.0, 0.0, 4.0], [6.0, 0.0, 0.0]])
BARS = ("crank", "coupler", "rocker")
AXIS = (0.0, 1.0, 0.0)
SETTINGS = {
    Integrator.implicit: Settings(dissipation=0.0, tolerance=1e-11),
    Integrator.explicit: Settings(Integrator.explicit),
}


def corner(i: int) -> tuple[float, float, float]:
    """As a place."""
    x, y, z = CORNERS[i].tolist()
    return (x, y, z)


def bars() -> list[Body]:
    """Crank, coupler and rocker."""
    pairs = zip(BARS, CORNERS, CORNERS[1:], strict=False)
    return [Body(tuple((0.5 * (a + b)).tolist()), 1e-3, (1e-3, 1.5e-3, 1.2e-3), name) for name, a, b in pairs]


def four_bar() -> RodModel:
    """With hinges at all four corners, on a held base."""
    base = Body((3.0, 0.0, 0.0), 1e-3, (1e-3, 2e-3, 3e-3), "base")
    ring = ("base", *BARS, "base")
    joints = [Hinge((ring[i], corner(i)), (ring[i + 1], corner(i)), AXIS) for i in range(4)]
    return RodModel(bodies=[*bars(), base], joints=joints, supports=[Hold(("base", base.centre))], loads=[Gravity()])


def independent() -> RodModel:
    """The same plane motion by 17 rows for 18 unknowns."""
    joints = [Hinge(("crank", corner(1)), ("coupler", corner(1)), AXIS)]
    ball = Spherical(("coupler", corner(2)), ("rocker", corner(2)))
    supports = [Hold(("crank", corner(0)), "xyz", "xz"), Hold(("rocker", corner(3)), "xz", "xz")]
    return RodModel(bodies=bars(), joints=[*joints, ball], supports=supports, loads=[Gravity()])


@pytest.mark.parametrize("integrator", list(Integrator))
def test_a_four_bar_of_hinges_moves_as_one_held_by_independent_rows(integrator: Integrator) -> None:
    """It falls through more than a radian; a ring that floats free falls as one.

    Catches: a singular tangent, a compliance that stays in the converged step, multipliers that pile up.
    """
    step = 5e-4 if integrator is Integrator.implicit else 1e-4
    settings = SETTINGS[integrator]
    run: dict[str, Any] = {"duration": 0.08, "step": step, "sample_every": round(0.02 / step), "settings": settings}
    ring, free = dynamics(four_bar(), **run), dynamics(independent(), **run)
    nodes = [ring.model.atlas.node_of[name, 0] for name in BARS]
    assert np.abs(free.x[-1] - free.x[0]).max() > 2.0
    assert np.abs(ring.x[:, nodes] - free.x).max() <= 1e-8
    assert ring.halved == free.halved == 0
    assert ring.iterations <= free.iterations + ring.steps


def test_only_rows_that_depend_on_each_other_are_soft() -> None:
    """Rows across the plane in the ring; none in an open chain, none in the ring with a spring of a rod in it.

    Catches: compliance where none is needed, rows that lie in the plane, a loop through what bends.
    """
    ring = four_bar().assembly.constraints
    assert (ring.soft[:, :3] > 0.0).tolist() == [[False, True, False]] * 4
    assert (ring.soft[:, 3:5] > 0.0).all()
    mobility = 0.0
    for arm in 0.5 * np.diff(CORNERS, axis=0)[:2]:  # of a push along y at the hinge of crank and coupler
        mobility += 1.0 / 1e-3 + arm[2] ** 2 / 1e-3 + arm[0] ** 2 / 1.2e-3
    assert ring.soft[1, 1] == pytest.approx(1e-4 * mobility, rel=1e-12)
    assert not independent().assembly.constraints.soft.any()
    points = CORNERS[3] + straight(2, 1.0, (1.0, 0.0, 0.0))
    rod = Rod(points, Section.circle(0.3), RodMaterial(young=1e3, poisson=0.3, density=1e-6), "leaf")
    ball = Body((3.0, 0.0, 0.0), 1e-3, (1e-3, 2e-3, 3e-3), "base")
    joints: list[Any] = [
        Hinge((a, corner(i)), (b, corner(i)), AXIS)
        for i, (a, b) in enumerate(zip(("base", *BARS[:2]), BARS, strict=True))
    ]
    joints += [Hinge(("rocker", corner(3)), ("leaf", 0), AXIS), Rigid(("leaf", -1), ("base", (7.0, 0.0, 0.0)))]
    leafed = RodModel([rod], joints, [*bars(), ball], [Hold(("base", ball.centre))])
    assert not leafed.assembly.constraints.soft.any()


# ---- Bennett's linkage

A, B = 4.0, 5.0  # lengths of opposite links
ALPHA = 0.7  # twist between the axes at the ends of a link of length A
BETA = float(np.arcsin(B / A * np.sin(ALPHA)))
RATIO = float(np.sin(0.5 * (BETA + ALPHA)) / np.sin(0.5 * (BETA - ALPHA)))


def bennett(theta: float) -> tuple[Array, Array]:
    """Points on the four axes, common to two links each, and the axes, (4, 3), at an angle of the first joint."""
    other = 2.0 * np.arctan(RATIO / np.tan(0.5 * theta))
    T = np.eye(4)
    points, axes = [], []
    for turn, length, twist in ((theta, A, ALPHA), (other, B, BETA), (-theta, A, ALPHA), (-other, B, BETA)):
        points.append(T[:3, 3].copy())
        axes.append(T[:3, 2].copy())
        c, s, ca, sa = np.cos(turn), np.sin(turn), np.cos(twist), np.sin(twist)
        # Denavit and Hartenberg: turn about z, length along x, twist about x
        T = T @ np.array(
            [[c, -s * ca, s * sa, length * c], [s, c * ca, -c * sa, length * s], [0, sa, ca, 0], [0, 0, 0, 1.0]]
        )
    np.testing.assert_allclose(T, np.eye(4), atol=1e-12)  # it closes
    return np.array(points), np.array(axes)


def thrown(step: float, integrator: Integrator) -> tuple[Motion, Array, Array]:
    """Bennett's linkage on its held first link, its second turning about the first's end at 60 rad/s."""
    points, axes = bennett(1.9)
    place = [tuple(p.tolist()) for p in points]
    names = ("base", "first", "second", "third")
    ends = np.roll(points, -1, axis=0)
    bodies = [
        Body(tuple(p.tolist()), 2e-3, (2e-3, 3e-3, 4e-3), n) for n, p in zip(names, 0.5 * (points + ends), strict=True)
    ]
    joints = [
        Hinge((names[i - 1], place[i]), (names[i], place[i]), tuple(axes[i].tolist()))  # type: ignore[arg-type]
        for i in range(4)
    ]
    model = RodModel(bodies=bodies, joints=joints, supports=[Hold(("base", bodies[0].centre))])
    # velocities of all links from the closed form, by a difference in the angle
    eps = 1e-6
    v = np.zeros((4, 6))
    (low, l_axes), (high, h_axes) = bennett(1.9 - eps), bennett(1.9 + eps)
    for k, name in enumerate(names):
        frames = []
        for p, a in ((low, l_axes), (high, h_axes)):
            # seen from the base link, from point 0 to point 1 with axis 0
            x = (p[1] - p[0]) / np.linalg.norm(p[1] - p[0])
            base = np.array([x, np.cross(a[0], x), a[0]])
            q, r = p[k], p[(k + 1) % 4]
            e = base @ (r - q) / np.linalg.norm(r - q)
            z = base @ a[k]
            frames.append((base @ (0.5 * (q + r) - p[0]), np.array([e, np.cross(z, e), z])))
        spin = frames[1][1].T @ frames[0][1]
        w = np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]) / (4.0 * eps)
        x = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
        home = np.array([x, np.cross(axes[0], x), axes[0]])
        v[model.atlas.node_of[name, 0]] = 60.0 * np.concatenate(
            [home.T @ (frames[1][0] - frames[0][0]) / (2.0 * eps), home.T @ w]
        )
    settings = SETTINGS[integrator]
    every = round(0.01 / step)
    return (
        dynamics(model, 0.1, step, start=replace(model.drawn(), v=v), sample_every=every, settings=settings),
        points,
        axes,
    )


@pytest.mark.parametrize("integrator", list(Integrator))
def test_bennetts_linkage_turns_by_its_own_relation(integrator: Integrator) -> None:
    """``tan(theta_1 / 2) tan(theta_2 / 2)`` stays, joints stay closed, energy is kept at second order.

    Catches: a compliance that lets the ring open, redundant rows of any but plane rings.
    """
    rests = []
    for step in (1e-3, 5e-4) if integrator is Integrator.implicit else (1e-4, 5e-5):
        motion, points, axes = thrown(step, integrator)
        state = motion.state(-1)
        names = ("base", "first", "second", "third")
        p = np.array([state.at((names[i], tuple(points[i].tolist()))) for i in range(4)])  # type: ignore[arg-type]
        q = np.array([state.at((names[i - 1], tuple(points[i].tolist()))) for i in range(4)])  # type: ignore[arg-type]
        tips = [tuple((points[i] + axes[i]).tolist()) for i in range(4)]
        z = np.array([state.at((names[i], tips[i])) for i in range(4)]) - p  # type: ignore[arg-type]
        across = np.array([state.at((names[i - 1], tips[i])) for i in range(4)]) - q  # type: ignore[arg-type]
        assert np.abs(p - q).max() <= 1e-4
        assert np.abs(z - across).max() <= 1e-4
        angles = []
        for i in (1, 2):
            before, after = p[i] - p[i - 1], p[(i + 1) % 4] - p[i]
            angles.append(np.arctan2(np.cross(before, after) @ z[i], before @ after))
        assert np.tan(0.5 * angles[0]) * np.tan(0.5 * angles[1]) == pytest.approx(-RATIO, rel=2e-5)
        energy = motion.energy("kinetic")
        rests.append(np.abs(energy / energy[0] - 1.0).max())
        assert np.abs(motion.x - motion.x[0]).max() > 2.0
    assert rests[1] <= 0.3 * rests[0] <= 0.3 * 5e-4
