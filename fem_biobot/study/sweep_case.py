"""One case of a sweep: done by the command's own job in a folder of its own, and kept as one row.

Runs in a worker, on this machine or elsewhere; knows nothing of other cases. The row is written last, so that a case
whose row exists is finished.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fem_biobot.design import Design
from fem_biobot.errors import BiobotError, DiskError, FileError
from fem_biobot.files import file_error, write_json
from fem_biobot.mesh.store import stored_file, stored_mesh
from fem_biobot.study.design_check import as_numbers, design_check
from fem_biobot.study.sweep_file import Start, Task

# one case at a time in a process, also where a cluster gives a worker several threads
_ALONE = threading.Lock()
_SOLID = (
    "tension_kPa", "muscle_force_mN", "eq3_force_mN", "tip_closing_mm", "tip_deflection_mm", "sagitta_mm",
    "fibre_stretch_1", "ball_von_mises_kPa", "strain_energy_uJ",
)  # fmt: skip
_STROKE = ("passive_closing_mm", "passive_force_mN", "stroke_mm", "stroke_force_mN", "natural_stretch_1")
_WALK = (
    "step_mm", "step_spread_mm", "speed_mm_per_s", "stroke_mm", "camera_stroke_mm", "slip_fraction_1",
    "passive_closing_mm", "active_force_mN", "weight_mN", "work_pillar_uJ", "work_walk_uJ", "efficiency_1",
    "mechanical_efficiency_1", "energy_error_1", "strokes_1",
)  # fmt: skip


@dataclass(frozen=True)
class CaseOrder:
    """What a worker is asked to do.

    Attributes
    ----------
    key
        Of the case.
    task
        Which job.
    design
        Of the case.
    cases, meshes
        Folders of the sweep, absolute: they must be the same for all workers.
    start
        Where solves of the sweep begin.
    parent
        Key of the finished case at whose states this solve begins; None where it begins from the undeformed body.
    """

    key: str
    task: Task
    design: Design
    cases: Path
    meshes: Path
    start: Start = Start.cold
    parent: str | None = None

    def perform(self) -> dict[str, Any]:
        """Do the case, keep its row and hand it back."""
        with _ALONE:
            return _performed(self)


@dataclass(frozen=True)
class MeshOrder:
    """A mesh that cases wait for."""

    design: Design
    meshes: Path

    def perform(self) -> dict[str, Any]:
        """Make the mesh; a failure is left to the cases, which meet it again and say so."""
        with _ALONE:
            try:
                stored_mesh(self.design, self.meshes)
            except DiskError as error:
                return {"status": "disk", "reason": str(error)}
            except BiobotError as error:
                return {"status": "failed", "reason": str(error)}
            return {"status": "done", "reason": ""}


def row_file(cases: Path, key: str) -> Path:
    """Where the row of a case is kept."""
    return cases / f"{key}.json"


def kept_row(cases: Path, key: str) -> dict[str, Any] | None:
    """Row of a finished case, or None.

    Raises
    ------
    FileError
        It is there and cannot be read.
    """
    file = row_file(cases, key)
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise file_error(error, file, doing="read") from None
    except ValueError as error:
        raise FileError(f"{file}: cannot be read ({error}), expected the row of a case; --force starts anew") from None


def needs_mesh(order: CaseOrder) -> Path | None:
    """File of the mesh that a case needs, None where it needs none."""
    return None if order.task is Task.walk else stored_file(order.design, order.meshes)


def begun_as(row: Mapping[str, Any]) -> str:
    """Where solves of the sweep began in which a row was made; rows that do not say are cold."""
    return row.get("start", Start.cold.value)


def failed_row(key: str, reason: str, *, again: bool = False) -> dict[str, Any]:
    """Row of a case that ended without a result; `again` where the next run is to do it once more."""
    return {
        "key": key, "status": "failed", "reason": reason, "outputs": {}, "check": [], "notes": [], "seconds_s": None,
        "newton_iterations_1": None, "parent": None, **({"again": True} if again else {}),
    }  # fmt: skip


def _performed(order: CaseOrder) -> dict[str, Any]:
    began = time.perf_counter()
    before: dict[str, Any] | None = None
    try:
        before = kept_row(order.cases, order.key)
        row = {**failed_row(order.key, ""), "status": "done", **_JOBS[order.task](order)}
    except DiskError as error:
        return {**failed_row(order.key, str(error)), "status": "disk"}
    except BiobotError as error:
        # a file may be mended, a design stays what it is
        row = failed_row(order.key, str(error), again=isinstance(error, FileError))
    except MemoryError:
        row = failed_row(order.key, "out of memory: give it fewer workers, or a larger mesh.size", again=True)
    except Exception as error:  # one case must not end the others
        row = failed_row(order.key, f"internal error: {type(error).__name__}: {error}", again=True)
    row |= {"seconds_s": round(time.perf_counter() - began, 3), "start": order.start.value}
    if before is not None and begun_as(before) == order.start:
        # done again for the states that it had lost: what was said of it stays, only children hear of a failure
        return before if row["status"] == "done" else row
    if "again" not in row:
        try:
            write_json(row_file(order.cases, order.key), row)
        except DiskError as error:
            return {**failed_row(order.key, str(error)), "status": "disk"}
    return row


def _solve(order: CaseOrder) -> dict[str, Any]:
    from fem_biobot.study.neighbour import Shared
    from fem_biobot.study.run import run

    beside = order.start is Start.neighbour
    shared = Shared(order.meshes, None if order.parent is None else order.cases / order.parent, sharp=beside)
    # a case that was interrupted begins anew, and so does one begun elsewhere before: half of one and half of another
    # would show in the last digits
    summary = run(order.design, order.cases / order.key, complete=False, shared=shared, force=True)
    states, own = summary["solid"]["states"], order.design.value("muscle.reference")
    stroke = (summary["solid"].get("stroke") or {}).get(own, {})
    prefix = "remodelled_" if own == "remodelled" else ""
    last = next((state for state in states if state["key"] == f"{prefix}peak"), states[-1])
    found = {name: stroke.get(name) for name in _STROKE if name in stroke}
    found |= {name: last[name] for name in _SOLID if last.get(name) is not None}
    if order.design.kind == "bot":
        found["touching"] = last["touching"]
    found["unknowns_1"] = summary["mesh"]["unknowns_1"]
    iterations = sum(state["newton_iterations_1"] for state in states)
    return {
        "outputs": found, "check": summary["design_check"], "notes": summary["notes"],
        "newton_iterations_1": iterations, "parent": order.parent,
    }  # fmt: skip


def _walk(order: CaseOrder) -> dict[str, Any]:
    from fem_biobot.study.walking import WalkPlan, walk_design

    drive = order.design.drive
    plan = WalkPlan((drive.frequency,), drive.duration, drive.amplitude)
    summary = walk_design(order.design, order.cases / order.key, plan, pictures=False)
    walked = summary["walks"][0]
    return {
        "outputs": {name: walked[name] for name in _WALK if name in walked},
        "check": as_numbers(design_check(order.design, walks=summary["walks"])),
        "notes": [*summary["notes"], *walked["notes"]],
    }


def _crosscheck(order: CaseOrder) -> dict[str, Any]:
    from fem_biobot.study.crosscheck import crosscheck_finding
    from fem_biobot.study.finding import Finding, examine
    from fem_biobot.study.reporter import Silent

    def work(design: Design, figures: Path) -> Finding:
        mesh, notes = stored_mesh(design, order.meshes)
        return crosscheck_finding(design, mesh, figures, Silent(), notes)

    summary = examine(order.design, order.cases / order.key, "crosscheck", work, mesh="generated", kind="")
    rows = [row for row in summary["crosscheck"]["rows"] if row["rods"] == "closed_form"]
    highest = max(row["tension_kPa"] for row in rows)
    found: dict[str, Any] = {"tension_kPa": highest}
    for row in rows:
        if row["tension_kPa"] == highest:
            found |= _beside(row)
    check = as_numbers(design_check(order.design))
    return {"outputs": found, "check": check, "notes": [*summary["notes"], *summary["remarks"]]}


def _beside(row: Mapping[str, Any]) -> dict[str, Any]:
    """A quantity in both models, as columns."""
    name = row["quantity"]
    words = name.split("_")[0] if name.count("_") == 1 else "_".join(name.split("_")[:-1])
    return {
        f"solid_{name}": row["solid_value"],
        f"rods_{name}": row["rods_value"],
        f"{words}_difference_1": row["difference_1"],
    }


_JOBS = {Task.solve: _solve, Task.walk: _walk, Task.crosscheck: _crosscheck}
