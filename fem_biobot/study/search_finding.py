"""A search as a result: every design tried, what was found or why not, a picture, a check of the design found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fem_biobot.design import Design
from fem_biobot.design_tissue import at_rest
from fem_biobot.study.design_check import as_numbers, check_table, design_check
from fem_biobot.study.finding import Finding
from fem_biobot.study.reporter import Reporter
from fem_biobot.study.search import SearchPlan, Solution, Tried, closest_to, nearest_try, reached, search
from fem_biobot.study.search_models import QUANTITIES, Model, seen
from fem_biobot.study.sweep_findings import column
from fem_biobot.study.sweep_findings import told as as_told
from fem_biobot.tables import Table
from fem_biobot.view.interactive import Moving
from fem_biobot.view.tissue import lines


def search_finding(design: Design, plan: SearchPlan, figures: Path, reporter: Reporter) -> Finding:
    """Search, and say plainly what came of it."""
    solutions, tried = search(design, plan, reporter)
    rows = [_row(plan, each.values, each) for each in tried]
    chosen = closest_to(solutions, design, plan.vary)
    found = [_found(plan, each, each is chosen) for each in solutions]
    tables = [_table("Designs tried", rows)]
    if found:
        tables.insert(0, _table("What gives it", found))
    remarks = [_answer(plan, solutions, chosen, tried)]
    views: list[Moving] = []
    if chosen is not None:
        named = dict(zip((r.key for r in plan.vary), chosen.values, strict=True))
        answer = design.with_values(named)
        tables.append(check_table(as_numbers(design_check(answer))))
        views.append(replace(seen(answer, plan.model), title=f"The design found, {_told(plan, chosen.values)}"))
    still = at_rest(design.muscle)
    notes = [still] if still else []
    if plan.model is Model.solid:
        notes.append("a design of another shape has another mesh: numbers scatter by what the mesh does to them")
    return Finding(
        {
            "model": plan.model.value,
            "targets": {f"{t.quantity}_{t.unit}": t.value for t in plan.targets},
            "reached": bool(solutions),
            "solutions": found,
            "rows": rows,
        },
        tables,
        {"search": rows, **({"solutions": found} if found else {})},
        _draw(design, plan, tried, solutions, figures),
        notes,
        remarks,
        views,
    )


def _keys(plan: SearchPlan, values: Sequence[float]) -> dict[str, Any]:
    return {column(r.key): as_told(r.key, v) for r, v in zip(plan.vary, values, strict=True)}


def _told(plan: SearchPlan, values: Sequence[float]) -> str:
    return ", ".join(f"{r.key} {r.told(v)}" for r, v in zip(plan.vary, values, strict=True))


def _row(plan: SearchPlan, values: Sequence[float], tried: Tried) -> dict[str, Any]:
    numbers = {f"{name}_{unit}": tried.answer.numbers.get(name) for name, (unit, _) in QUANTITIES.items()}
    return {**_keys(plan, values), **numbers, "reason": tried.answer.reason}


def _found(plan: SearchPlan, each: Solution, chosen: bool) -> dict[str, Any]:
    numbers = {f"{name}_{unit}": each.answer.numbers[name] for name, (unit, _) in QUANTITIES.items()}
    first = plan.vary[0].key
    bracket = {}
    if each.bracket is not None:
        bracket = {f"from_{column(first)}": each.bracket[0], f"to_{column(first)}": each.bracket[1]}
        bracket = {name: as_told(first, value) for name, value in bracket.items()}
    return {**_keys(plan, each.values), **bracket, **numbers, "nearest_to_design": chosen}


def _table(title: str, rows: Sequence[dict[str, Any]]) -> Table:
    header = tuple(rows[0])
    return Table(title, header, tuple(tuple(row[name] for name in header) for row in rows))


def _answer(plan: SearchPlan, solutions: Sequence[Solution], chosen: Solution | None, tried: Sequence[Tried]) -> str:
    """The answer in a sentence."""
    wanted = " and ".join(f"{t.quantity} {t.value:.4g} {t.unit}" for t in plan.targets)
    if chosen is not None:
        values = " ".join(f'--set {r.key}="{r.told(v)}"' for r, v in zip(plan.vary, chosen.values, strict=True))
        between = ""
        if chosen.bracket is not None:
            low, high = (plan.vary[0].told(v) for v in chosen.bracket)
            between = f", between {low} and {high}"
        more = f"; {len(solutions)} designs do, this one is nearest to yours" if len(solutions) > 1 else ""
        return f"{wanted}: {values}{between}{more}"
    where = ", ".join(f"{r.key} from {r.told(r.low)} to {r.told(r.high)}" for r in plan.vary)
    best = nearest_try(tried, plan.targets)
    if best is None:
        return f"{wanted}: cannot be reached: no design found an equilibrium with {where}; {tried[0].answer.reason}"
    spans = []
    for target in plan.targets:
        span = reached(tried, target.quantity)
        assert span is not None
        spans.append(f"{target.quantity} goes from {span[0]:.4g} to {span[1]:.4g} {target.unit}")
    near = ", ".join(r.told(v, 4) for r, v in zip(plan.vary, best.values, strict=True))
    failed = sum(not each.answer.numbers for each in tried)
    lost = f"; {failed} of {len(tried)} designs tried have no answer" if failed else ""
    return f"{wanted}: cannot be reached with {where}: {' and '.join(spans)}, nearest at {near}{lost}"


def _draw(
    design: Design, plan: SearchPlan, tried: Sequence[Tried], solutions: Sequence[Solution], figures: Path
) -> list[tuple[Path, str]]:
    """One key: the target's number over it. Two keys: the designs that give it, and those tried."""
    file = figures / "search.png"
    names = [column(r.key).rpartition("_") for r in plan.vary]
    labels = [f"{name} [{unit.replace('per', '/')}]" for name, _, unit in names]
    target = plan.targets[0]

    def told(values: Sequence[float]) -> list[float]:
        return [as_told(r.key, v) for r, v in zip(plan.vary, values, strict=True)]

    if len(plan.vary) == 1:
        have = sorted((told(t.values)[0], t.answer.numbers[target.quantity]) for t in tried if t.answer.numbers)
        if not have:
            return []
        x, y = ([pair[i] for pair in have] for i in (0, 1))
        found = [(told(s.values)[0], s.answer.numbers[target.quantity]) for s in solutions]
        points = {"found": ([v for v, _ in found], [f for _, f in found])} if found else None
        lines(
            file, {target.quantity: (x, y)}, x=labels[0], y=f"{target.quantity} [{target.unit}]", title=design.name,
            points=points, levels={"wanted": target.value},
        )  # fmt: skip
        return [(file, f"{QUANTITIES[target.quantity][1]}, over {plan.vary[0].key}.")]
    if not solutions:
        return []
    pairs = sorted(told(s.values) for s in solutions)
    curve = {"gives it": ([a for a, _ in pairs], [b for _, b in pairs])}
    lines(file, curve, x=labels[0], y=labels[1], title=design.name, points=curve)
    return [(file, "Designs that give what is wanted.")]
