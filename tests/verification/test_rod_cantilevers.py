"""R1 to R5: cantilevers at large deflection.

Problem: roll-up by an end moment; tip force and distributed dead load; the 45-degree bend; a short thick beam.
Exact answer and its source: the circle; the elastica's digits of VERIFICATION; the differential equations of the rod,
solved in tests/oracles/cosserat.py; Timoshenko's formulas.
What is measured: the tip, or the whole line.
Tolerance and why: rounding for constant strain; else the declared order, and the limit that it extrapolates to. The
inextensible, unshearable limit is taken by stiffnesses of 1e8 E I / L^2: what remains is P / EA, below 1e-7.
What it cannot see: joints, bodies, members; the path to these states.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import DistributedLoad, Hold, PointLoad
from fem_biobot.rod.statics import reaction, statics
from tests.helpers import slope
from tests.oracles.cosserat import cantilever_tip
from tests.rods import arc, rod_of, stiff, straight

BASE = Hold(("rod", 0))
TIP = ("rod", -1)


def extrapolated(values: list[np.ndarray]) -> np.ndarray:
    """Limit of values on meshes refined by two, of order 2."""
    return values[-1] + (values[-1] - values[-2]) / 3.0


@pytest.mark.parametrize(("share", "tip"), [(1.0, (0.0, 0.0)), (0.5, (0.0, 2.0 / np.pi))])
@pytest.mark.parametrize("n", [7, 24])
def test_r1_an_end_moment_rolls_a_rod_into_a_circle(share: float, tip: tuple[float, float], n: int) -> None:
    """Every node lies on the circle, to rounding, for a section that could stretch, shear and bend otherwise.

    Catches: the chord for the arc, EI of the other axis, a moment that is halved.
    """
    L, EI = 13.0, 2.3
    rod = rod_of(straight(n, L), (40.0, 50.0, 70.0, 5.1, EI, 1.7), normal=(0.0, 1.0, 0.0))
    curvature = 2 * np.pi * share / L
    model = RodModel([rod], supports=[BASE], loads=[PointLoad(TIP, moment=(0.0, 0.0, curvature * EI))])
    state = statics(model, tolerance=1e-13).last
    angle = curvature * np.linspace(0.0, L, n + 1)
    circle = np.stack([np.sin(angle), 1 - np.cos(angle), 0 * angle], axis=1) / curvature
    # residuals of 1e-13 of the moment over the softest stiffness, L^2 / EI
    np.testing.assert_allclose(state.points("rod"), circle, rtol=0.0, atol=1e-11 * L)
    np.testing.assert_allclose(state.at(TIP)[:2] / L, tip, rtol=0.0, atol=1e-11)
    np.testing.assert_allclose(reaction(state, ("rod", 0))[3:], [0.0, 0.0, -curvature * EI], rtol=0.0, atol=1e-10)


def _tip(n: int, load: PointLoad | DistributedLoad) -> np.ndarray:
    model = RodModel([rod_of(straight(n), stiff())], supports=[BASE], loads=[load])
    return statics(model).last.displacement(TIP)


@pytest.mark.parametrize(
    ("P", "w", "u"),
    [(1, 0.301721, 0.056433), (2, 0.493457, 0.160642), (5, 0.713792, 0.387628), (10, 0.810609, 0.554996)],
)
def test_r2_a_tip_force_bends_the_elastica(P: float, w: float, u: float) -> None:
    """The tip converges at order 2 to the tabulated elastica, to its six digits.

    Catches: a force that turns along, a membrane that locks, a load applied twice.
    """
    tips = [_tip(n, PointLoad(TIP, force=(0.0, 0.0, -P))) for n in (20, 40, 80)]
    limit = extrapolated(tips)
    np.testing.assert_allclose([-limit[2], -limit[0]], [w, u], rtol=0.0, atol=1.5e-6)
    assert slope([4.0, 2.0, 1.0], [float(np.linalg.norm(t - limit)) for t in tips]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(("q", "x", "y"), [(5, 0.8467, 0.4959), (15, 0.5296, 0.7860), (25, 0.3862, 0.8559)])
def test_r3_a_dead_load_along_the_rod(q: float, x: float, y: float) -> None:
    """The tip converges at order 2 to the published four digits, and to the differential equation's solution.

    Catches: half an element's load lost at an end, load per present length.
    """
    tips = [_tip(n, DistributedLoad("rod", force=(0.0, -q, 0.0))) for n in (20, 40, 80)]
    limit = extrapolated(tips)
    np.testing.assert_allclose([1 + limit[0], -limit[1]], [x, y], rtol=0.0, atol=6e-5)
    rigid = (np.inf,) * 3 + (1.0,) * 3
    frame = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    exact = cantilever_tip(1.0, rigid, (0.0, 0.0, 0.0), per_length=(0.0, -q, 0.0), frame=frame) - [1.0, 0.0, 0.0]
    # what the extrapolation leaves is of order 4
    np.testing.assert_allclose(limit, exact, rtol=0.0, atol=2e-6)
    errors = [float(np.linalg.norm(t - exact)) for t in tips]
    assert slope([4.0, 2.0, 1.0], errors) == pytest.approx(2.0, abs=0.1)


@cache
def _bend(n: int) -> np.ndarray:
    E = 1e7
    rod = rod_of(arc(n, 100.0, np.pi / 4), (E / 2, E / 2, E, E / 12, E / 12, E / 12))
    model = RodModel([rod], supports=[BASE], loads=[PointLoad(TIP, force=(0.0, 0.0, 600.0))])
    return statics(model).last.displacement(TIP)


def test_r4_the_45_degree_bend() -> None:
    """Eight elements are within 1 % of the quoted displacement; order 2 to the solution of the differential equation.

    Catches: curvature of the drawing lost or counted as strain, torsion and bending exchanged.
    """
    quoted = np.array([-23.5, -13.4, 53.4])
    assert np.linalg.norm(_bend(8) - quoted) < 0.01 * np.linalg.norm(quoted)
    E = 1e7
    frame = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    tip = cantilever_tip(
        25.0 * np.pi, (E / 2, E / 2, E, E / 12, E / 12, E / 12), (0.0, 0.0, 600.0), kappa0=(0.0, 0.01, 0.0), frame=frame
    )
    exact = tip - arc(1, 100.0, np.pi / 4)[-1]
    errors = [float(np.linalg.norm(_bend(n) - exact)) for n in (8, 16, 32)]
    assert slope([4.0, 2.0, 1.0], errors) == pytest.approx(2.0, abs=0.05)
    assert errors[-1] < 2e-4 * np.linalg.norm(exact)
    np.testing.assert_allclose(extrapolated([_bend(16), _bend(32)]), exact, rtol=0.0, atol=1e-5 * np.linalg.norm(exact))


def _thick(n: int, factor: float, force: float) -> float:
    from fem_biobot.rod.records import Rod
    from fem_biobot.rod.section import RodMaterial, Section

    section = Section.circle(0.25, shear_factor=factor)
    rod = Rod(straight(n, 3.0), section, RodMaterial(young=1e6, density=1e-6, shear_modulus=1e4))
    model = RodModel([rod], supports=[BASE], loads=[PointLoad(TIP, force=(0.0, -force, 0.0))])
    return -float(statics(model).last.displacement(TIP)[1])


@pytest.mark.parametrize(("factor", "tip"), [(4 / 3, 0.0611918925), (27 / 28, 0.0677702968)])
def test_r5_a_thick_cantilever_at_small_load(factor: float, tip: float) -> None:
    """Timoshenko's tip, to ten digits but for the load's square.

    Catches: the shear factor on the wrong side, G for E, shear left out.
    """
    linear = [1e3 * _thick(n, factor, 15e-3) for n in (30, 60)]
    # geometric terms go with the square of the slope, 2e-5^2
    assert linear[1] + (linear[1] - linear[0]) / 3 == pytest.approx(tip, rel=1e-8)
    # one point an element: the bending part is short by 1 / (4 n^2)
    assert linear[0] == pytest.approx(tip, rel=1.0 / (4 * 30**2))


def test_r5_a_thick_cantilever_at_full_load() -> None:
    """The nonlinear tip of VERIFICATION at F = 15.

    Catches: a linearised rod; the shear strain's coupling with stretch.
    """
    tips = [_thick(n, 4 / 3, 15.0) for n in (30, 60)]
    assert tips[1] + (tips[1] - tips[0]) / 3 == pytest.approx(0.0611734, abs=1e-7)
