"""Models and states: what fits together, interpolation, stretch and energy of a state, shorthands of a solution."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Fix, Step, as_step
from fem_biobot.solid.space import space
from tests.helpers import TIGHT, box_mesh, generator, on_three_corners, unchanged, unit
from tests.oracles.laws import ISOTROPIC

SIZE = (1.2, 0.9, 1.4)
MESH = box_mesh(2, SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))
SOFT, STIFF = NeoHooke(10.0, 0.4), NeoHooke(60.0, 0.3)
FIBRE = unit(0.3, 0.8, -0.5)


def _model(tension: object = 4.0, a0: np.ndarray = FIBRE, **more: object) -> SolidModel:
    active = {"muscle": ActiveStress(tension, a0)}
    given = {"materials": {"muscle": SOFT, "skeleton": STIFF}, "active": active, "supports": on_three_corners(SIZE)}
    return SolidModel(MESH, **{**given, **more})


def _state(model: SolidModel, u: np.ndarray, tension: float = 1.0) -> SolidState:
    return SolidState(model, Step(1.0, tension), np.ascontiguousarray(u))


@pytest.mark.parametrize("element", ["P2", "P1"])
def test_at_interpolates_with_the_elements_own_polynomials(element: str) -> None:
    """A field in the element's space is reproduced inside elements, on faces and at vertices.

    Catches: linear interpolation of quadratic elements, local coordinates of another vertex, node order.
    """
    model = _model(element=element)
    X = model.system.space.points

    def field(X: np.ndarray) -> np.ndarray:
        square = X[0] * X[1] + 0.4 * X[2] ** 2 if element == "P2" else 0.0 * X[0]
        return np.stack([X[0] - 2 * X[2], 0.3 * X[1] + square, 1.0 + X[2] - square])

    state = _state(model, field(X))
    inside = generator(8).uniform(0.0, 1.0, (3, 40)) * np.array(SIZE)[:, None]
    places = np.concatenate([inside, MESH.points[:, :6], np.array([[0.0, 0.2, SIZE[2]]]).T], axis=1)
    with unchanged(state.u):
        for place in places.T:
            np.testing.assert_allclose(state.at(tuple(place)), field(place), rtol=0.0, atol=1e-12)


def test_at_refuses_a_place_outside() -> None:
    """A position outside the body is refused, one on its surface is not, up to rounding.

    Catches: extrapolation from the nearest element.
    """
    state = _state(_model(), np.zeros_like(_model().system.space.points))
    state.at((SIZE[0] * (1 + 1e-12), 0.3, 0.2))
    with pytest.raises(ModelError, match="outside the body"):
        state.at((SIZE[0] * 1.01, 0.3, 0.2))


def test_stretch_is_known_where_there_are_fibres_only() -> None:
    """The stretch is |F a0| in the muscle and not a number elsewhere.

    Catches: zero or one reported for gel; fibres of other elements.
    """
    H = np.array([[0.2, 0.1, 0.0], [-0.1, -0.15, 0.3], [0.05, 0.0, 0.1]])
    n = len(MESH.regions["muscle"])
    a0 = generator(3).normal(size=(3, n))
    a0 /= np.linalg.norm(a0, axis=0)
    model = _model(a0=a0)
    state = _state(model, H @ model.system.space.points)
    expected = np.linalg.norm((np.eye(3) + H) @ a0, axis=0)
    found = state.stretch[MESH.regions["muscle"]]
    np.testing.assert_allclose(found, np.repeat(expected[:, None], found.shape[1], axis=1), rtol=1e-13)
    assert np.all(np.isnan(state.stretch[MESH.regions["skeleton"]]))


def test_energy_is_the_passive_energy_of_all_regions() -> None:
    """At a homogeneous deformation the energy is volume times psi of each law, whatever the tension.

    Catches: the active energy included, one region left out, a mean instead of an integral.
    """
    H = np.array([[0.2, 0.1, 0.0], [-0.1, -0.15, 0.3], [0.05, 0.0, 0.1]])
    model = _model()
    stretches = np.linalg.svd(np.eye(3) + H, compute_uv=False)
    half = 0.5 * np.prod(SIZE)
    expected = half * sum(ISOTROPIC["neo_hooke"](stretches, *moduli, {})[0] for moduli in ((10.0, 0.4), (60.0, 0.3)))
    for tension in (0.0, 2.0):
        state = _state(model, H @ model.system.space.points, tension)
        assert state.energy == pytest.approx(expected, rel=1e-12)


def test_internal_force_is_the_derivative_of_the_energy_with_tension() -> None:
    """The Taylor remainder of passive plus active energy with the internal force falls with slope 2.

    Catches: an active force without energy, a force of the other sign.
    """
    model = _model()
    X = model.system.space.points
    draw = generator(5)
    u, du = 0.02 * draw.normal(size=(2, *X.shape))

    def total(eps: float) -> float:
        points = _state(model, u + eps * du, 0.7).points
        return float(np.sum(points.psi * model.system.space.dV))

    power = float(np.sum(_state(model, u, 0.7).internal_force * du))
    eps = 2.0 ** -np.arange(5, 11)
    rest = [abs(total(e) - total(0.0) - e * power) for e in eps]
    assert np.polyfit(np.log(eps), np.log(rest), 1)[0] == pytest.approx(2.0, abs=0.1)


def test_a_solution_speaks_of_its_last_state() -> None:
    """stretch, energy, reaction and at of a solution are those of the last step.

    Catches: the first state; a state at another load.
    """
    solution = solve(_model(), [0.5, 1.0], settings=TIGHT)
    last = solution.states[-1]
    assert last.step == Step(1.0, 1.0)
    assert solution.last is last
    np.testing.assert_array_equal(solution.stretch, last.stretch)
    np.testing.assert_array_equal(solution.at((0.1, 0.2, 0.3)), last.at((0.1, 0.2, 0.3)))
    np.testing.assert_array_equal(solution.reaction("corner_000"), last.reaction("corner_000"))
    assert solution.energy == last.energy > solution.states[0].energy > 0.0
    assert solution.newton_iterations == sum(s.newton_iterations for s in solution.states)
    assert solution.factorisations == sum(s.factorisations for s in solution.states)


def test_tension_of_each_element_counts() -> None:
    """Tensions given one an element act where they are given: half the region at rest pulls with half the force.

    Catches: the mean tension, tensions in the order of another numbering.
    """
    elements = MESH.regions["muscle"]
    first = MESH.points[0, MESH.cells[:, elements]].mean(axis=0) < 0.5 * SIZE[0]
    a0 = np.array([0.0, 1.0, 0.0])
    state = _state(_model(np.where(first, 4.0, 0.0), a0), 0.0 * _model().system.space.points)
    virial = state.internal_force @ state.model.system.space.points.T
    volume = MESH.volumes[elements[first]].sum()
    np.testing.assert_allclose(virial, np.diag([0.0, 4.0 * volume, 0.0]), rtol=0.0, atol=1e-12)


def test_steps_are_numbers_or_records() -> None:
    """A number scales loads and tension alike; a record is kept.

    Catches: a number for the tension only.
    """
    assert as_step(0.3) == Step(0.3, 0.3)
    assert as_step(Step(1.0, 0.2)) == Step(1.0, 0.2)


@pytest.mark.parametrize(
    ("load", "tension"), [(float("nan"), 1.0), (1.0, float("inf")), (1.0, -0.1), ("1", 1.0), ([1.0], 1.0)]
)
def test_steps_that_are_no_numbers_or_push_are_refused(load: object, tension: float) -> None:
    """Factors must be finite numbers and the tension at least zero, however the step is given.

    Catches: a negative tension, for which no path exists; text that reads like a number taken for one.
    """
    with pytest.raises(ModelError, match="step"):
        Step(load, tension)
    if tension == 1.0:
        with pytest.raises(ModelError, match="step"):
            as_step(load)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"materials": {"muscle": SOFT}}, "materials: found none for region 'skeleton'"),
        ({"materials": {"muscle": SOFT, "skeleton": STIFF, "bone": STIFF}}, "materials: found region 'bone'"),
        ({"active": {"bone": ActiveStress(1.0, FIBRE)}}, "active: found region 'bone'"),
        ({"active": {"muscle": ActiveStress(np.ones(5), FIBRE)}}, r"active\['muscle'\].tension: found 5 values"),
        ({"active": {"muscle": ActiveStress(1.0, np.eye(3))}}, r"active\['muscle'\].a0: found 3 values"),
        ({"element": "P3"}, "element: found 'P3', expected one of P2, P1"),
    ],
)
def test_parts_that_do_not_fit_the_mesh_are_refused(given: dict, word: str) -> None:
    """Regions without a law, laws and tensions without a region, arrays of another length, unknown elements.

    Catches: a region left without stiffness; broadcasting of a wrong number of values.
    """
    with pytest.raises(ModelError, match=word):
        _model(**given)


def test_other_laws_share_the_discrete_space() -> None:
    """with_materials changes the stress, keeps everything else, and refuses other regions.

    Catches: laws given to the wrong regions; the space made again.
    """
    model = _model()
    changed = model.with_materials({"skeleton": SOFT, "muscle": STIFF})
    again = _model(materials={"muscle": STIFF, "skeleton": SOFT})
    u = 0.1 * np.sin(model.system.space.points[::-1])
    assert changed.system.pattern is model.system.pattern
    np.testing.assert_array_equal(_state(changed, u).internal_force, _state(again, u).internal_force)
    assert model.materials["muscle"] is SOFT
    with pytest.raises(ModelError, match="expected muscle, skeleton"):
        model.with_materials({"muscle": STIFF})


def test_quadrature_has_positive_weights_that_sum_to_the_volume() -> None:
    """Every rule offered has positive weights; degrees 3 and 4, which have none such, become 5.

    Catches: the 5-point and 11-point rules with a negative weight; a volume counted per point.
    """
    for degree in (None, 1, 2, 3, 4, 5, 6, 7):
        body = space(MESH, "P2", degree)
        assert body.dV.min() > 0.0, degree
        np.testing.assert_allclose(body.dV.sum(axis=1), MESH.volumes, rtol=1e-12)
    np.testing.assert_array_equal(space(MESH, "P2", 4).dV, space(MESH, "P2", 5).dV)
    X = space(MESH).quadrature_points
    assert X.shape == (3, *space(MESH).dV.shape)
    centroid = np.einsum("ieq,eq->ie", X, space(MESH).dV) / MESH.volumes
    np.testing.assert_allclose(centroid, MESH.points[:, MESH.cells].mean(axis=1), rtol=0.0, atol=1e-13)


def test_midpoints_stand_in_the_order_of_vtk() -> None:
    """The ten nodes of an element are its corners and the midpoints of sides 01, 12, 02, 03, 13, 23.

    Catches: another edge order, which draws folded elements.
    """
    body = space(MESH)
    corners = body.points[:, body.nodes[:4]]
    for place, (a, b) in enumerate([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)], start=4):
        middle = 0.5 * (corners[:, a] + corners[:, b])
        np.testing.assert_allclose(body.points[:, body.nodes[place]], middle, rtol=0.0, atol=1e-14)
    np.testing.assert_array_equal(body.nodes[:4], MESH.cells)


def test_inputs_of_a_model_are_taken_over_as_they_are() -> None:
    """Solving leaves the mesh, the fibres and the start untouched; supports given as a list stay what they were.

    Catches: views of caller's arrays written to; a list shared with the caller.
    """
    supports = list(on_three_corners(SIZE))
    model = _model(supports=supports)
    supports.append(Fix("x1"))
    assert len(model.supports) == 3
    first = solve(model, [0.4])
    with unchanged(MESH.points, MESH.cells, model.active["muscle"].a0, first.last.u, model.system.dead_load):
        solve(model, [0.8], start=first.states)


@pytest.mark.parametrize("degree", [0, -1, 8, 9, 10, 2.0, "2", True])
def test_degrees_without_positive_rule_are_refused(degree: object) -> None:
    """No rule known has positive weights at degree 8 or above; other things are no degree.

    Catches: the rules of degree 8 and 9 with their negative weights; an error of scikit-fem's; a text read as a number.
    """
    with pytest.raises(ModelError, match=r"quadrature degree: found .*positive weights"):
        space(MESH, "P2", degree)
