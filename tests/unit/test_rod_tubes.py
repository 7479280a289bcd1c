"""Surfaces of rods, bodies and muscles: closed, of the right volume, where the nodes are; fields on them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fem_biobot.errors import ModelError
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Body, Hold, Muscle, Rigid, Rod, Spring
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.tube_fields import KINDS, face_fields, line_fields, part_names, resultants
from fem_biobot.rod.tubes import along_elements, contact_points, equivalent_box, ground_square, pieces
from tests.helpers import generator, rotation, unchanged

GEL = RodMaterial(young=319.4, poisson=0.45, density=1.12e-6)
START = np.array([0.7, -1.1, 2.3])


def line(n: int, length: float, direction: np.ndarray) -> np.ndarray:
    return START + np.linspace(0.0, length, n)[:, None] * direction


def volume(points: np.ndarray, triangles: np.ndarray) -> float:
    """Enclosed volume by the divergence theorem, positive for triangles that turn outward."""
    a, b, c = points[:, triangles].transpose(1, 2, 0)
    return float(np.einsum("fi,fi->", a - points.mean(axis=1), np.cross(b - a, c - a)) / 6.0)


def is_closed(triangles: np.ndarray) -> bool:
    """Every edge is passed once in each direction."""
    edges = np.hstack([triangles[[0, 1]], triangles[[1, 2]], triangles[[2, 0]]]).T.tolist()
    there = {tuple(edge) for edge in edges}
    return len(there) == len(edges) and all((b, a) in there for a, b in there)


def polygon_area(outline: np.ndarray) -> float:
    x, y = outline.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@pytest.mark.parametrize(
    "section",
    [
        Section.rectangle(0.7, 2.1),
        Section.circle(0.9),
        Section.tube(1.3, 0.8),
        Section.given(1.7, 0.2, 0.3, 0.4, shear_factors=0.8),
        Section.given(1.5, 0.2, 0.3, 0.4, shear_factors=0.8, corners=[(-1, -0.5), (1, -0.5), (1, 0.5), (-0.5, 0.25)]),
    ],
)
def test_a_straight_tube_is_closed_and_holds_section_times_length(section: Section) -> None:
    """Catches: a cap missing or turned inward, the hole's wall turned as the outer one, a slice lost at an end."""
    direction = rotation(5)[0]
    model = RodModel([Rod(line(4, 5.3, direction), section, GEL)])
    state, sides = model.drawn(), 400
    (piece,) = pieces(model, sides=sides, between=3)
    points = piece.points(state.x, state.Q)
    assert is_closed(piece.triangles)
    # a polygon of so many sides has (sin t) / t of its circle's area, t = 2 pi / sides
    share = 1.0 if section.corners else math.sin(2 * math.pi / sides) * sides / (2 * math.pi)
    area = polygon_area(section.outline()) if section.corners else share * section.area
    assert volume(points, piece.triangles) == pytest.approx(5.3 * area, rel=1e-12)
    along = direction @ (points - START[:, None])
    assert along.min() == pytest.approx(0.0, abs=1e-12)
    assert along.max() == pytest.approx(5.3, rel=1e-13)


def test_sections_that_change_give_one_closed_tube_each() -> None:
    """Catches: the last section used for all, elements numbered from each stretch, a gap where sections change."""
    thick, thin = Section.circle(0.8), Section.rectangle(0.4, 0.6)
    other = Rod(line(3, 2.0, np.array([0.0, 1.0, 0.0])), thin, GEL, "other")
    rod = Rod(line(6, 5.0, np.array([1.0, 0.0, 0.0])), [thick, thick, thin, thin, thick], GEL, "bar")
    model = RodModel([other, rod], [Rigid(("other", 0), ("bar", 0))])
    state = model.drawn()
    found = pieces(model, sides=200, between=2)
    assert [piece.name for piece in found] == ["other", "bar", "bar", "bar"]
    assert [sorted(set(piece.element.tolist())) for piece in found] == [[0, 1], [2, 3], [4, 5], [6]]
    volumes = [volume(p.points(state.x, state.Q), p.triangles) for p in found]
    assert volumes == pytest.approx([2.0 * 0.24, 2.0 * thick.area, 2.0 * 0.24, 1.0 * thick.area], rel=2e-4)
    assert all(is_closed(piece.triangles) for piece in found)


def ring_state(elements: int, turn: float, radius: float) -> tuple[RodModel, RodState]:
    """A rod drawn along an arc in a tilted plane, thin section ``b x h`` with its width along the radius."""
    angle = np.linspace(0.0, turn, elements + 1)
    flat = radius * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    tilt = rotation(9)
    rod = Rod(START + flat @ tilt.T, Section.rectangle(0.5, 0.8), GEL, normal=tuple((tilt @ [1.0, 0.0, 0.0]).tolist()))
    model = RodModel([rod])
    return model, model.drawn()


