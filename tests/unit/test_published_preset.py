"""The preset elastica_walker: read, listed and walked like a design, refused where a solid is needed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.config import digest, load_design, to_toml
from fem_biobot.design_parts import Walker
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.mesh.geometry import build_mesh
from fem_biobot.rod.dynamics.integrate import Motion
from fem_biobot.rod.model import RodState
from fem_biobot.rod.published.course import beginning, diagnostics, published_drive
from fem_biobot.rod.published.description import AS_PUBLISHED, CORRECTED, ElasticaWalker, Oddity, Start
from fem_biobot.rod.published.design import walker_of
from fem_biobot.rod.published.machine import elastica_walker, ground_of
from fem_biobot.rod.reduce import ground_of as ground_of_design
from fem_biobot.rod.reduce import reduce
from fem_biobot.rod.walk import walk
from fem_biobot.solid.from_design import model_from_design
from fem_biobot.study.run import run
from fem_biobot.study.walking import WalkPlan, walk_design
from tests.command import call

PRESET = "elastica_walker"


def test_the_preset_is_the_published_machine() -> None:
    """Numbers of the file are those of the description; the machine is the same.

    Catches: a force in micronewtons, a ground of the design that the machine does not stand on.
    """
    design = load_design(PRESET)
    assert walker_of(design) == ElasticaWalker()
    assert reduce(design).mass == elastica_walker().mass
    assert ground_of_design(design) == ground_of(ElasticaWalker())


@pytest.mark.parametrize("oddity", list(Oddity))
def test_each_oddity_is_a_key(oddity: Oddity) -> None:
    """Switched on over the corrected set and off under the published one, in a file that reads back as the same.

    Catches: a key that switches another oddity, one that the digest does not see.
    """
    assert set(Oddity) < set(Walker.model_fields)
    on = load_design(PRESET, ["walker.oddities=corrected", f"walker.{oddity}=yes"])
    off = load_design(PRESET, [f"walker.{oddity}=no"])
    assert walker_of(on).oddities == CORRECTED | {oddity}
    assert walker_of(off).oddities == AS_PUBLISHED - {oddity}
    assert len({digest(d) for d in (on, off, load_design(PRESET))}) == 3


def test_the_file_reads_back_as_the_same(tmp_path: Path) -> None:
    """Without keys of meshes and media, which it has no use for.

    Catches: a mesh size written for a machine without a mesh.
    """
    design = load_design(PRESET, ["walker.halved_beam=no", "walker.start=published", "drive.frequency=1 Hz"])
    text = to_toml(design)
    assert "mesh" not in text
    assert "immersion" not in text
    path = tmp_path / "mine.toml"
    path.write_text(text)
    assert digest(load_design(path)) == digest(design)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("walker.halved_beam=perhaps", 'walker.halved_beam: found "perhaps", expected one of: as_set, yes, no'),
        ("walker.oddities=some", 'walker.oddities: found "some", expected one of: as_published, corrected'),
        ("walker.active_force=-1 mN", "walker.active_force: found -1 mN"),
        ("walker.halved_bream=yes", "walker.halved_bream: unknown key; did you mean walker.halved_beam?"),
        ("mesh.size=1 mm", 'mesh: found a section, expected none for kind "walker"'),
        ("ground.immersion=submerged", 'ground.immersion: found "submerged", expected no such key for kind "walker"'),
        ("skeleton.beam_length=14 mm", "skeleton."),
    ],
)
def test_what_is_not_its_own_is_refused(setting: str, words: str) -> None:
    """In one line that begins with the key.

    Catches: a key without effect taken in silence.
    """
    with pytest.raises(DesignError) as refusal:
        load_design(PRESET, [setting])
    assert str(refusal.value).startswith(words)
    assert "\n" not in str(refusal.value)


def test_other_machines_have_no_walker(tmp_path: Path) -> None:
    """A bot refuses the section, a machine without mesh section is told, and a bot is no published walker.

    Catches: sections of one kind accepted by another.
    """
    with pytest.raises(DesignError, match='walker: found a section, expected none for kind "bot"'):
        load_design("junction_bot", ["walker.start=standing"])
    path = tmp_path / "mine.toml"
    path.write_text('kind = "strip"\n')
    with pytest.raises(DesignError, match="mesh: missing, expected a section"):
        load_design(path)
    with pytest.raises(ModelError, match="kind: found bot, expected walker"):
        walker_of(load_design("junction_bot"))


@pytest.mark.parametrize("command", ["mesh", "solve", "run"])
def test_what_needs_a_solid_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    """Exit code 2 and one line that says it has no solid; nothing is written.

    Catches: a mesh of a machine that has none, a traceback.
    """
    monkeypatch.chdir(tmp_path)
    said = call(capsys, command, PRESET)
    assert said.code == 2
    assert "rods without a solid" in said.complaint
    assert len(said.err.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_functions_that_need_a_solid_refuse_it(tmp_path: Path) -> None:
    """As the command line does.

    Catches: a check at the command line alone.
    """
    design = load_design(PRESET)
    for make in (
        lambda: build_mesh(design),
        lambda: run(design, tmp_path / "out"),
        lambda: model_from_design(design, None),  # type: ignore[arg-type]
    ):
        with pytest.raises(DesignError, match="rods without a solid"):
            make()


def test_it_is_listed_with_its_forces(capsys: pytest.CaptureFixture[str]) -> None:
    """Among the presets, with the force of a fibre.

    Catches: a preset that is left out of the list, a span that it does not have.
    """
    said = call(capsys, "presets", "--json")
    (found,) = [row for row in json.loads(said.out) if row["name"] == PRESET]
    assert found["kind"] == "walker"
    assert (found["base_force_mN"], found["peak_force_mN"]) == (0.2, pytest.approx(0.8))


def test_the_published_course_begins_at_a_tenth_of_a_second() -> None:
    """Nothing before; then the base force grows at 1 mN/s to 0.2 mN and the strokes begin.

    Catches: strokes before the base force, a ramp in other units, a base force that goes on growing.
    """
    walker = ElasticaWalker(start=Start.published)
    drive = published_drive(walker, lambda t: abs(np.sin(2 * np.pi * t)))
    model = elastica_walker(walker)
    k = model.muscles["fibre_2_3"]
    for time, base in ((0.0, 0.0), (0.1, 0.0), (0.2, 0.1), (0.3, 0.2), (1.7, 0.2)):
        strokes = 0.6 * abs(np.sin(2 * np.pi * (time - 0.1))) if time > 0.1 else 0.0
        assert model.pull(drive(time))[k] == pytest.approx(base + strokes, abs=1e-12)
    assert published_drive(ElasticaWalker(active_force=0.0), lambda t: 1.0)(0.5) == 1.0
    with pytest.raises(ModelError, match="start: found 'flying', expected standing or published"):
        ElasticaWalker(start="flying")  # type: ignore[arg-type]


def test_a_design_begins_as_it_says() -> None:
    """From the drawing with the published course, or standing with the strokes alone.

    Catches: a base force twice, once standing and once in the drive.
    """
    for start in Start:
        design = load_design(PRESET, [f"walker.start={start}"])
        model = reduce(design)
        begun, drive = beginning(design, model, lambda t: 0.5)
        published = start is Start.published
        assert isinstance(begun, RodState) == published
        assert drive(1.0) == pytest.approx(0.5 + 1 / 3 if published else 0.5)
        assert model.pull(0.0).max() == pytest.approx(0.0 if published else 0.2)


@pytest.fixture(scope="module")
def fallen() -> Motion:
    """The published machine in its first tenths of a second."""
    walked = walk(load_design(PRESET, ["walker.start=published"]), duration=0.3, step=2e-3)
    assert walked.start is None
    return walked.motion


def test_it_falls_to_its_feet_and_is_pulled_together(fallen: Motion) -> None:
    """It stands on both pillars with its weight, tilted by their difference, before anything pulls.

    Catches: a machine that starts on the ground, a foot without contact, muscle with a weight.
    """
    stands = int(np.searchsorted(fallen.times, 0.098))
    state = fallen.state(stands)
    heights = [state.at((f"leg_{pillar}_right", 6))[2] for pillar in ("short", "long")]
    assert max(heights) < 0.2
    tilt = np.degrees(np.arcsin(state.directors("beam_right")[0, 2, 2]))
    assert tilt == pytest.approx(np.degrees(0.6 / 10.5), abs=0.5)
    rise = state.at(("ring_long_upper", 3))[2]
    assert rise == pytest.approx(1.5, abs=1e-9)
    assert fallen.state(-1).muscle_length("fibre_1_2") < 0.99 * state.muscle_length("fibre_1_2")


def test_diagnostics_are_what_the_code_writes(fallen: Motion) -> None:
    """The beam's middle, the distance of the inner corners of the feet, and friction as impulses, 120 times a second.

    Catches: the feet's middles for their corners, forces at instants instead of means, another rate.
    """
    found = diagnostics(fallen)
    np.testing.assert_allclose(np.diff(found["time_s"]), 1 / 120, rtol=1e-9)
    assert found["foot_distance_mm"][0] == pytest.approx(np.hypot(7.0, 0.6), rel=1e-9)
    middle = [fallen.state(i).at(("beam_right", 8))[0] for i in range(len(fallen.times))]
    np.testing.assert_allclose(found["beam_middle_x_mm"], np.interp(found["time_s"], fallen.times, middle), atol=1e-12)
    last = found["time_s"][-1]
    inside = fallen.times <= last + 1e-9
    gaps = np.diff(fallen.times, prepend=0.0)[inside]
    feet = fallen.contact_force[inside]
    for pillar, points in (("short", range(4)), ("long", range(4, 8))):
        for name, column in (("normal", 0), ("friction", 1)):
            impulse = found[f"{name}_{pillar}_mN"][1:].sum() / 120
            wanted = gaps @ feet[:, list(points), column].sum(axis=1)
            assert impulse == pytest.approx(wanted, rel=1e-2, abs=1e-6)
    assert found["ring_push_long_mN"].min() < -0.01
    assert found["ring_push_long_mN"][:11] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow
def test_the_command_walks_it_with_the_usual_outputs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A walk of two strokes: summary, tables with the diagnostics, rods over time, graphs and the animation.

    Catches: an output that needs a bot's parts, a stance sought by statics.
    """
    out = tmp_path / "out"
    arguments = ("--duration", "1s", "--frequency", "2Hz", "--set", "walker.halved_beam=no", "--set")
    said = call(capsys, "walk", PRESET, *arguments, "numerics.step=2 ms", "--out", out)
    assert said.code == 0
    names = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert {
        "summary.json", "design.toml", "rod.pvd", "report.html", "tables/walk_2Hz_air.csv",
        "tables/diagnostics_2Hz_air.csv", "figures/gait_2Hz_air.gif", "figures/walk_2Hz_air.png",
    } < names  # fmt: skip
    (found,) = json.loads((out / "summary.json").read_text())["walks"]
    assert found["active_force_mN"] == pytest.approx(2.4)
    assert 0.2 < found["stroke_mm"] < 1.2
    rows = np.genfromtxt(out / "tables" / "diagnostics_2Hz_air.csv", delimiter=",", names=True)
    assert len(rows) == 121


def test_a_walk_shorter_than_a_stroke_is_refused(tmp_path: Path) -> None:
    """As for other machines, before anything is written.

    Catches: a kind of machine that skips the checks of a plan.
    """
    with pytest.raises(DesignError, match=r"duration: found 0\.1 s, expected at least a stroke"):
        walk_design(load_design(PRESET), tmp_path / "none", WalkPlan((2.0,), 0.1, 1.0))
    assert not (tmp_path / "none").exists()
