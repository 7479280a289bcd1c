"""The volumetric part of a law: its measures of volume, and that a split law is the sum of its parts."""

from __future__ import annotations

from decimal import Decimal, localcontext

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import LAWS, LINEAR, LOG, QUADRATIC, NaturalState, NeoHooke, SplitLaw, Volumetric
from fem_biobot.material.law import add_law
from fem_biobot.material.natural_state import isochoric_contraction
from fem_biobot.material.volume import volume_measure
from tests.helpers import generic_gradients, unit, unpack, unpack_tangent
from tests.laws.cases import F0, POISSON, YOUNG, make_law

EPS = np.finfo(float).eps
GRADIENTS = generic_gradients(10)
ROUNDING = 2000 * EPS

table_laws = pytest.mark.parametrize("name", list(LAWS))
methods = pytest.mark.parametrize("method", ["energy", "stress", "tangent"])


def _exact(J: Decimal, measure: int) -> Decimal:
    """The measure in fifty digits."""
    if measure == LOG:
        return J.ln()
    if measure == LINEAR:
        return J - 1
    root = ((J * J - 1 - 2 * J.ln()) / 2).sqrt()
    return root if J > 1 else -root


@pytest.mark.parametrize("measure", [LOG, LINEAR, QUADRATIC])
@pytest.mark.parametrize("at", ["0.31", "0.79", "0.81", "0.993", "1.00001", "1.19", "1.21", "2.9"])
def test_a_measure_of_volume_and_its_derivatives_are_those_of_its_formula(measure: int, at: str) -> None:
    """g, g' and g'' agree with the formula and its central differences in fifty digits, near 1 and far from it.

    Catches: a lost half under the root, a sign at J < 1, a series cut short, differences of nearly equal numbers.
    """
    with localcontext() as context:
        context.prec = 60
        J, h = Decimal(at), Decimal("1e-15")
        low, mid, high = (_exact(J + k * h, measure) for k in (-1, 0, 1))
        wanted = [float(mid), float((high - low) / (2 * h)), float((high - 2 * mid + low) / (h * h))]
    found = volume_measure(np.array([float(at)]), measure)
    # the argument itself is rounded; second derivatives beyond the series lose some digits
    for value, expected, lost in zip(found, wanted, (10, 100, 1000), strict=True):
        np.testing.assert_allclose(value[0], expected, rtol=lost * EPS, atol=lost * EPS)


@pytest.mark.parametrize("measure", [LOG, LINEAR, QUADRATIC])
def test_every_measure_starts_with_slope_one(measure: int) -> None:
    """g(1) = 0 and g'(1) = 1 exactly, so that all moduli mean the same at small strain.

    Catches: a division by zero at J = 1, a measure scaled by its root.
    """
    g, slope, _ = volume_measure(np.array([1.0]), measure)
    assert (g[0], slope[0]) == (0.0, 1.0)


def test_an_unknown_measure_is_refused() -> None:
    """A code that stands for no measure is refused with those that do.

    Catches: the last branch taken for any code.
    """
    with pytest.raises(ModelError, match="measure: found 3"):
        volume_measure(np.array([1.1]), 3)


@table_laws
def test_a_split_law_is_the_sum_of_its_parts(name: str) -> None:
    """Energy, stress and tangent of the rest plus those of bulk/2 g(J)^2 are those of the whole law.

    Catches: another measure named than used, the modulus of the other convention, a volumetric term left in the rest.
    """
    law = make_law(name)
    assert isinstance(law, SplitLaw)
    rest, (bulk, measure) = law.split()
    J = np.linalg.det(np.moveaxis(GRADIENTS, -1, 0))
    g, g1, g2 = volume_measure(J, measure)
    inverse = np.moveaxis(np.linalg.inv(np.moveaxis(GRADIENTS, -1, 0)), 0, -1)
    cofactor = J * inverse.swapaxes(0, 1)  # dJ/dF
    second = np.einsum("ik...,jl...->ikjl...", cofactor, cofactor) / J
    second = second - J * np.einsum("kj...,li...->ikjl...", inverse, inverse)
    P = bulk * g * g1 * cofactor
    A4 = bulk * (g1**2 + g * g2) * np.einsum("ik...,jl...->ikjl...", cofactor, cofactor) + bulk * g * g1 * second
    scale = np.max(np.abs(law.tangent(GRADIENTS)))
    whole = rest.energy(GRADIENTS) + Volumetric(bulk, measure).energy(J)
    np.testing.assert_allclose(whole, law.energy(GRADIENTS), rtol=0.0, atol=ROUNDING * scale)
    np.testing.assert_allclose(rest.stress(GRADIENTS) + P, law.stress(GRADIENTS), rtol=0.0, atol=ROUNDING * scale)
    np.testing.assert_allclose(rest.tangent(GRADIENTS) + A4, law.tangent(GRADIENTS), rtol=0.0, atol=ROUNDING * scale)


