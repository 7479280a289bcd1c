"""Skeletons whose pillars are no boxes: rings that follow them, fibres that do, and what is told of the difference."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, MeshError
from fem_biobot.link.crosscheck import crosscheck
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.cuts import section, volume_above
from fem_biobot.mesh.foreign import fitted, import_mesh
from fem_biobot.mesh.geometry import build_mesh
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.own_shape import pillar_outlines, refuse_own_pillars, shape_notes, unlike
from fem_biobot.mesh.tagged import read_mesh, write_mesh
from fem_biobot.muscle.fibres import fibre_field
from fem_biobot.solid.from_design import tension_step
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, solve
from tests.command import call
from tests.drawing import drawn
from tests.helpers import committed_bot

R, SIDE = 1.75, 5.25  # of the pillars [mm], and how far from mid-span they stand
BEAM = (-7.0, -3.5, 3.06, 14.0, 7.0, 0.68)

pytestmark = pytest.mark.usefixtures("gmsh")


def bot(*sets: str) -> Design:
    """The junction bot with pillars as wide as they are long."""
    return load_design("junction_bot", ["skeleton.pillar_width=3.5 mm", *sets])


def standing(occ: Any, *pillars: tuple[int, int]) -> None:
    occ.fuse([(3, occ.addBox(*BEAM))], list(pillars))


def round_pillars(occ: Any) -> None:
    """Cylinders."""
    standing(occ, *((3, occ.addCylinder(x, 0, z, 0, 0, 3.06 - z, R)) for x, z in ((-SIDE, 0.6), (SIDE, 0.0))))


def tapered_pillars(occ: Any) -> None:
    """Cones, as wide as the design's pillars under the beam and a fifth narrower at the sole of the longer one."""
    narrow = {z: R * (1.0 - 0.2 * (3.06 - z) / 3.06) for z in (0.0, 0.6)}
    standing(occ, *((3, occ.addCone(x, 0, z, 0, 0, 3.06 - z, narrow[z], R)) for x, z in ((-SIDE, 0.6), (SIDE, 0.0))))


@dataclass(frozen=True)
class Machine:
    """A machine of round pillars."""

    design: Design
    mesh: BodyMesh
    file: Path


@pytest.fixture(scope="module")
def machine(gmsh: Any, tmp_path_factory: pytest.TempPathFactory) -> Machine:
    folder = tmp_path_factory.mktemp("round")
    file, design = drawn(gmsh, folder / "round.step", round_pillars), bot()
    return Machine(design, import_mesh(design, file, size=2.0), file)


def area(mesh: BodyMesh, name: str) -> float:
    """Of a surface [mm^2]."""
    p, q, r = (mesh.points[:, row] for row in mesh.surfaces[name])
    return 0.5 * float(np.linalg.norm(np.cross(q - p, r - p, axis=0), axis=0).sum())


def test_rings_follow_round_pillars(machine: Machine) -> None:
    """Volumes as drawn are those of cylinders, of hollow cylinders and of a strip between two circles, in closed form.

    The mesh has a chord for each of 24 parts of a circle or more, which lacks ``(2 pi / 24)^2 / 6`` of its area, and
    half as much of its length.

    Catches: a square block with a round hole, a junction that ends at the box's face, chords as coarse as the mesh.
    """
    m: Any = machine.design.muscle
    w, high, wide, thick = m.ring_thickness, m.ring_height, m.junction_width, m.junction_thickness
    outer, half = R + w, wide / 2.0
    segment = half * math.sqrt(outer**2 - half**2) + outer**2 * math.asin(half / outer)
    rings = 2.0 * math.pi * (outer**2 - R**2) * high
    muscle = rings + thick * (2.0 * SIDE * wide - 2.0 * segment)
    gel = 14.0 * 7.0 * 0.68 + math.pi * R**2 * (2.46 + 3.06)
    source, found = machine.mesh.source, machine.mesh.region_volumes()
    assert source["drawn_skeleton_mm3"] == pytest.approx(gel, rel=1e-9)
    assert source["drawn_muscle_mm3"] == pytest.approx(muscle, rel=1e-6)
    chord = (2.0 * math.pi / 24.0) ** 2 / 6.0
    assert (1.0 - chord) * gel < found["skeleton"] < gel
    assert found["muscle"] == pytest.approx(muscle, rel=2.0 * chord)
    touching = 2.0 * 2.0 * math.pi * R * high
    assert (1.0 - 0.5 * chord) * touching < area(machine.mesh, "interface") < touching


