"""Corrected rod elements: what they bend within, what they report, and how mass and loads go to their nodes."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot import DistributedLoad, Hold, PointLoad, Rod, RodModel, modes, reaction, statics
from fem_biobot.errors import ModelError
from fem_biobot.rod.discretisation import Discretisation, halves, node_shares, residual_bending
from fem_biobot.rod.section import RodMaterial, Section
from tests.helpers import generator, unchanged

# GA1, GA2, EA, EI1, EI2, GJ: no two alike
GA1, GA2, EA, EI1, EI2 = 30.0, 50.0, 400.0, 7.0, 3.0
MATERIAL = RodMaterial(young=1.0, density=0.002, shear_modulus=1.0)
SECTION = Section.given(EA, EI1, EI2, 2.0, shear_factors=(GA1 / EA, GA2 / EA))
LENGTH, TIP = 1.7, ("rod", -1)


def rod(n: int, **more: object) -> Rod:
    """Along x with its first director along y."""
    points = np.linspace(0.0, LENGTH, n + 1)[:, None] * np.eye(3)[0]
    return Rod(points, more.pop("section", SECTION), MATERIAL, normal=(0.0, 1.0, 0.0), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("n", [1, 3])
def test_one_element_bends_as_much_as_many_in_both_planes(n: int) -> None:
    """``F L^3 / 3 EI + F L / GA`` of a cantilever along either director, with the second moment about the other.

    Catches: EI of the wrong plane, a factor of 12, residual bending in one plane alone.
    """
    F = 1e-7
    load = PointLoad(TIP, force=(0.0, F, -2.0 * F))
    tip = statics(RodModel([rod(n)], supports=[Hold(("rod", 0))], loads=[load])).last.displacement(TIP)
    expected = [F * (LENGTH**3 / (3 * EI2) + LENGTH / GA1), -2 * F * (LENGTH**3 / (3 * EI1) + LENGTH / GA2)]
    np.testing.assert_allclose(tip[1:], expected, rtol=1e-7)


def test_resultants_are_those_of_equilibrium_and_shear_is_the_sections() -> None:
    """A pulled cantilever: couple and shear of the section at each element's middle, as the beam-column has them.

    With ``theta'' = k^2 (theta - Q / T)``, ``k^2 = T (1 + T / EA - T / GA) / EI``, free at the end: the couple is
    ``EI theta'``, the force on a section across it ``Q - T theta``.

    Catches: the element's shear, residual bending included, reported as the section's; couples at the ends.
    """
    Q, T, n = 1e-5, 2.0, 8
    load = PointLoad(TIP, force=(T, Q, 0.0))
    state = statics(RodModel([rod(n)], supports=[Hold(("rod", 0))], loads=[load])).last
    eps, kappa = state.strain("rod")
    force, couple = state.resultants("rod")
    np.testing.assert_allclose(eps[:, 2], T / EA, rtol=1e-6)
    np.testing.assert_allclose(couple[:, 1] / kappa[:, 1], EI2, rtol=1e-12)
    k = np.sqrt(T * (1.0 + T / EA - T / GA1) / EI2)
    s = LENGTH * (1.0 - (np.arange(n) + 0.5) / n)
    # means over an element against its middle: (k L / n)^2 / 24 is 1.2e-3
    exact = EI2 * Q / T * k * np.sinh(k * s) / np.cosh(k * LENGTH)
    np.testing.assert_allclose(np.abs(couple[:, 1]), exact, rtol=2e-3)
    across = Q * np.cosh(k * s) / np.cosh(k * LENGTH)
    # and k L T / GA; residual bending would add GA L^2 / 12 EI n^2, 3.8 %
    np.testing.assert_allclose(eps[:, 0], across / GA1, rtol=5e-3)
    np.testing.assert_allclose(force[:, 0], across, rtol=5e-3)


def test_tension_stiffens_the_s_of_an_element_as_that_of_a_beam_column() -> None:
    """Ends that do not turn, pulled by T: ``12 EI / L^3 + 6 T / 5 L`` across, in one element, and stable at any T.

    Catches: no sway (12 EI / L^3, and an element that turns away from its chord), half of it, the other plane's.
    """
    slender = Section.given(EA, EI1, EI2, 2.0, shear_factors=1e5)
    for T in (5.0, 100.0):
        supports = [Hold(("rod", 0)), Hold(TIP, "", "xyz")]
        F = 1e-6
        model = RodModel([rod(1, section=slender)], supports=supports, loads=[PointLoad(TIP, force=(T, F, 2.0 * F))])
        state = statics(model).last
        # to T / EA, by which the lever of the tension is longer than drawn
        expected = [1.0 / (12 * EI / LENGTH**3 + 1.2 * T / LENGTH) for EI in (EI2, EI1)]
        found = state.displacement(TIP)[1:] / np.array([F, 2.0 * F])
        np.testing.assert_allclose(found, expected, rtol=1e-3 + T / EA)
        assert state.stable


def test_residual_bending_leaves_its_arguments_and_plain_elements_alone() -> None:
    """Only shear changes; plain elements have the section's stiffnesses and no sway.

    Catches: a section overwritten in place, bending or twist softened, both ways of elements alike.
    """
    C, length = generator(33).uniform(1.0, 5.0, (4, 6)), np.array([0.3, 0.7, 1.1, 2.0])
    with unchanged(C, length):
        stiffness, sway = residual_bending(C, length)
    np.testing.assert_array_equal(stiffness[:, 2:], C[:, 2:])
    np.testing.assert_allclose(1 / stiffness[:, 0] - 1 / C[:, 0], length**2 / (12 * C[:, 4]), rtol=1e-12)
    np.testing.assert_allclose(1 / stiffness[:, 1] - 1 / C[:, 1], length**2 / (12 * C[:, 3]), rtol=1e-12)
    np.testing.assert_allclose(sway, 1.2 * (1 - stiffness[:, :2] / C[:, :2]) ** 2, rtol=1e-12)
    plain = RodModel([rod(3, discretisation="plain")]).assembly
    np.testing.assert_array_equal(plain.elements.stiffness, plain.elements.section)
    assert not plain.elements.sway.any()
    np.testing.assert_allclose(plain.inertia.mass / plain.inertia.mass[1], [0.5, 1.0, 1.0, 0.5], rtol=1e-12)


@pytest.mark.parametrize("n", [2, 3, 4, 9])
def test_shares_integrate_cubics_along_equal_elements(n: int) -> None:
    """Of a whole rod they are a rule of order 4; every element gives away all it has; a mirrored rod has mirrored ones.

    Catches: the trapezoidal rule, a cubic's weights at the ends, an element that gives more than it has.
    """
    span = 0.37
    shares = node_shares(np.full(n, span), ["same"] * n)
    s = span * np.arange(n + 1)
    polynomial = np.polynomial.Polynomial([0.3, -1.2, 0.7, 2.1])
    whole = polynomial.integ()(s[-1]) - polynomial.integ()(0.0)
    assert span * shares.sum(axis=0) @ polynomial(s) == pytest.approx(whole, rel=1e-12)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, rtol=1e-15)
    np.testing.assert_array_equal(shares, shares[::-1, ::-1])
    assert shares.sum(axis=0).min() >= 1 / 3 - 1e-15


def test_shares_stay_within_stretches_of_equal_elements() -> None:
    """Three of one section, one of another length, two and two of two more sections: no mass crosses a change.

    Catches: mass that crosses a step of the section, or of the length; an element alone that is not halved.
    """
    shares = node_shares(np.array([1.0, 1.0, 1.0, 0.8, 1.0, 1.0, 1.0, 1.0]), ["a", "a", "a", "a", "b", "b", "c", "c"])
    np.testing.assert_array_equal(shares[3], halves(8)[3])
    for first, last, expected in ((0, 3, [3 / 8, 9 / 8, 9 / 8, 3 / 8]), (4, 6, [1 / 3, 4 / 3, 1 / 3])):
        found = np.zeros(9)
        found[first : last + 1] = expected
        np.testing.assert_allclose(shares[first:last].sum(axis=0), found, rtol=1e-15)
    np.testing.assert_array_equal(shares[6:, 6:], shares[4:6, 4:7])


def test_a_rod_has_the_inertia_and_the_sag_of_its_length() -> None:
    """About its middle ``m L^2 / 12`` and the sections' own; clamped at both ends it sags by ``q L^4 / 384 EI``.

    Catches: mass or distributed load by halves, where inertia is off by 2 / n^2; clamps that bear the wrong share.
    """
    n, q = 8, 1e-6
    model = RodModel([rod(n)])
    inertia, x = model.assembly.inertia, model.built.x[:, 0] - LENGTH / 2
    mass = MATERIAL.density * EA * LENGTH
    about_z = inertia.mass @ x**2 + inertia.J[:, 2, 2].sum()
    assert about_z == pytest.approx(mass * LENGTH**2 / 12 + MATERIAL.density * EI2 * LENGTH, rel=1e-12)
    ends = [Hold(("rod", 0)), Hold(TIP)]
    slender = Section.given(EA, EI1, EI2, 2.0, shear_factors=1e5)
    loads = [DistributedLoad("rod", force=(0.0, q, 0.0))]
    state = statics(RodModel([rod(n, section=slender)], supports=ends, loads=loads)).last
    # the rule leaves (1 / 8)^4 times what its ends differ by, some ten times; by halves 1 / n^2, 1.6 %, is left
    sag = q * LENGTH**4 / (384 * EI2)
    assert state.displacement(("rod", n // 2))[1] == pytest.approx(sag, rel=3e-3)
    assert reaction(state, ("rod", 0))[1] == pytest.approx(-q * LENGTH / 2, rel=1e-6)


def test_frequencies_of_few_elements_are_those_of_many() -> None:
    """Three bending frequencies of a clamped slender rod with 12 elements, a thousandth or less from those of 48.

    Those of plain elements are up to 1 % off. Catches: masses by halves, stiffness without residual bending.
    """
    slender = Section.rectangle(0.02, 0.03)
    found = {}
    for n in (12, 48):
        for how in Discretisation:
            model = RodModel([rod(n, section=slender, discretisation=how)], supports=[Hold(("rod", 0))])
            found[n, how] = modes(model, count=6).frequencies
    off = {how: np.abs(found[12, how] / found[48, "corrected"] - 1.0).max() for how in Discretisation}
    assert off[Discretisation.corrected] < 1e-3
    assert off[Discretisation.plain] > 3e-3


def test_an_unknown_way_of_elements_is_refused() -> None:
    """With what was found and what is known. Catches: a name taken for the default."""
    with pytest.raises(ModelError, match="rod rod: discretisation: found 'exact', expected corrected or plain"):
        rod(2, discretisation="exact")
