"""Force-length curves: the named ones at their printed points, their energies, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from fem_biobot.errors import ModelError
from fem_biobot.material import FORCE_LENGTH, ActiveStress, FibreTension, ForceLength, force_length
from tests.laws.cases import CORNERED, FIBRE

EPS = np.finfo(float).eps


@pytest.mark.parametrize(
    ("name", "points"),
    [
        # over the optimal length: no force outside 0.4 to 1.6, 0.36 at the corners 0.6 and 1.4, parabolas between
        (
            "blemker_2005",
            {0.3: 0.0, 0.4: 0.0, 0.5: 0.09, 0.6: 0.36, 0.8: 0.84, 1.0: 1.0, 1.4: 0.36, 1.5: 0.09, 1.7: 0.0},
        ),
        # sarcomere lengths over 2.125 um, the middle of the plateau
        (
            "gordon_1966",
            {1.2 / 2.125: 0.0, 1.47 / 2.125: 0.42, 1.67 / 2.125: 0.84, 1.0: 1.0, 2.95 / 2.125: 0.5, 3.7 / 2.125: 0.0},
        ),
        ("none", {0.2: 1.0, 1.0: 1.0, 3.0: 1.0}),
    ],
)
def test_a_named_curve_goes_through_its_points(name: str, points: dict[float, float]) -> None:
    """The share of the tension at printed lengths, also with the optimal length moved.

    Catches: a piece begun at the wrong corner, a curve stretched the wrong way.
    """
    stretch, share = np.array(list(points)), np.array(list(points.values()))
    np.testing.assert_allclose(force_length(name)(stretch), share, rtol=0.0, atol=100 * EPS)
    np.testing.assert_allclose(force_length(name, 1.3)(1.3 * stretch), share, rtol=0.0, atol=100 * EPS)


@pytest.mark.parametrize("name", list(FORCE_LENGTH))
def test_a_named_curve_says_where_it_is_from(name: str) -> None:
    """Every curve has a source, and one that depends on length names its tissue.

    Catches: a number without its source.
    """
    curve = force_length(name)
    assert curve.is_constant == (name == "none")
    assert curve.is_constant or any(word in curve.source for word in ("native", "frog"))


@pytest.mark.parametrize("power", [0, 1, 2])
def test_the_energy_is_the_integral_of_the_force(power: int) -> None:
    """Energy of unit tension is int_1^s f x^(1 - p) dx, across corners on either side of 1.

    Catches: constants of the pieces left at zero, the integral begun elsewhere than at 1.
    """
    for s in (0.3, 0.7, 1.02, 1.3, 1.9):
        corners = [c for c in CORNERED.starts if min(s, 1.0) < c < max(s, 1.0)]
        wanted, _ = quad(lambda x: float(CORNERED(x)) * x ** (1 - power), 1.0, s, points=corners, epsabs=1e-13)
        assert float(CORNERED.energy(np.array(s), power)) == pytest.approx(wanted, abs=1e-12)


def test_the_slope_is_that_of_the_curve() -> None:
    """Between corners the slope is the central difference, exact for parabolas up to rounding.

    Catches: a factor of two lost from the square's derivative.
    """
    s, h = np.array([0.3, 0.8, 1.3, 1.9]), 1e-3
    difference = (CORNERED(s + h) - CORNERED(s - h)) / (2.0 * h)
    np.testing.assert_allclose(CORNERED.slope(s), difference, rtol=0.0, atol=1e-12)


def test_length_dependence_scales_the_tension_at_its_stretch() -> None:
    """Pulled to a stretch, the muscle has the tension's share there, and its tangent along the fibre is T f'.

    Catches: the curve read at the square of the stretch, its slope left out of the tangent.
    """
    s = 1.21
    F = np.diag([s, 0.9, 1.1])
    law = FibreTension(6.0, np.array([1.0, 0.0, 0.0]), force_length=CORNERED)
    assert law.stress(F)[0, 0] == pytest.approx(6.0 * float(CORNERED(s)), rel=10 * EPS)
    assert law.tangent(F)[0, 0, 0, 0] == pytest.approx(6.0 * float(CORNERED.slope(s)), rel=100 * EPS)


@pytest.mark.parametrize(
    ("starts", "coefficients", "word"),
    [
        ([0.1], [[1.0, 0.0, 0.0]], "starts"),
        ([0.0, 0.5, 0.4], np.ones((3, 3)), "starts"),
        ([0.0], [[1.0, 0.0]], "coefficients"),
        ([0.0], [[np.nan, 0.0, 0.0]], "coefficients"),
        ([0.0, 1.0], [[1.0, 0.0, 0.0], [1.1, 0.0, 0.0]], "jump of 0.1"),
    ],
)
def test_what_is_no_curve_is_refused(starts: list[float], coefficients: list, word: str) -> None:
    """Pieces begin at 0, rise, and join.

    Catches: a force that jumps, which no Newton iteration gets past.
    """
    with pytest.raises(ModelError, match=word):
        ForceLength(np.array(starts), np.array(coefficients))


@pytest.mark.parametrize("optimal", [0.0, -1.0, float("nan")])
def test_an_optimal_stretch_must_be_positive(optimal: float) -> None:
    """The length of greatest force is above 0.

    Catches: a division by zero in the curve's coefficients.
    """
    with pytest.raises(ModelError, match="optimal stretch"):
        force_length("blemker_2005", optimal)


def test_a_muscle_takes_a_curve_or_the_name_of_one() -> None:
    """Names are looked up; a curve of one's own is kept.

    Catches: a name kept as text, found out in the solver.
    """
    assert ActiveStress(1.0, FIBRE, force_length="gordon_1966").force_length.source.startswith("Gordon")
    assert ActiveStress(1.0, FIBRE, force_length=CORNERED).force_length is CORNERED
