"""Solids that move in a medium: drag on the wetted surface, its closed forms, and the rods in the same medium.

Problem: a block that sinks, from rest to its terminal speed; a block on springs that swings; a block carried by a
    stream; a machine moved as a whole.
Exact answer: roots of ``m' g = a v + b v^2``, ``v_t tanh(g t / v_t)``, ``v_t (1 - exp(-t / tau))``; envelopes
    ``A_0 exp(-a t / 2m)`` and ``A_0 / (1 + 4 b w A_0 t / (3 pi m))`` of weak damping; the spheres of the rods.
Measured: velocity, orders in time, amplitudes at turning points, the book of energies, forces.
Tolerance: rounding for what is steady and, on meshes that keep the planes of the pillars, for the rods; declared orders
    within 0.15; the envelopes' next order, ``(b A / m)^2``.
Cannot see: whether spheres are what a medium does to a machine.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.material import NeoHooke
from fem_biobot.mesh.files import read_mesh
from fem_biobot.rod.drag import kernels
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.dynamics.drag import SurfaceDrag
from fem_biobot.solid.dynamics.integrate import solid_dynamics
from fem_biobot.solid.dynamics.motion import SolidMotion
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.medium import surface_drag
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.records import Fix, Foundation
from fem_biobot.solid.walk import walking_body
from tests.helpers import box_mesh, on_three_corners, slope

ROOT = Path(__file__).resolve().parents[2]
SIZE = (1.0, 0.8, 0.5)
VOLUME = SIZE[0] * SIZE[1] * SIZE[2]
SURFACE = 2.0 * (SIZE[0] * SIZE[1] + SIZE[1] * SIZE[2] + SIZE[0] * SIZE[2])
RHO, MEDIUM, G = 1.2e-6, 1.0e-6, 9810.0
MASS = RHO * VOLUME
LINEAR, QUADRATIC = 2e-6, 3e-7  # kPa s/mm, kg/mm^3
ORDER = {Scheme.backward_euler: 1.0, Scheme.energy_momentum: 2.0, Scheme.soft_landing: 2.0}


@cache
def block(element: str = "P1", young: float = 2e3, **more: Any) -> SolidModel:
    """A stiff block of a millimetre."""
    supports = more.pop("supports", on_three_corners(SIZE))
    return SolidModel(box_mesh(1, SIZE), {"muscle": NeoHooke(young, 0.3)}, supports=supports, element=element, **more)


def sinking(drag: SurfaceDrag, duration: float, count: int, scheme: Scheme, **more: Any) -> SolidMotion:
    """The block let go in the medium."""
    return solid_dynamics(
        block(**more), duration, duration / count, densities={"muscle": RHO}, gravity=(0.0, 0.0, -G),
        medium_density=MEDIUM, free=True, drag=drag, sample_every=count // 2, damping_time=1e-4,
        settings=DynamicsSettings(scheme, tolerance=1e-11),
    )  # fmt: skip


def velocity(motion: SolidMotion, i: int = -1) -> np.ndarray:
    """Mean velocity (3,) of a sample."""
    return motion.momentum[i] / MASS


@pytest.mark.parametrize("element", ["P1", "P2"])
@pytest.mark.parametrize(("a", "b"), [(LINEAR, 0.0), (0.0, QUADRATIC), (LINEAR, QUADRATIC)])
def test_a_sinking_block_reaches_its_terminal_speed(a: float, b: float, element: str) -> None:
    """``(rho - rho_m) V g = S (a v + b v^2)`` after forty relaxation times, by steps of two; work of the medium.

    Catches: area of half the surface, facets inside the body, a half in the square, buoyancy left out.
    """
    weight = (RHO - MEDIUM) * VOLUME * G
    top = 2.0 * weight / (SURFACE * (a + np.sqrt(a * a + 4.0 * b * weight / SURFACE)))
    tau = MASS * top / weight
    motion = sinking(SurfaceDrag(a, b), 40.0 * tau, 20, Scheme.backward_euler, element=element)
    np.testing.assert_allclose(velocity(motion), [0.0, 0.0, -top], atol=1e-8 * top)
    # in the second half it sinks steadily: the medium takes what the weight gives
    way = motion.centre_of_mass[-2, 2] - motion.centre_of_mass[-1, 2]
    assert np.diff(motion.energy("drag"))[-1] == pytest.approx(-weight * way, rel=1e-5)
    assert np.abs(motion.energy_error).max() <= 1e-7 * abs(motion.energy("drag")[-1])


@pytest.mark.parametrize("scheme", list(Scheme))
@pytest.mark.parametrize("law", ["linear", "quadratic"])
def test_the_way_to_the_terminal_speed_has_the_order_of_its_scheme(scheme: Scheme, law: str) -> None:
    """``v_t (1 - exp(-t / tau))``, or ``v_t tanh(g t / v_t)`` with the square alone, at 1.5 relaxation times.

    Catches: drag at the step's beginning or end in a scheme of the middle, a quadratic part of the mean of squares.
    """
    weight = (RHO - MEDIUM) * VOLUME * G
    if law == "linear":
        drag, top = SurfaceDrag(LINEAR), weight / (SURFACE * LINEAR)
    else:
        drag, top = SurfaceDrag(0.0, QUADRATIC), float(np.sqrt(weight / (SURFACE * QUADRATIC)))
    tau = MASS * top / weight
    wanted = top * (1.0 - np.exp(-1.5) if law == "linear" else np.tanh(1.5))
    counts = (8, 16, 32)
    speeds = [float(-velocity(sinking(drag, 1.5 * tau, n, scheme))[2]) for n in counts]
    errors = [abs(v / wanted - 1.0) for v in speeds]
    assert slope([1.0 / n for n in counts], errors) == pytest.approx(ORDER[scheme], abs=0.15)
    assert errors[-1] <= (0.05 if ORDER[scheme] == 1.0 else 2e-3)


@pytest.mark.parametrize("law", ["linear", "quadratic"])
def test_a_swinging_block_loses_amplitude_as_its_drag_says(law: str) -> None:
    """``A_0 exp(-a S t / 2m)``, and ``1 / A - 1 / A_0 = 4 b S w t / (3 pi m)`` with the square: five swings on springs.

    Catches: a quadratic part without its size, drag that also acts along a body at rest, energy booked elsewhere.
    """
    stiffness = 0.02  # kPa/mm below the block, soft against 2 MPa
    k = stiffness * SIZE[0] * SIZE[1]
    w = float(np.sqrt(k / MASS))
    begin = 0.05
    drag = (
        SurfaceDrag(0.02 * w * MASS / SURFACE) if law == "linear" else SurfaceDrag(0.0, 0.4 * MASS / SURFACE)
    )  # (b S / m) A = 0.02
    supports = (Fix("z0", "xy"), Foundation("z0", stiffness, 0.0))
    period = 2.0 * np.pi / w
    motion = solid_dynamics(
        block(supports=supports), 5.0 * period, period / 100, densities={"muscle": RHO}, drag=drag,
        velocity=(0.0, 0.0, begin * w), settings=DynamicsSettings(Scheme.energy_momentum, tolerance=1e-11),
    )  # fmt: skip
    z, t = motion.centre_of_mass[:, 2] - motion.centre_of_mass[0, 2], motion.times
    turns = [i for i in range(1, len(z) - 1) if abs(z[i]) > abs(z[i - 1]) and abs(z[i]) >= abs(z[i + 1])]
    tops = []
    for i in turns:  # of the parabola through three samples
        bend, rise = z[i - 1] - 2.0 * z[i] + z[i + 1], 0.5 * (z[i + 1] - z[i - 1])
        tops.append((t[i] - rise / bend * (t[1] - t[0]), abs(z[i] - 0.5 * rise**2 / bend)))
    times, sizes = np.array(tops).T
    assert len(times) >= 9
    if law == "linear":
        rate = np.polyfit(times, np.log(sizes), 1)[0]
        assert rate == pytest.approx(-0.5 * 0.02 * w, rel=5e-3)
    else:
        rate = np.polyfit(times, 1.0 / sizes, 1)[0]
        assert rate == pytest.approx(4.0 * 0.4 * w / (3.0 * np.pi), rel=5e-3)
    lost = motion.energy("drag")[-1]
    assert lost == pytest.approx(motion.book[-1, :3].sum() - motion.book[0, :3].sum() - motion.energy("loads")[-1]
                                 - motion.energy("integrator")[-1], rel=1e-6)  # fmt: skip
    assert abs(motion.energy("integrator")[-1]) <= 1e-6 * abs(lost)


def test_a_stream_carries_a_free_body_with_it() -> None:
    """``u + (v_0 - u) exp(-t / tau)`` in a stream askew to it, and nothing else moves it.

    Catches: the stream with the wrong sign, drag against rest.
    """
    stream, begin = np.array([3.0, -1.0, 0.5]), np.array([-2.0, 4.0, 1.0])
    tau = MASS / (SURFACE * LINEAR)
    motion = solid_dynamics(
        block(), 2.0 * tau, tau / 50, densities={"muscle": RHO}, free=True, velocity=tuple(begin),
        drag=SurfaceDrag(LINEAR, velocity=tuple(stream)), settings=DynamicsSettings(Scheme.energy_momentum),
    )  # fmt: skip
    wanted = stream + (begin - stream) * np.exp(-motion.times[:, None] / tau)
    np.testing.assert_allclose(motion.momentum / MASS, wanted, atol=1e-3)
    assert np.abs(motion.angular_momentum[-1] - np.cross(motion.centre_of_mass[-1], motion.momentum[-1])).max() <= 1e-8


@pytest.mark.parametrize("preset", ["junction_bot", "ring_bot"])
def test_rods_and_solid_are_dragged_alike(preset: str) -> None:
    """One key: as a whole both machines resist alike, slowly and fast, along each axis, and sink alike.

    Catches: the whole machine as one sphere, a part without
    drag, the medium's density or viscosity of one of the two, surfaces inside the body.
    """
    keys = ["ground.immersion=submerged", "ground.viscosity=0.8 mPa s", "ground.medium_density=1e-3 g/mm^3"]
    design = load_design(preset, keys)
    body = walking_body(design, read_mesh(ROOT / "meshes" / f"{preset}_small.msh"))
    assert body.drag is not None
    model = reduce(design)
    lumps = model.assembly.drag
    for v in np.array([[1e-4, 0.0, 0.0], [0.0, 2e-4, 1e-4], [40.0, 0.0, 0.0], [0.0, -30.0, 60.0]]):
        n = body.system.space.n_nodes
        solid = body.drag.force(np.tile(v, (n, 1))).sum(axis=0)
        nodes = len(model.drawn().x)
        force = np.zeros((nodes, 6))
        kernels.add_drag(lumps, model.drawn().Q, np.tile([*v, 0.0, 0.0, 0.0], (nodes, 1)), force)
        np.testing.assert_allclose(solid, force[:, :3].sum(axis=0), rtol=1e-9, atol=1e-12 * np.abs(force).max())
    assert surface_drag(load_design(preset), body.model) is None
