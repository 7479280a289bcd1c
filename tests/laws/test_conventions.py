"""Conventions of active tension: which force each pulls with, and the way from one to another."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import ActiveStress, Convention, FibreTension, conventions, converted_tension, force_factor
from fem_biobot.material.fibre_tension import fibre_stretch
from fem_biobot.tables import plain
from tests.helpers import generic_gradients
from tests.laws.cases import FIBRE, STRESSES

EPS = np.finfo(float).eps
GRADIENTS = generic_gradients(10, seed=577)
STRETCH = fibre_stretch(GRADIENTS, FIBRE)
VOLUME = np.linalg.det(np.moveaxis(GRADIENTS, -1, 0))


@pytest.mark.parametrize("convention", STRESSES)
def test_the_force_of_a_tension_is_that_of_its_convention(convention: Convention) -> None:
    """Traction per reference area across the fibre is T, T s, T / s or T J / s, along the current fibre.

    Catches: conventions exchanged, a current area for the reference one, a factor at J = 1 only.
    """
    wanted = {
        "nominal": np.ones_like(STRETCH),
        "second_piola": STRETCH,
        "kirchhoff": 1.0 / STRETCH,
        "cauchy": VOLUME / STRETCH,
    }[convention.value]
    traction = np.einsum("ik...,k->i...", FibreTension(5.5, FIBRE, convention).stress(GRADIENTS), FIBRE)
    a = np.einsum("ik...,k->i...", GRADIENTS, FIBRE) / STRETCH
    np.testing.assert_allclose(traction, 5.5 * wanted * a, rtol=0.0, atol=200 * EPS * 5.5)
    np.testing.assert_allclose(force_factor(convention, STRETCH, VOLUME), wanted, rtol=50 * EPS)


def test_cauchy_stress_of_the_cauchy_convention_is_the_tension() -> None:
    """P F^T / J is T a x a whatever the deformation.

    Catches: a volume ratio upside down.
    """
    P = FibreTension(5.5, FIBRE, "cauchy").stress(GRADIENTS)
    sigma = np.einsum("im...,jm...->ij...", P, GRADIENTS) / VOLUME
    a = np.einsum("ik...,k->i...", GRADIENTS, FIBRE) / STRETCH
    np.testing.assert_allclose(sigma, 5.5 * np.einsum("i...,j...->ij...", a, a), rtol=0.0, atol=200 * EPS * 5.5)


@pytest.mark.parametrize("given", STRESSES)
@pytest.mark.parametrize("wanted", STRESSES)
def test_a_converted_tension_pulls_with_the_same_stress(given: Convention, wanted: Convention) -> None:
    """The law of the converted tension has the first Piola stress of the given one, at each point's own stretch.

    Catches: the ratio of factors upside down, the volume ratio forgotten on one side.
    """
    one = FibreTension(3.7, FIBRE, given).stress(GRADIENTS)
    tension = converted_tension(3.7, given, wanted, STRETCH, VOLUME)
    other = FibreTension(tension, FIBRE, wanted).stress(GRADIENTS)
    np.testing.assert_allclose(other, one, rtol=0.0, atol=500 * EPS * np.max(np.abs(one)))


def test_the_table_of_the_documentation_is_the_one_computed() -> None:
    """The module shows the very table that it makes, and a row of it is right by hand.

    Catches: documentation that has fallen behind, columns out of order.
    """
    text = plain(conventions.tension_table())
    shown = [line.split() for line in (conventions.__doc__ or "").splitlines()]
    made = [line.split() for line in text.splitlines()[1:]]
    assert all(row in shown for row in made)
    row = next(row for row in conventions.tension_table().rows if row[0] == 0.8)
    # 10 kPa nominal at 0.8: 10 / 0.8 of the second Piola kind; 8 of the Kirchhoff kind, and at J = 1 of Cauchy's
    np.testing.assert_allclose(row, [0.8, 10.0, 12.5, 8.0, 8.0], rtol=10 * EPS)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("active_strain", 0.9), "active_strain"),
        (("nominal", 0.0), "stretch: found 0"),
        (("cauchy", 0.9, -0.1), "volume ratio: found -0.1"),
        (("second guess", 0.9), "convention"),
    ],
)
def test_a_force_without_meaning_is_refused(arguments: tuple, word: str) -> None:
    """Active strain has no force of its own; stretches and volumes are positive.

    Catches: a factor of one for active strain, an infinite force.
    """
    with pytest.raises(ModelError, match=word):
        force_factor(*arguments)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"transverse": -0.1}, "transverse: found -0.1"),
        ({"transverse": 1.1}, "transverse: found 1.1"),
        ({"transverse": float("nan")}, "transverse"),
        ({"transverse": 0.2, "force_length": "blemker_2005"}, "force-length"),
        ({"force_length": "hill"}, "force_length: found 'hill', expected one of none"),
        ({"convention": "active_strain", "transverse": 0.2}, "transverse: found with convention active_strain"),
        ({"convention": "active_strain", "force_length": "gordon_1966"}, "force_length: found with"),
        ({"integrate": True}, "integrate"),
    ],
)
def test_options_that_do_not_go_together_are_refused(options: dict, word: str) -> None:
    """Each refusal names the option.

    Catches: an option ignored without a word.
    """
    with pytest.raises(ModelError, match=word):
        ActiveStress(4.0, FIBRE, **options)


@pytest.mark.parametrize(
    ("structure", "word"),
    [
        (np.eye(3), "trace"),
        (np.diag([1.2, -0.1, -0.1]), "eigenvalue"),
        (np.array([[0.5, 0.1, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.2]]), "skew"),
        (np.ones((3, 2)), "shape"),
    ],
)
def test_what_is_no_structure_tensor_is_refused(structure: np.ndarray, word: str) -> None:
    """A structure tensor is a mean of dyads of unit vectors: symmetric, of trace one, positive.

    Catches: a tensor that scales the tension or pushes.
    """
    with pytest.raises(ModelError, match=word):
        FibreTension(1.0, FIBRE, structure=structure)


def test_active_strain_is_no_tension_along_fibres() -> None:
    """The law of active stress refuses the convention that adds none.

    Catches: a missing power taken for another convention's.
    """
    with pytest.raises(ModelError, match="active_strain"):
        FibreTension(1.0, FIBRE, "active_strain")
