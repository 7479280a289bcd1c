"""Runs that end early: no equilibrium, a full disk, an interrupt. Files are whole, the code says what it was."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import time
from pathlib import Path

import meshio
import pytest

from fem_biobot.study.plan import Found, Solver, Wanted
from tests.command import call, command, environment

# coarse: about nine thousand unknowns, a third of a second a state
COARSE = ("junction_bot", "--size", "4 mm")


def assert_whole(folder: Path) -> None:
    """Every file below a folder can be read, and none is a leftover."""
    for file in folder.rglob("*"):
        if file.is_dir() or ".unfinished" in file.parts:
            continue
        assert not file.name.startswith("."), f"{file} was left behind"
        if file.suffix == ".vtu":
            assert len(meshio.read(file).points) > 0
        elif file.suffix == ".json":
            json.loads(file.read_text())
        else:
            assert file.stat().st_size > 0


def test_tension_without_equilibrium_ends_with_code_3_and_readable_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """1e4 kPa cannot converge: what was reached, why and what to try are said, and everything up to there is on disk.

    Catches: a failed solve called a success or a defect, states lost, a summary that calls itself complete.
    """
    out = tmp_path / "hot"
    said = call(capsys, "solve", *COARSE, "--set", "muscle.active_tension=10000 kPa", "--out", out)
    assert said.code == 3
    assert said.out == ""
    assert "Traceback" not in said.err
    assert said.complaint.startswith("fem-biobot: no equilibrium")
    assert "reached" in said.complaint
    assert "try" in said.complaint
    assert str(out) in said.complaint
    summary = json.loads((out / "summary.json").read_text())
    assert summary["complete"] is False
    # the passive path is as ever, only full drive is out of reach
    assert [s["key"] for s in summary["solid"]["states"]][-1] == "passive"
    assert "no equilibrium" in summary["failure"]
    assert len(list(out.glob("*.vtu"))) == len(summary["solid"]["states"])
    assert_whole(out)


def test_a_failed_result_is_not_taken_for_a_whole_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same command fails again in the same way; it does not return what the failure left.

    Catches: exit code 0 the second time.
    """
    hot = ("solve", "ring_bot", "--size", "1.5", "--set", "muscle.passive_tension=1e4 kPa", "--out", tmp_path / "hot")
    assert call(capsys, *hot, "--quiet").code == 3
    said = call(capsys, *hot, "--quiet")
    assert said.code == 3
    assert len(said.err.splitlines()) == 1


@pytest.mark.parametrize("after", [0, 3, 9])
def test_a_full_disk_ends_with_code_3_and_whole_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], after: int
) -> None:
    """The disk fills up at some file: one line names it, what was written before is whole, nothing half is left.

    Catches: a half file under its final name, a temporary file left behind, an internal error.
    """
    written = 0
    sync = os.fsync

    def fsync(handle: int) -> None:
        nonlocal written
        written += 1
        if written > after:
            raise OSError(errno.ENOSPC, "No space left on device")
        sync(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    out = tmp_path / "out"
    said = call(capsys, "solve", "cantilever", "--size", "1.4", "--out", out)
    assert said.code == 3
    assert "No space left on device" in said.complaint
    assert str(out) in said.complaint
    assert "Traceback" not in said.err
    assert_whole(out)
    # with space again the same command goes on
    monkeypatch.setattr(os, "fsync", sync)
    assert call(capsys, "solve", "cantilever", "--size", "1.4", "--out", out).code == 0


def test_an_interrupt_leaves_whole_files_and_the_same_command_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C between states: code 130, one line, readable files; the next run solves the remaining states only.

    Catches: an interrupt that kills half-way through a file, one called an error, a run that begins anew.
    """
    out = tmp_path / "out"
    process = subprocess.Popen(
        command("solve", *COARSE, "--out", out), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env=environment(), preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    deadline = time.monotonic() + 240.0
    while len(list(out.glob("solid_*.vtu"))) < 2 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    printed, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert printed == ""
    assert "Traceback" not in err
    assert (
        err.splitlines()[-1] == f"fem-biobot: interrupted: {out}: files are whole, the same command goes on from there"
    )
    assert_whole(out)
    kept = sorted(file.stem for file in (out / ".unfinished").glob("*.npz"))
    assert len(kept) >= 2

    solved: list[str] = []
    solve = Solver.solve

    def counted(self: Solver, wanted: Wanted) -> Found:
        solved.append(wanted.key)
        return solve(self, wanted)

    monkeypatch.setattr(Solver, "solve", counted)
    said = call(capsys, "solve", *COARSE, "--out", out, "--resume", "--json")
    assert said.code == 0
    summary = json.loads(said.out)
    assert summary["complete"] is True
    keys = [state["key"] for state in summary["solid"]["states"]]
    assert sorted(solved) == sorted(set(keys) - set(kept))
    assert keys[-1] == "remodelled_peak"
    assert_whole(out)
    assert not (out / ".unfinished").exists()