def test_the_line_between_nodes_is_the_arc_that_the_element_is() -> None:
    """Three elements over 4 rad lie on the circle everywhere, with the third director along it.

    Catches: positions between nodes on the chord, the rotation applied from the wrong end, the wrong mean rotation.
    """
    model, state = ring_state(3, 4.0, 2.7)
    position, frames = along_elements(model.assembly.elements, state.x, state.Q, np.array([0.0, 0.23, 0.5, 1.0]))
    local = (position - START) @ rotation(9)
    assert np.allclose(local[..., 2], 0.0, atol=1e-13)
    assert np.allclose(np.hypot(local[..., 0], local[..., 1]), 2.7, rtol=1e-13)
    angle = np.arctan2(local[..., 1], local[..., 0]) % (2 * math.pi)
    assert np.allclose(angle, (np.arange(3)[:, None] + [0.0, 0.23, 0.5, 1.0]) * 4.0 / 3.0, atol=1e-13)
    tangent = np.stack([-np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=-1) @ rotation(9).T
    assert np.allclose(frames[..., 2, :], tangent, atol=1e-13)
    assert np.allclose(np.linalg.det(frames), 1.0, atol=1e-13)


def test_a_bent_tube_holds_section_times_length_of_its_line() -> None:
    """Pappus: facets miss it by the square of their angle.

    Catches: sections that do not follow the directors, slices between nodes left out.
    """
    model, state = ring_state(6, 4.0, 2.7)
    error = []
    for between in (2, 4):
        (piece,) = pieces(model, between=between)
        points = piece.points(state.x, state.Q)
        assert is_closed(piece.triangles)
        error.append(1.0 - volume(points, piece.triangles) / (0.4 * 2.7 * 4.0))
    # a prism between sections a half-angle t from its middle has sin(t) cos(t) / t, t = 1 / 6 and 1 / 12, of the ring's
    # area to the centroid: 2 t^2 / 3 less
    assert error == pytest.approx([2 / 3 * (4 / 6 / 4) ** 2, 2 / 3 * (4 / 6 / 8) ** 2], rel=0.05)


def test_surfaces_follow_any_motion_and_all_samples_at_once() -> None:
    """Catches: directors transposed, an offset left in the drawing's axes, samples and points mixed up."""
    model = machine()
    state = model.drawn()
    turns = [rotation(3), rotation(4)]
    shift = generator(8).normal(size=(2, 3))
    x = np.stack([state.x @ R.T + d for R, d in zip(turns, shift, strict=True)])
    Q = np.stack([state.Q @ R.T for R in turns])
    with unchanged(x, Q):
        moved = [piece.points(x, Q) for piece in pieces(model)]
    for piece, points in zip(pieces(model), moved, strict=True):
        for k, R in enumerate(turns):
            expected = R @ piece.points(state.x, state.Q) + shift[k][:, None]
            assert np.allclose(points[k], expected, atol=1e-12), piece.name


def machine() -> RodModel:
    """A beam between two bodies drawn apart from the axes' origin, a muscle between them, a spring to the world."""
    beam = Rod(line(5, 6.0, np.array([1.0, 0.0, 0.0])), Section.rectangle(0.7, 3.0), GEL, "beam", normal=(0, 0, 1))
    low, high = START, START + np.array([6.0, 0.0, 0.0])
    left = Body.box((low[0] - 1.0, low[1], low[2] - 0.8), (2.0, 3.0, 1.6), 1.1e-6, "left")
    right = Body((high[0] + 1.0, high[1], high[2]), 3e-6, (2e-6, 3e-6, 4e-6), "right")
    joints = [Rigid(("beam", 0), ("left", left.centre)), Rigid(("beam", -1), ("right", right.centre))]
    muscle = Muscle(
        ("left", (float(low[0]), float(low[1]), 1.2)), ("right", (float(high[0]), float(high[1]), 1.6)),
        area=0.8, young=10.0, passive=3.0, active=2.0, rest_length=5.0, name="pull",
    )  # fmt: skip
    spring = Spring(("beam", 2), (0.0, 0.0, 9.0), stiffness=0.3, rest_length=1.0)
    feet = [ContactPoints("left", [(0.0, -1.0, 0.5), (1.0, -1.0, 0.5)]), ContactPoints(("beam", 1), [(2.0, -1.1, 1.0)])]
    return RodModel(
        [beam], joints, [left, right], [Hold(("left", left.centre))], members=[muscle, spring], contacts=feet
    )


def test_bodies_are_their_boxes_and_otherwise_the_box_of_their_inertia() -> None:
    """Catches: half edges taken for edges, boxes about the joint's node instead of the body, faces turned inward."""
    model = machine()
    state = model.drawn()
    named = {piece.name: piece for piece in pieces(model)}
    left = named["left"].points(state.x, state.Q)
    assert np.allclose(left.min(axis=1), START - [2.0, 1.5, 1.6], atol=1e-12)
    assert np.allclose(left.max(axis=1), START - [0.0, -1.5, 0.0], atol=1e-12)
    for name in ("left", "right"):
        assert is_closed(named[name].triangles)
    assert volume(left, named["left"].triangles) == pytest.approx(2.0 * 3.0 * 1.6, rel=1e-12)
    # J = m (b^2 + c^2) / 12 and its like: a^2 = 6 (3 + 4 - 2) / 3, b^2 = 6 (2 + 4 - 3) / 3, c^2 = 6 (2 + 3 - 4) / 3
    edges = np.ptp(named["right"].points(state.x, state.Q), axis=1)
    assert edges == pytest.approx(np.sqrt([10.0, 6.0, 2.0]), rel=1e-12)


def test_the_box_of_an_inertia_has_its_axes() -> None:
    """Catches: axes as columns, edges in another order than the axes."""
    straight = Body.box((0.0, 0.0, 0.0), (1.0, 2.0, 3.5), 1e-6)
    R = rotation(12)
    turned = Body((0.0, 0.0, 0.0), straight.mass, R @ straight.inertia @ R.T)
    edges, axes = equivalent_box(turned)
    order = np.argsort(edges)
    assert edges[order] == pytest.approx([1.0, 2.0, 3.5], rel=1e-9)
    assert np.allclose(np.abs(np.sum(axes[order] * R.T, axis=1)), 1.0, atol=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1.0, rel=1e-12)


def test_bodies_of_several_boxes_show_all_of_them() -> None:
    """Catches: the first box only, triangles of the second on the points of the first."""
    boxes = [((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), ((3.0, 0.0, 0.0), (2.0, 1.0, 3.0))]
    model = RodModel(bodies=[Body((1.0, 0.0, 0.0), 1e-6, (1e-6, 1e-6, 1e-6), "frame", boxes=boxes)])
    state = model.drawn()
    (piece,) = pieces(model)
    points = piece.points(state.x, state.Q)
    assert volume(points, piece.triangles) == pytest.approx(1.0 + 6.0, rel=1e-12)
    assert points[0].min() == pytest.approx(-0.5, rel=1e-12)
    assert points[0].max() == pytest.approx(4.0, rel=1e-12)


def test_boxes_without_size_are_refused() -> None:
    """Catches: a flat or nameless box that shows as nothing."""
    for edges in ((1.0, 0.0, 1.0), (1.0, 1.0)):
        with pytest.raises(ModelError, match="box"):
            Body((0.0, 0.0, 0.0), 1e-6, (1e-6, 1e-6, 1e-6), boxes=[((0.0, 0.0, 0.0), edges)])  # type: ignore[list-item]


def test_a_muscle_keeps_its_volume() -> None:
    """Catches: the drawn length in place of the rest length, the section as moulded at every stretch."""
    model = machine()
    state = model.drawn()
    (piece,) = [p for p in pieces(model, sides=400) if p.kind == "muscle"]
    assert is_closed(piece.triangles)
    assert volume(piece.points(state.x, state.Q), piece.triangles) == pytest.approx(0.8 * 5.0, rel=1e-4)


def test_slices_and_sides_below_the_least_are_refused() -> None:
    """Catches: a tube of two sides, or of no slice."""
    for given in ({"sides": 2}, {"between": 0}):
        with pytest.raises(ModelError, match="pieces"):
            pieces(machine(), **given)


def test_contact_points_of_round_feet_lie_below_their_axes() -> None:
    """Catches: a sphere's centre taken for its lowest point, a cylinder's tilt left out."""
    tilt = 0.3
    axis = (math.cos(tilt), 0.0, math.sin(tilt))
    body = Body.box((0.0, 0.0, 5.0), (1.0, 1.0, 1.0), 1e-6, "foot")
    feet = [
        ContactPoints("foot", [(0.0, 0.0, 4.5)]),
        ContactPoints("foot", [(1.0, 2.0, 4.0)], radius=0.4),
        ContactPoints("foot", [(0.0, 0.0, 4.0)], radius=0.4, axis=axis),
    ]
    model = RodModel(bodies=[body], contacts=feet)
    state = model.drawn()
    found = contact_points(model, Ground(), state.x, state.Q)
    lowest = np.array([0.0, 0.0, 4.0]) + 0.4 * np.array([math.sin(tilt), 0.0, -math.cos(tilt)])
    assert np.allclose(found, [[0.0, 0.0, 4.5], [1.0, 2.0, 3.6], lowest], atol=1e-12)


def test_the_ground_lies_in_its_plane_below_the_machine() -> None:
    """Catches: a level square under a slope, corners that turn away from the machine."""
    slope = 0.2
    ground = Ground(height=1.5, normal=(-math.sin(slope), 0.0, math.cos(slope)))
    points = generator(4).normal(size=(3, 30))
    corners = ground_square(ground, points, margin=0.1)
    n, t, s = ground.axes
    assert np.allclose(n @ corners, 1.5, atol=1e-12)
    for axis in (t, s):
        assert (axis @ corners).min() < (axis @ points).min() < (axis @ points).max() < (axis @ corners).max()
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1])
    assert np.allclose(normal / np.linalg.norm(normal), n, atol=1e-12)


