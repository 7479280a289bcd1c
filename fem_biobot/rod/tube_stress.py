"""Normal stress at the surfaces of rods and muscles, for pictures: what beam theory says where a solid has its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.model import RodState
from fem_biobot.rod.records import Muscle
from fem_biobot.rod.section import Section
from fem_biobot.rod.tubes import Piece, tube_layout

Array = NDArray[np.float64]


def normal_stress(state: RodState, pieces: Sequence[Piece]) -> Array:
    """Stress along rods and muscles at the points of all pieces, one after another, (p,) [kPa]; nan on bodies.

    In rods ``n3 / A + m1 x2 / I1 - m2 x1 / I2`` with the resultants of the elements, means of two at the section where
    they meet (Navier; shear and torsion are left out); in muscles the force over the present section, that of constant
    volume.

    Parameters
    ----------
    state
        Of an assembly.
    pieces
        Of its model.
    """
    return np.concatenate([_of_piece(state, piece) for piece in pieces])


def _of_piece(state: RodState, piece: Piece) -> Array:
    n_points = int(piece.triangles.max()) + 1
    if piece.kind == "muscle":
        k = state.model.muscles[piece.name]
        muscle = state.model.members[k]
        assert isinstance(muscle, Muscle)
        volume = muscle.area * float(state.model.assembly.members.length[k])
        return np.full(n_points, state.muscle_force(piece.name) * state.muscle_length(piece.name) / volume)
    layout = tube_layout(piece)
    if layout is None:
        return np.full(n_points, np.nan)
    slices, outlines = layout
    first = state.model.elements_of(piece.name).start
    rod = next(rod for rod in state.model.rods if rod.name == piece.name)
    sections: Sequence[Section] = rod.section  # type: ignore[assignment]  # one for each element by now
    section = sections[int(slices[0]) - first]
    n, m = state.resultants(piece.name)
    along = np.concatenate([n[:, 2:], m[:, :2]], axis=1)[slices - first]
    # ends have one neighbour, sections between elements two
    stations = 0.5 * (np.vstack([along[:1], along]) + np.vstack([along, along[-1:]]))

    def at(outline: Array) -> Array:
        x1, x2 = outline.T
        bent = stations[:, 1:2] * x2 / section.I1 - stations[:, 2:3] * x1 / section.I2
        return (stations[:, :1] / section.area + bent).ravel()

    found = [at(outline) for outline in outlines]
    if len(outlines) == 1:
        found.append(stations[[0, -1], 0] / section.area)
    return np.concatenate(found)
