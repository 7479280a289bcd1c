"""The table as a folder of files, as Markdown, and for the terminal."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from fem_biobot.errors import FileError
from fem_biobot.files import file_error, write_json, write_text
from fem_biobot.tables import Table
from fem_biobot.verification.records import Case, Claim, Row
from fem_biobot.verification.registry import CASES, IDS, not_covered
from fem_biobot.verification.verify import Count, Outcome, row_numbers, summary

SUMMARY, TABLE, PAGE, FIGURES = "summary.json", "verification.csv", "verification.md", "figures"
HEADER = ("case", "quantity", "reference", "ours", "error", "tolerance", "unit", "verdict", "source")
# columns that do not depend on a computation
STATIC = ("case", "quantity", "reference", "tolerance", "unit", "source")


_PREFACE = (
    "Our mathematics against known answers, computed by `fem-biobot verify`. A row passes where its error, the",
    "distance of ours from the reference in the row's unit, is within its tolerance; a row without one is shown and",
    "not judged. What each case measures, why its tolerances are what they are, what it cannot see and which faults it",
    "catches is said at its function in `fem_biobot/verification/`.",
)


def digits(value: float | None, count: int = 10) -> str:
    """A number with at most `count` significant digits; a dash for none."""
    return "-" if value is None or value != value else f"{value:.{count}g}"


def cells(row: Row) -> dict[str, str]:
    """Texts of a row by column."""
    return {
        **static_cells(row.case, row.claim),
        "ours": digits(row.ours),
        "error": digits(row.error, 2),
        "verdict": row.verdict,
    }


def static_cells(case: str, claim: Claim) -> dict[str, str]:
    """Texts of what a claim says beforehand, by column."""
    return {
        "case": case,
        "quantity": claim.quantity,
        "reference": digits(claim.reference),
        "tolerance": digits(claim.tolerance, 2),
        "unit": claim.unit,
        "source": claim.source,
    }


def terminal_table(outcomes: Iterable[Outcome]) -> Table:
    """All rows, to print."""
    rows = tuple(tuple(cells(row)[name] for name in HEADER) for outcome in outcomes for row in outcome.rows)
    return Table("Verification: known answers and ours", HEADER, rows)


def failures(outcomes: Iterable[Outcome]) -> list[str]:
    """A line for each row that failed, or for a case that broke off."""
    lines = []
    for outcome in outcomes:
        if outcome.failure:
            lines.append(f"{outcome.case.id}: broke off: {outcome.failure}")
            continue
        lines += [
            f"{row.case}: {row.claim.quantity}: found {digits(row.ours)} {row.claim.unit}, "
            f"expected {digits(row.claim.reference)} within {digits(row.claim.tolerance, 2)}"
            for row in outcome.rows
            if row.passed is False
        ]
    return lines


def uncovered_line() -> str:
    """Which cases are not there yet; empty if all are."""
    missing = not_covered()
    return f"not covered yet: {', '.join(missing)}" if missing else ""


def markdown(outcomes: Sequence[Outcome], figures: bool = True) -> str:
    """The table as a page, with its pictures beside it if `figures`."""
    missing = uncovered_line()
    lines = ["# Verification", "", *_PREFACE, "", f"{Count.of(outcomes).words()}.", ""]
    if missing:
        lines += [f"{missing[0].upper()}{missing[1:]}.", ""]
    lines += [_line(HEADER), _line(["---"] * len(HEADER))]
    lines += [_line(cells(row)[name] for name in HEADER) for outcome in outcomes for row in outcome.rows]
    if figures:
        for outcome in outcomes:
            if outcome.graph is not None:
                title = f"{outcome.case.id}: {outcome.case.title}"
                lines += ["", f"![{title}]({FIGURES}/{outcome.case.id}.png)"]
    return "\n".join([*lines, ""])


def _line(texts: Iterable[str]) -> str:
    # a bar would end the cell
    return "| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |"


def static_rows(page: str) -> list[dict[str, str]]:
    """What a page says of the static columns, row by row."""
    table = [line for line in page.splitlines() if line.startswith("| ")]
    names, *body = ([text.strip() for text in line.strip("|").split(" | ")] for line in table)
    return [
        {name: text for name, text in zip(names, texts, strict=True) if name in STATIC}
        for texts in body
        if set(texts) != {"---"}
    ]


def registered_rows(cases: Iterable[Case] = tuple(CASES.values())) -> list[dict[str, str]]:
    """The static columns of all cases."""
    return [static_cells(case.id, claim) for case in cases for claim in case.claims]


def where_to_look(folder: Path) -> list[str]:
    """Which files to open."""
    guide = {PAGE: "the table, with its pictures", TABLE: "every digit", SUMMARY: "every number for programs"}
    width = max(len(str(folder / name)) for name in guide)
    return ["", *(f"{str(folder / name).ljust(width)}  {text}" for name, text in guide.items())]


def usable(folder: Path) -> None:
    """Refuse a folder that holds something else than an earlier verification.

    Raises
    ------
    FileError
        It holds files that are no verification's.
    """
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    try:
        ours = "verification" in json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        ours = False
    if not ours:
        raise FileError(
            f"{folder}: found files that are no verification of this program, expected an empty or new folder; "
            "give another --out"
        )


def clear(folder: Path) -> None:
    """Make the folder, without what an earlier verification left in it; refuses as `usable` does."""
    usable(folder)
    try:
        (folder / FIGURES).mkdir(parents=True, exist_ok=True)
        for name in (TABLE, PAGE, *(f"{FIGURES}/{case}.png" for case in IDS)):
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise file_error(error, folder) from None
    write(folder, [], complete=False)


def draw(folder: Path, outcome: Outcome) -> None:
    """The picture of a case, if it has one."""
    if outcome.graph is None:
        return
    from fem_biobot.view.known import known_and_ours

    graph, case = outcome.graph, outcome.case
    known_and_ours(
        folder / FIGURES / f"{case.id}.png",
        graph.curves,
        x=graph.x,
        y=graph.y,
        title=f"{case.id}: {case.title}",
        logarithmic=graph.logarithmic,
        equal=graph.equal,
    )


def write(folder: Path, outcomes: Sequence[Outcome], *, complete: bool) -> None:
    """Summary, table and page of what is there so far; each file appears whole."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(HEADER)
    for outcome in outcomes:
        for row in outcome.rows:
            numbers = {"case": row.case, **row_numbers(row)}
            table.writerow(["" if numbers[name] is None else numbers[name] for name in HEADER])
    write_text(folder / TABLE, text.getvalue())
    write_text(folder / PAGE, markdown(outcomes))
    write_json(folder / SUMMARY, summary(outcomes, not_covered(), complete=complete))
