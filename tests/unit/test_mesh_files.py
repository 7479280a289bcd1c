"""Mesh files: every version that Gmsh writes comes in, ours go out and come back, damage is refused in one line."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import FileError, MeshError
from fem_biobot.mesh import msh
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.files import committed_mesh, read_mesh, write_mesh
from fem_biobot.mesh.geometry import GmshMissing, import_gmsh
from tests.helpers import box_mesh

# two tetrahedra above each other, a triangle between them and a point, in text that a person could have typed
TWO = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
4
0 4 "top"
2 3 "seam"
3 1 "skeleton"
3 2 "muscle"
$EndPhysicalNames
$Nodes
5
1 0 0 0
2 1 0 0
3 0 1 0
4 0.2 0.2 1
7 0.3 0.3 -1
$EndNodes
$Elements
4
1 15 2 4 1 4
2 2 2 3 1 1 2 3
3 4 2 1 1 1 2 3 4
4 4 2 2 2 1 3 2 7
$EndElements
"""

COMBINATIONS = list(itertools.product((2.2, 4.1), (0, 1), (1, 2)))


@pytest.fixture(scope="module")
def gmsh_files(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Paths of the same two boxes, written by Gmsh itself in every version, as text and binary, of order 1 and 2."""
    try:
        gmsh = import_gmsh()
    except GmshMissing as missing:
        pytest.skip(str(missing))
    folder = tmp_path_factory.mktemp("gmsh")
    for order in (1, 2):
        gmsh.initialize(["test", "-v", "0"], readConfigFiles=False, interruptible=False)
        occ = gmsh.model.occ
        occ.fragment([(3, occ.addBox(0, 0, 0, 1, 1, 1)), (3, occ.addBox(1, 0, 0, 1, 1, 0.5))], [])
        occ.synchronize()

        def near(dim: int, *box: float) -> list[int]:
            return [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*box, dim)]

        low, high = near(2, -0.1, -0.1, -0.1, 1.1, 1.1, 0.1), near(2, 0.9, -0.1, -0.1, 2.1, 1.1, 0.1)
        gmsh.model.addPhysicalGroup(3, near(3, -0.1, -0.1, -0.1, 1.1, 1.1, 1.1), 7, "gel block")
        gmsh.model.addPhysicalGroup(3, near(3, 0.9, -0.1, -0.1, 2.1, 1.1, 0.6), 9, "tissue")
        gmsh.model.addPhysicalGroup(2, low + high, 3, "ground")
        gmsh.model.addPhysicalGroup(2, low, 12, "foot")  # the same entity in two groups
        gmsh.model.addPhysicalGroup(1, near(1, -0.1, -0.1, -0.1, 0.1, 1.1, 0.1), 2, "edge")
        gmsh.model.addPhysicalGroup(0, near(0, 1.9, -0.1, -0.1, 2.1, 0.1, 0.1), 5, "tip")
        gmsh.model.addPhysicalGroup(0, near(0, -0.1, -0.1, -0.1, 0.1, 1.1, 0.1), 6, "both")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        for version, binary in itertools.product((2.2, 4.1), (0, 1)):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            for whole in (0, 1):
                gmsh.option.setNumber("Mesh.SaveAll", whole)
                gmsh.write(str(folder / f"{version}-{binary}-{order}-{whole}.msh"))
        gmsh.finalize()
    return lambda version, binary, order=1, whole=0: folder / f"{version}-{binary}-{order}-{whole}.msh"


NAMES = {"gel block": "skeleton", "tissue": "muscle"}


def typed(tmp_path: Path, *changes: tuple[str, str], text: str = TWO) -> Path:
    """The typed file with parts replaced, each of which must be there."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "typed.msh"
    path.write_text(text)
    return path


def refusal(path: Path, kind: type[Exception] = MeshError, **given: Any) -> str:
    """Message with which a file is refused; one line that names the file, by assertion."""
    with pytest.raises(kind) as caught:
        read_mesh(path, **given)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert len(message.splitlines()) == 1
    return message


def oriented_set(triples: np.ndarray) -> set[tuple[int, ...]]:
    """Triangles with their side, whichever vertex comes first."""
    found = set()
    for triple in triples.T.tolist():
        k = triple.index(min(triple))
        found.add(tuple(triple[k:] + triple[:k]))
    return found


# --- in ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("version", "binary", "order"), COMBINATIONS)
def test_what_gmsh_writes_is_read(gmsh_files, version: float, binary: int, order: int) -> None:
    """The same two boxes in every version: volumes, areas and points of the drawing; middle nodes dropped.

    Catches: byte counts of any section, a second group of an entity lost, middle nodes kept or taken for orphans.
    """
    mesh = read_mesh(gmsh_files(version, binary, order), NAMES)
    assert mesh.region_volumes() == pytest.approx({"skeleton": 1.0, "muscle": 0.5}, rel=1e-12)
    for name, area in (("ground", 2.0), ("foot", 1.0)):
        a, b, c = (mesh.points[:, row] for row in mesh.surfaces[name])
        assert (np.cross(b - a, c - a, axis=0) / 2).sum(axis=1) == pytest.approx([0, 0, -area], abs=1e-12)
    assert mesh.points[:, mesh.landmarks["tip"]] == pytest.approx([2, 0, 0], abs=1e-12)
    # a line and a group of two points are neither surface nor landmark
    assert mesh.source["ignored"] == ["both", "edge"]
    assert ("note" in mesh.source) == (order == 2)
    reference = read_mesh(gmsh_files(4.1, 1), NAMES)
    assert np.array_equal(mesh.cells, reference.cells)
    assert mesh.points == pytest.approx(reference.points, abs=1e-14)


@pytest.mark.parametrize("binary", [0, 1])
def test_files_with_all_entities_are_read(gmsh_files, binary: int) -> None:
    """Triangles and lines in no group do no harm; where the version leaves the groups out, this is said.

    Catches: ungrouped boundary taken for a defect, ungrouped volumes taken for a region.
    """
    assert read_mesh(gmsh_files(4.1, binary, 1, 1), NAMES).n_elements == read_mesh(gmsh_files(4.1, 1), NAMES).n_elements
    message = refusal(gmsh_files(2.2, binary, 1, 1), names=NAMES)
    assert "tetrahedra are in no named volume" in message
    assert "version 2" in message


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_meshio_reads_the_same(gmsh_files, version: float) -> None:
    """Points and tetrahedra agree with another reader of the format.

    Catches: permuted vertices or coordinates that the volumes do not show.
    """
    path = gmsh_files(version, 0)
    mesh, other = read_mesh(path, NAMES), meshio.read(path)
    theirs = np.concatenate([block.data for block in other.cells if block.type == "tetra"])
    assert other.points[theirs] == pytest.approx(mesh.points.T[mesh.cells.T], abs=0)


def test_a_typed_file_is_read(tmp_path: Path) -> None:
    """Gaps in the numbers of nodes, a triangle between two regions and a point are understood.

    Catches: node numbers used as indices, the interface's side left to the file.
    """
    mesh = read_mesh(typed(tmp_path))
    assert mesh.landmarks == {"top": 3}
    assert mesh.points[:, 4].tolist() == [0.3, 0.3, -1]
    # from skeleton (above) to muscle (below): clockwise as seen from above
    assert oriented_set(mesh.surfaces["seam"]) == {(0, 2, 1)}
    windows = tmp_path / "windows.msh"
    windows.write_bytes(TWO.replace("\n", "\r\n").encode())
    assert np.array_equal(read_mesh(windows).cells, mesh.cells)


def test_other_byte_order_is_read(tmp_path: Path) -> None:
    """A binary file from a machine with the other byte order.

    Catches: native numbers assumed.
    """
    body = b"$MeshFormat\n2.2 1 8\n" + struct.pack(">i", 1) + b"\n$EndMeshFormat\n"
    body += TWO[TWO.index("$PhysicalNames") : TWO.index("$Nodes")].encode() + b"$Nodes\n5\n"
    for line in TWO[TWO.index("$Nodes\n5\n") + 9 : TWO.index("$EndNodes")].splitlines():
        tag, *x = line.split()
        body += struct.pack(">i3d", int(tag), *map(float, x))
    body += b"\n$EndNodes\n$Elements\n4\n"
    for line in TWO[TWO.index("$Elements\n4\n") + 12 : TWO.index("$EndElements")].splitlines():
        tag, kind, n_marks, *rest = map(int, line.split())
        body += struct.pack(f">3i{1 + len(rest)}i", kind, 1, n_marks, tag, *rest)
    path = tmp_path / "big.msh"
    path.write_bytes(body + b"\n$EndElements\n")
    assert np.array_equal(read_mesh(path).cells, read_mesh(typed(tmp_path)).cells)


def test_bodies_of_one_region_and_other_regions_by_map(tmp_path: Path) -> None:
    """A skeleton alone is a body; two volumes may become one region; a name of the caller's own may be mapped.

    Catches: both regions demanded, a map that overwrites.
    """
    alone = typed(tmp_path, ('3 2 "muscle"', '3 2 "beam"'))
    assert list(read_mesh(alone, {"beam": "skeleton"}).regions) == ["skeleton"]
    assert set(read_mesh(alone, {"beam": "rubber"}).regions) == {"skeleton", "rubber"}


def test_extra_groups_of_known_elements_do_no_harm(tmp_path: Path) -> None:
    """Version 2 repeats an element for each group; a volume named `all` beside the regions changes nothing.

    Catches: elements counted twice, unknown names refused although nothing is unclear.
    """
    path = typed(
        tmp_path,
        ("$PhysicalNames\n4", '$PhysicalNames\n5\n3 8 "all"'),
        ("$Elements\n4", "$Elements\n6\n8 4 2 8 1 1 2 3 4\n9 4 2 8 2 1 3 2 7"),
    )
    mesh = read_mesh(path)
    assert mesh.n_elements == 2
    assert {name: len(elements) for name, elements in mesh.regions.items()} == {"skeleton": 1, "muscle": 1}


def test_a_design_completes_the_names_of_a_strangers_file(tmp_path: Path) -> None:
    """Without any surface or point in the file, those of the design are found by position.

    Catches: surfaces demanded from strangers, found on the wrong side.
    """
    design = load_design("junction_bot")
    ours = committed_mesh(design, 2.0)
    assert ours is not None
    write_mesh(tmp_path / "bare.msh", BodyMesh(ours.points, ours.cells, ours.regions))
    assert not read_mesh(tmp_path / "bare.msh").surfaces
    found = read_mesh(tmp_path / "bare.msh", design=design)
    assert found.landmarks == ours.landmarks
    assert {k: oriented_set(v) for k, v in found.surfaces.items()} == {
        k: oriented_set(v) for k, v in ours.surfaces.items()
    }


def test_a_mesh_of_another_design_is_refused(tmp_path: Path) -> None:
    """Volumes beyond 2 % of the design's are refused, and so are other regions; a metre is named.

    Catches: a wrong file used in silence.
    """
    design = load_design("strip")
    path = tmp_path / "box.msh"
    write_mesh(path, box_mesh(2, (7.1, 2.2, 0.4)))
    assert read_mesh(path, design=design).n_elements == 48
    write_mesh(path, box_mesh(2, (7.3, 2.2, 0.4)))
    assert "region muscle of the mesh has a volume of 6.424 mm^3, but that of the design has 6.16" in refusal(
        path, design=design
    )
    write_mesh(path, box_mesh(2, (7e-3, 2.2e-3, 0.4e-3)))
    assert "seems to be in m" in refusal(path, design=design)
    assert "found no skeleton and muscle, which the design has not, expected skeleton" in refusal(
        path, design=load_design("cantilever")
    )


# --- refusals ---------------------------------------------------------------------------------------------------------


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    """A missing file and a folder are file errors, in one line.

    Catches: the operating system's exceptions reaching the user.
    """
    assert "cannot read" in refusal(tmp_path / "nowhere.msh", FileError)
    assert "cannot read" in refusal(tmp_path, FileError)


@pytest.mark.parametrize("content", [b"", b"solid\nfacet normal", b"PK\x03\x04", bytes(range(256))])
def test_files_that_are_no_mesh_are_refused(tmp_path: Path, content: bytes) -> None:
    """An empty file, an STL, an archive and arbitrary bytes are no mesh.

    Catches: a parser that searches until it finds something.
    """
    path = tmp_path / "other.msh"
    path.write_bytes(content)
    assert "not a Gmsh mesh" in refusal(path)


@pytest.mark.parametrize(("version", "binary", "order"), COMBINATIONS)
def test_truncated_files_are_refused(gmsh_files, tmp_path: Path, version: float, binary: int, order: int) -> None:
    """Cut anywhere, a file is refused in one line; only the last line's end may be missing.

    Catches: counts not compared with what was read, a cut between sections taken for the end.
    """
    data = gmsh_files(version, binary, order).read_bytes()
    marks = [data.index(mark) + k for mark in (b"$EndNodes", b"$Elements", b"$EndElements") for k in (-1, 0, 1, 5)]
    cuts = {*np.linspace(1, len(data) - 2, 25).astype(int).tolist(), *marks, len(data) - 2}
    path = tmp_path / "cut.msh"
    for cut in sorted(cuts):
        path.write_bytes(data[:cut])
        refusal(path, names=NAMES)


def test_totals_and_the_end_of_a_file_are_checked(gmsh_files, tmp_path: Path) -> None:
    """Blocks that do not add up to the announced total, and a rest after the last section, are refused.

    Catches: totals read and forgotten, a cut in the name of a section that follows.
    """
    text = gmsh_files(4.1, 0).read_text()
    for section in ("Nodes", "Elements"):
        lines = text.splitlines()
        at = lines.index(f"${section}") + 1
        blocks, total, *rest = lines[at].split()
        lines[at] = " ".join([blocks, str(int(total) + 1), *rest])
        path = tmp_path / "total.msh"
        path.write_text("\n".join(lines) + "\n")
        assert f"section ${section}" in refusal(path, names=NAMES)
    path.write_text(text + "$Perio")
    assert "truncated" in refusal(path, names=NAMES)


def test_damaged_bytes_never_give_a_traceback(gmsh_files, tmp_path: Path) -> None:
    """With single bytes changed a file is read or refused in one line, never anything else.

    Catches: counts trusted for allocation, index errors.
    """
    draw = np.random.default_rng(6)
    path = tmp_path / "damaged.msh"
    for version, binary in ((2.2, 1), (4.1, 0), (4.1, 1)):
        data = gmsh_files(version, binary).read_bytes()
        for place in draw.integers(0, len(data), 40):
            path.write_bytes(data[:place] + bytes([draw.integers(256)]) + data[place + 1 :])
            reason = ""
            try:
                read_mesh(path, NAMES)
            except MeshError as error:
                reason = str(error)
            assert len(reason.splitlines()) <= 1


TETS = "3 4 2 1 1 1 2 3 4\n4 4 2 2 2 1 3 2 7\n"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ([("2.2 0 8", "4 0 8")], "format 4 is not read"),
        ([("2.2 0 8", "2.2 0 4")], "numbers of 4 bytes"),
        ([("2.2 0 8", "2.2 1 8")], "truncated or damaged in its section $MeshFormat"),
        ([("$Nodes\n5", "$Nodes\n6")], "truncated or damaged in its section $Nodes"),
        ([("$Elements\n4", "$Elements\n3")], "truncated or damaged in its section $Elements"),
        ([("$PhysicalNames\n4", "$PhysicalNames\n5")], "truncated or damaged in its section $PhysicalNames"),
        ([('0 4 "top"', "0 4 top")], "section $PhysicalNames is damaged: found '0 4 top'"),
        ([("0.2 0.2 1", "0.2 zwei 1")], "section $Nodes is damaged"),
        ([("7 0.3", "7.5 0.3")], "section $Nodes is damaged: a whole number"),
        ([("4 4 2 2 2 1 3 2 7", "4 99 2 2 2 1 3 2 7")], "unknown type 99"),
        ([("$Elements", "$Triangles"), ("$EndElements", "$EndTriangles")], "no section $Elements"),
        ([("$Nodes", "$Points"), ("$EndNodes", "$EndPoints")], "no section $Nodes"),
        ([("$Nodes", "$PartitionedEntities\n1\n$EndPartitionedEntities\n$Nodes")], "partitioned"),
        ([("7 0.3 0.3 -1", "4 0.3 0.3 -1")], "node 4 is there twice"),
        ([(TETS, ""), ("$Elements\n4", "$Elements\n2")], "triangles only"),
        ([(TETS, ""), ("2 2 2 3 1 1 2 3\n", ""), ("$Elements\n4", "$Elements\n1")], "no tetrahedra"),
        ([('3 1 "skeleton"\n3 2 "muscle"\n', ""), ("$PhysicalNames\n4", "$PhysicalNames\n2")], "no named volumes"),
        ([('3 2 "muscle"\n', ""), ("$PhysicalNames\n4", "$PhysicalNames\n3")], "number 2, without a name"),
        ([("4 4 2 2 2 1", "4 4 2 0 2 1")], "1 tetrahedra are in no named volume"),
        ([('"muscle"', '"Muskel"')], "the volumes Muskel are not known; expected skeleton or muscle, or a map"),
        ([("4 4 2 2 2 1", "4 4 2 1 2 1")], "region muscle is empty"),
        ([("$Elements\n4", "$Elements\n5\n9 4 2 2 1 1 2 3 4")], "1 elements are in the regions skeleton and muscle"),
        ([("4 4 2 2 2 1 3 2 7", "4 5 2 2 2 1 3 2 7 1 2 3 4")], "hexahedra"),
        ([("2 2 2 3 1 1 2 3", "2 3 2 3 1 1 2 3 4")], "surface seam has quadrangles"),
        ([("1 3 2 7", "1 3 2 8")], "nodes such as 8 are not in the file"),
        ([("1 3 2 7", "1 2 3 7")], "element 1 in region muscle at (0.325, 0.325, -0.25) mm is inverted"),
        ([("$Nodes\n5", "$Nodes\n6\n9 5 5 5")], "1 orphan vertices"),
        ([("0.2 0.2 1", "0.2 nan 1")], "not finite"),
        ([("2 2 2 3 1 1 2 3", "2 2 2 3 1 1 4 7")], "surface seam has 1 triangles that are no facets"),
    ],
)
def test_defects_of_a_file_are_named(tmp_path: Path, changes: list[tuple[str, str]], reason: str) -> None:
    """Each defect of an otherwise sound file is refused for its own reason.

    Catches: any of the checks dropped, or one defect reported as another.
    """
    assert reason in refusal(typed(tmp_path, *changes))