def test_a_round_machine_has_all_names(machine: Machine, tmp_path: Path) -> None:
    """Sides of a pillar are what looks along x more than across; soles are disks. The file reads as the design's.

    Catches: sides of both pillars in one, those that look the other way, a file that its own program refuses.
    """
    plan, mesh = layout(machine.design), machine.mesh
    assert set(mesh.surfaces) == {*plan.faces, "interface"}
    for name, x, sign in (
        ("pillar_short_inner", -SIDE, 1.0),
        ("pillar_long_outer", SIDE, 1.0),
        ("pillar_long_inner", SIDE, -1.0),
    ):
        corners = mesh.points[:, mesh.surfaces[name]]
        out = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0)
        assert np.all(sign * out[0] > 0.69 * np.linalg.norm(out[:2], axis=0))
        assert np.hypot(corners[0] - x, corners[1]) == pytest.approx(R, rel=1e-6)
    assert area(mesh, "foot_short") == pytest.approx(math.pi * R**2, rel=0.02)
    write_mesh(tmp_path / "a.msh", mesh)
    assert set(read_mesh(tmp_path / "a.msh", design=machine.design).surfaces) == set(mesh.surfaces)


def test_fibres_run_round_a_round_pillar(machine: Machine) -> None:
    """In the rings across the radius, but for the chords' ``pi / 24``; smooth ones are refused.

    Catches: fibres round the design's box, along the radius, a field that does not know where the pillar is.
    """
    mesh = machine.mesh
    muscle = mesh.cells[:, mesh.regions["muscle"]]
    X = mesh.points[:, muscle].mean(axis=1)
    a0 = fibre_field(machine.design, mesh)
    assert np.linalg.norm(a0, axis=0) == pytest.approx(np.ones(len(X.T)), rel=1e-12)
    behind = X[0] < -SIDE
    out = np.stack([X[0] + SIDE, X[1]])[:, behind]
    along = np.abs(np.sum(a0[:2, behind] * out, axis=0)) / np.linalg.norm(out, axis=0)
    assert along.max() < math.sin(math.pi / 24.0)
    smooth = machine.design.with_values({"muscle.fibres": "smooth"})
    with pytest.raises(DesignError, match="found smooth, expected piecewise or a file for pillars that are no boxes"):
        fibre_field(smooth, mesh)
    assert pillar_outlines(layout(machine.design), build_mesh(machine.design, 4.0)) is None


def test_a_rectangle_of_the_boxes_area_is_followed(gmsh: Any, tmp_path: Path) -> None:
    """3.0 x 4.083 mm in place of 3.5 x 3.5: the ring ends a thickness beyond it on all sides; the design's is refused.

    Catches: pillars known by their areas alone, soles cut off where the design's box ends, rings beside the pillars
    where volumes agree.
    """
    a, b = 1.5, 0.5 * 12.25 / 3.0

    def pillars(occ: Any) -> list[tuple[int, int]]:
        return [(3, occ.addBox(x - a, -b, z, 2 * a, 2 * b, 3.06 - z)) for x, z in ((-SIDE, 0.6), (SIDE, 0.0))]

    def build(occ: Any) -> None:
        standing(occ, *pillars(occ))

    def rings(occ: Any) -> None:
        parts = [
            (3, occ.addBox(*box.low, *(high - low for low, high in zip(box.low, box.high, strict=True))))
            for box in layout(bot()).muscle
        ]
        whole, _ = occ.fuse(parts[:1], parts[1:])
        occ.cut(whole, pillars(occ))

    file = drawn(gmsh, tmp_path / "a.step", build)
    with pytest.raises(MeshError, match=r"own: its rings are 0\.75 and 0\.75 mm thick at its ends, expected 0\.5"):
        import_mesh(bot(), file, muscle=drawn(gmsh, tmp_path / "b.step", rings), size=4.0)
    mesh = import_mesh(bot(), file, size=4.0)
    tissue, thick = mesh.points[:, mesh.region_vertices("muscle")], bot().muscle.ring_thickness  # type: ignore[union-attr]
    assert tissue.max(axis=1)[:2] == pytest.approx((SIDE + a + thick, b + thick), abs=1e-3)
    assert tissue.min(axis=1)[:2] == pytest.approx((-SIDE - a - thick, -b - thick), abs=1e-3)
    assert pillar_outlines(layout(bot()), mesh) is not None
    for foot in ("foot_short", "foot_long"):
        assert area(mesh, foot) == pytest.approx(12.25, rel=1e-6)


