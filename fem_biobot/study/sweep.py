"""Sweeps: many designs, each done by the same job, by whatever workers there are; rows land as cases end.

A case is finished when its row lies in the folder ``cases``. Finished cases are never done again, however the sweep
ended, and also where its file has grown since; the table is made anew from the rows, so none is lost.

Cases share meshes, and solves begin at the states of a case near by. Which one that is follows from the sweep's file
alone (`sweep_forest`), and a case waits for it: rows do not tell who did them or in which order they ended. A case
whose neighbour failed begins from the undeformed body; where that failure says nothing about the design (no memory, a
worker that died), both are left to the next run. Rows that were made with another start are done again. In a folder
that holds finished cases already, new ones begin at those that the present file says; their rows agree with those of
the whole file done at once within the tolerance of states.
"""

from __future__ import annotations

import shutil
from bisect import insort
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fem_biobot.design import Design
from fem_biobot.errors import DiskError, FileError, SolveError
from fem_biobot.files import file_error, write_text
from fem_biobot.study.finding import Finding, examine
from fem_biobot.study.neighbour import kept_states
from fem_biobot.study.outputs import tables_folder, write_table
from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.study.sweep_case import CaseOrder, MeshOrder, begun_as, failed_row, kept_row, needs_mesh
from fem_biobot.study.sweep_file import Case, Start, SweepPlan, Task
from fem_biobot.study.sweep_findings import sweep_finding, sweep_rows
from fem_biobot.study.sweep_forest import Forest, forest
from fem_biobot.study.sweep_runner import LocalRunner, Runner

Rows = dict[str, dict[str, Any]]
MakeRunner = Callable[[Path], Runner]

# more cases than this have to wait for their neighbours to be found: time goes with the square of their number
_MANY = 2_000


def sweep(
    plan: SweepPlan,
    out: Path,
    *,
    runner: MakeRunner | None = None,
    force: bool = False,
    resume: bool = False,
    reporter: Reporter | None = None,
) -> dict[str, Any]:
    """Do every case of a plan that is not finished yet and write the sweep's folder.

    Parameters
    ----------
    plan
        What to do.
    out
        Folder of the result: ``cases/<key>/`` for each case, ``tables/cases.csv`` with a row for each that ended.
    runner
        Makes who does the cases, given the absolute folder; by default a process for each processor of this machine.
    force, resume
        As in `study.run.run`; `force` forgets finished cases too.
    reporter
        Told of cases, with rate and time left.

    Returns
    -------
    dict
        The summary, as in `summary.json`.

    Raises
    ------
    BiobotError
        A folder that holds something else, a full disk.
    SolveError
        No case at all came to a result; the rows say why.
    """
    reporter = reporter or Silent()

    def work(design: Design, figures: Path) -> Finding:
        cases, meshes = _folders(out, force)
        write_text(out / "sweep.toml", plan.text)
        rows = _carry_out(plan, cases, meshes, runner or (lambda folder: LocalRunner()), reporter)
        if not any(row["status"] == "done" for row in rows.values()):
            reasons = dict.fromkeys(row["reason"] for row in rows.values())
            raise SolveError(f"none of {len(plan.cases)} cases came to a result; the first: {next(iter(reasons), '')}")
        return sweep_finding(plan, rows, figures, cases)

    identity = {"sweep": plan.digest}
    return examine(
        plan.base, out, "sweep", work, kind="study", identity=identity, force=force, resume=resume, reporter=reporter
    )


def _folders(out: Path, force: bool) -> tuple[Path, Path]:
    """Folders of cases and meshes, absolute, emptied where all is to be done again."""
    found = out.absolute() / "cases", out.absolute() / "meshes"
    for folder in found:
        try:
            if force and folder.exists():
                shutil.rmtree(folder)
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise file_error(error, folder) from None
    return found


def _carry_out(plan: SweepPlan, cases: Path, meshes: Path, make: MakeRunner, reporter: Reporter) -> Rows:
    """Rows of all cases by key: those kept from before, and those that the runner brings."""
    rows: Rows = {}
    numbers: dict[str, int] = {}
    elsewhere = 0
    for case in plan.cases:
        if case.key in numbers:  # the same design once more
            continue
        numbers[case.key] = case.number
        row = _known(case, cases)
        if row is not None and case.design is not None and begun_as(row) != plan.start:
            elsewhere += 1
        elif row is not None:
            rows[case.key] = row
    if elsewhere:
        reporter.note(f'{elsewhere} finished cases did not begin as start = "{plan.start}" says: they are done again')
    if plan.start is Start.neighbour and len(numbers) > _MANY:
        reporter.stage("neighbours")
    trees = forest(plan.cases) if plan.start is Start.neighbour else Forest()
    again = _without_states(trees, rows, cases)
    for key in again:
        reporter.note(f"case {numbers[key]}: the states at which others begin are gone: they are made again")
    waiting = [
        CaseOrder(case.key, plan.task, case.design, cases, meshes, plan.start, trees.parent.get(case.key))
        for case in plan.cases
        if case.design is not None and case.number == numbers[case.key]
        if case.key not in rows or case.key in again
    ]
    before = sum(row["status"] == "done" for row in rows.values())
    if before:
        reporter.note(f"{before} of {len(numbers)} cases were finished before; they are not done again")
    table = tables_folder(cases.parent) / "cases.csv"
    write_table(table, sweep_rows(plan, rows))
    if not waiting:
        return rows
    _compile(plan.task, plan.base, reporter)
    runner = make(cases.parent)
    try:
        reporter.stage(f"cases to {plan.task.value}", len(waiting))
        for ended in _answers(runner, waiting, trees, rows):
            for key, row in ended.items():
                if row["status"] == "disk":
                    raise DiskError(row["reason"])
                rows.setdefault(key, row)
                if row["status"] == "failed":
                    reporter.note(f"case {numbers[key]}: {row['reason']}")
                reporter.advance(f"case {numbers[key]}")
            if ended:
                write_table(table, sweep_rows(plan, rows))
    finally:
        runner.close()
    return rows


