"""The doctor: every part tried, what is missing named, one command for all of it, and its exit code."""

from __future__ import annotations

import builtins
import importlib
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from fem_biobot import doctor
from fem_biobot.doctor import Part, commands, examine, verdict, works
from fem_biobot.mesh import geometry
from fem_biobot.solid import linear
from fem_biobot.view import pictures
from tests.command import call

WHOLE = Part("numpy", "ok", "2.0")


def by_name(parts: list[Part]) -> dict[str, Part]:
    return {part.name: part for part in parts}


@pytest.fixture
def no_rendering(monkeypatch: pytest.MonkeyPatch) -> None:
    """The renderer is taken as working, since starting it takes seconds."""
    monkeypatch.setattr(pictures, "renderer_status", lambda: ("pyvista", ""))


@pytest.mark.usefixtures("no_rendering")
def test_every_part_is_examined_once(capsys: pytest.CaptureFixture[str]) -> None:
    """The parts that a user asks about, in a table and as JSON alike.

    Catches: a part left out of the list, JSON with something else on standard output.
    """
    said = call(capsys, "doctor", "--json")
    found = json.loads(said.out)
    names = [part["name"] for part in found["parts"]]
    expected = {"Python", "numpy", "scipy", "scikit-fem", "numba", "linear solver", "Gmsh", "renderer"}
    assert expected | {"presets", "threads", "memory", "disk"} <= set(names)
    assert len(names) == len(set(names))
    assert found["works"] is True
    assert said.code == 0
    text = call(capsys, "doctor").out
    assert all(any(line.startswith(name) for line in text.splitlines()) for name in names)


