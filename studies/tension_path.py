"""Study: the whole tension path of the junction bot, and what each part of it costs.

Question
--------
Does one path of load steps take the machine from rest to a tension of 14 kPa, where its muscle has shortened by four
tenths, in the same few factorisations on a coarse, a default and a fine mesh; what if it is asked to go half-way at
once, or all the way back; and what would plain Newton do?

Run: ``python studies/tension_path.py [--level smoke|full] [--out FOLDER]``; about a minute at level full.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import SolveError
from fem_biobot.files import replacing
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.progress import show_tables
from fem_biobot.solid import direct, linear, path
from fem_biobot.solid.from_design import tension_step
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, SolidSolution, SolidState, solve
from fem_biobot.solid.newton import NewtonSettings, Trial
from fem_biobot.solid.sharing import usable_threads
from fem_biobot.solid.system import Points, System
from fem_biobot.study.outputs import write_table
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

DESIGN = "junction_bot"
PEAK = 14.0  # kPa
OUTPUTS = 9
# sizes of the committed meshes [mm]: small, the preset's own, fine
SIZES = {"smoke": (2.0,), "full": (2.0, 0.9, 0.55)}
# where plain Newton is shown on the nine outputs; a level without them has one short path of it
PLAIN_SIZES: dict[str, tuple[float, ...]] = {"smoke": (), "full": (2.0, 0.9)}
NINE = tuple(PEAK * k / OUTPUTS for k in range(1, OUTPUTS + 1))
PLAIN_FROM_LAST = "plain, from last"
HALF_AT_ONCE = {
    "smoke": (PEAK / 2, PEAK),
    "full": tuple(PEAK / 2 + PEAK / 2 * k / (OUTPUTS - 1) for k in range(OUTPUTS)),
}
# plain Newton may go on for as long as this, so that its iterations are counted and not its halved steps
PATIENT = NewtonSettings(max_iterations=60)

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# Counted are factorisations, Newton and conjugate-gradient iterations along the path: whole numbers that do not depend
# on the machine and that tend to constants on finer meshes, because the iteration converges in the function space and
# not on a mesh. Seconds are given beside those of one factorisation of the same matrix in the same run, which makes
# them comparable between machines; no expectation is put on seconds. The fibre stretch is a volume mean over the middle
# of the junction, away from corners, and converges with the mesh.
#
# Plain Newton is had by letting the tangent use the stress of the present iterate, whatever stress is carried to it;
# everything else (steps, predictor, factorisations, tolerance) stays the same.


@dataclass
class Clock:
    """Seconds and calls by part."""

    seconds: dict[str, float] = field(default_factory=dict)
    each: dict[str, list[float]] = field(default_factory=dict)

    def add(self, part: str, seconds: float) -> None:
        self.seconds[part] = self.seconds.get(part, 0.0) + seconds
        self.each.setdefault(part, []).append(seconds)

    def of(self, part: str) -> float:
        return self.seconds.get(part, 0.0)


@contextmanager
def replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    """An attribute of a class or module replaced for a while."""
    before = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


@contextmanager
def timed(clock: Clock) -> Iterator[None]:
    """Time the parts of every solve within."""
    factorising = linear.SuperLU if linear.pardiso_missing() else linear.Pardiso
    parts = [
        (System, "deformation_gradient", "law"),
        (System, "points", "law"),
        (System, "internal_force", "residual"),
        (System, "tangent", "tangent"),
        (factorising, "factor", "factor"),
        (direct, "conjugate_gradients", "cg"),
    ]
    with ExitStack() as stack:
        for owner, name, part in parts:
            stack.enter_context(replaced(owner, name, _timing(getattr(owner, name), part, clock)))
        yield


def _timing(action: Any, part: str, clock: Clock) -> Any:
    def watched(*args: Any, **kwargs: Any) -> Any:
        begin = time.perf_counter()
        try:
            return action(*args, **kwargs)
        finally:
            clock.add(part, time.perf_counter() - begin)

    return watched


@contextmanager
def plain_newton() -> Iterator[None]:
    """Newton's method whose geometric stiffness uses the stress of the present iterate, not the carried one."""
    points, tangent = System.points, System.tangent
    latest: list[Points] = []

    def remembered(self: System, F: np.ndarray, *given: Any, **kwargs: bool) -> Points:
        found = points(self, F, *given, **kwargs)
        latest[:] = [*latest[-2:], found]
        return found

    def present(self: System, F: np.ndarray, S: np.ndarray, D: np.ndarray) -> np.ndarray:
        return tangent(self, F, next(found.S for found in latest if found.F is F), D)

    with replaced(System, "points", remembered), replaced(System, "tangent", present):
        yield


