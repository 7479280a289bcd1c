"""Solids in motion without a ground: what is kept, how fast they swing, and the order of the schemes.

Problem: a tumbling soft block; a cantilever let go; the same over ever shorter steps.
Exact answers: conservation of momentum, angular momentum and energy; natural frequencies of the static tangent with the
    consistent mass (`solid.modes`); the declared orders, one and two.
Measured: momenta and the book of energies of `solid_dynamics`; zero crossings; errors against a run of many steps.
Tolerance: conservation up to the tolerance of the steps (1e-12 of the forces); the frequency 0.2 % (a step of a 60th
    of the period, order two: 0.1 %); orders within 0.15.
Cannot see: contact, pressures.
"""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest

from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.solid.dynamics.integrate import rigid_velocity, solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidMotion
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.model import SolidModel, SolidState
from fem_biobot.solid.modes import modes
from fem_biobot.solid.records import Fix, Step
from tests.helpers import box_mesh, on_three_corners, slope

SIZE = (1.0, 0.8, 0.6)
DENSITY = {"muscle": 1.1e-6}
TIGHT = 1e-11
MIDDLE = DynamicsSettings(Scheme.energy_momentum, tolerance=TIGHT)


@cache
def _block(element: str = "P2") -> SolidModel:
    tension = ActiveStress(0.05, np.array([0.6, 0.8, 0.0]))
    return SolidModel(
        box_mesh(1 if element == "P2" else 2, SIZE),
        {"muscle": NeoHooke(0.5, 0.3)},
        {"muscle": tension},
        supports=on_three_corners(SIZE),
        element=element,
    )


def _tumbling(settings: DynamicsSettings, **more: object) -> SolidMotion:
    model = _block()
    velocity = rigid_velocity(model, (1.0, 2.0, -3.0), (40.0, 25.0, -60.0), (0.1, 0.3, 0.2))
    return solid_dynamics(
        model,
        0.06,
        2e-3,
        densities=DENSITY,
        free=True,
        velocity=velocity,
        settings=settings,
        **more,  # type: ignore[arg-type]
    )


def test_free_flight_keeps_momentum_angular_momentum_and_energy() -> None:
    """A soft block tumbles through more than half a turn; the mean strain's stress keeps all three.

    Catches: internal forces at the end of the step, a correction of the wrong size, mass lumped in one place.
    """
    found = _tumbling(MIDDLE)
    size = np.linalg.norm(found.angular_momentum[0])
    assert np.abs(found.momentum - found.momentum[0]).max() <= 1e-10 * np.linalg.norm(found.momentum[0])
    assert np.abs(found.angular_momentum - found.angular_momentum[0]).max() <= 1e-7 * size
    energy = found.energy("kinetic") + found.energy("strain")
    assert found.energy("strain").max() > 1e-5 * energy[0]
    assert np.abs(energy - energy[0]).max() <= 1e-8 * energy[0]


def test_muscle_inside_a_free_body_changes_no_momentum() -> None:
    """The muscle contracts in flight: momenta stay, its work is in the book, and the book closes.

    Catches: active stress left out of the force's balance, its work entered with the wrong sign.
    """
    found = _tumbling(MIDDLE, drive=lambda t: 10.0 * t, damping_time=2e-4)
    size = np.linalg.norm(found.angular_momentum[0])
    assert np.abs(found.angular_momentum - found.angular_momentum[0]).max() <= 1e-7 * size
    work = found.energy("muscle")
    assert work[-1] > 1e-3 * found.book[0, 0]
    assert found.energy("viscous")[-1] < 0.0
    assert np.abs(found.energy_error).max() <= 1e-7 * np.abs(work).max()


def test_backward_euler_tells_what_it_takes() -> None:
    """It takes energy from the tumbling, all of which its own entry shows; linear momentum stays.

    Catches: dissipation that is booked as what is left over, an entry without the stress's part.
    """
    found = _tumbling(DynamicsSettings(tolerance=TIGHT), drive=lambda t: 10.0 * t, damping_time=2e-4)
    assert np.abs(found.momentum - found.momentum[0]).max() <= 1e-10 * np.linalg.norm(found.momentum[0])
    lost = found.energy("integrator")
    assert lost[-1] < -0.01 * found.book[0, 0]
    assert np.all(np.diff(lost) < 0.0)
    assert np.abs(found.energy_error).max() <= 1e-7 * abs(lost[-1])


def test_cantilever_swings_with_its_natural_frequency() -> None:
    """Let go from its first mode it crosses zero at the frequency that the static tangent and mass give.

    Catches: mass that is half or lumped, a step's length squared where it is not.
    """
    model = SolidModel(
        box_mesh((1, 1, 4), (1.0, 0.8, 6.0), shift=0.0), {"muscle": NeoHooke(100.0, 0.3)}, supports=[Fix("z0")]
    )
    rest = SolidState(model, Step(0.0, 0.0), np.zeros_like(model.system.space.points))
    first = modes(rest, DENSITY, 1)
    shape = first.shapes[0] / np.abs(first.shapes[0]).max()
    period = 1.0 / first.frequencies[0]
    start = SolidState(model, Step(0.0, 0.0), 1e-3 * shape)
    found = solid_dynamics(
        model, 1.5 * period, period / 60.0, densities=DENSITY, start=start,
        settings=DynamicsSettings(Scheme.energy_momentum, tolerance=1e-9),
    )  # fmt: skip
    tip = np.einsum("sin,in->s", found.u, shape)
    crossing = [
        found.times[k] - tip[k] * (found.times[k + 1] - found.times[k]) / (tip[k + 1] - tip[k])
        for k in np.flatnonzero(tip[1:] * tip[:-1] < 0.0)
    ]
    assert len(crossing) == 3
    assert 2.0 * (crossing[2] - crossing[0]) / 2.0 == pytest.approx(period, rel=2e-3)


@pytest.mark.parametrize(
    ("scheme", "declared"),
    [(Scheme.backward_euler, 1.0), (Scheme.energy_momentum, 2.0), (Scheme.soft_landing, 2.0)],
)
def test_schemes_have_their_orders(scheme: Scheme, declared: float) -> None:
    """The error of a damped, driven motion falls with the declared power of the step.

    Catches: drive taken at the wrong instant, viscosity of the wrong step, a velocity that is that of the chord.
    """
    model = _block("P1")

    def end(n: int) -> np.ndarray:
        found = solid_dynamics(
            model, 0.02, 0.02 / n, densities=DENSITY, gravity=(0.0, 50.0, -9810.0), damping_time=3e-4, sample_every=n,
            drive=lambda t: np.sin(150.0 * t) ** 2, settings=DynamicsSettings(scheme, tolerance=1e-10),
        )  # fmt: skip
        return found.u[-1]

    counts = [100, 200, 400] if scheme is Scheme.backward_euler else [20, 40, 80]
    ends = [end(n) for n in (*counts, 2 * counts[-1])]
    errors = [np.linalg.norm(a - b) for a, b in itertools.pairwise(ends)]
    assert slope([1.0 / n for n in counts], errors) == pytest.approx(declared, abs=0.15)
