"""Interactive views of a sweep: the cases with the largest and the smallest number, from what their folders hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.errors import BiobotError, FileError
from fem_biobot.study.outputs import standing
from fem_biobot.study.sweep_file import Case, SweepPlan, Task
from fem_biobot.view.interactive import Moving, Piece
from fem_biobot.view.machine import Machine, Shape
from fem_biobot.view.moving import machine_view
from fem_biobot.view.report import views_of
from fem_biobot.vtk import read_vtu

Row = Mapping[str, Any]

# states of a solve that are shown, in order; those of remodelled tissue where the design has it
_KEYS = ("passive", "peak")


def sweep_views(
    plan: SweepPlan, rows: Sequence[Row], number: str | None, spelt: str, cases: Path
) -> tuple[list[Moving | Piece], list[str]]:
    """Views of the extreme cases, and notes on those that cannot be shown.

    Parameters
    ----------
    plan
        The sweep.
    rows
        Of the table, those of finished cases.
    number
        Which of their numbers is looked at; None leaves all out.
    spelt
        That number for a reader, its unit in brackets at the end.
    cases
        Folder of the cases.
    """
    have = [row for row in rows if number is not None and isinstance(row.get(number), int | float)]
    if number is None or not have:
        return [], []
    ordered = sorted(have, key=lambda row: float(row[number]))
    low, high = ordered[0], ordered[-1]
    by_number = {case.number: case for case in plan.cases}
    found: list[Moving | Piece] = []
    notes = []
    for word, row in (("largest", high), ("smallest", low)) if high is not low else (("only", high),):
        case = by_number[int(row["case"])]
        what, _, unit = spelt.partition(" [")
        title = f"Case {case.number}: {word} {what}, {float(row[number]):.4g} {unit.rstrip(']')}".rstrip()
        try:
            found += [replace(each, title=title) for each in _SHOWN[plan.task](case, cases / case.key)]
        except BiobotError as error:
            notes.append(f"case {case.number}: not shown in 3D: {error}")
    return found, notes


def solved_view(folder: Path, reference: str, *, stands: bool) -> Moving:
    """Passive state and full drive of a solve, from its files; a body without these, in all its states.

    Parameters
    ----------
    folder
        Of the result: ``solid_NN_<state>.vtu``.
    reference
        Of the tissue: ``remodelled`` shows the states of that name.
    stands
        Whether the body is shown on its feet.

    Raises
    ------
    FileError
        A file is missing or none of ours.
    """
    files = {file.stem.split("_", 2)[2]: file for file in sorted(folder.glob("solid_*.vtu"))}
    prefix = "remodelled_" if reference == "remodelled" else ""
    wanted = [key for key in (f"{prefix}{key}" for key in _KEYS) if key in files] or list(files)
    if not wanted:
        raise FileError(f"{folder}: found no solid_*.vtu, expected the states of a solve")
    rest = next((key for key in ("rest", "load_0") if key in files), None)
    keys = wanted if rest is None or rest in wanted else [rest, *wanted]
    read = [_state(files[key]) for key in keys]
    points, cells, muscle, _, _ = read[0]
    regions = {"muscle": np.flatnonzero(muscle)} if muscle.any() else {}
    machine = Machine(points, cells, regions)
    shapes = [
        Shape(key, key.replace("_", " "), standing(points + u) - points if stands else u, stress)
        for key, (_, _, _, u, stress) in zip(keys, read, strict=True)
    ]
    return machine_view(machine, shapes, title=folder.name, from_rest=rest is not None)


def _state(file: Path) -> tuple[Any, Any, Any, Any, Any]:
    """Points (3, n), cells (10, e), which cells are muscle (e,), displacement (3, n), von Mises stress (e,)."""
    points, cells, at_points, at = read_vtu(file)
    missing = {"displacement_mm"}.difference(at_points) | {"von_mises_kPa"}.difference(at)
    if missing:
        raise FileError(f"{file}: found no {sorted(missing)[0]}, expected a state of a solve")
    fibres = at.get("fibre_direction_1", np.zeros((3, cells.shape[1])))
    return points, cells, np.linalg.norm(fibres, axis=0) > 0.5, at_points["displacement_mm"], at["von_mises_kPa"]


def _solved(case: Case, folder: Path) -> list[Moving | Piece]:
    assert case.design is not None
    reference = str(case.design.value("muscle.reference")) if case.design.muscle is not None else "as_moulded"
    return [solved_view(folder, reference, stands=case.design.kind == "bot")]


def _walked(case: Case, folder: Path) -> list[Moving | Piece]:
    """The walk once more: its case keeps numbers alone."""
    from fem_biobot.rod.walk import walk
    from fem_biobot.study.views import walk_view

    assert case.design is not None
    drive = case.design.drive
    return [walk_view(walk(case.design, frequency=drive.frequency, duration=drive.duration))]


def _compared(case: Case, folder: Path) -> list[Moving | Piece]:
    found: list[Moving | Piece] = [*views_of(folder / "report.html")]
    return found[:1]


_SHOWN = {Task.solve: _solved, Task.walk: _walked, Task.crosscheck: _compared}
