"""The shared battery: what is true of every law, at ten generic deformations far from the identity."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.material import LAWS, Convention, FibreTension, law_from
from fem_biobot.material.law import is_symmetric
from fem_biobot.material.laws import has_fibres, parameters
from tests.helpers import generator, generic_gradients, rotation, taylor_slope, unchanged
from tests.laws.cases import CASES, FIBRE, POISSON, STRESSES, YOUNG, Case, make_law
from tests.oracles import laws as oracle

EPS = np.finfo(float).eps
GRADIENTS = generic_gradients(10)
# products and inverses of a few well-conditioned 3 by 3 tensors
ROUNDING = 2000 * EPS

every_law = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
energetic_laws = pytest.mark.parametrize("case", [c for c in CASES if c.energetic], ids=lambda case: case.name)
# active strain measures its energy from the passive one
measured_laws = pytest.mark.parametrize(
    "case", [c for c in CASES if c.energetic and c.name != "active_strain"], ids=lambda case: case.name
)
active_laws = pytest.mark.parametrize("case", [c for c in CASES if not c.passive], ids=lambda case: case.name)
passive_laws = pytest.mark.parametrize("case", [c for c in CASES if c.passive], ids=lambda case: case.name)
table_laws = pytest.mark.parametrize("name", list(LAWS))


@measured_laws
def test_energy_is_zero_where_the_law_rests(case: Case) -> None:
    """psi is zero in the undeformed body, or in the natural state of tissue that has another.

    Catches: a missing constant (``I1`` for ``I1 - 3``), the natural state's inverse left out.
    """
    law, F = case.make(), case.rest[:, :, None]
    scale = np.max(np.abs(law.tangent(F)))
    assert abs(law.energy(F)[0]) < ROUNDING * scale


@passive_laws
def test_passive_stress_is_zero_where_the_law_rests(case: Case) -> None:
    """A passive law carries no stress at rest.

    Catches: a missing pressure term (``mu F`` without ``- mu F^-T``).
    """
    law, F = case.make(), case.rest[:, :, None]
    assert np.max(np.abs(law.stress(F))) < ROUNDING * np.max(np.abs(law.tangent(F)))


@pytest.mark.parametrize("convention", STRESSES)
@pytest.mark.parametrize("transverse", [0.0, 0.27])
def test_active_stress_at_rest_is_the_tension_along_the_fibre(convention: Convention, transverse: float) -> None:
    """Muscle pulls with T along its fibre and a share of it in every direction across, in the undeformed body.

    Catches: an active stress scaled by ``stretch - 1``, the wrong sign, a pressure added to it, half the share across.
    """
    P = FibreTension(3.1, FIBRE, convention, transverse=transverse).stress(np.eye(3)[:, :, None])[:, :, 0]
    dyad = np.outer(FIBRE, FIBRE)
    wanted = 3.1 * (dyad + transverse * (np.eye(3) - dyad))
    np.testing.assert_allclose(P, wanted, rtol=0.0, atol=20 * EPS * 3.1)


@energetic_laws
def test_stress_is_the_derivative_of_the_energy(case: Case) -> None:
    """The Taylor remainder of psi with P falls with slope 2.

    Catches: wrong sign, a lost factor, ``F^-1`` for ``F^-T`` in the stress.
    """
    law, H = case.make(), 0.3 * generator(5).normal(size=(3, 3, 10))
    power = np.einsum("ik...,ik...->...", law.stress(GRADIENTS), H)
    slopes = taylor_slope(lambda e: law.energy(GRADIENTS + e * H)[None], power[None])
    np.testing.assert_allclose(slopes, 2.0, rtol=0.0, atol=0.1)


@every_law
def test_tangent_is_the_derivative_of_the_stress(case: Case) -> None:
    """The Taylor remainder of P with A4 falls with slope 2.

    Catches: a missing tangent term, ``F^-1 F^-1`` with two indices exchanged, implicit einsum output.
    """
    law, H = case.make(), 0.3 * generator(6).normal(size=(3, 3, 10))
    change = np.einsum("ikjl...,jl...->ik...", law.tangent(GRADIENTS), H)
    longest = law.stress(GRADIENTS + H / 64.0) - law.stress(GRADIENTS) - change / 64.0
    if np.max(np.abs(longest)) < ROUNDING * np.max(np.abs(law.tangent(GRADIENTS))):
        return  # linear in F: there is no remainder
    slopes = taylor_slope(lambda e: law.stress(GRADIENTS + e * H), change)
    np.testing.assert_allclose(slopes, 2.0, rtol=0.0, atol=0.1)


@every_law
def test_a_rotation_after_the_deformation_turns_the_stress_only(case: Case) -> None:
    """P(QF) = Q P(F) and psi(QF) = psi(F).

    Catches: F used where C belongs, such as an I4 from ``a0 . F a0``.
    """
    law, Q = case.make(), rotation()
    QF = np.einsum("ij,jk...->ik...", Q, GRADIENTS)
    P = law.stress(GRADIENTS)
    scale = np.max(np.abs(law.tangent(GRADIENTS)))
    if case.energetic:
        np.testing.assert_allclose(law.energy(QF), law.energy(GRADIENTS), rtol=0.0, atol=ROUNDING * scale)
    np.testing.assert_allclose(law.stress(QF), np.einsum("ij,jk...->ik...", Q, P), rtol=0.0, atol=ROUNDING * scale)


@every_law
def test_stress_keeps_the_symmetry_of_the_material(case: Case) -> None:
    """Turning the body before the deformation leaves the current body as it is: P(F Q) (F Q)^T = P(F) F^T.

    Any turn if isotropic, any about the fibre if it knows no plane, half a turn about it otherwise.

    Catches: a fixed axis in an isotropic law, a fibre taken in the current body, a natural state turned with it.
    """
    law = case.make()
    if case.fibre is None:
        # the natural state is turned, not the reference body: F F0^-1 -> F F0^-1 Q
        Q = np.linalg.inv(case.rest) @ rotation(8) @ case.rest
    else:
        Q = _about(case.fibre, np.pi if case.plane else 0.83)
    turned = np.einsum("ij...,jk->ik...", GRADIENTS, Q)
    scale = np.max(np.abs(law.tangent(GRADIENTS)))
    # P F^T is of the current body, where nothing was turned
    tau, other = (np.einsum("im...,jm...->ij...", law.stress(F), F) for F in (GRADIENTS, turned))
    np.testing.assert_allclose(other, tau, rtol=0.0, atol=ROUNDING * scale)
    if case.energetic:
        np.testing.assert_allclose(law.energy(turned), law.energy(GRADIENTS), rtol=0.0, atol=ROUNDING * scale)


def _about(axis: np.ndarray, angle: float) -> np.ndarray:
    """Rotation about `axis` by Rodrigues' formula."""
    x, y, z = axis
    W = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * W + (1.0 - np.cos(angle)) * W @ W


