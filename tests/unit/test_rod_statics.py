"""Statics of rods as a function: what it refuses, reports, leaves alone; its linear algebra."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.sparse import csc_matrix

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.rod.balance import Point, conditions, of_state, out_of_balance, strain_change, tangent
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Body, Gravity, Hinge, Hold, Muscle, PointLoad, Rigid, Spherical, Spring
from fem_biobot.rod.sparse import Factors, SingularError, negative_motions, pattern
from fem_biobot.rod.statics import RodStep, reaction, statics
from tests.helpers import generator, taylor_slope, unchanged
from tests.rods import arc, rod_of, straight

STIFF = (40.0, 50.0, 70.0, 3.0, 2.0, 1.0)
ROD = rod_of(straight(4, 2.0), STIFF, mass_per_length=1e-4)
TIP = ("rod", -1)
BASE = Hold(("rod", 0))
PUSH = PointLoad(TIP, (0.1, 0.4, -0.3))
NAN = float("nan")


def _cantilever() -> RodModel:
    return RodModel([ROD], supports=[BASE], loads=[PUSH])


def _mixed() -> RodModel:
    """A held rod, a hinge, a body on it, a muscle and a spring, a partial hold."""
    other = rod_of(arc(3, 2.0, 0.8) + np.array([2.0, 0.0, 0.0]), STIFF, name="other")
    end = tuple((arc(3, 2.0, 0.8)[-1] + np.array([2.0, 0.0, 0.0])).tolist())
    return RodModel(
        [ROD, other],
        [Hinge(TIP, ("other", 0), (0.1, 0.2, 1.0)), Rigid(("other", -1), ("foot", end))],
        [Body((4.0, 1.0, 0.4), 1e-3, (1e-3, 2e-3, 3e-3), "foot")],
        [BASE, Hold(("other", 2), "z", "x")],
        [PUSH, PointLoad(("foot", (4.0, 1.2, 0.3)), (0.1, 0.2, -0.1), following=True)],
        [Muscle(("rod", 1), ("foot", end), 0.4, 3.0, 1.0), Spring(("foot", end), (5.0, 3.0, 1.0), 0.3)],
    )


def _generic(model: RodModel, seed: int = 3, size: float = 0.2) -> Point:
    """A point some way from the drawing, with multipliers."""
    draw = generator(seed)
    n, j = model.n_nodes, len(model.assembly.constraints.rows)
    at = Point(model.built.x.copy(), np.tile(np.eye(3), (n, 1, 1)), 0.5 * draw.normal(size=(j, 6)))
    return at.moved(size * draw.normal(size=(n, 6)), np.zeros((j, 6)))


def test_the_tangent_is_the_derivative_of_all_forces() -> None:
    """Elements, members, loads, joints with their multipliers, held nodes: residual and gaps together.

    Catches: a block in the wrong place, a joint's geometric stiffness left out, the multipliers' sign.
    """
    model = _mixed()
    given, at = conditions(model, 0.8, 0.7, 1.0, 0.0), _generic(model)
    unknowns = pattern(given.assembly, model.system)
    forces = out_of_balance(model, given, at)
    matrix = unknowns.matrix(*tangent(model, given, at, forces.s, forces.tension, forces.lengths))
    direction = generator(9).normal(size=unknowns.size)
    step, change = unknowns.scatter(direction)

    def residual(eps: float) -> np.ndarray:
        found = out_of_balance(model, given, at.moved(eps * step, -eps * change))
        return unknowns.gather(found.force, -found.value)[:, None]

    np.testing.assert_allclose(taylor_slope(residual, -(matrix @ direction)[:, None]), 2.0, atol=0.1)


def test_the_change_of_strain_is_its_derivative() -> None:
    """As the iteration extrapolates resultants with it.

    Catches: the length forgotten, forces of neighbouring elements mixed.
    """
    model = _mixed()
    given, at = conditions(model, 0.0, 0.0, 0.0, 0.0), _generic(model)
    step = generator(5).normal(size=(model.n_nodes, 6))
    C = model.assembly.elements.stiffness

    def strain(eps: float) -> np.ndarray:
        return (out_of_balance(model, given, at.moved(eps * step, np.zeros_like(at.multiplier))).s / C).reshape(-1, 1)

    np.testing.assert_allclose(taylor_slope(strain, strain_change(given, at, step).reshape(-1, 1)), 2.0, atol=0.1)


@pytest.mark.parametrize("shift", [60.0, 0.0, -0.4, -3.0])
def test_negative_motions_are_those_of_the_reduced_stiffness(shift: float) -> None:
    """As many as eigenvalues below zero on the null space of the joints.

    Catches: signs of the multipliers' own pivots counted, too small a weight of the joints.
    """
    model = _mixed()
    given, at = conditions(model, 0.8, 0.7, 1.0, 0.0), _generic(model, size=0.03)
    unknowns = pattern(given.assembly, model.system)
    forces = out_of_balance(model, given, at)
    A = unknowns.matrix(*tangent(model, given, at, forces.s, forces.tension, forces.lengths)).toarray()
    A = 0.5 * (A + A.T)
    node = ~unknowns.joint
    A[np.ix_(node, node)] += shift * np.eye(int(node.sum()))
    Z = null_space(A[np.ix_(~node, node)])
    expected = int((np.linalg.eigvalsh(Z.T @ A[np.ix_(node, node)] @ Z) < 0.0).sum())
    assert negative_motions(csc_matrix(A), unknowns.joint) == expected
    assert (expected > 0) == (shift < 60.0)


def test_factors_solve_and_report_what_has_no_solution() -> None:
    """With joints that say one thing twice; an infinite entry and an empty system.

    Catches: the joints' compliance left in the answer, a singular matrix solved.
    """
    K = np.array([[3.0, 1.0], [1.0, 2.0]])
    G = np.array([[1.0, 2.0], [1.0, 2.0]])
    matrix = csc_matrix(np.block([[K, G.T], [G, np.zeros((2, 2))]]))
    joint = np.array([False, False, True, True])
    # u on the line (2, -1): 2 t; the work of b along it over its stiffness, 12 - 4 + 2
    found = Factors(matrix, joint).solve(np.array([5.0, 4.0, 0.0, 0.0]))[:2]
    np.testing.assert_allclose(found, 6.0 / 10.0 * np.array([2.0, -1.0]), rtol=1e-12)
    with pytest.raises(SingularError):
        Factors(csc_matrix(np.array([[np.inf]])), np.array([False]))
    with pytest.raises(SingularError):
        Factors(csc_matrix(np.array([[1.0, 1.0], [1.0, 1.0]])), np.array([False, False]))
    assert Factors(csc_matrix((0, 0)), np.zeros(0, dtype=bool)).solve(np.zeros(0)).shape == (0,)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: RodStep(load=NAN), "step: load: found nan"),
        (lambda: RodStep(tension=-1.0), "step: tension: found -1"),
        (lambda: RodStep(load="1"), "step: load: found '1'"),  # type: ignore[arg-type]
        (lambda: statics(_cantilever(), drive=NAN), "drive: found nan"),
        (lambda: statics(_cantilever(), free="fall"), "free: found 'fall'"),
        (lambda: statics(_cantilever(), free="hold"), "free: found 'hold' with 1 supports"),
        (lambda: statics(_cantilever(), start=_cantilever().drawn()), "start: found a state of another model"),
        (lambda: statics(RodModel([ROD], loads=[PUSH]), free="hold"), "free: the loads have a resultant"),
        (lambda: statics(RodModel([ROD], loads=[PUSH])), 'nothing holds .*translation along x.*free="hold"'),
        (
            lambda: statics(RodModel([ROD], supports=[Hold(("rod", 0), rotation=""), Hold(TIP, "xyz", "")])),
            "supports: nothing holds rotation about x, expected",
        ),
        (
            lambda: statics(RodModel([ROD], supports=[Hold(("rod", 0), "xy", "xyz")])),
            "nothing holds translation along z",
        ),
        (
            lambda: statics(
                RodModel(
                    [ROD, rod_of(straight(2) + np.array([2.0, 0, 0]), STIFF, name="loose")],
                    [Spherical(TIP, ("loose", 0))],
                    supports=[BASE],
                )
            ),
            "rotation about x of 'loose'",
        ),
    ],
)
def test_what_cannot_stand_is_refused(make: Callable[[], object], word: str) -> None:
    """By the key or by the motion that nothing holds, in one line.

    Catches: a singular tangent solved by luck; a floating model under a resultant.
    """
    with pytest.raises(ModelError, match=word) as refusal:
        make()
    assert "\n" not in str(refusal.value)


def test_a_pendulum_is_no_loose_part() -> None:
    """A rod on a ball joint may hang by its weight; about its own axis something must hold it.

    Catches: stiffness by weight overlooked, a spin about the rod's axis overlooked.
    """
    hanging = rod_of(straight(4, 2.0, (0.0, 0.0, -1.0)), STIFF, mass_per_length=1e-4)
    state = statics(RodModel([hanging], supports=[Hold(("rod", 0), "xyz", "z")], loads=[Gravity()])).last
    assert state.stable
    with pytest.raises(ModelError, match="nothing holds rotation about z"):
        statics(RodModel([hanging], supports=[Hold(("rod", 0), "xyz", "")], loads=[Gravity()]))


def test_a_failed_step_hands_over_what_was_reached() -> None:
    """A rod of too few elements wound up: the states before, the reason, and the steps between which it lies.

    Catches: states lost, a failure without a word.
    """
    wound = rod_of(straight(2, 1.0), (1e4, 1e4, 1e4, 1.0, 1.0, 1.0))
    model = RodModel([wound], supports=[BASE], loads=[PointLoad(TIP, moment=(0.0, 0.0, 10.0))])
    with pytest.raises(SolveError, match=r"turns by more than 3 rad|no convergence") as failure:
        statics(model, [0.3, 1.0])
    error = failure.value
    assert len(error.best.states) == 1
    assert error.reached.load >= 0.3
    assert error.wanted == RodStep(1.0, 1.0)
    assert error.reason in str(error)
    assert "\n" not in str(error)


def test_steps_scale_loads_and_tension() -> None:
    """A number both, a record each; the states say by how much, and a start goes on from there.

    Catches: tension scaled by the load, the drive forgotten in the state.
    """
    muscle = Muscle(("rod", 0), TIP, 0.4, 3.0, 1.0, 2.0)
    model = RodModel([rod_of(arc(6, 2.0, 1.0), STIFF)], supports=[BASE], loads=[PUSH], members=[muscle])
    found = statics(model, [RodStep(0.5, 0.0), 1.0], drive=0.5)
    first, last = found.states
    assert (first.load, first.tension, first.drive) == (0.5, 0.0, 0.5)
    assert first.muscle_force("muscle") == pytest.approx(0.4 * 3.0 * (1 - 1 / first.stretch("muscle")), rel=1e-12)
    assert last.muscle_force("muscle") == pytest.approx(0.4 * (2.0 + 3.0 * (1 - 1 / last.stretch("muscle"))), rel=1e-12)
    np.testing.assert_allclose(reaction(first, ("rod", 0))[:3], -0.5 * np.array(PUSH.force), rtol=0.0, atol=1e-9)
    again = statics(model, [1.0], drive=0.5, start=first).last
    np.testing.assert_allclose(again.x, last.x, rtol=0.0, atol=1e-9)
    assert found.stable
    assert found.last is last


def test_histories_are_read_at_the_time() -> None:
    """Loads with a history act as they do then.

    Catches: all histories at time 0.
    """
    load = PointLoad(TIP, (0.0, 1e-4, 0.0), history=lambda t: t)
    model = RodModel([ROD], supports=[BASE], loads=[load])
    found = [statics(model, time=t).last.displacement(TIP)[1] for t in (0.0, 1.0, 2.0)]
    assert found[0] == 0.0
    assert found[2] == pytest.approx(2.0 * found[1], rel=1e-6)


def test_nothing_given_is_changed() -> None:
    """Neither the model's arrays nor a start's; a second call gives the same bytes.

    Catches: a state that shares the start's arrays, warm starts kept in the model.
    """
    model = _mixed()
    first = statics(model).last
    arrays = [model.built.x, *model.assembly.elements, *model.assembly.constraints, first.x, first.Q, first.multiplier]
    with unchanged(*arrays):
        second = statics(model).last
        third = statics(model, [1.3], start=first).last
    assert np.array_equal(first.x, second.x)
    assert np.array_equal(first.Q, second.Q)
    assert not np.shares_memory(third.x, first.x)


def test_a_state_is_in_balance() -> None:
    """Forces of elements, members, loads and joints cancel at every node, and joints are closed.

    Catches: convergence declared by the step, joints left open.
    """
    model = _mixed()
    state = statics(model).last
    given, at = of_state(state)
    forces = out_of_balance(model, given, at)
    free = model.assembly.inertia.held == 0
    assert np.abs(forces.force[free]).max() < 1e-10 * forces.scale * given.extent
    assert np.abs(forces.value).max() < 1e-10
    assert state.residual < 1e-10


def test_listeners_hear_of_iterations_and_halved_steps() -> None:
    """Convergence is quadratic at last: from below 1e-3 to below 1e-5 in one iteration.

    Catches: a tangent that is not the derivative, silence.
    """
    heard: list[tuple[str, dict[str, float]]] = []
    found = statics(_mixed(), listener=lambda kind, values: heard.append((kind, values)))
    rest = [values["residual"] for kind, values in heard if kind == "iteration"]
    last = [(a, b) for a, b in pairwise(rest) if 1e-6 < a < 1e-3]
    assert last
    assert all(b < 300.0 * a**2 + 1e-12 for a, b in last)
    assert 0 < found.iterations < len(rest)
    assert sum(kind == "halved" for kind, _ in heard) == found.halvings


def test_units_do_not_matter() -> None:
    """The same rod a thousand times as long and a million times as stiff bends alike.

    Catches: an absolute tolerance.
    """
    shapes = []
    for length, force in ((1.0, 1.0), (1e3, 1e-6), (1e-3, 1e6)):
        c = np.array([*[force] * 3, *[force * length**2] * 3])
        rod = rod_of(straight(5, 2.0 * length), c * STIFF)
        load = PointLoad(TIP, tuple(force * np.array([0.1, 0.7, -0.4])))
        shapes.append(statics(RodModel([rod], supports=[BASE], loads=[load])).last.points("rod") / length)
    for shape in shapes[1:]:
        np.testing.assert_allclose(shape, shapes[0], rtol=0.0, atol=1e-9)


def test_a_guess_need_not_be_in_balance() -> None:
    """From a start that is far off, with a held end where the start has it.

    Catches: held nodes put back to the drawing, a start without load taken for an equilibrium.
    """
    model = RodModel([ROD], supports=[BASE, Hold(TIP)])
    begin = model.drawn()
    x = begin.x + np.linspace(0.0, 1.0, 5)[:, None] * np.array([-0.3, 0.2, 0.0])
    x[1:4] += 0.05 * generator(4).normal(size=(3, 3))
    state = statics(model, start=RodState(model, x, begin.Q)).last
    np.testing.assert_allclose(state.at(TIP), [1.7, 0.2, 0.0], rtol=0.0, atol=1e-12)
    assert np.abs(reaction(state, TIP) + 0.0)[:3].max() > 0.1
