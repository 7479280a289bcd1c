"""Surfaces from STL: the same body whatever the file's kind, faces whole again, nothing but closed bodies taken."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay

from fem_biobot.errors import FileError, MeshError
from fem_biobot.mesh.stl import plane_faces, read_stl
from tests.helpers import rotation

# a cube's sides as quadrilaterals, counter-clockwise from outside, of the corners x + 2 y + 4 z
SIDES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


def box(low: tuple[float, float, float], high: tuple[float, float, float], parts: int = 1) -> np.ndarray:
    """Triangles of a box, each side cut into `parts` by `parts` pieces, (f, 3, 3)."""
    corner = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    found = []
    for a, b, _, d in SIDES:
        along, across = (corner[b] - corner[a]) / parts, (corner[d] - corner[a]) / parts
        for i in range(parts):
            for j in range(parts):
                p = corner[a] + i * along + j * across
                found += [[p, p + along, p + along + across], [p, p + along + across, p + across]]
    return np.array(low) + np.array(found) * (np.array(high) - np.array(low))


def with_hole() -> np.ndarray:
    """A box with a square hole right through it, (f, 3, 3)."""
    outer, inner = box((0, 0, 0), (3, 3, 1)), box((1, 1, 0), (2, 2, 1))
    walls = [t[::-1] for t in inner if np.ptp(t[:, 2]) > 0]
    sides = [t for t in outer if np.ptp(t[:, 2]) > 0]
    ring = [((0, 0), (1, 1)), ((3, 0), (2, 1)), ((3, 3), (2, 2)), ((0, 3), (1, 2))]
    lids = []
    for (a, b), (c, d) in zip(ring, ring[1:] + ring[:1], strict=True):
        for z, turn in ((0.0, -1), (1.0, 1)):
            p, q, r, s = (np.array([*xy, z]) for xy in (a, c, d, b))
            lids += [np.array([p, q, r])[::turn], np.array([p, r, s])[::turn]]
    return np.array([*sides, *walls, *lids])


def text_of(triangles: np.ndarray) -> bytes:
    lines = ["solid part"]
    for t in triangles:
        lines += ["facet normal 0 0 0", "outer loop", *("vertex {:.9g} {:.9g} {:.9g}".format(*p) for p in t)]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid part"]).encode()


def binary_of(triangles: np.ndarray) -> bytes:
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows = np.zeros(len(triangles), kind)
    rows["corners"] = triangles
    # a header that begins like a text file, as some programs write it
    return b"solid of a program".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes()


@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("written", [text_of, binary_of])
def test_a_box_has_six_faces_of_four_corners_however_it_was_cut(tmp_path: Path, written, parts: int) -> None:
    """Catches: triangles kept as faces, points on straight edges kept as corners, a binary file taken for a text."""
    file = tmp_path / "box.stl"
    file.write_bytes(written(box((0.5, -1.0, 0.2), (2.7, 2.06, 3.6), parts)))
    found = read_stl(file, "mm")
    assert found.points.shape == (3, 8)
    assert [[len(loop) for loop in face] for face in found.loops] == [[4]] * 6
    assert found.volume == pytest.approx(2.2 * 3.06 * 3.4, rel=1e-9)
    assert found.points.max(axis=1) == pytest.approx([2.7, 2.06, 3.6], abs=1e-12)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1e3), ("cm", 10.0), ("um", 1e-3), ("in", 25.4)])
def test_numbers_are_taken_in_their_unit(tmp_path: Path, unit: str, factor: float) -> None:
    """Catches: a factor turned round."""
    (tmp_path / "box.stl").write_bytes(text_of(box((0, 0, 0), (1, 2, 3))))
    assert read_stl(tmp_path / "box.stl", unit).volume == pytest.approx(6.0 * factor**3, rel=1e-9)


def test_a_face_with_a_hole_keeps_its_outer_loop_first() -> None:
    """Catches: the hole taken for the face, loops of different faces joined."""
    found = plane_faces(with_hole())
    holed = [face for face in found.loops if len(face) == 2]
    assert len(found.loops) == 10
    assert len(holed) == 2
    for outer, inner in holed:
        assert np.ptp(found.points[0, outer]) == 3.0
        assert np.ptp(found.points[0, inner]) == 1.0
    assert found.volume == pytest.approx(8.0, rel=1e-12)


def test_a_turned_round_body_stays_many_faces() -> None:
    """A cone of 24 sides in a general position has 25 faces.

    Catches: planes only found along the axes, sides of a round body melted together.
    """
    angle = 2.0 * np.pi * np.arange(24) / 24
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(24)], axis=1)
    tip, foot = np.array([0.0, 0.0, 1.7]), np.zeros(3)
    after = np.roll(rim, -1, axis=0)
    triangles = [[a, b, tip] for a, b in zip(rim, after, strict=True)]
    triangles += [[b, a, foot] for a, b in zip(rim, after, strict=True)]
    found = plane_faces(np.array(triangles) @ rotation(3).T)
    assert sorted(len(loop) for (loop,) in found.loops) == [3] * 24 + [24]


@pytest.mark.parametrize(
    ("triangles", "words"),
    [
        (box((0, 0, 0), (1, 1, 1))[1:], "not watertight: 3 of 18 edges"),
        (np.concatenate([box((0, 0, 0), (1, 1, 1)), box((2, 0, 0), (3, 1, 1))]), "2 closed surfaces"),
        (np.concatenate([box((0, 0, 0), (1, 1, 1)), box((1, 1, 0), (2, 2, 1))]), "4 triangles"),
        (np.concatenate([box((0, 0, 0), (1, 1, 1))[:1, ::-1], box((0, 0, 0), (1, 1, 1))[1:]]), "turn differently"),
        (np.concatenate([box((0, 0, 0), (1, 1, 1))[:1], box((0, 0, 0), (1, 1, 1))[:1, ::-1]]), "volume"),
        (np.full((1, 3, 3), np.inf), "finite"),
        (np.zeros((0, 3, 3)), "0 triangles"),
    ],
)
def test_what_is_no_closed_body_is_refused(tmp_path: Path, triangles: np.ndarray, words: str) -> None:
    """Catches: a mesh that leaks, two bodies taken for one, an empty file."""
    file = tmp_path / "a.stl"
    file.write_bytes(binary_of(triangles))
    with pytest.raises(MeshError, match=words) as told:
        read_stl(file, "mm")
    assert str(file) in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"hello", "no STL file"), (b"solid a\nvertex 1 2 x\n", "vertices"), (b"solid\nvertex 1 2 3", "vertices")],
)
def test_what_is_no_stl_file_is_refused(tmp_path: Path, content: bytes, words: str) -> None:
    """Catches: any file read as some triangles."""
    (tmp_path / "a.stl").write_bytes(content)
    with pytest.raises(MeshError, match=words):
        read_stl(tmp_path / "a.stl", "mm")


def test_a_file_that_is_not_there_and_a_unit_that_is_none_are_refused(tmp_path: Path) -> None:
    """Catches: the system's own words, a unit guessed."""
    with pytest.raises(FileError, match=r"a\.stl"):
        read_stl(tmp_path / "a.stl", "mm")
    with pytest.raises(MeshError, match="unit: found 'ft', expected one of: mm"):
        read_stl(tmp_path / "a.stl", "ft")