def ellipses(short: float) -> Callable[[Any], None]:
    """Pillars of the box's area, elliptic, with this half axis along x."""

    def build(occ: Any) -> None:
        parts = []
        for x, z in ((-SIDE, 0.6), (SIDE, 0.0)):
            disk = [(2, occ.addDisk(x, 0, z, 12.25 / (math.pi * short), short))]
            occ.rotate(disk, x, 0, z, 0, 0, 1, math.pi / 2)
            parts += [e for e in occ.extrude(disk, 0, 0, 3.06 - z) if e[0] == 3]
        standing(occ, *parts)

    return build


def test_curved_pillars_of_the_boxes_area_are_followed(gmsh: Any, tmp_path: Path) -> None:
    """Ellipses, and circles wider than the box that are flush with the beam's ends.

    Catches: sides of a pillar looked for in its box, sections known by their areas alone.
    """
    radius = math.sqrt(12.25 / math.pi)

    def flush(occ: Any) -> None:
        at = 7.0 - radius
        standing(occ, *((3, occ.addCylinder(x, 0, z, 0, 0, 3.06 - z, radius)) for x, z in ((-at, 0.6), (at, 0.0))))

    for build in (ellipses(1.7), flush):
        mesh = import_mesh(bot(), drawn(gmsh, tmp_path / "a.step", build), size=4.0)
        assert pillar_outlines(layout(bot()), mesh) is not None
        for foot in ("foot_short", "foot_long"):
            assert area(mesh, foot) == pytest.approx(12.25, rel=0.02)
        for side in ("inner", "outer"):
            assert {f"pillar_short_{side}", f"pillar_long_{side}"} <= set(mesh.surfaces)


def test_the_volume_above_a_height_is_that_of_the_boxes_there() -> None:
    """Of the committed bot's skeleton, at heights within the pillars, within the beam, under and above all.

    Catches: corners counted as wedges, the part below taken for that above.
    """
    _, box = committed_bot()
    gel = box.cells[:, box.regions["skeleton"]]
    beam, pillar = 14.0 * 7.0, 3.5 * 7.0
    for z, exact in (
        (-1.0, beam * 0.68 + pillar * (2.46 + 3.06)),
        (1.37, beam * 0.68 + 2.0 * pillar * (3.06 - 1.37)),
        (3.4, beam * 0.34),
        (9.0, 0.0),
    ):
        assert volume_above(box.points, gel, z) == pytest.approx(exact, rel=1e-9)


