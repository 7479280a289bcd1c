"""Factors of length and velocity on a muscle's active tension: tables, kernels, slopes, refusals."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.activation import kernels
from fem_biobot.rod.activation.build import activations
from fem_biobot.rod.activation.curve import MuscleCurve
from fem_biobot.rod.balance import Point, conditions, out_of_balance, tangent
from fem_biobot.rod.dynamics.integrate import Integrator, Settings, dynamics
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Hold, Muscle, Rigid, Rod, Spring
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.sparse import pattern
from tests.helpers import generator, plain_python, taylor_slope
from tests.rods import straight

Array = np.ndarray
NAMES = tuple(name for name, value in vars(kernels).items() if hasattr(value, "py_func"))
GAUSS, HILL = MuscleCurve.gaussian(0.95, 0.4), MuscleCurve.hill(2.5, 0.3, 1.5)


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from."""
    with ExitStack() as stack:
        if request.param == "plain":
            stack.enter_context(plain_python(kernels, *NAMES))
        yield request.param


def muscle(**more: Any) -> Muscle:
    """Between two points of a body and a rod that are not there."""
    return Muscle(("a", (0.0, 0.0, 0.0)), ("b", (1.0, 0.0, 0.0)), 0.8, 10.0, 0.7, 3.0, 0.9, 1.2, **more)


def reading(curve: MuscleCurve) -> Callable[[float], tuple[float, float]]:
    """Value and slope as the kernels read them."""
    table = activations([muscle(force_length=curve)])
    return lambda x: kernels.factor(table, 0, x)


def test_named_curves_are_their_closed_forms(mode: str) -> None:
    """Value and slope between the knots, and the end values outside.

    Catches: a slope per knot for one per unit, an index off by one, an extrapolation.
    """
    gauss, hill = reading(GAUSS), reading(HILL)
    for s in (0.313, 0.8, 0.95, 1.4, 2.2):
        z = (s / 0.95 - 1.0) / 0.4
        assert gauss(s) == pytest.approx((np.exp(-z * z), -2.0 * z / 0.38 * np.exp(-z * z)), abs=1e-7)
    for r in (-2.3, -0.7, -0.01, 0.02, 1.3, 6.0):
        u = -r / 2.5
        y, c = -u, 0.5 * 0.3 / 1.3
        wanted = (1.0 - u) / (1.0 + u / 0.3) if u > 0.0 else 1.0 + 0.5 * y / (y + c)
        assert hill(r)[0] == pytest.approx(wanted, abs=1e-7)
    # the same slope on both sides of rest, (1 + 1/k) / fastest
    assert hill(-1e-9)[1] == pytest.approx(hill(1e-9)[1]) == pytest.approx((1.0 + 1.0 / 0.3) / 2.5)
    assert hill(-2.5001) == (0.0, 0.0)
    assert hill(9.0) == (pytest.approx(1.0 + 0.5 * 3.0 / (3.0 + 0.5 * 0.3 / 1.3), rel=1e-14), 0.0)
    assert kernels.factor(activations([muscle()]), -1, 0.3) == (1.0, 0.0)


def test_any_function_is_read_without_leaving_its_range() -> None:
    """The plateau and straight flanks of Gordon, Huxley and Julian (1966), given by their corners, stay what they are.

    Catches: an interpolation that overshoots at corners.
    """
    corners, values = [0.635, 0.835, 1.0, 1.125, 1.825], [0.0, 0.84, 1.0, 1.0, 0.0]
    read = reading(MuscleCurve(lambda s: float(np.interp(s, corners, values)), 0.4, 2.0, name="steps"))
    x = np.linspace(0.3, 2.1, 4001)
    found = np.array([read(s)[0] for s in x])
    assert found.min() == 0.0
    assert found.max() == 1.0
    np.testing.assert_allclose(found, np.interp(x, corners, values), atol=5e-3)
    inside = (x > 1.13) & (x < 1.82)
    np.testing.assert_allclose(found[inside], np.interp(x, corners, values)[inside], atol=1e-12)


def test_a_smooth_function_without_slope_is_read_to_a_millionth() -> None:
    """Catches: a coarser table than told."""
    read = reading(MuscleCurve(lambda s: float(np.exp(-((s - 1.0) ** 2) / 0.2)), 0.3, 1.9))
    x = np.linspace(0.31, 1.89, 999)
    assert np.abs([read(s)[0] - np.exp(-((s - 1.0) ** 2) / 0.2) for s in x]).max() <= 2e-6


def test_the_active_force_has_the_slopes_told(mode: str) -> None:
    """By the length at the end with a weight, and by the rate; standing force has none.

    Catches: a slope by stretch for one by length, the weight twice, factors on the standing force.
    """
    rest, before, after, rate, weight = 1.6, 1.45, 1.38, 9.0, 0.6
    table = activations([muscle(force_length=GAUSS, force_velocity=HILL)])
    force, by_length, by_rate = kernels.active_tension(table, 0, rest, before, after, weight, rate, 2.3)
    gauss, hill = reading(GAUSS), reading(HILL)
    factor = weight * gauss(after / rest)[0] + (1.0 - weight) * gauss(before / rest)[0]
    standing = 0.8 * 0.9 * np.sin(1.2) * 0.7
    assert force == pytest.approx(standing + 2.3 * factor * hill(rate * (after - before) / rest)[0], rel=1e-12)

    def moved(eps: float) -> Array:
        found, _, _ = kernels.active_tension(table, 0, rest, before, after + eps, weight, rate, 2.3)
        return np.array([[found]])

    slope = np.array([[weight * by_length + rate * by_rate]])
    np.testing.assert_allclose(taylor_slope(lambda e: moved(0.1 * e), 0.1 * slope), 2.0, atol=0.1)


