"""The command line: what each command prints, where it writes, which options it takes, and its exit codes."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fem_biobot import cli, jobs, orders, telling
from fem_biobot.errors import BiobotError, DesignError, DiskError, SolveError
from tests.command import call, call_process, command, environment, listing, msh

# ---------------------------------------------------------------- presets, schema, version, help


def test_presets_are_listed_with_their_key_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    """Every preset has a line with what it is and what tells it from the others, in a pipe without control characters.

    Catches: a preset left out, numbers of one preset beside the name of another.
    """
    said = call(capsys, "presets")
    assert said.code == 0
    assert said.err == ""
    assert all(c.isprintable() or c == "\n" for c in said.out)
    (line,) = [line for line in said.out.splitlines() if line.startswith("junction_bot ")]
    # 14 mm of beam less two pillars of 3.5 mm; 2.2 mm x 0.4 mm of muscle
    assert "span 7 mm" in line
    assert "0.88 mm^2" in line
    assert (
        sum(line.startswith(name) for name in ("ring_bot", "strip", "cantilever") for line in said.out.splitlines())
        == 3
    )


def test_presets_as_json_carry_numbers_with_units_in_their_keys(capsys: pytest.CaptureFixture[str]) -> None:
    """Standard output is one JSON list.

    Catches: a table printed as well, the beam length taken for the span.
    """
    said = call(capsys, "presets", "--json")
    by_name = {preset["name"]: preset for preset in json.loads(said.out)}
    assert by_name["junction_bot"]["span_mm"] == pytest.approx(14.0 - 2 * 3.5, rel=1e-12)
    assert by_name["cantilever"]["kind"] == "cantilever"
    assert "moment_arm_mm" not in by_name["strip"]


def test_schema_is_json_and_knows_the_keys(capsys: pytest.CaptureFixture[str]) -> None:
    """The schema command prints what editors read.

    Catches: a Python dict printed instead of JSON.
    """
    schema = json.loads(call(capsys, "schema").out)
    assert "theta" in schema["properties"]["muscle"]["properties"]


def test_version_names_the_program_and_python(capsys: pytest.CaptureFixture[str]) -> None:
    """One line, exit code 0.

    Catches: a version option that goes on to complain about a missing command.
    """
    said = call(capsys, "--version")
    assert said.code == 0
    assert said.out.startswith("fem-biobot ")
    assert f"Python {sys.version_info[0]}." in said.out


@pytest.mark.parametrize("arguments", [(), ("--help",), ("run", "--help"), ("-h",)])
def test_help_goes_to_standard_output(capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]) -> None:
    """Help is a result, not an error; the program alone shows it too.

    Catches: help on standard error, exit code 2 without arguments.
    """
    said = call(capsys, *arguments)
    assert said.code == 0
    assert said.err == ""
    assert "Usage: fem-biobot" in said.out


def test_every_command_of_the_contract_says_what_it_takes(capsys: pytest.CaptureFixture[str]) -> None:
    """The options that scripts rely on.

    Catches: a renamed or dropped option.
    """
    for name, options in {
        "run": (
            "--out",
            "--size",
            "--mesh",
            "--rename",
            "--set",
            "--quiet",
            "--json",
            "--force",
            "--resume",
            "--debug",
        ),
        "solve": ("--out", "--size", "--mesh", "--set", "--quiet", "--json", "--force", "--resume", "--debug"),
        "mesh": ("--out", "--size", "--mesh", "--set", "--quiet", "--json", "--force", "--debug"),
        "presets": ("--json", "--debug"),
        "verify": ("--out", "--quiet", "--json", "--debug"),
        "doctor": ("--json", "--debug"),
    }.items():
        text = call(capsys, name, "--help").out
        assert [option for option in options if option not in text] == [], name


def test_the_command_starts_fast() -> None:
    """Help and presets import nothing heavy.

    Catches: numpy, numba, gmsh or matplotlib imported at the top of the command line.
    """
    code = (
        "import sys; from fem_biobot.cli import main; main(['--help']); main(['presets']);"
        "print([m for m in ('numpy', 'numba', 'scipy', 'gmsh', 'matplotlib', 'pyvista', 'pint') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


# ---------------------------------------------------------------- usage errors


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("rum",), ("rum", "run")),
        (("run",), ("DESIGN", "run --help")),
        (("run", "strip", "--siz", "1 mm"), ("--siz", "did you mean --size")),
        (("run", "strip", "--out"), ("--out",)),
        (("run", "strip", "more"), ("more",)),
        (("run", "strip", "--force", "--resume"), ("--resume", "--force")),
        (("run", "strip", "--rename", "gel=skeleton"), ("--rename", "--mesh")),
        (("run", "strip", "--mesh", "a.msh", "--size", "1 mm"), ("--size", "--mesh")),
        (("run", "strip", "--mesh", "a.msh", "--rename", "gel"), ("--rename", "NAME=REGION")),
        (("run", "strip", "--mesh", "a.msh", "--rename", "g=muscle", "--rename", "g=skeleton"), ("--rename", "g ")),
        (("run", "strip", "--size", "0 mm"), ("--size", "above 0 mm")),
        (("run", "strip", "--size", "-1"), ("--size", "above 0 mm")),
        (("run", "strip", "--size", "1 kPa"), ("--size", "a length")),
        (("run", "strip", "--size", "nan"), ("--size", "not finite")),
        (("run", "strip", "--size", "small"), ("--size", "a length")),
        (("run", "strip", "--set", "muscle.theta"), ("--set", "key=value")),
        (("run", "stripe"), ("stripe", "did you mean strip")),
        (("mesh",), ("DESIGN", "--mesh")),
        (("mesh", "--mesh", "a.msh", "--set", "muscle.gamma=1"), ("--set", "DESIGN")),
        (("mesh", "strip", "--out", "no\nline.msh/x", "--bad"), ("--bad",)),
        (("presets", "--quick"), ("--quick", "no such option")),
    ],
)
def test_wrong_usage_is_one_line_with_code_2(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    words: tuple[str, ...],
) -> None:
    """Every misuse names the option, in one line on standard error; nothing is written.

    Catches: typer's three-line usage box, an option that is ignored where it means nothing.
    """
    monkeypatch.chdir(tmp_path)
    said = call(capsys, *arguments)
    assert said.code == 2
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert [word for word in words if word not in said.err] == []
    assert listing(tmp_path) == {}


@pytest.mark.parametrize("text", ["0.8", " 0.8 ", "0.8mm", "0.8 mm", "8e-1", "800 um", ".8"])
def test_mesh_size_is_in_mm_unless_it_says_otherwise(text: str) -> None:
    """The one place where a bare number has a unit, which its help states.

    Catches: a bare number refused, read in m, or a unit ignored.
    """
    assert orders.mesh_size(text) == pytest.approx(0.8, rel=1e-15)


# ---------------------------------------------------------------- exit codes


@pytest.mark.parametrize(
    ("error", "code", "word"),
    [
        (DesignError("muscle.theta: found 200 deg"), 2, "muscle.theta"),
        (SolveError("no equilibrium"), 3, "no equilibrium"),
        (DiskError("x: No space left"), 3, "x:"),
        (MemoryError("PARDISO"), 3, "--size"),
        (MemoryError(), 3, "out of memory"),
        (OSError(errno.ENOSPC, "No space left on device"), 3, "No space left"),
        (PermissionError(errno.EACCES, "Permission denied", "/x/y"), 2, "/x/y"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (ZeroDivisionError("by zero"), 1, "internal error"),
        (KeyError("u"), 1, "run again with --debug"),
        (OSError(errno.EBADF, "Bad file descriptor"), 1, "internal error"),
        (ImportError("libz.so"), 1, "doctor"),
        (BiobotError("of no kind"), 1, "of no kind"),
        (DesignError("two\nlines\x1b[31m"), 2, "two; lines\\x1b"),
    ],
)
def test_each_outcome_has_its_exit_code_and_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: BaseException, code: int, word: str
) -> None:
    """What ends a job decides the code; the message is one printable line and no traceback.

    Catches: a code of another class, a traceback without --debug, control characters let through.
    """

    def fail(as_json: bool) -> int:
        raise error

    monkeypatch.setattr(jobs, "list_presets", fail)
    said = call(capsys, "presets")
    assert said.code == code
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert said.err.startswith("fem-biobot: ")
    assert word in said.err
    assert said.err.strip().isprintable()


def test_debug_shows_the_traceback_and_keeps_the_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With --debug the traceback comes before the line.

    Catches: --debug without effect, or one that turns every code into 1.
    """

    def fail(as_json: bool) -> int:
        raise SolveError("no equilibrium")

    monkeypatch.setattr(jobs, "list_presets", fail)
    said = call(capsys, "presets", "--debug")
    assert said.code == 3
    assert "Traceback" in said.err
    assert said.complaint == "fem-biobot: no equilibrium"


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs the signals of POSIX")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP", "SIGINT"])
def test_signals_end_a_job_like_an_interrupt(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """A job that is told to end raises through its own clean-up; afterwards the handlers are as they were.

    Catches: SIGTERM that kills the process half-way through a file, a handler left behind.
    """
    number = getattr(signal, name)
    # whoever started the tests may have told them to ignore it (nohup, a job in the background)
    inherited = signal.getsignal(number)
    before = signal.default_int_handler if name == "SIGINT" else signal.SIG_DFL
    signal.signal(number, before)
    cleaned: list[str] = []

    def wait(as_json: bool) -> int:
        try:
            os.kill(os.getpid(), number)
            time.sleep(5.0)
        finally:
            cleaned.append("yes")
        return 0

    monkeypatch.setattr(jobs, "list_presets", wait)
    said = call(capsys, "presets")
    assert said.code == 130
    assert said.err == "fem-biobot: interrupted\n"
    after = signal.getsignal(number)
    signal.signal(number, inherited)
    assert cleaned == ["yes"]
    assert after is before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_standard_output_on_a_full_disk_is_a_failure() -> None:
    """A result that could not be printed is not called a success.

    Catches: output lost with exit code 0, or a traceback from the interpreter's last flush.
    """
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            command("presets"), stdout=full, stderr=subprocess.PIPE, text=True, env=environment(), check=False
        )
    assert done.returncode == 3
    assert done.stderr.splitlines()[0].startswith("fem-biobot: ")
    assert "Traceback" not in done.stderr


