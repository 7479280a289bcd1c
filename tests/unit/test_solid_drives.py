"""Muscles and loads of one body driven each on its own, against scalar equations of strips in series or parallel."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.errors import ModelError
from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.model import SolidModel, buckling, solve
from fem_biobot.solid.records import BodyForce, Fix, Load, Pressure, Step, Symmetry, Traction, as_step
from tests.helpers import TIGHT, box_mesh, taylor_slope

SIZE = (1.3, 0.9, 2.0)
MESH = box_mesh(2, SIZE, layers=(0.5, 1.0), names=("low", "high"))
E_LOW, E_HIGH = 9.0, 14.0
T_LOW, T_HIGH = 3.0, 4.4
# nu = 0: a strip that is pulled or contracts along its fibre stays as wide as it was
LAWS = {"low": NeoHooke(E_LOW, 0.0), "high": NeoHooke(E_HIGH, 0.0)}
ROLLERS = [Symmetry("x0"), Symmetry("y0"), Symmetry("z0")]


def _pull(s: float, E: float, tension: float, convention: str) -> float:
    """Nominal stress of a strip of nu = 0 at the stretch s, its tension along it: mu (s - 1/s) and the tension's."""
    passive = 0.5 * E * (s - 1.0 / s)
    return passive + tension * {"nominal": 1.0, "second_piola": s, "kirchhoff": 1.0 / s}[convention]


def _muscles(axis: int, low: str = "nominal", high: str = "second_piola") -> dict[str, ActiveStress]:
    a0 = np.eye(3)[axis]
    return {"low": ActiveStress(T_LOW, a0, low), "high": ActiveStress(T_HIGH, a0, high)}


DRIVES = [(1.0, 1.0), (0.3, 1.0), (0.8, 0.0), (0.0, 0.55)]


@pytest.mark.parametrize("element", ["P2", "P2-P1"])
def test_muscles_in_parallel_hold_the_sum_of_their_own_tensions(element: str) -> None:
    """Two strips side by side, held at their length, pull with the sum of their drives' tensions over their areas.

    Catches: one factor for all muscles, the factors of the two swapped, a region's own convention lost.
    """
    model = SolidModel(MESH, LAWS, _muscles(0), supports=[*ROLLERS, Fix("x1", "x")], element=element)
    steps = [{"low": low, "high": high} for low, high in DRIVES]
    area = SIZE[1] * SIZE[2] / 2.0
    for state, (low, high) in zip(solve(model, steps, settings=TIGHT).states, DRIVES, strict=True):
        assert state.reaction("x1")[0] == pytest.approx(area * (low * T_LOW + high * T_HIGH), rel=1e-11)
        assert np.abs(state.u).max() < 1e-11


def test_muscles_in_series_each_shorten_by_their_own_drive() -> None:
    """Two strips end to end, free: each has the stretch at which its own law balances its own tension.

    Second muscle of the Kirchhoff kind. Catches: the drive of one acting on both, a common factor on top of the own
    one, the predictor between drives that change in different directions.
    """
    model = SolidModel(MESH, LAWS, _muscles(2, high="kirchhoff"), supports=ROLLERS)
    steps = [Step(1.0, 0.9, tensions={"low": low, "high": high}) for low, high in DRIVES]
    for state, (low, high) in zip(solve(model, steps, settings=TIGHT).states, DRIVES, strict=True):
        s_low = brentq(lambda s, f=low: _pull(s, E_LOW, f * T_LOW, "nominal"), 0.3, 1.1, xtol=1e-14)
        s_high = brentq(lambda s, f=high: _pull(s, E_HIGH, f * T_HIGH, "kirchhoff"), 0.2, 1.1, xtol=1e-14)
        assert state.at((0.4, 0.3, 1.0))[2] == pytest.approx(s_low - 1.0, rel=1e-9, abs=1e-11)
        assert state.at((0.4, 0.3, 2.0))[2] == pytest.approx(s_low + s_high - 2.0, rel=1e-9, abs=1e-11)


def test_muscles_in_series_between_walls_share_their_force() -> None:
    """Held at both ends the stretches sum to the length and the forces are one: the stronger stretches the other.

    Catches: a muscle's tension counted in its neighbour.
    """
    model = SolidModel(MESH, LAWS, _muscles(2), supports=[*ROLLERS, Fix("z1", "z")])
    low, high = 0.35, 0.9
    state = solve(model, [{"low": low, "high": high}], settings=TIGHT).last

    def gap(s: float) -> float:
        other = _pull(2.0 - s, E_HIGH, high * T_HIGH, "second_piola")
        return _pull(s, E_LOW, low * T_LOW, "nominal") - other

    s = brentq(gap, 0.5, 1.5, xtol=1e-14)
    assert s > 1.03
    assert state.at((0.4, 0.3, 1.0))[2] == pytest.approx(s - 1.0, rel=1e-9)
    force = SIZE[0] * SIZE[1] * _pull(s, E_LOW, low * T_LOW, "nominal")
    assert state.reaction("z1")[2] == pytest.approx(force, rel=1e-9)


