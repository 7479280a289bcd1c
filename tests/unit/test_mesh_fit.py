"""Skeletons of other lengths lend them to the design; a STEP file may hold skeleton and muscle by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import MeshError
from fem_biobot.mesh.foreign import export_part, fitted, import_mesh
from fem_biobot.mesh.layout import layout
from fem_biobot.mesh.solids import drawn_muscle, drawn_skeleton
from fem_biobot.mesh.tagged import read_mesh
from tests.command import ROOT, call
from tests.drawing import drawn

SKELETON = {
    "skeleton.beam_length": 18.0,
    "skeleton.beam_width": 7.4,
    "skeleton.beam_thickness": 0.9,
    "skeleton.pillar_length": 4.3,
    "skeleton.pillar_width": 6.2,
    "skeleton.short_pillar_height": 3.3,
    "skeleton.long_pillar_height": 3.9,
}
MUSCLE = {
    "muscle.junction_width": 2.5,
    "muscle.junction_thickness": 0.45,
    "muscle.junction_height": 1.7,
    "muscle.ring_thickness": 0.6,
    "muscle.ring_height": 1.2,
    "muscle.ring_offset": -0.15,
}


pytestmark = pytest.mark.usefixtures("gmsh")


@pytest.fixture(scope="module")
def bot() -> Design:
    return load_design("junction_bot")


def values(design: Design, names: dict[str, float]) -> dict[str, float]:
    return {name: design.value(name) for name in names}


@pytest.mark.parametrize(("suffix", "unit"), [(".step", None), (".stl", "mm")])
def test_a_design_takes_the_lengths_of_its_parts(bot: Design, tmp_path: Path, suffix: str, unit: str | None) -> None:
    """Drawn elsewhere, so that nothing lies where the design has it; to a nanometre, or single precision of STL.

    Catches: lengths of one pillar taken for the other, widths of the beam for those of pillars, heights from the sole
    instead of the axis, a ring's offset turned round.
    """
    other = bot.with_values({**SKELETON, **MUSCLE})
    for part in ("skeleton", "muscle"):
        export_part(other, tmp_path / f"{part}{suffix}", part)
    found = fitted(bot, tmp_path / f"skeleton{suffix}", unit=unit)
    assert values(found, SKELETON) == pytest.approx(SKELETON, abs=3e-6)
    assert values(found, MUSCLE) == values(bot, MUSCLE)
    both = fitted(bot, tmp_path / f"skeleton{suffix}", muscle=tmp_path / f"muscle{suffix}", unit=unit)
    assert values(both, {**SKELETON, **MUSCLE}) == pytest.approx({**SKELETON, **MUSCLE}, abs=3e-6)
    mesh = import_mesh(found, tmp_path / f"skeleton{suffix}", unit=unit, size=4.0)
    assert mesh.region_volumes() == pytest.approx(dict(layout(found).volumes), rel=1e-5)
    kept = fitted(bot, tmp_path / f"skeleton{suffix}", unit=unit, kept=["skeleton.beam_length", "skeleton.beam_width"])
    assert kept.value("skeleton.beam_length") == 14.0


def test_the_committed_drawings_have_the_designs_lengths(bot: Design) -> None:
    """Catches: lengths in another unit, a slice through a rounded edge."""
    step = fitted(bot, ROOT / "tests" / "drawings" / "skeleton.step")
    names = [name for name in SKELETON if name != "skeleton.beam_length"]
    for name in ("skeleton.beam_length", *names):
        assert step.value(name) == pytest.approx(bot.value(name), abs=2e-6), name


def test_a_loop_round_all_pillars_is_measured_too(tmp_path: Path) -> None:
    """Catches: a junction looked for where there is none."""
    other = load_design("ring_bot").with_values({"muscle.ring_thickness": 0.31, "muscle.ring_height": 0.62})
    for part in ("skeleton", "muscle"):
        export_part(other, tmp_path / f"{part}.step", part)
    found = fitted(load_design("ring_bot"), tmp_path / "skeleton.step", muscle=tmp_path / "muscle.step")
    for name in ("muscle.ring_thickness", "muscle.ring_height", "muscle.junction_height"):
        assert found.value(name) == pytest.approx(
            other.value(name) if "junction" not in name else _middle(other), abs=3e-6
        )


def _middle(design: Design) -> float:
    """Height of a loop's middle."""
    return design.value("muscle.junction_height") + design.value("muscle.ring_offset")


