"""What the medium of a design does to the surface of its solid: the drag of a sphere for each part, spread over it."""

from __future__ import annotations

import numpy as np

from fem_biobot.design import Design
from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.drag import SurfaceDrag, drag_term
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.space import Ints

# drag coefficient of a smooth sphere on its disc at Reynolds numbers from 1e3 to 1e5
_SPHERE = 0.44


def surface_drag(design: Design, model: SolidModel) -> SurfaceDrag | None:
    """Drag on the wetted surface of a submerged bot with a ``ground.viscosity``; None without one.

    Notes
    -----
    The machine is cut at the planes of the pillars' inner faces into pillars and bays. Each part has the drag of a
    sphere of its volume, linear after Stokes (1851) and quadratic with a coefficient of 0.44 on its disc,
    ``6 pi mu R v + rho C pi R^2 / 2 |v| v``, an assumption about the size, not the shape, and the same that the rods
    make; it is spread evenly over what of the whole boundary lies between the part's planes, soles included. The
    tissue's volume counts with the nearest pillar, that of a bay is its beam.

    On a sphere in Stokes flow the traction is the same everywhere, ``3 mu v / (2 R)``; on a plate it is not. The
    ground's nearness is left out.
    """
    viscosity = design.ground.viscosity
    if viscosity is None:
        return None
    space, mesh = model.system.space, model.mesh
    bays = _Parts(design)
    X = space.quadrature_points
    inside = bays.of(X)
    tissue = mesh.regions["muscle"]
    inside[tissue] = bays.pillar_of(X[:, tissue])
    volume = np.bincount(inside.ravel(), weights=space.dV.ravel(), minlength=bays.count)
    # areas by the very points at which the traction acts
    wetted = drag_term(SurfaceDrag(1.0), mesh, model.system)
    on = bays.of(wetted.facets.positions(np.ascontiguousarray(space.points.T)))
    area = np.bincount(on.ravel(), weights=wetted.linear.ravel(), minlength=bays.count)
    radius = np.cbrt(0.75 * volume / np.pi)
    linear = 6.0 * np.pi * viscosity * radius / area
    quadratic = design.ground.medium_density * _SPHERE * np.pi * radius**2 / (2.0 * area)
    return SurfaceDrag(lambda at: linear[bays.of(at)], lambda at: quadratic[bays.of(at)])


class _Parts:
    """Pillars 0, 2, 4, ... and bays 1, 3, ... from the short to the long pillar, by the position along x."""

    def __init__(self, design: Design) -> None:
        half = design.value("skeleton.pillar_length") / 2.0
        self.centres = np.array([x for x, _ in design.pillars])
        self.planes = np.sort(np.concatenate([self.centres[:-1] + half, self.centres[1:] - half]))
        self.count = 2 * len(self.centres) - 1

    def of(self, X: Array) -> Ints:
        """Number of the part at positions (3, ...), (...)."""
        return np.searchsorted(self.planes, X[0])

    def pillar_of(self, X: Array) -> Ints:
        """Number of the nearest pillar, (...)."""
        return 2 * np.searchsorted(0.5 * (self.centres[1:] + self.centres[:-1]), X[0])
