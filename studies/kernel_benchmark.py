"""Study: what one evaluation of residual and tangent costs, beside the forms of scikit-fem and beside FElupe.

Question
--------
How much faster are the compiled kernels than the same operator written as scikit-fem's own forms, and than FElupe's
vectorised assembly, on one mesh, in one process, with the same quadrature and into the same sparse matrix?

Run: ``python studies/kernel_benchmark.py [--level smoke|full] [--out FOLDER]``; about three minutes at level full.
FElupe takes part where it is installed (``pip install felupe``, or the extra ``bench`` of this package).
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import sparse
from skfem.quadrature import get_quadrature
from skfem.refdom import RefTet

from fem_biobot.config import load_design
from fem_biobot.files import replacing
from fem_biobot.material.law import inverse, volume_ratio
from fem_biobot.material.neo_hooke import NeoHooke
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.progress import show_tables
from fem_biobot.solid.model import SolidModel
from fem_biobot.solid.records import Fix
from fem_biobot.solid.sharing import usable_threads
from fem_biobot.solid.system import System
from fem_biobot.study.outputs import write_table
from fem_biobot.tables import Table

Array = NDArray[np.float64]
Row = dict[str, Any]
Seconds = dict[str, float]

# --- design -----------------------------------------------------------------------------------------------------------

DESIGN = "junction_bot"
# size of the committed mesh [mm]
SIZE = {"smoke": 2.0, "full": 0.9}
LAW = NeoHooke(319.4, 0.45)
# rounds of all contenders in turn, and how many of them the slow ones join
ROUNDS = {"smoke": 3, "full": 21}
SLOW_ROUNDS = {"smoke": 1, "full": 3}
# the environment that keeps every library to one thread; what counts processors itself is held on one of them
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# The machine's mesh as one body of compressible neo-Hooke, quadratic tetrahedra, four quadrature points, in a generic
# state of finite strain. One evaluation takes a displacement to the residual and to the assembled sparse tangent:
# deformation gradient, law, element integrals, scatter; sparsity and everything else that is constant is made before.
# Contenders take turns, so that whatever else the machine does falls on all alike; medians over the rounds converge,
# and so do their ratios, which hold for this machine only.
#
# Ours keeps the upper triangle, which is what the solver factors; the others assemble the whole matrix. Our law gives
# stress and moduli in one stage, or the stress only, which is what a residual by itself is timed with. The other two
# evaluate the law in whichever way is fastest for them: scikit-fem's forms are handed the stress and the tangent tensor
# at the points, made once by NumPy (a form that evaluates the law itself repeats it 900 times; measured once, beside),
# FElupe's `SolidBody` reuses the deformation gradient of the residual for the tangent.


@dataclass(frozen=True)
class Case:
    """What all contenders assemble."""

    system: System
    u: Array

    @classmethod
    def of(cls, size: float) -> Case:
        mesh = committed_mesh(load_design(DESIGN), size)
        assert mesh is not None, f"no committed mesh of {DESIGN}"
        body = BodyMesh(mesh.points, mesh.cells, {"body": np.arange(mesh.n_elements)})
        corners = [tuple(map(float, mesh.points[:, vertex])) for vertex in mesh.cells[:3, 0]]
        model = SolidModel(body, {"body": LAW}, supports=[Fix(corner) for corner in corners])
        x, y, z = model.system.space.points
        waves = [np.sin(0.33 * y + 0.25 * z), np.sin(0.25 * x - 0.2 * z), np.cos(0.31 * x + 0.27 * y)]
        return cls(model.system, np.ascontiguousarray(0.3 * np.array(waves).T))


@dataclass
class Evaluation:
    """Residual (dofs,), tangent, and what each stage took."""

    residual: Array
    tangent: sparse.csr_matrix
    seconds: Seconds


class Stages:
    """A stopwatch that is told when a stage has ended."""

    def __init__(self) -> None:
        self.seconds: Seconds = {}
        self._last = time.perf_counter()

    def end(self, stage: str) -> None:
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now


Contender = Callable[[], Evaluation]


def ours(case: Case) -> Contender:
    """The package's compiled stages."""
    system, p = case.system, case.system.pattern

    def evaluate() -> Evaluation:
        stages = Stages()
        F = system.deformation_gradient(case.u)
        stages.end("gradient")
        points = system.points(F, 0.0)
        stages.end("law")
        force, _ = system.internal_force(points)
        stages.end("residual")
        data = system.tangent(F, points.S, points.D)
        stages.end("tangent")
        system.points(F, 0.0, moduli=False)  # what a residual alone asks of the law; no part of both together
        stages.end("stress")
        upper = sparse.csr_matrix((data, p.columns, p.starts), shape=(p.n_dofs, p.n_dofs))
        return Evaluation(force.ravel(), upper, stages.seconds)

    return evaluate


