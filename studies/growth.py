"""Study: how time and memory of a solve grow with the mesh, with a factor of the whole matrix and without.

Question
--------
What do time, peak memory and iterations of one and the same contraction do from 20 000 to a million unknowns; where do
conjugate gradients on two levels overtake the factor; and do their iterations stay bounded?

Run: ``python studies/growth.py [--level smoke|full] [--out FOLDER]``; level full takes a quarter of an hour, needs Gmsh
and 6 GiB of memory.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fem_biobot.config import load_design
from fem_biobot.files import replacing
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.mesh.geometry import build_mesh
from fem_biobot.progress import show_tables
from fem_biobot.solid.from_design import tension_step
from fem_biobot.solid.linear import conjugate_gradients
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, SolidState, linear_solver, solve
from fem_biobot.solid.multigrid.solver import TwoLevelSolver
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.study.outputs import write_table
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

DESIGN = "junction_bot"
# mesh sizes [mm]: about 19 000, 62 000, 147 000, 300 000 and 1 000 000 unknowns; the last two are made by Gmsh
SIZES = {"smoke": (2.0, 0.9), "full": (2.0, 0.9, 0.55, 0.375, 0.233)}
FINEST_FACTORED = {"smoke": 2.0, "full": 0.375}
COMMITTED = (2.0, 0.9, 0.55)
# tensions [kPa]; the machine is half closed at the second
TENSIONS = {"smoke": (0.3,), "full": (1.0, 2.0)}
TOLERANCE = 1e-8
# Poisson's ratios of the tissue beside the design's own 0.47, and the finest mesh that they are tried on
OTHER_POISSON = {"smoke": (), "full": (0.3, 0.49)}
FINEST_OTHER = 0.55
DIRECT, ITERATIVE = "direct", "iterative"
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# The junction bot on ever finer meshes of the same size everywhere, contracting to 2 kPa, every state to a residual of
# 1e-8 and seen to be stable. Each size and way is a process of its own on one processor, so that its peak memory is
# its own and processor time measures it whatever else the machine does; meshes are made before, in other processes.
# Memory is the largest resident set, of which the interpreter with its libraries takes some 0.2 GiB at every size.
#
# Time and memory above that are fitted by powers of the number of unknowns. A factor by nested dissection in three
# dimensions takes n^2 operations and n^(4/3) memory as n grows; here bodies are thin, which is kinder. Whatever
# iterates a bounded number of times takes time and memory of order n.
#
# Iterations are counted on one system, the tangent of the last state with a generic right-hand side, to 1e-8: those
# within Newton's method stop at tolerances that depend on how it goes.


# --- run --------------------------------------------------------------------------------------------------------------


@dataclass
class Study:
    """One row a size and way, the same of other Poisson's ratios, and fitted exponents."""

    rows: list[Row] = field(default_factory=list)
    others: list[Row] = field(default_factory=list)
    exponents: list[Row] = field(default_factory=list)

    def of(self, way: str) -> list[Row]:
        return [row for row in self.rows if row["way"] == way]


def run(level: str) -> Study:
    """All sizes, one process each."""
    study = Study()
    with tempfile.TemporaryDirectory() as folder:
        files = {size: _mesh_file(size, Path(folder)) for size in SIZES[level]}
        for size, file in files.items():
            for way in (DIRECT, ITERATIVE):
                if way == ITERATIVE or size >= FINEST_FACTORED[level]:
                    study.rows.append(_alone("--solve", str(file), way, level))
                    print(_line(study.rows[-1]), file=sys.stderr, flush=True)
        for poisson in OTHER_POISSON[level]:
            for size, file in files.items():
                if size >= FINEST_OTHER:
                    study.others.append(_alone("--solve", str(file), ITERATIVE, level, str(poisson)))
    study.exponents = _exponents(study)
    return study


def _line(row: Row) -> str:
    return f"{row['way']}, {row['unknowns_1']} unknowns: {row['solve_s']:.1f} s, {row['peak_GiB']:.2f} GiB"


