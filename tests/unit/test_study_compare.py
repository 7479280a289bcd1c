"""Closed forms beside which strips and cantilevers are put, the paper's rows, and the error estimate."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.solid.measures import eq3_stiffness, muscle_work
from fem_biobot.study import compare


@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("poisson", [0.3, 0.47])
def test_free_contraction_has_no_stress_left(ratio: float, poisson: float) -> None:
    """Both first Piola stresses of the contracted body vanish, by the law's own formula written out.

    Catches: the tension multiplied by the stretch (the other convention), a lost factor of the volume term.
    """
    young = 10.0
    mu = young / (2.0 * (1.0 + poisson))
    lmbda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    tension = ratio * mu
    s, w = compare.free_contraction(young, poisson, tension)
    ln_J = np.log(s * w * w)
    assert mu * (s - 1.0 / s) + lmbda * ln_J / s + tension == pytest.approx(0.0, abs=1e-9 * mu)
    assert mu * (w - 1.0 / w) + lmbda * ln_J / w == pytest.approx(0.0, abs=1e-9 * mu)
    assert s < 1.0 < w


def test_free_contraction_tends_to_the_incompressible_one() -> None:
    """At a Poisson's ratio of almost one half the stretch is the root of mu (s - s^-2) + T = 0 (0.754877666 at T = mu).

    Catches: a wrong limit that the stress balance alone would not show.
    """
    poisson = 0.4999999
    mu = 10.0 / (2.0 * (1.0 + poisson))
    assert compare.free_contraction(10.0, poisson, mu)[0] == pytest.approx(0.754877666, abs=1e-5)


def test_free_contraction_of_an_incompressible_body_is_the_tabled_one() -> None:
    """At a Poisson's ratio of one half itself s = 0.618033989 at T = 2 mu, and the volume stays.

    Catches: an infinite modulus let into the iteration for compressible bodies.
    """
    s, w = compare.free_contraction(9.0, 0.5, 6.0)
    assert s == pytest.approx(0.618033989, abs=1e-9)
    assert s * w * w == pytest.approx(1.0, abs=1e-14)


def test_eq3_stiffness_of_the_junction_bot() -> None:
    """k = 8 E I / (l L^2) with l = 2.0 mm, L = 7.0 mm is 4.77 mN/mm with the I of the published rods, 0.183 mm^4.

    Catches: span and arm swapped, the second moment of the other axis. Tolerance: the plate's I is 0.25 % larger.
    """
    assert eq3_stiffness(load_design("junction_bot")) == pytest.approx(4.77, rel=0.004)


def test_timoshenko_tip_of_a_slender_beam_is_bending_alone() -> None:
    """A beam 100 times longer than thick bends by F L^3 / (3 E I); the shear part is below a thousandth.

    Catches: a lost cube, the shear term without its length.
    """
    design = load_design("cantilever", ["skeleton.beam_length=68 mm"])
    E, I = 319.4, 7.0 * 0.68**3 / 12.0  # noqa: E741
    assert design.load is not None
    assert compare.timoshenko_tip(design) == pytest.approx(design.load.tip_force * 68.0**3 / (3 * E * I), rel=1e-3)


def test_muscle_work_of_a_known_path() -> None:
    """With L(s) = -(a s + b s^2) the work is a s^2/2 + 2 b s^3/3, exactly for a cubic spline.

    Catches: the opposite sign, integrating L instead of s dL. Tolerance: rounding.
    """
    s = np.array([0.2, 0.5, 0.6, 1.0])
    a, b = 0.7, 0.4
    expected = a * s**2 / 2 + 2 * b * s**3 / 3
    assert muscle_work(s, -(a * s + b * s**2)) == pytest.approx(expected, rel=1e-12)


def test_error_estimate_is_exact_for_a_first_order_error() -> None:
    """Values 1 + 0.3 h on h = 1 and 1.5 give an estimated error of 0.3.

    Catches: dividing by the ratio instead of the ratio minus one, the sign of the difference.
    """
    fine = [{"key": "peak", "label": "stimulated", "tip_closing_mm": 1.3}]
    coarse = [{"key": "peak", "label": "stimulated", "tip_closing_mm": 1.45}]
    (row,) = compare.error_estimate(fine, coarse, 1.5)
    assert row["estimated error"] == pytest.approx(0.3, rel=1e-12)
    assert row["relative_1"] == pytest.approx(0.3 / 1.3, rel=1e-12)


def test_rows_beside_the_paper_carry_their_differences() -> None:
    """Ours minus printed, relative to the printed number; states that are missing have no row.

    Catches: swapped operands, rows for states that were not solved.
    """
    design = load_design("junction_bot")
    rows = compare.beside_paper(design, [{"key": "force_1", "tip_closing_mm": 0.75}], {})
    assert len(rows) == 1
    assert rows[0]["difference"] == pytest.approx(0.25)
    assert rows[0]["relative_1"] == pytest.approx(0.5)
