"""Stresses of a state: measures of stress, means over elements, probes at places, the stress along the fibre."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import ActiveStress, NaturalState, NeoHooke
from fem_biobot.solid.model import SolidModel, SolidState
from fem_biobot.solid.records import Step
from fem_biobot.solid.stress import (
    ball,
    cauchy_stress,
    element_mean,
    fibre_stress,
    first_piola_stress,
    node_probe,
    probe,
    second_piola_stress,
    von_mises,
)
from tests.helpers import box_mesh, generator, generic_gradients, on_three_corners, rotation, unchanged, unit
from tests.laws.cases import F0
from tests.oracles.laws import principal

SIZE = (1.2, 0.9, 1.4)
MESH = box_mesh(2, SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))
MODULI = {"muscle": (10.0, 0.4), "skeleton": (60.0, 0.3)}
FIBRE = unit(0.3, 0.8, -0.5)
F = generic_gradients(1, seed=99)[:, :, 0]


def _state(natural: np.ndarray | None = None) -> SolidState:
    """A homogeneous deformation F of the two regions at half the tension of 8 kPa."""
    laws = {name: NeoHooke(*moduli) for name, moduli in MODULI.items()}
    if natural is not None:
        laws["muscle"] = NaturalState(laws["muscle"], natural)
    model = SolidModel(MESH, laws, {"muscle": ActiveStress(8.0, FIBRE)}, on_three_corners(SIZE))
    return SolidState(model, Step(1.0, 0.5), (F - np.eye(3)) @ model.system.space.points)


def _expected_cauchy(region: str) -> np.ndarray:
    P = principal("neo_hooke", F, *MODULI[region])[1]
    if region == "muscle":
        a = F @ FIBRE
        P = P + 4.0 * np.outer(a / np.linalg.norm(a), FIBRE)
    return P @ F.T / np.linalg.det(F)


@pytest.mark.parametrize("region", list(MODULI))
def test_each_measure_of_stress_is_that_of_the_law(region: str) -> None:
    """First Piola, second Piola and Cauchy stress of a homogeneous state, passive and active together.

    Catches: J left out, F on the wrong side, the tension at factor 1.
    """
    state = _state()
    elements = MESH.regions[region]
    sigma = _expected_cauchy(region)
    P = np.linalg.det(F) * sigma @ np.linalg.inv(F).T
    S = np.linalg.inv(F) @ P
    found = first_piola_stress(state.points), second_piola_stress(state.points), cauchy_stress(state.points)
    for values, expected in zip(found, (P, S, sigma), strict=True):
        here = values[:, :, elements]
        wide = np.broadcast_to(expected[:, :, None, None], here.shape)
        np.testing.assert_allclose(here, wide, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_von_mises_is_one_number_for_a_state_of_stress() -> None:
    """A pull gives itself, a shear sqrt(3) times itself, a pressure nothing; turning and pressure do not matter.

    Catches: the deviator's third, a factor 3/2, shear counted once.
    """
    Q = rotation(6)
    pull = np.diag([5.0, 0.0, 0.0])
    shear = np.array([[0.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    cases = np.stack([Q @ s @ Q.T + p * np.eye(3) for s, p in ((pull, -7.0), (shear, 3.0), (0 * pull, 11.0))], axis=-1)
    with unchanged(cases):
        found = von_mises(cases)
    np.testing.assert_allclose(found, [5.0, 2.0 * np.sqrt(3.0), 0.0], rtol=1e-12, atol=1e-6)


def test_fibre_stress_is_the_traction_along_the_current_fibre() -> None:
    """a . sigma a with a the unit current fibre; not a number in gel.

    Catches: the reference fibre, an unnormalised one, active stress alone.
    """
    state = _state()
    found = fibre_stress(state, cauchy_stress(state.points))
    a = F @ FIBRE / np.linalg.norm(F @ FIBRE)
    expected = a @ _expected_cauchy("muscle") @ a
    np.testing.assert_allclose(found[MESH.regions["muscle"]], expected, rtol=1e-12)
    assert np.all(np.isnan(found[MESH.regions["skeleton"]]))


def test_the_mean_over_an_element_is_by_volume() -> None:
    """The mean of a field linear in the position is its value at the centroid.

    Catches: an unweighted mean on unequal weights; a sum.
    """
    space = _state().model.system.space
    values = np.einsum("ci,ieq->ceq", np.array([[1.0, -2.0, 0.5], [0.0, 3.0, 1.0]]), space.quadrature_points)
    centroids = MESH.points[:, MESH.cells].mean(axis=1)
    expected = np.array([[1.0, -2.0, 0.5], [0.0, 3.0, 1.0]]) @ centroids
    np.testing.assert_allclose(element_mean(_state().model.system, values), expected, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("natural", [None, "one", "each"])
def test_a_probe_reads_the_stress_at_places(natural: str | None) -> None:
    """At any place inside, the stress is that of the element's law, natural states included; outside, nothing is read.

    Catches: the law of the neighbour, the natural state of another element, the tension at factor 1.
    """
    given = None
    if natural == "one":
        given = F0
    elif natural == "each":
        given = F0[:, :, None] + 0.02 * generator(4).normal(size=(3, 3, MESH.n_elements))
    state = _state(given)
    X = generator(7).uniform(0.02, 0.98, (3, 60)) * np.array(SIZE)[:, None]
    outside = np.array([[0.3, -0.1, 0.4], [5.0, 0.1, 0.1]]).T
    found = probe(state.model.system, np.concatenate([outside, X], axis=1))
    assert found.elements.shape == (60,)
    sigma = found.cauchy_stress(state)
    means = element_mean(state.model.system, cauchy_stress(state.points))
    np.testing.assert_allclose(sigma, means[:, :, found.elements], rtol=0.0, atol=1e-11 * np.abs(means).max())
    np.testing.assert_array_equal(np.isin(found.elements, MESH.regions["muscle"]), X[2] < 0.5 * SIZE[2])
    gradient = found.deformation_gradient(state)
    np.testing.assert_allclose(gradient, np.broadcast_to(F[:, :, None], gradient.shape), rtol=0.0, atol=1e-12)


def test_a_probe_reads_what_quadratic_displacement_does_between_points() -> None:
    """F varies linearly inside quadratic elements, and the probe sees its value at the place itself.

    Catches: the element's mean for the local value.
    """
    model = _state().model
    points = model.system.space.points
    u = 0.1 * np.stack([points[0] * points[1], points[2] ** 2, points[0] ** 2])
    state = SolidState(model, Step(), u)
    X = generator(7).uniform(0.02, 0.98, (3, 20)) * np.array(SIZE)[:, None]
    zero = np.zeros(20)
    H = 0.1 * np.array([[X[1], X[0], zero], [zero, zero, 2 * X[2]], [2 * X[0], zero, zero]])
    found = probe(model.system, X).deformation_gradient(state)
    np.testing.assert_allclose(found, np.eye(3)[:, :, None] + H, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("element", ["P2", "P1"])
def test_nodes_are_asked_of_each_of_their_elements(element: str) -> None:
    """The node probe gives F of every element at its own nodes, element by element.

    Catches: nodes in another order, a neighbour's value.
    """
    model = SolidModel(MESH, _state().model.materials, supports=on_three_corners(SIZE), element=element)
    space = model.system.space
    X = space.points
    u = 0.1 * (np.stack([X[0] * X[1], X[2] ** 2, X[0] ** 2]) if element == "P2" else X[::-1] * [[1.0], [2.0], [3.0]])
    found = node_probe(model.system).deformation_gradient(SolidState(model, Step(), u))
    at = X[:, space.nodes.T.ravel()]  # element by element
    zero = 0 * at[0]
    one = zero + 1.0
    H = [[at[1], at[0], zero], [zero, zero, 2 * at[2]], [2 * at[0], zero, zero]]
    if element == "P1":
        H = [[zero, zero, one], [zero, 2 * one, zero], [3 * one, zero, zero]]
    np.testing.assert_allclose(found, np.eye(3)[:, :, None] + 0.1 * np.array(H), rtol=0.0, atol=1e-12)


def test_fibre_fields_of_a_probe_are_those_of_the_points() -> None:
    """Stretch and stress along the fibre at places agree with those at the quadrature points, zero in gel.

    Catches: the fibre of another element, NaN in gel (which spoils a picture).
    """
    state = _state()
    stretch, stress = node_probe(state.model.system).fibre_fields(state)
    per_element = stretch.reshape(MESH.n_elements, -1), stress.reshape(MESH.n_elements, -1)
    points = state.stretch, fibre_stress(state, cauchy_stress(state.points))
    muscle = MESH.regions["muscle"]
    for found, expected in zip(per_element, points, strict=True):
        np.testing.assert_allclose(found[muscle], expected[muscle][0, 0], rtol=1e-11)
        assert not found[MESH.regions["skeleton"]].any()


def test_a_ball_is_even_and_fills_its_radius() -> None:
    """The cloud is centred, lies within the radius and has the ball's second moment.

    Catches: a shell, a cube, an off-centre grid.
    """
    centre = np.array([1.0, -2.0, 0.5])
    X = ball(centre, 0.3)
    r = np.linalg.norm(X - centre[:, None], axis=0)
    assert r.max() <= 0.3
    np.testing.assert_allclose(X.mean(axis=1), centre, rtol=0.0, atol=1e-14)
    assert X.shape[1] == pytest.approx(20**3 * np.pi / 6.0, rel=0.02)
    assert np.mean(r**2) == pytest.approx(0.6 * 0.3**2, rel=0.02)
