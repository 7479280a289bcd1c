"""The jobs behind the commands: each does its work, prints its result on standard output and returns an exit code.

Knows nothing of how arguments are parsed. Parts that are slow to import are imported by the job that needs them, after
everything that can be refused without them.
"""

from __future__ import annotations

import json
import os
import platform
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fem_biobot.errors import DesignError, FileError, SolveError

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.mesh.body import BodyMesh
    from fem_biobot.study.reporter import Reporter
    from fem_biobot.study.walking import WalkPlan
    from fem_biobot.tables import Table

_BARE_NUMBER = re.compile(r"\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*")


@dataclass(frozen=True)
class Order:
    """What the options of a command say."""

    design: str
    out: Path | None = None
    size: str | None = None
    mesh_file: Path | None = None
    rename: Sequence[str] = ()
    sets: Sequence[str] = ()
    quiet: bool = False
    json: bool = False
    force: bool = False
    resume: bool = False
    walks: bool = True


@dataclass(frozen=True)
class WalkOrder:
    """What the options of `walk` say beside an `Order`."""

    frequencies: Sequence[str] = ()
    duration: str | None = None
    amplitude: str | None = None
    model: str = "rod"


def solve(order: Order, complete: bool) -> int:
    """The main job on a design; `complete` adds what makes a run out of a solve."""
    from fem_biobot.config import load_design
    from fem_biobot.design_checks import refuse_without_solid

    design, size, names = load_design(order.design, order.sets), mesh_size(order.size), region_names(order.rename)
    refuse_without_solid(design, "solve")
    folder = result_folder(design, order.out)

    from fem_biobot.results import remarks, result_tables
    from fem_biobot.study.run import run

    def work(reporter: Reporter) -> dict[str, Any]:
        return run(
            design,
            folder,
            mesh_file=order.mesh_file,
            names=names or None,
            size=size,
            force=order.force,
            resume=order.resume,
            complete=complete,
            walks=order.walks,
            reporter=reporter,
        )

    summary = worked(order, folder, work)
    show(order, summary, folder, lambda: (result_tables(summary, design.kind), remarks(summary, design.kind)))
    return 0


def walk(order: Order, walking: WalkOrder) -> int:
    """Walk a design over its ground."""
    from fem_biobot.config import load_design

    design, plan = load_design(order.design, order.sets), walk_plan(order, walking)
    word = {"rod": "walk", "solid": "walk_solid", "both": "walk_both"}[walking.model]
    folder = result_folder(design, order.out or Path("runs") / f"{safe_name(design.name)}_{word}")
    size, names = mesh_size(order.size), region_names(order.rename)

    from fem_biobot.results import walk_table

    def work(reporter: Reporter) -> dict[str, Any]:
        if walking.model == "rod":
            from fem_biobot.study.walking import walk_design

            return walk_design(design, folder, plan, force=order.force, resume=order.resume, reporter=reporter)
        from fem_biobot.study.solid_walking import walk_solid

        return walk_solid(
            design, folder, plan, rods=walking.model == "both", mesh_file=order.mesh_file, names=names or None,
            size=size, force=order.force, resume=order.resume, reporter=reporter,
        )  # fmt: skip

    summary = worked(order, folder, work)
    show(order, summary, folder, lambda: ([walk_table(summary["walks"])], []))
    return 0


def given_mesh(order: Order, design: Design) -> BodyMesh | None:
    """The mesh file of an order, read and checked before anything is written; None where the mesh is generated."""
    from fem_biobot.mesh.files import read_mesh

    names = region_names(order.rename)
    return None if order.mesh_file is None else read_mesh(order.mesh_file, names or None, design=design)


def worked(order: Order, folder: Path, work: Callable[[Reporter], dict[str, Any]]) -> dict[str, Any]:
    """Summary of a job that is told of while it runs; its end says where to find what was reached."""
    from fem_biobot.progress import reporting

    try:
        with standard_output_free(order.json), reporting(order.quiet) as reporter:
            summary = work(reporter)
            # those of a result that was there already have been told to nobody yet
            for note in summary["notes"]:
                reporter.note(note)
            return summary
    except SolveError as failure:
        raise SolveError(f"{failure}; what was reached is in {folder}", failure.best) from failure
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{folder}: files are whole, the same command goes on from there") from None


