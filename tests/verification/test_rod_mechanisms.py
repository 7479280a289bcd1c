"""Joints, rigid parts, members and supports of rod assemblies, each against a closed form.

Problem: hanging bars, a linkage, offsets, rollers, tapered and naturally curved rods, following loads, muscle against a
spring, buoyancy, moving supports, floating machines.
Exact answer and its source: statics on paper, arithmetic in each test.
What is measured: positions, forces, reactions.
Tolerance and why: the solver's (1e-11 of the largest force, over the stiffness in play) where the element is exact;
otherwise its known error.
What it cannot see: contact and motion.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import (
    Body,
    Gravity,
    Hinge,
    Hold,
    Muscle,
    PointLoad,
    Resistance,
    Rigid,
    Spherical,
    Spring,
)
from fem_biobot.rod.statics import RodStep, reaction, statics
from fem_biobot.verification.rod_turned import PLAIN, assembly
from tests.helpers import rotation
from tests.oracles.cosserat import follower_tip
from tests.rods import arc, rod_of, stiff, straight

TIP = ("rod", -1)
DOWN = (0.0, 0.0, -1.0)


@pytest.mark.parametrize("kind", ["hinge", "spherical"])
def test_hanging_bars_line_up_with_what_they_carry(kind: str) -> None:
    """Two bars under weights at their ends and a sideways force: each along its own resultant, stretched by it.

    Catches: a joint that carries moment, or lets go; a multiplier of the wrong sign; bars that do not stretch.
    """
    W1, W2, F, EA = 2.0, 3.0, 4.0, 500.0
    upper, lower = straight(3, 1.5, DOWN), straight(2, 2.0, DOWN) + np.array([0.0, 0.0, -1.5])
    stiffness = (300.0, 300.0, EA, 5.0, 6.0, 4.0)
    rods = [rod_of(upper, stiffness, name="upper"), rod_of(lower, stiffness, name="lower")]
    ends = ("upper", -1), ("lower", 0)
    joint = Hinge(*ends, axis=(0.0, 1.0, 0.0)) if kind == "hinge" else Spherical(*ends)
    # a spherical joint needs the lower bar kept from spinning
    spin = [Hold(("lower", 0), "", "z")] if kind == "spherical" else []
    loads = [PointLoad(("upper", -1), (0.0, 0.0, -W1)), PointLoad(("lower", -1), (F, 0.0, -W2))]
    found = statics(RodModel(rods, [joint], supports=[Hold(("upper", 0), "xyz", "xz"), *spin], loads=loads))
    state = found.last
    # as drawn nothing is stretched, and the tangent has no stiffness: the way is down
    assert found.descents == 1
    top, bottom = np.array([F, 0.0, -W1 - W2]), np.array([F, 0.0, -W2])
    elbow = 1.5 * (1 / np.linalg.norm(top) + 1 / EA) * top
    hand = elbow + 2.0 * (1 / np.linalg.norm(bottom) + 1 / EA) * bottom
    np.testing.assert_allclose(state.at(("upper", -1)), elbow, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(state.at(("lower", -1)), hand, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(reaction(state, ("upper", 0))[:3], -top, rtol=0.0, atol=1e-8)
    assert state.stable


def test_a_parallel_linkage_of_rigid_bodies_hangs_along_the_force() -> None:
    """Cranks turn to ``tan = F / W`` though four hinges about one axis hold the coupler more than once.

    Catches: redundant joints that make the system singular; a hinge that blocks its own axis.
    """
    F, W, crank, base = 3.0, 2.0, 1.7, 2.5
    bodies = [
        Body((0.0, 0.0, -crank / 2), 0.1, (1.0, 1.0, 1.0), "left"),
        Body((base, 0.0, -crank / 2), 0.1, (1.0, 1.0, 1.0), "right"),
        Body((base / 2, 0.0, -crank), 0.1, (1.0, 1.0, 1.0), "coupler"),
    ]
    axis, low = (0.0, 1.0, 0.0), [(0.0, 0.0, -crank), (base, 0.0, -crank)]
    joints = [Hinge((n, p), ("coupler", p), axis) for n, p in zip(("left", "right"), low, strict=True)]
    supports = [Hold((n, p), "xyz", "xz") for n, p in (("left", (0.0, 0.0, 0.0)), ("right", (base, 0.0, 0.0)))]
    load = PointLoad(("coupler", (base / 2, 0.0, -crank)), (F, 0.0, -W))
    state = statics(RodModel(joints=joints, bodies=bodies, supports=supports, loads=[load])).last
    size = np.hypot(F, W)
    for place, start in zip(low, (0.0, base), strict=True):
        expected = [start + crank * F / size, 0.0, -crank * W / size]
        np.testing.assert_allclose(state.at(("coupler", place)), expected, rtol=0.0, atol=1e-9)
    borne = sum(reaction(state, (n, p))[:3] for n, p in (("left", (0.0, 0.0, 0.0)), ("right", (base, 0.0, 0.0))))
    np.testing.assert_allclose(borne, [-F, 0.0, W], rtol=0.0, atol=1e-9)


def test_a_hinge_turns_all_the_way() -> None:
    """A crank driven past half a turn by a following moment against a spring at its axis stays a hinge.

    The moment makes no difference to where the hinge lets it go: here a spiral rod about the axis turns by M L / G J.

    Catches: rotation rows that vanish at half a turn.
    """
    GJ, length, wanted = 2.0, 3.0, 1.4 * np.pi
    spiral = rod_of(straight(6, length, (0.0, 0.0, 1.0)), stiff(twist=GJ, other=1e4), name="spiral")
    arm = Body((1.0, 0.0, length), 1.0, (1.0, 1.0, 1.0), "arm")
    model = RodModel(
        [spiral],
        [Rigid(("spiral", -1), ("arm", (0.0, 0.0, length)))],
        [arm],
        [Hold(("spiral", 0)), Hold(("arm", (0.0, 0.0, length)), "xy", "xy")],
        [PointLoad(("arm", (1.0, 0.0, length)), moment=(0.0, 0.0, wanted * GJ / length))],
    )
    state = statics(model).last
    np.testing.assert_allclose(
        state.at(("arm", (1.0, 0.0, length))), [np.cos(wanted), np.sin(wanted), length], rtol=0.0, atol=1e-9
    )


@pytest.mark.parametrize("loaded", ["body", "rod"])
def test_a_rigid_arm_adds_its_lever(loaded: str) -> None:
    """A force at the end of an arm beyond the rod's tip: bending, shear and the arm's turn, at small load.

    Catches: the offset forgotten in stiffness or load, turned by the wrong frame.
    """
    L, a, EI, GA, F, n = 2.0, 0.7, 3.0, 40.0, 1e-6, 3
    rod = rod_of(straight(n, L), (GA, GA, 60.0, EI, EI, 2.0))
    end = (L + a, 0.3, 0.0)
    arm = Body((L + 0.4, 0.1, 0.0), 1.0, (1.0, 1.0, 1.0), "arm")
    other = rod_of([[L + a, 0.3, 0.0], [L + a, 0.9, 0.0]], (GA, GA, 60.0, EI, EI, 2.0), name="other")
    parts = ([rod], [Rigid(TIP, ("arm", end))], [arm])
    place = ("arm", end)
    if loaded == "rod":
        parts, place = ([rod, other], [Rigid(TIP, ("other", 0))], []), ("other", 0)
    model = RodModel(*parts, supports=[Hold(("rod", 0))], loads=[PointLoad(place, (0.0, F, 0.0))])
    sinks = L**3 / (3 * EI) + L / GA + a * L**2 / EI + a * a * L / EI
    found = statics(model).last.displacement(place) / F
    np.testing.assert_allclose(found[1], sinks, rtol=1e-6)
    # the arm's sideways part moves its end along the rod, by the turn at the tip
    np.testing.assert_allclose(found[0], -0.3 * (L**2 / 2 + a * L) / EI, rtol=1e-5)


def test_a_beam_on_two_supports() -> None:
    """Held at one end, on rollers at the other: ``F L^3 / 48 E I + F L / 4 G A`` at its middle, half the force each.

    Catches: a partial hold that holds rotations too, rows of the wrong component.
    """
    L, EI, GA, F, n = 3.0, 2.0, 30.0, 1e-6, 4
    rod = rod_of(straight(n, L), (GA, GA, 60.0, EI, EI, 2.0))
    supports = [Hold(("rod", 0), "xyz", "x"), Hold(TIP, "yz", "")]
    model = RodModel([rod], supports=supports, loads=[PointLoad(("rod", n // 2), (0.0, 0.0, -F))])
    state = statics(model).last
    expected = L**3 / (48 * EI) + L / (4 * GA)
    np.testing.assert_allclose(-state.displacement(("rod", n // 2))[2] / F, expected, rtol=1e-6)
    for place in (("rod", 0), TIP):
        np.testing.assert_allclose(reaction(state, place), [0, 0, F / 2, 0, 0, 0], rtol=0.0, atol=1e-7 * F)


def test_a_tapered_rod_turns_by_the_integral_of_its_flexibility() -> None:
    """``M L / (EI_0 c) ln(1 + c)`` for EI_0 (1 + c s / L), by large turns; midpoints of order 2.

    Catches: one section for all elements, sections in reverse order.
    """
    L, M, c = 2.0, 3.0, -0.6
    found = []
    for n in (8, 16, 32):
        middle = (np.arange(n) + 0.5) / n
        parts = [rod_of(straight(1), stiff(1.3 * (1 + c * s), 1e6)).section for s in middle]
        base = rod_of(straight(n, L), stiff(1.3, 1e6))
        rod = type(base)(base.points, [p[0] for p in parts], base.material)
        model = RodModel([rod], supports=[Hold(("rod", 0))], loads=[PointLoad(TIP, moment=(0.0, 0.0, M))])
        turn = statics(model).last.directors("rod")[-1, 2]
        found.append(np.arctan2(turn[1], turn[0]) % (2 * np.pi))
    exact = M * L / 1.3 * np.log(1 + c) / c % (2 * np.pi)
    errors = np.abs(np.array(found) - exact)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)
    np.testing.assert_allclose(found[-1] + (found[-1] - found[-2]) / 3, exact, rtol=1e-5)


def test_a_ring_is_opened_by_its_own_moment() -> None:
    """A rod drawn as a ring of radius r, free of stress, is straightened by a moment E I / r, to rounding.

    Catches: natural curvature left out or of the wrong sign, chord lengths for arcs.
    """
    r, EI, n = 1.7, 2.2, 12
    ring = rod_of(arc(n, r, 2 * np.pi), (50.0, 60.0, 70.0, EI, EI, 1.9))
    model = RodModel([ring], supports=[Hold(("rod", 0))], loads=[PointLoad(TIP, moment=(0.0, 0.0, -EI / r))])
    state = statics(model, tolerance=1e-13).last
    np.testing.assert_allclose(state.points("rod"), straight(n, 2 * np.pi * r), rtol=0.0, atol=1e-10 * r)


def test_a_rod_drawn_straight_takes_its_natural_curvature() -> None:
    """Without loads it lies on the helix of its natural curvature and twist, free of stress.

    Catches: natural strains ignored, components exchanged; a force scale of zero.
    """
    k, t, n = 0.9, 0.4, 9
    rod = rod_of(straight(n, 3.0), (50.0, 60.0, 70.0, 2.0, 3.0, 1.0), natural_curvature=(0.0, k, t), normal=(0, 1, 0))
    state = statics(RodModel([rod], supports=[Hold(("rod", 0))])).last
    assert state.energy < 1e-18 * 2.0 * k**2 * 3.0
    # a helix about the constant spin k d2 + t d3: each node's directors are turned by the same vector
    R = np.swapaxes(state.directors("rod"), 1, 2)
    for a, b in pairwise(R):
        spin = a.T @ b
        vector = np.array([spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]])
        w = np.hypot(k, t)
        np.testing.assert_allclose(vector, 2 * np.sin(w / 3) / w * np.array([0.0, k, t]), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("tip", [(0.0, 3.0), (-1.2, 2.0)])
def test_a_following_tip_force(tip: tuple[float, float]) -> None:
    """A force fixed to the tip's directors, against the initial value problem seen from the tip.

    Catches: a dead force, a load stiffness of the wrong sign, components taken along the wrong axes.
    """
    found = []
    for n in (20, 40):
        rod = rod_of(straight(n), stiff())
        load = PointLoad(TIP, force=(*tip, 0.0), following=True)
        found.append(statics(RodModel([rod], supports=[Hold(("rod", 0))], loads=[load])).last.at(TIP)[:2])
    exact = follower_tip(1.0, 1.0, tip)
    np.testing.assert_allclose(found[1] + (found[1] - found[0]) / 3, exact, rtol=0.0, atol=2e-5)
    assert np.linalg.norm(found[1] - exact) < 2e-3


@pytest.mark.parametrize("resistance", list(Resistance))
def test_a_muscle_shortens_against_a_spring(resistance: Resistance) -> None:
    """Eq. 2: ``A (gamma sin(theta) T + E (s - 1) / s) = k L (1 - s)``; states at several tensions and drives.

    Catches: gamma twice, the cosine, drive on the passive part, the factor of a step on resistance.
    """
    L, A, E, k, gamma, theta = 4.0, 0.65, 10.0, 0.9, 0.8, 1.1
    block = Body((L, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0), "block")
    middle = ("block", (L, 0.0, 0.0))
    ground = Body((0.0, 0.0, 0.0), 1.0, (1.0, 1.0, 1.0), "ground")
    muscle = Muscle(("ground", (0.0, 0.0, 0.0)), middle, A, E, 9.09, 1.3, gamma, theta, resistance)
    spring = Spring(middle, (L + 2.0, 0.0, 0.0), k)
    supports = [Hold(("ground", (0.0, 0.0, 0.0))), Hold(middle, "yz")]
    model = RodModel(bodies=[ground, block], supports=supports, members=[muscle, spring])
    for drive in (0.0, 0.7):
        found = statics(model, [RodStep(1.0, 0.5), 1.0], drive=drive)
        for state, factor in zip(found.states, (0.5, 1.0), strict=True):
            T = factor * (9.09 + drive * 1.3)

            def pull(s: float, T: float = T) -> float:
                law = (s - 1) / s if resistance is Resistance.eq2 else (s - s**-2) / 3
                return A * (gamma * np.sin(theta) * T + E * law)

            s = brentq(lambda s: pull(s) - k * L * (1 - s), 0.1, 1.0, xtol=1e-14)
            np.testing.assert_allclose(state.stretch("muscle"), s, rtol=1e-9)
            np.testing.assert_allclose(state.muscle_force("muscle"), k * L * (1 - s), rtol=1e-9)


def test_weight_less_buoyancy_is_borne_by_the_support() -> None:
    """``(density - medium) volume g``, and its moment about the clamp.

    Catches: buoyancy added to weight, or with the wrong lever; one of them without the step's factor.
    """
    from fem_biobot.rod.records import Rod
    from fem_biobot.rod.section import RodMaterial, Section

    rod = Rod(straight(10, 8.0), Section.rectangle(2.0, 0.5), RodMaterial(young=1e6, density=1.1e-6, poisson=0.3))
    model = RodModel([rod], supports=[Hold(("rod", 0))], loads=[Gravity((0.0, 0.0, -9810.0), 1.0e-6)])
    for state in statics(model, [0.4, 1.0]).states:
        weight = state.load * (1.1e-6 - 1.0e-6) * 8.0 * 1.0 * 9810.0
        found = reaction(state, ("rod", 0))
        # positions are rounded to 1e-15 mm, which is 1e-9 mN of E A / h
        np.testing.assert_allclose(found[:3], [0.0, 0.0, weight], rtol=0.0, atol=1e-8)
        np.testing.assert_allclose(found[4], -weight * state.centre_of_mass[0], rtol=1e-3)


def test_supports_move_with_the_load_factor() -> None:
    """A bar held at both ends, one of which moves along it and turns about it: ``E A d / L`` and ``G J t / L``.

    Eleven radians are more than a turn, also from the first state to the second.

    Catches: turns taken modulo a turn, motion not scaled by the factor, a support moved twice.
    """
    L, EA, GJ, d, t = 5.0, 70.0, 1.9, 0.4, 11.0
    rod = rod_of(straight(10, L), (50.0, 60.0, EA, 400.0, 400.0, GJ))
    moving = Hold(TIP, displacement=(d, 0.0, 0.0), turn=(t, 0.0, 0.0))
    found = statics(RodModel([rod], supports=[Hold(("rod", 0)), moving]), [0.3, 1.0])
    for state, factor in zip(found.states, (0.3, 1.0), strict=True):
        expected = [EA * d / L * factor, 0.0, 0.0, GJ * t / L * factor, 0.0, 0.0]
        np.testing.assert_allclose(reaction(state, TIP), expected, rtol=0.0, atol=1e-8)
        np.testing.assert_allclose(state.displacement(TIP), [factor * d, 0.0, 0.0], rtol=0.0, atol=1e-12)


def test_a_partial_support_moves_too() -> None:
    """A simply supported beam whose far end sinks turns as a rigid one; nothing is strained.

    Catches: the world's offset taken from the drawing only.
    """
    L, sink = 4.0, 0.9
    rod = rod_of(straight(6, L), (50.0, 60.0, 70.0, 2.0, 3.0, 1.0))
    supports = [Hold(("rod", 0), "xyz", "x"), Hold(TIP, "yz", "", displacement=(7.0, 0.0, -sink))]
    state = statics(RodModel([rod], supports=supports)).last
    expected = [np.sqrt(L**2 - sink**2), 0.0, -sink]
    np.testing.assert_allclose(state.at(TIP), expected, rtol=0.0, atol=1e-9)
    assert state.energy < 1e-15


def _bot(supports: list[Hold]) -> RodModel:
    """A beam with two arms and a muscle between them, drawn askew."""
    R = rotation(11)
    beam = rod_of(straight(12, 14.0) @ R.T, (200.0, 210.0, 320.0, 25.0, 40.0, 30.0), name="beam")
    feet = [(R @ np.array([x, 0.3, -3.0])).tolist() for x in (0.0, 14.0)]
    arms = [Body(tuple(f), 1e-6, (1e-6, 1e-6, 1e-6), name) for f, name in zip(feet, ("a", "b"), strict=True)]
    joints = [Rigid(("beam", 0), ("a", tuple(feet[0]))), Rigid(("beam", -1), ("b", tuple(feet[1])))]
    muscle = Muscle(("a", tuple(feet[0])), ("b", tuple(feet[1])), 0.65, 10.0, 9.09, 1.3)
    return RodModel([beam], joints, arms, supports, members=[muscle])


def test_a_floating_machine_is_what_any_neutral_support_gives() -> None:
    """Held nowhere, at its end or in its middle: the same force, stretch, energy and strains; no reaction.

    Catches: a support that bears force, a state that depends on where it is held.
    """
    floating = statics(_bot([]), free="hold").last
    for place in (("beam", 5), ("beam", -1)):
        held = statics(_bot([Hold(place)])).last
        for name in ("stretch", "muscle_force"):
            np.testing.assert_allclose(getattr(held, name)("muscle"), getattr(floating, name)("muscle"), rtol=1e-9)
        np.testing.assert_allclose(held.energy, floating.energy, rtol=1e-8)
        np.testing.assert_allclose(held.strain("beam")[1], floating.strain("beam")[1], rtol=0.0, atol=1e-9)
        assert np.abs(reaction(held, place)).max() < 1e-9 * held.muscle_force("muscle")


def test_r9_speaks_of_an_assembly_that_is_strained() -> None:
    """The assembly that is turned stretches, bends and twists in both rods, and its muscle pulls.

    Catches: an invariance of nothing.
    """
    state = statics(assembly(PLAIN)).last
    assert state.energy > 0.01
    for name in ("bent", "bar"):
        eps, kappa = state.strain(name)
        assert np.abs(eps).max() > 1e-3
        assert (np.abs(kappa).max(axis=0) > 1e-4).all()
    assert state.muscle_force("muscle") > 0.1
