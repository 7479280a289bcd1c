"""Bodies written for ParaView come back as they were; the outer surface is the outer surface."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import pyvista
import skfem

from fem_biobot.errors import FileError
from fem_biobot.vtk import boundary_surface, nodal_mean, read_vtu, split_by_region, write_pvd, write_vtu

BOX = (2.0, 1.0, 1.5)


def box(counts: tuple[int, int, int] = (5, 4, 6)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes (3, n), positively oriented quadratic elements (10, e), and two regions cut at x = 1."""
    mesh = skfem.MeshTet.init_tensor(*(np.linspace(0.0, size, n) for size, n in zip(BOX, counts, strict=True)))
    corner = mesh.p[:, mesh.t]
    volume = np.linalg.det((corner[:, 1:] - corner[:, :1]).transpose(2, 0, 1))
    corners = np.where(volume > 0, mesh.t, mesh.t[[1, 0, 2, 3]])
    # turned in place, so that each of an element's four facets comes to lie on the surface somewhere
    turns = np.array([[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0], [1, 2, 0, 3]])
    mesh = skfem.MeshTet(mesh.p, np.take_along_axis(corners, turns[np.arange(corners.shape[1]) % 5].T, axis=0))
    basis = skfem.Basis(mesh, skfem.ElementTetP2(), intorder=1)
    cells = basis.element_dofs
    return basis.doflocs, cells, (basis.doflocs[0, cells[:4]].mean(axis=0) > 1.0).astype(np.int64)