def test_what_takes_boxes_is_told_with_numbers(machine: Machine) -> None:
    """Area and second moments of a circle beside those of the square; a box has nothing to tell.

    Chords lack twice as much of the second moment, ``(2 pi / 24)^2 / 3``.

    Catches: moments about another axis, the design's numbers told as the mesh's.
    """
    notes = shape_notes(machine.design, machine.mesh)
    assert len(notes) == 2
    assert notes[0].startswith("pillar short is no box: at its ring it has 9.5")
    assert "take the design's 12.2 mm^2, 12.5 and 12.5 mm^4" in notes[0]
    mesh = machine.mesh
    gel = mesh.cells[:, mesh.regions["skeleton"]]
    found = section(mesh.points, gel[:, mesh.points[0, gel].mean(axis=0) < 0.0], 1.3)
    assert found is not None
    about = math.pi * R**4 / 4.0
    for value, exact, share in (
        (found.area, math.pi * R**2, 6.0),
        *((each, about, 3.0) for each in found.second_moments),
    ):
        assert (1.0 - (2.0 * math.pi / 24.0) ** 2 / share) * exact < value < exact
    design, box = committed_bot()
    assert shape_notes(design, box) == []
    assert unlike(layout(design), box) == ""
    gel = box.cells[:, box.regions["skeleton"]]
    for z, (a, b) in ((1.37, (3.5, 7.0)), (3.4, (14.0, 7.0))):
        cut = section(box.points, gel[:, (box.points[0, gel].mean(axis=0) < 0.0) | (z > 3.0)], z)
        assert cut is not None
        assert cut.area == pytest.approx(a * b, rel=1e-9)
        assert cut.second_moments == pytest.approx((a * b**3 / 12.0, b * a**3 / 12.0), rel=1e-9)
    assert section(box.points, gel, 9.0) is None


def test_a_round_machine_closes_as_the_one_of_boxes(machine: Machine) -> None:
    """At 0.5 kPa: its muscle pulls, as hard within 2 %, and its beam, the same, closes the tips as far within 15 %.

    Round pillars hold the beam's end at a point of mid-width alone: of the beam's width of 7 mm the corner of the box's
    3.5 mm is at the span's end, the circle on the mean ``R (1 - pi / 4)`` beyond it, on both sides 0.75 mm of a
    span of 7 mm, which is 11 % of its turn.

    Catches: a ring beside its pillar, fibres that do not close, a junction that is not joined to its rings.
    """

    def state(mesh: BodyMesh) -> dict[str, Any]:
        model = SolidModel.from_design(machine.design, mesh)
        return dict(Measurer(machine.design, model).measures(solve(model, [tension_step(machine.design, 0.5)]).last))

    own, box = state(machine.mesh), state(build_mesh(machine.design, 2.0))
    assert own["muscle_force_mN"] == pytest.approx(box["muscle_force_mN"], rel=0.02)
    assert 0.1 < box["tip_closing_mm"] < own["tip_closing_mm"] < 1.15 * box["tip_closing_mm"]


def test_a_tapered_pillar_is_followed(gmsh: Any, tmp_path: Path) -> None:
    """Rings about the section in their middle; a design takes its lengths from under the beam, where they are flush.

    Catches: a section of the wrong height, pillars that do not reach the beam's ends at half height refused.
    """
    file = drawn(gmsh, tmp_path / "a.step", tapered_pillars)
    mesh = import_mesh(bot(), file, size=4.0)
    m: Any = bot().muscle
    # half of each ring, beyond its pillar's middle; radii where z is 1.3 mm
    tissue = mesh.cells[:, mesh.regions["muscle"]]
    outer = np.abs(mesh.points[0, tissue].mean(axis=0)) > SIDE
    radii = [R * (1.0 - 0.2 * (3.06 - 1.3) / 3.06)] * 2
    half = 0.5 * math.pi * m.ring_height * sum((x + m.ring_thickness) ** 2 - x**2 for x in radii)
    assert mesh.volumes[mesh.regions["muscle"]][outer].sum() == pytest.approx(half, rel=0.03)
    found = fitted(bot(), file)
    assert found.value("skeleton.pillar_length") == pytest.approx(2.0 * R, rel=0.01)


def hollow(occ: Any) -> None:
    left = occ.cut(
        [(3, occ.addCylinder(-SIDE, 0, 0.6, 0, 0, 2.46, R))], [(3, occ.addCylinder(-SIDE, 0, 1.0, 0, 0, 1.0, 1.0))]
    )
    standing(occ, left[0][0], (3, occ.addCylinder(SIDE, 0, 0, 0, 0, 3.06, R)))


def legs(occ: Any) -> None:
    standing(
        occ,
        *((3, occ.addCylinder(-SIDE, y, 0.6, 0, 0, 2.46, 0.8)) for y in (-0.9, 0.9)),
        (3, occ.addCylinder(SIDE, 0, 0, 0, 0, 3.06, R)),
    )


