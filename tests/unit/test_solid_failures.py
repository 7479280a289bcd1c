"""A solve that fails says at which step and iteration, why, and in which element, and keeps its best iterate."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fem_biobot.errors import SolveError
from fem_biobot.material import ActiveStress, Gent, NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.failure import least_stiffness, place
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Fix, Step, Traction
from fem_biobot.solid.step_failed import Why
from tests.helpers import box_mesh, generator, hold_everywhere

LAW = NeoHooke(10.0, 0.3)
MESH = box_mesh(2, (1.0, 1.2, 1.6), layers=(0.5, 1.0), names=("low", "high"))


class Spoilt:
    """A law with its tangent or stress multiplied."""

    def __init__(self, tangent: float = 1.0, stress: float = 1.0) -> None:
        self.tangents, self.stresses = tangent, stress

    def energy(self, F: np.ndarray) -> np.ndarray:
        return LAW.energy(F)

    def stress(self, F: np.ndarray) -> np.ndarray:
        return self.stresses * LAW.stress(F)

    def tangent(self, F: np.ndarray) -> np.ndarray:
        return self.tangents * LAW.tangent(F)


def _failure(model: SolidModel, steps: list[float | Step], **more: object) -> SolveError:
    with pytest.raises(SolveError) as caught:
        solve(model, steps, **more)  # type: ignore[arg-type]
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith("no equilibrium between load x")
    return caught.value


def _named(failure: SolveError, mesh: BodyMesh) -> str:
    """Region of the element that the message names, after its number and place are seen to be those of the mesh."""
    told = re.search(r"element (\d+) in region (\w+) at \((.+), (.+), (.+)\) mm", str(failure))
    assert told is not None
    element = int(told[1])
    assert element == failure.element
    middle = mesh.points[:, mesh.cells[:, element]].mean(axis=1)
    np.testing.assert_allclose([float(told[k]) for k in (3, 4, 5)], middle, rtol=1e-3)
    assert element in mesh.regions[told[2]]
    return told[2]


def test_an_inverted_element_is_named() -> None:
    """Only the upper layer is asked to turn inside out; the message names one of its elements and the trial.

    Catches: the element's number within its region, the number of the first element.
    """

    def push(X: np.ndarray) -> np.ndarray:
        return np.stack([0.0 * X[0], 0.0 * X[1], -3.0 * np.maximum(X[2] - 0.8, 0.0)])

    low = [Fix("low_top", "xyz")]
    mesh = BodyMesh(MESH.points, MESH.cells, MESH.regions, {**MESH.surfaces, "low_top": _middle()}, MESH.landmarks)
    model = SolidModel(mesh, {"low": LAW, "high": LAW}, supports=[*hold_everywhere(push), *low])
    failure = _failure(model, [1.0])
    assert failure.why is Why.inverted
    assert "an element is inverted (det F = -" in str(failure)
    assert _named(failure, mesh) == "high"
    assert failure.reached.load < failure.failed_at.load <= failure.wanted.load == 1.0
    assert f"at load x{failure.failed_at.load:.4g}" in str(failure)
    assert re.search(r", iteration \d+: an element", str(failure))


def _middle() -> np.ndarray:
    """Facets of the plane between the layers, (3, f)."""
    t = MESH.cells[:, MESH.regions["low"]]
    faces = np.concatenate([t[[1, 2, 3]], t[[0, 3, 2]], t[[0, 1, 3]], t[[0, 2, 1]]], axis=1)
    return faces[:, np.all(np.abs(MESH.points[2, faces] - 0.8) < 1e-9, axis=0)]


def test_a_point_outside_its_law_is_named() -> None:
    """Chains drawn out in the lower layer only: the element is one of that layer, the limit is told.

    Catches: the point's number within the region's part taken for the element's.
    """

    def pull(X: np.ndarray) -> np.ndarray:
        return np.stack([0.6 * X[0], (1.6**-0.5 - 1.0) * X[1], (1.6**-0.5 - 1.0) * X[2]])

    # the other way round, so that the number of an element differs from its place in the region
    mesh = BodyMesh(
        MESH.points, MESH.cells[:, ::-1], _reversed(MESH.regions, MESH.cells.shape[1]), MESH.surfaces, MESH.landmarks
    )
    laws = {"low": Gent(10.0, 0.4, chain_limit=0.5), "high": LAW}
    failure = _failure(SolidModel(mesh, laws, supports=hold_everywhere(pull)), [1.0])
    assert failure.why is Why.outside_law
    assert "chain_limit" in str(failure)
    assert _named(failure, mesh) == "low"


def _reversed(regions: dict[str, np.ndarray], n: int) -> dict[str, np.ndarray]:
    return {name: np.sort(n - 1 - elements) for name, elements in regions.items()}


@pytest.mark.parametrize(
    ("law", "load", "why", "word"),
    [
        (Spoilt(stress=float("nan")), 1e-3, Why.no_number, "the residual is not a number"),
        (Spoilt(tangent=0.01), 1e-6, Why.diverged, r"the residual grows \(to .* of the force scale\)"),
        (Spoilt(tangent=3.0), 1e-3, Why.iterations, "no convergence in 12 iterations"),
        (Spoilt(tangent=-1.0), 1e-3, Why.indefinite, "the tangent is not positive definite"),
    ],
)
def test_the_reason_is_told_with_the_loudest_element(law: Spoilt, load: float, why: Why, word: str) -> None:
    """A law spoilt in the upper layer alone: the reason as a word and in words, and an element at its nodes.

    Catches: reasons told apart by their text only, an element of the layer that converges.
    """
    model = SolidModel(MESH, {"low": LAW, "high": law}, supports=[Fix("z0")], loads=[Traction("z1", (0.0, load, load))])
    failure = _failure(model, [1.0])
    assert failure.why is why
    assert re.search(rf"at load x\S+, tension x\S+, iteration \d+: {word}.*; the largest force out of", str(failure))
    region = _named(failure, MESH)
    top = MESH.points[2, MESH.cells[:, failure.element]].max()
    assert region == "high" or top > 0.8 - 1e-9


def test_the_best_iterate_is_kept() -> None:
    """Out of iterations, the error carries the try with the least residual, as a state that is no equilibrium.

    Its residual is computed anew. Catches: the last iterate in place of the best, one of an earlier step, a view of
    the array that the iteration goes on with.
    """
    model = SolidModel(
        MESH, {"low": LAW, "high": Spoilt(tangent=1.5)}, supports=[Fix("z0")], loads=[Traction("z1", (0.0, 1.0, 1.0))]
    )
    seen: list[float] = []
    failure = _failure(
        model,
        [1.0],
        settings=NewtonSettings(max_iterations=4),
        observe=lambda kind, v: seen.append(v["residual"]) if kind == "iteration" else None,
    )
    state = failure.iterate
    assert isinstance(state, SolidState)
    assert state.step == failure.failed_at
    assert state.residual == pytest.approx(min(seen[-5:]), rel=1e-12)
    system = model.system
    force, magnitude = system.internal_force(state.points)
    r = system.residual(state.points, force, system.external_force(np.ascontiguousarray(state.u.T), state.step))
    r[system.held.dofs] = 0.0
    assert 1e-9 < state.residual < 1.0
    assert np.linalg.norm(r) / np.linalg.norm(magnitude) == pytest.approx(state.residual, rel=1e-6)
    again = failure.retold("in other words")
    assert str(again) == "in other words"
    assert {k: v for k, v in vars(again).items()} == vars(failure)


def test_an_unstable_equilibrium_names_where_it_is_least_stiff() -> None:
    """A free body that contracts beyond its limit: the softer of its two parts is named, and what to do.

    Catches: an element of the stiff part, the modulus without the geometric part.
    """
    laws = {"low": NeoHooke(40.0, 0.0), "high": NeoHooke(8.0, 0.0)}
    a0 = np.array([0.0, 0.0, 1.0])
    active = {name: ActiveStress(3.9, a0, "kirchhoff") for name in laws}
    supports = [Fix("z0", "z"), Fix((0.0, 0.0, 0.0)), Fix((1.0, 0.0, 0.0), "y")]
    model = SolidModel(MESH, laws, active, supports)
    failure = _failure(model, [0.8, 1.4])
    assert failure.why in (Why.unstable, Why.indefinite)
    assert _named(failure, MESH) == "high"
    assert len(failure.best.states) == 1


def test_the_least_stiffness_is_the_smallest_eigenvalue_of_the_tangent() -> None:
    """Against dP/dF of the law itself, as a 9 by 9 matrix, at a generic state with tension.

    Catches: shears counted once, the geometric part left out or with the indices of the current frame.
    """
    active = {"high": ActiveStress(6.0, np.array([0.6, 0.0, 0.8]))}
    model = SolidModel(MESH, {"low": LAW, "high": NeoHooke(14.0, 0.2)}, active, supports=[Fix("z0")])
    system = model.system
    u = 0.02 * generator(8).normal(size=(system.space.n_nodes, 3))
    F = system.deformation_gradient(u)
    found = least_stiffness(system.points(F, 1.0))
    for element in (MESH.regions["low"][3], MESH.regions["high"][5]):
        at = F[:, :, [element]]
        A4 = model.materials["low" if element in MESH.regions["low"] else "high"].tangent(at)
        if element in MESH.regions["high"]:
            A4 = A4 + system.contractions[0].law.at(np.array([element])).tangent(at)  # type: ignore[attr-defined]
        A = np.moveaxis(A4.reshape(9, 9, -1), -1, 0)
        assert found[element] == pytest.approx(np.linalg.eigvalsh(A)[:, 0].min(), rel=1e-9, abs=1e-9)


def test_a_failure_on_the_way_of_own_drives_tells_their_factors() -> None:
    """The two ends of the step and the try between them are told with the factors of muscles and loads of their own.

    Catches: common factors alone, which are the same at both ends.
    """
    a0 = np.array([0.0, 0.0, 1.0])
    laws = {"low": NeoHooke(8.0, 0.0), "high": NeoHooke(8.0, 0.0)}
    active = {name: ActiveStress(3.9, a0, "kirchhoff") for name in laws}
    supports = [Fix("z0", "z"), Fix((0.0, 0.0, 0.0)), Fix((1.0, 0.0, 0.0), "y")]
    loads = [Traction("z1", (0.0, 0.0, -0.01), name="weight")]
    steps = [Step(0.0, 0.2, {"weight": 0.4}, {"high": 0.3}), Step(0.0, 0.2, {"weight": 0.5}, {"high": 3.0})]
    failure = _failure(SolidModel(MESH, laws, active, supports, loads), steps)
    text = r"tension x0.2, weight x0.4\S*, high x\S+ \(reached\) and .*tension x0.2, weight x0.5, high x3 \(asked\)"
    assert re.search(text, str(failure))
    assert re.search(r"at load x0, tension x0.2, weight x0.4\S*, high x\S+", failure.reason)


def test_a_place_outside_all_regions_is_told_as_none() -> None:
    """Catches: the last region looked at."""
    bare = BodyMesh(MESH.points, MESH.cells, {"low": MESH.regions["low"]})
    assert " in region none at (" in place(bare, int(MESH.regions["high"][0]))
