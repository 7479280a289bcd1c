"""Mesh files: any tagged tetrahedral `.msh` in, ours out.

A stranger's mesh is an equal citizen: its volumes carry the names `skeleton` and `muscle`, or names that the caller
maps to them; its named triangles become surfaces, its named single points landmarks. What is unclear is refused.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.errors import FileError, MeshError
from fem_biobot.files import file_error, write_text
from fem_biobot.mesh import msh
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.checks import check_regions
from fem_biobot.mesh.facets import facets, row_keys
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.naming import named_landmarks, named_surfaces, oriented
from fem_biobot.mesh.own_shape import check_shape

Ints = NDArray[np.int64]

REGIONS = ("skeleton", "muscle")


def read_mesh(
    path: str | os.PathLike[str], names: Mapping[str, str] | None = None, *, design: Design | None = None
) -> BodyMesh:
    """Mesh from a Gmsh file of version 2.2 or 4.1, text or binary.

    Parameters
    ----------
    path
        The file.
    names
        Volume names of the file to region names, for files with their own: ``{"gel": "skeleton"}``.
    design
        If given, the mesh must be one of this design: same regions, volumes within 2 %, or pillars of another shape
        in the design's machine (`own_shape.unlike`). Surfaces and landmarks of the design that the file does not
        name are found by position, as far as they lie on facets and vertices.

    Returns
    -------
    BodyMesh
        Checked. Second-order elements are reduced to their vertices, which `source` notes.

    Raises
    ------
    FileError
        The file cannot be read.
    MeshError
        It is no tetrahedral mesh with named volumes, it is damaged, or it fails a check; one line with the file.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise file_error(error, path, doing="read") from None
    try:
        return _body(msh.parse(data), dict(names or {}), str(path), design)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None


def write_mesh(path: str | os.PathLike[str], mesh: BodyMesh) -> None:
    """Write a mesh as Gmsh text of version 4.1 with its names; whole or not at all, the same bytes for the same mesh.

    Raises
    ------
    FileError
        The file cannot be written, or does not end in ``.msh``.
    """
    if Path(path).suffix != ".msh":
        raise FileError(f"{path}: a mesh file ends in .msh")
    write_text(path, mesh_text(mesh))


def mesh_text(mesh: BodyMesh) -> str:
    """Content of a mesh file, see `write_mesh`."""
    names = {(3, k): name for k, name in enumerate(mesh.regions, start=1)}
    blocks = [
        msh.Block(4, (k,), elements + 1, mesh.cells[:, elements] + 1)
        for k, elements in enumerate(mesh.regions.values(), start=1)
    ]
    count = mesh.n_elements
    # a facet that is in several surfaces stands once, on an entity that is in several groups
    members: dict[tuple[int, int, int], list[int]] = {}
    for k, (name, triples) in enumerate(mesh.surfaces.items(), start=1):
        names[2, k] = name
        for triple in triples.T.tolist():
            members.setdefault(_turned(triple), []).append(k)
    for kind, groups in ((2, _grouped(members)), (15, _grouped(_points(mesh.landmarks, names)))):
        for belongs, items in groups.items():
            tags = np.arange(count + 1, count + 1 + len(items))
            blocks.append(msh.Block(kind, belongs, tags, np.array(items).reshape(len(items), -1).T + 1))
            count += len(items)
    return msh.text(mesh.points, blocks, names)


def _turned(triple: list[int]) -> tuple[int, int, int]:
    """The same oriented triangle, smallest vertex first."""
    k = triple.index(min(triple))
    return triple[k], triple[k - 2], triple[k - 1]


def _points(landmarks: Mapping[str, int], names: dict[tuple[int, int], str]) -> dict[int, list[int]]:
    members: dict[int, list[int]] = {}
    for k, (name, vertex) in enumerate(landmarks.items(), start=1):
        names[0, k] = name
        members.setdefault(vertex, []).append(k)
    return members


def _grouped(members: Mapping) -> dict[tuple[int, ...], list]:
    groups: dict[tuple[int, ...], list] = {}
    for item, belongs in members.items():
        groups.setdefault(tuple(sorted(set(belongs))), []).append(item)
    return groups


