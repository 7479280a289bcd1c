"""Masses and rotary inertias of a machine's parts as the solid's mesh has them, on the nodes of its rods."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.observed import Array, Ints
from fem_biobot.link.strip import STRIP
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Rigid

PILLARS = ("pillar_short", "pillar_long")
# points and equal weights of a rule for tetrahedra that is exact for squares: a Gauss point beside each corner
_NEAR, _FAR = (5.0 + 3.0 * 5.0**0.5) / 20.0, (5.0 - 5.0**0.5) / 20.0
_RULE = _FAR + (_NEAR - _FAR) * np.eye(4)


@dataclass(frozen=True)
class Cloud:
    """Points (3, p) [mm] with volumes (p,) [mm^3] that have the volume, centre and second moments of tetrahedra."""

    X: Array
    volume: Array

    def body(self, density: float, name: str, chosen: NDArray[np.bool_]) -> Body:
        """Those of the points that are chosen, as a rigid body."""
        X, mass = self.X[:, chosen], density * self.volume[chosen]
        centre = X @ mass / mass.sum()
        arm = X - centre[:, None]
        second = np.einsum("ip,jp,p->ij", arm, arm, mass)
        x, y, z = (float(c) for c in centre)
        volume = float(self.volume[chosen].sum())
        return Body((x, y, z), float(mass.sum()), np.trace(second) * np.eye(3) - second, name, volume)


def cloud(mesh: BodyMesh, region: str) -> Cloud:
    """Quadrature points of the elements of a region."""
    elements: Ints = mesh.regions[region]
    corners = mesh.points[:, mesh.cells[:, elements]]  # (3, 4, e)
    points = np.einsum("ice,qc->iqe", corners, _RULE).reshape(3, -1)
    return Cloud(points, np.tile(mesh.volumes[elements] / 4.0, 4))


def with_masses(model: RodModel, design: Design, mesh: BodyMesh) -> RodModel:
    """A reduced model of two pillars with the masses of a mesh: of pillars, of the beam at its nodes, of the tissue.

    Parameters
    ----------
    model
        From `reduce`, also with sections or a junction from the mesh.
    design, mesh
        What it is of.

    Raises
    ------
    ModelError
        A mesh too coarse for the nodes of the beam.

    Notes
    -----
    Rotary inertia of the beam is that of its mass: sections with stiffness from a mesh have moments of area that are no
    longer those of a rectangle. A junction that is a rod has the mass of its own section between the rings, and the
    bodies ``ring_short`` and ``ring_long`` are the rest of the muscle; a muscle between two points leaves the tissue
    where `reduce` puts it.
    """
    gel, half = cloud(mesh, "skeleton"), design.span / 2
    density = design.value("skeleton.material.density")
    beam = model.rods[0]
    x = beam.points[:, 0]
    outside = np.abs(gel.X[0]) > half
    nearest = np.abs(gel.X[0] - x[:, None]).argmin(axis=0)
    bodies = {body.name: body for body in model.bodies}
    for name, side in zip(PILLARS, (-1.0, 1.0), strict=True):
        own = gel.body(density, name, outside & (side * gel.X[0] > 0.0))
        bodies[name] = replace(own, boxes=bodies[name].boxes)
    bare = np.setdiff1d(np.arange(len(x)), nearest[~outside])
    if len(bare):
        raise ModelError(
            f"mesh: found no gel next to x = {x[bare[0]]:.4g} mm, expected some at each of the {len(x)} nodes of "
            f"{beam.name} (a finer mesh)"
        )
    pieces = [gel.body(density, f"{beam.name}_{i}", ~outside & (nearest == i)) for i in range(len(x))]
    joints = [*model.joints, *(Rigid((beam.name, i), (piece.name, piece.centre)) for i, piece in enumerate(pieces))]
    rods = [replace(beam, mass=0.0)]
    for rod in model.rods[1:]:
        if rod.name != STRIP:
            rods.append(rod)
            continue
        inside = half - design.value("muscle.ring_thickness")
        tissue = cloud(mesh, "muscle")
        for name, side in (("ring_short", -1.0), ("ring_long", 1.0)):
            own = tissue.body(design.value("muscle.material.density"), name, side * tissue.X[0] > inside)
            bodies[name] = replace(own, boxes=bodies[name].boxes)
        middles = 0.5 * (rod.points[1:, 0] + rod.points[:-1, 0])
        rods.append(replace(rod, mass=[float(abs(m) < inside) for m in middles]))
    # bodies that are fixed to each other are found by a point of theirs: those of the new ones
    moved = {name: body.centre for name, body in bodies.items()}
    joints = [_at_centre(joint, moved) if isinstance(joint, Rigid) else joint for joint in joints]
    parts = (model.supports, model.loads, model.members, model.contacts)
    every = [*bodies.values(), *pieces]
    return RodModel(rods, joints, every, *parts, model.damping_time, model.touches, model.landmarks)


def _at_centre(joint: Rigid, centres: dict[str, tuple[float, float, float]]) -> Rigid:
    """The joint of two bodies by their own centres; any other as it is."""
    (a, at_a), (b, at_b) = joint.a, joint.b
    if a in centres and b in centres and not isinstance(at_a, int) and not isinstance(at_b, int):
        return Rigid((a, centres[a]), (b, centres[b]))
    return joint
