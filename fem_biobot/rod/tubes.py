"""What an assembly looks like: closed surfaces of its rods, bodies and muscles, moved along with its nodes.

Geometry alone, in plain arrays: no fields, no files, no drawing. A `Piece` is made once from a model; its triangles
stay, its points follow the nodes, of one state or of all samples of a motion at once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fem_biobot.errors import ModelError
from fem_biobot.rod.element.arrays import Elements
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Muscle
from fem_biobot.rod.section import Section

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SIDES = 32  # of a round section

# corners of a cube by sign, and triangles of its faces, (3, 12), counter-clockwise from outside
_CUBE = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=float)
_CUBE_FACES = np.array(
    [[0, 0, 4, 4, 0, 0, 2, 2, 0, 0, 1, 1], [2, 3, 5, 7, 1, 5, 6, 7, 4, 6, 3, 7], [3, 1, 7, 6, 5, 4, 7, 3, 6, 2, 7, 5]]
)


class Shape(Protocol):
    """Points of a surface that follow the nodes."""

    def points(self, x: Array, Q: Array) -> Array:
        """Positions (..., 3, p) [mm] from nodes at x (..., n, 3) [mm] with directors Q (..., n, 3, 3)."""
        ...


@dataclass(frozen=True, eq=False)
class Piece:
    """The closed surface of a part, or of a stretch of a rod with one section.

    Attributes
    ----------
    name, kind
        Of the part; ``rod``, ``body`` or ``muscle``.
    shape
        Gives its points.
    triangles
        Of its points, (3, f), counter-clockwise from outside.
    element
        The element of the model that each triangle belongs to, (f,); -1 for other kinds.
    """

    name: str
    kind: str
    shape: Shape
    triangles: Ints
    element: Ints

    def points(self, x: Array, Q: Array) -> Array:
        """Positions (..., 3, p) [mm] from nodes at x (..., n, 3) [mm] with directors Q (..., n, 3, 3)."""
        return self.shape.points(x, Q)


def pieces(model: RodModel, *, sides: int = SIDES, between: int = 2) -> tuple[Piece, ...]:
    """Surfaces of a model's rods, bodies and muscles.

    Parameters
    ----------
    model
        Whose; springs have no section and are left out.
    sides
        Corners of a round section, at least 3.
    between
        Slices of an element, at least 1: the surface follows the arc or helix that the element is.

    Notes
    -----
    *Rods* are their section's outline, carried along the centre line by the directors; neighbouring elements of one
    section are one tube, plane at both ends. A round section of less area than its circle is a tube with a hole.
    *Bodies* are their boxes; without any, the box of the same mass and inertia. *Muscles* are round, of the section
    that leaves their volume as it is: as moulded at their rest length.
    """
    if sides < 3 or between < 1:
        raise ModelError(f"pieces: found sides {sides} and between {between}, expected at least 3 and 1")
    found: list[Piece] = []
    for rod in model.rods:
        first = model.elements_of(rod.name).start
        sections: Sequence[Section] = rod.section  # type: ignore[assignment]  # one for each element by now
        for section, run in groupby(enumerate(sections), key=lambda pair: pair[1]):
            numbers = first + np.array([e for e, _ in run])
            found.append(_tube_piece(rod.name, section, model.assembly.elements, numbers, sides, between))
    for body in model.bodies:
        corners, triangles = _boxes(body)
        node = model.atlas.node_of[body.name, 0]
        shape = _Fixed(node, corners - model.atlas.centre[node])
        found.append(Piece(body.name, "body", shape, triangles, np.full(triangles.shape[1], -1)))
    for name, k in model.muscles.items():
        muscle = model.members[k]
        assert isinstance(muscle, Muscle)
        triangles, _ = _sweep_triangles(1, sides, holed=False)
        shape = _Strand(
            model.assembly.members.nodes[k],
            model.assembly.members.offset[k],
            muscle.area * float(model.assembly.members.length[k]),
            _across(model, k),
            sides,
        )
        found.append(Piece(name, "muscle", shape, triangles, np.full(triangles.shape[1], -1)))
    return tuple(found)


def point_of(x: Array, Q: Array, node: int, offset: Array) -> Array:
    """Points fixed to a node, (..., 3), by their offset in its frame, (3,) or (p, 3) giving (..., p, 3) [mm]."""
    if offset.ndim == 1:
        return x[..., node, :] + np.einsum("...ji,j->...i", Q[..., node, :, :], offset)
    return x[..., node, None, :] + np.einsum("...ji,pj->...pi", Q[..., node, :, :], offset)


def element_ends(elements: Elements, x: Array, Q: Array) -> tuple[Array, Array]:
    """Positions (..., m, 2, 3) [mm] and directors (rows, ..., m, 2, 3, 3) at the ends of elements."""
    at = Q[..., elements.nodes, :, :]
    ends = x[..., elements.nodes, :] + np.einsum("...ji,...j->...i", at, elements.offset)
    return ends, np.einsum("...ij,...jk->...ik", elements.turn, at)


def along_elements(elements: Elements, x: Array, Q: Array, shares: Array) -> tuple[Array, Array]:
    """Positions (..., m, k, 3) [mm] and directors (..., m, k, 3, 3) at shares (k,) of the elements' length.

    Exact for the rod's own elements, whose strains are constant: with the rotation vector phi from end to end, the
    directors turn by ``s phi`` and the centre line by ``s V(s phi) V(phi)^-1``, V the mean of all rotations up to
    there. Elements that turn by pi or more wrap.
    """
    ends, frames = element_ends(elements, x, Q)
    R1, R2 = np.swapaxes(frames[..., 0, :, :], -1, -2), np.swapaxes(frames[..., 1, :, :], -1, -2)
    turn = np.swapaxes(R1, -1, -2) @ R2
    phi = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_rotvec().reshape(turn.shape[:-1])
    chord = np.einsum("...ji,...j->...i", R1, ends[..., 1, :] - ends[..., 0, :])
    arc = np.linalg.solve(_mean_rotation(phi), chord[..., None])[..., 0]
    parts = shares[:, None] * phi[..., None, :]  # (..., m, k, 3)
    step = shares[:, None] * np.einsum("...kij,...j->...ki", _mean_rotation(parts), arc)
    line = ends[..., 0, None, :] + np.einsum("...ij,...kj->...ki", R1, step)
    turned = Rotation.from_rotvec(parts.reshape(-1, 3)).as_matrix().reshape((*parts.shape, 3))
    return line, np.swapaxes(R1[..., None, :, :] @ turned, -1, -2)


def _mean_rotation(phi: Array) -> Array:
    """Mean of ``exp(s phi)`` over s from 0 to 1, (..., 3, 3), of rotation vectors (..., 3)."""
    angle = np.linalg.norm(phi, axis=-1)[..., None, None]
    small = angle < 1e-3
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    second = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    K = np.zeros((*phi.shape, 3))
    K[..., 2, 1], K[..., 0, 2], K[..., 1, 0] = phi[..., 0], phi[..., 1], phi[..., 2]
    K -= np.swapaxes(K, -1, -2)
    return np.eye(3) + first * K + second * (K @ K)


@dataclass(frozen=True, eq=False)
class _Tube:
    """Elements with one outline: stations along them, and at the two ends the middle of the cap if there is no hole."""

    elements: Elements
    outlines: tuple[Array, ...]
    between: int

    def points(self, x: Array, Q: Array) -> Array:
        line, frames = along_elements(self.elements, x, Q, np.arange(self.between + 1) / self.between)
        lead = line.shape[:-3]
        # every station once: the last of an element is the first of the next
        line = np.concatenate([line[..., :-1, :].reshape(*lead, -1, 3), line[..., -1:, -1, :]], axis=-2)
        inner = frames[..., :-1, :, :].reshape(*lead, -1, 3, 3)
        frames = np.concatenate([inner, frames[..., -1:, -1, :, :]], axis=-3)
        rings = [
            line[..., None, :] + np.einsum("pa,...ai->...pi", outline, frames[..., :2, :]) for outline in self.outlines
        ]
        found = [ring.reshape(*lead, -1, 3) for ring in rings]
        if len(self.outlines) == 1:
            found.append(line[..., [0, -1], :])
        return np.swapaxes(np.concatenate(found, axis=-2), -1, -2)


def tube_layout(piece: Piece) -> tuple[Ints, tuple[Array, ...]] | None:
    """Element of each slice of a rod's piece, (s,), and its outlines (p, 2) [mm]; None of other kinds.

    Points of such a piece: for each outline its points at the ``s + 1`` stations, one station after another; then, with
    one outline, the middles of both caps.
    """
    if not isinstance(piece.shape, _Tube):
        return None
    return np.repeat(np.unique(piece.element), piece.shape.between), piece.shape.outlines


@dataclass(frozen=True, eq=False)
class _Fixed:
    """Points fixed to a node."""

    node: int
    offset: Array

    def points(self, x: Array, Q: Array) -> Array:
        return np.swapaxes(point_of(x, Q, self.node, self.offset), -1, -2)


@dataclass(frozen=True, eq=False)
class _Strand:
    """A round strand of constant volume between two points; `across` is fixed to its first node."""

    nodes: Ints
    offset: Array
    volume: float
    across: Array
    sides: int

    def points(self, x: Array, Q: Array) -> Array:
        a, b = (point_of(x, Q, int(self.nodes[i]), self.offset[i]) for i in (0, 1))
        length = np.linalg.norm(b - a, axis=-1)[..., None]
        t = (b - a) / length
        first = np.einsum("...ji,j->...i", Q[..., int(self.nodes[0]), :, :], self.across)
        first = first - t * np.sum(first * t, axis=-1, keepdims=True)
        first = first / np.linalg.norm(first, axis=-1, keepdims=True)
        frame = np.stack([first, np.cross(t, first)], axis=-2)
        radius = np.sqrt(self.volume / (math.pi * length))[..., None]
        ring = radius * np.einsum("pa,...ai->...pi", _circle(1.0, self.sides), frame)
        ends = [a[..., None, :] + ring, b[..., None, :] + ring, a[..., None, :], b[..., None, :]]
        return np.swapaxes(np.concatenate(ends, axis=-2), -1, -2)


def _across(model: RodModel, k: int) -> Array:
    """A direction across a member as drawn, the one of the drawing's axes that is most so."""
    members, centre = model.assembly.members, model.atlas.centre
    (a, b), (ra, rb) = members.nodes[k], members.offset[k]
    return np.eye(3)[int(np.abs(centre[b] + rb - centre[a] - ra).argmin())]


