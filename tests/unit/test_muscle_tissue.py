"""Tissue by seeding: compaction, maturation, Eq. 1, and a design that says how it was seeded."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

from fem_biobot.config import load_design, to_toml
from fem_biobot.design_tissue import told
from fem_biobot.errors import DesignError
from fem_biobot.mesh.files import read_mesh
from fem_biobot.muscle.compaction import compacted_section, compaction_ratio
from fem_biobot.muscle.maturation import active_force, passive_force, tensions
from fem_biobot.muscle.myotubes import Tissue, explained, mean_sine, seeding_rows
from fem_biobot.study.muscle_findings import muscle_findings
from tests.command import ROOT, call

SEEDED = ("muscle.tissue.seeded_width = 7 mm", "muscle.tissue.days = 10")


def test_compaction_meets_the_printed_ratios() -> None:
    """1.58 at 3.5 mm and 3.08 at 14 mm, 0.75 more for a doubling; tissue stays within what it was seeded with.

    Catches: the ratio upside down, the logarithm of another base, volume that is gained.
    """
    assert compaction_ratio(3.5) == 1.58
    assert compaction_ratio(14.0) == pytest.approx(3.08)
    assert compaction_ratio(9.0) - compaction_ratio(4.5) == pytest.approx(0.75)
    width, depth = compacted_section(9.0)
    assert (width, depth) == (pytest.approx(9.0 / compaction_ratio(9.0)), 0.4)
    narrow, thick = compacted_section(9.0, 0.5, 0.7)
    assert narrow == width
    assert narrow * thick == pytest.approx(0.7 * 9.0 * 0.5)
    for arguments, words in (((3.0,), "seeded_width: found 3 mm"), ((7.0, 0.0), "seeded_depth: found 0 mm"),
                             ((7.0, 0.4, 0.0), "volume_kept: found 0")):  # fmt: skip
        with pytest.raises(DesignError, match=words):
            compacted_section(*arguments)


def test_tensions_by_day_scale_with_the_measured_forces() -> None:
    """At 15 days the split of 10.39 kPa; before, in proportion to the forces; a third for tissue seeded with myoblasts.

    Catches: shares of the passive instead of the total force, days that are extrapolated.
    """
    assert tensions(15.0) == (9.09, pytest.approx(1.30))
    assert passive_force(10.0) == 8.38
    # printed as 7.5 percent of the total
    assert active_force(10.0) / (active_force(10.0) + 8.38) == pytest.approx(0.075)
    assert tensions(10.0) == pytest.approx((9.09 * 8.38 / 8.45, 1.30 * 0.6795 / 1.2071), rel=1e-3)
    assert passive_force(12.5) == pytest.approx((8.38 + 8.45) / 2.0)
    assert tensions(12.0, "myoblasts") == pytest.approx((tensions(12.0)[0], tensions(12.0)[1] / 3.0))
    with pytest.raises(DesignError, match="days: found 16, expected between 5 and 15"):
        tensions(16.0)
    with pytest.raises(DesignError, match="seeding: found cells"):
        tensions(12.0, "cells")  # type: ignore[arg-type]


def test_equation_one_takes_each_of_its_terms_once() -> None:
    """Force is the product; the factors between two tissues multiply to that of their forces.

    Catches: a length squared, gamma left out, a mean of the squared sine in place of the sine's.
    """
    young, old = Tissue(900.0, 0.2, 8e-4, 0.87, 0.9), Tissue(1500.0, 0.35, 6e-4, 0.96, 1.0)
    assert old.force == pytest.approx(1500.0 * 0.35 * 6e-4 * 0.96)
    factors = explained(young, old)
    assert math.prod(v for k, v in factors.items() if k != "force") == pytest.approx(factors["force"])
    # chi_mean_sin of 15 degrees in the facts on dispersion
    assert mean_sine(math.pi / 2, math.radians(15.0)) == pytest.approx(0.9663, abs=2e-4)
    assert mean_sine(1.1, math.radians(15.0)) == pytest.approx(math.sin(1.1) * 0.9663, abs=2e-4)
    assert mean_sine(1.1, 0.0) == pytest.approx(math.sin(1.1))
    rows = {row["term"]: row["factor_1"] for row in seeding_rows(0.3)}
    assert list(rows.values()) == [pytest.approx(3.0), pytest.approx(1.5), pytest.approx(2.0)]
    with pytest.raises(DesignError, match=r"Eq\. 1: force: found 0 mN"):
        explained(Tissue(0.0, 1.0, 1.0), old)
    with pytest.raises(DesignError, match=r"Eq\. 1: length: found -1"):
        Tissue(1.0, -1.0, 1.0)
    with pytest.raises(DesignError, match=r"Eq\. 1: chi: found 1\.2, expected at most 1"):
        Tissue(1.0, 1.0, 1.0, 1.2)


def test_a_design_says_how_it_was_seeded() -> None:
    """Section and tension follow, replace what the preset says, follow again when the seeding changes, and are told.

    Catches: the preset's width kept, a tension of another day left behind, a resolved file that does not read back.
    """
    design = load_design("junction_bot", SEEDED)
    muscle = design.muscle
    assert muscle is not None
    assert muscle.junction_width == pytest.approx(7.0 / 2.33)
    assert design.junction_section == pytest.approx(0.4 * 7.0 / 2.33)
    assert (muscle.passive_tension, muscle.active_tension) == pytest.approx(tensions(10.0))
    other = design.with_values({"muscle.tissue.days": 15.0, "muscle.tissue.volume_kept": 0.5})
    assert other.value("muscle.active_tension") == 1.30
    assert other.junction_section == pytest.approx(0.5 * 7.0 * 0.4)
    assert "3.004 mm by 0.4 mm" in (told(muscle) or "")
    assert told(load_design("junction_bot").muscle) is None


def test_a_seeded_design_reads_back_and_may_be_a_base(tmp_path: Path) -> None:
    """The resolved file holds the section and what follows; a file over a preset, or over that file, changes it.

    Catches: a resolved file that clashes with itself, a base's width that stays.
    """
    design = load_design("junction_bot", SEEDED)
    whole = tmp_path / "whole.toml"
    whole.write_text(to_toml(design))
    assert load_design(whole).muscle == design.muscle
    assert load_design(whole, ["muscle.tissue.days=15"]).value("muscle.passive_tension") == 9.09
    over = tmp_path / "over.toml"
    over.write_text('base = "junction_bot"\n[muscle.tissue]\nseeded_width = "3.5 mm"\nseeding = "myoblasts"\n')
    assert load_design(over).value("muscle.junction_width") == pytest.approx(3.5 / 1.58)
    assert load_design(over).value("muscle.active_tension") == pytest.approx(1.30 / 3.0)
    twice = tmp_path / "twice.toml"
    twice.write_text('base = "whole.toml"\n[muscle.tissue]\ndays = 12\n')
    assert load_design(twice).value("muscle.tissue.seeded_width") == 7.0
    assert load_design(twice).value("muscle.passive_tension") == pytest.approx(tensions(12.0)[0])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (("muscle.tissue.days=12",), r"muscle\.tissue\.seeded_width: missing"),
        (("muscle.tissue.seeded_width=7",), r"muscle\.tissue\.seeded_width: found \"7\" \(no unit\)"),
        (("muscle.tissue.seeded_width=20 mm",), r"muscle\.tissue\.seeded_width: found 20 mm, expected between"),
        ((*SEEDED, "muscle.tissue.days=3"), r"muscle\.tissue\.days: found 3, expected between 5 and 15"),
        ((*SEEDED, "muscle.tissue.seeding=cells"), r"muscle\.tissue\.seeding: found \"cells\", expected one of"),
        ((*SEEDED, "muscle.junction_width=2 mm"), r"muscle\.junction_width: found 2 mm beside muscle\.tissue"),
        (("muscle.active_tension=2 kPa", *SEEDED), r"muscle\.active_tension: found 2 kPa beside muscle\.tissue"),
    ],
)
def test_seeding_that_makes_no_tissue_is_refused(settings: tuple[str, ...], words: str) -> None:
    """By the key, in whatever order the settings stand.

    Catches: a stated width that wins in silence, numbers from outside what was measured.
    """
    with pytest.raises(DesignError, match=words):
        load_design("junction_bot", settings)


def test_a_ring_is_not_seeded_in_a_trench() -> None:
    """The law of widths is the junction's.

    Catches: a loop of muscle given a junction's section.
    """
    with pytest.raises(DesignError, match=r"muscle\.tissue: found with muscle\.layout ring"):
        load_design("ring_bot", SEEDED)
    with pytest.raises(DesignError, match=r"muscle\.junction_width: found wide beside"):
        load_design("junction_bot", SEEDED).with_values({"muscle.junction_width": "wide"})


def test_the_command_and_the_run_tell_of_the_tissue(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Tables of widths, days and Eq. 1 are written beside the measured; a run takes drive, tissue and oxygen.

    Catches: the paper's forces in the wrong row, a subject that the run leaves out.
    """
    out = tmp_path / "t"
    sets = [part for setting in SEEDED for part in ("--set", setting)]
    said = call(capsys, "muscle", "tissue", "junction_bot", *sets, "--out", out, "--json")
    assert said.code == 0
    summary = json.loads(said.out)
    active = tensions(10.0)[1]
    assert summary["tissue"]["eq1_active_mN"] == pytest.approx(active * 0.4 * 7.0 / 2.33)
    rows = list(csv.DictReader((out / "tables" / "tissue_width.csv").open()))
    assert [float(r["active_mN"]) for r in rows] == [0.97, 0.67, 0.47]
    assert float(rows[2]["eq1_force_mN"]) == pytest.approx(active * 0.4 * 14.0 / 3.08)
    assert float(rows[2]["eq1_force_volume_mN"]) == pytest.approx(active * 0.4 * 14.0 / 1.58)
    days = list(csv.DictReader((out / "tables" / "tissue_day.csv").open()))
    assert [float(r["paper_passive_mN"]) for r in days] == [7.99, 8.38, 8.45]
    design = load_design(
        "junction_bot", [*SEEDED, "muscle.oxygen.consumption = 0.01 mM/s", "muscle.force_velocity.fastest = 5 1/s"]
    )
    folder = tmp_path / "run"
    folder.mkdir()
    found = muscle_findings(design, read_mesh(ROOT / "meshes" / "junction_bot_small.msh"), folder)
    assert list(found.numbers) == ["drive", "fibres", "tissue", "oxygen", "velocity"]
    assert len(found.figures) == 7
    assert all(file.is_file() for file, _ in found.figures)
    assert (folder / "tables" / "seeding.csv").is_file()
    assert (
        muscle_findings(load_design("cantilever"), read_mesh(ROOT / "meshes" / "cantilever_small.msh"), folder).numbers
        == {}
    )
