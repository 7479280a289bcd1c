"""Bad input at the command line: exit code 2, one line that names the key or the file, nothing written."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fem_biobot.mesh.committed import mesh_folder
from tests.command import call, listing, msh


@pytest.mark.parametrize(
    ("design", "setting", "words"),
    [
        ("junction_bot", "muscle.thickness=1 mm", ("muscle.thickness", "unknown")),
        ("junction_bot", "muscle.junction_widht=1 mm", ("muscle.junction_widht", "muscle.junction_width?")),
        ("junction_bot", "skeleton.beam_length=14", ("skeleton.beam_length", "no unit", "14 mm")),
        ("junction_bot", "skeleton.beam_length=14 kPa", ("skeleton.beam_length", "not a length")),
        ("junction_bot", "muscle.theta=200 deg", ("muscle.theta", "200 deg", "180 deg")),
        ("junction_bot", "muscle.gamma=1.2", ("muscle.gamma", "1.2", "between 0 and 1")),
        ("junction_bot", "muscle.junction_height=2.95 mm", ("muscle.junction_height", "beam")),
        ("junction_bot", "skeleton.material.poisson=0.5", ("skeleton.material.poisson", "0.5", "P2-P1")),
        ("junction_bot", "skeleton.pillar_length=7.5 mm", ("skeleton.pillar_length", "overlap")),
        ("junction_bot", "muscle.junction_width=9 mm", ("muscle.junction_width", "9 mm")),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
@pytest.mark.parametrize("command", ["run", "mesh"])
def test_a_wrong_design_is_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
    design: str,
    setting: str,
    words: tuple[str, ...],
) -> None:
    """Key, what was found and what was expected in one line, before anything is meshed, solved or written.

    Catches: a check that the command line goes around, a folder made before the design was read.
    """
    monkeypatch.chdir(tmp_path)
    said = call(capsys, command, design, "--set", setting)
    assert said.code == 2
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert [word for word in words if word not in said.err] == []
    assert listing(tmp_path) == {}


def test_a_wrong_design_file_is_refused_with_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file that is no TOML names the file and the line.

    Catches: a parser's own message without the file.
    """
    file = tmp_path / "mine.toml"
    file.write_text('base = "strip"\n[muscle\n')
    said = call(capsys, "run", file, "--out", tmp_path / "out")
    assert said.code == 2
    assert said.err.startswith(f"fem-biobot: {file}, line 2")
    assert list(listing(tmp_path)) == ["mine.toml"]


