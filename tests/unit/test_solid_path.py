"""Paths of load steps: continuation, halving, what is told on the way, and how a solve ends that cannot go on."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

from fem_biobot.errors import SolveError
from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.failure import advice
from fem_biobot.solid.from_design import model_from_design, tension_step
from fem_biobot.solid.measures import measures
from fem_biobot.solid.model import SolidModel, SolidSolution, solve
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.path import PathFailedError
from fem_biobot.solid.records import Fix, Step, Traction
from fem_biobot.solid.step_failed import StepFailedError, Why
from tests.helpers import TIGHT, box_mesh, committed_bot, hold_everywhere, on_three_corners, slope, unit

FIBRE = unit(0.3, 0.8, -0.5)
SOFT = NeoHooke(10.0, 0.45)


def _contracting() -> SolidModel:
    """A block of muscle that bends: two regions, tension in one."""
    mesh = box_mesh(2, layers=(0.5, 1.0), names=("muscle", "skeleton"))
    laws = {"muscle": SOFT, "skeleton": NeoHooke(30.0, 0.4)}
    return SolidModel(mesh, laws, {"muscle": ActiveStress(8.0, FIBRE)}, on_three_corners())


def _driven(*value: float) -> SolidModel:
    """A block between a fixed face and one driven by `value`."""
    return SolidModel(box_mesh(2), {"muscle": SOFT}, supports=[Fix("z0"), Fix("z1", "xyz", value)])


def test_states_come_in_the_order_asked_and_the_start_goes_on() -> None:
    """A path cut in two and continued from its states ends where the whole path ends, with no more work.

    Catches: `start` ignored (the predictor's states lost), states in another order.
    """
    model = _contracting()
    factors = [0.25, 0.5, 0.75, 1.0]
    whole = solve(model, factors, settings=TIGHT)
    assert [state.step for state in whole.states] == [Step(f, f) for f in factors]
    cut = solve(model, factors[:3], settings=TIGHT)
    rest = solve(model, factors[3:], settings=TIGHT, start=cut.states)
    np.testing.assert_allclose(rest.last.u, whole.last.u, rtol=0.0, atol=1e-11)
    assert rest.newton_iterations <= whole.last.newton_iterations
    fresh = solve(model, factors[3:], settings=TIGHT)
    np.testing.assert_allclose(fresh.last.u, whole.last.u, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize(("count", "largest"), [(3, 0.0125), (4, 0.00625)])
def test_the_predictor_is_of_the_order_of_its_states(count: int, largest: float) -> None:
    """The first residual of the next step falls with the third power of the spacing, from four states with the fourth.

    Catches: linear extrapolation (slope 2), weights for another spacing, a fourth state forgotten.
    """
    model = _contracting()
    spacing, first = [largest, largest / 2.0, largest / 4.0], []
    for h in spacing:
        starts: list[float] = []
        solve(
            model,
            [0.5 - k * h for k in range(count - 1, -2, -1)],
            settings=TIGHT,
            observe=lambda kind, values, starts=starts: (
                values.get("iteration") == 0 and starts.append(values["residual"])
            ),
        )
        first.append(starts[-1])
    assert slope(spacing, first) == pytest.approx(count, abs=0.15)


def test_a_path_may_turn_back_stand_still_and_start_at_rest() -> None:
    """Zero, a repeated factor and a way back give what the factor alone gives.

    Catches: a division by the length of the step, extrapolation across a turn.
    """
    model = _contracting()
    solution = solve(model, [0.0, 0.5, 0.5, 1.0, 0.5, 0.0], settings=TIGHT)
    u = [state.u for state in solution.states]
    assert np.abs(u[0]).max() == 0.0
    assert solution.states[2].newton_iterations == 0
    np.testing.assert_allclose(u[2], u[1], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(u[4], u[1], rtol=0.0, atol=1e-11)
    assert np.abs(u[5]).max() < 1e-11 * np.abs(u[3]).max()


def test_loads_and_tension_may_go_their_own_ways() -> None:
    """A state depends on its two factors and not on the way there.

    Catches: a predictor that extrapolates along one factor across a corner in the other.
    """
    model = SolidModel(
        box_mesh(2),
        {"muscle": SOFT},
        {"muscle": ActiveStress(8.0, FIBRE)},
        [Fix("z0")],
        [Traction("z1", (1.0, 0.5, 0.3))],
    )
    around = solve(model, [Step(0.0, 0.5), Step(0.0, 1.0), Step(0.5, 1.0), Step(1.0, 1.0)], settings=TIGHT)
    straight = solve(model, [Step(1.0, 1.0)], settings=TIGHT)
    np.testing.assert_allclose(around.last.u, straight.last.u, rtol=0.0, atol=1e-11)


def test_the_caller_is_told_of_iterations_halvings_and_states() -> None:
    """`observe` hears each iteration and each halving, `on_state` each state as soon as it has converged.

    Catches: states handed over at the end only, so that nothing is on disk when a later step fails.
    """
    heard: list[tuple[str, dict]] = []
    kept: list[int] = []
    solution = solve(
        _driven(0.8, 0.0, -0.45),
        [0.1, 1.0],
        observe=lambda kind, values: heard.append((kind, values)),
        on_state=lambda state: kept.append(len(heard)),
    )
    kinds = [kind for kind, _ in heard]
    assert kinds.count("halved") == solution.halvings > 0
    assert kinds.count("iteration") > solution.newton_iterations
    assert len(kept) == 2
    assert kept[0] < len(heard) == kept[1]
    assert heard[0] == ("iteration", {"iteration": 0, "residual": heard[0][1]["residual"]})
    assert heard[-1][1]["residual"] <= 1e-9


def test_a_step_too_long_is_halved_and_arrives() -> None:
    """Half the height and most of the width in one step inverts elements; halved, it ends where ten steps end.

    Catches: a failed trial kept as the next start, the asked state replaced by the last half.
    """
    model = _driven(0.8, 0.0, -0.45)
    at_once = solve(model, [1.0], settings=TIGHT)
    slowly = solve(model, np.linspace(0.1, 1.0, 10), settings=TIGHT)
    assert at_once.halvings > 0
    assert len(at_once.states) == 1
    assert at_once.last.step == Step(1.0, 1.0)
    np.testing.assert_allclose(at_once.last.u, slowly.last.u, rtol=0.0, atol=1e-10)


def test_a_solve_that_cannot_go_on_keeps_what_it_reached() -> None:
    """Pressed flat, the block loses stability; the error names both ends, carries the states before, and exits with 3.

    Catches: an error empty-handed, states of half steps among the results.
    """
    model = _driven(0.0, 0.0, -0.95)
    with pytest.raises(SolveError, match=r"reached\) and load x1, .*asked.*; try a lower tension") as caught:
        solve(model, [0.1, 0.2, 1.0])
    best = caught.value.best
    assert isinstance(best, SolidSolution)
    assert [state.step.load for state in best.states] == [0.1, 0.2]
    assert best.last.residual <= 1e-9
    assert best.halvings >= 8
    assert caught.value.exit_code == 3


@pytest.mark.parametrize(
    ("reached", "wanted", "expected"),
    [
        (Step(0.5, 0.2), Step(1.0, 0.2), "load x0.5, tension x0.2 .reached. and load x1, tension x0.2 "),
        (Step(1.0, 0.123412), Step(1.0, 0.123449), "tension x0.12341 .reached. and load x1, tension x0.12345 "),
        (Step(1.0, 1.0 - 2e-16), Step(1.0, 1.0), "tension x0.9999999999999998 .reached. and load x1, tension x1 "),
    ],
)
def test_the_ends_of_a_failed_step_can_be_told_apart(reached: Step, wanted: Step, expected: str) -> None:
    """As many digits are printed as the two ends differ by.

    Catches: "between load x1 and load x1" after many halvings.
    """
    last, failure = SimpleNamespace(step=reached), StepFailedError("no luck", Why.iterations, iteration=12)
    told = advice(PathFailedError(failure, last, wanted, wanted), box_mesh(1), None, None)  # type: ignore[arg-type]
    assert re.search(expected, told)


def test_a_column_is_refused_beyond_its_buckling_load() -> None:
    """A clamped column under a dead end load converges to 97 % of its buckling load and not to 106 % of it.

    Timoshenko's P / (1 + P / (k G A)) of Euler's P = pi^2 E I / (4 L^2), k = 5/6; at nu = 0 it stays straight until
    then. Catches: an indefinite tangent factored all the same, a geometric stiffness of the wrong sign.
    """
    E, width, length = 100.0, 1.0, 8.0
    euler = np.pi**2 * E * width**4 / 12.0 / (4.0 * length**2)
    critical = euler / (1.0 + euler / (5.0 / 6.0 * E / 2.0 * width**2))
    model = SolidModel(
        box_mesh((2, 2, 10), (width, width, length), shift=0.0),
        {"muscle": NeoHooke(E, 0.0)},
        supports=[Fix("z0")],
        loads=[Traction("z1", (0.0, 0.0, -critical / width**2))],
    )
    with pytest.raises(SolveError, match="not positive definite") as caught:
        solve(model, [0.97, 1.06])
    best = caught.value.best
    assert len(best.states) == 1
    assert np.abs(best.last.u[:2]).max() < 1e-9 * length
    assert caught.value.buckling.step.load == pytest.approx(1.0, abs=0.03)


class _Wrong:
    """A law with its tangent or stress spoilt, without a compiled form."""

    def __init__(self, tangent: float = 1.0, stress: float = 1.0) -> None:
        self.law, self.tangents, self.stresses = NeoHooke(10.0, 0.3), tangent, stress

    def energy(self, F: np.ndarray) -> np.ndarray:
        return self.law.energy(F)

    def stress(self, F: np.ndarray) -> np.ndarray:
        return self.stresses * self.law.stress(F)

    def tangent(self, F: np.ndarray) -> np.ndarray:
        return self.tangents * self.law.tangent(F)


@pytest.mark.parametrize(
    ("law", "load", "word"),
    [
        (_Wrong(tangent=1.0, stress=float("nan")), 1e-3, "not a number"),
        (_Wrong(tangent=0.01), 1e-6, "the residual grows"),
        (_Wrong(tangent=3.0), 1e-3, "no convergence in 12 iterations"),
        (_Wrong(tangent=-1.0), 1e-3, "not positive definite"),
    ],
)
def test_each_way_to_fail_is_named(law: _Wrong, load: float, word: str) -> None:
    """A NaN, a growing residual, slow convergence and an indefinite tangent each end in their own words.

    Catches: an endless loop, a result accepted after the last iteration.
    """
    model = SolidModel(box_mesh(1), {"muscle": law}, supports=[Fix("z0")], loads=[Traction("z1", (0.0, load, load))])
    with pytest.raises(SolveError, match=word):
        solve(model)


def test_a_displacement_through_itself_ends_with_the_inverted_element() -> None:
    """A body asked to turn inside out, held all around, says which element is inverted.

    Catches: a negative volume accepted (a NaN from its logarithm).
    """
    inside_out = hold_everywhere(lambda X: np.diag([0.0, 0.0, -2.0]) @ X)
    with pytest.raises(SolveError, match=r"an element is inverted \(det F = -.*; element \d+ in region muscle at"):
        solve(SolidModel(box_mesh(1), {"muscle": SOFT}, supports=inside_out))


def test_a_trial_of_ones_own_is_where_the_first_step_begins() -> None:
    """From the solution itself nothing is left to do; a hopeless trial fails without halving.

    Catches: the trial ignored; the predictor put on top of it.
    """
    model = _contracting()
    solved = solve(model, [1.0], settings=TIGHT)
    again = solve(model, [1.0], trial=(solved.last.u, solved.last.points.S))
    assert again.newton_iterations == 0
    np.testing.assert_array_equal(again.last.u, solved.last.u)
    with pytest.raises(SolveError, match="inverted") as caught:
        solve(model, [1.0], trial=(-3.0 * model.system.space.points, None))
    assert caught.value.best.halvings == 0


def test_the_smallest_loads_are_solved_as_well() -> None:
    """A tension a billion times below the moduli gives a billionth of the displacement.

    Catches: a tolerance below the rounding of stresses in a stiff body, so that small drives fail.
    """
    model = SolidModel(
        box_mesh(2), {"muscle": NeoHooke(300.0, 0.3)}, {"muscle": ActiveStress(1.0, FIBRE)}, on_three_corners()
    )
    small, smaller = (solve(model, [factor]).last.u / factor for factor in (1e-3, 1e-7))
    # the rounding of F, 1e-16, beside strains of 1e-7 / 300
    np.testing.assert_allclose(smaller, small, rtol=0.0, atol=1e-4 * np.abs(small).max())


def test_settings_are_obeyed() -> None:
    """A looser tolerance ends earlier; one iteration is not enough for a large step.

    Catches: constants in place of the settings.
    """
    model = _contracting()
    loose = solve(model, [0.2], settings=NewtonSettings(tolerance=1e-3))
    tight = solve(model, [0.2], settings=NewtonSettings(tolerance=1e-12))
    assert loose.newton_iterations < tight.newton_iterations
    assert tight.last.residual <= 1e-12 < loose.last.residual <= 1e-3
    with pytest.raises(SolveError, match="no convergence in 1 iterations"):
        solve(model, [0.2], settings=NewtonSettings(max_iterations=1))


# --- the machine ------------------------------------------------------------------------------------------------------

NINE = np.linspace(0.0, 14.0, 10)[1:]


def test_the_whole_tension_path_and_back() -> None:
    """0 to 14 kPa in nine outputs takes at most 30 factorisations; unloading ends in the undeformed body.

    With the stresses carried along and extrapolated it took 11, 30 iterations and no halving; without either it needs
    twice as many and ten halvings. Catches: Newton's zigzag on the thin strip, a predictor of the displacement alone,
    a rough state on the way kept as an answer.
    """
    design, mesh = committed_bot()
    model = model_from_design(design, mesh)
    up = solve(model, [tension_step(design, T) for T in NINE])
    assert up.factorisations <= 30
    assert up.newton_iterations <= 45
    assert up.halvings == 0
    values = [measures(state, design) for state in up.states]
    closing = np.array([v["tip_closing_mm"] for v in values])
    stretch = np.array([v["fibre_stretch_1"] for v in values])
    assert np.all(np.diff(closing) > 0.0)
    assert np.all(np.diff(stretch) < 0.0)
    assert 0.5 < stretch[-1] < 0.65
    down = solve(model, [tension_step(design, 0.0)], start=up.states[-3:])
    assert np.abs(down.last.u).max() < 1e-8 * closing[-1]


@pytest.mark.slow
def test_the_work_does_not_grow_with_the_mesh() -> None:
    """On two meshes the path takes the same factorisations within two, in nine outputs and in one step to 7 kPa.

    Catches: steps that depend on the mesh, halvings on the finer one.
    """
    counts = []
    for size in (2.0, 0.75):
        design, mesh = committed_bot(size)
        model = model_from_design(design, mesh)
        nine = solve(model, [tension_step(design, T) for T in NINE])
        once = solve(model, [tension_step(design, 7.0)])
        counts.append((nine.factorisations, once.factorisations))
        np.testing.assert_allclose(once.last.u, _at(model, design, 7.0), rtol=0.0, atol=1e-6)
    assert max(max(pair) for pair in counts) <= 30
    assert np.abs(np.diff(counts, axis=0)).max() <= 2


def _at(model: SolidModel, design: object, tension: float) -> np.ndarray:
    """Displacement at a tension reached in small steps."""
    return solve(model, [tension_step(design, T) for T in np.linspace(0.0, tension, 8)[1:]]).last.u


@pytest.mark.slow
def test_an_impossible_tension_ends_with_what_was_reached() -> None:
    """1e4 kPa on the machine: an error with exit code 3 that carries the passive state.

    Catches: a loop of ever smaller steps; a crash in the factorisation.
    """
    design, mesh = committed_bot()
    model = model_from_design(design, mesh)
    with pytest.raises(SolveError, match="no equilibrium between") as caught:
        solve(model, [tension_step(design, 3.0), tension_step(design, 1e4)])
    assert [state.step for state in caught.value.best.states] == [tension_step(design, 3.0)]


def test_a_column_beyond_its_buckling_load_is_refused() -> None:
    """A perfect column at 0.9 of Euler's load stands; at 1.6 no state is returned, though the straight one balances.

    Catches: accepting an equilibrium whose tangent is not positive definite, which conjugate gradients do not see.
    """
    mesh = box_mesh((2, 2, 10), (1.0, 1.0, 8.0), shift=0.0)
    young = 100.0
    euler = np.pi**2 * young / 12.0 / (4.0 * 8.0**2)  # clamped-free, square section of side 1
    model = SolidModel(
        mesh, {"muscle": NeoHooke(young, 0.0)}, supports=[Fix("z0")], loads=[Traction("z1", (0.0, 0.0, -euler))]
    )
    assert len(solve(model, [0.9]).states) == 1
    with pytest.raises(SolveError, match="positive definite") as caught:
        solve(model, [1.6])
    assert caught.value.reached.load < 1.05
    assert not caught.value.best.states