@contextmanager
def from_last_state() -> Iterator[None]:
    """Steps that begin at the last state instead of the predictor's extrapolation."""
    with replaced(path, "predict", lambda system, history, goal: Trial(history[-1].u, None, history[-1].p)):
        yield


# --- run --------------------------------------------------------------------------------------------------------------


@dataclass
class Study:
    """Tables of a run: one row a path, one row an output, and the residuals of every step."""

    paths: list[Row] = field(default_factory=list)
    outputs: list[Row] = field(default_factory=list)
    residuals: dict[str, list[list[float]]] = field(default_factory=dict)


def run(level: str) -> Study:
    """All paths on all meshes of a level."""
    design = load_design(DESIGN)
    study = Study()
    for size in SIZES[level]:
        mesh = committed_mesh(design, size)
        assert mesh is not None, f"no committed mesh of {DESIGN}"
        model, measurer = _machine(design, mesh)
        solve(model, [tension_step(design, 0.1)])  # load what is compiled before anything is timed
        _walk(study, design, model, measurer, size, "nine outputs", NINE)
        _walk(study, design, model, measurer, size, "7 kPa at once", HALF_AT_ONCE[level])
        last = study.outputs[-1]
        _walk(study, design, model, measurer, size, "back to 0 at once", (0.0,), last["states"], last["tip_closing_mm"])
        if not PLAIN_SIZES[level]:
            with plain_newton(), from_last_state():
                _walk(
                    study, design, model, measurer, size, "7 kPa at once", HALF_AT_ONCE[level], method=PLAIN_FROM_LAST
                )
        if size in PLAIN_SIZES[level]:
            with plain_newton():
                _walk(study, design, model, measurer, size, "nine outputs", NINE, method="plain, predicted")
                with from_last_state():
                    _walk(study, design, model, measurer, size, "nine outputs", NINE, method=PLAIN_FROM_LAST)
            with from_last_state():
                _walk(study, design, model, measurer, size, "nine outputs", NINE, method="carried, from last")
    for row in study.outputs:
        row.pop("states", None)
    return study


def _machine(design: Design, mesh: BodyMesh) -> tuple[SolidModel, Measurer]:
    model = SolidModel.from_design(design, mesh)
    return model, Measurer(design, model)