def _without_states(trees: Forest, rows: Rows, cases: Path) -> set[str]:
    """Finished cases at whose states a case begins that is still to be done, and whose states cannot be read."""
    again: set[str] = set()
    for key in sorted(trees.rank, key=trees.rank.__getitem__, reverse=True):
        parent = trees.parent.get(key)
        if parent is None or (key in rows and key not in again) or parent in again:
            continue
        if rows.get(parent, {}).get("status") == "done":
            try:
                kept_states(cases / parent)
            except FileError:
                again.add(parent)
    return again


def _begun(order: CaseOrder, parent: Mapping[str, Any]) -> CaseOrder:
    """The order once its parent has ended: from the undeformed body where that came to nothing."""
    return order if parent["status"] == "done" else replace(order, parent=None)


def _left(after: dict[str, list[CaseOrder]], parent: str) -> Rows:
    """Rows of all cases that would have begun after one that is still to be done, taken out of those that wait."""
    found: Rows = {}
    for order in after.pop(parent, ()):
        found[order.key] = failed_row(order.key, "its neighbour is still to be done", again=True)
        found |= _left(after, order.key)
    return found


def _answers(runner: Runner, orders: Sequence[CaseOrder], trees: Forest, known: Rows) -> Iterator[Rows]:
    """Rows by key as cases end, some at a time.

    A mesh is asked for before the first case that needs it, and a case given out once its parent has ended.
    """

    def place(order: CaseOrder) -> int:
        return trees.rank.get(order.key, len(trees.rank))

    to_end = {order.key for order in orders}
    after: dict[str, list[CaseOrder]] = {}
    waiting: list[CaseOrder] = []
    for order in sorted(orders, key=place):
        if order.parent is None:
            waiting.append(order)
        elif order.parent in to_end:
            after.setdefault(order.parent, []).append(order)
        else:
            waiting.append(_begun(order, known[order.parent]))
    tried: set[Path] = set()
    asked: dict[str, Path] = {}
    under_way = 0

    def meshed(order: CaseOrder) -> bool:
        file = needs_mesh(order)
        return file is None or file in tried or file.exists()

    while waiting or under_way:
        while under_way < runner.capacity:
            order = next((o for o in waiting if meshed(o)), None)
            if order is not None:
                waiting.remove(order)
                runner.submit(order.key, order)
                under_way += 1
                continue
            order = next((o for o in waiting if needs_mesh(o) not in asked.values()), None)
            if order is None:
                break
            file = needs_mesh(order)
            assert file is not None
            asked[f"mesh_{file.stem}"] = file
            runner.submit(f"mesh_{file.stem}", MeshOrder(order.design, order.meshes))
            under_way += 1
        ended: Rows = {}
        for name, answer in runner.wait():
            under_way -= 1
            if name not in asked:
                ended[name] = failed_row(name, answer, again=True) if isinstance(answer, str) else answer
                if "again" in ended[name]:
                    ended |= _left(after, name)
                for order in after.pop(name, ()):
                    insort(waiting, _begun(order, ended[name]), key=place)
                continue
            tried.add(asked[name])
            if isinstance(answer, Mapping) and answer["status"] == "disk":
                raise DiskError(answer["reason"])
        yield ended


def _known(case: Case, cases: Path) -> dict[str, Any] | None:
    """What is known of a case without doing it: that there is no such design, or the row kept from before."""
    return failed_row(case.key, case.refused) if case.design is None else kept_row(cases, case.key)


def _compile(task: Task, design: Design, reporter: Reporter) -> None:
    """Compile once, before workers that would all do it at the same time."""
    if task is not Task.solve:
        from fem_biobot.rod.compiling import compile_kernels as compile_rods

        compile_rods(reporter)
    if task is not Task.walk:
        from fem_biobot.solid.compiling import compile_kernels as compile_solid

        compile_solid(reporter, design.mesh.element)