@table_laws
@methods
def test_an_incompressible_law_splits_and_is_refused_whole(name: str, method: str) -> None:
    """At a Poisson's ratio of 0.5 the rest is finite, the modulus infinite, and the whole law is told where to go.

    Catches: a division by zero, an infinite stress handed to the solver, a ratio rounded down silently.
    """
    law = make_law(name, poisson=0.5)
    rest, volumetric = law.split()
    assert volumetric.bulk == np.inf
    assert np.all(np.isfinite(getattr(rest, method)(GRADIENTS)))
    with pytest.raises(ModelError, match="needs the mixed element P2-P1"):
        getattr(law, method)(GRADIENTS)
    with pytest.raises(ModelError, match="needs the mixed element P2-P1"):
        volumetric.energy(np.ones(3))


@table_laws
def test_the_compiled_form_of_an_incompressible_law_is_refused_too(name: str) -> None:
    """The solver's own way into a law refuses an infinite modulus as well.

    Catches: infinite numbers from the compiled form, found by the factorisation much later.
    """
    shape = (4, 1)
    F = np.broadcast_to(np.eye(3)[:, :, None, None], (3, 3, *shape)).copy()
    with pytest.raises(ModelError, match="needs the mixed element P2-P1"):
        make_law(name, poisson=0.5).add_second_piola(
            F, np.arange(4), np.zeros((6, *shape)), np.zeros((21, *shape)), np.zeros(shape)
        )


@table_laws
def test_the_rest_of_an_incompressible_law_is_the_limit_of_compressible_ones(name: str) -> None:
    """The rest at 0.5 is reached from below, linearly in what is missing to 0.5.

    Catches: a shear modulus from another branch at 0.5.
    """
    at = make_law(name, poisson=0.5).split()[0].stress(GRADIENTS)
    near, nearer = (make_law(name, poisson=0.5 - gap).split()[0].stress(GRADIENTS) - at for gap in (2e-3, 1e-3))
    assert 0.0 < np.max(np.abs(nearer)) < 1e-3 * np.max(np.abs(at))
    np.testing.assert_allclose(near, 2.0 * nearer, rtol=0.0, atol=1e-5 * np.max(np.abs(at)))


@table_laws
def test_the_rest_of_a_split_law_runs_compiled_as_it_is_written(name: str) -> None:
    """The law without its volumetric energy has a compiled form of the same stress, tangent and energy.

    Catches: the volumetric term left in one of the two.
    """
    rest, _ = make_law(name, poisson=0.5).split()
    F = generic_gradients(4).reshape(3, 3, 4, 1)
    S, D, psi = np.zeros((6, 4, 1)), np.zeros((21, 4, 1)), np.zeros((4, 1))
    add_law(rest, F, np.arange(4), S, D, psi)
    P = np.einsum("im...,mk...->ik...", F, unpack(S))
    A4 = np.einsum("im...,mknl...,jn...->ikjl...", F, unpack_tangent(D), F)
    A4 += np.einsum("ij,kl...->ikjl...", np.eye(3), unpack(S))
    scale = np.max(np.abs(rest.tangent(F)))
    np.testing.assert_allclose(P, rest.stress(F), rtol=0.0, atol=ROUNDING * scale)
    np.testing.assert_allclose(A4, rest.tangent(F), rtol=0.0, atol=ROUNDING * scale)
    np.testing.assert_allclose(psi, rest.energy(F), rtol=0.0, atol=ROUNDING * scale)


def test_a_natural_state_splits_if_it_keeps_the_volume() -> None:
    """Tissue contracted at constant volume has its law's volumetric part, and the rest in the natural state.

    Catches: the natural state lost from the rest, a volumetric part measured from the natural state.
    """
    state = isochoric_contraction(0.8, unit(0.3, -0.5, 0.8))
    law = NaturalState(NeoHooke(YOUNG, POISSON), state)
    rest, volumetric = law.split()
    J = np.linalg.det(np.moveaxis(GRADIENTS, -1, 0))
    whole = rest.energy(GRADIENTS) + volumetric.energy(J)
    scale = np.max(np.abs(law.tangent(GRADIENTS)))
    np.testing.assert_allclose(whole, law.energy(GRADIENTS), rtol=0.0, atol=ROUNDING * scale)
    np.testing.assert_array_equal(rest.F0, state)


def test_a_natural_state_of_another_volume_is_not_split() -> None:
    """The pressure measures volume from the reference body, so a swollen natural state is refused with how much.

    Catches: a pressure that pulls swollen tissue back to its reference volume.
    """
    with pytest.raises(ModelError, match="det F0"):
        NaturalState(NeoHooke(YOUNG, POISSON), F0).split()


def test_a_natural_state_of_a_law_without_split_is_refused() -> None:
    """The law inside must be one that splits.

    Catches: an AttributeError instead of a line that names the law.
    """

    class Whole:
        def __init__(self, law: NeoHooke) -> None:
            self.energy, self.stress, self.tangent = law.energy, law.stress, law.tangent

    with pytest.raises(ModelError, match="Whole inside, expected a law with split"):
        NaturalState(Whole(NeoHooke(YOUNG, POISSON)), np.eye(3)).split()