@pytest.mark.parametrize("case", [c for c in CASES if c.fibre is not None], ids=lambda case: case.name)
def test_a_fibre_has_no_sign(case: Case) -> None:
    """Energy, stress and tangent are the same for a0 and -a0.

    Catches: odd powers of a component of a0 (``a0 . F a0`` for the stretch, one factor of the dyad lost).
    """
    one, other = case.make(), case.make(a0=-case.fibre)
    for method in ("energy", "stress", "tangent") if case.energetic else ("stress", "tangent"):
        a, b = getattr(one, method)(GRADIENTS), getattr(other, method)(GRADIENTS)
        np.testing.assert_allclose(a, b, rtol=0.0, atol=ROUNDING * np.max(np.abs(a)))


@every_law
def test_angular_momentum_is_balanced(case: Case) -> None:
    """P F^T is symmetric.

    Catches: an index slip such as ``a0 x a`` for ``a x a0``.
    """
    law = case.make()
    tau = np.einsum("im...,jm...->ij...", law.stress(GRADIENTS), GRADIENTS)
    assert np.max(np.abs(tau - tau.swapaxes(0, 1))) < ROUNDING * np.max(np.abs(law.tangent(GRADIENTS)))


@every_law
def test_tangent_has_major_symmetry_if_there_is_an_energy(case: Case) -> None:
    """A4[i, k, j, l] = A4[j, l, i, k] for every law with an energy, and for no other.

    Catches: a non-energetic term, axes exchanged in one of the tangent's products; a law without energy that says
    nothing of it.
    """
    law = case.make()
    A4 = law.tangent(GRADIENTS)
    scale = np.max(np.abs(A4))
    skew = np.max(np.abs(A4 - np.moveaxis(A4, (2, 3), (0, 1))))
    assert is_symmetric(law) == case.energetic
    assert skew < ROUNDING * scale if case.energetic else skew > 0.01 * scale


@pytest.mark.parametrize("name", [name for name in LAWS if name != "guccione"])
def test_small_strain_is_hookes_law(name: str) -> None:
    """With its default parameters A4(I) is the linear tensor of E and nu, fibres being slack there.

    Catches: wrong conversion of the moduli, a shear modulus off by two, plane-stress constants.
    """
    A4 = law_from(name, YOUNG, POISSON, FIBRE).tangent(np.eye(3)[:, :, None])[..., 0]
    np.testing.assert_allclose(A4, oracle.linear_elasticity(YOUNG, POISSON), rtol=0.0, atol=ROUNDING * YOUNG)


