"""Tension that depends on the rate of the fibre's stretch: Hill's curve, the law's stress and tangent over a step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fem_biobot.errors import ModelError
from fem_biobot.material import ActiveStress, Convention, Dispersion, ForceVelocity, NeoHooke
from fem_biobot.material.active import active_law
from fem_biobot.material.force_velocity import Straining
from fem_biobot.material.law import PAIRS
from fem_biobot.material.muscle_tension import MuscleTension
from tests.helpers import generator, generic_gradients, slope, taylor_slope, unit
from tests.laws.cases import FIBRE, NORMAL, SMOOTH, STRESSES

Array = NDArray[np.float64]

HILL = ForceVelocity(2.5, 0.3, 1.5)
STEP, SHARE = 0.25, 0.7
TENSION, STANDING = 7.7, 2.9


def strain(F: Array) -> Array:
    """Green-Lagrange strain with its shears doubled, (6, ...)."""
    C = np.einsum("ki...,kj...->ij...", F, F)
    return np.stack([(C[i, j] - (i == j)) * (0.5 if i == j else 1.0) for i, j in PAIRS])


def stretch(F: Array, H: Array) -> Array:
    """Root of ``H : C``."""
    return np.sqrt(np.einsum("ki...,kj...,ij->...", F, F, H))


def law_of(convention: Convention = Convention.nominal, **more: Any) -> MuscleTension:
    """Two parts, over one element."""
    given: dict[str, Any] = {"force_length": SMOOTH, "standing": STANDING, "force_velocity": HILL, **more}
    muscle = ActiveStress(given.pop("tension", TENSION), given.pop("a0", FIBRE), convention, **given)
    law = active_law(muscle, 1, np.array([0]), NeoHooke(10.0, 0.3))
    assert isinstance(law, MuscleTension)
    return law.at(np.array([0]))


# a step that begins elsewhere; fibres shorten at some points and lengthen at others
BEGIN, END = generic_gradients(8, 0.12, seed=3), generic_gradients(8, 0.12, seed=4)


def over_step(law: MuscleTension, F: Array, share: float = 1.0) -> MuscleTension:
    """The law in a step from `BEGIN` to F."""
    E0 = strain(BEGIN)
    return law.straining(Straining(E0, (strain(F) - E0) / STEP, STEP, share))


def test_the_curve_is_hills() -> None:
    """``(F + a)(v + b) = (1 + a) b`` with ``a = k``, ``b = k v_max``; no force from v_max on, its bound in lengthening.

    Catches: the curvature's inverse, force that pushes, lengthening without bound.
    """
    k, fastest = HILL.curvature, HILL.fastest
    v = np.linspace(0.0, 1.0, 9) * fastest
    np.testing.assert_allclose((HILL(-v) + k) * (v + k * fastest), (1.0 + k) * k * fastest, rtol=1e-14)
    assert HILL(-1.7 * fastest) == 0.0
    y, c = 0.8, 0.5 * k / (1.0 + k)
    assert HILL(y * fastest) == pytest.approx(1.0 + 0.5 * y / (y + c), rel=1e-14)
    assert HILL.plateau == HILL(9.0 * fastest) == pytest.approx(1.0 + 0.5 * 3.0 / (3.0 + c), rel=1e-14)
    assert HILL.plateau < 1.5


def test_the_slope_is_the_derivative_and_does_not_jump_at_rest() -> None:
    """Central differences on both sides, 0 beyond both ends, the same slope from both sides of rest.

    Catches: the inner derivative, a kink where the hyperbolas meet.
    """
    rates = np.array([-2.3, -1.1, -0.2, 0.3, 1.9, 7.2])
    eps = 1e-6
    np.testing.assert_allclose(HILL.slope(rates), (HILL(rates + eps) - HILL(rates - eps)) / (2.0 * eps), rtol=1e-7)
    np.testing.assert_array_equal(HILL.slope(np.array([-2.6, 7.6])), 0.0)
    assert HILL.slope(-1e-10) == pytest.approx(HILL.slope(1e-10), rel=1e-8)


@pytest.mark.parametrize("share", [0.0, 0.2, 1.0, 1.3])
def test_the_rate_of_a_load_is_the_curves_inverse(share: float) -> None:
    """Catches: branches exchanged, the wrong sign of shortening."""
    assert HILL(HILL.rate_at(share)) == pytest.approx(share, abs=1e-14)


def test_shortening_is_strongest_where_power_is_greatest() -> None:
    """Of a thousand rates none gives more power, and one near it nearly as much.

    Catches: the root with the other sign, a rate that is not in units of the fastest.
    """
    rates = np.linspace(-HILL.fastest, 0.0, 1001)
    power = -rates * HILL(rates)
    assert HILL.strongest == pytest.approx(rates[np.argmax(power)], abs=HILL.fastest / 1000)


@pytest.mark.parametrize("convention", STRESSES)
def test_what_stimulation_adds_is_scaled_by_the_curve(convention: Convention) -> None:
    """Stress over a step is the standing part's and g of the stimulated part's, g at the stretches' difference over h.

    Catches: the standing tension scaled, a rate at the step's end, a rate that is relative to the stretch reached.
    """
    law = law_of(convention)
    rate = (stretch(END, np.outer(FIBRE, FIBRE)) - stretch(BEGIN, np.outer(FIBRE, FIBRE))) / STEP
    assert (rate < -0.1).any()
    assert (rate > 0.1).any()
    standing = law_of(convention, standing=0.0, force_length="none", tension=STANDING).stress(END)
    isometric = law.stress(END) - standing
    np.testing.assert_allclose(over_step(law, END).stress(END), standing + HILL(rate) * isometric, rtol=1e-12)


@pytest.mark.parametrize("spread", [0.0, 0.4])
@pytest.mark.parametrize("convention", STRESSES)
def test_the_tangent_over_a_step_is_the_derivative(convention: Convention, spread: float) -> None:
    """The remainder of the stress falls with the square when the step's end is moved, away from rest.

    Catches: the rate left out of the tangent, its slope over the wrong stretch, the step's length missing.
    """
    law = law_of(convention, dispersion=Dispersion(spread, "planar", NORMAL) if spread else None)
    # small against the strain at which the fastest shortening is reached
    direction = 0.05 * generator().normal(size=END.shape)

    def stress(eps: float) -> Array:
        return over_step(law, END + eps * direction).stress(END + eps * direction)

    along = np.einsum("ikjl...,jl...->ik...", over_step(law, END).tangent(END), direction)
    np.testing.assert_allclose(taylor_slope(stress, along), 2.0, atol=0.1)
    still = np.einsum("ikjl...,jl...->ik...", over_step(replace_slope(law), END).tangent(END), direction)
    assert taylor_slope(stress, still).max() < 1.1


def test_the_share_of_the_step_divides_the_rates_part() -> None:
    """Moduli are by the strain at which the stress is evaluated: only a share of the step's change goes on to its end.

    Catches: the share as a factor, or left out.
    """
    law = law_of()
    still = over_step(replace_slope(law), END).tangent(END)
    whole, part = (over_step(law, END, share).tangent(END) - still for share in (1.0, SHARE))
    np.testing.assert_allclose(part * SHARE, whole, rtol=1e-9, atol=1e-12 * np.abs(whole).max())


def replace_slope(law: MuscleTension) -> MuscleTension:
    """The same law without the part of its tangent that comes of the rate."""

    class Flat(ForceVelocity):
        def slope(self, rate: Array | float) -> Array:
            return np.zeros_like(np.asarray(rate, dtype=float))

    return replace(law, force_velocity=Flat(HILL.fastest, HILL.curvature, HILL.eccentric))


def test_an_instant_is_the_limit_of_short_steps() -> None:
    """The stress at an instant is what steps around it tend to, order one in their length.

    Catches: the rate of squared stretch, an instant taken for rest.
    """
    law, dF = law_of(), generator(5).normal(size=BEGIN.shape)
    rate = np.einsum("ki...,kj...->ij...", BEGIN, dF)
    rate = np.stack([(rate[i, j] + rate[j, i]) * (0.5 if i == j else 1.0) for i, j in PAIRS])
    instant = law.straining(Straining(strain(BEGIN), rate, 0.0)).stress(BEGIN)
    steps, errors = [1e-3, 5e-4, 2.5e-4], []
    for h in steps:
        change = (strain(BEGIN + h * dF) - strain(BEGIN)) / h
        errors.append(np.abs(law.straining(Straining(strain(BEGIN), change, h)).stress(BEGIN) - instant).max())
    assert slope(steps, errors) == pytest.approx(1.0, abs=0.1)
    assert np.abs(instant - law.stress(BEGIN)).max() > 0.1


@pytest.mark.parametrize("columns", [0, 21, 36])
@pytest.mark.parametrize("convention", STRESSES)
def test_the_compiled_form_is_the_laws(convention: Convention, columns: int) -> None:
    """Over some elements of a mesh, with fields of tension and fibres, a spread, and points of different rates.

    Catches: rates of other elements, a packed entry misplaced, an energy where there is none.
    """
    draw, n, chosen = generator(), 5, np.array([3, 1])
    F, F0 = (generic_gradients(4 * n, 0.1, seed).reshape(3, 3, n, 4) for seed in (7, 8))
    a0 = draw.normal(size=(3, 2))
    a0 /= np.linalg.norm(a0, axis=0)
    muscle = ActiveStress(
        np.array([5.0, 6.1]), a0, convention, SMOOTH, dispersion=Dispersion(0.3, "solid"),
        standing=np.array([1.2, 2.2]), force_velocity=HILL,
    )  # fmt: skip
    law = active_law(muscle, n, chosen, NeoHooke(10.0, 0.3))
    assert isinstance(law, MuscleTension)
    E0 = strain(F0)
    moving = law.straining(Straining(E0, (strain(F) - E0) / STEP, STEP, SHARE))
    S, D, psi = np.zeros((6, n, 4)), np.zeros((columns, n, 4)), np.zeros((n, 4))
    moving.add_second_piola(F, chosen, S, D, psi)
    part, own = F[:, :, chosen], moving.at(chosen)
    inverse = np.linalg.inv(part.transpose(2, 3, 0, 1)).transpose(2, 3, 0, 1)
    full = np.einsum("im...,mk...->ik...", inverse, own.stress(part))
    np.testing.assert_allclose(S[:, chosen], np.stack([full[i, j] for i, j in PAIRS]), rtol=0.0, atol=1e-12)
    assert not S[:, [0, 2, 4]].any()
    material = own.tangent(part) - np.einsum("ij,kl...->ikjl...", np.eye(3), full)
    material = np.einsum("mi...,ikjl...,nj...->mknl...", inverse, material, inverse)
    entry = 0
    for a, (i, j) in enumerate(PAIRS):
        for b, (k, m) in enumerate(PAIRS):
            if columns == 36 or (columns == 21 and b >= a):
                wanted = material[i, j, k, m]
                if columns == 21:
                    wanted = 0.5 * (wanted + material[k, m, i, j])
                np.testing.assert_allclose(D[entry, chosen], wanted, rtol=0.0, atol=2e-10)
                entry += 1


def test_without_a_rate_nothing_changes() -> None:
    """A step in which nothing moves, and a law without the dependence, give the isometric stress.

    Catches: a share other than 1 at rest, a curve where none was asked for.
    """
    law = law_of()
    nothing = Straining(strain(END), np.zeros((6, END.shape[-1])), STEP)
    np.testing.assert_array_equal(law.straining(nothing).stress(END), law.stress(END))
    plain = law_of(force_velocity=None)
    assert plain.straining(nothing) is plain


def test_a_tension_that_depends_on_the_rate_has_no_energy() -> None:
    """Catches: the energy of the isometric tension in its place."""
    with pytest.raises(ModelError, match="force_velocity: found a tension that depends on the rate"):
        over_step(law_of(), END).energy(END)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"fastest": 0.0}, "fastest: found 0.0, expected a number above 0"),
        ({"fastest": float("inf")}, "fastest: found inf"),
        ({"curvature": -0.1}, "curvature: found -0.1"),
        ({"eccentric": 1.0}, "eccentric: found 1.0, expected a number above 1"),
        ({"eccentric": "much"}, "eccentric: found 'much'"),
    ],
)
def test_curves_that_are_none_are_refused(given: dict[str, Any], words: str) -> None:
    """Catches: a parameter that is not checked."""
    with pytest.raises(ModelError, match=words):
        replace(HILL, **given)


def test_what_the_rate_does_not_go_with_is_refused() -> None:
    """Catches: a curve that is passed over in silence, a load beyond the plateau."""
    with pytest.raises(ModelError, match=r"share: found 1\.6"):
        HILL.rate_at(1.6)
    for more, words in (
        ({"force_velocity": 3.0}, "force_velocity: found 3.0, expected a ForceVelocity"),
        ({"transverse": 0.1}, "transverse: found 0.1 together with a force-velocity curve"),
        ({"convention": "active_strain"}, "force_velocity: found with convention active_strain"),
        ({"dispersion": Dispersion(0.3, "solid"), "integrate": True}, "integrate: found with .* force-velocity"),
    ):
        with pytest.raises(ModelError, match=words):
            ActiveStress(**{"tension": 1.0, "a0": unit(1.0, 2.0, 0.0), "force_velocity": HILL, **more})