@pytest.mark.usefixtures("no_rendering")
def test_a_needed_part_that_is_missing_makes_the_doctor_fail(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a module that every run needs the exit code is 1, and pip's command is told.

    Catches: exit code 0 whatever is missing, a missing module taken for a broken one.
    """
    load = importlib.import_module

    def without_scipy(name: str, package: str | None = None) -> ModuleType:
        if name == "scipy":
            raise ModuleNotFoundError("No module named 'scipy'", name="scipy")
        return load(name, package)

    monkeypatch.setattr(importlib, "import_module", without_scipy)
    said = call(capsys, "doctor")
    assert said.code == 1
    assert "Runs will fail: scipy missing." in said.out
    assert "-m pip install scipy" in said.out


def test_commands_are_one_for_each_kind() -> None:
    """All system packages in one line without repeats, all Python packages in another.

    Catches: one apt-get line for each part, packages repeated.
    """
    parts = [
        WHOLE,
        Part("a", "instead", "", system=("libgl1", "libxft2")),
        Part("b", "instead", "", system=("libgl1", "libosmesa6"), python=("gmsh",)),
        Part("c", "missing", "", python=("pint",), command="export X=1"),
    ]
    apt, pip, other = commands(parts)
    assert apt == "apt-get install -y libgl1 libxft2 libosmesa6"
    assert pip.endswith(" -m pip install gmsh pint")
    assert other == "export X=1"
    assert commands([WHOLE]) == []


@pytest.mark.parametrize(
    ("statuses", "runs", "text"),
    [
        (("ok", "ok"), True, "Everything is there."),
        (("ok", "low"), True, "Everything is there."),
        (("ok", "instead"), True, "in place of: p1"),
        (("missing", "instead"), False, "p0 missing"),
    ],
)
def test_the_verdict_follows_from_the_parts(statuses: tuple[doctor.Status, ...], runs: bool, text: str) -> None:
    """Only what is missing stops runs.

    Catches: a replaced part called a failure, a missing one called replaced.
    """
    parts = [Part(f"p{k}", status, "") for k, status in enumerate(statuses)]
    assert works(parts) is runs
    assert text in verdict(parts)[0]


@pytest.mark.usefixtures("no_rendering")
def test_gmsh_without_its_package_asks_pip_and_without_a_library_asks_apt(monkeypatch: pytest.MonkeyPatch) -> None:
    """The command fits what is missing; the mesh comes from the committed ones either way.

    Catches: apt-get told where pip is needed.
    """

    def missing(library: str) -> Callable[[], None]:
        def fail() -> None:
            raise geometry.GmshMissing(library)

        return fail

    monkeypatch.setattr(geometry, "import_gmsh", missing("gmsh"))
    part = by_name(examine())["Gmsh"]
    assert (part.status, part.python, part.system) == ("instead", ("gmsh",), ())
    monkeypatch.setattr(geometry, "import_gmsh", missing("libXft.so.2"))
    part = by_name(examine())["Gmsh"]
    assert (part.status, part.python) == ("instead", ())
    assert "libxft2" in part.system
    assert "libXft.so.2" in part.found


@pytest.mark.parametrize(
    ("note", "system", "python"),
    [
        (
            "pictures drawn by matplotlib: off-screen rendering failed (ImportError: libXrender.so.1: cannot open); "
            "`apt-get install -y libosmesa6` (or libegl1) brings full pictures",
            {"libxrender1", "libosmesa6"},
            (),
        ),
        (
            "pictures drawn by matplotlib: off-screen rendering failed (No module named 'pyvista'); "
            "`pip install pyvista` brings full pictures",
            set(),
            ("pyvista",),
        ),
        ("FEM_BIOBOT_RENDERER = matplotlib: pictures drawn by the built-in renderer", set(), ()),
    ],
)
def test_the_renderer_asks_for_what_it_lacks(
    monkeypatch: pytest.MonkeyPatch, note: str, system: set[str], python: tuple[str, ...]
) -> None:
    """Libraries by their packages; nothing where the built-in renderer was chosen.

    Catches: a command for somebody who needs none, the library of the message lost, the remedy told twice.
    """
    monkeypatch.setattr(pictures, "renderer_status", lambda: ("matplotlib", note))
    part = by_name(examine())["renderer"]
    assert part.status == "instead"
    assert set(part.system) == system
    assert part.python == python
    assert "install" not in part.found


@pytest.mark.usefixtures("no_rendering")
def test_the_linear_solver_that_will_be_used_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """PARDISO or SuperLU with the reason; a choice of the user's is no lack.

    Catches: PARDISO reported where SuperLU factors.
    """
    monkeypatch.setattr(linear, "pardiso_missing", lambda: "no mkl_rt here")
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    part = by_name(examine())["linear solver"]
    assert part.status == "instead"
    assert "SuperLU" in part.found
    assert "no mkl_rt here" in part.found
    assert part.python == ("pypardiso",)
    monkeypatch.setattr(linear, "pardiso_missing", lambda: "FEM_BIOBOT_FACTORISATION asks for SuperLU")
    assert by_name(examine())["linear solver"].python == ()
    monkeypatch.setattr(linear, "pardiso_missing", lambda: None)
    assert "PARDISO" in by_name(examine())["linear solver"].found


@pytest.mark.usefixtures("no_rendering")
def test_numba_without_a_place_for_its_cache_is_broken(monkeypatch: pytest.MonkeyPatch) -> None:
    """numba refuses to start then; the doctor says where to let it write.

    Catches: a doctor that dies of what it should report.
    """
    load = builtins.__import__

    def refuse(name: str, *rest: object) -> ModuleType:
        if name == "fem_biobot.solid" and "kernels" in (rest[2] or ()):  # type: ignore[operator]
            raise RuntimeError("cannot cache function 'f': no locator available for file 'kernels.py'")
        return load(name, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", refuse)
    part = by_name(examine())["numba"]
    assert part.status == "missing"
    assert "no locator" in part.found
    assert part.command.startswith("export NUMBA_CACHE_DIR=")


@pytest.mark.usefixtures("no_rendering")
def test_little_memory_and_a_full_disk_are_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Scarce is not missing: the advice is to make the run smaller, or to write elsewhere.

    Catches: thresholds in the wrong unit, a folder that cannot be written called fine.
    """
    monkeypatch.setattr(doctor, "_available_memory", lambda: 0.9e9)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=10**8))
    parts = by_name(examine(tmp_path))
    assert (parts["memory"].status, parts["disk"].status) == ("low", "low")
    assert "0.9 GB" in parts["memory"].found
    assert works(list(parts.values()))
    monkeypatch.setattr(doctor, "_available_memory", lambda: 3.0e9)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: SimpleNamespace(free=10**9))
    parts = by_name(examine(tmp_path))
    assert (parts["memory"].status, parts["disk"].status) == ("ok", "ok")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert by_name(examine(tmp_path))["disk"].status == "low"


@pytest.mark.usefixtures("no_rendering")
def test_an_examination_that_fails_is_a_result(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a check raises is shown as that part's state; the other parts are examined all the same.

    Catches: one broken part that hides all others behind a traceback.
    """

    def fail() -> str | None:
        raise ZeroDivisionError("odd\nlines")

    monkeypatch.setattr(linear, "pardiso_missing", fail)
    parts = by_name(examine())
    assert parts["linear solver"].status == "missing"
    assert parts["linear solver"].found == "cannot be examined: ZeroDivisionError: odd"
    assert parts["disk"].status in ("ok", "low")