def test_a_reader_that_goes_away_is_no_error() -> None:
    """``presets | head -1`` ends quietly.

    Catches: BrokenPipeError shown as an internal error.
    """
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        command("schema"), stdout=write, stderr=subprocess.PIPE, text=True, env=environment(), check=False
    )
    os.close(write)
    assert (done.returncode, done.stderr) == (0, "")


# ---------------------------------------------------------------- mesh


def test_mesh_writes_a_file_and_says_what_is_in_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Counts, volume against the design, quality and surfaces; the file reads back by the same command.

    Catches: the volume of the design printed twice instead of the mesh's, a file elsewhere than said.
    """
    said = call(capsys, "mesh", "strip", "--size", "0.8", "--out", tmp_path / "new", "--json")
    assert said.code == 0
    found = json.loads(said.out)
    assert found["file"] == str(tmp_path / "new" / "strip.msh")
    muscle = found["regions"]["muscle"]
    # 7 x 2.2 x 0.4 mm
    assert muscle["volume_mm3"] == pytest.approx(6.16, rel=1e-9)
    assert muscle["design_volume_mm3"] == pytest.approx(6.16, rel=1e-12)
    assert muscle["elements_1"] == found["elements_1"]
    assert 0.0 < found["quality"]["worst_radius_ratio_1"] <= found["quality"]["mean_radius_ratio_1"] <= 1.0
    again = json.loads(call(capsys, "mesh", "--mesh", found["file"], "--json").out)
    assert again["regions"]["muscle"]["elements_1"] == muscle["elements_1"]
    assert set(again["surfaces"]) == {"end_minus", "end_plus", "junction_mid"}
    assert "design_volume_mm3" not in again["regions"]["muscle"]
    text = call(capsys, "mesh", "strip", "--mesh", found["file"])
    assert text.code == 0
    for word in ("tetrahedra", "muscle", "end_plus", "radius ratio", "6.16", "nothing was written"):
        assert word in text.out
    assert list(listing(tmp_path)) == ["new", "new/strip.msh"]


def test_mesh_does_not_write_over_another_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The same mesh again is fine, another one is refused until forced.

    Catches: a mesh silently replaced, or the same one refused.
    """
    file = tmp_path / "strip.msh"
    made = ("mesh", "strip", "--size", "1.5", "--out", tmp_path, "--quiet")
    assert call(capsys, *made).out == f"{file}\n"
    first = file.read_bytes()
    assert call(capsys, *made).code == 0
    file.write_text("something else")
    said = call(capsys, *made)
    assert said.code == 2
    assert str(file) in said.err
    assert file.read_text() == "something else"
    assert call(capsys, *made, "--force").code == 0
    assert file.read_bytes() == first


