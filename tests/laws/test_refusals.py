"""What laws and active tensions refuse when they are made, each with the word of what is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import (
    LAWS,
    ActiveStrain,
    ActiveStress,
    Convention,
    FibreTension,
    NaturalState,
    NeoHooke,
    law_from,
)
from fem_biobot.material.natural_state import isochoric_contraction
from tests.helpers import unit

FIBRE = unit(0.2, 0.9, -0.4)


@pytest.mark.parametrize("name", list(LAWS))
@pytest.mark.parametrize(
    ("young", "poisson", "word"),
    [
        (-3.0, 0.3, "young"),
        (0.0, 0.3, "young"),
        (float("nan"), 0.3, "young"),
        (float("inf"), 0.3, "young"),
        (3.0, 0.501, "poisson"),
        (3.0, -0.1, "poisson"),
        (3.0, float("nan"), "poisson"),
    ],
)
def test_passive_moduli_out_of_range_are_refused(name: str, young: float, poisson: float, word: str) -> None:
    """A modulus that is not positive and a Poisson's ratio outside [0, 0.5] are refused by name.

    Catches: no check; a check that lets NaN through.
    """
    with pytest.raises(ModelError, match=word):
        law_from(name, young, poisson, FIBRE)


def test_an_unknown_law_is_refused_with_the_known_ones() -> None:
    """The message lists the laws that exist.

    Catches: a bare KeyError.
    """
    with pytest.raises(ModelError, match=r"law: found 'rubber', expected one of .*neo_hooke"):
        law_from("rubber", 1.0, 0.3)


@pytest.mark.parametrize("make", [FibreTension, ActiveStress])
@pytest.mark.parametrize("tension", [-1.0, float("nan"), np.array([2.0, -0.1])])
def test_a_tension_that_pushes_is_refused(make: type, tension: object) -> None:
    """Muscle pulls: a negative tension, or one that is no number, is refused.

    Catches: a check of the first value only, of ``tension < 0`` without NaN.
    """
    with pytest.raises(ModelError, match="tension"):
        make(tension, FIBRE)


@pytest.mark.parametrize("make", [FibreTension, ActiveStress])
@pytest.mark.parametrize("a0", [1.001 * FIBRE, np.zeros(3), np.full(3, np.nan), np.stack([FIBRE, 2 * FIBRE], axis=1)])
def test_a_fibre_that_is_no_unit_vector_is_refused(make: type, a0: np.ndarray) -> None:
    """Fibres must have unit length, every one of them.

    Catches: silent normalisation, a check of the first fibre only.
    """
    with pytest.raises(ModelError, match="a0"):
        make(1.0, a0)


@pytest.mark.parametrize("a0", [np.ones((3, 2, 2)) / np.sqrt(3.0), np.array([[1.0, 0.0, 0.0]])])
def test_fibres_of_another_shape_are_refused(a0: np.ndarray) -> None:
    """Fibres of a region come as (3,) or (3, e).

    Catches: fibres given as rows taken for columns.
    """
    with pytest.raises(ModelError, match="shape"):
        ActiveStress(1.0, a0)


def test_an_unknown_convention_is_refused_and_a_name_is_understood() -> None:
    """The convention is an enum; its name does as well.

    Catches: any text accepted.
    """
    with pytest.raises(ModelError, match="convention"):
        ActiveStress(1.0, FIBRE, "second guess")
    assert ActiveStress(1.0, FIBRE, "nominal").convention is Convention.nominal


@pytest.mark.parametrize(
    ("F0", "word"), [(np.eye(2), "shape"), (np.ones((3, 3, 2, 2)), "shape"), (-np.eye(3), "det F")]
)
def test_a_natural_state_that_is_none_is_refused(F0: np.ndarray, word: str) -> None:
    """A natural state is one tensor of positive determinant, or one an element.

    Catches: an inverted natural state used silently.
    """
    with pytest.raises(ModelError, match=word):
        NaturalState(NeoHooke(1.0, 0.3), F0)


def test_a_natural_state_needs_a_law_with_an_energy() -> None:
    """A natural state scales an energy, so tension per current area has no place in it.

    Catches: an unsymmetric tangent pulled back as if it were symmetric.
    """
    with pytest.raises(ModelError, match="NaturalState: found FibreTension, expected a law that has an energy"):
        NaturalState(FibreTension(1.0, FIBRE, "cauchy"), np.eye(3))


def test_active_strain_refuses_a_tension_that_its_law_cannot_carry() -> None:
    """A law that does not resist shortening has no natural stretch for a tension.

    Catches: the end of the bracket returned as if it were an answer.
    """

    class Slack:
        def energy(self, F: np.ndarray) -> np.ndarray:
            return np.zeros(F.shape[2:])

        def stress(self, F: np.ndarray) -> np.ndarray:
            return np.zeros_like(F)

        def tangent(self, F: np.ndarray) -> np.ndarray:
            return np.zeros((3, 3, *F.shape))

    with pytest.raises(ModelError, match="tension: found 2 kPa, expected one that active strain"):
        ActiveStrain(2.0, FIBRE, Slack())


def test_an_isochoric_contraction_keeps_the_volume_and_shortens_the_fibre() -> None:
    """The natural state contracted to s along a0 has that stretch, determinant one, and no shear with the fibre.

    Catches: s for s^(-1/2) across, the dyad of the wrong axes.
    """
    a0 = np.stack([FIBRE, unit(1.0, -2.0, 0.5)], axis=1)
    F0 = isochoric_contraction(np.array([0.7, 0.9]), a0)
    np.testing.assert_allclose(np.einsum("ike,ke->ie", F0, a0), np.array([0.7, 0.9]) * a0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(np.moveaxis(F0, -1, 0)), 1.0, rtol=1e-14)
    np.testing.assert_allclose(F0, F0.swapaxes(0, 1), rtol=0, atol=1e-15)


@pytest.mark.parametrize("stretch", [0.0, -0.5])
def test_a_natural_stretch_must_be_positive(stretch: float) -> None:
    """A natural length of zero or less is refused.

    Catches: a NaN from the square root.
    """
    with pytest.raises(ModelError, match="natural stretch"):
        isochoric_contraction(stretch, FIBRE)


def test_given_fibres_are_kept_as_a_read_only_copy() -> None:
    """Changing the caller's array later does not change the muscle.

    Catches: the caller's array kept by reference.
    """
    mine = FIBRE.copy()
    muscle = ActiveStress(1.0, mine)
    mine[:] = 0.0
    np.testing.assert_array_equal(muscle.a0, FIBRE)
    with pytest.raises(ValueError, match="read-only"):
        muscle.a0[0] = 1.0