def moved(model: RodModel) -> RodState:
    """A generic state near the drawn one, muscles at some drive."""
    rng = generator(21)
    state = model.drawn()
    turns = Rotation.from_rotvec(0.05 * rng.normal(size=(model.n_nodes, 3))).as_matrix()
    return RodState(model, state.x + 0.05 * rng.normal(size=state.x.shape), state.Q @ turns, drive=0.7)


def test_face_fields_are_the_states_own_and_zero_elsewhere() -> None:
    """Catches: parts numbered by kind, values of one element on another, muscle fields on the bodies."""
    model = machine()
    state = moved(model)
    found = pieces(model)
    fields = face_fields(state, found)
    names = part_names(model)
    assert names == ("beam", "left", "right", "pull", "spring_1")
    part, kind = fields["part"], fields["kind"]
    assert [names[k] for k in np.unique(part)] == ["beam", "left", "right", "pull"]
    assert all(
        KINDS[k] == {"b": "rod", "l": "body", "r": "body", "p": "muscle"}[names[p][0]]
        for p, k in zip(part, kind, strict=True)
    )
    n, m = state.resultants("beam")
    element = found[0].element
    beam = part == 0
    assert np.allclose(fields["n_force_mN"][beam], np.linalg.norm(n, axis=1)[element], rtol=1e-13)
    assert np.allclose(fields["m_couple_uJ"][beam], np.linalg.norm(m, axis=1)[element], rtol=1e-13)
    assert np.allclose(fields["tension_mN"][beam], n[element, 2], rtol=1e-13)
    muscle = part == names.index("pull")
    assert np.all(fields["tension_mN"][muscle] == state.muscle_force("pull"))
    assert np.all(fields["stretch_1"][muscle] == state.stretch("pull"))
    body = kind == KINDS.index("body")
    assert not any(np.any(fields[k][body]) for k in ("n_force_mN", "m_couple_uJ", "curvature_per_mm", "tension_mN"))
    assert np.all(fields["stretch_1"][body] == 1.0)


