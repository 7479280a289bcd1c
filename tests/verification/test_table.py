"""Every row of the verification table passes; what each case measures and catches stands in its own docstring.

Also that numbers in the table which nobody printed are those of the independent answers in tests/oracles.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.material import LAWS
from fem_biobot.verification import rods, solid_states
from fem_biobot.verification.records import Finding
from fem_biobot.verification.registry import CASES
from tests.oracles import laws
from tests.oracles.cosserat import cantilever_tip

ROWS = [(case.id, number) for case in CASES.values() for number, _ in enumerate(case.claims)]


@cache
def found(name: str) -> Finding:
    """What a case computes, once."""
    return CASES[name].compute()


@pytest.mark.parametrize(("name", "number"), ROWS, ids=[f"{name}-{number}" for name, number in ROWS])
def test_a_row_passes(name: str, number: int) -> None:
    """What was computed is the known answer within its tolerance; a row that is only shown has a number.

    Catches: see each case's docstring.
    """
    row = CASES[name].rows(found(name))[number]
    assert np.isfinite(row.ours), row.claim.quantity
    assert row.passed is not False, f"{row.claim.quantity}: {row.ours}, error {row.error:.2g}"


@pytest.mark.parametrize("name", list(CASES))
def test_a_picture_shows_the_known_answer_beside_ours(name: str) -> None:
    """Each graph has a known curve and one of ours, as many values as places, all of them numbers.

    Catches: a picture without its answer, values that are not numbers handed on to the drawing.
    """
    graph = found(name).graph
    if graph is None:
        pytest.skip("no curve")
    assert {curve.known for curve in graph.curves} == {True, False}
    for curve in graph.curves:
        x, y = np.asarray(curve.x, dtype=float), np.asarray(curve.y, dtype=float)
        assert x.shape == y.shape
        assert x.ndim == 1
        assert np.isfinite([x, y]).all(), curve.name


@pytest.mark.parametrize("name", list(CASES))
def test_a_case_says_what_it_measures_and_what_it_catches(name: str) -> None:
    """Each case's function names problem, measure, tolerance, blind spots and the faults that it was seen to catch.

    Catches: a case that was added without a word on its tolerances.
    """
    text = CASES[name].compute.__doc__ or ""
    assert text.startswith(f"{name}: ")
    for word in ("Problem:", "Measured:", "Tolerance:", "Cannot see:", "Catches:"):
        assert word in text, word


def test_every_law_is_stretched_and_sheared_in_the_table() -> None:
    """S4 has a row for each law that a design can name.

    Catches: a law added without its known stress.
    """
    assert set(solid_states.STRESSES) == set(LAWS)
    assert set(solid_states.END_STRESSES) == set(laws.ISOTROPIC)


@pytest.mark.parametrize("name", list(solid_states.STRESSES))
def test_stresses_in_the_table_are_those_of_the_laws_twins(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """S4: digits of the stress at a generic deformation, from each law's energy in other variables.

    Catches: a digit copied from the code under test.
    """
    own = solid_states.PARAMETERS.get(name, {})
    monkeypatch.setitem(laws.PARAMETERS, name, own)
    young, poisson, fibre = solid_states.YOUNG, solid_states.POISSON, solid_states.FIBRE
    _, P = laws.at_point(name, solid_states.GENERIC, young, poisson, fibre)
    assert solid_states.STRESSES[name][0] == pytest.approx(np.linalg.norm(P), rel=1e-13)
    if name in solid_states.END_STRESSES:

        def stresses(across: float) -> np.ndarray:
            stretches = np.array([solid_states.SHORTENED, across, across])
            return laws.ISOTROPIC[name](stretches, young, poisson, own)[1]

        across = brentq(lambda t: stresses(t)[1], 0.8, 1.5, xtol=1e-15, rtol=1e-15)
        assert solid_states.END_STRESSES[name] == pytest.approx(stresses(across)[0], rel=1e-13)


# directors of a cantilever along x, as rows
FRAME = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


@pytest.mark.parametrize("q", list(rods.DEAD_LOAD))
def test_tips_under_dead_load_are_those_of_the_differential_equation(q: float) -> None:
    """R3: ten digits of the tip of an inextensible, unshearable cantilever, and the four that are printed.

    Catches: a digit copied from the code under test.
    """
    rigid = (np.inf,) * 3 + (1.0,) * 3
    x, y, _ = cantilever_tip(1.0, rigid, (0.0, 0.0, 0.0), per_length=(0.0, -q, 0.0), frame=FRAME)
    np.testing.assert_allclose(rods.DEAD_LOAD_EXACT[q], [x, -y], rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(rods.DEAD_LOAD[q], [x, -y], rtol=0.0, atol=5.1e-5)


def test_the_bends_tip_is_that_of_the_differential_equation() -> None:
    """R4: ten digits of the tip's displacement.

    Catches: a digit copied from the code under test; a stiffness of another section.
    """
    E = 1e7
    stiffness = (E / 2, E / 2, E, E / 12, E / 12, E / 12)
    tip = cantilever_tip(25.0 * np.pi, stiffness, (0.0, 0.0, 600.0), kappa0=(0.0, 0.01, 0.0), frame=FRAME)
    drawn = 100.0 * np.array([np.sqrt(0.5), 1.0 - np.sqrt(0.5), 0.0])
    np.testing.assert_allclose(rods.BEND_EXACT, tip - drawn, rtol=0.0, atol=1e-9)
    assert rods.BEND_STIFFNESS == stiffness


def test_the_thick_cantilevers_nonlinear_tip_is_that_of_the_differential_equation() -> None:
    """R5: the printed tip at full load.

    Catches: a printed digit misread.
    """
    A, inertia, k, G = np.pi / 16.0, np.pi * 0.25**4 / 4.0, 4.0 / 3.0, 1e4
    stiffness = (k * G * A, k * G * A, 1e6 * A, 1e6 * inertia, 1e6 * inertia, 2.0 * G * inertia)
    tip = cantilever_tip(3.0, stiffness, (0.0, -15.0, 0.0), frame=FRAME)
    assert -tip[1] == pytest.approx(rods.R5.claims[-1].reference, abs=5e-8)