@skfem.LinearForm
def _force(v: Any, w: Any) -> Array:
    return np.einsum("ik...,ik...->...", w.stress, v.grad)


@skfem.BilinearForm
def _stiffness(du: Any, v: Any, w: Any) -> Array:
    return np.einsum("ik...,ik...->...", np.einsum("ikjl...,jl...->ik...", w.tensor, du.grad), v.grad)


@skfem.BilinearForm
def _stiffness_law_within(du: Any, v: Any, w: Any) -> Array:
    F = w.u.grad + np.eye(3)[:, :, None, None]
    G, ln_J, H = inverse(F), np.log(volume_ratio(F)), du.grad
    dP = LAW.mu * H + (LAW.mu - LAW.lmbda * ln_J) * np.einsum("ki...,lk...,jl...->ij...", G, H, G)
    dP = dP + LAW.lmbda * np.einsum("ki...,ik...->...", G, H) * G.swapaxes(0, 1)
    return np.einsum("ik...,ik...->...", dP, v.grad)


def skfem_forms(case: Case, *, law_within: bool = False) -> Contender:
    """The same operator as scikit-fem's forms; its node numbers are those of our space."""
    basis = skfem.Basis(case.system.space.mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=2)

    def evaluate() -> Evaluation:
        stages = Stages()
        u = basis.interpolate(case.u.ravel())
        F = u.grad + np.eye(3)[:, :, None, None]
        stages.end("gradient")
        stress, tensor = LAW.stress(F), LAW.tangent(F)
        stages.end("law")
        residual = _force.assemble(basis, stress=stress)
        stages.end("residual")
        if law_within:
            tangent = _stiffness_law_within.assemble(basis, u=u)
        else:
            tangent = _stiffness.assemble(basis, tensor=tensor)
        stages.end("tangent")
        return Evaluation(residual, tangent, stages.seconds)

    return evaluate


def felupe_body(case: Case, *, parallel: bool) -> Contender:
    """FElupe's solid body on the same nodes and quadrature points (its own four are given to eight digits only)."""
    import felupe

    space = case.system.space
    points, weights = get_quadrature(RefTet, 2)
    mesh = felupe.Mesh(np.ascontiguousarray(space.points.T), np.ascontiguousarray(space.nodes.T), "tetra10")
    scheme = felupe.quadrature.Scheme(np.ascontiguousarray(points.T), np.ascontiguousarray(weights))
    displacement = felupe.FieldContainer([felupe.Field(felupe.RegionQuadraticTetra(mesh, quadrature=scheme), dim=3)])
    displacement[0].values[:] = case.u
    try:
        law = felupe.NeoHookeCompressible(mu=LAW.mu, lmbda=LAW.lmbda, parallel=parallel)
    except TypeError:  # versions whose laws know no threads
        law = felupe.NeoHookeCompressible(mu=LAW.mu, lmbda=LAW.lmbda)
    body = felupe.SolidBody(law, displacement)

    def evaluate() -> Evaluation:
        stages = Stages()
        residual = body.assemble.vector(displacement, parallel=parallel)
        stages.end("residual")
        tangent = body.assemble.matrix(parallel=parallel)
        stages.end("tangent")
        return Evaluation(np.asarray(residual.todense()).ravel(), tangent, stages.seconds)

    return evaluate


# --- run --------------------------------------------------------------------------------------------------------------

OURS, FORMS, FORMS_LAW_WITHIN = "ours", "scikit-fem forms", "scikit-fem forms, law within"
FELUPE, FELUPE_PARALLEL = "FElupe", "FElupe, parallel"