def bad_mesh(kind: str, folder: Path) -> Path:
    """A mesh file with one thing wrong."""
    file = folder / f"{kind}.msh"
    committed = mesh_folder()
    assert committed is not None
    whole = (committed / "junction_bot_small.msh").read_bytes()
    if kind == "missing_region":
        return msh(file, {"skeleton": [0, 1, 2, 3, 4]})
    if kind == "unknown_region":
        return msh(file, {"skeleton": [0, 1, 2, 3], "tendon": [4]})
    if kind == "empty_region":
        return msh(file, {"skeleton": [0, 1, 2, 3, 4]}, empty=["muscle"])
    if kind == "inverted_element":
        return msh(file, {"skeleton": [0, 1, 2, 3], "muscle": [4]}, flipped=[4])
    if kind == "triangles_only":
        return msh(file, {"skeleton": [0, 1, 2, 3], "muscle": [4]}, triangles=True)
    if kind == "other_machine":
        return msh(file, {"skeleton": [0, 1, 2, 3], "muscle": [4]})
    if kind == "truncated":
        file.write_bytes(whole[: len(whole) // 2])
    elif kind == "empty_file":
        file.write_bytes(b"")
    elif kind == "not_a_mesh":
        file.write_text("solid cube\nendsolid cube\n")
    return file


@pytest.mark.parametrize(
    ("kind", "word"),
    [
        ("missing_region", "muscle"),
        ("unknown_region", "tendon"),
        ("empty_region", "muscle is empty"),
        ("inverted_element", "inverted"),
        ("truncated", "truncated"),
        ("triangles_only", "triangles only"),
        ("other_machine", "volume"),
        ("empty_file", "MeshFormat"),
        ("not_a_mesh", "MeshFormat"),
        ("absent", "No such file"),
    ],
)
@pytest.mark.parametrize("command", ["run", "mesh"])
def test_a_wrong_mesh_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, kind: str, word: str
) -> None:
    """The file and its defect in one line; no folder is made for a result.

    Catches: a mesh taken as it is, the folder made and marked before the mesh was read.
    """
    file = bad_mesh(kind, tmp_path)
    before = listing(tmp_path)
    said = call(capsys, command, "junction_bot", "--mesh", file, "--out", tmp_path / "out")
    assert said.code == 2
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert str(file) in said.err
    assert word in said.err
    assert listing(tmp_path) == before


# ---------------------------------------------------------------- folders


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder that holds the result of a cantilever."""
    from fem_biobot.cli import main

    folder = tmp_path_factory.mktemp("taken") / "result"
    assert main(["solve", "cantilever", "--size", "1.4", "--out", str(folder), "--quiet"]) == 0
    return folder


@pytest.mark.parametrize(
    "arguments",
    [
        ("cantilever", "--size", "1.4", "--set", "load.tip_force=0.02 mN"),
        ("strip", "--size", "0.8"),
        ("strip", "--size", "0.8", "--resume"),
    ],
)
@pytest.mark.parametrize("command", ["solve", "run"])
def test_a_folder_with_another_designs_result_is_left_alone(
    taken: Path, capsys: pytest.CaptureFixture[str], command: str, arguments: tuple[str, ...]
) -> None:
    """The folder is named and not touched.

    Catches: one result written over another, also one that differs in a single value.
    """
    before = listing(taken)
    said = call(capsys, command, *arguments, "--out", taken)
    assert said.code == 2
    assert len(said.err.splitlines()) == 1
    assert str(taken) in said.err
    assert "another design" in said.err
    assert listing(taken) == before


@pytest.mark.parametrize("extra", [(), ("--force",), ("--resume",)])
def test_a_folder_with_other_files_is_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], extra: tuple[str, ...]
) -> None:
    """Files that are no result stay, even with --force.

    Catches: a result among somebody's photographs, or a forced run that clears them.
    """
    (tmp_path / "photo.txt").write_text("mine")
    said = call(capsys, "solve", "strip", "--size", "0.8", "--out", tmp_path, *extra)
    assert said.code == 2
    assert len(said.err.splitlines()) == 1
    assert str(tmp_path) in said.err
    assert listing(tmp_path) == {"photo.txt": b"mine"}


def test_there_must_be_something_to_resume(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """--resume without an unfinished result is refused.

    Catches: --resume that quietly begins.
    """
    said = call(capsys, "solve", "strip", "--size", "0.8", "--out", tmp_path / "new", "--resume")
    assert said.code == 2
    assert "resume" in said.err
    assert listing(tmp_path) == {}


@pytest.mark.parametrize("place", ["file", "file/below", "file/far/below"])
@pytest.mark.parametrize("command", ["solve", "mesh"])
def test_a_folder_that_cannot_be_made_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, place: str
) -> None:
    """A path through a regular file is refused in one line that names it, before the work.

    Catches: a run of a minute that ends with a traceback because its folder cannot be made.
    """
    (tmp_path / "file").write_text("mine")
    out = tmp_path / place
    said = call(capsys, command, "strip", "--size", "0.8", "--out", out)
    assert said.code == 2
    assert len(said.err.splitlines()) == 1
    assert str(tmp_path / "file") in said.err
    assert "expected a folder" in said.err
    assert listing(tmp_path) == {"file": b"mine"}


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="permissions do not bind the superuser")
def test_a_folder_without_permission_is_refused_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder of somebody else is refused in one line.

    Catches: permission found out after the solve.
    """
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    said = call(capsys, "solve", "strip", "--size", "0.8", "--out", locked / "new")
    assert said.code == 2
    assert len(said.err.splitlines()) == 1
    assert str(locked) in said.err


def test_permission_is_asked_of_the_system(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same refusal where the system says no, whoever runs the test.

    Catches: the refusal dropped, unseen because the superuser may write everywhere.
    """
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    said = call(capsys, "solve", "strip", "--size", "0.8", "--out", tmp_path / "new")
    assert said.code == 2
    assert "no permission" in said.err
    assert listing(tmp_path) == {}