def test_an_element_in_both_regions_of_version_4_is_refused(gmsh_files, tmp_path: Path) -> None:
    """A volume that belongs to both regions is refused.

    Catches: the first of several groups taken.
    """
    text = (
        gmsh_files(4.1, 0).read_text().replace('3 7 "gel block"', '3 7 "skeleton"').replace('9 "tissue"', '9 "muscle"')
    )
    lines = text.splitlines()
    # volumes are the last lines of the entities; one group becomes two
    end = lines.index("$EndEntities")
    fields = lines[end - 1].split()
    assert fields[7:9] == ["1", "9"]
    lines[end - 1] = " ".join([*fields[:7], "2", "7", "9", *fields[9:]])
    path = tmp_path / "both.msh"
    path.write_text("\n".join(lines) + "\n")
    assert "is in the regions skeleton and muscle" in refusal(path)


def test_a_map_of_unknown_names_is_refused(tmp_path: Path) -> None:
    """A misspelt name in the map is refused with the names that there are.

    Catches: a map that has no effect in silence.
    """
    assert "names maps gell, but the volumes are muscle, skeleton" in refusal(typed(tmp_path), names={"gell": "muscle"})


# --- out --------------------------------------------------------------------------------------------------------------


def test_a_mesh_comes_back_as_it_went_out(tmp_path: Path) -> None:
    """Points to the last bit, cells, regions that alternate, overlapping surfaces with their side, landmarks.

    Catches: rounding of coordinates, renumbering, a facet in two surfaces lost, two names of one vertex.
    """
    box = box_mesh(2, (1.1, 0.9, 1 / 3))
    even = np.arange(0, box.n_elements, 2)
    sent = BodyMesh(
        box.points / 7,
        box.cells,
        {"skeleton": even, "muscle": even + 1},
        {"top": box.surfaces["z1"], "part of it": box.surfaces["z1"][:, 2:5], "x1": box.surfaces["x1"]},
        {"a": 3, "b": 3, "c": 7},
    )
    write_mesh(tmp_path / "a.msh", sent)
    back = read_mesh(tmp_path / "a.msh")
    assert back.points.tobytes() == sent.points.tobytes()
    assert back.cells.tobytes() == sent.cells.tobytes()
    assert {k: v.tolist() for k, v in back.regions.items()} == {k: v.tolist() for k, v in sent.regions.items()}
    assert back.landmarks == sent.landmarks
    assert {k: oriented_set(v) for k, v in back.surfaces.items()} == {
        k: oriented_set(v) for k, v in sent.surfaces.items()
    }
    write_mesh(tmp_path / "b.msh", back)
    assert (tmp_path / "a.msh").read_bytes() == (tmp_path / "b.msh").read_bytes()