def _circle(radius: float, sides: int) -> Array:
    angle = 2.0 * math.pi * np.arange(sides) / sides
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _outlines(section: Section, sides: int) -> tuple[Array, ...]:
    """Outline of a section, and of its hole if it is a round tube."""
    outer = section.outline(sides)
    if section.corners or section.radius is None:
        return (outer,)
    inside = section.radius**2 - section.area / math.pi
    return (outer,) if inside <= 1e-9 * section.radius**2 else (outer, _circle(math.sqrt(inside), sides))


def _tube_piece(name: str, section: Section, elements: Elements, e: Ints, sides: int, between: int) -> Piece:
    outlines = _outlines(section, sides)
    holed = len(outlines) > 1
    triangles, slices = _sweep_triangles(len(e) * between, len(outlines[0]), holed=holed)
    part = elements._replace(nodes=elements.nodes[e], offset=elements.offset[e], turn=elements.turn[e])
    return Piece(name, "rod", _Tube(part, outlines, between), triangles, e[slices // between])


def _sweep_triangles(slices: int, sides: int, *, holed: bool) -> tuple[Ints, Ints]:
    """Triangles (3, f) of a closed sweep and the slice that each belongs to, (f,).

    Points: the outline at each of the ``slices + 1`` stations, then that of the hole, or else the middles of both caps.
    """
    i, j = (a.ravel() for a in np.meshgrid(np.arange(slices), np.arange(sides), indexing="ij"))
    after = (j + 1) % sides

    def wall(base: int) -> Ints:
        a, b = base + i * sides + j, base + i * sides + after
        return np.hstack([[a, b, b + sides], [a, b + sides, a + sides]])

    ring, onward = np.arange(sides), (np.arange(sides) + 1) % sides
    end, count = slices * sides, (slices + 1) * sides
    if holed:
        inner = count + ring, count + onward
        start_cap = np.hstack([[ring, inner[0], inner[1]], [ring, inner[1], onward]])
        end_cap = end + np.hstack([[ring, onward, inner[1]], [ring, inner[1], inner[0]]])
        walls = np.hstack([wall(0), wall(count)[[0, 2, 1]]])
        belongs = np.tile(i, 4)
    else:
        start_cap = np.array([np.full(sides, count), onward, ring])
        end_cap = np.array([np.full(sides, count + 1), end + ring, end + onward])
        walls, belongs = wall(0), np.tile(i, 2)
    caps = [np.zeros(start_cap.shape[1], dtype=np.int64), np.full(end_cap.shape[1], slices - 1)]
    return np.hstack([walls, start_cap, end_cap]).astype(np.int64), np.concatenate([belongs, *caps]).astype(np.int64)


def _boxes(body: Body) -> tuple[Array, Ints]:
    """Corners as drawn, (8 b, 3) [mm], and triangles (3, 12 b) of a body's boxes."""
    if body.boxes:
        corners = [np.array(c, dtype=float) + _CUBE * np.array(e, dtype=float) / 2.0 for c, e in body.boxes]
    else:
        edges, axes = equivalent_box(body)
        corners = [np.array(body.centre, dtype=float) + _CUBE * edges / 2.0 @ axes]
    triangles = [_CUBE_FACES + 8 * k for k in range(len(corners))]
    return np.vstack(corners), np.hstack(triangles).astype(np.int64)


def equivalent_box(body: Body) -> tuple[Array, Array]:
    """Edges (3,) [mm] of the box with a body's mass and inertia, and its axes, rows, (3, 3).

    From ``J_1 = m (b^2 + c^2) / 12`` and its like: ``a^2 = 6 (J_2 + J_3 - J_1) / m``. An inertia that no body has,
    whose largest part exceeds the others' sum, gives an edge near zero.
    """
    if np.count_nonzero(body.inertia - np.diag(np.diag(body.inertia))):
        J, axes = np.linalg.eigh(body.inertia)
        axes = axes.T * np.sign(np.linalg.det(axes))
    else:
        J, axes = np.diag(body.inertia), np.eye(3)
    square = 6.0 * (J.sum() - 2.0 * J) / body.mass
    return np.sqrt(np.maximum(square, 1e-6 * square.max())), axes


def contact_points(model: RodModel, ground: Ground, x: Array, Q: Array) -> Array:
    """Where contact points touch, or are nearest to the ground, (..., c, 3) [mm]: below the axis of round ones."""
    contacts, normal = model.assembly.contacts, ground.axes[0]
    at = Q[..., contacts.node, :, :]
    centre = x[..., contacts.node, :] + np.einsum("...ji,...j->...i", at, contacts.offset)
    axis = np.einsum("...ji,...j->...i", at, contacts.axis)
    down = axis * (axis @ normal)[..., None] - normal
    size = np.linalg.norm(down, axis=-1, keepdims=True)
    return centre + contacts.radius[:, None] * down / np.maximum(size, 1e-300)


def ground_square(ground: Ground, points: Array, *, margin: float = 0.25) -> Array:
    """Corners (3, 4) [mm] of a piece of the ground below points (3, p), wider by `margin` of their extent all round.

    Counter-clockwise seen from the machine's side.
    """
    n, t, s = ground.axes
    low = np.array([(t @ points).min(), (s @ points).min()])
    high = np.array([(t @ points).max(), (s @ points).max()])
    pad = margin * float((high - low).max())
    (a, c), (b, d) = low - pad, high + pad
    corners: Sequence[tuple[float, float]] = ((a, c), (b, c), (b, d), (a, d))
    return np.array([ground.height * n + u * t + v * s for u, v in corners]).T