def test_a_muscle_without_a_factor_of_its_own_follows_the_common_one() -> None:
    """Naming both muscles, naming one, and naming none give one state where the factors are the same.

    Catches: muscles not named left at rest, a mapping that scales the loads too.
    """
    model = SolidModel(MESH, LAWS, _muscles(2), supports=[*ROLLERS, Fix("z1", "z", 0.3)])
    same = [
        Step(1.0, 0.6),
        Step(1.0, 0.6, tensions={"low": 0.6}),
        Step(1.0, 1.7, tensions={"low": 0.6, "high": 0.6}),
        {"low": 0.6, "high": 0.6},
    ]
    first, *others = [solve(model, [step], settings=TIGHT).last.u for step in same]
    for u in others:
        np.testing.assert_allclose(u, first, rtol=0.0, atol=1e-12)


def test_loads_and_prescribed_displacements_have_factors_of_their_own() -> None:
    """The reaction balances each load times its own factor; a displacement driven by its name goes its own way.

    Catches: the common factor on a load that has its own; a dead pressure, a follower pressure or a body force left
    out; the factor squared.
    """
    loads: list[Load] = [
        Traction("x1", (0.31, 0.0, 0.0)),
        Traction("x1", (0.0, 0.17, 0.0), name="across"),
        BodyForce((0.0, 0.0, -0.23), "low"),
        BodyForce((0.11, 0.0, 0.0)),
        Pressure("y1", 0.4, follower=False),
    ]
    model = SolidModel(MESH, LAWS, supports=[Fix("z0")], loads=loads)
    step = Step(0.5, 0.0, loads={"x1": 0.3, "across": -0.7, "low": 0.9, "y1": 0.2})
    area, volume = SIZE[1] * SIZE[2], float(np.prod(SIZE))
    expected = -np.array(
        [
            0.3 * 0.31 * area + 0.5 * 0.11 * volume,
            -0.7 * 0.17 * area - 0.2 * 0.4 * SIZE[0] * SIZE[2],
            -0.9 * 0.23 * volume / 2.0,
        ]
    )
    np.testing.assert_allclose(solve(model, [step], settings=TIGHT).last.reaction("z0"), expected, rtol=1e-9)
    pulled = [Fix("z1", "z", 0.2, name="lift"), Fix("x1", "x", 0.1)]
    moved = SolidModel(MESH, LAWS, supports=[*ROLLERS, *pulled])
    state = solve(moved, [Step(1.0, 1.0, loads={"lift": 0.25})]).last
    np.testing.assert_allclose(state.at((SIZE[0], 0.3, 2.0))[[0, 2]], [0.1, 0.05], rtol=1e-12)


def test_a_follower_pressure_driven_by_name_has_its_factor_in_force_and_tangent() -> None:
    """Force and matrix of a follower pressure are those of its own factor.

    Catches: the factor in the force alone, which costs Newton its rate.
    """
    model = SolidModel(MESH, LAWS, supports=[Fix("z0")], loads=[Pressure("z1", 1.4), Pressure("x1", 0.8, name="side")])
    system = model.system
    u = 0.1 * np.sin(2.0 * system.space.points.T[:, ::-1])
    step = Step(0.7, 0.0, loads={"side": 0.2})
    points = system.points(system.deformation_gradient(u), step)

    def out_of_balance(eps: float) -> np.ndarray:
        moved = u + eps * direction
        now = system.points(system.deformation_gradient(moved), step)
        return system.residual(now, system.internal_force(now)[0], system.external_force(moved, step))[:, None]

    direction = np.cos(3.0 * system.space.points.T)
    change = system.product(system.matrix(points, points.S, u, step), direction.ravel())[:, None]
    assert taylor_slope(out_of_balance, change)[0] == pytest.approx(2.0, abs=0.1)


