"""What the rows of a sweep say together: the table, rank correlations, pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from fem_biobot.design import keys
from fem_biobot.study.design_check import against, overall
from fem_biobot.study.finding import Finding
from fem_biobot.study.sweep_file import SweepPlan, Task
from fem_biobot.study.sweep_views import sweep_views
from fem_biobot.tables import Table
from fem_biobot.view.report import heading
from fem_biobot.view.sweep import against_each, coordinates

Row = dict[str, Any]

# what is shown of each task; all else stands in the CSV file
_SHOWN = {
    Task.solve: ("stroke_mm", "muscle_force_mN", "tip_closing_mm", "tip_deflection_mm", "fibre_stretch_1"),
    Task.walk: ("speed_mm_per_s", "step_mm", "stroke_mm", "slip_fraction_1"),
    Task.crosscheck: ("solid_stroke_mm", "rods_stroke_mm", "stroke_difference_1", "muscle_force_difference_1"),
}
# fewer points say nothing about ranks
_FEWEST = 5
_MOST_SHOWN = 60


def column(key: str) -> str:
    """A design key as the name of a column, its unit as the suffix; angles are told in degrees."""
    quantity = keys()[key].quantity
    if quantity is None:
        return key
    unit = "deg" if quantity.unit == "rad" else quantity.unit
    return f"{key}_" + unit.replace("/", "_per_").replace("^", "").replace(" ", "_")


def sweep_rows(plan: SweepPlan, found: Mapping[str, Mapping[str, Any]]) -> list[Row]:
    """Rows of the table, in the order of the cases, for those that ended; the same whoever did them, and when."""
    rows: list[Row] = []
    for case in plan.cases:
        row = found.get(case.key)
        if row is None:
            continue
        parameters = {column(key): told(key, value) for key, value in case.values.items()}
        start = {"case": case.number, **parameters, "status": row["status"], "reason": row["reason"]}
        judged = {"works": overall(row["check"]), "against": against(row["check"])}
        rows.append({**start, **row["outputs"], **judged, "key": case.key})
    return rows


def sweep_finding(plan: SweepPlan, found: Mapping[str, Mapping[str, Any]], figures: Path, cases: Path) -> Finding:
    """Table, sensitivities and pictures of all cases, whose folder is `cases`, and the extreme ones to turn."""
    rows = sweep_rows(plan, found)
    done = [row for row in rows if row["status"] == "done"]
    names = [column(key) for key in plan.varied]
    outputs = [name for name in _SHOWN[plan.task] if any(row.get(name) is not None for row in done)]
    ranks = rank_correlations(done, names, outputs)
    tables = [_cases(plan, rows, names, outputs)]
    if ranks:
        tables.append(_ranks(ranks, names, outputs))
    failed = len(rows) - len(done)
    remarks = [f"{len(done)} of {len(rows)} cases done" + (f", {failed} failed: see the reasons" if failed else "")]
    unkept = sum(bool(row.get("again")) for row in found.values())
    if unkept:
        remarks.append(f"{unkept} cases are still to be done: the same command does them")
    beside = sum(row.get("parent") is not None for row in found.values())
    if beside:
        remarks.append(f"{beside} of {len(done)} solves began at the states of a case near by")
    notes = dict.fromkeys(note for case in plan.cases for note in found[case.key]["notes"])
    if len(notes) > 8:
        remarks.append(f"{len(notes)} different notes of cases: see cases/*.json")
    shown = outputs[0] if outputs else None
    views, unseen = sweep_views(plan, done, shown, _spelt(shown or ""), cases)
    return Finding(
        {
            "name": plan.name,
            "task": plan.task.value,
            "cases_1": len(rows),
            "done_1": len(done),
            "failed_1": failed,
            "busy_s": round(sum(row["seconds_s"] or 0.0 for row in found.values()), 3),
            "begun_beside_1": beside,
            "newton_iterations_1": sum(row.get("newton_iterations_1") or 0 for row in found.values()),
            "rows": rows,
            "rank_correlations_1": ranks,
        },
        tables,
        {"cases": rows, **({"rank_correlations": ranks} if ranks else {})},
        _draw(plan, done, names, outputs, figures),
        [*(notes if len(notes) <= 8 else []), *unseen],
        remarks,
        views,
        complete=not unkept,
    )


def rank_correlations(rows: Sequence[Row], parameters: Sequence[str], outputs: Sequence[str]) -> list[Row]:
    """Spearman's rank correlation of every number with every parameter that is one: a row a number.

    1 where a number rises with a parameter whatever the others do, -1 where it falls, near 0 where the parameter hardly
    matters or the number turns. None for what does not vary, nothing from fewer than five cases.
    """
    kept = [name for name in parameters if _numbers(rows, name) is not None]
    found: list[Row] = []
    for output in outputs:
        have = [row for row in rows if row.get(output) is not None]
        y = _numbers(have, output)
        if len(have) < _FEWEST or y is None or not kept:
            continue
        line: Row = {"number": output}
        for name in kept:
            x = _numbers(have, name)
            varies = x is not None and np.ptp(x) > 0.0 and np.ptp(y) > 0.0
            statistic: Any = spearmanr(x, y).statistic if varies else None  # pyright: ignore[reportAttributeAccessIssue]
            line[name] = None if statistic is None else float(statistic)
        found.append(line)
    return found


def _numbers(rows: Sequence[Row], name: str) -> np.ndarray | None:
    """A column as numbers, None where some are none."""
    values = [row.get(name) for row in rows]
    if any(isinstance(v, str | bool) or v is None for v in values):
        return None
    return np.array(values, dtype=float)


def told(key: str, value: Any) -> Any:
    """A value as the table shows it."""
    quantity = keys()[key].quantity
    if quantity is None or quantity.unit != "rad":
        return value
    # what was written in degrees reads as it was written
    return float(f"{math.degrees(value):.12g}")


def _cases(plan: SweepPlan, rows: Sequence[Row], names: Sequence[str], outputs: Sequence[str]) -> Table:
    header = ("case", *names, *outputs, "works", "against it")
    told_of = [{**row, "against it": row["reason"] or row["against"]} for row in rows[:_MOST_SHOWN]]
    lines = tuple(tuple(row.get(name) for name in header) for row in told_of)
    more = f", the first {_MOST_SHOWN} of {len(rows)} (all in tables/cases.csv)" if len(rows) > _MOST_SHOWN else ""
    return Table(f"{plan.name}: {plan.task.value}{more}", tuple(_spelt(name) for name in header), lines)


def _ranks(ranks: Sequence[Row], names: Sequence[str], outputs: Sequence[str]) -> Table:
    kept = [name for name in names if name in ranks[0]]
    lines = tuple((_spelt(row["number"]), *(row[name] for name in kept)) for row in ranks)
    header = ("number", *(_spelt(name) for name in kept))
    return Table("Rank correlation with each parameter (Spearman) [1]", header, lines)


def _spelt(name: str) -> str:
    """A column's name for a reader, without the section that no other key is confused with."""
    return heading(name.replace("_mm_per_s", " [mm/s]") if name.endswith("_mm_per_s") else name)


def _draw(
    plan: SweepPlan, done: Sequence[Row], names: Sequence[str], outputs: Sequence[str], figures: Path
) -> list[tuple[Path, str]]:
    """Every number against every parameter, and all of a case as one line."""
    if not done or not outputs:
        return []
    columns = {_spelt(name): [row.get(name) for row in done] for name in (*names, *outputs)}
    ys = [_spelt(name) for name in outputs]
    xs = [_spelt(name) for name in names]
    files = figures / "against_each.png", figures / "parallel.png"
    against_each(files[0], columns, xs, ys, title=f"{plan.name}: {plan.task.value}")
    found = [(files[0], "Every number against every parameter; one mark a case.")]
    if len(names) > 1:
        coordinates(files[1], columns, xs, ys, title=f"{plan.name}: {plan.task.value}")
        found.append((files[1], f"Every case as a line through its values, coloured by its {ys[0]}."))
    return found