def _body(raw: msh.Raw, names: dict[str, str], path: str, design: Design | None) -> BodyMesh:
    kinds = {block.kind for block in raw.elements}
    if not kinds & set(msh.TETRAHEDRA):
        found = "triangles only" if kinds & set(msh.TRIANGLES) else "no tetrahedra"
        raise MeshError(f"the mesh has {found}; expected tetrahedra (in Gmsh: mesh in 3D)")
    if not any(dim == 3 for dim, _ in raw.names):
        raise MeshError("the mesh has no named volumes; in Gmsh, make physical volumes named skeleton and muscle")
    cells, regions = _volumes(raw, names)
    order = np.argsort(raw.node_tags, kind="stable")
    tags = raw.node_tags[order]
    if np.any(np.diff(tags) == 0):
        raise MeshError(f"node {tags[np.flatnonzero(np.diff(tags) == 0)[0]]} is there twice")
    spare = _middle_nodes(raw, kinds)
    kept = tags[~np.isin(tags, spare)]
    points = raw.points[:, order[np.searchsorted(tags, kept)]]
    vertices = _numbered(cells, kept)
    surfaces, landmarks, ignored = _lower_names(raw, kept)
    source: dict[str, object] = {"file": path, "format": f"msh {raw.version} {'binary' if raw.binary else 'text'}"}
    if kinds & set(msh.TETRAHEDRA[1:]):
        source["note"] = "elements of higher order were reduced to their vertices"
    if ignored:
        source["ignored"] = sorted(ignored)
    mesh = BodyMesh(points, vertices, regions, surfaces, landmarks, source).checked()
    table, region_of, labels = facets(mesh.cells), mesh.region_of(), list(regions)
    surfaces = oriented(surfaces, table, region_of, labels)
    if design is not None:
        plan = layout(design)
        check_regions(mesh.regions, plan.volumes)
        surfaces = {**named_surfaces(plan, mesh.points, table, region_of, labels), **surfaces}
        landmarks = {**named_landmarks(plan.landmarks, mesh.points), **landmarks}
        found = BodyMesh(mesh.points, mesh.cells, mesh.regions, surfaces, landmarks, source)
        check_shape(plan, found)
        return found
    return BodyMesh(mesh.points, mesh.cells, mesh.regions, surfaces, landmarks, source)


def _volumes(raw: msh.Raw, names: dict[str, str]) -> tuple[Ints, dict[str, Ints]]:
    """Node numbers of the tetrahedra (4, e) in the order of the file's numbers, and the elements of each region."""
    titles = {tag: name for (dim, tag), name in raw.names.items() if dim == 3}
    strange = sorted(set(names) - set(titles.values()))
    if strange:
        raise MeshError(f"names maps {', '.join(strange)}, but the volumes are {', '.join(sorted(titles.values()))}")
    # volumes with other names are refused below, unless their elements are in a known region as well
    region = {tag: names.get(name, name) for tag, name in titles.items() if name in names or name in REGIONS}
    labels = [name for name in REGIONS if name in region.values()]
    labels += sorted(set(region.values()) - set(REGIONS))
    blocks = [block for block in raw.elements if block.kind in msh.TETRAHEDRA]
    solids = {5, 6, 7, 12, 13, 14, 17, 18, 19, 92, 93}
    if any(block.kind in solids for block in raw.elements):
        raise MeshError("the mesh has hexahedra, prisms or pyramids; expected tetrahedra only")
    number = []
    for block in blocks:
        inside = sorted({labels.index(region[g]) for g in block.groups if g in region})
        if len(inside) > 1:
            raise MeshError(f"element {block.tags[0]} is in the regions {' and '.join(labels[k] for k in inside)}")
        number.append(np.full(block.tags.size, inside[0] if inside else -1))
    tags = np.concatenate([block.tags for block in blocks])
    nodes = np.concatenate([block.nodes[:4] for block in blocks], axis=1)
    where = np.concatenate(number)
    order = np.argsort(tags, kind="stable")
    nodes, where = nodes[:, order], where[order]
    if raw.version[0] == "2":
        # this version repeats an element for each of its groups
        keys = row_keys(nodes, int(nodes.max()) + 1)
        nodes, where = _once(keys, nodes, where, labels)
    if np.any(where < 0):
        others = {titles.get(g, f"number {g}, without a name") for b in blocks for g in b.groups if g not in region}
        wanted = " or ".join(REGIONS)
        if not others:
            raise MeshError(
                f"{int((where < 0).sum())} tetrahedra are in no named volume; expected all of them in {wanted} (Gmsh "
                f"leaves the groups out of version 2 when it saves all elements)"
            )
        listed = sorted(others)
        raise MeshError(
            f"the volumes {', '.join(listed)} are not known; expected {wanted}, or a map of names such as "
            f'{{"{listed[0]}": "skeleton"}}'
        )
    for k, label in enumerate(labels):
        if not np.any(where == k):
            raise MeshError(f"region {label} is empty: its volume is named, but has no tetrahedra")
    return nodes, {label: np.flatnonzero(where == k) for k, label in enumerate(labels)}