@dataclass
class Benchmark:
    """Rows of one process, one a contender, and how it was run."""

    threads: str
    our_threads: int
    unknowns: int
    elements: int
    rows: list[Row] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def row(self, contender: str) -> Row | None:
        return next((row for row in self.rows if row["contender"] == contender), None)

    def ratio(self, contender: str, what: str = "both") -> float | None:
        """How many times longer a contender takes than ours."""
        mine, other = self.row(OURS), self.row(contender)
        return None if mine is None or other is None else other[f"{what}_s"] / mine[f"{what}_s"]


def felupe_missing() -> str:
    """Why FElupe cannot take part, or nothing."""
    try:
        import felupe
    except ImportError as error:
        return f"FElupe takes no part ({error}); pip install felupe brings it"
    return (
        ""
        if hasattr(felupe, "RegionQuadraticTetra")
        else "FElupe takes no part: this version has no quadratic tetrahedra"
    )


def measure(level: str, threads: str, *, only_serial: bool = False) -> Benchmark:
    """One process: check that all contenders agree, then time them in turn."""
    case = Case.of(SIZE[level])
    found = Benchmark(threads, usable_threads(), case.system.n_dofs, case.system.space.nodes.shape[1])
    contenders: dict[str, Contender] = {OURS: ours(case), FORMS: skfem_forms(case)}
    if missing := felupe_missing():
        found.notes.append(missing)
    else:
        contenders[FELUPE] = felupe_body(case, parallel=False)
        if not only_serial:
            contenders[FELUPE_PARALLEL] = felupe_body(case, parallel=True)
    if level == "full" and not only_serial:
        contenders[FORMS_LAW_WITHIN] = skfem_forms(case, law_within=True)
    slow = {FORMS: SLOW_ROUNDS[level], FORMS_LAW_WITHIN: 1}
    times: dict[str, list[Seconds]] = {name: [] for name in contenders}
    differences: dict[str, tuple[float, float]] = {}
    mine = contenders[OURS]()  # also loads what is compiled
    whole = (mine.tangent + sparse.triu(mine.tangent, 1).T).tocsr()
    for name, contender in contenders.items():
        if name == FORMS_LAW_WITHIN:  # a minute: its one timed round is compared as well
            continue
        other = contender()
        differences[name] = _difference(other, mine.residual, whole)
    for number in range(ROUNDS[level]):
        for name, contender in contenders.items():
            if number < slow.get(name, ROUNDS[level]):
                begin = time.perf_counter()
                other = contender()
                both = time.perf_counter() - begin - other.seconds.get("stress", 0.0)
                times[name].append({**other.seconds, "both": both})
                if name not in differences:
                    differences[name] = _difference(other, mine.residual, whole)
    found.rows = [_row(name, times[name], differences[name]) for name in contenders]
    for row in found.rows:
        for what in ("residual", "tangent", "both"):
            row[f"{what}_ratio_1"] = found.ratio(row["contender"], what)
    return found


def _difference(other: Evaluation, residual: Array, whole: sparse.csr_matrix) -> tuple[float, float]:
    """Relative distances of residual and tangent from ours; our upper triangle is compared with itself whole."""
    tangent = other.tangent
    if tangent.nnz < whole.nnz:
        tangent = (tangent + sparse.triu(tangent, 1).T).tocsr()
    return (
        float(np.linalg.norm(other.residual - residual) / np.linalg.norm(residual)),
        float(sparse.linalg.norm(tangent - whole) / sparse.linalg.norm(whole)),
    )


def _row(name: str, times: list[Seconds], difference: tuple[float, float]) -> Row:
    """Medians over the rounds. `residual` and `tangent` hold what each needs alone: gradient, law and its own stage.

    The residual alone needs of the law the stress only, where a contender has a stage for that.
    """
    keys = ("gradient", "law", "stress", "residual", "tangent", "both")
    stage = {key: np.array([t.get(key, 0.0) for t in times]) for key in keys}
    stress = stage["stress"] if stage["stress"].any() else stage["law"]
    both = stage["both"]
    return {
        "contender": name,
        "rounds_1": len(times),
        "gradient_s": _median(stage["gradient"]),
        "law_s": _median(stage["law"]),
        "stress_s": _median(stage["stress"]),
        "residual_stage_s": _median(stage["residual"]),
        "tangent_stage_s": _median(stage["tangent"]),
        "residual_s": float(np.median(stage["gradient"] + stress + stage["residual"])),
        "tangent_s": float(np.median(stage["gradient"] + stage["law"] + stage["tangent"])),
        "both_s": float(np.median(both)),
        "both_low_s": float(np.quantile(both, 0.25)),
        "both_high_s": float(np.quantile(both, 0.75)),
        "residual_difference_1": difference[0],
        "tangent_difference_1": difference[1],
    }