def test_a_surface_of_too_many_faces_is_refused() -> None:
    """Catches: a scan of a hundred thousand triangles that meshes for hours."""
    rows = np.random.default_rng(5).normal(size=(3000, 3))
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    triangles = rows[ConvexHull(rows).simplices]
    inward = (
        np.einsum(
            "fi,fi->f", np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), triangles[:, 0]
        )
        < 0
    )
    triangles[inward] = triangles[inward][:, ::-1]
    with pytest.raises(MeshError, match="plane faces, expected at most 5000"):
        plane_faces(triangles)


def test_a_face_that_touches_itself_at_a_corner_is_refused() -> None:
    """Two dents in one lid that meet at a point of it.

    Catches: loops that run on into one another.
    """
    flat = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [2, 2], [1, 1.5], [1, 2.5], [3, 1.5], [3, 2.5]])
    found = [np.array(t) for t in box((0, 0, -2), (4, 4, 0)) if t[:, 2].min() < 0.0]
    dents = 0
    for t in Delaunay(flat).simplices:
        corners = np.column_stack([flat[t], np.zeros(3)])
        if np.cross(corners[1] - corners[0], corners[2] - corners[0])[2] < 0.0:
            corners = corners[::-1]
        if set(t) in ({4, 5, 6}, {4, 7, 8}):
            tip = corners.mean(axis=0) - [0.0, 0.0, 0.5]
            found += [np.array([a, b, tip]) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
            dents += 1
        else:
            found.append(corners)
    assert dents == 2
    with pytest.raises(MeshError, match=r"touches itself at a corner.*give a STEP file"):
        plane_faces(np.array(found))