def _once(keys: Ints, nodes: Ints, where: Ints, labels: list[str]) -> tuple[Ints, Ints]:
    """Each element once, with the region that any of its copies has."""
    _, first, copy_of = np.unique(keys, return_index=True, return_inverse=True)
    best = np.full(first.size, -1)
    np.maximum.at(best, copy_of.reshape(-1), where)
    clash = np.flatnonzero((where >= 0) & (where != best[copy_of.reshape(-1)]))
    if clash.size:
        one, other = labels[where[clash[0]]], labels[best[copy_of.reshape(-1)[clash[0]]]]
        raise MeshError(f"{clash.size} elements are in the regions {one} and {other}")
    order = np.argsort(first)
    return nodes[:, first[order]], best[order]


def _middle_nodes(raw: msh.Raw, kinds: set[int]) -> Ints:
    """Nodes that are only there for the higher order of elements, and are no vertex of any."""
    if not kinds & set(msh.TETRAHEDRA[1:]):
        return np.empty(0, dtype=np.int64)
    corners = {**dict.fromkeys(msh.TETRAHEDRA, 4), **dict.fromkeys(msh.TRIANGLES, 3), **dict.fromkeys(msh.LINES, 2)}
    vertices = [block.nodes[: corners.get(block.kind, 1)].ravel() for block in raw.elements]
    others = [block.nodes[corners.get(block.kind, 1) :].ravel() for block in raw.elements]
    return np.setdiff1d(np.concatenate(others), np.concatenate(vertices))


def _numbered(nodes: Ints, tags: Ints) -> Ints:
    """Vertex indices of node numbers."""
    place = np.minimum(np.searchsorted(tags, nodes), max(tags.size - 1, 0))
    if tags.size == 0 or np.any(tags[place] != nodes):
        raise MeshError(
            f"element nodes such as {nodes[tags[place] != nodes][0] if tags.size else 0} are not in the file"
        )
    return place


def _lower_names(raw: msh.Raw, tags: Ints) -> tuple[dict[str, Ints], dict[str, int], list[str]]:
    """Named surfaces and landmarks; and the names that are neither."""
    surfaces, landmarks, ignored = {}, {}, []
    for (dim, group), name in sorted(raw.names.items()):
        if dim == 3:
            continue
        blocks = [block for block in raw.elements if group in block.groups]
        if dim == 2 and any(block.kind in msh.QUADRANGLES for block in blocks):
            raise MeshError(f"surface {name} has quadrangles; expected triangles")
        wanted = {0: msh.POINT, 2: msh.TRIANGLES}.get(dim, ())
        parts = [block.nodes[: 3 if dim == 2 else 1] for block in blocks if block.kind in wanted]
        nodes = np.concatenate(parts, axis=1) if parts else np.empty((1, 0), dtype=np.int64)
        if dim == 2 and nodes.size:
            surfaces[name] = _numbered(nodes, tags)
        elif dim == 0 and nodes.size == 1:
            landmarks[name] = int(_numbered(nodes, tags)[0, 0])
        else:
            ignored.append(name)
    return surfaces, landmarks, ignored