def test_a_strangers_volumes_can_be_renamed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A mesh with its own names is taken once they are mapped, and refused with advice before.

    Catches: the mapping reversed, or not handed on.
    """
    file = msh(tmp_path / "theirs.msh", {"gel": [0, 1, 2, 3], "tissue": [4]})
    refused = call(capsys, "mesh", "--mesh", file)
    assert refused.code == 2
    assert "gel" in refused.err
    said = call(capsys, "mesh", "--mesh", file, "--rename", "gel=skeleton", "--rename", "tissue=muscle", "--json")
    assert said.code == 0
    regions = json.loads(said.out)["regions"]
    assert {name: region["elements_1"] for name, region in regions.items()} == {"skeleton": 4, "muscle": 1}


# ---------------------------------------------------------------- solve and run


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the cantilever was solved into `runs/cantilever`, by the command with its defaults."""
    folder = tmp_path_factory.mktemp("solved")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert cli.main(["solve", "cantilever", "--size", "1.4 mm", "--quiet"]) == 0
    return folder


def test_solve_writes_where_the_contract_says(solved: Path) -> None:
    """The default folder is runs/<design>, with the files of a solve and without those of a run.

    Catches: another default folder, pictures drawn by solve.
    """
    names = {path.name for path in (solved / "runs" / "cantilever").iterdir()}
    assert {"summary.json", "design.toml", "solid.pvd", "tables"} <= names
    assert "report.html" not in names
    assert [name for name in names if name.startswith(".")] == []


