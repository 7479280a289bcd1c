"""A solve beside a neighbour: the same states in fewer iterations, whatever the neighbour is like."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import FileError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.solid.from_design import tension_unit
from fem_biobot.solid.held import place_nodes
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.newton import Trial
from fem_biobot.solid.path import residual
from fem_biobot.solid.records import Step
from fem_biobot.study.neighbour import STATES, Beside, Guide, Shared, keep_states, kept_states, lagrange
from fem_biobot.study.plan import Found, Solver, wanted_states
from fem_biobot.study.reporter import Silent

MIXED = ["mesh.element=P2-P1", "muscle.material.poisson=0.48"]


def solved(design: Design, mesh: BodyMesh, beside: Path | None = None, *, sharp: bool = False) -> list[Found]:
    """All states of a design's solve."""
    shared = Shared(Path(), beside, sharp)
    solver = Solver(design, mesh, Silent(), shared=shared)
    return [solver.solve(each) for each in wanted_states(design)]


def strip(*sets: str) -> Design:
    return load_design("strip", ["mesh.size=1.1 mm", "muscle.passive_tension=2 kPa", *sets])


def work(found: list[Found]) -> int:
    return sum(each.state.newton_iterations for each in found)


def apart(one: Found, other: Found) -> float:
    """Largest difference of displacements over the largest displacement."""
    return float(np.abs(one.state.u - other.state.u).max() / max(np.abs(other.state.u).max(), 1e-12))


def bots(more: tuple[str, ...] = ()) -> tuple[Design, Design]:
    """Two bots of one mesh that differ in tension and stiffness."""
    first = ["mesh.size=5 mm", "muscle.passive_tension=5 kPa", "muscle.material.young=10 kPa", *more]
    other = ["mesh.size=5 mm", "muscle.passive_tension=5.6 kPa", "muscle.material.young=10.7 kPa", *more]
    return load_design("junction_bot", first), load_design("junction_bot", other)


def test_a_bot_beside_its_neighbour_comes_to_the_same_states_in_fewer_iterations(tmp_path: Path) -> None:
    """Each state of a given tension is that of the path alone to 1e-8; those of a force and of remodelled tissue to
    what their search leaves. Measured: 33 iterations in place of 53.

    Catches: trials of other signs or tensions, a search that begins from nothing, a tolerance loosened for a trial.
    """
    first, other = bots()
    mesh = mesh_for(first)[0]
    keep_states(tmp_path, solved(first, mesh), first)
    cold, warm = solved(other, mesh), solved(other, mesh, tmp_path)
    assert work(warm) < 0.7 * work(cold)
    for one, two in zip(warm, cold, strict=True):
        # a force is met to 1e-4 of it, a natural stretch to 2e-3 of the tension
        searched = 2e-4 if one.wanted.force else 4e-3 if one.wanted.reference == "remodelled" else 1e-8
        assert apart(one, two) < searched, one.wanted.key


@pytest.mark.slow
def test_a_sharp_search_does_not_tell_where_it_began(tmp_path: Path) -> None:
    """Natural stretch and states of remodelled tissue, beside a neighbour and alone, to 1e-7.

    Catches: a search that ends as soon as it may.
    """
    first, other = bots(("muscle.reference=remodelled",))
    mesh = mesh_for(first)[0]
    keep_states(tmp_path, solved(first, mesh, sharp=True), first)
    cold, warm = (solved(other, mesh, beside, sharp=True) for beside in (None, tmp_path))
    assert work(warm) < 0.75 * work(cold)
    for one, two in zip(warm[-2:], cold[-2:], strict=True):
        assert one.natural_stretch == pytest.approx(two.natural_stretch, rel=1e-7)
        assert apart(one, two) < 1e-7


