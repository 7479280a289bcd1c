"""Thick incompressible tube under a pressure that follows its inner wall.

Problem: quarter of a tube, radii 1 and 2 mm, plane strain by symmetry planes, incompressible neo-Hooke.
Exact answer: r^2 = R^2 + c, p = mu int (r^2/R^2 - R^2/r^2) dr / r over the wall (Rivlin 1949), by quadrature; c from p.
Measured: radial displacement of inner and outer wall.
Tolerance: straight-sided elements follow a circle to h^2: the error falls with that, and is bounded.
Cannot see: an edge that is free (the symmetry planes hold it).
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from fem_biobot.material import NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Pressure, Symmetry
from tests.helpers import box_mesh, slope

INNER, OUTER, MU = 1.0, 2.0, 4.0
PRESSURE = 1.6  # kPa: the bore grows by a quarter


def _tube(n: int) -> BodyMesh:
    """``n`` cells through the wall, as many along the quarter; x0 the bore, y0 and y1 the planes of symmetry."""
    mesh = box_mesh((n, n, 1), shift=0.0)
    radius, angle = INNER + (OUTER - INNER) * mesh.points[0], 0.5 * np.pi * mesh.points[1]
    points = np.array([radius * np.cos(angle), radius * np.sin(angle), mesh.points[2] / n])
    points[np.abs(points) < 1e-14] = 0.0
    return BodyMesh(points, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks).checked()


def _inflated(p: float) -> float:
    """``c`` of the exact answer."""

    def excess(c: float) -> float:
        inside, outside = (np.sqrt(R**2 + c) for R in (INNER, OUTER))
        return quad(lambda r: MU * (r**2 / (r**2 - c) - (r**2 - c) / r**2) / r, inside, outside, epsabs=1e-13)[0] - p

    return float(brentq(excess, 0.0, 10.0, xtol=1e-14))


def _errors(n: int) -> tuple[float, float]:
    """Of the radial displacement at bore and outer wall [mm]."""
    model = SolidModel(
        _tube(n),
        {"muscle": NeoHooke(3.0 * MU, 0.5)},
        supports=[Symmetry(face) for face in ("y0", "y1", "z0", "z1")],
        loads=[Pressure("x0", PRESSURE)],
        element="P2-P1",
    )
    assert model.system.symmetric
    found = solve(model)
    assert found.halvings == 0
    c = _inflated(PRESSURE)
    exact = [np.sqrt(R**2 + c) - R for R in (INNER, OUTER)]
    assert exact[0] > 0.2
    ours = [found.at((R, 0.0, 0.0))[0] for R in (INNER, OUTER)]
    return abs(ours[0] - exact[0]), abs(ours[1] - exact[1])


def test_the_tube_inflates_by_the_closed_form() -> None:
    """Both walls move as r^2 = R^2 + c wants, to an error that falls with h^2.

    Catches: a dead pressure (a tenth less), a pressure per reference area, a bore pushed inwards.
    """
    errors = np.array([_errors(n) for n in (3, 6)])
    assert np.all(errors[-1] < [5e-3, 4e-3])
    for column in errors.T:
        assert slope([1 / 3, 1 / 6], list(column)) > 1.8