def test_the_way_between_steps_is_straight_in_every_factor() -> None:
    """Half-way all factors are half-way, named in one step or in both; tensions extrapolated below zero end there.

    Catches: names of the second step dropped, the common factor of the first step for a name it does not give.
    """
    one = Step(0.0, 0.4, loads={"a": 1.0}, time=0.2)
    two = Step(1.0, 1.0, tensions={"m": 0.2}, time=0.8)
    half = one.between(two, 0.5)
    assert (half.load, half.tension, half.time) == pytest.approx((0.5, 0.7, 0.5))
    assert half.loads == pytest.approx({"a": 1.0})
    assert half.tensions == pytest.approx({"m": 0.3})
    assert one.between(two, 4.0).tensions == {"m": 0.0}
    assert as_step({"m": 0.3}) == Step(1.0, 1.0, tensions={"m": 0.3})
    assert half.told() == "load x0.5, tension x0.7, a x1, m x0.3, time 0.5 s"


def test_buckling_looks_along_the_factors_of_the_step() -> None:
    """A column under two end loads of which only one grows buckles when their sum is critical.

    Catches: the critical step with the common factor only.
    """
    E, length = 100.0, 10.0
    euler = np.pi**2 * E / 12.0 / (4.0 * length**2)
    loads = [Traction("z1", (0.0, 0.0, -euler), name=name) for name in ("still", "growing")]
    mesh = box_mesh((2, 2, 8), (1.0, 1.0, length), shift=0.0)
    model = SolidModel(mesh, {"muscle": NeoHooke(E, 0.0)}, supports=[Fix("z0")], loads=loads)
    state = solve(model, [Step(0.0, 0.0, loads={"still": 0.4})]).last
    found = buckling(state, Step(0.0, 0.0, loads={"still": 0.4, "growing": 1.0}))
    assert found is not None
    assert found.step.loads["still"] == pytest.approx(0.4)
    assert found.step.loads["growing"] == pytest.approx(0.6, abs=0.03)


@pytest.mark.parametrize(
    ("step", "word"),
    [
        ({"middle": 1.0}, r"step, tensions: found 'middle', expected one of low, high"),
        (Step(loads={"lid": 1.0}), r"step, loads: found 'lid', expected one of x1, lift"),
    ],
)
def test_steps_that_name_what_is_not_there_are_refused(step: object, word: str) -> None:
    """A muscle or load that the model does not have is refused before anything is solved, also towards buckling.

    Catches: a misspelt name that drives nothing.
    """
    supports = [*ROLLERS, Fix("z1", "z", 0.1, name="lift"), Fix("y1", "y")]
    model = SolidModel(MESH, LAWS, _muscles(0), supports=supports, loads=[Traction("x1", (1.0, 0.0, 0.0))])
    with pytest.raises(ModelError, match=word):
        solve(model, [step])  # type: ignore[list-item]
    rest = solve(model, [Step(0.0, 0.0)]).last
    with pytest.raises(ModelError, match=word):
        buckling(rest, step)  # type: ignore[arg-type]


def test_a_model_without_muscles_says_so() -> None:
    """Catches: "expected one of" and nothing after it."""
    with pytest.raises(ModelError, match=r"none .the model has nothing of that kind"):
        solve(SolidModel(MESH, LAWS, supports=[Fix("z0")]), [{"low": 1.0}])


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"tensions": {"low": -0.1}}, r"tensions\['low'\]: found tension factor -0.1"),
        ({"tensions": {"low": "1"}}, r"tensions\['low'\]: found '1', expected a finite factor"),
        ({"loads": {"x1": float("nan")}}, r"loads\['x1'\]"),
        ({"loads": {"x1": [1.0, 2.0]}}, r"loads\['x1'\]: found several numbers"),
        ({"loads": 0.5}, "loads: found 0.5, expected factors by name"),
        ({"time": float("inf")}, "time"),
    ],
)
def test_factors_that_are_no_numbers_or_push_are_refused(given: dict[str, object], word: str) -> None:
    """Each factor of its own is held to what the common ones are.

    Catches: a pushing muscle by the back door.
    """
    with pytest.raises(ModelError, match=word):
        Step(**given)  # type: ignore[arg-type]


def _two_plates(mesh: BodyMesh) -> SolidModel:
    supports = [Fix("z0", name="floor"), Fix("z1", "z", 0.1), Fix("x1", "z", lambda X: 0.05 * X, name="wall")]
    return SolidModel(mesh, {"low": LAWS["low"], "high": LAWS["high"]}, supports=supports)


def test_supports_driven_apart_are_refused_where_they_meet() -> None:
    """Two prescribed displacements that agree under common factors contradict each other under different ones.

    Catches: agreement asked once, at factor 1.
    """
    model = _two_plates(MESH)
    assert solve(model, [1.0]).last.at((SIZE[0], 0.3, 2.0))[2] == pytest.approx(0.1)
    with pytest.raises(ModelError, match=r"contradicting displacements at \(1.3, .*, 2\) mm, load x1, .*wall x0.5"):
        solve(model, [Step(loads={"wall": 0.5})])
