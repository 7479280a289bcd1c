"""A machine without Gmsh's libraries and without a renderer: runs go on with committed meshes and built-in pictures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.command import ROOT, call_process, environment

BROKEN_GMSH = 'raise OSError("libGLU.so.1: cannot open shared object file: No such file or directory")\n'
CRASHING_PYVISTA = "import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n"


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment in which importing gmsh fails for a library and importing pyvista kills the interpreter."""
    folder = tmp_path_factory.mktemp("bare")
    (folder / "gmsh.py").write_text(BROKEN_GMSH)
    (folder / "pyvista.py").write_text(CRASHING_PYVISTA)
    return environment(PYTHONPATH=f"{folder}:{ROOT}", FEM_BIOBOT_RENDERER="auto")


def test_run_goes_on_and_says_what_it_used_instead(bare: dict[str, str], tmp_path: Path) -> None:
    """A preset runs to its end on the committed mesh with pictures; output and summary name library and command.

    Catches: the crash of the renderer taking the run with it, a fall-back that is not told, a note without a remedy.
    """
    out = tmp_path / "out"
    said = call_process("run", "strip", "--size", "0.8", "--out", out, env=bare)
    assert said.code == 0, said.err
    summary = json.loads((out / "summary.json").read_text())
    for text in (said.err, " ".join(summary["notes"])):
        assert "libGLU" in text
        assert "apt-get install -y" in text
        assert "strip_small.msh" in text
        assert "SIGSEGV" in text
        assert "libosmesa6" in text
    assert "Traceback" not in said.err
    assert summary["complete"] is True
    pictures = sorted((out / "figures").glob("*.png"))
    assert len(pictures) >= 3
    assert all(file.read_bytes().startswith(b"\x89PNG") for file in pictures)
    assert (out / "report.html").exists()


def test_mesh_of_another_geometry_is_refused_with_the_command(bare: dict[str, str], tmp_path: Path) -> None:
    """Without Gmsh there is no mesh of a changed design: one line, the library and the one command.

    Catches: the committed mesh of another geometry used in its place.
    """
    said = call_process("run", "strip", "--set", "muscle.junction_length=8 mm", "--out", tmp_path / "out", env=bare)
    assert said.code == 2
    assert len(said.err.splitlines()) == 1
    assert "libGLU" in said.err
    assert "apt-get install -y" in said.err
    assert not (tmp_path / "out").exists()


def test_mesh_command_falls_back_on_the_committed_mesh(bare: dict[str, str], tmp_path: Path) -> None:
    """The mesh command writes the committed mesh and says so.

    Catches: the note lost, or an exit code that calls it a failure.
    """
    said = call_process("mesh", "cantilever", "--out", tmp_path, "--json", env=bare)
    assert said.code == 0
    (note,) = json.loads(said.out)["notes"]
    assert "cantilever_medium.msh" in note
    assert note in said.err
    assert (tmp_path / "cantilever.msh").exists()


def test_doctor_names_what_is_missing_and_one_command_for_all_of_it(bare: dict[str, str]) -> None:
    """Both parts are replaced, one apt-get line brings all libraries, and the program is called working.

    Catches: two commands, a library left out, exit code 1 although presets run.
    """
    said = call_process("doctor", env=bare)
    assert said.code == 0, said.err
    lines = said.out.splitlines()
    (gmsh,) = [line for line in lines if line.startswith("Gmsh")]
    (renderer,) = [line for line in lines if line.startswith("renderer")]
    assert "instead" in gmsh
    assert "libGLU.so.1" in gmsh
    assert "instead" in renderer
    assert "SIGSEGV" in renderer
    (command,) = [line for line in lines if line.strip().startswith("apt-get")]
    assert {"libglu1-mesa", "libgl1", "libxcursor1", "libxft2", "libxinerama1", "libgomp1", "libosmesa6"} <= set(
        command.split()
    )
    found = json.loads(call_process("doctor", "--json", env=bare).out)
    assert found["works"] is True
    assert found["commands"] == [command.strip()]