def test_curvature_is_that_of_the_shape_not_of_the_stress() -> None:
    """Catches: natural curvature left out, twist counted as bending."""
    _, state = ring_state(5, 2.0, 2.7)
    found = resultants(state)
    assert np.allclose(found.curvature, 1.0 / 2.7, rtol=1e-12)
    assert np.allclose(found.twist, 0.0, atol=1e-13)
    assert np.allclose(found.stretch, 1.0, rtol=1e-13)
    assert np.abs(found.n_force).max() < 1e-9 * GEL.young


def test_lines_carry_directors_and_forces_in_space() -> None:
    """Forces along elements turn with the machine; directors are unit vectors along and across the rods.

    Catches: resultants left in the material frame, members and elements in another order, a spring without its tension.
    """
    model = machine()
    state = moved(model)
    lines = line_fields(state)
    R = rotation(17)
    turned = line_fields(RodState(model, state.x @ R.T, state.Q @ R.T, drive=0.7))
    beam = lines.cell_data["part"] == 0
    assert np.count_nonzero(beam) == 4
    assert np.allclose(turned.cell_data["n_force_mN"][:, beam], R @ lines.cell_data["n_force_mN"][:, beam], rtol=1e-9)
    sizes = np.linalg.norm(lines.cell_data["n_force_mN"], axis=0)
    assert np.allclose(sizes[beam], np.linalg.norm(state.resultants("beam")[0], axis=1), rtol=1e-12)
    assert np.allclose(lines.points[:, 0], state.at(("beam", 0)), atol=1e-13)
    assert np.allclose(lines.point_data["director_3"][:, 2], state.directors("beam")[1, 2], atol=1e-13)
    length = np.linalg.norm(lines.points[:, lines.lines[1]] - lines.points[:, lines.lines[0]], axis=0)
    assert lines.cell_data["tension_mN"][-2] == state.muscle_force("pull")
    assert lines.cell_data["tension_mN"][-1] == pytest.approx(0.3 * (length[-1] - 1.0), rel=1e-12)
    assert [KINDS[k] for k in lines.cell_data["kind"][-2:]] == ["muscle", "spring"]
    assert np.allclose(lines.points[:, -1], [0.0, 0.0, 9.0])
