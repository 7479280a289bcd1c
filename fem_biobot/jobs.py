"""The jobs behind the commands: each does its work, prints its result on standard output and returns an exit code.

Knows nothing of how arguments are parsed. Parts that are slow to import are imported by the job that needs them, after
everything that can be refused without them.
"""

from __future__ import annotations

import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fem_biobot.orders import Order, VerifyOrder, WalkOrder, mesh_size, region_names, walk_plan
from fem_biobot.telling import (
    print_json,
    result_folder,
    safe_name,
    say,
    show,
    standard_output_free,
    usable_folder,
    worked,
)

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.study.reporter import Reporter


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
    word = "walk_stroke" if walking.stroke_from == "solid" else word
    folder = result_folder(design, order.out or Path("runs") / f"{safe_name(design.name)}_{word}")
    size, names = mesh_size(order.size), region_names(order.rename)

    from fem_biobot.results import walk_table

    def work(reporter: Reporter) -> dict[str, Any]:
        if walking.stroke_from == "solid":
            from fem_biobot.study.stroke_walking import walk_with_stroke

            return walk_with_stroke(
                design, folder, plan, mesh_file=order.mesh_file, names=names or None, size=size, force=order.force,
                resume=order.resume, reporter=reporter,
            )  # fmt: skip
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
