"""Skeletons from other programs: the design's names at the design's places, or one line that says what is wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import FileError, MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.foreign import export_part, import_mesh
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.solids import shift_to
from fem_biobot.mesh.tagged import read_mesh, write_mesh
from tests.command import ROOT
from tests.drawing import drawn

DRAWINGS = ROOT / "tests" / "drawings"
BOXES = ((-7.0, -3.5, 3.06, 14.0, 7.0, 0.68), (-7.0, -3.5, 0.6, 3.5, 7.0, 2.46), (3.5, -3.5, 0.0, 3.5, 7.0, 3.06))


pytestmark = pytest.mark.usefixtures("gmsh")


@pytest.fixture(scope="module")
def bot() -> Design:
    return load_design("junction_bot")


def skeleton(occ: Any) -> list[tuple[int, int]]:
    parts = [(3, occ.addBox(*numbers)) for numbers in BOXES]
    return occ.fuse(parts[:1], parts[1:])[0]


def assert_is_the_designs(mesh: BodyMesh, design: Design, *, rel: float = 1e-6) -> None:
    plan = layout(design)
    assert mesh.region_volumes() == pytest.approx(dict(plan.volumes), rel=rel)
    assert set(mesh.surfaces) == {*plan.faces, "interface"}
    for name, place in plan.landmarks.items():
        assert mesh.points[:, mesh.landmarks[name]] == pytest.approx(place, abs=2e-6)
    assert mesh.quality().minimum > 0.05


@pytest.mark.parametrize(("file", "more"), [("skeleton.step", {}), ("skeleton_cm.stl", {"unit": "cm", "align": True})])
def test_another_programs_skeleton_gets_the_designs_names_and_muscle(bot: Design, file: str, more: dict) -> None:
    """Volumes to what single precision leaves of an STL file; the files are of CadQuery and trimesh.

    Catches: a unit or a shift lost, landmarks beside vertices, feet not found, a muscle that is not joined.
    """
    mesh = import_mesh(bot, DRAWINGS / file, size=2.0, **more)
    assert_is_the_designs(mesh, bot)
    assert mesh.source["skeleton"] == file


def test_the_drawings_are_those_of_their_sidecar() -> None:
    """Catches: a file exchanged without its origin."""
    about = json.loads((DRAWINGS / "skeletons.json").read_text(encoding="utf-8"))
    assert (ROOT / about["made_by"]).is_file()
    assert {name for name in about if "." in name} == {
        f.name for f in DRAWINGS.iterdir() if f.suffix in (".step", ".stl")
    }
    assert about["skeleton.step"]["volume_found_mm3"] == pytest.approx(
        layout(load_design("junction_bot")).volumes["skeleton"]
    )


@pytest.mark.parametrize("suffix", [".step", ".stl"])
def test_what_is_exported_comes_back(bot: Design, tmp_path: Path, suffix: str) -> None:
    """Skeleton and muscle, each a file.

    Catches: an export in another unit, of another part, of parts that are no solid.
    """
    files = {region: tmp_path / f"{region}{suffix}" for region in ("skeleton", "muscle")}
    for region, file in files.items():
        export_part(bot, file, region)
    unit = "mm" if suffix == ".stl" else None
    mesh = import_mesh(bot, files["skeleton"], muscle=files["muscle"], unit=unit, size=2.0)
    assert_is_the_designs(mesh, bot)
    # and its file is a mesh of the design for every other command
    write_mesh(tmp_path / "a.msh", mesh)
    assert set(read_mesh(tmp_path / "a.msh", design=bot).landmarks) == set(mesh.landmarks)


def test_a_muscle_is_moved_along_with_its_skeleton(bot: Design, tmp_path: Path) -> None:
    """Both drawn 3, -2 and 5 mm from the design's place.

    Catches: the skeleton alone moved home.
    """
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    files = [tmp_path / "skeleton.stl", tmp_path / "muscle.stl"]
    for file in files:
        export_part(bot, file, file.stem)
        data = file.read_bytes()
        rows = np.frombuffer(data, kind, offset=84).copy()
        rows["corners"] += np.array([3.0, -2.0, 5.0], dtype=np.float32)
        file.write_bytes(data[:84] + rows.tobytes())
    mesh = import_mesh(bot, files[0], muscle=files[1], unit="mm", align=True, size=2.0)
    assert_is_the_designs(mesh, bot)


@pytest.mark.parametrize("preset", ["ring_bot", "cantilever"])
def test_other_kinds_come_back_too(preset: str, tmp_path: Path) -> None:
    """Catches: holes of a loop that are filled, a beam without pillars or muscle refused."""
    design = load_design(preset)
    export_part(design, tmp_path / "a.step")
    mesh = import_mesh(design, tmp_path / "a.step", size=1.5)
    assert mesh.region_volumes() == pytest.approx(dict(layout(design).volumes), rel=1e-9)


def test_a_fillet_comes_through_stl_within_its_chords(bot: Design, tmp_path: Path) -> None:
    """Gel outside of the arcs, inside of the corners, that eight chords add to the quarter circles.

    Catches: arcs that are joined to planes, a volume counted twice along the arc.
    """
    rounded = bot.with_values({"skeleton.fillet_radius": 0.4})
    export_part(rounded, tmp_path / "a.stl")
    mesh = import_mesh(rounded, tmp_path / "a.stl", unit="mm", size=2.0)
    # two arcs of 7 mm: the sector of a quarter circle less its eight triangles
    more = 2 * 7.0 * 0.4**2 * (np.pi / 4 - 8 * np.sin(np.pi / 16) / 2)
    found = mesh.region_volumes()["skeleton"] - layout(rounded).volumes["skeleton"]
    # points lie within half of 1e-5 mm: 2 x 0.63 x 7 mm^2 of arcs times that is 4e-3 of it
    assert found == pytest.approx(more, rel=4e-3)


def test_the_muscle_fits_the_very_pillars(gmsh: Any, bot: Design, tmp_path: Path) -> None:
    """Pillars with rounded edges: the ring fills what they lack, so muscle and gel together keep their volume.

    Catches: a ring cut out by the design's box, with gaps at the rounded edges.
    """

    def rounded(occ: Any) -> None:
        boxes = [occ.addBox(*numbers) for numbers in BOXES]
        occ.synchronize()
        upright = [
            tag
            for _, tag in gmsh.model.getBoundary(
                [(3, boxes[1]), (3, boxes[2])], combined=False, recursive=False, oriented=False
            )
            for _, tag in gmsh.model.getBoundary([(2, tag)], oriented=False)
        ]
        lines = []
        for tag in sorted(set(upright)):
            low, high = np.reshape(gmsh.model.getBoundingBox(1, tag), (2, 3))
            if high[2] - low[2] > 1.0:
                lines.append(tag)
        pillars = occ.fillet(boxes[1:], lines, [0.3])
        occ.fuse([(3, boxes[0])], pillars)

    mesh = import_mesh(bot, drawn(gmsh, tmp_path / "a.step", rounded), size=2.0)
    plan = layout(bot)
    # four edges of two pillars, 1.1 mm of them within the rings; the mesh has one chord for an arc, or more
    arcs, chords = (8 * share * 0.3**2 * 1.1 for share in (1.0 - np.pi / 4, 0.5))
    assert arcs < mesh.region_volumes()["muscle"] - plan.volumes["muscle"] <= chords * (1.0 + 1e-9)


def test_a_landmark_goes_where_it_is_asked_for(bot: Design) -> None:
    """Inside the gel, on no face of the drawing.

    Catches: a name that is taken for the design's place, a point that is no vertex.
    """
    place = (-3.61, 0.13, 2.97)
    mesh = import_mesh(bot, DRAWINGS / "skeleton.step", size=2.0, landmarks={"corner_short": place})
    assert mesh.points[:, mesh.landmarks["corner_short"]] == pytest.approx(place, abs=1e-9)


def surface(occ: Any) -> None:
    occ.addRectangle(0.0, 0.0, 0.0, 1.0, 2.0)


def two_bodies(occ: Any) -> None:
    skeleton(occ)
    occ.addBox(0.0, 0.0, 10.0, 1.0, 1.0, 1.0)


def turned(occ: Any) -> None:
    occ.rotate(skeleton(occ), 0, 0, 0, 0, 0, 1, np.pi / 2)


def hollow(occ: Any) -> None:
    occ.cut(skeleton(occ), [(3, occ.addBox(-6.0, -2.0, 1.0, 1.5, 4.0, 1.0))])


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (surface, "holds no volume; expected a solid"),
        (two_bodies, "2 bodies that do not touch"),
        (turned, "7 x 14 x 3.74 mm, but that of the design is 14 x 7 x 3.74 mm; it is turned"),
        (hollow, "pillar short: found a hole in it at z = 1.3 mm, expected none where its ring goes round"),
        (lambda occ: occ.translate(skeleton(occ), 0.0, 0.0, 0.5), r"lies \(0, 0, 0.5\) mm from its place"),
        (lambda occ: occ.dilate(skeleton(occ), 0, 0, 0, 0.1, 0.1, 0.1), "10 times too small: is its unit right"),
    ],
)
def test_what_is_no_skeleton_of_the_design_is_refused(
    gmsh: Any, bot: Design, tmp_path: Path, build: Callable[[Any], object], words: str
) -> None:
    """Catches: a machine in metres, upside down or elsewhere meshed all the same, with a muscle in empty space."""
    file = drawn(gmsh, tmp_path / "a.step", build)
    with pytest.raises(MeshError, match=words) as told:
        import_mesh(bot, file, size=2.0)
    assert "\n" not in str(told.value)


def apart(occ: Any) -> None:
    occ.addBox(-3.4, -1.1, 1.2, 6.8, 2.2, 0.4)


def within(occ: Any) -> None:
    occ.addBox(-5.0, -1.1, 1.2, 10.0, 2.2, 0.4)


@pytest.mark.parametrize(
    ("build", "words"), [(apart, "does not touch the skeleton"), (within, "overlaps the skeleton in 2.64 mm")]
)
def test_a_muscle_that_does_not_fit_is_refused(
    gmsh: Any, bot: Design, tmp_path: Path, build: Callable[[Any], object], words: str
) -> None:
    """A junction that ends 0.1 mm before the pillars; one that reaches 1.5 mm into both, 2 x 1.5 x 2.2 x 0.4 mm^3.

    Catches: two bodies solved beside each other, gel and muscle in one place.
    """
    file = drawn(gmsh, tmp_path / "a.step", build)
    with pytest.raises(MeshError, match=words):
        import_mesh(bot, DRAWINGS / "skeleton.step", muscle=file, size=2.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"skeleton": DRAWINGS / "skeleton_cm.stl"}, r"does not say its unit; give it with --unit mm\|cm"),
        ({"unit": "cm"}, "unit: found cm, but a STEP file says its own"),
        ({"skeleton": DRAWINGS / "skeletons.json"}, "ends in .json, expected one of: .step"),
        ({"landmarks": {"nose": (0.0, 0.0, 0.0)}}, "landmark nose: unknown, expected one of: span_short"),
        ({"landmarks": {"span_mid": (0.0, 0.0, 9.0)}}, "no landmark span_mid.*give its place with --landmark"),
        ({"size": -1.0}, "positive length"),
    ],
)
def test_what_does_not_go_together_is_refused(bot: Design, changes: dict[str, Any], words: str) -> None:
    """Catches: a unit guessed, a misspelt landmark that changes nothing, a landmark lost."""
    given = {"skeleton": DRAWINGS / "skeleton.step", "size": 2.0, **changes}
    with pytest.raises(MeshError, match=words):
        import_mesh(bot, given.pop("skeleton"), **given)


def test_parts_that_a_design_has_not_are_refused(tmp_path: Path) -> None:
    """Catches: a strip with a skeleton, a beam with a muscle from a file."""
    step = DRAWINGS / "skeleton.step"
    with pytest.raises(MeshError, match="strip, which has no skeleton"):
        import_mesh(load_design("strip"), step)
    with pytest.raises(MeshError, match="cantilever, which has no muscle"):
        import_mesh(load_design("cantilever"), step, muscle=step)
    with pytest.raises(MeshError, match="found no skeleton in a design of kind strip"):
        export_part(load_design("strip"), tmp_path / "a.step")
    with pytest.raises(MeshError, match="ends in nothing"):
        export_part(load_design("cantilever"), tmp_path / "a")


def test_a_file_that_cannot_be_read_is_told_by_its_name(bot: Design, tmp_path: Path) -> None:
    """Catches: OpenCASCADE's own silence about a file that is not there, or is something else."""
    with pytest.raises(FileError, match=r"a\.step"):
        import_mesh(bot, tmp_path / "a.step")
    (tmp_path / "a.step").write_text("hello")
    with pytest.raises(MeshError, match="no STEP file"):
        import_mesh(bot, tmp_path / "a.step")
    (tmp_path / "a.step").write_text("ISO-10303-21;\nHEADER;\nbroken")
    with pytest.raises(MeshError, match=r"could not mesh|holds no volume"):
        import_mesh(bot, tmp_path / "a.step")


def test_a_box_is_moved_only_when_it_may_be() -> None:
    """Catches: the shift turned round, a shift of rounding taken for a real one."""
    wanted = np.array([[-7.0, -3.5, 0.0], [7.0, 3.5, 3.74]])
    move = np.array([0.3, -1.0, 2.0])
    assert shift_to("a", wanted - move, wanted, align=True) == pytest.approx(move, rel=1e-12)
    assert not shift_to("a", wanted + 1e-7, wanted, align=False).any()
    with pytest.raises(MeshError, match=r"lies \(-0.3, 1, -2\) mm"):
        shift_to("a", wanted - move, wanted, align=False)
    with pytest.raises(MeshError, match="set the design's lengths"):
        shift_to("a", wanted * [1.1, 1.0, 1.0], wanted, align=True)