def test_a_step_file_with_both_parts_is_split_by_their_names(gmsh: Any, bot: Design, tmp_path: Path) -> None:
    """By the words skeleton and muscle, or by names that stand for them; what is in one solid is no other's.

    Catches: solids told apart by their order, a muscle built besides the one in the file, an unknown solid left out.
    """
    plan = layout(bot)

    def build(occ: Any) -> None:
        drawn_muscle(occ, plan, [], joined=True)
        drawn_skeleton(occ, plan)

    named = drawn(gmsh, tmp_path / "named.step", build, ("Muscle", "skeleton"))
    mesh = import_mesh(bot, named, size=4.0)
    assert mesh.region_volumes() == pytest.approx(dict(plan.volumes), rel=1e-6)
    other = drawn(gmsh, tmp_path / "other.step", build, ("tissue", "gel"))
    mesh = import_mesh(bot, other, size=4.0, names={"gel": "skeleton", "tissue": "muscle"})
    assert mesh.region_volumes() == pytest.approx(dict(plan.volumes), rel=1e-6)
    assert values(fitted(bot, named), MUSCLE) == pytest.approx(values(bot, MUSCLE), abs=2e-6)
    for names, words in (
        ({"gel": "skeleton"}, "the solid tissue is not known, expected skeleton or muscle"),
        ({"gel": "muscle", "tissue": "muscle"}, "found no solid named skeleton, only tissue, gel"),
        ({"bone": "skeleton"}, "--rename names bone, but the solids are tissue, gel"),
    ):
        with pytest.raises(MeshError, match=words):
            import_mesh(bot, other, size=4.0, names=names)
    export_part(bot, tmp_path / "muscle.step", "muscle")
    with pytest.raises(MeshError, match=r"muscle\.step: found a muscle in .*named\.step, too"):
        import_mesh(bot, named, muscle=tmp_path / "muscle.step", size=4.0)


