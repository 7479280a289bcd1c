"""Twist of a circular cylinder between two plates.

Problem: bar bonded to plates that turn against each other about its axis at a fixed distance.
Exact answer: small twist, M = G I_p theta / L at every Poisson's ratio (Saint-Venant); incompressible neo-Hooke at any
twist tau per length, M = mu I_p tau and an axial force N = -mu I_p tau^2 / 2, the plates pushed apart (Rivlin 1949:
M = pi mu tau a^4 / 2, N = -pi mu tau^2 a^4 / 4). Free to lengthen, it does (Poynting 1909).
Measured: reaction moment and axial reaction of a plate; the length of the free bar.
Tolerance: I_p is that of the mesh's own section, a polygon of 24 sides; 0.1 % of the moment and 0.3 % of the force are
left.
Cannot see: a moment that is wrong by a factor common to both ends.
"""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.material import NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Fix, Rotate, Symmetry
from tests.helpers import box_mesh

RADIUS, LENGTH = 1.3, 2.6
AXIS = (0.0, 0.0, 1.0)
CENTRE = (0.4, -0.2, 0.0)


def _cylinder() -> BodyMesh:
    """A square of six by six cells drawn out to a disc, in six layers; straight edges."""
    mesh = box_mesh((6, 6, 6), shift=0.0)
    a, b = 2.0 * mesh.points[:2] - 1.0
    x, y = a * np.sqrt(1.0 - 0.5 * b**2), b * np.sqrt(1.0 - 0.5 * a**2)
    points = np.array([RADIUS * x + CENTRE[0], RADIUS * y + CENTRE[1], LENGTH * mesh.points[2]])
    return BodyMesh(points, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks).checked()


MESH = _cylinder()


def _polar_moment() -> float:
    """Second moment of the mesh's section about the axis [mm^4]: exact for linear triangles of the end."""
    x, y = MESH.points[:2, MESH.surfaces["z0"]] - np.array(CENTRE[:2])[:, None, None]
    area = 0.5 * np.abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    mixed = x[0] * x[1] + x[1] * x[2] + x[2] * x[0] + y[0] * y[1] + y[1] * y[2] + y[2] * y[0]
    return float(np.sum(area / 6.0 * (np.sum(x**2 + y**2, axis=0) + mixed)))


IP = _polar_moment()


def _twisted(law: NeoHooke, angle: float, element: str, advance: float | None = 0.0) -> SolidState:
    plates = [Fix("z0") if advance is not None else Symmetry("z0"), Rotate("z1", AXIS, CENTRE, angle, advance=advance)]
    if advance is None:
        plates[0] = Rotate("z0", AXIS, CENTRE, 0.0, advance=0.0)
    return solve(SolidModel(MESH, {"muscle": law}, supports=plates, element=element)).last


def test_a_small_twist_takes_the_moment_of_saint_venant() -> None:
    """M = G I_p theta / L, at a Poisson's ratio of 0.3; the other end takes minus that, nothing acts across the axis.

    Catches: E in place of G, the second moment about a diameter, the angle in degrees.
    """
    law, theta = NeoHooke(12.0, 0.3), 1e-4
    assert pytest.approx(np.pi * RADIUS**4 / 2.0, rel=0.05) == IP
    state = _twisted(law, theta, "P2")
    moment = state.reaction_moment("z1", CENTRE)
    assert moment[2] == pytest.approx(law.mu * IP * theta / LENGTH, rel=0.01)
    np.testing.assert_allclose(state.reaction_moment("z0", CENTRE), -moment, atol=1e-9 * moment[2])
    assert np.abs(moment[:2]).max() < 1e-3 * moment[2]
    assert np.abs(state.reaction("z1")).max() < 1e-3 * moment[2]


@pytest.mark.parametrize("theta", [1.0, 2.2])
def test_a_large_twist_of_an_incompressible_bar_is_rivlins(theta: float) -> None:
    """M = mu I_p tau and N = -mu I_p tau^2 / 2 at 57 and 126 degrees; half the layers of elements leave ten times more.

    Catches: displacements scaled in place of the angle, a moment with arms of the reference body, the sign of the
    axial force.
    """
    law = NeoHooke(12.0, 0.5)
    state, tau = _twisted(law, theta, "P2-P1"), theta / LENGTH
    assert state.reaction_moment("z1", CENTRE)[2] == pytest.approx(law.mu * IP * tau, rel=0.002)
    assert state.reaction("z1")[2] == pytest.approx(-0.5 * law.mu * IP * tau**2, rel=0.005)


def test_a_bar_free_to_lengthen_does_with_the_square_of_the_twist() -> None:
    """The Poynting effect: the mean of the free plate moves outwards, four times as far for twice the angle.

    Catches: the plate held along the axis; a plate that is drawn in.
    """
    rises = []
    for theta in (0.25, 0.5):
        state = _twisted(NeoHooke(12.0, 0.5), theta, "P2-P1", advance=None)
        top = np.unique(MESH.surfaces["z1"])
        assert abs(state.reaction("z1")[2]) < 1e-9
        rises.append(float(state.u[2, top].mean()))
    assert rises[0] > 0.0
    assert rises[1] / rises[0] == pytest.approx(4.0, rel=0.05)