def show(
    order: Order,
    summary: Mapping[str, Any],
    folder: Path,
    words: Callable[[], tuple[Sequence[Table], Sequence[str]]],
) -> None:
    """A result on standard output: as JSON, as the folder's path, or as tables and where to look."""
    if order.json:
        print_json(summary)
        return
    if order.quiet:
        say(str(folder))
        return

    from fem_biobot.progress import show_tables
    from fem_biobot.results import where_to_look

    tables, lines = words()
    show_tables(tables)
    say("", *lines, *where_to_look(folder))


def walk_plan(order: Order, walking: WalkOrder) -> WalkPlan:
    """Frequencies, duration and amplitude of the options, with the design's where there are none."""
    from fem_biobot.config import load_design
    from fem_biobot.study.walking import WalkPlan
    from fem_biobot.units import parse_quantity, shown

    if walking.model not in ("rod", "solid", "both"):
        raise DesignError(f"--model: found {shown(walking.model)}, expected rod, solid or both")
    if walking.model == "rod":
        for option, given in (("--size", order.size), ("--mesh", order.mesh_file)):
            if given is not None:
                raise DesignError(
                    f"{option}: found with --model rod, which has no mesh, expected --model solid or both"
                )

    def number(text: str, unit: str, option: str) -> float:
        value = parse_quantity(f"{text.strip()} {unit}" if _BARE_NUMBER.fullmatch(text) else text, unit, option)
        if not value > 0.0:
            raise DesignError(f"{option}: found {shown(text)}, expected above 0 {unit}")
        return value

    drive = load_design(order.design, order.sets).drive
    frequencies = tuple(
        number(part, "Hz", "--frequency") for text in walking.frequencies for part in text.split(",") if part.strip()
    )
    duration = drive.duration if walking.duration is None else number(walking.duration, "s", "--duration")
    amplitude: float | None = drive.amplitude
    if walking.amplitude == "paper":
        amplitude = None
    elif walking.amplitude is not None:
        try:
            amplitude = float(walking.amplitude)
        except ValueError:
            amplitude = -1.0
        if not 0.0 <= amplitude < float("inf"):
            raise DesignError(
                f"--amplitude: found {shown(walking.amplitude)}, expected a number of at least 0, or paper for the "
                "forces of the paper's simulation"
            )
    return WalkPlan(frequencies or (drive.frequency,), duration, amplitude)


@dataclass(frozen=True)
class VerifyOrder:
    """What the options of `verify` say."""

    cases: Sequence[str] = ()
    out: Path | None = None
    quiet: bool = False
    json: bool = False
    debug: bool = False


def verify(order: VerifyOrder) -> int:
    """Known answers beside ours; 1 if a row fails."""
    from fem_biobot.progress import reporting, show_tables
    from fem_biobot.verification import report
    from fem_biobot.verification.registry import chosen, not_covered
    from fem_biobot.verification.verify import Count, Outcome, summary, verify

    cases = chosen(order.cases)
    folder = usable_folder(order.out or Path("runs") / "verification")
    report.clear(folder)
    done: list[Outcome] = []

    def keep(outcome: Outcome) -> None:
        done.append(outcome)
        report.draw(folder, outcome)
        report.write(folder, done, complete=len(done) == len(cases))

    try:
        with standard_output_free(order.json), reporting(order.quiet) as reporter:
            verify(cases, reporter=reporter, on_outcome=keep, raising=order.debug)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{folder}: files are whole and hold {len(done)} of {len(cases)} cases") from None
    count = Count.of(done)
    if order.json:
        print_json(summary(done, not_covered(), complete=True))
    elif order.quiet:
        say(str(folder))
    else:
        show_tables([report.terminal_table(done)])
        missing = report.uncovered_line()
        say("", *([missing] if missing else []), count.words(), *report.where_to_look(folder))
    for line in report.failures(done):
        print(line, file=sys.stderr)  # noqa: T201
    return 0 if count.good else 1


def list_presets(as_json: bool) -> int:
    """The designs that come with the program, with their key numbers."""
    from fem_biobot.config import load_design, presets

    found = [load_design(name) for name in presets()]
    if as_json:
        print_json([{"name": d.name, "description": d.description, "kind": d.kind, **_key_numbers(d)} for d in found])
        return 0

    from fem_biobot.progress import show_tables
    from fem_biobot.results import preset_table

    show_tables([preset_table([(d.name, d.description, _key_numbers(d)) for d in found])])
    return 0


def examine(as_json: bool) -> int:
    """What works on this machine; 1 if something is missing that every run needs."""
    from fem_biobot import doctor

    with standard_output_free(as_json):
        parts = doctor.examine()
    if as_json:
        print_json(doctor.as_json(parts))
    else:
        from fem_biobot.progress import show_tables

        show_tables([doctor.table(parts)])
        say("", *doctor.verdict(parts))
    return 0 if doctor.works(parts) else 1