def test_small_strain_of_the_exponential_has_its_moduli_by_direction() -> None:
    """Shear across the fibres has mu, along them mu bfs/bt; with equal exponents the body is Hooke's.

    Catches: the reference modulus taken of another plane, a factor of two between c and mu.
    """
    own = {"exponent_fibre": 5.0, "exponent_across": 2.0, "exponent_shear": 3.0}
    A4 = law_from("guccione", YOUNG, POISSON, np.array([1.0, 0.0, 0.0]), **own).tangent(np.eye(3)[:, :, None])[..., 0]
    mu = YOUNG / (2.0 + 2.0 * POISSON)
    assert A4[1, 2, 1, 2] == pytest.approx(mu, rel=1e-13)
    assert A4[0, 1, 0, 1] == pytest.approx(1.5 * mu, rel=1e-13)
    # pulled along the fibre at constant volume: strain 1, -1/2, -1/2; c (bf + bt/2) with c = 2 mu / bt
    e = np.diag([1.0, -0.5, -0.5])
    assert np.einsum("ik,ikjl,jl", e, A4, e) == pytest.approx(mu * (5.0 + 1.0), rel=1e-13)
    same = law_from("guccione", YOUNG, POISSON, FIBRE, **dict.fromkeys(own, 1.7)).tangent(np.eye(3)[:, :, None])
    np.testing.assert_allclose(same[..., 0], oracle.linear_elasticity(YOUNG, POISSON), rtol=0.0, atol=ROUNDING * YOUNG)


@table_laws
def test_stress_and_energy_are_those_of_an_independent_twin(name: str) -> None:
    """Energy and stress of a generic F are those written in principal stretches, or in axes of the fibre.

    Catches: any change of the energy that stays consistent (ln J for J - 1, another volumetric term, an invariant
    with its volume left in).
    """
    law = make_law(name)
    for F in np.moveaxis(GRADIENTS, -1, 0):
        psi, P = oracle.at_point(name, F, YOUNG, POISSON, FIBRE)
        scale = float(np.max(np.abs(law.tangent(F[:, :, None]))))
        assert abs(law.energy(F[:, :, None])[0] - psi) < ROUNDING * scale
        np.testing.assert_allclose(law.stress(F[:, :, None])[..., 0], P, rtol=0.0, atol=ROUNDING * scale)


def test_every_law_of_the_table_has_an_independent_twin() -> None:
    """The oracles know every law that a design can name.

    Catches: a law added without its twin.
    """
    assert set(oracle.ISOTROPIC) | set(oracle.FIBRES) == set(oracle.PARAMETERS) == set(LAWS)
    assert all(set(oracle.PARAMETERS[name]) == set(parameters(name)) for name in LAWS)
    assert set(oracle.FIBRES) == {name for name in LAWS if has_fibres(name)}


@active_laws
def test_tension_is_proportional_to_its_factor(case: Case) -> None:
    """A law at a multiple of its tension is that of the multiple tension.

    Catches: a factor taken twice or forgotten; a natural stretch kept from another tension.
    """
    whole, part = case.make(tension=7.7), case.make(tension=3.1).scaled(7.7 / 3.1)
    for method in ("stress", "tangent"):
        a, b = getattr(whole, method)(GRADIENTS), getattr(part, method)(GRADIENTS)
        np.testing.assert_allclose(b, a, rtol=0.0, atol=ROUNDING * np.max(np.abs(a)))


@pytest.mark.parametrize("case", [c for c in CASES if not c.energetic], ids=lambda case: case.name)
def test_a_law_without_energy_says_so(case: Case) -> None:
    """Tension per current area has no energy, and asking for it is refused.

    Catches: zero or another convention's energy handed out.
    """
    with pytest.raises(ModelError, match="has no energy"):
        case.make().energy(GRADIENTS)


@pytest.mark.parametrize(
    ("case", "parameter"),
    [(case, parameter) for case in CASES for parameter in case.parameters],
    ids=lambda x: x.name if isinstance(x, Case) else x,
)
def test_every_parameter_matters(case: Case, parameter: str) -> None:
    """A changed parameter changes the stress.

    Catches: an inert parameter (a default used instead of what was given).
    """
    P = case.make().stress(GRADIENTS)
    other = case.make(**{parameter: case.parameters[parameter]}).stress(GRADIENTS)
    assert np.max(np.abs(other - P)) > 0.005 * np.max(np.abs(P))


@energetic_laws
@pytest.mark.parametrize("method", ["energy", "stress", "tangent"])
def test_an_inverted_point_is_refused(case: Case, method: str) -> None:
    """One point with det F < 0 among good ones is refused with its determinant, and so is det F = 0.

    Catches: no check (a silent NaN from the logarithm), a check of the first point only.
    """
    for third in (-0.5, 0.0):
        F = GRADIENTS.copy()
        F[:, :, 6] = np.diag([1.1, 0.9, third])
        with pytest.raises(ModelError, match="det F"):
            getattr(case.make(), method)(F)


@every_law
def test_inputs_stay_as_they_are_and_any_trailing_axes_do(case: Case) -> None:
    """The methods leave F alone, and points may be arranged as (e, q) or come alone.

    Catches: in-place arithmetic on F, axes counted from the front.
    """
    law = case.make()
    F = GRADIENTS.reshape(3, 3, 5, 2)
    with unchanged(F):
        for method in ("energy", "stress", "tangent") if case.energetic else ("stress", "tangent"):
            arranged, flat = getattr(law, method)(F), getattr(law, method)(GRADIENTS)
            np.testing.assert_array_equal(arranged.reshape(flat.shape), flat)
            one = getattr(law, method)(GRADIENTS[..., 3])
            np.testing.assert_allclose(one, flat[..., 3], rtol=0.0, atol=ROUNDING * np.max(np.abs(flat)))
