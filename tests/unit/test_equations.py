"""The paper's equations as functions."""

from __future__ import annotations

import math

import pytest

from fem_biobot.config import load_design
from fem_biobot.equations import equation_1, equation_2, equation_3
from fem_biobot.errors import ModelError
from fem_biobot.solid.measures import eq3_stiffness


def test_a_held_muscle_pulls_with_the_sine() -> None:
    """gamma sigma A sin(theta): half at 30 degrees.

    Catches: a cosine, gamma left out.
    """
    assert equation_1(10.0, 0.65, math.radians(30.0), 0.8) == pytest.approx(0.8 * 10.0 * 0.65 * 0.5, rel=1e-14)


def test_a_muscle_that_has_shortened_pulls_with_less() -> None:
    """The paper's own inputs: 2.6 mN at a shortening of 0.38 (facts: A 1.08, gamma 0.83, 10.39 kPa, E 10 kPa).

    Catches: resistance that grows with the strain alone, gamma on the resistance too.
    """
    assert equation_2(10.39, 1.08, 10.0, 0.3836, gamma=0.83) == pytest.approx(2.6, abs=0.02)
    assert equation_2(10.39, 1.08, 10.0, 0.0) == equation_1(10.39, 1.08)
    with pytest.raises(ModelError, match="shortening below 1"):
        equation_2(10.0, 1.0, 10.0, 1.0)


def test_a_sagitta_shows_the_force_that_bends_the_beam() -> None:
    """With the printed numbers 4.77 mN a millimetre (facts), and the machine's own stiffness by the same formula.

    Catches: the arm in the numerator, a span that is not squared.
    """
    assert equation_3(1.0, 319.4 * 0.183, 2.0, 7.0) == pytest.approx(4.77, abs=0.005)
    design = load_design("junction_bot")
    assert eq3_stiffness(design) == pytest.approx(8.0 * 319.4 * 7.0 * 0.68**3 / 12.0 / (2.0 * 49.0), rel=1e-14)
