"""What is known of an assembly's state at its surfaces, along its lines and at its contact points, for files.

Names end in their unit; values have the point or cell axis last. Numbers in fields of parts count the names that
`part_names` gives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fem_biobot.friction.kernels import LIFTED, SLIP, STICK
from fem_biobot.rod.dynamics.integrate import Motion
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Muscle
from fem_biobot.rod.tubes import Piece, along_elements, contact_points, element_ends, point_of

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Fields = dict[str, NDArray[np.generic]]

KINDS = ("rod", "body", "muscle", "spring")
TOUCH = tuple(name for _, name in sorted({LIFTED: "lifted", STICK: "stick", SLIP: "slip"}.items()))


def part_names(model: RodModel) -> tuple[str, ...]:
    """Names of rods, bodies and members, in the order in which fields of parts count them."""
    members = [m.name if isinstance(m, Muscle) else f"spring_{k}" for k, m in enumerate(model.members)]
    return (*(r.name for r in model.rods), *(b.name for b in model.bodies), *members)


@dataclass(frozen=True, eq=False)
class Resultants:
    """Of a state's elements: resultants in space (m, 3), the tensile part (m,), bending and twist, and the stretch.

    `n_force`, `axial_force` [mN], `m_couple` [uJ], `curvature`, `twist` [1/mm], `stretch` [1].
    """

    n_force: Array
    axial_force: Array
    m_couple: Array
    curvature: Array
    twist: Array
    stretch: Array


def resultants(state: RodState) -> Resultants:
    """Resultants of all elements, in space with the directors of their middles.

    Elastic parts alone, without damping. Curvature and twist are the whole ones, those of the natural shape included;
    stretch is the length of the centre line over that drawn.
    """
    model = state.model
    elements = model.assembly.elements
    parts = [(state.resultants(rod.name), state.strain(rod.name)) for rod in model.rods]
    n, m, eps, kappa = (
        np.concatenate([np.zeros((0, 3)), *(part[i][j] for part in parts)]) for i, j in ((0, 0), (0, 1), (1, 0), (1, 1))
    )
    middle = along_elements(elements, state.x, state.Q, np.array([0.5]))[1][:, 0]
    third = np.array([0.0, 0.0, 1.0])
    stretch = np.linalg.norm(eps + elements.eps0 + third, axis=1) / np.linalg.norm(elements.eps0 + third, axis=1)
    kappa = kappa + elements.kappa0
    return Resultants(
        np.einsum("ma,mai->mi", n, middle),
        n[:, 2],
        np.einsum("ma,mai->mi", m, middle),
        np.linalg.norm(kappa[:, :2], axis=1),
        kappa[:, 2],
        stretch,
    )


def face_fields(state: RodState, pieces: Sequence[Piece], found: Resultants | None = None) -> Fields:
    """Fields of the triangles of all pieces, one after another, (f,) each.

    `part` and `kind` (of `KINDS`) as numbers; sizes of `n_force` and `m_couple`, the tensile force of rods and muscles,
    curvature and twist of rods, stretch of rods and muscles. Zero, and stretch one, where there is no such thing.
    """
    model = state.model
    found = found or resultants(state)
    names = part_names(model)
    counts = [piece.triangles.shape[1] for piece in pieces]
    element = np.concatenate([piece.element for piece in pieces]) if pieces else np.zeros(0, dtype=np.int64)
    of_rod = element >= 0

    def carried(values: Array, other: float = 0.0) -> Array:
        spread = np.full(element.size, other)
        spread[of_rod] = values[element[of_rod]]
        return spread

    fields: Fields = {
        "part": np.repeat([names.index(piece.name) for piece in pieces], counts).astype(np.int32),
        "kind": np.repeat([KINDS.index(piece.kind) for piece in pieces], counts).astype(np.int32),
        "n_force_mN": carried(np.linalg.norm(found.n_force, axis=1)),
        "m_couple_uJ": carried(np.linalg.norm(found.m_couple, axis=1)),
        "curvature_per_mm": carried(found.curvature),
        "twist_per_mm": carried(found.twist),
    }
    tension, stretch = carried(found.axial_force), carried(found.stretch, 1.0)
    ends = np.cumsum(counts)
    for piece, end, count in zip(pieces, ends, counts, strict=True):
        if piece.kind == "muscle":
            tension[end - count : end] = state.muscle_force(piece.name)
            stretch[end - count : end] = state.stretch(piece.name)
    return {**fields, "tension_mN": tension, "stretch_1": stretch}


@dataclass(frozen=True, eq=False)
class Lines:
    """Points (3, n) [mm], lines as pairs of points (2, l), and the fields of both."""

    points: Array
    lines: Ints
    point_data: Fields
    cell_data: Fields


def line_fields(state: RodState, found: Resultants | None = None) -> Lines:
    """Elements and members as lines: directors at the ends, resultants in space along elements, tension and stretch.

    Every element has its own two ends, where the directors are those of its sections; at the ends of members they are
    zero.
    """
    model = state.model
    found = found or resultants(state)
    elements, members = model.assembly.elements, model.assembly.members
    ends, frames = element_ends(elements, state.x, state.Q)
    m, k = len(ends), len(members.law)
    strands = np.zeros((k, 2, 3))
    for member in range(k):
        for end in (0, 1):
            node, offset = int(members.nodes[member, end]), members.offset[member, end]
            strands[member, end] = offset if node < 0 else point_of(state.x, state.Q, node, offset)
    length = np.linalg.norm(strands[:, 1] - strands[:, 0], axis=1)
    tension = np.array(
        [
            state.muscle_force(member.name)
            if isinstance(member, Muscle)
            else members.stiffness[j] * (length[j] - members.length[j])
            for j, member in enumerate(model.members)
        ]
    )
    rest = np.where(members.length > 0.0, members.length, 1.0)
    points = np.concatenate([ends, strands]).reshape(-1, 3).T
    counts = [len(rod.points) - 1 for rod in model.rods]
    n_rods, n_bodies = len(model.rods), len(model.bodies)
    along = (found.n_force, found.m_couple)
    return Lines(
        points,
        np.arange(2 * (m + k)).reshape(-1, 2).T,
        {
            f"director_{a + 1}": np.concatenate([frames[..., a, :].reshape(-1, 3), np.zeros((2 * k, 3))]).T
            for a in range(3)
        },
        {
            "part": np.concatenate(
                [np.repeat(np.arange(n_rods), counts), n_rods + n_bodies + np.arange(k)]
            ).astype(np.int32),
            "kind": np.array(
                [0] * m + [KINDS.index("muscle" if isinstance(each, Muscle) else "spring") for each in model.members],
                dtype=np.int32,
            ),
            **{
                name: np.concatenate([values, np.zeros((k, 3))]).T
                for name, values in zip(("n_force_mN", "m_couple_uJ"), along, strict=True)
            },
            "curvature_per_mm": np.concatenate([found.curvature, np.zeros(k)]),
            "twist_per_mm": np.concatenate([found.twist, np.zeros(k)]),
            "tension_mN": np.concatenate([found.axial_force, tension]),
            "stretch_1": np.concatenate([found.stretch, length / rest]),
        },
    )  # fmt: skip


def contact_fields(motion: Motion, i: int) -> tuple[Array, Fields]:
    """Contact points of a sample, (3, c) [mm], and their fields; none of a motion without a ground.

    Forces are those of the ground on the machine, means since the sample before. `touch` counts `TOUCH`, `foot` the
    model's groups of contact points.
    """
    model = motion.model
    if motion.ground is None:
        return np.zeros((3, 0)), {}
    n, t, s = motion.ground.axes
    force = motion.contact_force[i]
    friction = force[:, 1:2] * t + force[:, 2:] * s
    foot = np.repeat(np.arange(len(model.contacts)), [len(group.points) for group in model.contacts])
    points = contact_points(model, motion.ground, motion.x[i], motion.Q[i])
    return points.T, {
        "foot": foot.astype(np.int32),
        "touch": motion.touch[i].astype(np.int32),
        "contact_force_mN": (force[:, :1] * n + friction).T,
        "normal_force_mN": (force[:, :1] * n).T,
        "friction_force_mN": friction.T,
        "slip_share_1": motion.slip_share[i],
        "contact_share_1": motion.contact_share[i],
    }
