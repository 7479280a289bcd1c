"""Surfaces, lines and points written for ParaView come back as they were, by VTK's own reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import pyvista

from fem_biobot.errors import FileError
from fem_biobot.vtk import write_pvd, write_vtp

POINTS = np.array([[0.0, 2.0, 2.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0, 0.5], [0.5, 0.5, 0.5, 0.5, 1.7]])
SQUARE = np.array([[3], [2], [1], [0]])
TRIANGLES = np.array([[0, 1, 2, 3], [1, 2, 3, 0], [4, 4, 4, 4]])


def written(path: Path, **fields: object) -> pyvista.PolyData:
    write_vtp(path, POINTS, [SQUARE, TRIANGLES], **fields)  # type: ignore[arg-type]
    found = pyvista.read(path)
    assert isinstance(found, pyvista.PolyData)
    return found


def test_a_surface_is_read_back_by_vtk_with_its_shape(tmp_path: Path) -> None:
    """Catches: offsets counted from the start of each block, points and components swapped, a polygon turned inward."""
    found = written(tmp_path / "a.vtp")
    assert np.array_equal(found.points, POINTS.T)
    assert found.faces.tolist() == [4, 3, 2, 1, 0, 3, 0, 1, 4, 3, 1, 2, 4, 3, 2, 3, 4, 3, 3, 0, 4]
    assert found.n_open_edges == 0
    # a pyramid of base 2 x 1 and height 1.2; VTK's volume is signed by the turn of the polygons
    assert found.triangulate().volume == pytest.approx(2.0 * 1.2 / 3.0, rel=1e-12)


def test_fields_come_back_at_their_points_and_cells(tmp_path: Path) -> None:
    """Catches: cells counted polygons first, whole numbers turned to floats, a vector's components as points."""
    rng = np.random.default_rng(11)
    force, weight = rng.normal(size=(3, 5)), rng.normal(size=8)
    found = written(
        tmp_path / "a.vtp",
        vertices=np.array([4]),
        lines=[np.array([0, 4, 2]), np.array([1, 3])],
        point_data={"force_mN": force, "node": np.arange(5, dtype=np.int16)},
        cell_data={"weight_1": weight, "part": np.arange(8, dtype=np.int32)},
        names={"part_names": ["bar", "fuß & <sole>", ""]},
    )
    assert np.array_equal(found.point_data["force_mN"], force.T)
    assert found.point_data["node"].dtype == np.int16
    assert found.verts.tolist() == [1, 4]
    assert found.lines.tolist() == [3, 0, 4, 2, 2, 1, 3]
    assert np.array_equal(found.cell_data["weight_1"], weight)
    # the single point, two lines, the square and four triangles
    assert [found.get_cell(k).n_points for k in range(8)] == [1, 3, 2, 4, 3, 3, 3, 3]
    assert list(found.field_data["part_names"]) == ["bar", "fuß & <sole>", ""]


def test_files_are_whole_the_same_and_alone(tmp_path: Path) -> None:
    """Catches: a time stamp inside, a temporary file left, a folder that VTK needs beside the file."""
    for name in ("a.vtp", "b.vtp"):
        written(tmp_path / name, point_data={"u_mm": POINTS})
    assert (tmp_path / "a.vtp").read_bytes() == (tmp_path / "b.vtp").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.vtp", "b.vtp"]


def test_nothing_to_show_is_a_file_too(tmp_path: Path) -> None:
    """Catches: an empty set of contact points that breaks the writer or VTK."""
    write_vtp(
        tmp_path / "a.vtp", np.zeros((3, 0)), vertices=np.zeros(0, dtype=int), point_data={"f_mN": np.zeros((3, 0))}
    )
    found = pyvista.read(tmp_path / "a.vtp")
    assert isinstance(found, pyvista.PolyData)
    assert (found.n_points, found.n_cells) == (0, 0)


def test_a_series_of_surfaces_keeps_its_times(tmp_path: Path) -> None:
    """Catches: times rounded, the second file read for the first time."""
    for i in range(2):
        write_vtp(tmp_path / f"rod_{i}.vtp", POINTS * (1.0 + i), SQUARE)
    write_pvd(tmp_path / "rod.pvd", [(1.0 / 7.0, "rod_0.vtp"), (0.35, "rod_1.vtp")])
    reader = pyvista.get_reader(tmp_path / "rod.pvd")
    assert reader.time_values == [1.0 / 7.0, 0.35]  # type: ignore[attr-defined]
    reader.set_active_time_value(0.35)  # type: ignore[attr-defined]
    assert np.array_equal(reader.read()[0].points, 2.0 * POINTS.T)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"points": POINTS.T}, "points have shape"),
        ({"polys": SQUARE[:2]}, "polys have shape"),
        ({"polys": SQUARE[:, 0]}, "polys have shape"),
        ({"polys": SQUARE + 3}, "polys name point 6"),
        ({"polys": SQUARE - 1}, "lowest -1"),
        ({"lines": [np.array([2])]}, "lines have shape"),
        ({"lines": [np.array([2, 5])]}, "lines name point 5"),
        ({"vertices": np.array([5])}, "verts name point 5"),
        ({"point_data": {"u_mm": POINTS[:, :4]}}, "u_mm has shape"),
        ({"cell_data": {"part": np.zeros(2)}}, "part has shape"),
        ({"point_data": {"u_mm": np.full(5, np.inf)}}, "not finite"),
        ({"names": {"part names": ["a"]}}, "part names"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path: Path, change: dict[str, object], word: str) -> None:
    """Catches: a field of another mesh, points given as rows, or a polygon of no point reaching ParaView."""
    given: dict[str, object] = {"points": POINTS, "polys": SQUARE, **change}
    with pytest.raises(FileError, match=word):
        write_vtp(tmp_path / "a.vtp", **given)  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []
