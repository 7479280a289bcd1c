"""The command line: reads arguments, calls the package, turns outcomes into text and exit codes.

Nothing imports this module. Arguments are parsed first and give a job; the job runs afterwards, so that typer's ways
with exceptions and interrupts never meet the work. Heavy parts are imported when a job needs them.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from fem_biobot import comparing_jobs, jobs, mesh_jobs
from fem_biobot.errors import BiobotError
from fem_biobot.files import file_error
from fem_biobot.muscle_commands import muscle
from fem_biobot.options import (
    AsJson,
    Debug,
    Job,
    MeshFile,
    NoWalk,
    OptionError,
    Quiet,
    Rename,
    Sets,
    Size,
    check_mesh,
    ordering,
    plainly,
)
from fem_biobot.orders import Order, VerifyOrder, WalkOrder
from fem_biobot.study_commands import study

PROGRAM = "fem-biobot"
INTERNAL, INPUT, FAILED, INTERRUPTED = 1, 2, 3, 130


app = typer.Typer(
    name=PROGRAM,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Finite-element model of muscle-driven hydrogel machines: from one design file to stress and stroke.",
)

app.add_typer(muscle)
app.add_typer(study)


@app.callback(invoke_without_command=True)
def _program(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and end.")] = False,
) -> None:
    if version:
        jobs.print_version()
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())  # noqa: T201


@app.command("presets")
def _presets_command(as_json: AsJson = False, debug: Debug = False) -> Job:
    """List the designs that come with the program."""
    return partial(jobs.list_presets, as_json)


@app.command("mesh")
def _mesh_command(
    design: Annotated[
        str | None, typer.Argument(metavar="[DESIGN]", help="Preset or TOML file; may be left out to check a --mesh.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder of the mesh file; by default the current one.")
    ] = None,
    size: Size = None,
    mesh: MeshFile = None,
    rename: Rename = None,
    skeleton: Annotated[
        Path | None,
        typer.Option(
            "--from", metavar="FILE", help="Skeleton of your own, STEP or STL; a STEP file may hold the muscle, too."
        ),
    ] = None,
    muscle: Annotated[
        Path | None,
        typer.Option("--muscle", metavar="FILE", help="Muscle beside it; by default built round the pillars."),
    ] = None,
    unit: Annotated[
        str | None, typer.Option("--unit", metavar="UNIT", help="Of STL files: mm, cm, m, um or in.")
    ] = None,
    align: Annotated[bool, typer.Option("--align", help="Move the parts to the design's place.")] = False,
    fit: Annotated[
        bool, typer.Option("--fit", help="Take the design's lengths from the parts; writes that design, too.")
    ] = False,
    landmark: Annotated[
        list[str] | None,
        typer.Option("--landmark", metavar="NAME=X,Y,Z", help="Place of a named point [mm] instead of the design's."),
    ] = None,
    export: Annotated[
        Path | None, typer.Option("--export", metavar="FILE", help="Write the skeleton as STEP or STL, mesh nothing.")
    ] = None,
    export_muscle: Annotated[
        Path | None, typer.Option("--export-muscle", metavar="FILE", help="The same of the muscle.")
    ] = None,
    sets: Sets = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
    force: Annotated[bool, typer.Option("--force", help="Write over another file of that name.")] = False,
    debug: Debug = False,
) -> Job:
    """Mesh a design into <name>.msh, or check a given mesh (written only if --out is given)."""
    if design is None and mesh is None:
        wanted = "a preset, a TOML file, or --mesh FILE.msh to check"
        raise OptionError(f"DESIGN: missing, expected {wanted if skeleton is None else 'the design of --from'}")
    if design is None and sets:
        raise OptionError("--set: found without DESIGN, expected the design that it changes")
    check_mesh(mesh, rename if skeleton is None else None, size)
    goes = (("--muscle", muscle), ("--unit", unit), ("--align", align), ("--fit", fit), ("--landmark", landmark))
    for name, given in goes:
        if given and skeleton is None:
            raise OptionError(f"{name}: found without --from, expected the skeleton that it goes with")
    ways = {"--mesh": mesh, "--from": skeleton, "--export": export or export_muscle}
    chosen = [name for name, given in ways.items() if given]
    if len(chosen) > 1 or (design is None and "--export" in chosen):
        raise OptionError(f"{chosen[0]}: found together with {chosen[-1]}, expected one of them")
    order = Order(design or "", out, size, mesh, rename or (), sets or (), quiet, as_json, force)
    own = mesh_jobs.MeshOrder(skeleton, muscle, unit, align, landmark or (), export, export_muscle, fit)
    return partial(mesh_jobs.mesh, order, own)


@app.command("solve")
@ordering(meshes=True, resumes=True)
def _solve_command(order: Order, no_walk: NoWalk = False) -> Job:
    """Solve for the states of a design: tables, VTK files and summary, no pictures."""
    # there is no walking to leave out
    return partial(jobs.solve, replace(order, walks=False), False)


@app.command("run")
@ordering(meshes=True, resumes=True)
def _run_command(order: Order, no_walk: NoWalk = False) -> Job:
    """Do it all: mesh, states, stroke, error estimate, walking, comparison, report."""
    return partial(jobs.solve, replace(order, walks=not no_walk), True)


@app.command("walk")
@ordering(meshes=True, resumes=True)
def _walk_command(
    order: Order,
    frequency: Annotated[
        list[str] | None,
        typer.Option("--frequency", metavar="HZ", help="Strokes per second, such as 2Hz; repeat it for a sweep."),
    ] = None,
    duration: Annotated[
        str | None, typer.Option("--duration", metavar="S", help="Driven time of each walk, such as 10s.")
    ] = None,
    amplitude: Annotated[
        str | None,
        typer.Option("--amplitude", metavar="SHARE", help="Largest drive, or paper for the forces of its simulation."),
    ] = None,
    model: Annotated[
        str, typer.Option("--model", metavar="MODEL", help="Which model walks: rod, solid or both.")
    ] = "rod",
    stroke_from: Annotated[
        str,
        typer.Option("--stroke-from", metavar="MODEL", help="solid: the rods also walk with the stroke of the solid."),
    ] = "rod",
) -> Job:
    """Walk a design over its ground: steps, speed, foot forces, work, with plots and an animation."""
    return partial(jobs.walk, order, WalkOrder(frequency or (), duration, amplitude, model, stroke_from))


@app.command("crosscheck")
@ordering(design="junction_bot", meshes=True)
def _crosscheck_command(
    order: Order,
    measured: Annotated[
        Path | None,
        typer.Option("--measured", metavar="FILE.csv", help="Measured deflections: tell tension and modulus instead."),
    ] = None,
    fit: Annotated[
        list[str] | None,
        typer.Option("--fit", metavar="NAME", help="What is sought: tension, or passive and active; stiffness."),
    ] = None,
    pixel: Annotated[
        str | None, typer.Option("--pixel", metavar="MM", help="Pixel of a camera with noise, such as 0.02mm.")
    ] = None,
    noise: Annotated[
        float | None, typer.Option("--noise", metavar="PIXELS", help="Its deviation, in pixels; by default a half.")
    ] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Of its noise.")] = None,
) -> Job:
    """Solve as a solid and as rods at the same tensions: how far they agree, and why not."""
    if pixel is None and (noise, seed) != (None, None):
        raise OptionError("--noise, --seed: found without --pixel, expected the size of the pixel that they are about")
    if measured is not None:
        return partial(comparing_jobs.measured, order, measured, fit or ())
    if fit:
        raise OptionError("--fit: found without --measured, expected the file of what was measured")
    return partial(comparing_jobs.crosscheck, order, pixel, noise, seed)


app.command("validate")(
    ordering(design="junction_bot", meshes=True)(
        plainly(
            comparing_jobs.validate,
            "Predict the paper's printed numbers: one verdict each, or why there is no prediction.",
        )
    )
)


@app.command("verify")
def _verify_command(
    cases: Annotated[
        list[str] | None, typer.Argument(metavar="[CASE]...", help="Cases such as S1, R4 or C3; all if none is given.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder of the table; by default runs/verification.")
    ] = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
    debug: Debug = False,
) -> Job:
    """Compute known answers: one table of every case, with errors, tolerances and sources; fails if a row does."""
    return partial(jobs.verify, VerifyOrder(cases or (), out, quiet, as_json, debug))


@app.command("doctor")
def _doctor_command(as_json: AsJson = False, debug: Debug = False) -> Job:
    """Say which parts work on this machine, what is used instead, and which command brings the rest."""
    return partial(jobs.examine, as_json)


@app.command("schema")
def _schema_command(debug: Debug = False) -> Job:
    """Print the JSON schema of a design file, for completion and checks in editors."""
    return jobs.print_schema


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code.

    Parameters
    ----------
    argv
        Arguments without the program's name; those of the process if None.
    """
    arguments = list(sys.argv[1:] if argv is None else argv)
    if argv is None:
        # a terminal of another encoding gets escapes, not a failure
        for stream in (sys.stdout, sys.stderr):
            getattr(stream, "reconfigure", lambda **_: None)(errors="backslashreplace")
    try:
        with _stopped_by_signals():
            # a command gives its job; --help and --version end with a code
            given: Job | int | None = typer.main.get_command(app).main(arguments, PROGRAM, standalone_mode=False)
            code = given() if callable(given) else given or 0
            sys.stdout.flush()
            return code
    except BrokenPipeError:
        # whoever read our output has enough; keep the interpreter's last flush from complaining
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Exception, KeyboardInterrupt) as error:
        code, text = verdict(error)
        if "--debug" in arguments:
            traceback.print_exception(error)
        print(f"{PROGRAM}: {_one_line(text)}", file=sys.stderr)  # noqa: T201
        try:
            sys.stdout.flush()
        except OSError:
            # what is left in the buffer cannot be written; the interpreter's last flush would change the exit code
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return code


def verdict(error: BaseException) -> tuple[int, str]:
    """Exit code and message of what ended a command."""
    if isinstance(error, KeyboardInterrupt | typer.Abort):
        return INTERRUPTED, f"interrupted{': ' if error.args else ''}{error}"
    if isinstance(error, BiobotError):
        return error.exit_code, str(error)
    if hasattr(error, "format_message"):  # typer's own, whose classes have moved between its versions
        return INPUT, _usage(error)
    if isinstance(error, MemoryError):
        return FAILED, f"out of memory ({error or 'no more could be had'}): ask for a larger --size"
    if isinstance(error, OSError) and (error.filename is not None or error.errno == errno.ENOSPC):
        # what no part of the package has put into its own words, and a full disk below standard output
        found = file_error(error, error.filename or "standard output", doing="use" if error.filename else "write")
        return found.exit_code, str(found)
    if isinstance(error, ImportError):
        return INTERNAL, f"a part of the program cannot be loaded ({error}): see {PROGRAM} doctor"
    what = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return INTERNAL, f"internal error: {what} (this is a defect; run again with --debug)"


def _usage(error: Any) -> str:
    """A usage error of typer in one line: what, and the nearest option where there is one."""
    option, near = getattr(error, "option_name", None), getattr(error, "possibilities", None)
    if type(error).__name__ == "NoSuchOption":
        text = f"{option}: no such option" + (f"; did you mean {near[0]}?" if near else "")
    else:
        text = error.format_message().rstrip(".")
    context = getattr(error, "ctx", None)
    return f"{text} (see {context.command_path if context else PROGRAM} --help)"


def _one_line(text: str) -> str:
    joined = "; ".join(line.strip() for line in text.splitlines() if line.strip())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in joined)


@contextmanager
def _stopped_by_signals() -> Iterator[None]:
    """A request to end (SIGTERM, a closed terminal) stops the work like Ctrl-C, so that files stay whole."""

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = {}
    if threading.current_thread() is threading.main_thread():
        for name in ("SIGTERM", "SIGHUP"):
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is signal.SIG_DFL:
                before[number] = signal.signal(number, stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
