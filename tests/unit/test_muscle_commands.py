"""The commands below `fem-biobot muscle`: what they print, write, reuse and refuse."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest

from fem_biobot.config import load_design
from fem_biobot.design_checks import refuse_without_muscle
from fem_biobot.errors import DesignError
from tests.command import call, listing


def test_the_group_lists_its_commands(capsys: pytest.CaptureFixture[str]) -> None:
    """Without a command the group shows what there is and ends well; an unknown one is refused in one line.

    Catches: a group that does nothing in silence, a traceback for a mistyped command.
    """
    said = call(capsys, "muscle")
    assert said.code == 0
    assert "drive" in said.out
    said = call(capsys, "muscle", "dirve", "junction_bot")
    assert (said.code, len(said.err.splitlines())) == (2, 1)
    assert "dirve" in said.complaint


def test_drive_writes_a_whole_folder_and_reuses_it(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The samples are those of the design's waveform, the JSON alone stands on standard output, a second call works
    nothing anew, and a folder of another design or another subject is refused.

    Catches: options that are not passed on, a result computed again, another's result written over.
    """
    out = tmp_path / "drive"
    said = call(capsys, "muscle", "drive", "junction_bot", "--set", "drive.amplitude=0.6", "--out", out, "--json")
    assert said.code == 0
    summary = json.loads(said.out)
    # mean of |sin| is 2 / pi
    assert summary["drive"]["mean_1"] == pytest.approx(0.6 * 2.0 / math.pi, rel=1e-4)
    rows = list(csv.DictReader((out / "tables" / "drive.csv").open()))
    assert float(rows[100]["drive_1"]) == pytest.approx(0.6 * math.sin(math.pi * 2.0 * float(rows[100]["time_s"])))
    assert {"summary.json", "design.toml", "report.html", "figures/drive.png"} <= set(listing(out))
    before = listing(out)
    again = call(capsys, "muscle", "drive", "junction_bot", "--set", "drive.amplitude=0.6", "--out", out)
    assert (again.code, listing(out)) == (0, before)
    assert "holds this design's result already" in again.err
    assert "mean" in again.out
    other = call(capsys, "muscle", "drive", "junction_bot", "--out", out, "--quiet")
    assert (other.code, len(other.err.splitlines())) == (2, 1)
    assert "another design" in other.complaint
    forced = call(capsys, "muscle", "drive", "junction_bot", "--out", out, "--quiet", "--force")
    assert (forced.code, forced.out.strip()) == (0, str(out))
    solved = call(capsys, "solve", "junction_bot", "--out", out, "--quiet")
    assert (solved.code, "another job, muscle drive" in solved.complaint) == (2, True)


def test_a_machine_without_a_muscle_is_refused_before_anything_is_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A beam has no muscle; a walker of rods has one that is driven, but no tissue.

    Catches: an empty folder left behind, a walker refused for its drive.
    """
    said = call(capsys, "muscle", "drive", "cantilever", "--out", tmp_path / "none")
    assert said.code == 2
    assert said.complaint.endswith("expected a bot, strip or walker with a muscle to examine its drive")
    assert not (tmp_path / "none").exists()
    refuse_without_muscle(load_design("elastica_walker"), "drive it", tissue=False)
    with pytest.raises(DesignError, match="kind: found walker, expected a bot or strip"):
        refuse_without_muscle(load_design("elastica_walker"), "ask for oxygen")