def _walk(
    study: Study,
    design: Design,
    model: SolidModel,
    measurer: Measurer,
    size: float,
    name: str,
    tensions: Sequence[float],
    start: Sequence[SolidState] = (),
    closing: float | None = None,
    method: str = "carried stress",
) -> None:
    """One path: solve, count, time, and add its rows to the study."""
    clock, history = Clock(), []
    key = f"{size} mm, {name}, {method}"

    def observe(kind: str, values: dict[str, float]) -> None:
        if kind == "iteration":
            if values["iteration"] == 0:
                history.append([])
            history[-1].append(values["residual"])

    failure = ""
    begin = time.perf_counter()
    with timed(clock):
        try:
            found = solve(
                model,
                [tension_step(design, tension) for tension in tensions],
                settings=PATIENT if method.startswith("plain") else None,
                start=start,
                observe=observe,
            )
        except SolveError as error:
            failure, found = str(error), error.best
    seconds = time.perf_counter() - begin
    states = found.states if isinstance(found, SolidSolution) else ()
    for tension, state in zip(tensions, states, strict=False):
        study.outputs.append(
            {
                "size_mm": size,
                "path": name,
                "method": method,
                "tension_kPa": tension,
                "fibre_stretch_1": measurer.fibre_stretch(state),
                "tip_closing_mm": measurer.tip_closing(state),
                "newton_1": state.newton_iterations,
                "factorisations_1": state.factorisations,
                "cg_1": state.cg_iterations,
                "states": states[-4:],
            }
        )
    one = float(np.median(clock.each.get("factor", [np.nan])))
    parts = {part: clock.of(part) for part in ("law", "residual", "tangent", "factor", "cg")}
    study.paths.append(
        {
            "size_mm": size,
            "unknowns_1": model.n_dofs,
            "path": name,
            "method": method,
            "outputs_1": len(states),
            "factorisations_1": found.factorisations,
            "newton_1": found.newton_iterations,
            "most_a_step_1": max((len(residuals) - 1 for residuals in history), default=0),
            "cg_1": found.cg_iterations,
            "halvings_1": found.halvings,
            "fibre_stretch_1": measurer.fibre_stretch(states[-1]) if states else None,
            "remaining_1": float(np.abs(states[-1].u).max()) / closing if closing and states else None,
            "seconds_s": seconds,
            **{f"{part}_s": value for part, value in parts.items()},
            "rest_s": seconds - sum(parts.values()),
            "one_factorisation_s": one,
            "ratio_1": seconds / one,
            "failure": failure,
        }
    )
    study.residuals[key] = history


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study) -> None:
    """What must hold at every level."""
    ours = [row for row in study.paths if row["method"] == "carried stress"]
    assert ours, "no path was run"
    for row in ours:
        where = f"{row['size_mm']} mm, {row['path']}"
        assert not row["failure"], f"{where}: {row['failure']}"
        assert row["factorisations_1"] <= 30, f"{where}: {row['factorisations_1']} factorisations"
    for name in ("nine outputs", "7 kPa at once"):
        rows = [row for row in ours if row["path"] == name]
        counts = [row["factorisations_1"] for row in rows]
        assert max(counts) - min(counts) <= 2, f"{name}: factorisations differ between meshes, {counts}"
    ends = {row["size_mm"]: [] for row in ours}
    for row in ours:
        if row["path"] != "back to 0 at once":
            ends[row["size_mm"]].append(row["fibre_stretch_1"])
    for size, (nine, half) in ends.items():
        # the same state along two paths: to ten times the tolerance of the residual
        assert abs(nine - half) < 1e-8, f"{size} mm: two paths end at stretches {nine} and {half}"
        assert 0.56 < nine < 0.60, f"{size} mm: fibre stretch {nine:.4f} at {PEAK:g} kPa"
    for row in ours:
        if row["path"] == "back to 0 at once":
            assert row["remaining_1"] < 1e-8, f"{row['size_mm']} mm: {row['remaining_1']:.2g} of the closing remains"
    for plain in (row for row in study.paths if row["method"].startswith("plain")):
        carried = next(row for row in ours if (row["size_mm"], row["path"]) == (plain["size_mm"], plain["path"]))
        # why the stress is carried: without it the same path takes far more iterations, or ends
        worse = bool(plain["failure"]) or plain["newton_1"] > 1.5 * carried["newton_1"]
        where = f"{plain['size_mm']} mm, {plain['method']}"
        assert worse, f"{where}: {plain['newton_1']} iterations, carried stress {carried['newton_1']}"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Two cores shared with other work, two threads; meshes of 18 816, 61 617 and 146 757 unknowns.

* Nine outputs from 0 to 14 kPa: 12, 13 and 14 factorisations in single precision on the three meshes, 27, 26 and 30
  Newton iterations, 156, 151 and 193 of conjugate gradients, no step halved. Whether a state is stable is told by
  conjugate gradients with the factor at hand. The fibres end at a stretch of 0.5826, 0.5813 and 0.5808. What follows
  was found when all factors were in double precision, the predictor quadratic, and every state factored once more to
  see that it is stable: then the same outputs took 20 factorisations on all three meshes, and 30 to 32 Newton
  iterations.
* Asked to go to 7 kPa at once, and on to 14 in the remaining outputs: 26, 26 and 28 factorisations, 31, 31 and 34
  Newton iterations. "At once" is what the caller asks; the path goes in two steps of its own, of which one or two are
  halved. The end is the same state.
