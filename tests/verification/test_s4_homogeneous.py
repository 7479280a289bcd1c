"""S4: homogeneous stretch and shear of a distorted patch, with one region and with two.

Problem: a block on a mesh with displaced inner vertices, displacement given on its boundary (or on its ends only).
Exact answer: piecewise linear displacement; stretch across and end force from scalar equations of the law, traction
    between two layers from its continuity (tests/oracles); laws with fibres by their own twins.
Measured: displacement of every node, F at every quadrature point, reactions on faces.
Tolerance: 1e-10 of the size; rounding grown by the solve (residual to 1e-13 of the force scale).
Cannot see: rates, bending, elements other than straight-sided ones.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.material import LAWS, ActiveStress
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Symmetry, Traction
from fem_biobot.verification.solid_states import CLOSE, GENERIC, POISSON, YOUNG, bar, filled, virial
from fem_biobot.verification.solid_states import PATCH as SIZE
from tests.helpers import TIGHT, box_mesh, hold_everywhere, unit
from tests.laws.cases import FIBRE, make_law
from tests.oracles.laws import ISOTROPIC, PARAMETERS, at_point
from tests.oracles.layers import two_layers

every_law = pytest.mark.parametrize("name", list(LAWS))
isotropic_laws = pytest.mark.parametrize("name", list(ISOTROPIC))
every_element = pytest.mark.parametrize("element", ["P2", "P1", "P2-P1"])
# linear elements are asked for more than they bear; a homogeneous state does not lock
pytestmark = pytest.mark.filterwarnings("ignore::fem_biobot.solid.space.LockingWarning")


def _principal(name: str, along: float, across: float) -> np.ndarray:
    """Principal first Piola stresses of a bar, (3,) [kPa]."""
    return ISOTROPIC[name](np.array([along, across, across]), YOUNG, POISSON, PARAMETERS[name])[1]


@every_law
@every_element
def test_a_linear_displacement_of_the_boundary_fills_the_block(name: str, element: str) -> None:
    """Inner nodes of a distorted mesh follow u = (F - I) X exactly, and the faces carry P N of the law.

    Catches: slopes mapped with the inverse transposed, weights of another rule, midpoints out of order.
    """
    F = GENERIC
    if name == "blemker":  # not elliptic where fibres are short and sheared at once
        F = 0.5 * (F + np.eye(3))
    state = filled(make_law(name, YOUNG, POISSON), F, element)
    exact = (F - np.eye(3)) @ state.X
    np.testing.assert_allclose(state.u, exact, rtol=0.0, atol=CLOSE)
    _, P = at_point(name, F, YOUNG, POISSON, FIBRE)
    # P is constant, so reactions times positions sum to its integral
    volume = float(np.prod(SIZE))
    np.testing.assert_allclose(virial(state), volume * P, rtol=0.0, atol=CLOSE * YOUNG * volume)


@isotropic_laws
@pytest.mark.parametrize("element", ["P2", "P2-P1"])
@pytest.mark.parametrize("stretch", [0.6, 1.5])
def test_a_bar_between_its_ends_obeys_the_scalar_equations(name: str, stretch: float, element: str) -> None:
    """Held to a stretch along x with free sides, the bar has the stretch across and the end force of the law.

    Catches: free surfaces that carry traction, a reaction with the wrong sign, force per current area.
    """
    across = brentq(lambda t: _principal(name, stretch, t)[1], 0.5, 1.5, xtol=1e-15, rtol=1e-15)
    force = _principal(name, stretch, across)[0] * SIZE[1] * SIZE[2]
    state = bar(make_law(name, YOUNG, POISSON), stretch, element)
    expected = np.diag([stretch, across, across])[:, :, None, None]
    np.testing.assert_allclose(state.F, np.broadcast_to(expected, state.F.shape), rtol=0.0, atol=CLOSE)
    scale = YOUNG * SIZE[1] * SIZE[2]
    np.testing.assert_allclose(state.reaction("x1"), [force, 0.0, 0.0], rtol=0.0, atol=CLOSE * scale)
    np.testing.assert_allclose(state.reaction("x0"), [-force, 0.0, 0.0], rtol=0.0, atol=CLOSE * scale)


@isotropic_laws
def test_a_pulled_bar_reaches_the_stretch_of_its_dead_load(name: str) -> None:
    """The same bar under the end traction of the scalar equations has their stretches.

    Catches: tractions on the current area or along the current normal, a lost factor of the triangle's area.
    """
    stretch = 1.4
    across = brentq(lambda t: _principal(name, stretch, t)[1], 0.5, 1.5, xtol=1e-15, rtol=1e-15)
    pull = float(_principal(name, stretch, across)[0])
    model = SolidModel(
        box_mesh(2, SIZE),
        {"muscle": make_law(name, YOUNG, POISSON)},
        supports=[Symmetry("x0"), Symmetry("y0"), Symmetry("z0")],
        loads=[Traction("x1", (pull, 0.0, 0.0))],
    )
    state = solve(model, [0.5, 1.0], settings=TIGHT).last
    expected = np.diag([stretch, across, across])[:, :, None, None]
    np.testing.assert_allclose(state.F, np.broadcast_to(expected, state.F.shape), rtol=0.0, atol=CLOSE)


@every_law
def test_simple_shear_needs_the_forces_of_the_law(name: str) -> None:
    """The sheared block's face y = 1 carries the shear and the normal force of P at F = I + g e1 x e2.

    Catches: P transposed, the shear of small strain only.
    """
    g = 0.7
    F = np.eye(3)
    F[0, 1] = g
    _, P = at_point(name, F, YOUNG, POISSON, FIBRE)
    state = filled(make_law(name, YOUNG, POISSON), F)
    area = SIZE[0] * SIZE[2]
    # opposite side faces are meshed alike, so their share in the edge nodes cancels
    np.testing.assert_allclose(state.reaction("y1"), P[:, 1] * area, rtol=0.0, atol=CLOSE * YOUNG * area)
    np.testing.assert_allclose(state.reaction("y0"), -P[:, 1] * area, rtol=0.0, atol=CLOSE * YOUNG * area)


@every_law
@every_element
def test_two_regions_share_a_traction_across_their_interface(name: str, element: str) -> None:
    """Two layers of unequal moduli, one of them contracting, each deform homogeneously, by the same traction.

    Catches: elements of the wrong region, a tension applied to both, an interface that is not conforming.
    """
    moduli = [(YOUNG, 0.44), (8.0 * YOUNG, 0.31)]
    a0 = unit(0.5, -0.3, 0.8)
    heights = (0.5 * SIZE[2], 0.5 * SIZE[2])
    top = np.array([0.35, -0.2, -0.22])
    low, high, traction = two_layers(name, heights, top, moduli, (6.0, 0.0), a0)
    assert np.linalg.norm(low - high) > 0.2

    def exact(X: np.ndarray) -> np.ndarray:
        below = np.minimum(X[2], heights[0])
        return np.outer(low, below) + np.outer(high, X[2] - below)

    mesh = box_mesh(2, SIZE, layers=(0.5, 1.0), names=("muscle", "skeleton"))
    materials = {"muscle": make_law(name, *moduli[0], a0), "skeleton": make_law(name, *moduli[1], a0)}
    model = SolidModel(mesh, materials, {"muscle": ActiveStress(6.0, a0)}, hold_everywhere(exact), element=element)
    state = solve(model, [0.5, 1.0], settings=TIGHT).last
    np.testing.assert_allclose(state.u, exact(model.system.space.points), rtol=0.0, atol=CLOSE)
    area = SIZE[0] * SIZE[1]
    scale = CLOSE * moduli[1][0] * area
    np.testing.assert_allclose(state.reaction("z1"), traction * area, rtol=0.0, atol=scale)
    np.testing.assert_allclose(state.reaction("z0"), -traction * area, rtol=0.0, atol=scale)
