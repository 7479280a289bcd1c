"""S1: free contraction of a block of muscle along an oblique fibre, in every convention of active tension.

Problem: unit cube on a distorted mesh, neo-Hooke, compressible or not, tension T along an oblique fibre, no load.
Exact answer: two stretches from two scalar equations of the law (tests/oracles/free_muscle.py), whose limit at
    nu -> 1/2 is the table of shared values: mu (s - s^-2) + T = 0 nominal, s = (mu/(mu + T))^(1/3) second Piola. Active
    strain: by its definition the incompressible stretch at constant volume, at any Poisson's ratio.
Measured: F^T F at every quadrature point; fibre stretch; lengths of the cube's edges through `at`.
Tolerance: 1e-9, the residual is solved to 1e-13 of the force scale and the block's softest stiffness is near mu.
Cannot see: discretisation (the answer is homogeneous), forces through a section (there are none), shear.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.material import LAWS, ActiveStress, Convention, NaturalState, NeoHooke
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.verification.solid_states import NOMINAL as INCOMPRESSIBLE
from fem_biobot.verification.solid_states import OBLIQUE as FIBRE
from fem_biobot.verification.solid_states import SECOND_PIOLA, free_block
from tests.helpers import TIGHT, box_mesh, on_three_corners
from tests.laws.cases import make_law
from tests.oracles.free_muscle import free_stretches, incompressible_stretch
from tests.oracles.laws import at_point

# the symmetric part of an unsymmetric tangent converges linearly
PATIENT = replace(TIGHT, max_iterations=60)
STRESSES = [c.value for c in Convention if c is not Convention.active_strain]


def _assert_stretches(state: SolidState, s: float, t: float) -> None:
    """Every point has the stretch `s` along the fibre and `t` across it, and an edge its length."""
    C = np.einsum("im...,ik...->mk...", state.F, state.F)
    expected = t**2 * np.eye(3) + (s**2 - t**2) * np.outer(FIBRE, FIBRE)
    np.testing.assert_allclose(C, np.broadcast_to(expected[:, :, None, None], C.shape), rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(state.stretch, s, rtol=0.0, atol=1e-9)
    edge = np.array([0.0, 0.0, 1.0]) + state.at((0.2, 0.3, 1.0)) - state.at((0.2, 0.3, 0.0))
    assert np.linalg.norm(edge) == pytest.approx(np.sqrt(expected[2, 2]), abs=1e-9)


@pytest.mark.parametrize("convention", STRESSES)
def test_the_scalar_equations_reach_the_incompressible_ones(convention: str) -> None:
    """The oracle's stretch tends to the incompressible one with an error proportional to 1 - 2 nu; two are tabled.

    Catches: a wrong scalar equation (sign of T, t for t^2).
    """
    table = {"nominal": INCOMPRESSIBLE, "second_piola": SECOND_PIOLA}.get(convention, {})
    for tension in INCOMPRESSIBLE:
        limit = incompressible_stretch(tension, convention)
        assert limit == pytest.approx(table.get(tension, limit), abs=6e-10)
        near, nearer = (free_stretches(tension, 0.5 - gap, convention)[0] - limit for gap in (2e-4, 1e-4))
        assert abs(nearer) < 3e-4
        assert near / nearer == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize("convention", STRESSES)
@pytest.mark.parametrize(("poisson", "element"), [(0.3, "P2"), (0.47, "P2"), (0.47, "P2-P1"), (0.4999, "P2-P1")])
def test_free_muscle_contracts_by_the_scalar_equations(convention: str, poisson: float, element: str) -> None:
    """Every point of the block has the two stretches of the scalar equations at T/mu = 0.1, 0.5, 1 and 2.

    Catches: tension along a0 of another frame, one convention taken for another, a tension not scaled by the step.
    """
    law = NeoHooke(9.3, poisson)
    tensions = list(INCOMPRESSIBLE)
    muscle = {"muscle": ActiveStress(law.mu, FIBRE, convention)}
    model = SolidModel(box_mesh(2), {"muscle": law}, muscle, on_three_corners(), element=element)
    solution = solve(model, tensions, settings=PATIENT)
    for tension, state in zip(tensions, solution.states, strict=True):
        _assert_stretches(state, *free_stretches(tension, poisson, convention))


@pytest.mark.parametrize("convention", STRESSES)
def test_free_muscle_feels_its_force_length_curve(convention: str) -> None:
    """With a curve the scalar equations hold with the tension's share at the stretch reached.

    Catches: the share of the last state kept (a staggered update), a curve read at the undeformed length.
    """
    law, poisson = NeoHooke(9.3, 0.4), 0.4
    muscle = ActiveStress(1.5 * law.mu, FIBRE, convention, force_length="blemker_2005")
    model = SolidModel(box_mesh(2), {"muscle": law}, {"muscle": muscle}, on_three_corners())

    def share(s: float) -> float:
        return 1.0 - 4.0 * (1.0 - s) ** 2 if s > 0.6 else 9.0 * (s - 0.4) ** 2

    state = solve(model, [0.4, 1.0], settings=PATIENT).last
    _assert_stretches(state, *free_stretches(1.5, poisson, convention, share))


@pytest.mark.parametrize("poisson", [0.3, 0.47])
def test_active_strain_contracts_by_the_incompressible_equation(poisson: float) -> None:
    """Active strain takes the block to its natural state: the nominal, incompressible stretch, at constant volume.

    Catches: a natural state contracted by another tension's stretch; the passive law left beside its contracted self.
    """
    law = NeoHooke(9.3, poisson)
    muscle = ActiveStress(law.mu, FIBRE, "active_strain")
    model = SolidModel(box_mesh(2), {"muscle": law}, {"muscle": muscle}, on_three_corners())
    tensions = list(INCOMPRESSIBLE)
    for tension, state in zip(tensions, solve(model, tensions, settings=TIGHT).states, strict=True):
        s = incompressible_stretch(tension)
        assert s == pytest.approx(INCOMPRESSIBLE[tension], abs=6e-10)
        _assert_stretches(state, s, s**-0.5)


@pytest.mark.parametrize("name", list(LAWS))
def test_every_law_contracts_freely_by_its_own_equation(name: str) -> None:
    """Incompressible, along the fibre, the stretch is where the twin's ``dW/ds + T`` vanishes at constant volume.

    Catches: a law whose split loses a part, or keeps some volume in the rest; fibres in other axes than the tension's.
    """
    mu = 3.1
    law = make_law(name, 3.0 * mu, 0.5, FIBRE)
    dyad = np.outer(FIBRE, FIBRE)

    def pull(s: float) -> float:
        F = s * dyad + (np.eye(3) - dyad) / np.sqrt(s)
        change = dyad - 0.5 * s**-1.5 * (np.eye(3) - dyad)
        # a compressible twin of the same shear modulus: at constant volume its volume carries nothing
        return float(np.sum(at_point(name, F, 2.6 * mu, 0.3, FIBRE)[1] * change)) + 0.9 * mu

    s = brentq(pull, 0.3, 1.0, xtol=1e-14)
    muscle = {"muscle": ActiveStress(0.9 * mu, FIBRE)}
    model = SolidModel(box_mesh(2), {"muscle": law}, muscle, on_three_corners(), element="P2-P1")
    _assert_stretches(solve(model, [0.5, 1.0], settings=PATIENT).last, s, s**-0.5)


def test_active_strain_contracts_the_law_that_the_model_has_now() -> None:
    """A model with other materials contracts those.

    Catches: a contraction of the law that the model was first made with.
    """
    soft, hard = NeoHooke(9.3, 0.3), NeoHooke(18.6, 0.3)
    muscle = ActiveStress(soft.mu, FIBRE, "active_strain")
    model = SolidModel(box_mesh(2), {"muscle": soft}, {"muscle": muscle}, on_three_corners())
    s = incompressible_stretch(0.5)
    _assert_stretches(solve(model.with_materials({"muscle": hard}), [1.0], settings=TIGHT).last, s, s**-0.5)
    stays = model.with_materials({"muscle": NaturalState(hard, np.eye(3))})
    _assert_stretches(solve(stays, [1.0], settings=TIGHT).last, s, s**-0.5)


def test_incompressible_muscle_keeps_its_volume() -> None:
    """At a Poisson's ratio of 1/2 every point has J = 1 and the pressure that balances the sides, mu (1/s - 1) + p = 0.

    Catches: a body that is only nearly incompressible (a ratio of 0.4999 misses by 1e-5), a pressure of the wrong sign.
    """
    law = NeoHooke(9.3, 0.5)
    for tension, state in zip(
        INCOMPRESSIBLE, free_block(law, ActiveStress(law.mu, FIBRE), list(INCOMPRESSIBLE), "P2-P1"), strict=True
    ):
        s = incompressible_stretch(tension)
        np.testing.assert_allclose(state.pressure, law.mu * (1.0 - 1.0 / s), rtol=0.0, atol=1e-9 * law.mu)
        np.testing.assert_allclose(np.linalg.det(np.moveaxis(state.F, (0, 1), (-2, -1))), 1.0, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("convention", [c.value for c in Convention])
def test_incompressible_muscle_contracts_by_its_convention(convention: str) -> None:
    """At a Poisson's ratio of 1/2 the stretch is that of mu (s - s^-2) + T p(s) = 0: p = 1, s, 1/s, 1/s.

    Active strain has that of nominal tension. Catches: a volume ratio of the Cauchy convention that is not the field's.
    """
    law = NeoHooke(9.3, 0.5)
    muscle = {"muscle": ActiveStress(law.mu, FIBRE, convention)}
    model = SolidModel(box_mesh(2), {"muscle": law}, muscle, on_three_corners(), element="P2-P1")
    known = "nominal" if convention == "active_strain" else convention
    for tension, state in zip(INCOMPRESSIBLE, solve(model, list(INCOMPRESSIBLE), settings=PATIENT).states, strict=True):
        s = incompressible_stretch(tension, known)
        _assert_stretches(state, s, s**-0.5)


def test_the_way_to_a_tension_does_not_matter() -> None:
    """One step to T/mu = 2, or four, end in the same stretch, and both in that of the scalar equations.

    Catches: an intermediate state left rough, tension accumulated instead of set.
    """
    law = NeoHooke(9.3, 0.47)
    model = SolidModel(box_mesh(2), {"muscle": law}, {"muscle": ActiveStress(2.0 * law.mu, FIBRE)}, on_three_corners())
    s, _ = free_stretches(2.0, 0.47)
    for steps in ([1.0], [0.1, 0.4, 0.6, 1.0]):
        np.testing.assert_allclose(solve(model, steps, settings=TIGHT).stretch, s, rtol=0.0, atol=1e-9)
