"""What an examination of one side of a design found, and the folder it is written to.

A run takes the same findings into its own report. Tables stand in the summary, so that a result that was on disk
already is shown like a new one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fem_biobot.config import digest
from fem_biobot.design import Design
from fem_biobot.files import write_json
from fem_biobot.study.folder import SUMMARY, ResultFolder, write_design
from fem_biobot.study.outputs import figures_folder, tables_folder, write_table
from fem_biobot.study.provenance import appendix
from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.study.versions import versions
from fem_biobot.tables import Table
from fem_biobot.view.interactive import Moving, Piece
from fem_biobot.view.report import write_report


@dataclass(frozen=True)
class Finding:
    """Numbers, tables and figures about one subject.

    Attributes
    ----------
    numbers
        For `summary.json`, each with its unit as the suffix of its key.
    tables
        For the terminal and the report.
    series
        File name without suffix to rows of equal keys, for `tables/*.csv`.
    figures
        Files already drawn, with captions.
    notes
        What was used instead of what.
    remarks
        Lines below the tables.
    views
        Interactive views for the report.
    complete
        Whether all was done; if not, the next run of the same goes on.
    """

    numbers: Mapping[str, Any]
    tables: Sequence[Table] = ()
    series: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)
    figures: Sequence[tuple[Path, str]] = ()
    notes: Sequence[str] = ()
    remarks: Sequence[str] = ()
    views: Sequence[Moving | Piece] = ()
    complete: bool = True


Work = Callable[[Design, Path], Finding]


def examine(
    design: Design,
    out: Path,
    subject: str,
    work: Work,
    *,
    mesh: str = "none",
    kind: str = "muscle",
    identity: Mapping[str, str] | None = None,
    force: bool = False,
    resume: bool = False,
    reporter: Reporter | None = None,
) -> dict[str, Any]:
    """Examine a design and write the result's folder.

    Parameters
    ----------
    design
        What is examined.
    out
        Folder of the result.
    subject
        Name of the examination; its numbers stand under it in the summary.
    work
        Does it, drawing its figures in the folder it is given.
    mesh
        Which mesh, where one is used.
    kind
        What the subject belongs to; nothing for one that stands by itself.
    identity
        What else tells this result from another of the same design.
    force
        Redo what is there, also another design's result.
    resume
        Insist on going on from an unfinished result.
    reporter
        Told of what is there already.

    Returns
    -------
    dict
        The summary, as in `summary.json`.

    Raises
    ------
    BiobotError
        Wrong input, or a folder that holds something else.
    """
    reporter = reporter or Silent()
    job = {"kind": f"{kind} {subject}".strip(), "design_digest": digest(design), "mesh": mesh}
    job |= identity or {}
    folder = ResultFolder(out, job)
    done = folder.done(reporter, force=force, resume=resume)
    if done is not None:
        return done
    began = time.perf_counter()
    folder.open()
    write_design(out, design)
    finding = work(design, figures_folder(out))
    write_series(out, finding)
    summary = {
        "complete": finding.complete,
        "job": job,
        "design_digest": job["design_digest"],
        "design": design.name,
        "versions": versions(),
        "timings_s": {"total": round(time.perf_counter() - began, 3)},
        subject: dict(finding.numbers),
        "tables": [{"title": t.title, "header": t.header, "rows": t.rows} for t in finding.tables],
        "remarks": list(finding.remarks),
        "notes": list(finding.notes),
    }
    write_report(
        out / "report.html",
        {k: v for k, v in summary.items() if k not in ("tables", "remarks", "job")},
        list(finding.figures),
        [(t.title, t.header, t.rows) for t in finding.tables],
        [*finding.remarks, *finding.notes],
        views=finding.views,
        appendix=appendix(design),
        title=f"{design.name}: {job['kind']}",
    )
    if finding.complete:
        folder.close(summary)
    else:
        write_json(out / SUMMARY, summary)
    return summary


def write_series(folder: Path, finding: Finding) -> None:
    """Rows of a finding as `tables/*.csv`."""
    tables = tables_folder(folder)
    for name, rows in finding.series.items():
        write_table(tables / f"{name}.csv", rows)


def tables_of(summary: Mapping[str, Any]) -> list[Table]:
    """Tables that a summary of `examine` holds."""
    return [Table(t["title"], tuple(t["header"]), tuple(map(tuple, t["rows"]))) for t in summary["tables"]]
