"""Relatives of R6: natural frequencies of rods and assemblies.

Problem: a free rod, a pendulum, a string, a loaded column, a mass on a weightless rod.
Exact answer and its source: closed forms of textbooks, arithmetic in each test.
What is measured: frequencies; shapes where they are known.
Tolerance and why: order 2 and the limit it extrapolates to; rounding where nothing is discretised.
What it cannot see: damping; how a motion of finite size goes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fem_biobot.rod.model import RodModel
from fem_biobot.rod.modes import modes
from fem_biobot.rod.records import Body, Gravity, Hinge, Hold, Muscle, PointLoad, Rigid, Spring
from fem_biobot.rod.statics import statics
from tests.rods import rod_of, stiff, straight

TIP = ("rod", -1)


def test_rigid_motions_have_no_frequency() -> None:
    """Six exact zeros, drawn anywhere, and shapes that strain nothing.

    Catches: zeros as rounding leaves them, negative squares that become no numbers.
    """
    rod = rod_of(straight(12, 5.0, (0.3, 0.5, -0.7)), (40.0, 50.0, 70.0, 3.0, 2.0, 1.0), mass_per_length=1e-6)
    found = modes(RodModel([rod]), count=7)
    assert (found.frequencies[:6] == 0.0).all()
    assert found.frequencies[6] > 1.0
    turns = found.shapes[:6, :, 3:]
    np.testing.assert_allclose(turns, turns[:, :1] * np.ones((1, 13, 1)), rtol=0.0, atol=1e-6 * np.abs(turns).max())


def test_a_pendulum_of_one_body_swings_as_it_should() -> None:
    """``w^2 = m g l / (J + m l^2)`` about either axis, and it may spin freely.

    Catches: the geometric stiffness of joints, without which nothing pulls it back.
    """
    m, length, J, g = 2.0, 5.0, (11.0, 7.0, 3.0), 9810.0
    body = Body((0.0, 0.0, -length), m, J)
    model = RodModel(bodies=[body], supports=[Hold(("body", (0.0, 0.0, 0.0)), rotation="")], loads=[Gravity()])
    found = modes(model)
    expected = [m * g * length / (j + m * length**2) for j in J[:2]]
    np.testing.assert_allclose(found.squares, [0.0, *expected], rtol=1e-12)
    upright = modes(
        RodModel(bodies=[replace(body, centre=(0.0, 0.0, length))], supports=model.supports, loads=model.loads)
    )
    np.testing.assert_allclose(upright.squares, [-expected[1], -expected[0], 0.0], rtol=1e-12)
    assert np.isnan(upright.frequencies[:2]).all()


def test_a_double_pendulum_swings_as_lagrange_says() -> None:
    """Two equal point masses on rods of equal length: ``w^2 = (2 -+ sqrt 2) g / l``.

    The rods are stiff and have no mass, the bodies hardly any inertia.

    Catches: a hinge's multiplier left out of the tangent, masses of joined parts lost.
    """
    g, length = 9810.0, 30.0
    points = straight(1, length, (0.0, 0.0, -1.0))
    rods = [rod_of(points, stiff(1e7, 1e7), name="a"), rod_of(points + points[-1], stiff(1e7, 1e7), name="b")]
    bodies = [Body(tuple(k * points[-1]), 1e-3, (1e-9, 1e-9, 1e-9), name) for k, name in ((1, "p"), (2, "q"))]
    joints = [
        Rigid(("a", -1), ("p", tuple(points[-1]))),
        Hinge(("a", -1), ("b", 0), (0.0, 1.0, 0.0)),
        Rigid(("b", -1), ("q", tuple(2 * points[-1]))),
    ]
    model = RodModel(rods, joints, bodies, [Hold(("a", 0), "xyz", "xz")], [Gravity()])
    found = modes(model, statics(model).last, 2).squares
    np.testing.assert_allclose(found, (2 + np.array([-1, 1]) * np.sqrt(2)) * g / length, rtol=1e-4)


def test_a_string_owes_its_frequency_to_its_tension() -> None:
    """``w = k pi / L sqrt(T / m)`` for a thin rod that is drawn out between its supports.

    Catches: geometric stiffness of rods from the drawn state, a state given and not used.
    """
    L, EA, m, stretch = 10.0, 500.0, 1e-6, 0.02
    found = []
    for n in (20, 40):
        rod = rod_of(straight(n, L), (300.0, 300.0, EA, 1e-4, 1e-4, 1e-3), mass_per_length=m)
        supports = [Hold(("rod", 0), "xyz", "x"), Hold(TIP, "xyz", "", displacement=(stretch * L, 0.0, 0.0))]
        model = RodModel([rod], supports=supports)
        found.append(modes(model, statics(model).last, 4).squares[::2])
    # the string's length has grown and its mass has not; E I adds (k pi / L)^2 E I / T, 1e-6
    T, length = EA * stretch, L * (1 + stretch)
    expected = (np.array([1, 2]) * np.pi) ** 2 * T / (m * L * length)
    np.testing.assert_allclose(found[1] + (found[1] - found[0]) / 3, expected, rtol=2e-3)


def test_a_column_slows_down_as_it_nears_its_buckling_load() -> None:
    """Pinned at both ends: ``w^2 = w_0^2 (1 - P / P_cr)``, below, and beyond where it grows.

    Catches: a compressed rod that stiffens, an unstable equilibrium with a frequency.
    """
    L, EI, m, n = 4.0, 2.0, 1e-6, 60
    rod = rod_of(straight(n, L), (1e6, 1e6, 1e6, 1e3, EI, 1e3), mass_per_length=m, normal=(0.0, 1.0, 0.0))
    supports = [Hold(("rod", 0), "xyz", "xy"), Hold(TIP, "yz", "xy")]
    # the second turn held at both ends keeps bending in one plane; pinned about z
    squares = []
    for share in (0.0, 0.6, 1.3):
        load = PointLoad(TIP, force=(-share * np.pi**2 * EI / L**2, 0.0, 0.0))
        model = RodModel([rod], supports=supports, loads=[load])
        state = statics(model).last
        found = modes(model, state, 1)
        squares.append(found.squares[0])
        assert np.isnan(found.frequencies[0]) == (share > 1.0)
        assert state.stable == (share < 1.0)
    np.testing.assert_allclose(np.array(squares) / (np.pi**4 * EI / (m * L**4)), [1.0, 0.4, -0.3], rtol=0.0, atol=3e-3)


def test_a_mass_on_a_weightless_rod_and_a_spring() -> None:
    """``w^2 = (3 E I / L^3 + k) / m``: nodes without mass follow.

    Catches: a singular mass matrix, members left out of the stiffness, elements that do not bend within.
    """
    L, EI, m, k, n = 3.0, 2.0, 5e-4, 0.1, 3
    rod = rod_of(straight(n, L), stiff(EI, 1e6))
    mass = Body((L, 0.0, 0.0), m, (1e-12, 1e-12, 1e-12))
    spring = Spring(TIP, (L, 0.0, 2.0), k)
    model = RodModel([rod], [Rigid(TIP, ("body", (L, 0.0, 0.0)))], [mass], [Hold(("rod", 0))], members=[spring])
    found = modes(model, count=2).squares
    soft = 3 * EI / L**3
    np.testing.assert_allclose(found, [soft / m, (soft + k) / m], rtol=1e-5)


def test_lanczos_finds_what_all_eigenvalues_are() -> None:
    """A rod of more unknowns than are solved densely, floating under its own muscle's tension.

    Catches: modes missed or doubled by the iteration, a shift that spoils digits.
    """
    rod = rod_of(straight(130, 10.0), (400.0, 500.0, 700.0, 30.0, 20.0, 10.0), mass_per_length=1e-6)
    muscle = Muscle(("rod", 20), ("rod", 110), 0.5, 2.0, 1.0)
    model = RodModel([rod], members=[muscle])
    state = statics(model, free="hold").last
    fast = modes(model, state, 10)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fem_biobot.rod.modes._DENSE", 10_000)
        slow = modes(model, state, 10)
    np.testing.assert_allclose(fast.squares[6:], slow.squares[6:], rtol=1e-6)
    assert (fast.squares[:6] == 0.0).all()
    mass = np.array([*model.assembly.inertia.mass])
    kinetic = np.einsum("cni,n,dni->cd", fast.shapes[6:, :, :3], mass, fast.shapes[6:, :, :3])
    # rotary inertia is E I / E A of it
    np.testing.assert_allclose(kinetic, np.eye(4), rtol=0.0, atol=0.2)
