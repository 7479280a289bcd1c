"""R8 and relatives: buckling, post-buckling and snap-through of rods.

Problem: Euler's column before and after its load; a shallow truss; a twisted rod with slack that buckles into a helix.
Exact answer and its source: Euler's load and the elliptic integrals of the elastica; the truss in closed form; the
localised solution of a long twisted rod (Gazzola et al. 2018, whose moment and tension VERIFICATION prints).
What is measured: where the smallest stiffness changes sign; the states beyond.
Tolerance and why: order 2 and its limit.
What it cannot see: dynamics of the jump; whether the helix would touch itself.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Body, Hold, PointLoad, Spring
from fem_biobot.rod.statics import statics
from fem_biobot.verification.rod_systems import helix, localised_angle
from tests.helpers import slope
from tests.rods import rod_of, stiff, straight

TIP = ("rod", -1)


def _column(n: int, load: float, aside: float = 0.0, other: float = 1e8) -> RodModel:
    push = PointLoad(TIP, force=(-load, aside, 0.0))
    return RodModel([rod_of(straight(n), stiff(twist=0.7, other=other))], supports=[Hold(("rod", 0))], loads=[push])


def _critical(n: int) -> float:
    """Load at which the straight column loses its stability, by bisection."""
    low, high = 2.0, 3.0
    while high - low > 1e-8:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if statics(_column(n, middle, other=1e6)).stable else (low, middle)
    return low


def test_a_column_is_stable_up_to_eulers_load() -> None:
    """The sign of the smallest stiffness changes at a load that converges at order 4 to pi^2 / 4.

    Stretch changes it by P / E A, 2.5e-6.

    Catches: geometric stiffness with the wrong sign or factor, of an element's own S left out (order 2), signs of
    pivots counted wrongly.
    """
    exact = np.pi**2 / 4
    found = [_critical(n) for n in (3, 6, 12)]
    assert slope([4.0, 2.0, 1.0], [abs(f - exact) for f in found]) == pytest.approx(4.0, abs=0.05)
    assert found[-1] == pytest.approx(exact, rel=3e-6)


@pytest.mark.parametrize("alpha", [0.7, 2.0])
def test_a_column_beyond_eulers_load_finds_the_elastica(alpha: float) -> None:
    """Pushed aside and let go, it rests on the buckled branch, whose tip turned by alpha is known; both are reported.

    With k = sin(alpha / 2): load (2 K / pi)^2 of Euler's, tip at 2 E / K - 1 along and 2 k / K across.

    Catches: a post-buckled state refused, the straight one called stable.
    """
    m = np.sin(alpha / 2) ** 2
    load, along, across = ellipk(m) ** 2, 2 * ellipe(m) / ellipk(m) - 1, 2 * np.sqrt(m) / ellipk(m)
    tips = []
    for n in (20, 40):
        model = _column(n, load)
        assert not statics(model).stable
        aside = statics(_column(n, load, aside=0.1)).last
        begin = RodState(model, aside.x, aside.Q)
        state = statics(model, start=begin).last
        assert state.stable
        tips.append(state.at(TIP))
    limit = tips[1] + (tips[1] - tips[0]) / 3
    np.testing.assert_allclose(limit, [along, across, 0.0], rtol=0.0, atol=3e-5)


def test_a_shallow_truss_snaps_through() -> None:
    """Beyond its limit load the truss rests on the other side, where its two springs carry the load in tension.

    Catches: a fold taken for a failure, a state between, the jump landing on an unstable branch.
    """
    half, height, k = 3.0, 0.8, 5.0
    free = np.hypot(half, height)
    block = Body((0.0, 0.0, height), 1.0, (1.0, 1.0, 1.0))
    top = ("body", (0.0, 0.0, height))
    springs = [Spring(top, (side * half, 0.0, 0.0), k) for side in (-1.0, 1.0)]

    def force(z: float) -> float:
        return 2 * k * (free / np.hypot(half, z) - 1.0) * z

    # the fold: d force / dz = 0 at (half^2 + z^2)^(3/2) = free half^2
    fold = np.sqrt((free * half**2) ** (2 / 3) - half**2)
    rail = Hold(top, translation="xy")
    model = RodModel(
        bodies=[block], supports=[rail], members=springs, loads=[PointLoad(top, force=(0.0, 0.0, -force(fold)))]
    )
    found = statics(model, [0.9, 1.2])
    for state, factor, (low, high) in zip(found.states, (0.9, 1.2), ((fold, height), (-5.0, -height)), strict=True):
        z = brentq(lambda z, by=factor: force(z) - by * force(fold), low, high, xtol=1e-14)
        np.testing.assert_allclose(state.at(top), [0.0, 0.0, z], rtol=0.0, atol=1e-9)
        assert state.stable
    assert found.descents == 1


def test_r8_the_finest_helix_needs_no_extrapolation_to_look_right() -> None:
    """Its envelope is within 1.5 % of the peak everywhere, and its twist is the same all along.

    Catches: elements that lose turns, bending and twist exchanged.
    """
    state = helix(400)
    angle = np.arccos(np.clip(state.directors("rod")[:, 2, 2], -1.0, 1.0))
    expected = localised_angle(np.linspace(-0.5, 0.5, 401))
    assert np.abs(angle - expected).max() < 0.015 * expected.max()
    twist = state.resultants("rod")[1][:, 2]
    # a round rod without couple along it carries one torsional moment
    np.testing.assert_allclose(twist, twist.mean(), rtol=5e-3)