def posts(occ: Any) -> None:
    standing(occ, *((3, occ.addCylinder(x, 0, z, 0, 0, 3.06 - z, 1.0)) for x, z in ((-SIDE, 0.6), (SIDE, 0.0))))


def box_with(*cuts: tuple[float, ...]) -> Callable[[Any], None]:
    """The design's skeleton without boxes of these corners and lengths."""

    def build(occ: Any) -> None:
        parts = [(3, occ.addBox(x - R, -R, z, 2 * R, 2 * R, 3.06 - z)) for x, z in ((-SIDE, 0.6), (SIDE, 0.0))]
        whole, _ = occ.fuse([(3, occ.addBox(*BEAM))], parts)
        occ.cut(whole, [(3, occ.addBox(*cut)) for cut in cuts])

    return build


waist = box_with((-2.5, -3.5, 3.06, 5, 2.5, 0.68), (-2.5, 1.0, 3.06, 5, 2.5, 0.68))
cavities = box_with((-3.0, -3.0, 3.2, 2.5, 6, 0.4), (0.5, -3.0, 3.2, 2.5, 6, 0.4))
# above the pillars, where sections across have these, too
hidden = box_with((-6.5, -3.0, 3.2, 2.5, 6, 0.4), (4.0, -3.0, 3.2, 2.5, 6, 0.4))


@pytest.mark.parametrize(
    ("build", "sets", "words"),
    [
        (hollow, (), r"a\.step: pillar short: found a hole in it at z = 1\.3 mm"),
        (legs, (), "pillar short: found 2 parts of the skeleton at z = 1.3 mm, expected the one"),
        (posts, (), r"nor is it the design's with pillars of their own: its pillar short reaches from x = -6\.2"),
        (waist, (), r"own: its beam has 1\.36 mm\^2 across at x = -2\.4\d* mm, expected 4\.76"),
        (cavities, (), r"its beam has 2\.36 mm\^2 across at x = -2\.8\d* mm, expected 4\.76"),
        (hidden, (), r"its beam has 54\.64 mm\^3 above z = 3\.06 mm, expected 66\.64"),
        (ellipses(1.75), (), r"a\.step: found 80\.1\d* of the skeleton's 134\.3 mm\^3 after it was cut"),
        (round_pillars, ("skeleton.beam_length=15 mm",), "but that of the design is 15 x 7 x 3.74 mm"),
    ],
)
def test_what_no_ring_goes_round_is_refused(
    gmsh: Any, tmp_path: Path, build: Callable[[Any], object], sets: tuple[str, ...], words: str
) -> None:
    """Catches: tissue in a hole, one ring of two legs, posts with the junction beside them, another machine, a beam
    that is narrowed or hollow, half a machine.
    """
    file = drawn(gmsh, tmp_path / "a.step", build)
    with pytest.raises(MeshError, match=words) as told:
        import_mesh(bot(*sets), file, size=4.0)
    assert "\n" not in str(told.value)


def test_a_loop_follows_boxes_alone(gmsh: Any, tmp_path: Path) -> None:
    """Catches: tissue left out, or in the air, at the corners of pillars that are not there."""
    design = load_design("ring_bot")
    plan = layout(design)

    def build(occ: Any) -> None:
        parts = []
        for box in plan.pillars:
            (x, _, z), (x1, _, z1) = box.low, box.high
            parts.append((3, occ.addCylinder(0.5 * (x + x1), 0, z, 0, 0, z1 - z, 0.5 * (x1 - x))))
        assert plan.beam is not None
        low, high = plan.beam.low, plan.beam.high
        occ.fuse([(3, occ.addBox(*low, *(b - a for a, b in zip(low, high, strict=True))))], parts)

    file = drawn(gmsh, tmp_path / "a.step", build)
    with pytest.raises(MeshError, match="a loop round all pillars follows boxes; give it with --muscle"):
        import_mesh(design, file, size=4.0)