def print_schema() -> int:
    """The JSON schema of design files."""
    from fem_biobot.config import json_schema

    print_json(json_schema())
    return 0


def print_version() -> None:
    """The version of the package and of Python."""
    try:
        version = metadata.version("fem_biobot")
    except metadata.PackageNotFoundError:
        version = "(a checkout that is not installed)"
    say(f"fem-biobot {version}, Python {platform.python_version()}")


def mesh_size(text: str | None) -> float | None:
    """Mesh size of the option [mm]; a bare number is in mm, as the option's help says."""
    from fem_biobot.design import keys
    from fem_biobot.units import shown

    if text is None:
        return None
    size = length(text, "--size")
    allowed = keys()["mesh.size"].quantity
    if allowed is not None and not allowed.allows(size):
        raise DesignError(f"--size: found {shown(text)}, expected {allowed.interval()}")
    return size


def length(text: str, option: str) -> float:
    """Length of an option [mm]; a bare number is in mm."""
    from fem_biobot.units import parse_quantity

    return parse_quantity(f"{text.strip()} mm" if _BARE_NUMBER.fullmatch(text) else text, "mm", option)


def region_names(texts: Sequence[str]) -> Mapping[str, str]:
    """Volume names of a mesh file to regions, from texts such as ``gel=skeleton``."""
    names: dict[str, str] = {}
    for text in texts:
        name, _, region = (part.strip() for part in text.rpartition("="))
        if not (name and region):
            raise DesignError(f"--rename: found {text!r}, expected NAME=REGION, such as gel=skeleton")
        if names.setdefault(name, region) != region:
            raise DesignError(f"--rename: found {name} for {names[name]} and for {region}, expected it once")
    return names


def result_folder(design: Design, out: Path | None) -> Path:
    """Folder of the result, refused at once where it cannot be made or written; nothing is made yet."""
    return usable_folder(Path("runs") / safe_name(design.name) if out is None else out)


def usable_folder(folder: Path) -> Path:
    """The folder, refused where it cannot be made or written; nothing is made yet."""
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder}: found a file, expected a folder for the result")
    above = folder.absolute()
    place = next(parent for parent in (above, *above.parents) if parent.exists())
    if not place.is_dir():
        raise FileError(f"{folder}: cannot be made: {place} is a file, expected a folder")
    if not os.access(place, os.W_OK | os.X_OK):
        raise FileError(f"{folder}: cannot be written: no permission in {place}, expected a folder of your own")
    return folder


def safe_name(name: str) -> str:
    """A design's name as the name of a file."""
    return re.sub(r"[^\w.-]+", "_", name).strip("._")[:100] or "unnamed"


def _key_numbers(design: Design) -> dict[str, float]:
    """What tells one design from another."""
    if design.walker is not None:
        base = design.walker.base_force
        return {"base_force_mN": base, "peak_force_mN": base + design.drive.amplitude * design.walker.active_force}
    numbers = {"span_mm": design.span}
    if design.skeleton is not None:
        numbers["gel_young_kPa"] = design.skeleton.material.young
        numbers["second_moment_mm4"] = design.second_moment
    if design.muscle is not None:
        if design.skeleton is not None:
            numbers["moment_arm_mm"] = design.moment_arm
        numbers["muscle_section_mm2"] = design.junction_section
        numbers["passive_tension_kPa"] = design.tension(0.0)
        numbers["peak_tension_kPa"] = design.tension(design.drive.amplitude)
    if design.load is not None:
        numbers["tip_force_mN"] = design.load.tip_force
    return numbers


@contextmanager
def standard_output_free(needed: bool) -> Iterator[None]:
    """Whatever the work prints goes to standard error where standard output is for JSON alone."""
    if not needed:
        yield
        return
    with redirect_stdout(sys.stderr):
        yield


def print_json(value: Any) -> None:
    """JSON in plain ASCII, so that no terminal's encoding can spoil it."""
    say(json.dumps(value, indent=2, allow_nan=False, default=_plain))


def _plain(value: object) -> object:
    tolist = getattr(value, "tolist", None)
    if tolist is None:
        raise TypeError(f"no JSON form for {type(value).__name__}")
    return tolist()


def say(*lines: str) -> None:
    sys.stdout.write("".join(f"{line}\n" for line in lines))