def _alone(*arguments: str) -> Row:
    """What a process of its own prints last."""
    search = os.pathsep.join(path for path in sys.path if path)
    done = subprocess.run(
        [sys.executable, str(Path(__file__).resolve()), *arguments],
        env={**os.environ, **ONE_THREAD, "PYTHONPATH": search},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


def _mesh_file(size: float, folder: Path) -> Path:
    """The mesh of a size on disk: committed, or made by Gmsh."""
    file = folder / f"{size}.npz"
    if size in COMMITTED:
        _write_mesh(size, file)
    else:
        _alone("--mesh", str(size), str(file))
    return file


def _write_mesh(size: float, file: Path) -> None:
    design = load_design(DESIGN)
    mesh = committed_mesh(design, size) if size in COMMITTED else build_mesh(design, size)
    assert mesh is not None, f"no committed mesh of {DESIGN}"
    parts: dict[str, Any] = {"points": mesh.points, "cells": mesh.cells}
    for kind in ("regions", "surfaces", "landmarks"):
        parts |= {f"{kind}.{name}": value for name, value in getattr(mesh, kind).items()}
    np.savez(file, **parts)


def _read_mesh(file: Path) -> BodyMesh:
    with np.load(file) as parts:
        named: dict[str, dict[str, Any]] = {"regions": {}, "surfaces": {}, "landmarks": {}}
        for key in parts.files:
            kind, _, name = key.partition(".")
            if kind in named:
                named[kind][name] = int(parts[key]) if kind == "landmarks" else parts[key]
        return BodyMesh(parts["points"], parts["cells"], **named)


def measure(file: Path, way: str, level: str, poisson: str = "") -> Row:
    """One contraction in this process."""
    design = load_design(DESIGN, [f"muscle.material.poisson={poisson}"] if poisson else [])
    begin = time.process_time()
    model = SolidModel.from_design(design, _read_mesh(file))
    system = model.system
    setup = time.process_time() - begin
    settings = NewtonSettings(tolerance=TOLERANCE, linear=way)
    solver = linear_solver(model, settings)
    begin = time.process_time()
    found = solve(model, [tension_step(design, T) for T in TENSIONS[level]], settings=settings, solver=solver)
    taken = time.process_time() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return {
        "way": way,
        "poisson_1": design.value("muscle.material.poisson"),
        "unknowns_1": model.n_dofs,
        "elements_1": model.mesh.n_elements,
        "entries_1": len(system.pattern.columns),
        "setup_s": setup,
        "solve_s": taken,
        "peak_GiB": peak,
        "newton_1": found.newton_iterations,
        "factorisations_1": found.factorisations,
        "cg_1": found.cg_iterations,
        "residual_1": max(state.residual for state in found.states),
        "tip_closing_mm": Measurer(design, model).tip_closing(found.last),
        "cg_of_one_1": _iterations(found.last, solver) if isinstance(solver, TwoLevelSolver) else None,
        "linear_solver": found.linear_solver,
    }


def _iterations(state: SolidState, solver: TwoLevelSolver) -> int:
    """Iterations that reduce a generic residual by 1e-8 at a state, with a preconditioner made there."""
    system = state.model.system
    points = system.points(state.F, state.step.tension)
    data = system.matrix(points, points.S)
    system.block(data)
    b = np.random.default_rng(3).normal(size=system.n_dofs)
    b[system.held.dofs] = 0.0
    solver.levels.renew(data)
    solve_levels = solver.levels.solve
    return conjugate_gradients(system.pattern, data, b, solve_levels, tolerance=1e-8, max_iterations=400)[1]


def _exponents(study: Study) -> list[Row]:
    """Least squares of logarithms over the unknowns; memory above that of the interpreter, taken as 0.2 GiB."""
    out = []
    for way in (DIRECT, ITERATIVE):
        rows = study.of(way)
        if len(rows) < 2:
            continue
        n = np.log([row["unknowns_1"] for row in rows])
        row: Row = {"way": way, "sizes_1": len(rows)}
        for name, values in (
            ("setup", [r["setup_s"] for r in rows]),
            ("solve", [r["solve_s"] for r in rows]),
            ("memory", [max(r["peak_GiB"] - 0.2, 1e-3) for r in rows]),
        ):
            row[f"{name}_exponent_1"] = float(np.polyfit(n, np.log(values), 1)[0])
        out.append(row)
    return out


# --- expect -----------------------------------------------------------------------------------------------------------

# peak at the finest mesh [GiB]
_MOST_MEMORY = 14.0


def expect(study: Study, level: str) -> None:
    """Every state converged, both ways agree, iterations bounded; how it grows where there are sizes enough."""
    for row in (*study.rows, *study.others):
        assert row["residual_1"] <= TOLERANCE, f"{_line(row)}: residual {row['residual_1']:.2g}"
    for row in study.of(DIRECT):
        other = next(r for r in study.of(ITERATIVE) if r["unknowns_1"] == row["unknowns_1"])
        apart = abs(row["tip_closing_mm"] - other["tip_closing_mm"]) / row["tip_closing_mm"]
        # a hundred times the residual's tolerance: soft directions turn a small force into a larger displacement
        assert apart < 100.0 * TOLERANCE, f"{_line(row)}: the two ways differ by {apart:.2g} of the closing"
    counts = [row["cg_of_one_1"] for row in study.of(ITERATIVE)]
    assert all(later <= 1.25 * counts[0] for later in counts), f"iterations grow with the mesh: {counts}"
    if level == "smoke":
        return
    largest = study.of(ITERATIVE)[-1]
    assert largest["unknowns_1"] > 1_000_000, f"only {largest['unknowns_1']} unknowns"
    assert largest["peak_GiB"] < _MOST_MEMORY, f"{largest['peak_GiB']:.1f} GiB at {largest['unknowns_1']} unknowns"
    growth = next(row for row in study.exponents if row["way"] == ITERATIVE)
    assert growth["solve_exponent_1"] < 1.25, f"time grows with the power {growth['solve_exponent_1']:.2f}"
    assert growth["memory_exponent_1"] < 1.1, f"memory grows with the power {growth['memory_exponent_1']:.2f}"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Two cores shared with much other work, processor seconds of one thread, both states together; each row measured by this
program in a process of its own, the rows in several sittings; that both ways end alike was compared at 18 816 unknowns.

* On two levels, 18 816, 61 617, 146 757, 331 824 and 1 091 280 unknowns: 2.0, 5.6, 14.0, 35.7 and 148 s; 0.30, 0.43,
  0.67, 1.16 and 3.25 GiB at most. Powers of the unknowns: 1.06 in time, 0.84 in memory above the interpreter's (0.94
  from the third mesh to the last). The residuals are below 1e-9, asked for 1e-8; six factorisations of the
  linear tetrahedra and ten Newton iterations on every mesh.
