"""The design check of a run, by all that was found, and the tables of a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fem_biobot.design import Design
from fem_biobot.rod.gait import Walk
from fem_biobot.solid.strains import exceeded_strain
from fem_biobot.study import outputs, walk_files
from fem_biobot.study.contact_outputs import contact_rows
from fem_biobot.study.design_check import as_numbers, check_table, design_check
from fem_biobot.study.plan import Found
from fem_biobot.view.report import Table

Summary = Mapping[str, Any]


def checked(design: Design, found: Sequence[Found], summary: Summary) -> list[dict[str, Any]]:
    """Rows of the design check from closed forms, from the states of the solid and from the walks of a summary."""
    own = "remodelled_peak" if design.value("muscle.reference") == "remodelled" else "peak"
    full = next((f.state for f in found if f.wanted.key == own and design.kind == "bot"), None)
    strain = None if full is None else exceeded_strain(full, "skeleton")
    return as_numbers(design_check(design, solid=summary["solid"], gel_strain=strain, walks=summary["walks"]))


def report_tables(summary: Summary) -> list[Table]:
    """What sliding rings press on their pillars, and the design check where something is asked of the machine."""
    tables: list[Table] = []
    if rows := contact_rows(summary["solid"]["states"]):
        header = list(rows[0])
        tables.append(("What the pillars bear", header, [[row[name] for name in header] for row in rows]))
    if summary["design_check"]:
        table = check_table(summary["design_check"])
        tables.append((table.title, table.header, table.rows))
    return tables


def write_run_tables(folder: Path, summary: Summary, walks: Sequence[Walk]) -> None:
    """Every number of a run as CSV."""
    tables, solid = outputs.tables_folder(folder), summary["solid"]
    outputs.write_table(tables / "states.csv", solid["states"])
    for name, rows in (
        ("comparison", solid.get("comparison")),
        ("error_estimate", solid.get("error_estimate")),
        ("design_check", summary.get("design_check")),
        ("contact", contact_rows(solid["states"])),
    ):
        if rows:
            outputs.write_table(tables / f"{name}.csv", rows)
    if walks:
        walk_files.write_walk_tables(folder, walks)
    if solid.get("stroke"):
        outputs.write_table(tables / "stroke.csv", [{"tissue": k, **v} for k, v in solid["stroke"].items()])