def test_the_tangent_of_statics_holds_the_slope_of_active_tension() -> None:
    """A rod bent by a muscle between two arms, at a generic place and drive.

    Catches: a slope left out of the matrix, of the whole tension, of the wrong sign.
    """
    rod = Rod(straight(3, 4.0), Section.circle(0.3), RodMaterial(young=300.0, poisson=0.4, density=1e-6))
    bodies = [Body((x, 0.0, -1.0), 1e-6, (1e-6,) * 3, n) for n, x in (("left", 0.0), ("right", 4.0))]
    joints = [Rigid(("rod", i), (n, (x, 0.0, -1.0))) for i, n, x in ((0, "left", 0.0), (-1, "right", 4.0))]  # type: ignore[arg-type]
    pull = Muscle(
        ("left", (0.0, 0.2, -1.0)),
        ("right", (4.0, 0.0, -1.0)),
        0.8,
        10.0,
        0.7,
        9.0,
        force_length=GAUSS,
        force_velocity=HILL,
    )
    model = RodModel([rod], joints, bodies, [Hold(("rod", 0))], members=[pull])
    draw = generator(12)
    start = Point(model.built.x.copy(), model.drawn().Q, np.zeros((0, 6)))
    at = start.moved(0.2 * draw.normal(size=(4, 6)), np.zeros((0, 6)))
    step = draw.normal(size=(4, 6)) * (model.assembly.inertia.held == 0)[:, None]
    given = conditions(model, 1.0, 0.8, 0.6, 0.0)
    forces, rows = out_of_balance(model, given, at), pattern(given.assembly, model.system)
    matrix = rows.matrix(*tangent(model, given, at, forces.s, forces.tension, forces.lengths))

    def force(eps: float) -> Array:
        found = out_of_balance(model, given, at.moved(eps * step, np.zeros((0, 6))))
        return rows.gather(found.force, found.value)[:, None]

    wanted = -(matrix @ rows.gather(step, np.zeros((0, 6))))[:, None]
    np.testing.assert_allclose(taylor_slope(force, wanted), 2.0, atol=0.1)


def test_a_shared_curve_is_kept_once() -> None:
    """Catches: a table for each muscle, numbers that point to another's."""
    spring = Spring(("a", 0), (0.0, 0.0, 0.0), 1.0)
    table = activations([muscle(force_velocity=HILL), spring, muscle(force_length=GAUSS, force_velocity=HILL)])
    assert table.curve.tolist() == [[-1, 0], [-1, -1], [1, 0]]
    assert len(table.table) == 2
    assert table.standing[1] == 0.0


def test_explicit_steps_know_the_damping_of_hills_curve() -> None:
    """``h^2 w^2 + 2 h c / m < 4`` with ``c = T A F'(0) / length`` at full drive, though the run begins without.

    Catches: a limit from the passive stiffness alone, from the drive at the start.
    """
    m, rest = 2e-3, 4.0
    pull = Muscle(
        ("ball", (4.0, 0.0, 0.0)), ("post", (0.0, 0.0, 0.0)), 0.5, 3.0, 0.0, 60.0, force_velocity=MuscleCurve.hill(1.5)
    )
    bodies = [Body((x, 0.0, 0.0), m, (1.0, 1.0, 1.0), n) for n, x in (("ball", 4.0), ("post", 0.0))]
    model = RodModel(bodies=bodies, supports=[Hold(("post", (0.0, 0.0, 0.0)))], members=[pull])
    w2, c = 3.0 * 0.5 / rest / m, 30.0 * (1.0 + 1.0 / 0.25) / 1.5 / rest / m
    limit = (np.sqrt(c * c + 4.0 * w2) - c) / w2
    settings = Settings(integrator=Integrator.explicit)
    with pytest.raises(ModelError, match=f"expected at most {limit:.3g} s"):
        dynamics(model, 0.1, 1.02 * limit, drive=lambda t: 0.0, settings=settings)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: MuscleCurve(lambda s: 1.0, 0.5, 0.5), "high: found 0.5, expected a number above low"),
        (lambda: MuscleCurve(lambda s: 1.0, float("nan"), 1.0), "low: found nan"),
        (lambda: MuscleCurve(lambda s: s - 1.0, 0.5, 1.5, name="mine"), "mine: found -0.5 at 0.5"),
        (lambda: MuscleCurve(lambda s: float("inf") if s > 1.0 else 1.0, 0.5, 1.5), "no finite number at 1.0"),
        (lambda: MuscleCurve(lambda s: 1.0 / (s - 0.5), 0.5, 1.5), "ZeroDivisionError"),
        (lambda: MuscleCurve(lambda s: 1.0, 0.5, 1.5, slope=lambda s: float("nan")), "slope: found no finite"),
        (lambda: MuscleCurve.gaussian(width=0.0), "gaussian: width: found 0"),
        (lambda: MuscleCurve.hill(-1.0), "hill: fastest: found -1"),
        (lambda: MuscleCurve.hill(1.0, curvature=float("inf")), "hill: curvature"),
        (lambda: MuscleCurve.hill(1.0, eccentric=1.0), "hill: eccentric: found 1, expected a number above 1"),
        (lambda: muscle(force_length=lambda s: 1.0), "force_length: found .* expected a MuscleCurve"),
        (lambda: muscle(force_velocity=0.5), "force_velocity: found 0.5"),
    ],
)
def test_wrong_curves_are_named(make: Callable[[], object], word: str) -> None:
    """Catches: a table of numbers that are none."""
    with pytest.raises(ModelError, match=word):
        make()
