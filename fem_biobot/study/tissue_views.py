"""Interactive views of a muscle on its mesh: which way its fibres run, how much oxygen reaches it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.oxygenation import Oxygenation
from fem_biobot.view.interactive import Coloured, Moving
from fem_biobot.view.machine import GEL, MUSCLE, Machine
from fem_biobot.vtk import boundary_surface

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_MOST_GLYPHS = 2500
# of the size of an element: length of a glyph, and how far it floats above the surface
_LENGTH, _ABOVE = 0.7, 0.02


def fibres_view(mesh: BodyMesh, a0: Array, *, title: str = "Fibres of the muscle") -> Moving:
    """The body, its muscle coloured by the direction of its fibres, which are drawn on its faces.

    Parameters
    ----------
    mesh
        The body.
    a0
        Unit directions in the elements of muscle, (3, e) in the order of ``mesh.regions["muscle"]``.
    title
        Of the view.
    """
    machine = Machine(mesh.points, mesh.cells, dict(mesh.regions))
    angle = np.full(mesh.n_elements, np.nan)
    # their sense means nothing
    angle[mesh.regions["muscle"]] = np.degrees(np.arccos(np.clip(np.abs(a0[0]), 0.0, 1.0)))
    parts, points, triangles, part = _regions(machine, mesh)
    values = machine.nodal(angle, muscle_only=True)
    values[~machine.of_muscle] = np.nan
    ends = _glyphs(mesh, a0)
    n = points.shape[1]
    lines = np.arange(ends.shape[1]).reshape(-1, 2).T + n
    return Moving(
        title,
        np.hstack([points, ends])[None],
        triangles,
        np.concatenate([part, np.full(ends.shape[1], len(parts))]),
        {**parts, "directions": "#1f2429"},
        ["as moulded"],
        edges=np.hstack([machine.edges, lines]),
        fields=[
            Coloured(
                "angle between fibres and x [deg]",
                np.concatenate([values, np.full(ends.shape[1], np.nan)]),
                (0.0, 90.0),
                "viridis",
            )
        ],
        caption="Short lines on the muscle's faces: directions of its elements' fibres. To scale.",
    )


def oxygen_view(found: Oxygenation, *, title: str = "Oxygen in the muscle") -> Moving:
    """The tissue in two halves of which one can be left out, to look at the oxygen in the middle section.

    Where the mesh has the section x = 0 the cut is plane, else it goes between elements.
    """
    basis = found.field.basis
    cells = np.asarray(basis.mesh.t)[:, found.tissue]
    used, numbers = np.unique(cells, return_inverse=True)
    points, cells = np.asarray(basis.mesh.p)[:, used], numbers.reshape(cells.shape)
    c = np.maximum(found.field.c[np.asarray(basis.nodal_dofs)[0]], 0.0)[used]
    alive = np.zeros(used.size)
    count = np.zeros(used.size)
    for row in cells:
        np.add.at(alive, row, found.field.viable()[found.tissue])
        np.add.at(count, row, 1.0)
    right = points[0, cells].mean(axis=0) > 0.0
    halves = [(name, cells[:, side]) for name, side in (("half x < 0", ~right), ("half x > 0", right)) if side.any()]
    # each half closed, on points of its own
    sides = [boundary_surface(half) for _, half in halves]
    n = points.shape[1]
    law = found.field.law

    def both(values: Array) -> Array:
        return np.tile(values, len(halves))

    return Moving(
        title,
        np.hstack([points] * len(halves))[None],
        np.hstack([side + k * n for k, side in enumerate(sides)]),
        np.repeat(np.arange(len(halves)), n),
        {name: MUSCLE if k == 0 else "#d98880" for k, (name, _) in enumerate(halves)},
        ["steady"],
        fields=[
            Coloured(
                "oxygen [mM]", both(c), (0.0, law.supply), "viridis", f"tissue lives above {law.threshold:.3g} mM"
            ),
            Coloured("viable share [1]", both(alive / count), (0.0, 1.0), "viridis"),
        ],
        caption="Leave out one half to see the section in the middle. To scale.",
    )


def _regions(machine: Machine, mesh: BodyMesh) -> tuple[dict[str, str], Array, Ints, Ints]:
    """Parts with their colours, points, closed surfaces of gel and muscle, and the part of each point."""
    cells = machine.split[1]
    kinds = [("hydrogel", GEL, ~machine.muscle), ("muscle", MUSCLE, machine.muscle)]
    there = [(name, colour, boundary_surface(cells[:, which])) for name, colour, which in kinds if which.any()]
    part = machine.of_muscle.astype(np.int64) if len(there) == 2 else np.zeros(machine.of_muscle.size, dtype=np.int64)
    triangles = np.hstack([surface for *_, surface in there])
    return {name: colour for name, colour, _ in there}, mesh.points[:, machine.split[0]], triangles, part


def _glyphs(mesh: BodyMesh, a0: Array) -> Array:
    """Ends of short lines along the fibres on the muscle's own faces, two after one another, (3, 2 k) [mm]."""
    cells = mesh.cells[:, mesh.regions["muscle"]]
    faces = np.concatenate([np.delete(cells, k, axis=0) for k in range(4)], axis=1)
    owner = np.tile(np.arange(cells.shape[1]), 4)
    _, first, count = np.unique(np.sort(faces, axis=0), axis=1, return_index=True, return_counts=True)
    outer = np.sort(first[count == 1])
    outer = outer[:: max(1, -(-outer.size // _MOST_GLYPHS))]
    a, b, c = mesh.points[:, faces[:, outer]].swapaxes(0, 1)
    middle, normal = (a + b + c) / 3.0, np.cross(b - a, c - a, axis=0)
    area = np.linalg.norm(normal, axis=0)
    normal = normal / area
    inside = mesh.points[:, cells[:, owner[outer]]].mean(axis=1)
    normal *= np.sign(np.sum((middle - inside) * normal, axis=0))
    size = np.sqrt(area)
    fibre = a0[:, owner[outer]]
    # seen along the face
    flat = fibre - np.sum(fibre * normal, axis=0) * normal
    lifted = middle + _ABOVE * size * normal
    half = 0.5 * _LENGTH * size * flat
    return np.stack([lifted - half, lifted + half], axis=2).reshape(3, -1)
