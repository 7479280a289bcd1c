"""Natural frequencies of bars and beams, held, free and under load.

Problem: slender bars of neo-Hooke at rest or under an end load, with consistent mass.
Exact answer: axial w = pi/2 sqrt(E/rho)/L (held at one end) and pi sqrt(E/rho)/L (free), exact at nu = 0; bending roots
    of cos cosh = -1 and = 1 with Timoshenko's correction; under an end load the beam-column's own equation.
Measured: the lowest frequencies, by displacement and mixed elements.
Tolerance: axial 1e-6 (discretisation, falls with h^4); bending 1.5 % (sections that warp are no beam's); the share
    under load 0.005.
Cannot see: damping, mass that is lumped, plates.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.material import NeoHooke
from fem_biobot.solid.model import SolidModel, SolidState, buckling, solve
from fem_biobot.solid.modes import modes
from fem_biobot.solid.records import Fix, Step, Traction
from tests.helpers import box_mesh, slope

E, RHO, LENGTH, WIDTH, HEIGHT = 100.0, 1e-6, 10.0, 1.0, 0.8


def _bar(n: int, poisson: float = 0.0, element: str = "P2", load: float = 0.0) -> SolidModel:
    return SolidModel(
        box_mesh((1, 1, n), (WIDTH, HEIGHT, LENGTH), shift=0.0),
        {"muscle": NeoHooke(E, poisson)},
        # a clamp that lets the section widen
        supports=[Fix("z0", "z"), Fix((0.0, 0.0, 0.0), "xy"), Fix((WIDTH, 0.0, 0.0), "y")],
        loads=[Traction("z1", (0.0, 0.0, load))] if load else [],
        element=element,
    )


def _rest(model: SolidModel) -> SolidState:
    return SolidState(model, Step(0.0, 0.0), np.zeros_like(model.system.space.points))


def _nearest(found: np.ndarray, wanted: float) -> float:
    """The frequency nearest to the one wanted, as a share of it."""
    return float(found[np.nanargmin(np.abs(found - wanted))] / wanted)


def _bending(root: float, poisson: float = 0.0, *, thickness: float = HEIGHT) -> float:
    """Timoshenko beam to first order in (thickness / length)^2 [Hz]; `root` of the slender beam."""
    area, inertia = WIDTH * HEIGHT, WIDTH * HEIGHT * thickness**2 / 12.0
    euler = root**2 / LENGTH**2 * np.sqrt(E * inertia / (RHO * area))
    shear = 2.0 * (1.0 + poisson) * 6.0 / 5.0
    return float(euler / (2.0 * np.pi) * (1.0 - 0.5 * (root / LENGTH) ** 2 * inertia / area * (1.0 + shear)))


def test_axial_frequencies_of_a_bar_are_exact() -> None:
    """Held at one end sqrt(E/rho) / 4 L, free sqrt(E/rho) / 2 L; the error falls with the fourth power.

    Catches: a lumped or wrong mass, frequencies in rad/s, half of the modes missed.
    """
    wave = np.sqrt(E / RHO)
    held = [modes(_rest(_bar(n)), {"muscle": RHO}, 8).frequencies for n in (6, 12)]
    errors = [abs(_nearest(f, wave / (4.0 * LENGTH)) - 1.0) for f in held]
    assert errors[1] < 1e-6
    assert slope([1 / 6, 1 / 12], errors) == pytest.approx(4.0, abs=0.3)
    free = modes(_rest(_bar(6)), {"muscle": RHO}, 14, free=True).frequencies
    assert np.all(free[:6] == 0.0)
    assert _nearest(free, wave / (2.0 * LENGTH)) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize(("element", "poisson"), [("P2", 0.0), ("P2-P1", 0.3), ("P2-P1", 0.5)])
def test_a_cantilever_swings_as_a_beam(element: str, poisson: float) -> None:
    """The first bending frequencies of both planes, held and free, are a Timoshenko beam's.

    Catches: locking (too high), a mixed element whose pressures carry mass.
    """
    state = _rest(_bar(12, poisson, element))
    held = modes(state, {"muscle": RHO}, 4).frequencies
    for thickness in (HEIGHT, WIDTH):
        assert _nearest(held, _bending(1.8751040687, poisson, thickness=thickness)) == pytest.approx(1.0, abs=0.015)
    free = modes(state, {"muscle": RHO}, 8, free=True).frequencies
    assert free[5] == 0.0
    assert free[6] / _bending(4.7300407449, poisson) == pytest.approx(1.0, abs=0.015)


def _share_under_load(share: float) -> float:
    """Squared lowest frequency of a slender clamped-free column under a share of its dead buckling load, of its own.

    Solutions of EI d4w + P d2w = rho A omega^2 w over a unit length, clamped below, d2w = EI d3w + P dw = 0 above.
    """
    k2 = share * np.pi**2 / 4.0

    def determinant(m: float) -> float:
        root = np.sqrt(k2**2 + 4.0 * m**4)
        a, b = np.sqrt(0.5 * (root - k2)), np.sqrt(0.5 * (root + k2))
        sinh, cosh, sin, cos = np.sinh(a), np.cosh(a), np.sin(b), np.cos(b)
        # w = A (cosh a z - cos b z) + B (sinh a z - a/b sin b z)
        bent = a**2 * cosh + b**2 * cos, a**2 * sinh + a * b * sin
        sheared = (
            a**3 * sinh - b**3 * sin + k2 * (a * sinh + b * sin),
            a**3 * cosh + a * b**2 * cos + k2 * a * (cosh - cos),
        )
        return bent[0] * sheared[1] - bent[1] * sheared[0]

    return float((brentq(determinant, 0.3, 2.5, xtol=1e-12) / 1.8751040687) ** 4)


@pytest.mark.parametrize(("element", "poisson"), [("P2", 0.0), ("P2-P1", 0.5)])
def test_the_square_falls_to_zero_at_the_buckling_load(element: str, poisson: float) -> None:
    """Under half of its critical load a column's squared frequency is 0.520 of the unloaded one's, as a beam's.

    Two problems that share little agree: the buckling factor extrapolated from the unloaded column, and frequencies of
    the loaded one. Catches: modes about the undeformed body only, a buckling factor of another mode.
    """
    assert _share_under_load(0.0) == pytest.approx(1.0, abs=1e-9)
    assert _share_under_load(0.9) == pytest.approx(0.1, abs=0.02)
    model = _bar(10, poisson, element, load=-1.0)
    rest = _rest(model)
    found = buckling(rest, Step(1.0, 0.0))
    assert found is not None
    critical = found.step.load
    half = solve(model, [Step(0.5 * critical)]).last
    squares = [modes(state, {"muscle": RHO}, 1).squares[0] for state in (rest, half)]
    assert squares[1] / squares[0] == pytest.approx(_share_under_load(0.5), abs=0.005)