def test_gmsh_opens_what_we_write(tmp_path: Path) -> None:
    """Gmsh itself finds our groups with our names, and writes them back readable.

    Catches: a file that only our own reader understands.
    """
    try:
        gmsh = import_gmsh()
    except GmshMissing as missing:
        pytest.skip(str(missing))
    sent = box_mesh(2, layers=(0.5, 1.0), names=("skeleton", "muscle"))
    write_mesh(tmp_path / "a.msh", sent)
    gmsh.initialize(["test", "-v", "0"], readConfigFiles=False, interruptible=False)
    try:
        gmsh.open(str(tmp_path / "a.msh"))
        groups = gmsh.model.getPhysicalGroups()
        names = {(dim, gmsh.model.getPhysicalName(dim, tag)) for dim, tag in groups}
        assert names == {
            (3, "skeleton"),
            (3, "muscle"),
            *((2, k) for k in sent.surfaces),
            *((0, k) for k in sent.landmarks),
        }
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.write(str(tmp_path / "b.msh"))
    finally:
        gmsh.finalize()
    back = read_mesh(tmp_path / "b.msh")
    assert back.points.tobytes() == sent.points.tobytes()
    assert np.array_equal(back.cells, sent.cells)


def test_writing_is_whole_or_not_at_all(tmp_path: Path) -> None:
    """A folder that is not there and a name that is no mesh are refused, and nothing is left behind.

    Catches: half a file, an extension that readers do not know.
    """
    box = box_mesh(1)
    with pytest.raises(FileError, match=r"ends in \.msh"):
        write_mesh(tmp_path / "a.vtk", box)
    with pytest.raises(FileError, match="nowhere"):
        write_mesh(tmp_path / "nowhere" / "a.msh", box)
    assert list(tmp_path.iterdir()) == []


def test_version_two_with_negative_groups(tmp_path: Path) -> None:
    """A negative group only says that it sees the entity from behind.

    Catches: negative tags taken for other groups.
    """
    raw = msh.parse(TWO.replace("2 2 2 3 1 1 2 3", "2 2 2 -3 1 1 2 3").encode())
    assert [block.groups for block in raw.elements if block.kind == 2] == [(3,)]
