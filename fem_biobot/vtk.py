"""Files for ParaView and pyvista: `.vtu` bodies, `.vtp` surfaces and lines, and the `.pvd` that lists them over time.

Needs meshio and no renderer, so it works on a machine without graphics. Works on plain arrays; knows nothing of designs
or solvers. Also holds the array work that drawing and writing share: nodes doubled where two regions meet, element
means carried to nodes, and the outer surface of quadratic tetrahedra.
"""

from __future__ import annotations

import base64
import itertools
import os
import zlib
from collections.abc import Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any
from xml.etree.ElementTree import ParseError
from xml.sax.saxutils import quoteattr

import meshio
import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import FileError
from fem_biobot.files import file_error, replacing, write_bytes, write_text

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_CELL_TYPES = {4: "tetra", 10: "tetra10"}
# outward facets of a positively oriented tetrahedron: corners a, b, c, then the nodes between a-b, b-c and c-a
_FACETS = np.array([[0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [2, 0, 3, 6, 7, 9], [0, 2, 1, 6, 5, 4]])
_VTK_TYPES = {
    "f8": "Float64",
    "f4": "Float32",
    "i8": "Int64",
    "i4": "Int32",
    "i2": "Int16",
    "i1": "Int8",
    "u1": "UInt8",
}
_QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


def write_vtu(
    path: str | os.PathLike[str],
    points: NDArray[Any],
    cells: NDArray[Any],
    *,
    point_data: Mapping[str, NDArray[Any]] | None = None,
    cell_data: Mapping[str, NDArray[Any]] | None = None,
    region: NDArray[Any] | None = None,
) -> None:
    """Write a body of tetrahedra with its fields as a compressed binary `.vtu`.

    Parameters
    ----------
    path
        The file; whole or not at all. The same arrays give the same bytes.
    points
        Node positions, (3, n) [mm]; the reference ones if a field `displacement_mm` moves them.
    cells
        Nodes of each element in VTK's order, (10, e) quadratic or (4, e) linear.
    point_data
        Name with unit (`displacement_mm`) to values with the point axis last: scalars (n,), vectors (3, n), symmetric
        tensors (6, n) in the order xx, yy, zz, xy, yz, xz, tensors (3, 3, n), written row by row as nine components.
    cell_data
        The same per element.
    region
        Region number of each element, (e,); becomes the cell field `region`.

    Raises
    ------
    FileError
        A shape does not fit, a name has a blank, a value is not finite, or the file cannot be written.
    """
    points = np.asarray(points, dtype=float)
    cells = np.asarray(cells)
    if points.ndim != 2 or points.shape[0] != 3:
        raise FileError(f"{path}: points have shape {points.shape}, expected (3, n)")
    if cells.ndim != 2 or cells.shape[0] not in _CELL_TYPES:
        raise FileError(f"{path}: cells have shape {cells.shape}, expected (4, e) or (10, e)")
    n_points, n_cells = points.shape[1], cells.shape[1]
    if cells.size and (cells.min() < 0 or cells.max() >= n_points):
        raise FileError(f"{path}: cells name node {cells.max()} (lowest {cells.min()}), expected 0 to {n_points - 1}")
    fields = dict(cell_data or {})
    if region is not None:
        fields["region"] = np.asarray(region, dtype=np.int32)
    mesh = meshio.Mesh(
        _vtk_rows(path, "points", points, n_points),
        [(_CELL_TYPES[cells.shape[0]], np.ascontiguousarray(cells.T, dtype=np.int64))],
        point_data={name: _vtk_rows(path, name, v, n_points) for name, v in (point_data or {}).items()},
        cell_data={name: [_vtk_rows(path, name, v, n_cells)] for name, v in fields.items()},
    )
    with replacing(path) as temporary:
        mesh.write(temporary, file_format="vtu", binary=True, compression="zlib")


def read_vtu(path: str | os.PathLike[str]) -> tuple[Array, Ints, dict[str, Array], dict[str, Array]]:
    """Points (3, n), cells (4 or 10, e), point and cell data of a file that `write_vtu` wrote, point axis last.

    Raises
    ------
    FileError
        It is missing, or not such a file.
    """
    try:
        # meshio.read itself ends the process where it cannot read
        found = meshio.vtu.read(str(path))
        block = found.cells[0]
        cells = {name: np.asarray(values[0]).T for name, values in found.cell_data.items()}
    except OSError as error:
        raise file_error(error, path, doing="read") from None
    except (LookupError, ValueError, AssertionError, ParseError, zlib.error, meshio.ReadError) as error:
        raise FileError(f"{path}: cannot be read ({error}), expected a body as .vtu") from None
    return found.points.T, block.data.T, {name: np.asarray(v).T for name, v in found.point_data.items()}, cells


def _vtk_rows(path: str | os.PathLike[str], name: str, values: NDArray[Any], count: int) -> NDArray[Any]:
    """Point axis first, components in a row; refuses what is not finite or does not fit `count` points."""
    values = np.asarray(values)
    if not name or any(c.isspace() for c in name):
        raise FileError(f"{path}: field name {name!r}, expected one word ending in its unit, such as displacement_mm")
    if values.dtype == bool:
        values = values.astype(np.int8)
    if values.dtype.kind not in "iuf":
        raise FileError(f"{path}: field {name} holds {values.dtype}, expected numbers")
    if values.shape not in ((count,), (3, count), (6, count), (3, 3, count)):
        expected = f"({count},), (3, {count}), (6, {count}) or (3, 3, {count})"
        raise FileError(f"{path}: field {name} has shape {values.shape}, expected {expected}")
    if not np.isfinite(values).all():
        bad = int(np.count_nonzero(~np.isfinite(values)))
        raise FileError(f"{path}: field {name} has {bad} values that are not finite")
    if values.ndim == 1:
        return np.ascontiguousarray(values)
    return np.ascontiguousarray(values.reshape(int(np.prod(values.shape[:-1])), count).T)


def write_vtp(
    path: str | os.PathLike[str],
    points: NDArray[Any],
    polys: NDArray[Any] | Sequence[NDArray[Any]] = (),
    *,
    lines: Sequence[NDArray[Any]] = (),
    vertices: NDArray[Any] | None = None,
    point_data: Mapping[str, NDArray[Any]] | None = None,
    cell_data: Mapping[str, NDArray[Any]] | None = None,
    names: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Write polygons, lines and single points with their fields as a compressed binary `.vtp`.

    Parameters
    ----------
    path
        The file; whole or not at all. The same arrays give the same bytes.
    points
        Positions, (3, n) [mm].
    polys
        Nodes of each polygon, (k, f), counter-clockwise from outside; or several such arrays, of triangles and of
        quadrilaterals, say.
    lines
        Nodes of each polygonal line, (k,).
    vertices
        Nodes shown as single points, (v,).
    point_data, cell_data
        As in `write_vtu`; cells are counted vertices first, then lines, then polygons.
    names
        Lists of words, which ParaView shows as field data: what the numbers of a field stand for.

    Raises
    ------
    FileError
        A shape does not fit, a name has a blank, a value is not finite, or the file cannot be written.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[0] != 3:
        raise FileError(f"{path}: points have shape {points.shape}, expected (3, n)")
    n = points.shape[1]
    blocks = [np.asarray(block) for block in ([polys] if isinstance(polys, np.ndarray) else polys)]
    if any(block.ndim != 2 or len(block) < 3 for block in blocks):
        raise FileError(f"{path}: polys have shape {[b.shape for b in blocks]}, expected (k, f) with k of at least 3")
    rows = [np.asarray(line) for line in lines]
    if any(row.ndim != 1 or len(row) < 2 for row in rows):
        raise FileError(f"{path}: lines have shape {[r.shape for r in rows]}, expected (k,) with k of at least 2")
    single = np.zeros(0, dtype=np.int64) if vertices is None else np.asarray(vertices)
    kinds = {
        "Verts": (single, np.ones(single.size)),
        "Lines": (np.concatenate([[], *rows]), np.array([len(row) for row in rows])),
        "Polys": (
            np.concatenate([[], *(block.T.ravel() for block in blocks)]),
            np.concatenate([[], *(np.full(block.shape[1], len(block)) for block in blocks)]),
        ),
    }
    for kind, (nodes, _) in kinds.items():
        if nodes.size and (nodes.min() < 0 or nodes.max() >= n):
            found = f"{nodes.max():.0f} (lowest {nodes.min():.0f})"
            raise FileError(f"{path}: {kind.lower()} name point {found}, expected 0 to {n - 1}")
    n_cells = sum(counts.size for _, counts in kinds.values())
    parts = [f"<FieldData>{_words(path, names or {})}</FieldData>"]
    sizes = " ".join(f'NumberOf{kind}="{counts.size}"' for kind, (_, counts) in kinds.items())
    parts.append(f'<Piece NumberOfPoints="{n}" {sizes} NumberOfStrips="0">')
    for tag, data, count in (("PointData", point_data, n), ("CellData", cell_data, n_cells)):
        arrays = [_data_array(name, _vtk_rows(path, name, v, count)) for name, v in (data or {}).items()]
        parts.append(f"<{tag}>{''.join(arrays)}</{tag}>")
    parts.append(f"<Points>{_data_array('Points', _vtk_rows(path, 'points', points, n))}</Points>")
    for kind, (nodes, counts) in kinds.items():
        where = _data_array("connectivity", nodes.astype(np.int64))
        ends = _data_array("offsets", np.cumsum(counts).astype(np.int64))
        parts.append(f"<{kind}>{where}{ends}</{kind}>")
    head = (
        '<?xml version="1.0"?>\n<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<PolyData>'
    )
    text = "\n".join([head, *parts, "</Piece>\n</PolyData>\n</VTKFile>\n"])
    write_bytes(path, text.encode("utf-8"))


def _data_array(name: str, rows: NDArray[Any]) -> str:
    """A field in VTK's XML: one compressed block in base64, after its sizes."""
    kind = rows.dtype.kind + str(rows.dtype.itemsize)
    if kind not in _VTK_TYPES:
        rows, kind = (rows.astype(np.int64), "i8") if rows.dtype.kind in "iu" else (rows.astype(float), "f8")
    raw = rows.astype(rows.dtype.newbyteorder("<"), copy=False).tobytes()
    block = zlib.compress(raw, 6)
    header = np.array([1, len(raw), 0, len(block)] if raw else [0, 0, 0], dtype="<u8").tobytes()
    data = (base64.b64encode(header) + (base64.b64encode(block) if raw else b"")).decode("ascii")
    width = rows.shape[1] if rows.ndim == 2 else 1
    kind, label = _VTK_TYPES[kind], quoteattr(name)
    return f'<DataArray type="{kind}" Name={label} NumberOfComponents="{width}" format="binary">{data}</DataArray>'


def _words(path: str | os.PathLike[str], names: Mapping[str, Sequence[str]]) -> str:
    """Lists of words in VTK's XML: their bytes as numbers, a zero after each word."""
    out = []
    for name, words in names.items():
        if not name or any(c.isspace() for c in name):
            raise FileError(f"{path}: list of names {name!r}, expected one word")
        numbers = " ".join(str(byte) for word in words for byte in (*word.encode("utf-8"), 0))
        head = f'type="String" Name={quoteattr(name)} NumberOfTuples="{len(words)}" format="ascii"'
        out.append(f"<Array {head}>{numbers}</Array>")
    return "".join(out)


def write_pvd(path: str | os.PathLike[str], entries: Sequence[tuple[float, str]]) -> None:
    """Write the list of a series' files, which ParaView opens as one object over time.

    Parameters
    ----------
    path
        The `.pvd` file.
    entries
        Time (or another increasing parameter) and file name of each state. Names are relative to the `.pvd`'s folder.

    Raises
    ------
    FileError
        Times that do not increase, a name that is absolute or leaves the folder, or the file cannot be written.
    """
    times = [float(time) for time, _ in entries]
    if not np.isfinite(times).all() or any(b <= a for a, b in itertools.pairwise(times)):
        raise FileError(f"{path}: times of the states are {times}, expected increasing numbers")
    rows = []
    for time, name in zip(times, (name for _, name in entries), strict=True):
        file = PurePosixPath(str(name).replace("\\", "/"))
        if not file.name or file.is_absolute() or ".." in file.parts or ":" in file.parts[0]:
            raise FileError(f"{path}: state file {name} must be named relative to the folder of the .pvd")
        rows.append(f'    <DataSet timestep="{time!r}" group="" part="0" file={quoteattr(str(file))}/>')
    head = '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">'
    text = "\n".join(['<?xml version="1.0"?>', head, "  <Collection>", *rows, "  </Collection>", "</VTKFile>", ""])
    write_text(path, text)


def split_by_region(cells: Ints, region_of_element: Ints, *, n_points: int | None = None) -> tuple[Ints, Ints]:
    """Double the nodes that regions share, so that a point field may jump from one region to the next.

    Parameters
    ----------
    cells
        Nodes of each element, (k, e).
    region_of_element
        Region number of each element, (e,).
    n_points
        Number of nodes; the largest in `cells` plus one if left out.

    Returns
    -------
    node_map
        Old node of each new node, (m,), m >= n. The first n are 0 to n-1: every old number stays valid, and
        ``values[..., node_map]`` carries a continuous field over.
    new_cells
        Elements on the new nodes, (k, e). Elements of two regions share no node.
    """
    n = int(cells.max()) + 1 if n_points is None else n_points
    region = np.unique(np.asarray(region_of_element), return_inverse=True)[1].astype(np.int64)
    count = int(region.max()) + 1
    node, where = np.unique((cells * count + region).ravel(), return_inverse=True)  # pairs of (old node, region)
    old = node // count
    first = np.ones(old.size, dtype=bool)
    first[1:] = old[1:] != old[:-1]
    number = np.where(first, old, 0)
    number[~first] = n + np.arange(np.count_nonzero(~first))
    node_map = np.concatenate([np.arange(n, dtype=np.int64), old[~first].astype(np.int64)])
    return node_map, number[where].reshape(cells.shape).astype(np.int64)


def nodal_mean(
    cells: Ints, values: NDArray[Any], *, weights: NDArray[Any] | None = None, n_points: int | None = None
) -> Array:
    """Weighted mean at each node of the values of the elements around it.

    Parameters
    ----------
    cells
        Nodes of each element, (k, e); from `split_by_region` to keep jumps between regions.
    values
        Element values with the element axis last, (..., e).
    weights
        Positive weight of each element, (e,), usually its volume; equal if left out.
    n_points
        Number of nodes; the largest in `cells` plus one if left out.

    Returns
    -------
    Array
        Values at the nodes, (..., n); zero at nodes of no element. Constants are reproduced.
    """
    values = np.asarray(values, dtype=float)
    n = int(cells.max()) + 1 if n_points is None else n_points
    weight = np.ones(cells.shape[1]) if weights is None else np.asarray(weights, dtype=float)
    nodes = cells.ravel()
    total = np.bincount(nodes, np.tile(weight, cells.shape[0]), n)
    rows = (values * weight).reshape(-1, cells.shape[1])
    sums = np.array([np.bincount(nodes, np.tile(row, cells.shape[0]), n) for row in rows])
    return (sums / np.where(total > 0.0, total, 1.0)).reshape(*values.shape[:-1], n)


def nodal_mean_of_nodes(cells: Ints, values: Array, *, weights: Array, n_points: int) -> Array:
    """Weighted mean at each node of what the elements around it say AT that node.

    Parameters
    ----------
    cells
        Nodes of each element, (k, e).
    values
        What each element says at its own nodes, (k, e).
    weights
        Positive weight of each element, (e,), usually its volume.
    n_points
        Number of nodes.

    Returns
    -------
    Array
        Values at the nodes, (n,); zero at nodes of no element. A field linear in the elements is carried to the surface
        whole, where means over elements would cut it off.
    """
    weight = np.broadcast_to(weights, cells.shape).ravel()
    nodes = cells.ravel()
    total = np.bincount(nodes, weight, n_points)
    return np.bincount(nodes, weight * values.ravel(), n_points) / np.where(total > 0.0, total, 1.0)


def boundary_surface(cells: Ints, *, node_map: Ints | None = None) -> Ints:
    """Outer surface of a body of tetrahedra as triangles between neighbouring nodes.

    Parameters
    ----------
    cells
        Nodes of each element in VTK's order, positively oriented, (10, e) or (4, e); a subset of a mesh is a body too.
    node_map
        From `split_by_region`, where `cells` are its new cells: facets between regions then count as interior.

    Returns
    -------
    Ints
        Triangles, (3, f), turning counter-clockwise seen from outside. A quadratic facet gives four.
    """
    local = _FACETS if cells.shape[0] == 10 else _FACETS[:, :3]
    facets = cells[local].transpose(1, 0, 2).reshape(local.shape[1], -1)  # (6 or 3, 4 e)
    corners = facets[:3] if node_map is None else node_map[facets[:3]]
    key = np.sort(corners, axis=0)
    order = np.lexsort(key)
    same = (key[:, order[1:]] == key[:, order[:-1]]).all(axis=0)
    inner = np.zeros(order.size, dtype=bool)
    inner[1:] |= same
    inner[:-1] |= same
    outer = np.sort(order[~inner])
    if cells.shape[0] == 4:
        return facets[:, outer]
    return facets[:, outer][_QUARTERS.T].reshape(3, -1)