def test_rods_are_not_set_beside_round_pillars(machine: Machine) -> None:
    """Catches: an error of the pillar's corners, which are not there, in place of the reason."""
    with pytest.raises(MeshError, match=r"short: found 3\.4\d* x 3\.4\d* mm and 9\.53 mm\^2 at its ring, expected"):
        crosscheck(machine.design, machine.mesh)
    refuse_own_pillars(*committed_bot())


def test_a_mesh_of_another_machine_is_refused_with_the_reason(machine: Machine, tmp_path: Path) -> None:
    """Rings, junction and box are still the design's when pillars are not.

    Catches: any muscle accepted round pillars that are no boxes.
    """
    write_mesh(tmp_path / "a.msh", machine.mesh)
    for key, words in (
        ("muscle.ring_height=1.3 mm", "its rings reach from z = 0.75 to 1.85 mm"),
        ("muscle.ring_thickness=0.7 mm", "its rings are 0.5"),
        ("muscle.junction_width=2.5 mm", "its junction has 0.88 mm"),
        ("skeleton.beam_width=6 mm", "its skeleton has another box"),
    ):
        with pytest.raises(MeshError, match=words):
            read_mesh(tmp_path / "a.msh", design=bot(key))


def test_rings_are_looked_at_all_round(machine: Machine) -> None:
    """A muscle that is thicker or thinner beside its pillars, or leaves a part of them free, is not the design's.

    Catches: rings known by their ends along x, tissue on one side taken for a ring.
    """
    plan, mesh = layout(machine.design), machine.mesh
    assert unlike(plan, mesh) == ""
    alone = np.setdiff1d(mesh.region_vertices("muscle"), mesh.region_vertices("skeleton"))
    beside = alone[np.abs(mesh.points[1, alone]) > R + 0.1]
    for factor, words in ((1.4, "mm thick about its pillar at"), (0.9, "mm thick about its pillar at")):
        points = mesh.points.copy()
        points[1, beside] *= factor
        moved = BodyMesh(points, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks, mesh.source)
        assert words in unlike(plan, moved)
    tissue = np.zeros(mesh.n_elements, dtype=bool)
    tissue[mesh.regions["muscle"]] = True
    kept = ~(tissue & (mesh.points[1, mesh.cells].mean(axis=0) > 1.1))
    cells, left = mesh.cells[:, kept], tissue[kept]
    there = np.isin(mesh.surfaces["interface"], cells[:, left]).all(axis=0)
    surfaces = {**mesh.surfaces, "interface": mesh.surfaces["interface"][:, there]}
    regions = {"skeleton": np.flatnonzero(~left), "muscle": np.flatnonzero(left)}
    half = BodyMesh(mesh.points, cells, regions, surfaces, mesh.landmarks, mesh.source)
    assert "mm around its pillars at z = 1.3 mm" in unlike(plan, half)


def test_the_commands_tell_of_round_pillars(
    machine: Machine, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catches: boxes taken for round pillars without a word."""
    said = call(
        capsys,
        "mesh",
        "junction_bot",
        "--set",
        "skeleton.pillar_width=3.5 mm",
        "--from",
        machine.file,
        "--size",
        "4",
        "--out",
        tmp_path,
    )
    assert said.code == 0
    assert "pillar short is no box" in said.err


@pytest.mark.slow
def test_a_round_machine_runs_to_full_drive(
    machine: Machine, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Catches: something on the way of a run that takes boxes and stops."""
    write_mesh(tmp_path / "a.msh", machine.mesh)
    out = tmp_path / "run"
    said = call(
        capsys, "run", "junction_bot", "--set", "skeleton.pillar_width=3.5 mm", "--mesh", tmp_path / "a.msh",
        "--no-walk", "--out", out, "--json",
    )  # fmt: skip
    assert said.code == 0
    summary = json.loads(said.out)
    peak = next(state for state in summary["solid"]["states"] if state["key"] == "peak")
    assert peak["muscle_force_mN"] == pytest.approx(4.37, rel=0.02)
    assert peak["tip_closing_mm"] == pytest.approx(3.94, rel=0.03)
    assert any("is no box" in note for note in summary["notes"])