def area_vectors(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = points[:, triangles].transpose(1, 0, 2)
    return np.cross(b - a, c - a, axis=0) / 2.0


def test_a_body_is_read_back_by_vtk_with_all_its_fields(tmp_path: Path) -> None:
    """Catches: node order not VTK's, points and components swapped, a field of one element block lost, float32."""
    points, cells, region = box()
    rng = np.random.default_rng(7)
    n, e = points.shape[1], cells.shape[1]
    u, sigma, P = rng.normal(size=(3, n)), rng.normal(size=(6, n)), rng.normal(size=(3, 3, n))
    stretch = rng.normal(size=e)
    write_vtu(
        tmp_path / "a.vtu",
        points,
        cells,
        point_data={"displacement_mm": u, "cauchy_stress_kPa": sigma, "first_piola_kPa": P, "s_1": u[0]},
        cell_data={"fibre_stretch_1": stretch, "fibre_1": rng.normal(size=(3, e))},
        region=region,
    )
    grid = pyvista.read(tmp_path / "a.vtu")
    assert set(grid.celltypes) == {pyvista.CellType.QUADRATIC_TETRA}
    assert np.array_equal(grid.points, points.T)
    assert np.array_equal(grid.cells_dict[pyvista.CellType.QUADRATIC_TETRA], cells.T)
    assert np.array_equal(grid.point_data["displacement_mm"], u.T)
    assert np.array_equal(grid.point_data["cauchy_stress_kPa"][11], sigma[:, 11])
    assert np.array_equal(grid.point_data["first_piola_kPa"][11], P[:, :, 11].ravel())
    assert np.array_equal(grid.point_data["s_1"], u[0])
    assert np.array_equal(grid.cell_data["fibre_stretch_1"], stretch)
    assert grid.cell_data["fibre_1"].shape == (e, 3)
    assert np.array_equal(grid.cell_data["region"], region)
    # VTK integrates each quadratic element itself: a wrong node order would not give the box
    assert grid.compute_cell_sizes()["Volume"].sum() == pytest.approx(3.0, rel=1e-12)


def test_a_body_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    """Catches: axes swapped on the way back, fields of cells among those of points, a process that a bad file ends."""
    points, cells, region = box((2, 2, 3))
    u, s = np.sin(points) + 0.1, np.arange(cells.shape[1], dtype=float)
    write_vtu(tmp_path / "a.vtu", points, cells, point_data={"u_mm": u}, cell_data={"s_kPa": s}, region=region)
    found = read_vtu(tmp_path / "a.vtu")
    np.testing.assert_array_equal(found[0], points)
    np.testing.assert_array_equal(found[1], cells)
    np.testing.assert_array_equal(found[2]["u_mm"], u)
    np.testing.assert_array_equal(found[3]["s_kPa"], s)
    np.testing.assert_array_equal(found[3]["region"], region)
    with pytest.raises(FileError, match="b\\.vtu"):
        read_vtu(tmp_path / "b.vtu")
    whole = (tmp_path / "a.vtu").read_bytes()
    for number, content in enumerate((b"[muscle]", b"", whole[: len(whole) // 2])):
        (tmp_path / f"{number}.vtu").write_bytes(content)
        with pytest.raises(FileError, match=r"cannot be read .* expected a body as \.vtu"):
            read_vtu(tmp_path / f"{number}.vtu")


def test_linear_elements_are_written_too(tmp_path: Path) -> None:
    """Catches: quadratic cell type hard-wired."""
    points, cells, _ = box()
    write_vtu(tmp_path / "a.vtu", points[:, : cells[:4].max() + 1], cells[:4])
    assert set(pyvista.read(tmp_path / "a.vtu").celltypes) == {pyvista.CellType.TETRA}


def test_the_same_arrays_give_the_same_bytes(tmp_path: Path) -> None:
    """Catches: a time stamp or a file name inside the file; a temporary file left; input changed."""
    points, cells, region = box()
    before = points.copy()
    for name in ("a.vtu", "b.vtu"):
        write_vtu(tmp_path / name, points, cells, point_data={"displacement_mm": points}, region=region)
    assert (tmp_path / "a.vtu").read_bytes() == (tmp_path / "b.vtu").read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.vtu", "b.vtu"]
    assert np.array_equal(points, before)


@pytest.mark.parametrize(
    ("name", "values", "word"),
    [
        ("u_mm", np.zeros((4, 3)), "u_mm has shape"),
        ("u_mm", np.array([0.0, np.nan, 0.0, 0.0]), "u_mm has 1 values that are not finite"),
        ("von mises", np.zeros(4), "von mises"),
        ("u_mm", np.array(["a"] * 4), "expected numbers"),
    ],
)
def test_fields_that_do_not_fit_are_refused_by_name(tmp_path: Path, name: str, values: np.ndarray, word: str) -> None:
    """Catches: a transposed field or NaN reaching ParaView in silence."""
    points = np.hstack([np.zeros((3, 1)), np.eye(3)])
    with pytest.raises(FileError, match=word):
        write_vtu(tmp_path / "a.vtu", points, np.arange(4)[:, None], point_data={name: values})
    assert list(tmp_path.iterdir()) == []


def test_points_and_cells_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    """Catches: points given as rows, triangles, an element that names a node which is not there."""
    points, cells = np.hstack([np.zeros((3, 1)), np.eye(3)]), np.arange(4)[:, None]
    with pytest.raises(FileError, match="points have shape"):
        write_vtu(tmp_path / "a.vtu", points.T, cells)
    with pytest.raises(FileError, match="cells have shape"):
        write_vtu(tmp_path / "a.vtu", points, cells[:3])
    with pytest.raises(FileError, match="cells name node 4"):
        write_vtu(tmp_path / "a.vtu", points, cells + 1)


def test_vtk_reads_the_series_with_its_times(tmp_path: Path) -> None:
    """Catches: attributes that VTK does not know, times rounded, files looked for in the working folder."""
    points, cells, _ = box((2, 2, 2))
    for i, scale in enumerate((0.5, 2.5)):
        write_vtu(tmp_path / f"solid_{i}.vtu", points, cells, point_data={"displacement_mm": scale * points})
    write_pvd(tmp_path / "solid.pvd", [(1.0 / 3.0, "solid_0.vtu"), (9.09, "solid_1.vtu")])
    reader = pyvista.get_reader(tmp_path / "solid.pvd")
    assert reader.time_values == [1.0 / 3.0, 9.09]
    reader.set_active_time_value(9.09)
    assert np.allclose(reader.read()[0].point_data["displacement_mm"], 2.5 * points.T, rtol=1e-15)


def test_series_names_are_escaped(tmp_path: Path) -> None:
    """Catches: text pasted into XML."""
    write_pvd(tmp_path / "a.pvd", [(0.0, 'a "b" & c.vtu')])
    sets = ET.parse(tmp_path / "a.pvd").getroot().findall("Collection/DataSet")
    assert [s.get("file") for s in sets] == ['a "b" & c.vtu']


def test_a_series_refuses_times_that_go_back_and_names_outside_its_folder(tmp_path: Path) -> None:
    """Catches: ParaView sorting or dropping states, and a folder that breaks when it is moved."""
    with pytest.raises(FileError, match="increasing"):
        write_pvd(tmp_path / "a.pvd", [(1.0, "a.vtu"), (1.0, "b.vtu")])
    for name in ("/tmp/a.vtu", "../a.vtu", "C:\\a.vtu", ""):
        with pytest.raises(FileError, match="relative"):
            write_pvd(tmp_path / "a.pvd", [(1.0, name)])


def test_regions_share_no_node_after_the_split_and_old_numbers_stay() -> None:
    """Catches: an interface node left shared, old node numbers shuffled, elements moved."""
    points, cells, region = box()
    node_map, split = split_by_region(cells, region)
    assert np.array_equal(node_map[: points.shape[1]], np.arange(points.shape[1]))
    assert np.array_equal(node_map[split], cells)
    assert not set(split[:, region == 0].ravel()) & set(split[:, region == 1].ravel())
    interface = np.count_nonzero(points[0] == 1.0)
    assert interface > 20
    assert node_map.size == points.shape[1] + interface


def test_three_regions_at_one_node_get_three_nodes() -> None:
    """Catches: region numbers taken as 0 and 1."""
    cells = np.array([[0, 0, 0], [1, 3, 4], [2, 2, 5], [6, 7, 8]])
    node_map, split = split_by_region(cells, np.array([12, -3, 5]))
    assert np.unique(split[0]).size == 3
    assert np.count_nonzero(node_map == 0) == 3
    assert np.array_equal(node_map[split], cells)


def test_nodal_means_keep_the_jump_between_regions_and_weigh_by_volume() -> None:
    """Catches: averaging across the interface, weights forgotten."""
    _, cells, region = box()
    node_map, split = split_by_region(cells, region)
    rows = nodal_mean(split, np.array([region * 3.0 + 4.0, region * 1.0]))
    assert rows.shape == (2, node_map.size)
    assert np.allclose(rows[0, split[:, region == 1]], 7.0, rtol=1e-14)
    assert np.allclose(rows[0, split[:, region == 0]], 4.0, rtol=1e-14)
    pair = np.array([[0, 0], [1, 1], [2, 2], [3, 4]])
    mean = nodal_mean(pair, np.array([1.0, 5.0]), weights=np.array([3.0, 1.0]), n_points=6)
    assert mean == pytest.approx([2.0, 2.0, 2.0, 1.0, 5.0, 0.0])


@pytest.mark.parametrize("nodes", [4, 10])
def test_the_surface_is_the_box(nodes: int) -> None:
    """Catches: an interior facet kept, a facet lost, a triangle turned inward, midside nodes in the wrong order."""
    points, cells, region = box()
    triangles = boundary_surface(cells[:nodes])
    area = area_vectors(points, triangles)
    exact = 2.0 * (2.0 * 1.0 + 1.0 * 1.5 + 2.0 * 1.5)
    assert np.linalg.norm(area, axis=0).sum() == pytest.approx(exact, rel=1e-12)
    volume = (area * points[:, triangles].mean(axis=1)).sum() / 3.0  # divergence theorem
    assert volume == pytest.approx(3.0, rel=1e-12)
    # closed: each edge is passed once in each direction, so quarters of one facet and of neighbours fit together
    edges = np.hstack([triangles[[0, 1]], triangles[[1, 2]], triangles[[2, 0]]])
    there, back = ({(int(a), int(b)) for a, b in pair.T} for pair in (edges, edges[::-1]))
    assert there == back
    assert len(there) == edges.shape[1]
    half = boundary_surface(cells[:nodes][:, region == 1])
    assert np.linalg.norm(area_vectors(points, half), axis=0).sum() == pytest.approx(8.0, rel=1e-12)


def test_the_surface_of_a_split_body_leaves_the_interface_out() -> None:
    """Catches: facets compared by doubled nodes, so that the interface shows as surface."""
    points, cells, region = box()
    node_map, split = split_by_region(cells, region)
    triangles = boundary_surface(split, node_map=node_map)
    area = area_vectors(points[:, node_map], triangles)
    assert np.linalg.norm(area, axis=0).sum() == pytest.approx(13.0, rel=1e-12)
    assert not np.all(points[0, node_map][triangles] == 1.0, axis=0).any()
