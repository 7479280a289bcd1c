"""Sections and materials of rods: constants against tables, integrals and double series; what is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.section import RodMaterial, Section, rectangle_torsion, stiffness

EPS = np.finfo(float).eps
NAN = float("nan")


def _moments(outline: np.ndarray) -> tuple[float, float, float]:
    """Area and second moments about both axes of a polygon, by Green's theorem."""
    (x, y), (u, v) = outline.T, np.roll(outline, -1, axis=0).T
    cross = x * v - u * y
    return cross.sum() / 2, (cross * (y * y + y * v + v * v)).sum() / 12, (cross * (x * x + x * u + u * u)).sum() / 12


def test_constants_of_a_rectangle_are_those_of_its_outline() -> None:
    """The width lies along director 1, so it is cubed in I2.

    Catches: I1 and I2 exchanged; an outline turned by a right angle or run clockwise.
    """
    section = Section.rectangle(1.7, 0.6)
    np.testing.assert_allclose((section.area, section.I1, section.I2), _moments(section.outline()), rtol=8 * EPS)
    assert section.polar == section.I1 + section.I2
    assert section.radius is None


def test_constants_of_a_tube_are_those_of_its_outlines() -> None:
    """Outer less inner polygon of many corners.

    Catches: the hole's moment added, a diameter for a radius, pi / 2 for pi / 4.
    """
    n = 4000
    tube, full, hole = Section.tube(1.3, 0.9), Section.circle(1.3), Section.circle(0.9)
    found = np.array(_moments(full.outline(n))) - np.array(_moments(hole.outline(n)))
    # the polygon's area is short by (2 pi / n)^2 / 6, its moments by twice that
    np.testing.assert_allclose((tube.area, tube.I1, tube.I2), found, rtol=10 * (2 * np.pi / n) ** 2)
    np.testing.assert_allclose(tube.J, tube.polar, rtol=2 * EPS)
    assert tube.radius == 1.3


@pytest.mark.parametrize(
    ("aspect", "factor"),
    [(1.0, 0.1406), (1.2, 0.166), (1.5, 0.196), (2.0, 0.229), (2.5, 0.249), (3.0, 0.263), (4.0, 0.281), (10.0, 0.312)],
)
def test_torsion_of_rectangles_is_the_tabulated_one(aspect: float, factor: float) -> None:
    """``J = factor a b^3``, the usual table of Timoshenko and Goodier, whichever side is the longer.

    Catches: half sides for sides, the longer side cubed, b / a inverted in the series.
    """
    b = 0.7
    for sides in ((aspect * b, b), (b, aspect * b)):
        found = Section.rectangle(*sides).J / (aspect * b**4)
        np.testing.assert_allclose(found, factor, rtol=0.0, atol=0.0005)


@pytest.mark.parametrize("aspect", [1.0, 1.43, 6.0])
def test_torsion_of_rectangles_agrees_with_the_double_series(aspect: float) -> None:
    """Prandtl's stress function in sines of both sides; another series, with a known remainder.

    Catches: terms of the series left out, a wrong sum of 1 / n^5.
    """
    a, b = aspect, 1.0
    odd = np.arange(1.0, 2000.0, 2.0)
    m, n = odd[:, None], odd[None, :]
    J = 256 * a * b / np.pi**6 * np.sum(1 / (m**2 * n**2 * ((m / a) ** 2 + (n / b) ** 2)))
    # left out beyond N, in either index: sum of 1/n^4 is 1/(6 N^3), times that of 1/m^2, pi^2/8
    rest = 256 * a * b / np.pi**6 * (a**2 + b**2) / (6 * 2000.0**3) * np.pi**2 / 8
    assert 0.0 < rectangle_torsion(a, b) - J < 1.1 * rest + 1e-14


def test_torsion_of_a_thin_strip_is_short_by_its_two_ends() -> None:
    """``(1 - 0.630249 b / a) / 3``, at aspects for which the rest of the series is nothing.

    Catches: an overflow of the hyperbolic functions.
    """
    for aspect in (50.0, 1e6):
        # the constant is 192 / pi^5 (1 + 1/3^5 + 1/5^5 + ...), here to 1e-6
        short = (1.0 - 0.630249 / aspect) / 3.0
        np.testing.assert_allclose(rectangle_torsion(1.0, aspect) / aspect, short, rtol=1e-6 / aspect)


@pytest.mark.parametrize(
    ("section", "factor"),
    [
        (Section.rectangle(2.0, 1.0), 5 / 6),
        (Section.rectangle(2.0, 1.0, poisson=0.3), 13 / 15.3),
        (Section.circle(0.4), 6 / 7),
        (Section.circle(0.4, poisson=0.5), 0.9),
        # a thin wall, Cowper's limit 2 (1 + nu) / (4 + 3 nu)
        (Section.tube(1.0, 1.0 - 1e-9, poisson=0.3), 2.6 / 4.9),
        # m^2 = 1/4: 6 * 1.3 * 1.5625 / (8.8 * 1.5625 + 23.6 / 4)
        (Section.tube(1.0, 0.5, poisson=0.3), 12.1875 / 19.65),
        (Section.circle(0.4, shear_factor=27 / 28), 27 / 28),
        (Section.rectangle(2.0, 1.0, shear_factor=1.0), 1.0),
    ],
)
def test_shear_factors_are_cowpers_unless_given(section: Section, factor: float) -> None:
    """Numbers of his formulas; the same in both directions.

    Catches: the factor of another shape, Poisson's ratio ignored, a given factor ignored.
    """
    np.testing.assert_allclose(section.shear_factors, factor, rtol=1e-6)


