"""S1, continued: active stress and active strain agree in free contraction and part in shear.

Problem: a cube of neo-Hooke contracted along x at constant volume to the stretch s of its tension, then sheared by k,
    across its fibres (u_y = k x) or along them (u_x = k y), displacement given on its whole boundary.
Exact answer: shear components of tau = mu (b - I) + T a x a s' (nominal, s' the stretch of the sheared fibre) and of
    tau = mu s b + mu (s^-2 - s) F a0 x F a0 (active strain): mu k s^2 + T s k / sqrt(1 + k^2) against mu k, and
    mu k / s against mu k. Pressure does not enter a shear component.
Measured: reactions on the faces, against the traction P N of these stresses.
Tolerance: 1e-10 of mu; rounding, the field is linear.
Cannot see: which of the two muscle is.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.model import SolidModel, solve
from tests.helpers import TIGHT, box_mesh, hold_everywhere
from tests.oracles.free_muscle import incompressible_stretch

LAW = NeoHooke(11.0, 0.3)
TENSION_OVER_MU, SHEAR = 0.8, 0.4
S = incompressible_stretch(TENSION_OVER_MU)


def _shear_stress(convention: str, F: np.ndarray, row: int, column: int) -> float:
    """Component of the Kirchhoff stress of the cube under `F`, from the reactions of three faces."""
    model = SolidModel(
        box_mesh(2),
        {"muscle": LAW},
        {"muscle": ActiveStress(TENSION_OVER_MU * LAW.mu, np.array([1.0, 0.0, 0.0]), convention)},
        hold_everywhere(lambda X: (F - np.eye(3)) @ X),
    )
    state = solve(model, settings=TIGHT).last
    # sum of reaction times reference position over a unit cube is the first Piola stress
    P = state.internal_force @ model.system.space.points.T
    return float((P @ F.T)[row, column])


@pytest.mark.parametrize("k", [0.0, SHEAR])
def test_shear_across_the_fibres_meets_other_stresses(k: float) -> None:
    """Sheared so that the fibres turn, the two resist by their closed forms; at k = 0 neither does.

    Catches: active strain that contracts the fibre term only; a fibre tension that does not turn with its fibre.
    """
    F = np.array([[1.0, 0.0, 0.0], [k, 1.0, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([S, S**-0.5, S**-0.5])
    mu = LAW.mu
    nominal = mu * k * S**2 + TENSION_OVER_MU * mu * S * k / np.sqrt(1.0 + k**2)
    assert _shear_stress("nominal", F, 0, 1) == pytest.approx(nominal, abs=1e-10 * mu)
    assert _shear_stress("active_strain", F, 0, 1) == pytest.approx(mu * k, abs=1e-10 * mu)
    assert k == 0.0 or nominal > 1.1 * mu * k


@pytest.mark.parametrize("k", [0.0, SHEAR])
def test_shear_along_the_fibres_meets_a_softer_matrix(k: float) -> None:
    """Sheared along the fibres the contracted matrix resists by mu k, the merely pulled one by mu k / s.

    Catches: a natural state that is not contracted across (s for s^(-1/2)).
    """
    F = np.array([[1.0, k, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([S, S**-0.5, S**-0.5])
    mu = LAW.mu
    assert _shear_stress("nominal", F, 0, 1) == pytest.approx(mu * k / S, abs=1e-10 * mu)
    assert _shear_stress("active_strain", F, 0, 1) == pytest.approx(mu * k, abs=1e-10 * mu)