def test_json_is_the_summary_alone(
    solved: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Standard output holds exactly what summary.json holds; a result that is there is said on standard error.

    Catches: a table or a note on standard output, a result computed anew.
    """
    monkeypatch.chdir(solved)
    before = listing(solved)
    said = call(capsys, "solve", "cantilever", "--size", "1.4", "--json")
    assert said.code == 0
    assert json.loads(said.out) == json.loads((solved / "runs/cantilever/summary.json").read_text())
    assert "--force" in said.err
    assert listing(solved) == before


def test_quiet_prints_the_path_alone(
    solved: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing on standard error, one path on standard output.

    Catches: notes or progress with --quiet.
    """
    monkeypatch.chdir(solved)
    said = call(capsys, "solve", "cantilever", "--size", "1.4", "--quiet")
    assert (said.code, said.out, said.err) == (0, "runs/cantilever\n", "")


def test_the_final_tables_hold_the_numbers_of_the_summary(
    solved: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is printed at the end is read from the summary, and says where to look.

    Catches: ours and the closed form exchanged, files named that are not there.
    """
    monkeypatch.chdir(solved)
    said = call(capsys, "solve", "cantilever", "--size", "1.4")
    rows = json.loads((solved / "runs/cantilever/summary.json").read_text())["solid"]["comparison"]
    (line,) = [line for line in said.out.splitlines() if line.strip().startswith(rows[-1]["quantity"])]
    numbers = [float(word) for word in line.split() if word.replace(".", "").replace("-", "").isdigit()]
    assert numbers[-4:-2] == pytest.approx([rows[-1]["ours"], rows[-1]["paper"]], rel=5e-4)
    assert "closed form" in said.out
    assert "ParaView" in said.out
    assert "report.html" not in said.out


def test_options_reach_the_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every option of `run` arrives at the main job under its meaning.

    Catches: --force and --resume exchanged, `solve` doing a whole run, a mapping lost on the way.
    """
    from fem_biobot.study import run as study

    seen: dict[str, object] = {}

    def fake(design: object, out: Path, **options: object) -> dict[str, object]:
        seen.update(options, out=out, theta=design.value("muscle.theta"))  # type: ignore[attr-defined]
        raise SolveError("enough")

    monkeypatch.setattr(study, "run", fake)
    file = tmp_path / "a.msh"
    out = tmp_path / "out"
    call(capsys, "run", "strip", "--out", out, "--mesh", file, "--rename", "gel=muscle", "--force",
         "--set", "muscle.theta=60 deg", "--set", "muscle.gamma=0.5")  # fmt: skip
    assert {k: seen[k] for k in ("out", "mesh_file", "names", "size", "force", "resume", "complete")} == {
        "out": out, "mesh_file": file, "names": {"gel": "muscle"}, "size": None,
        "force": True, "resume": False, "complete": True,
    }  # fmt: skip
    assert seen["theta"] == pytest.approx(1.0471975511965976)
    call(capsys, "solve", "strip", "--out", out, "--size", "0.9 mm", "--resume")
    assert (seen["size"], seen["force"], seen["resume"], seen["complete"]) == (0.9, False, True, False)
    assert not out.exists()


def test_json_stays_alone_whatever_the_work_prints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a library prints on the way goes to standard error.

    Catches: a chatty library that spoils the JSON of a script.
    """
    from fem_biobot.study import run as study

    def chatty(*_: object, **__: object) -> dict[str, object]:
        print("hello from a library")  # noqa: T201
        return {"notes": ["a note"], "speed_mm_per_s": 1.5}

    monkeypatch.setattr(study, "run", chatty)
    said = call(capsys, "run", "strip", "--out", tmp_path / "out", "--json")
    assert json.loads(said.out) == {"notes": ["a note"], "speed_mm_per_s": 1.5}
    assert said.err.splitlines() == ["hello from a library", "note: a note"]


def test_names_of_designs_do_not_lead_out_of_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A design named like a path gets a harmless folder.

    Catches: a result written to ../../somewhere because a design file says so.
    """
    from fem_biobot.config import load_design

    monkeypatch.chdir(tmp_path)
    for name, folder in (("../../x y", "x_y"), ("..", "unnamed"), ("bot-2.1", "bot-2.1")):
        design = load_design("strip").with_values({"name": name})
        assert telling.result_folder(design, None) == Path("runs") / folder


def test_the_module_is_the_command() -> None:
    """``python -m fem_biobot`` hands on the exit code.

    Catches: a module that ends with 0 whatever happened.
    """
    assert call_process("run", "nothing_like_it").code == 2