def test_stiffnesses_stand_in_the_order_of_the_strains() -> None:
    """Shear along 1 and 2, stretch; bending about 1 and 2, twist; with a shear modulus of any size.

    Catches: G and E exchanged, a shear factor on EA, the polar moment in place of J, a stretch factor on bending.
    """
    section = Section.given(2.0, 0.3, 0.5, 0.7, shear_factors=(0.8, 0.9))
    found = stiffness(section, RodMaterial(young=100.0, density=1e-6, shear_modulus=60.0))
    np.testing.assert_allclose(found, [96.0, 108.0, 200.0, 30.0, 50.0, 42.0], rtol=2 * EPS)
    assert RodMaterial(young=100.0, density=0.0, poisson=0.25).G == 40.0
    half = stiffness(replace(section, stretch_factor=0.5), RodMaterial(young=100.0, density=1e-6, shear_modulus=60.0))
    np.testing.assert_allclose(half, [96.0, 108.0, 100.0, 30.0, 50.0, 42.0], rtol=2 * EPS)


def test_a_given_section_is_drawn_by_what_is_known() -> None:
    """Its corners, its radius, or the circle of its area.

    Catches: a circle of the wrong area; one factor read for one direction alone.
    """
    corners = [(0.0, 0.0), (2.0, 0.0), (1.0, 1.5)]
    assert np.array_equal(Section.given(1.5, 1.0, 1.0, 1.0, shear_factors=0.9, corners=corners).outline(), corners)
    radii = [
        np.hypot(*Section.given(np.pi * 4.0, 1.0, 1.0, 1.0, shear_factors=0.9, radius=r).outline(7).T)
        for r in (1.1, None)
    ]
    np.testing.assert_allclose(radii, np.tile([[1.1], [2.0]], 7), rtol=4 * EPS)
    assert Section.given(1.0, 1.0, 1.0, 1.0, shear_factors=0.9).shear_factors == (0.9, 0.9)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Section.circle(0.0), "circle radius: found 0.0, expected a finite number above 0 mm"),
        (lambda: Section.circle(NAN), "circle radius: found nan"),
        (lambda: Section.circle(True), "circle radius: found True"),
        (lambda: Section.circle("1 mm"), "circle radius: found '1 mm'"),  # type: ignore[arg-type]
        (lambda: Section.tube(1.0, 1.0), "tube inner: found 1 mm, expected less than the outer radius, 1 mm"),
        (lambda: Section.tube(1.0, -0.1), "tube inner: found -0.1, expected a finite number at least 0 mm"),
        (lambda: Section.tube(-1.0, 0.1), "tube outer"),
        (lambda: Section.rectangle(1.0, float("inf")), "rectangle height"),
        (lambda: Section.rectangle(-1.0, 1.0), "rectangle width"),
        (lambda: Section.rectangle(1.0, 1.0, poisson=0.6), "poisson: found 0.6, expected a number above -1"),
        (lambda: Section.circle(1.0, poisson=NAN), "poisson: found nan"),
        (lambda: Section.circle(1.0, shear_factor=0.0), "section shear_factor: found 0.0"),
        (lambda: Section.given(0.0, 1.0, 1.0, 1.0, shear_factors=1.0), "section area"),
        (lambda: Section.given(1.0, 1.0, -1.0, 1.0, shear_factors=1.0), "section I2"),
        (lambda: Section.given(1.0, 1.0, 1.0, NAN, shear_factors=1.0), "section J"),
        (lambda: Section.given(1.0, 1.0, 1.0, 1.0, shear_factors=1.0, radius=0.0), "section radius"),
        (lambda: replace(Section.circle(1.0), stretch_factor=-1.0), "section stretch_factor: found -1.0"),
        (lambda: Section.given(1.0, 1.0, 1.0, 1.0, shear_factors=1.0, corners=[(0, 0), (1, NAN), (0, 1)]), "corners"),
        (lambda: Section.given(1.0, 1.0, 1.0, 1.0, shear_factors=1.0, corners=[(0, 0), (1, 1)]), "at least three"),
        (lambda: RodMaterial(young=0.0, density=1e-6, poisson=0.3), "young: found 0.0"),
        (lambda: RodMaterial(young=1.0, density=-1e-6, poisson=0.3), "density: found -1e-06"),
        (lambda: RodMaterial(young=1.0, density=1e-6), "found neither, expected one of poisson and shear_modulus"),
        (lambda: RodMaterial(young=1.0, density=1e-6, poisson=0.3, shear_modulus=1.0), "found both"),
        (lambda: RodMaterial(young=1.0, density=1e-6, poisson=-1.0), "poisson: found -1.0"),
        (lambda: RodMaterial(young=1.0, density=1e-6, shear_modulus=0.0), "shear_modulus: found 0.0"),
    ],
)
def test_what_is_no_section_or_material_is_refused(make: Callable[[], object], word: str) -> None:
    """Sizes that are not positive, numbers that are none, holes larger than the rod: by name, in one line.

    Catches: a check that a NaN passes; a truth value taken for a number.
    """
    with pytest.raises(ModelError, match=word) as refusal:
        make()
    assert "\n" not in str(refusal.value)