def _median(values: Array) -> float | None:
    return float(np.median(values)) if values.any() else None


def run(level: str) -> list[Benchmark]:
    """The benchmark in this process with the libraries' own threads; at level full also in one with one thread each."""
    found = [measure(level, "the libraries' own choice")]
    if level == "full":
        asked = [sys.executable, str(Path(__file__).resolve()), "--level", level, "--one-thread"]
        search = os.pathsep.join(path for path in sys.path if path)
        done = subprocess.run(
            asked, env={**os.environ, **ONE_THREAD, "PYTHONPATH": search}, stdout=subprocess.PIPE, text=True, check=True
        )
        found.append(Benchmark(**json.loads(done.stdout.splitlines()[-1])))
    return found


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(found: list[Benchmark], level: str) -> None:
    """All contenders assemble the same; the ratios only where rounds and mesh are enough to speak of them."""
    for benchmark in found:
        assert {OURS, FORMS} <= {row["contender"] for row in benchmark.rows}
        for row in benchmark.rows:
            # rounding of some hundred products and of the laws' own formulas
            assert row["tangent_difference_1"] < 1e-12, (
                f"{row['contender']}: tangent differs, {row['tangent_difference_1']:.2g}"
            )
            assert row["residual_difference_1"] < 1e-11, (
                f"{row['contender']}: residual differs, {row['residual_difference_1']:.2g}"
            )
    for benchmark in found:
        forms = benchmark.ratio(FORMS)
        assert forms is not None
        if level == "smoke":
            assert forms > 10.0, f"scikit-fem's forms take only {forms:.1f} times as long"
            continue
        # about half of what was found, so that a busy machine does not fail it; `verdict` speaks of the aims
        assert forms > 100.0, f"scikit-fem's forms take only {forms:.0f} times as long"
        for what, least in (("both", 2.5), ("tangent", 2.5), ("residual", 2.0)):
            body = benchmark.ratio(FELUPE, what)
            assert body is None or body > least, f"FElupe takes only {body:.1f} times as long for {what}"


def verdict(found: list[Benchmark]) -> list[str]:
    """The aims and whether each process met them: tangent 100 times scikit-fem's forms, 3 (better 8) times FElupe's."""
    lines = []
    for number, benchmark in enumerate(found):
        for contender, aim in ((FORMS, 100.0), (FELUPE, 3.0)):
            for what in ("tangent", "residual", "both"):
                ratio = benchmark.ratio(contender, what)
                if ratio is not None and (contender == FELUPE or what != "residual"):
                    met = "meets" if ratio >= aim else "falls short of"
                    lines.append(f"table {number + 1}: {contender}, {what}: {ratio:.3g} times, {met} {aim:g}")
    return lines


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Two cores, 61 617 unknowns, 12 047 elements, medians of interleaved rounds, in two runs while other work kept the cores
busy (one to three other processes). All contenders assemble the same tangent and residual to 3e-15. "Both" is residual
and tangent together; law and deformation gradient are included in each.

* One thread for every library, undisturbed as far as could be had: ours 24 ms for both (tangent alone 21, residual
  alone 5.6; stages: gradient 1.7 to 2.1, law 1.9 to 2.0, its stress only 0.9, internal force 2.6 to 2.8, tangent 17).
  FElupe takes 5.1 times as long for both, 4.9 times for the tangent, 3.4 times for the residual.
* One thread, strongly disturbed: all take up to twice as long; FElupe 5.3 times for both, 4.9 for the tangent.
* The libraries' own threads, two for ours on two busy cores: 24 ms for both; FElupe 5.2 times as long (tangent 5.0,
  residual 3.2), its parallel option 5.4 times (5.2, 3.3). In the more disturbed run ours 49 ms, FElupe 4.8 times (4.0,
  5.0), its parallel option 4.5 times (4.0, 2.7).