* Iterations on one system do not grow with the mesh, they fall: 52, 34, 28, 25 and 23; all of them together 292, 214,
  197, 184 and 180.
* Factored in single precision, the first four meshes: 1.2, 3.9, 12.6 and 44 s; 0.33, 0.56, 1.04 and 2.27 GiB; powers
  1.25 and 0.96.
* So the factor is as fast up to about 200 000 unknowns and takes twice the memory at 330 000, where the two levels take
  a fifth less time: the automatic choice changes at 300 000.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
The other Poisson's ratios at level full, meshes refined towards corners, other machines, more than one thread, the
mixed element (which is always factored).
"""


def tables(study: Study) -> list[Table]:
    """What is printed."""
    header = ("way", "poisson_1", "unknowns_1", "elements_1", "setup_s", "solve_s", "peak_GiB", "newton_1")
    header += ("factorisations_1", "cg_1", "cg_of_one_1", "tip_closing_mm", "residual_1")
    shown = [Table("Growth, one thread", header, tuple(tuple(row[c] for c in header) for row in study.rows))]
    if study.others:
        rows = tuple(tuple(row[c] for c in header) for row in study.others)
        shown.append(Table("Other Poisson's ratios of the tissue", header, rows))
    header = ("way", "sizes_1", "setup_exponent_1", "solve_exponent_1", "memory_exponent_1")
    if study.exponents:
        rows = tuple(tuple(row[c] for c in header) for row in study.exponents)
        shown.append(Table("Fitted powers of the unknowns", header, rows))
    return shown


def write(study: Study, folder: Path) -> None:
    """CSV and a picture of time, memory and iterations."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "growth.csv", [*study.rows, *study.others])
    figure = Figure(figsize=(11.0, 3.8), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 3)
    slopes = {row["way"]: row for row in study.exponents}
    for number, way in enumerate((DIRECT, ITERATIVE)):
        rows = study.of(way)
        n = [row["unknowns_1"] for row in rows]
        for axes, key, name in ((panels[0], "solve_s", "solve"), (panels[1], "peak_GiB", "memory")):
            power = f", power {slopes[way][f'{name}_exponent_1']:.2f}" if way in slopes else ""
            axes.loglog(n, [row[key] for row in rows], "-o", color=f"C{number}", markersize=4, label=way + power)
    for poisson in dict.fromkeys(row["poisson_1"] for row in (*study.of(ITERATIVE), *study.others)):
        rows = [r for r in (*study.of(ITERATIVE), *study.others) if r["poisson_1"] == poisson]
        n, counts = [row["unknowns_1"] for row in rows], [row["cg_of_one_1"] for row in rows]
        panels[2].semilogx(n, counts, "-o", markersize=4, label=f"Poisson's ratio {poisson:g}")
    for axes, label in zip(panels, ("processor seconds", "peak memory [GiB]", "iterations to 1e-8"), strict=True):
        axes.set_xlabel("unknowns")
        axes.set_ylabel(label)
        axes.legend(frameon=False, fontsize=8)
    panels[2].set_ylim(bottom=0.0)
    with replacing(folder / "growth.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--level", choices=tuple(SIZES), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "growth")
    parser.add_argument("--solve", nargs="+", help=argparse.SUPPRESS)
    parser.add_argument("--mesh", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.mesh:
        _write_mesh(float(options.mesh[0]), Path(options.mesh[1]))
        print("{}")
        return
    if options.solve:
        file, *rest = options.solve
        print(json.dumps(measure(Path(file), *rest)))
        return
    study = run(options.level)
    show_tables(tables(study))
    write(study, options.out)
    print(f"\nfiles in {options.out}")
    expect(study, options.level)
    print("every expectation holds")


if __name__ == "__main__":
    main()
