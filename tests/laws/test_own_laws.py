"""Each law at what is special to it: limits, slack fibres, coincident stretches, and a law of a user's own."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.material import (
    LAWS,
    ActiveStrain,
    Blemker,
    Gent,
    Guccione,
    HolzapfelOgden,
    NeoHooke,
    OutsideLawError,
    Yeoh,
    law_from,
)
from fem_biobot.material.law import Array, volume_ratio
from fem_biobot.material.laws import has_fibres, parameters
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Fix, Symmetry
from tests.helpers import TIGHT, box_mesh, generator, hold_everywhere
from tests.laws.cases import FIBRE, PARAMETERS, make_law

EPS = np.finfo(float).eps
X_AXIS = np.array([1.0, 0.0, 0.0])


class SaintVenantKirchhoff:
    """A law of a user's own, ``lmbda/2 (tr e)^2 + mu e : e`` of the Green-Lagrange strain: a law's methods alone."""

    def __init__(self, lmbda: float, mu: float) -> None:
        self.lmbda, self.mu = lmbda, mu

    def _strain(self, F: Array) -> tuple[Array, Array]:
        e = 0.5 * (np.einsum("mi...,mk...->ik...", F, F) - np.eye(3).reshape((3, 3) + (1,) * (F.ndim - 2)))
        return e, np.einsum("ii...->...", e)

    def energy(self, F: Array) -> Array:
        volume_ratio(F)
        e, trace = self._strain(F)
        return 0.5 * self.lmbda * trace**2 + self.mu * np.einsum("ik...,ik...->...", e, e)

    def stress(self, F: Array) -> Array:
        volume_ratio(F)
        e, trace = self._strain(F)
        return self.lmbda * trace * F + 2.0 * self.mu * np.einsum("im...,mk...->ik...", F, e)

    def tangent(self, F: Array) -> Array:
        volume_ratio(F)
        e, trace = self._strain(F)
        eye = np.eye(3)
        b = np.einsum("im...,jm...->ij...", F, F)
        S = self.lmbda * trace * eye.reshape((3, 3) + (1,) * (F.ndim - 2)) + 2.0 * self.mu * e
        return (
            np.einsum("ij,kl...->ikjl...", eye, S)
            + self.lmbda * np.einsum("ik...,jl...->ikjl...", F, F)
            + self.mu * (np.einsum("ij...,kl->ikjl...", b, eye) + np.einsum("il...,jk...->ikjl...", F, F))
        )


def test_a_law_of_ones_own_takes_one_class_and_no_change_of_the_package() -> None:
    """A bar of a law defined here, beside one of the package's, is pulled to the stretches of that law's equations.

    Catches: a solver that asks for the compiled form, for an entry in the table, or for a base class.
    """
    lmbda, mu, s = 9.0, 6.0, 1.25
    # free sides: lmbda tr e + 2 mu e_t = 0
    e = 0.5 * (s**2 - 1.0)
    e_t = -lmbda * e / (2.0 * lmbda + 2.0 * mu)
    t = np.sqrt(1.0 + 2.0 * e_t)
    force = s * (lmbda * (e + 2.0 * e_t) + 2.0 * mu * e)
    mesh = box_mesh(2, layers=(0.5, 1.0), names=("mine", "too"))
    supports = [Symmetry("x0"), Symmetry("y0"), Symmetry("z0"), Fix("x1", "x", s - 1.0)]
    mine = SaintVenantKirchhoff(lmbda, mu)
    model = SolidModel(mesh, {"mine": mine, "too": mine}, supports=supports)
    state = solve(model, [0.5, 1.0], settings=TIGHT).last
    expected = np.diag([s, t, t])[:, :, None, None]
    np.testing.assert_allclose(state.F, np.broadcast_to(expected, state.F.shape), rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(state.reaction("x1"), [force, 0.0, 0.0], rtol=0.0, atol=1e-9)
    # beside a compiled law: both fill the same arrays
    beside = SolidModel(mesh, {"mine": mine, "too": NeoHooke(20.0, 0.3)}, supports=supports)
    assert solve(beside, [0.5, 1.0]).last.residual < 1e-9


def test_chains_drawn_out_are_refused_and_the_solver_takes_a_smaller_step() -> None:
    """At its limit Gent's law has no energy; a solve that reaches for it fails with that reason, not with a NaN.

    Catches: a logarithm of a negative number, a limit of the undeformed first invariant.
    """
    law = Gent(10.0, 0.4, chain_limit=0.5)
    # s^2 + 2/s - 3 = 0.5 at constant volume, near s = 1.447
    just, beyond = (np.diag([s, s**-0.5, s**-0.5])[:, :, None] for s in (1.44, 1.46))
    assert np.isfinite(law.energy(just)[0])
    with pytest.raises(OutsideLawError, match="chain_limit"):
        law.stress(beyond)
    # a body free to swell gets past it by its volume; one held at constant volume does not
    drawn = np.array([0.6, 1.6**-0.5 - 1.0, 1.6**-0.5 - 1.0])[:, None]
    with pytest.raises(SolveError, match="chain_limit"):
        solve(SolidModel(box_mesh(1), {"muscle": law}, supports=hold_everywhere(lambda X: drawn * X)), [1.0])
    # within the limit a bar stiffens
    supports = [Symmetry("x0"), Symmetry("y0"), Symmetry("z0"), Fix("x1", "x", 0.4)]
    stiff, soft = (
        solve(SolidModel(box_mesh(1), {"muscle": made}, supports=supports), [1.0]).reaction("x1")[0]
        for made in (law, NeoHooke(10.0, 0.4))
    )
    assert stiff > 1.8 * soft


@pytest.mark.parametrize("law", [Guccione(10.0, 0.3, X_AXIS), HolzapfelOgden(10.0, 0.3, X_AXIS)])
def test_an_exponent_beyond_all_tissue_is_refused(law: object) -> None:
    """Pulled to seven times its length an exponential law says so instead of overflowing.

    Catches: an infinite stress, with NaN in the next tangent.
    """
    with pytest.raises(OutsideLawError, match="exponent"):
        law.tangent(np.diag([7.0, 0.5, 0.5])[:, :, None])


def test_slack_fibres_leave_the_matrix_alone() -> None:
    """Shortened along the fibre, the reinforced body is its neo-Hookean matrix; lengthened, it is stiffer.

    Catches: fibres that push, an exponential of the negative strain.
    """
    law, matrix = HolzapfelOgden(10.0, 0.3, X_AXIS), law_from("neo_hooke_isochoric", 10.0, 0.3)
    short, long = np.diag([0.8, 1.1, 1.1])[:, :, None], np.diag([1.15, 0.95, 0.95])[:, :, None]
    for method in ("energy", "stress", "tangent"):
        np.testing.assert_array_equal(getattr(law, method)(short), getattr(matrix, method)(short))
    # at s: 2 k1 s e exp(k2 e^2) with e = s^2 - 1
    e = 1.15**2 - 1.0
    added = 2.0 * 18.472 * 1.15 * e * np.exp(16.026 * e**2)
    assert (law.stress(long) - matrix.stress(long))[0, 0, 0] == pytest.approx(added, rel=1e-12)


def test_random_fibres_make_an_isotropic_law() -> None:
    """At a dispersion of 1/3 the direction of the fibre does not matter.

    Catches: the share of the first invariant without its factor of three.
    """
    F = (np.eye(3) + 0.2 * generator(3).normal(size=(3, 3)))[:, :, None]
    one, other = (HolzapfelOgden(10.0, 0.3, a0, fibre_dispersion=1.0 / 3.0).stress(F) for a0 in (X_AXIS, FIBRE))
    np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-11 * np.max(np.abs(one)))


@pytest.mark.parametrize("shear", [0.0, 1e-9, 1e-4, 0.0998, 0.1002])
def test_shear_across_the_fibre_is_smooth_where_stretches_coincide(shear: float) -> None:
    """Sheared across its fibres by g the muscle resists with mu B dB/dg, 2 arsinh(g/2) = B; from zero shear on.

    Catches: a division by zero at equal stretches, a jump where the series ends.
    """
    law = Blemker(10.0, 0.3, X_AXIS)
    F = np.eye(3)
    F[1, 2] = shear
    # trace of the sheared block is 2 + g^2 = 2 cosh B, so B = 2 arsinh(g/2), dB/dg = 1 / sqrt(1 + g^2/4)
    B = 2.0 * np.arcsinh(0.5 * shear)
    wanted = law.mu * B / np.sqrt(1.0 + 0.25 * shear**2)
    assert law.stress(F)[1, 2] == pytest.approx(wanted, rel=1e-9, abs=1e-14)
    assert law.tangent(F)[1, 2, 1, 2] == pytest.approx(law.mu, rel=0.01)


def test_shear_along_the_fibre_is_simple() -> None:
    """Sheared along its fibres by g the muscle resists with mu g, at any g.

    Catches: both shears exchanged, a shear divided by the wrong stretch.
    """
    law = Blemker(10.0, 0.3, X_AXIS, ground=0.0)
    F = np.eye(3)
    F[0, 1] = 0.7
    assert law.stress(F)[0, 1] == pytest.approx(law.mu * 0.7, rel=1e-12)


@pytest.mark.parametrize("stretch", [0.8, 1.02, 1.2, 1.39, 1.41, 1.7])
def test_the_passive_fibre_of_muscle_is_the_papers(stretch: float) -> None:
    """Pulled at constant volume with ``ground = 0`` the fibre carries ``peak f(s)``: nothing, exponential, straight.

    Catches: a line that does not go on with the exponential's slope, the pull of the shears at no shear.
    """
    law = Blemker(10.0, 0.3, X_AXIS, ground=0.0)
    if stretch <= 1.0:
        f = 0.0
    elif stretch <= 1.4:
        f = 0.05 * (np.exp(6.6 * (stretch - 1.0)) - 1.0)
    else:
        f = 0.05 * (np.exp(2.64) - 1.0) + 0.05 * 6.6 * np.exp(2.64) * (stretch - 1.4)
    P = law.stress(np.diag([stretch, stretch**-0.5, stretch**-0.5]))
    # along minus across, so that pressure drops out: s P_11 - t P_22 = s dW/ds
    pull = stretch * P[0, 0] - stretch**-0.5 * P[1, 1]
    assert pull == pytest.approx(stretch * 300.0 * f, rel=1e-11, abs=1e-11)


def test_muscle_sheared_and_shortened_is_not_elliptic() -> None:
    """The limit that the law's documentation states: a fibre short by a quarter and sheared has no real wave speed.

    Catches: a change of the law that should be told in its documentation.
    """
    normals = generator(5).normal(size=(3, 4000))
    normals /= np.linalg.norm(normals, axis=0)
    law = Blemker(10.0, 0.4, X_AXIS)

    def least(F: Array) -> float:
        acoustic = np.einsum("ikjl,kn,ln->nij", law.tangent(F), normals, normals)
        return float(np.linalg.eigvalsh(acoustic)[:, 0].min())

    short, sheared = np.diag([0.75, 0.75**-0.5, 0.75**-0.5]), np.eye(3)
    sheared[1, 0] = np.tan(np.radians(20.0))
    assert least(short) > 0.0
    assert least(sheared) > 0.0
    assert least(sheared @ short) < 0.0


@pytest.mark.parametrize(
    ("name", "own", "word"),
    [
        ("mooney_rivlin", {"second_share": 1.1}, "second_share: found 1.1, expected at least 0 and at most 1"),
        ("yeoh", {"c3": -1.0}, "c3: found -1 kPa"),
        ("yeoh", {"c2": -1.0, "c3": 0.01}, "c2: found -1 kPa, expected above"),
        ("yeoh", {"c2": float("nan")}, "c2"),
        ("gent", {"chain_limit": 0.0}, "chain_limit: found 0, expected above 0"),
        ("guccione", {"exponent_across": 0.0}, "exponent_across"),
        ("holzapfel_ogden", {"fibre_modulus": -1.0}, "fibre_modulus: found -1 kPa, expected at least 0 kPa"),
        ("holzapfel_ogden", {"fibre_dispersion": 0.34}, "fibre_dispersion"),
        ("blemker", {"straight_stretch": 0.9}, "straight_stretch: found 0.9, expected above optimal_stretch"),
        ("blemker", {"fibre_exponent": 2000.0}, "fibre_exponent"),
        ("blemker", {"ground": -0.1}, "ground"),
        ("neo_hooke", {"c2": 1.0}, "c2: found a parameter that the law neo_hooke does not have, expected none"),
        ("yeoh", {"chain_limit": 1.0}, "chain_limit: found .* yeoh does not have, expected one of c2, c3"),
    ],
)
def test_parameters_out_of_place_are_refused(name: str, own: dict[str, float], word: str) -> None:
    """Each refusal names the parameter, what was found and what was expected.

    Catches: a check that NaN passes, a parameter of another law ignored.
    """
    with pytest.raises(ModelError, match=word):
        law_from(name, 10.0, 0.3, FIBRE, **own)


@pytest.mark.parametrize("name", [name for name in LAWS if has_fibres(name)])
def test_a_law_with_fibres_asks_for_them(name: str) -> None:
    """Without fibres, with fibres of another length, shape, or number of elements, it refuses.

    Catches: a default direction along x.
    """
    with pytest.raises(ModelError, match=f"law: found {name} where there are no fibres"):
        law_from(name, 10.0, 0.3)
    with pytest.raises(ModelError, match="a0"):
        law_from(name, 10.0, 0.3, 1.01 * FIBRE)
    with pytest.raises(ModelError, match="shape"):
        law_from(name, 10.0, 0.3, np.ones((3, 2, 2)) / np.sqrt(3.0))
    F = np.broadcast_to(np.eye(3)[:, :, None, None], (3, 3, 4, 1)).copy()
    law = make_law(name, a0=np.stack([FIBRE] * 3, axis=1))
    with pytest.raises(ModelError, match="a0: found fibres of 3 elements, expected 1 or 4"):
        law.add_second_piola(F, np.arange(4), np.zeros((6, 4, 1)), np.zeros((21, 4, 1)), np.zeros((4, 1)))


@pytest.mark.parametrize("name", [name for name in LAWS if has_fibres(name)])
def test_fibres_by_element_are_those_of_the_element(name: str) -> None:
    """A field of fibres over all elements serves the chosen ones, in the compiled form and through `at`.

    Catches: the first element's fibre used for all, fibres counted within the chosen elements.
    """
    a0 = generator(8).normal(size=(3, 5))
    a0 /= np.linalg.norm(a0, axis=0)
    F = (np.eye(3)[:, :, None, None] + 0.1 * generator(9).normal(size=(3, 3, 5, 2))).copy()
    chosen = np.array([4, 1])
    law = make_law(name, a0=a0)
    S, D, psi = np.zeros((6, 5, 2)), np.zeros((21, 5, 2)), np.zeros((5, 2))
    law.add_second_piola(F, chosen, S, D, psi)
    for e in chosen:
        own = make_law(name, a0=a0[:, e])
        np.testing.assert_allclose(psi[e], own.energy(F[:, :, e]), rtol=1e-10)
    np.testing.assert_allclose(psi[chosen], law.at(chosen).energy(F[:, :, chosen]), rtol=1e-10)
    assert not np.any(psi[[0, 2, 3]])


@pytest.mark.parametrize("name", list(LAWS))
def test_the_table_says_which_parameters_a_law_has(name: str) -> None:
    """Names and units of a law's own parameters are those it can be made with.

    Catches: a parameter that the table of names does not list.
    """
    units = parameters(name)
    assert set(units) == set(PARAMETERS[name])
    assert set(units.values()) <= {"1", "kPa"}
    made = law_from(name, 10.0, 0.3, FIBRE, **PARAMETERS[name])
    assert all(getattr(made, own) == value for own, value in PARAMETERS[name].items())


def test_yeoh_without_coefficients_is_neo_hooke() -> None:
    """Both coefficients at their default of zero leave the isochoric neo-Hooke.

    Catches: a default other than the documented one.
    """
    F = (np.eye(3) + 0.2 * generator(4).normal(size=(3, 3)))[:, :, None]
    plain = law_from("neo_hooke_isochoric", 10.0, 0.3)
    np.testing.assert_allclose(Yeoh(10.0, 0.3).stress(F), plain.stress(F), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("name", list(LAWS))
def test_every_law_of_the_table_bears_a_sheared_block(name: str) -> None:
    """With its default parameters every law carries a block through a moderate shear, in a few steps.

    Catches: a default so stiff or so limited that nothing can be solved with it.
    """
    given = hold_everywhere(lambda X: np.stack([0.2 * X[1], 0 * X[1], 0 * X[1]]))
    model = SolidModel(box_mesh(2), {"muscle": law_from(name, 10.0, 0.4, FIBRE)}, supports=given)
    assert solve(model, [0.5, 1.0]).last.residual < 1e-9


@pytest.mark.parametrize("name", ["neo_hooke", "guccione"])
def test_the_natural_stretch_of_active_strain_is_found_by_its_true_slope(name: str) -> None:
    """The slope with which the natural stretch is sought is the central difference of the pull, by element.

    Catches: a term of the second derivative lost, which the bisection behind Newton's steps would hide.
    """
    a0 = np.stack([FIBRE, X_AXIS], axis=1)
    law = ActiveStrain(np.array([3.0, 5.0]), a0, make_law(name, a0=a0))
    s, h = np.array([0.8, 0.65]), 1e-5
    (low, _), (_, slope), (high, _) = (law._pull(at, a0) for at in (s - h, s, s + h))
    np.testing.assert_allclose(slope, (high - low) / (2.0 * h), rtol=1e-8)
    # and the stretch found balances the tension
    found, _ = law._pull(law.natural_stretch, a0)
    np.testing.assert_allclose(found, [-3.0, -5.0], rtol=1e-12)