* A third run with nothing else on the machine: one thread each, ours 24.8 ms for both and FElupe 5.1 times as long
  (tangent 4.9, residual 3.7), scikit-fem's forms 224 times (256); the libraries' own threads, two for ours, 24.0 ms and
  5.4 times (5.2, 3.3), the forms 233 times (266). The second thread brings next to nothing on these two processors.
* scikit-fem's forms take 190 to 360 times as long for both, 210 to 400 times for the tangent; a form that evaluates the
  law itself 1600 to 2200 times.
* So 100 times scikit-fem's forms and 3 times FElupe's are met with one thread each, 8 times FElupe's is not. Of our
  tangent's 17 ms some 10 to 11 are arithmetic, at less than half of what the vector units could do, the rest is adding
  to the sparse matrix; other orders of elements or of the matrix's rows did not make the adding shorter, fetching the
  rows ahead did.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
Other laws, active tension, other elements, more than two threads, meshes that leave the last-level cache.
"""


def table(benchmark: Benchmark) -> Table:
    """What is printed of one process: milliseconds, ratios, agreement."""
    header = (
        "contender",
        "rounds",
        "gradient",
        "law",
        "stress only",
        "residual stage",
        "tangent stage",
        "residual",
        "tangent",
        "both",
    )
    header += ("quartiles", "ratio residual", "ratio tangent", "ratio both", "difference")
    rows = []
    for row in benchmark.rows:
        keys = ("gradient_s", "law_s", "stress_s", "residual_stage_s", "tangent_stage_s")
        keys += ("residual_s", "tangent_s", "both_s")
        milliseconds = [None if row[key] is None else 1e3 * row[key] for key in keys]
        ratios = [row[f"{what}_ratio_1"] for what in ("residual", "tangent", "both")]
        quartiles = f"{1e3 * row['both_low_s']:.4g} to {1e3 * row['both_high_s']:.4g}"
        rows.append(
            (row["contender"], row["rounds_1"], *milliseconds, quartiles, *ratios, f"{row['tangent_difference_1']:.0e}")
        )
    title = (
        f"Milliseconds, {benchmark.unknowns} unknowns, {benchmark.elements} elements; threads: {benchmark.threads}, "
    )
    title += f"ours {benchmark.our_threads}"
    return Table(title, header, tuple(rows))


def write(found: list[Benchmark], folder: Path) -> None:
    """CSV and a picture of the medians."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "kernel_benchmark.csv", [{"threads": b.threads, **row} for b in found for row in b.rows])
    figure = Figure(figsize=(8.0, 3.6), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    rows = found[0].rows
    for number, what in enumerate(("residual", "tangent")):
        at = np.arange(len(rows)) + 0.38 * (number - 0.5)
        bars = axes.barh(at, [1e3 * row[f"{what}_s"] for row in rows], 0.36, label=what, color=f"C{number}")
        axes.bar_label(bars, [f"{row[f'{what}_ratio_1']:.3g} x" for row in rows], padding=3, fontsize=8)
    axes.set_yticks(np.arange(len(rows)), [row["contender"] for row in rows])
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.margins(x=0.15)
    axes.set_xlabel(f"milliseconds, {found[0].unknowns} unknowns (and multiples of ours)")
    axes.legend(frameon=False)
    with replacing(folder / "kernel_benchmark.png") as temporary:
        figure.savefig(temporary, format="png")


def machine() -> str:
    """Processors, threads and versions, in one line."""
    names: Mapping[str, str] = {"numba": "numba", "numpy": "NumPy", "scikit-fem": "scikit-fem", "felupe": "FElupe"}
    versions = []
    for package, name in names.items():
        try:
            versions.append(f"{name} {version(package)}")
        except PackageNotFoundError:
            continue
    return f"{os.cpu_count()} processors; {', '.join(versions)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--level", choices=tuple(SIZE), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "kernel_benchmark")
    parser.add_argument("--one-thread", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one_thread:
        if hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        print(json.dumps(vars(measure(options.level, "one for every library", only_serial=True))))
        return
    found = run(options.level)
    show_tables([table(benchmark) for benchmark in found])
    write(found, options.out)
    print("", *verdict(found), "", machine(), *found[0].notes, f"files in {options.out}", sep="\n")
    expect(found, options.level)
    print("every expectation holds")


if __name__ == "__main__":
    main()