* Back from 14 to 0 in one step: 10, 15 and 13 factorisations with one to three steps halved; 8e-10, 5e-10 and 9e-10
  of the largest closing remain.
* Why the stress is carried: plain Newton takes 68 iterations, 44 factorisations and ten halved steps from the
  predictor's displacement, and 54 iterations and 28 factorisations from the last state, where 30 and 20 do with
  carried stress, the same on both meshes tried. Most of the gain is the predictor's, which is good only with the
  stress carried through it: from the last state, carried stress takes 45 iterations. No step needed more than seven
  iterations with either, since long steps are divided beforehand.
* The nine outputs cost as much as 60, 42 and 32 factorisations on the three meshes (one takes 0.11, 0.34 and 2.5 s).
  On the fine mesh two thirds of the time are factorisations, a sixth conjugate gradients, a ninth the tangent, and
  one part in forty law and residual. One iteration of conjugate gradients costs a seventh of a factorisation on the
  small mesh, a fifteenth on the default and a twenty-fifth on the fine one.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
Other designs and laws, Poisson's ratios nearer to one half, meshes beyond 150 000 unknowns, plain Newton without the
division of long steps, seconds on an idle machine.
"""


def tables(study: Study) -> list[Table]:
    """What is printed."""
    counts = ("size_mm", "path", "method", "outputs_1", "factorisations_1", "newton_1", "most_a_step_1", "cg_1")
    counts += ("halvings_1", "fibre_stretch_1", "remaining_1")
    seconds = ("size_mm", "path", "method", "law_s", "residual_s", "tangent_s", "factor_s", "cg_s", "rest_s")
    seconds += ("seconds_s", "one_factorisation_s", "ratio_1")
    shown = [
        Table("Work", counts, tuple(tuple(row[c] for c in counts) for row in study.paths)),
        Table("Seconds", seconds, tuple(tuple(row[c] for c in seconds) for row in study.paths)),
    ]
    failed = [(row["size_mm"], row["method"], row["failure"]) for row in study.paths if row["failure"]]
    if failed:
        shown.append(Table("Paths that ended early", ("size_mm", "method", "why"), tuple(failed)))
    return shown


def write(study: Study, folder: Path) -> None:
    """CSV of paths and outputs, and a picture of the path and of the iterations."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "paths.csv", study.paths)
    write_table(folder / "outputs.csv", study.outputs)
    figure = Figure(figsize=(10.0, 4.0), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    for size in dict.fromkeys(row["size_mm"] for row in study.outputs):
        rows = [
            row
            for row in study.outputs
            if row["size_mm"] == size and row["path"] == "nine outputs" and row["method"] == "carried stress"
        ]
        at = [0.0, *(row["tension_kPa"] for row in rows)]
        left.plot(
            at, [1.0, *(row["fibre_stretch_1"] for row in rows)], "-o", markersize=3, label=f"mesh size {size} mm"
        )
    left.set_xlabel("nominal tension [kPa]")
    left.set_ylabel("fibre stretch, middle of the junction [1]")
    left.legend(frameon=False)
    plain = [row["size_mm"] for row in study.paths if row["method"].startswith("plain")]
    shown = min(plain or [row["size_mm"] for row in study.paths])
    for number, method in enumerate(("carried stress", "plain, predicted", "plain, from last")):
        done = 0
        for step, residuals in enumerate(study.residuals.get(f"{shown} mm, nine outputs, {method}", [])):
            at = done + np.arange(len(residuals))
            right.semilogy(at, residuals, "-", color=f"C{number}", linewidth=1.0, label=None if step else method)
            done += len(residuals)
    right.set_xlabel(f"iterations along the path, mesh size {shown} mm")
    right.set_ylabel("residual / force scale [1]")
    right.legend(frameon=False)
    with replacing(folder / "tension_path.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--level", choices=tuple(SIZES), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "tension_path")
    options = parser.parse_args()
    study = run(options.level)
    show_tables(tables(study))
    write(study, options.out)
    name = "SuperLU" if linear.pardiso_missing() else "PARDISO"
    print(f"\n{usable_threads()} threads assemble; factorisation by {name}; files in {options.out}")
    expect(study)
    print("every expectation holds")


if __name__ == "__main__":
    main()
