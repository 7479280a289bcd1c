"""Drawings in and out at the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fem_biobot.errors import DesignError
from fem_biobot.mesh_jobs import landmark_places
from tests.command import ROOT, call, listing

DRAWINGS = ROOT / "tests" / "drawings"


def test_a_skeleton_goes_out_and_comes_in_and_is_solved_on(
    gmsh: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exported, meshed with the muscle of its own file, checked as a mesh of the design by the command that takes any.

    Catches: an option that is not handed on, files exchanged, a mesh that the other commands refuse.
    """
    step, stl = tmp_path / "s.step", tmp_path / "m.stl"
    said = call(capsys, "mesh", "junction_bot", "--export", step, "--export-muscle", stl)
    assert (said.code, said.out) == (0, f"{step}\n{stl}\n")
    again = call(capsys, "mesh", "junction_bot", "--export", step)
    assert again.code == 2
    assert str(step) in again.err
    assert call(capsys, "mesh", "junction_bot", "--export", step, "--force", "--json").code == 0
    said = call(
        capsys, "mesh", "junction_bot", "--from", step, "--muscle", stl, "--unit", "mm", "--size", "2",
        "--out", tmp_path, "--landmark", "corner_short=-3.6,0.1,3.1", "--json",
    )  # fmt: skip
    found = json.loads(said.out)
    assert found["source"]["muscle"] == "m.stl"
    assert found["landmarks"]["corner_short"]["position_mm"] == pytest.approx([-3.6, 0.1, 3.1], abs=1e-6)
    assert found["regions"]["skeleton"]["relative_1"] == pytest.approx(0.0, abs=1e-6)
    checked = call(capsys, "mesh", "junction_bot", "--mesh", tmp_path / "junction_bot.msh", "--json")
    assert json.loads(checked.out)["elements_1"] == found["elements_1"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--from", "a.step"), ("DESIGN", "--from")),
        (("junction_bot", "--muscle", "a.step"), ("--muscle", "without --from")),
        (("junction_bot", "--unit", "mm"), ("--unit", "without --from")),
        (("junction_bot", "--align"), ("--align", "without --from")),
        (("junction_bot", "--landmark", "a=1,2,3"), ("--landmark", "without --from")),
        (("junction_bot", "--from", "a.step", "--mesh", "a.msh"), ("--mesh", "--from", "one of them")),
        (("junction_bot", "--from", "a.step", "--export", "b.step"), ("--from", "--export", "one of them")),
        (("junction_bot", "--from", "a.step", "--landmark", "a=1,2"), ("--landmark", "a=1,2", "NAME=X,Y,Z")),
        (("junction_bot", "--from", "a.step"), ("a.step", "No such file")),
        (("junction_bot", "--from", str(DRAWINGS / "skeleton_cm.stl")), ("skeleton_cm.stl", "--unit")),
        (("strip", "--export", "a.step"), ("a.step", "no skeleton")),
    ],
)
def test_wrong_orders_are_one_line(
    gmsh: None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    words: tuple[str, ...],
) -> None:
    """Catches: an option ignored where it means nothing, a file half written before the order was understood."""
    monkeypatch.chdir(tmp_path)
    said = call(capsys, "mesh", *arguments)
    assert said.code == 2
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert [word for word in words if word not in said.err] == []
    assert listing(tmp_path) == {}


def test_places_are_read_by_name() -> None:
    """Catches: a coordinate lost, a name given twice of which one is dropped."""
    assert landmark_places([" a = 1, -2.5 ,3e-1"]) == {"a": (1.0, -2.5, 0.3)}
    for wrong in (["a=1,2,x"], ["a"], ["=1,2,3"], ["a=1,2,3", "a=1,2,4"]):
        with pytest.raises(DesignError, match="--landmark"):
            landmark_places(wrong)