BEAM, LEFT, RIGHT = (-7.0, -3.5, 3.0, 14.0, 7.0, 0.7), (-7.0, -3.5, 0.6, 3.5, 7.0, 2.4), (3.5, -3.5, 0.0, 3.5, 7.0, 3.0)
WRONG = {
    "nothing below the beam": ([BEAM], "found nothing below the beam, expected 2 pillars"),
    "one pillar": ([BEAM, LEFT], "found 1 pillars below the beam, expected 2"),
    "three pillars": (
        [BEAM, LEFT, RIGHT, (0.5, -3.5, 0.3, 1.0, 7.0, 2.7)],
        r"found 3 pillars .* expected 2; .* --set skeleton\.pillar_count=3",
    ),
    "turned": (
        [BEAM, (-7.0, -3.5, 0.0, 3.5, 7.0, 3.0), (3.5, -3.5, 0.6, 3.5, 7.0, 2.4)],
        "the longer pillar is at the lower x",
    ),
    "unlike": ([BEAM, LEFT, (4.5, -3.5, 0.0, 2.5, 7.0, 3.0)], r"found pillars of 3\.5, 2\.5, expected one skel"),
    "overhanging": (
        [(-8.0, -3.5, 3.0, 16.0, 7.0, 0.7), LEFT, RIGHT],
        "the beam reaches 1 and 1 beyond its pillars",
    ),
    "a wall in the middle": (
        [BEAM, LEFT, RIGHT, (-1.0, -3.5, 0.0, 2.0, 7.0, 1.0)],
        "found 2 parts between the pillars",
    ),
    "no room for the muscle": (
        [BEAM, (-7.0, -3.5, 2.0, 3.5, 7.0, 1.0), (3.5, -3.5, 1.9, 3.5, 7.0, 1.1)],
        r"its lengths make no design: muscle\.junction_height",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_is_not_found_is_asked_for_in_a_line(gmsh: Any, bot: Design, tmp_path: Path, case: str) -> None:
    """Catches: a machine with other pillars taken for this one, lengths that make no design told as a defect."""
    boxes, words = WRONG[case]

    def build(occ: Any) -> None:
        parts = [(3, occ.addBox(*box)) for box in boxes]
        if len(parts) > 1 and case != "a wall in the middle":
            occ.fuse(parts[:1], parts[1:])
        elif len(parts) > 1:
            # hung from one side, so that it is one body
            parts.append((3, occ.addBox(-4.0, -3.5, 0.6, 4.0, 1.0, 0.3)))
            occ.fuse(parts[:1], parts[1:])

    file = drawn(gmsh, tmp_path / "a.step", build)
    with pytest.raises(MeshError, match=words) as told:
        fitted(bot, file)
    assert "\n" not in str(told.value)


def test_muscles_without_rings_or_junction_are_told(gmsh: Any, bot: Design, tmp_path: Path) -> None:
    """Catches: a junction alone taken for a muscle with rings of no thickness."""
    export_part(bot, tmp_path / "skeleton.step")
    alone = drawn(gmsh, tmp_path / "alone.step", lambda occ: occ.addBox(-3.5, -1.1, 1.2, 7.0, 2.2, 0.4))
    with pytest.raises(MeshError, match="no muscle beyond the pillars' outer faces"):
        fitted(bot, tmp_path / "skeleton.step", muscle=alone)

    def rings(occ: Any) -> None:
        for x in (-7.5, 3.0):
            occ.cut(
                [(3, occ.addBox(x, -4.0, 0.75, 4.5, 8.0, 1.1))], [(3, occ.addBox(x + 0.5, -3.5, 0.75, 3.5, 7.0, 1.1))]
            )

    with pytest.raises(MeshError, match="found 0 junctions at mid-span"):
        fitted(bot, tmp_path / "skeleton.step", muscle=drawn(gmsh, tmp_path / "rings.step", rings))
    with pytest.raises(MeshError, match="found strip, expected a bot"):
        fitted(load_design("strip"), tmp_path / "skeleton.step")


def test_the_command_writes_the_design_beside_its_mesh(
    bot: Design, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The two go together: the mesh reads as one of that design; a key that is set stays.

    Catches: a design with its old lengths, one that overrides what was asked for, the way to it not told.
    """
    export_part(bot.with_values(SKELETON), tmp_path / "a.step")
    given = ("mesh", "junction_bot", "--from", tmp_path / "a.step", "--size", "4", "--out", tmp_path)
    refused = call(capsys, *given)
    assert (refused.code, "--fit" in refused.complaint) == (2, True)
    said = call(capsys, *given, "--fit", "--set", "muscle.junction_width=2 mm")
    assert said.code == 0
    assert "junction_bot.toml" in said.out
    design = load_design(tmp_path / "junction_bot.toml")
    assert values(design, SKELETON) == pytest.approx(SKELETON, abs=2e-6)
    assert design.value("muscle.junction_width") == 2.0
    mesh = read_mesh(tmp_path / "junction_bot.msh", design=design)
    assert {"foot_short", "foot_long", "junction_mid"} <= set(mesh.surfaces)
    lonely = call(capsys, "mesh", "junction_bot", "--fit")
    assert (lonely.code, "--fit: found without --from" in lonely.complaint) == (2, True)
    (tmp_path / "junction_bot.toml").write_text("another")
    again = call(capsys, *given, "--fit", "--set", "muscle.junction_width=2 mm")
    assert (again.code, "found another design" in again.complaint) == (2, True)