def test_mixed_states_begin_beside_mixed_states(tmp_path: Path) -> None:
    """Displacements and pressures of a nearly incompressible strip are those of the path alone; beside itself a strip
    needs an iteration a state at most, where its own forces all but vanish.

    Catches: pressures left behind, or taken of another state.
    """
    first, other = strip(*MIXED), strip(*MIXED, "muscle.passive_tension=2.2 kPa")
    mesh = mesh_for(first)[0]
    alone = solved(first, mesh)
    keep_states(tmp_path, alone, first)
    itself = solved(first, mesh, tmp_path)
    assert all(each.state.newton_iterations <= 1 for each in itself)
    for one, two in zip(solved(other, mesh, tmp_path), solved(other, mesh), strict=True):
        assert apart(one, two) < 1e-8
        assert one.state.pressure is not None
        assert two.state.pressure is not None
        assert np.abs(one.state.pressure - two.state.pressure).max() <= 1e-7 * max(
            np.abs(two.state.pressure).max(), 1.0
        )


@pytest.mark.parametrize("size", [0.02, 3.0])
def test_a_neighbour_that_leads_nowhere_costs_iterations_alone(size: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Displacements that are noise, of a hundredth of a mesh size and of three: the states are those of the path alone.

    Catches: a solve that fails with its trial, a state that is none taken for one.
    """
    design = strip()
    mesh = mesh_for(design)[0]
    cold = solved(design, mesh)
    noise = np.random.default_rng(31)
    wild: dict[str, Beside] = {}
    for each in cold:
        u = each.state.u + size * noise.standard_normal(each.state.u.shape)
        wild[each.wanted.key] = Beside(u, None, 1.0, each.wanted.tension or 0.0, 0.0, 1.0)
    monkeypatch.setattr(Shared, "states", lambda shared: wild)
    for one, two in zip(solved(design, mesh), cold, strict=True):
        assert apart(one, two) < 1e-7


def test_states_come_back_with_all_their_digits_or_not_at_all(tmp_path: Path) -> None:
    """Displacements, pressures and numbers, bit by bit; a missing file, one cut short and one of others are refused.

    Catches: single precision, half a file read as a whole one.
    """
    design = strip(*MIXED)
    mesh = mesh_for(design)[0]
    found = solved(design, mesh)
    keep_states(tmp_path, found, design)
    back = kept_states(tmp_path)
    assert list(back) == [each.wanted.key for each in found]
    for each, beside in zip(found, back.values(), strict=True):
        assert each.state.pressure is not None
        assert beside.pressure is not None
        assert (each.state.u == beside.u).all()
        assert (each.state.pressure == beside.pressure).all()
        assert beside.tension == pytest.approx(each.wanted.tension, rel=1e-14)
    content = (tmp_path / STATES).read_bytes()
    for harmed in (content[:-700], content[:4000], b"", b"states"):
        (tmp_path / STATES).write_bytes(harmed)
        with pytest.raises(FileError, match=r"cannot be read|cannot read"):
            kept_states(tmp_path)
    np.savez(tmp_path / STATES, u=np.zeros(3))
    with pytest.raises(FileError, match="expected the states of a solve"):
        kept_states(tmp_path)
    (tmp_path / STATES).unlink()
    with pytest.raises(FileError, match="cannot read"):
        kept_states(tmp_path)


def test_states_of_another_mesh_are_refused(tmp_path: Path) -> None:
    """As many nodes and pressures as the model has, or one line that says so.

    Catches: an array that happens to broadcast.
    """
    design = strip()
    model = SolidModel.from_design(design, mesh_for(design)[0])
    few = Beside(np.zeros((3, 7)), None, 1.0, 0.0, 0.0, 1.0)
    with pytest.raises(FileError, match=r"rest: found \(7, 0\) nodes and pressures"):
        Guide({"rest": few}, design, model)


def test_a_polynomial_goes_through_its_places() -> None:
    """Weights of four uneven places give a cubic anywhere, and one of them its own value.

    Catches: weights of the wrong place, weights that do not add up to one.
    """
    places = np.array([0.0, 0.94, 1.93, 2.75])

    def cubic(x: np.ndarray | float) -> np.ndarray | float:
        return 0.3 - 1.7 * x + 0.4 * x**2 + 0.23 * x**3

    for at in (1.4, 2.2, -0.3, 3.1):
        assert lagrange(places, at) @ cubic(places) == pytest.approx(cubic(at), rel=1e-12)
    assert lagrange(places, 1.93).tolist() == [0.0, 0.0, 1.0, 0.0]


def test_forces_are_expected_at_the_neighbours_tensions_in_proportion() -> None:
    """Own tensions 1.1 + 0.02 f times the neighbour's at equal force are foretold from two seen; none seen, its own.

    Catches: the neighbour's tension where own ones are known, a proportion turned round, a guess from no forces.
    """
    design, _ = bots()
    model = SolidModel.from_design(design, mesh_for(design)[0])
    u = np.zeros((3, model.system.space.n_nodes))

    def curve(force: float) -> float:
        return 1.7 * force + 0.2 * force**3

    there = {f"at_{f}": Beside(u, None, 1.0, curve(f), f, 1.0) for f in (0.0, 0.5, 1.0, 1.4, 2.0)}
    there["remodelled_passive"] = Beside(u, None, 1.0, 9.0, 0.7, 0.6)
    guide = Guide(there, design, model)
    assert guide.tension(0.8, [(0.0, 0.0)]) == pytest.approx(curve(0.8), rel=1e-12)
    seen = [(0.0, 0.0), *(((1.1 + 0.02 * f) * curve(f), f) for f in (0.5, 0.9))]
    assert guide.tension(1.4, seen) == pytest.approx((1.1 + 0.02 * 1.4) * curve(1.4), rel=1e-10)
    assert Guide({"rest": there["at_0.0"]}, design, model).tension(0.8, seen) is None


def test_what_a_trial_leaves_is_what_is_not_balanced() -> None:
    """Internal less external forces off the clamp, at a state and beside it; at an equilibrium next to nothing.

    Catches: forces of another step, held unknowns counted.
    """
    design = load_design("cantilever", ["mesh.size=2 mm"])
    model = SolidModel.from_design(design, mesh_for(design)[0])
    state = solve(model, [Step(0.5, 0.0)]).last
    free = np.ones(state.u.shape[1], dtype=bool)
    free[place_nodes(model.mesh, model.system.space, "clamp")] = False
    u = state.u + 1e-3 * free * np.sin(state.X)
    left = []
    for where, load in ((state.u, 0.5), (u, 0.5), (state.u, 0.8)):
        step = Step(load, 0.0)
        at = np.ascontiguousarray(where.T)
        forces = replace(state, u=where).internal_force - model.system.external_force(at, step).T
        left.append(residual(model.system, Trial(at), step))
        assert left[-1] == pytest.approx(np.linalg.norm(forces[:, free]), rel=1e-9)
    assert left[0] < 1e-6 * left[1]
    assert left[2] > 1e3 * left[0]


def test_a_neighbour_that_misleads_about_a_force_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Guesses of 900 kPa, and of none, for a muscle force: tensions tried stay within what an own guess may be, and the
    force is met without the neighbour, which guides what follows.

    Catches: a guess that is taken as it is, a force given up with its neighbour, a neighbour forgotten for good.
    """
    design, _ = bots()
    mesh = mesh_for(design)[0]
    wanted = next(each for each in wanted_states(design) if each.force)
    assert wanted.force is not None
    monkeypatch.setattr(Guide, "trial", lambda guide, *given: None)
    cold = Solver(design, mesh, Silent()).solve(wanted)
    reach, tried = Solver._reach, []

    def watched(solver: Solver, step: Step, *given: Any) -> SolidState:
        bent = solver.guide is not None
        if bent:
            tried.append((step.tension * tension_unit(design), max(t for t, _ in solver.seen)))
        return reach(solver, step, *given)

    monkeypatch.setattr(Solver, "_reach", watched)
    monkeypatch.setattr(Guide, "tension", lambda guide, force, seen: 900.0)
    monkeypatch.setattr(Shared, "states", lambda shared: {})
    solver = Solver(design, mesh, Silent(), shared=Shared(Path(), Path()))
    guide = solver.guide
    assert guide is not None
    found = solver.solve(wanted)
    assert tried[0][0] < 30.0
    assert all(tension <= 2.0 * max(tried[0][0], most) * (1.0 + 1e-12) for tension, most in tried)
    assert found.state.step.tension == cold.state.step.tension
    assert apart(found, cold) < 1e-8
    assert work([found]) > work([cold])
    assert solver.guide is guide
    monkeypatch.setattr(Guide, "tension", lambda guide, force, seen: 0.0)
    assert solver._tension_guess(1.3) == pytest.approx(0.2 * 1.3 / design.junction_section)
