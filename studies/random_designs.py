"""Study: designs drawn at random, each solved or refused for a reason.

Question
--------
Somebody who tries lengths, moduli, laws and tensions that nobody tried before: does every design either reach all the
states asked for, or end in one line that says why? Does any crash, and is any state that is handed back as an
equilibrium none?

Run: ``python studies/random_designs.py [--level smoke|part|full] [--out FOLDER] [--only NUMBER]``; about half an hour
on one idle core at level full. It needs Gmsh.
"""

from __future__ import annotations

import argparse
import time
import traceback
import warnings
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import BiobotError, DesignError, MeshError, SolveError
from fem_biobot.files import replacing
from fem_biobot.material.law import volume_ratio
from fem_biobot.material.volume import LOG
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.geometry import GmshMissing, build_mesh
from fem_biobot.progress import show_tables
from fem_biobot.solid.from_design import newton_settings, tension_step, tension_unit
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.space import LockingWarning
from fem_biobot.study.outputs import write_table
from fem_biobot.tables import Table

Array = NDArray[np.float64]
Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

# at level smoke five that are soon solved, one that is refused, one that Gmsh dies of, and one whose trials have forces
# far above those of its states
NUMBERS: dict[str, Sequence[int]] = {"smoke": (1, 2, 3, 4, 5, 16, 49, 194), "part": range(60), "full": range(200)}
SEED = 20181105
MOST_UNKNOWNS = 15_000
LARGEST_TENSION = 15.0  # kPa
# shares of all designs
KINDS = {"junction_bot": 0.65, "strip": 0.2, "cantilever": 0.15}
GEL_LAWS = {"neo_hooke": 0.5, "neo_hooke_isochoric": 0.15, "mooney_rivlin": 0.15, "yeoh": 0.1, "gent": 0.1}
TISSUE_LAWS = {
    "neo_hooke": 0.4,
    "neo_hooke_isochoric": 0.1,
    "mooney_rivlin": 0.1,
    "gent": 0.1,
    "guccione": 0.1,
    "holzapfel_ogden": 0.1,
    "blemker": 0.1,
}
CONVENTIONS = {"nominal": 0.5, "second_piola": 0.15, "kirchhoff": 0.15, "cauchy": 0.1, "active_strain": 0.1}
# the displacement element serves up to here, the mixed one beyond (and for a third of the designs below)
BEARS = 0.49


def drawn(number: int, attempt: int = 0) -> dict[str, str]:
    """Preset and settings of one design; each has a stream of its own, so that one can be made again alone."""
    draw = np.random.default_rng([SEED, number, attempt])

    def one_of(shares: dict[str, float]) -> str:
        return str(draw.choice(list(shares), p=list(shares.values())))

    def about(value: float, factor: float) -> float:
        """A value times or divided by at most a factor, evenly in the logarithm."""
        return float(value * factor ** draw.uniform(-1.0, 1.0))

    def mm(value: float) -> str:
        return f"{value:.4f} mm"

    kind = one_of(KINDS)
    # 0.3 to 0.4999, as many designs in each decade of 0.5 - nu
    poisson = [0.5 - 10.0 ** draw.uniform(-4.0, np.log10(0.2)) for _ in range(2)]
    mixed = max(poisson) > BEARS or draw.uniform() < 1.0 / 3.0
    total, passive = LARGEST_TENSION * draw.uniform(0.05, 1.0), draw.uniform(0.3, 1.0)
    size = about(1.0, 1.6)
    settings = {"preset": kind, "mesh.element": "P2-P1" if mixed else "P2"}
    gel = {
        "skeleton.beam_length": mm(size * about(14.0, 1.1)),
        "skeleton.beam_width": mm(size * about(7.0, 1.1)),
        "skeleton.beam_thickness": mm(size * about(0.68, 1.7)),
        "skeleton.material.law": one_of(GEL_LAWS),
        "skeleton.material.young": f"{about(150.0, 8.0):.5g} kPa",
        "skeleton.material.poisson": f"{poisson[0]:.6f}",
    }
    tissue = {
        "muscle.junction_width": mm(size * about(2.2, 1.5)),
        "muscle.junction_thickness": mm(size * about(0.4, 1.7)),
        "muscle.theta": f"{draw.uniform(55.0, 125.0):.3f} deg",
        "muscle.spread": f"{draw.choice([0.0, draw.uniform(2.0, 25.0)]):.3f} deg",
        "muscle.passive_tension": f"{passive * total:.5g} kPa",
        "muscle.active_tension": f"{(1.0 - passive) * total:.5g} kPa",
        "muscle.convention": one_of(CONVENTIONS),
        "muscle.material.law": one_of(TISSUE_LAWS),
        "muscle.material.young": f"{about(15.0, 5.0):.5g} kPa",
        "muscle.material.poisson": f"{poisson[1]:.6f}",
    }
    if tissue["muscle.convention"] == "active_strain":
        tissue["muscle.spread"] = "0 deg"  # the two do not go together
    pillars = {
        "skeleton.pillar_length": mm(size * about(3.5, 1.1)),
        "skeleton.pillar_width": mm(size * about(6.3, 1.1)),
        "skeleton.short_pillar_height": mm(size * about(2.8, 1.1)),
        "skeleton.long_pillar_height": mm(size * about(3.4, 1.1)),
        "skeleton.fillet_radius": mm(size * float(draw.choice([0.0, 0.2], p=[0.9, 0.1]))),
        "muscle.junction_height": mm(size * about(1.45, 1.1)),
        "muscle.ring_thickness": mm(size * about(0.5, 1.3)),
        "muscle.ring_height": mm(size * about(1.1, 1.2)),
        "muscle.ring_offset": mm(-0.1 * size),
    }
    coarse = draw.uniform(1.0, 3.0)
    if kind == "junction_bot":
        return {**settings, **gel, **tissue, **pillars, "mesh.size": mm(size * 2.0 * coarse)}
    if kind == "strip":
        length = {"muscle.junction_length": mm(size * about(7.0, 1.6))}
        return {**settings, **tissue, **length, "mesh.size": mm(size * 0.5 * coarse)}
    force = 10.0 ** draw.uniform(-3.0, 0.0)
    return {**settings, **gel, "load.tip_force": f"{force:.5g} mN", "mesh.size": mm(size * 0.8 * coarse)}


# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# Counted is how each design ends. A state that was handed back is looked at anew: the out-of-balance forces are
# computed from its displacement (and pressure) alone, with basis functions, quadrature, first Piola stress and volume
# measure written out here or taken from the laws' plain form, none of it from the compiled kernels, the assembly or the
# iteration. What is left over, relative to the sum of the sizes of all passive and active element forces, must be at
# most ten times the tolerance asked for, or a thousand times what rounding of the stresses leaves; no point may be
# inverted.

TOLERANCE_FACTOR = 10.0
ROUNDING_FACTOR = 1e3
# corners and edges of the quadratic tetrahedron, and its rule of four points
_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))
_NEAR, _FAR = (5.0 + 3.0 * np.sqrt(5.0)) / 20.0, (5.0 - np.sqrt(5.0)) / 20.0


def _slopes(X: Array, nodes: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Gradients of the quadratic basis (10, 3, e, q) [1/mm], barycentric coordinates (4, q), volume of each point."""
    x = X[:, nodes[:4]]  # (3, 4, e)
    edges = x[:, 1:] - x[:, :1]
    volume = np.linalg.det(np.moveaxis(edges, -1, 0)) / 6.0
    # rows of the inverse are the gradients of the coordinates 1 to 3
    rows = np.moveaxis(np.linalg.inv(np.moveaxis(edges, -1, 0)), 0, -1)  # (3 coordinates, 3, e)
    g = np.concatenate([-rows.sum(axis=0, keepdims=True), rows])  # (4, 3, e)
    at = np.full((4, 4), _FAR) + (_NEAR - _FAR) * np.eye(4)  # (4 coordinates, q)
    corners = [(4.0 * at[a] - 1.0) * g[a][:, :, None] for a in range(4)]
    middles = [4.0 * (at[a] * g[b][:, :, None] + at[b] * g[a][:, :, None]) for a, b in _EDGES]
    return np.stack(corners + middles), at, np.repeat(volume[:, None] / 4.0, 4, axis=1)


def left_over(state: SolidState) -> tuple[float, float, float]:
    """Out-of-balance force over the sum of sizes [1], the same that rounding may leave, and the least volume ratio.

    In the mixed form the first also has what is left of ``g(J) = p / bulk``, in the solver's units of it.
    """
    model, system = state.model, state.model.system
    X, nodes = state.X, system.space.nodes
    slopes, at, dV = _slopes(X, nodes)
    F = np.einsum("bie,bkeq->ikeq", state.u.T[nodes].transpose(0, 2, 1), slopes) + np.eye(3)[:, :, None, None]
    J = volume_ratio(F)
    P, stiffness = np.zeros_like(F), np.zeros(dV.shape)
    parts = {} if system.mixed is None else {tuple(part.elements): part for part in system.mixed.field.parts}
    volume_gaps = np.zeros(system.n_pressures)
    for name, elements in model.mesh.regions.items():
        law = model.materials[name]
        law = law.at(elements) if hasattr(law, "at") else law  # type: ignore[attr-defined]
        part = parts.get(tuple(elements))
        own = F[:, :, elements]
        if part is None:
            P[:, :, elements] += law.stress(own)
        else:
            rest, volumetric = law.split()  # type: ignore[attr-defined]
            here = system.mixed.field.nodes[:, elements]
            p = np.einsum("ce,cq->eq", state.pressure[here], at)
            g, slope = _measure(J[elements], volumetric.measure)
            cofactor = J[elements] * np.linalg.inv(own.transpose(2, 3, 0, 1)).transpose(3, 2, 0, 1)
            P[:, :, elements] += rest.stress(own) + p * slope * cofactor
            for c in range(4):
                np.add.at(volume_gaps, here[c], np.sum(at[c] * (g - p / volumetric.bulk) * dV[elements], axis=1))
        bulk = law.split()[1].bulk if hasattr(law, "split") and part is None else 0.0  # type: ignore[attr-defined]
        stiffness[elements] = law.young / (1.0 + law.poisson) + (bulk if np.isfinite(bulk) else 0.0)  # type: ignore[attr-defined]
    pull = np.zeros_like(F)
    for c in system.contractions:
        pull[:, :, c.elements] += c.law_at(state.step).at(c.elements).stress(F[:, :, c.elements])  # type: ignore[attr-defined]
    passive, active = (np.einsum("ikeq,bkeq,eq->bie", stress, slopes, dV) for stress in (P, pull))
    rounding = np.einsum("eq,bkeq,eq->bke", stiffness, np.abs(slopes), dV)
    force, sizes, noise = (np.zeros((system.space.n_nodes, 3)) for _ in range(3))
    for b in range(10):
        np.add.at(force, nodes[b], (passive[b] + active[b]).T)
        np.add.at(sizes, nodes[b], (np.abs(passive[b]) + np.abs(active[b])).T)
        np.add.at(noise, nodes[b], rounding[b].T)
    force -= _tip_load(state)
    free = system.held.to_local(force).ravel()
    free[system.held.dofs] = 0.0
    scale = float(np.linalg.norm(sizes))
    if system.mixed is not None:
        free = np.concatenate([free, volume_gaps * system.mixed.field.scale])
    return (
        float(np.linalg.norm(free)) / scale,
        float(np.finfo(float).eps * np.linalg.norm(noise)) / scale,
        float(J.min()),
    )


def _measure(J: Array, measure: int) -> tuple[Array, Array]:
    """``g(J)`` and its slope in plain closed forms, of the quadratic one as a series near J = 1."""
    if measure == LOG:
        return np.log(J), 1.0 / J
    e = J - 1.0
    near = np.abs(e) < 1e-3
    far = np.where(near, 0.5, e)
    g = np.sign(far) * np.sqrt(0.5 * (far * far + 2.0 * far) - np.log1p(far))
    series = e - e**2 / 6.0 + e**3 / 9.0 - 11.0 / 135.0 * e**4
    bend = 1.0 - e / 3.0 + e**2 / 3.0 - 44.0 / 135.0 * e**3
    return np.where(near, series, g), np.where(near, bend, 0.5 * (1.0 + far - 1.0 / (1.0 + far)) / g)


def _tip_load(state: SolidState) -> Array:
    """Nodal forces of a cantilever's tip load, (n, 3) [mN]: a third of a facet's force at the middle of each side."""
    model, out = state.model, np.zeros((state.X.shape[1], 3))
    middle = {tuple(sorted(pair)): n for pair, n in _middles(state)}
    for load in model.loads:
        triangles = model.mesh.surfaces["tip"]
        corners = state.X[:, triangles]
        area = 0.5 * np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], axis=0), axis=0
        )
        for t, size in zip(triangles.T, area, strict=True):
            for a, b in ((0, 1), (1, 2), (0, 2)):
                node = middle[tuple(sorted((int(t[a]), int(t[b]))))]
                out[node] += state.step.load * size / 3.0 * np.asarray(load.value)  # type: ignore[union-attr]
    return out


def _middles(state: SolidState) -> list[tuple[tuple[int, int], int]]:
    """The two vertices of every edge, with the node between them."""
    nodes = state.model.system.space.nodes
    found = []
    for k, (a, b) in enumerate(_EDGES):
        found += [((int(i), int(j)), int(n)) for i, j, n in zip(nodes[a], nodes[b], nodes[4 + k], strict=True)]
    return found


# --- run --------------------------------------------------------------------------------------------------------------


@dataclass
class Study:
    """One row a design."""

    rows: list[Row] = field(default_factory=list)


def run(level: str, only: int | None = None) -> Study:
    """All designs of a level, one after the other; beyond smoke in a process of their own, which may die."""
    study = Study()
    if level == "smoke" or only is not None:
        study.rows += [tried(number) for number in (NUMBERS[level] if only is None else (only,))]
        return study
    worker = _worker()
    for number in NUMBERS[level]:
        try:
            row = worker.submit(tried, number).result()
        except BrokenProcessPool:
            row = {**_blank(number), **drawn(number), "ended": "crashed", "said": "the process died"}
            worker = _worker()
        study.rows.append(row)
        print(f"{number:4d} {row['seconds_s']:6.1f} s  {row['ended']}: {row['said']}", flush=True)
    worker.shutdown()
    return study


def _worker() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(max_workers=1, mp_context=get_context("spawn"))


def _blank(number: int) -> Row:
    row: Row = {"number": number, "ended": "", "said": "", "states_1": 0, "asked_1": 0, "unknowns_1": None}
    return row | {"left_over_1": None, "allowed_1": None, "least_volume_1": None, "halvings_1": None, "seconds_s": 0.0}


def tried(number: int) -> Row:
    """One design: how it ended, what was said, and what is left over in the worst of its states."""
    row = _blank(number)
    begin = time.perf_counter()
    try:
        _solved(row, number)
    except GmshMissing:
        raise
    except BiobotError as refusal:
        row["ended"] = f"refused, {_REFUSALS[type(refusal)]}" if type(refusal) in _REFUSALS else "crashed"
        row["said"] = str(refusal)
        if isinstance(refusal, SolveError) and refusal.best is not None:
            _look_at(row, list(refusal.best.states))
            row["halvings_1"] = refusal.best.halvings
    except Exception:  # a defect of the package: what the study is to find
        row["ended"], row["said"] = "crashed", traceback.format_exc().strip().splitlines()[-1]
    row["seconds_s"] = time.perf_counter() - begin
    return row


_REFUSALS: dict[type[BiobotError], str] = {DesignError: "design", MeshError: "mesh", SolveError: "solve"}


def _solved(row: Row, number: int) -> None:
    model = None
    for attempt in range(_ATTEMPTS):  # again where the mesh cannot be as coarse as that
        settings = drawn(number, attempt)
        row |= {"preset": settings["preset"], **settings}
        design = load_design(
            settings["preset"], [f"{key}={value}" for key, value in settings.items() if key != "preset"]
        )
        model = _model(design)
        if model is not None:
            break
    if model is None:
        raise MeshError(f"mesh: found more than {MOST_UNKNOWNS} unknowns {_ATTEMPTS} times, expected fewer once")
    row["unknowns_1"] = model.n_dofs
    if design.muscle is None:
        steps = [0.25, 1.0]
    else:
        full = tension_unit(design)
        steps = [tension_step(design, tension) for tension in (0.5 * design.tension(0.0), design.tension(0.0), full)]
    row["asked_1"] = len(steps)
    found = solve(model, steps, settings=newton_settings(design))
    row["ended"], row["halvings_1"] = "converged", found.halvings
    _look_at(row, list(found.states))


_ATTEMPTS = 12


def _model(design: Design) -> SolidModel | None:
    """The model on a mesh of at most so many unknowns, coarser than asked for where need be; None if there is none."""
    size = design.mesh.size
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LockingWarning)
        for _ in range(3):
            mesh: BodyMesh = build_mesh(design, size)
            model = SolidModel.from_design(design, mesh)
            if model.n_dofs <= MOST_UNKNOWNS:
                return model
            size *= 1.6
    return None


def _look_at(row: Row, states: list[SolidState]) -> None:
    """Judge every state that was handed back as an equilibrium."""
    row["states_1"] = len(states)
    worst = -np.inf
    for state in states:
        if state.step.tension == 0.0 and not state.model.loads:
            continue
        gap, rounding, least = left_over(state)
        allowed = TOLERANCE_FACTOR * 1e-9 + ROUNDING_FACTOR * rounding
        if gap / allowed > worst:
            worst = gap / allowed
            row["left_over_1"], row["allowed_1"] = gap, allowed
        row["least_volume_1"] = least if row["least_volume_1"] is None else min(least, row["least_volume_1"])


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study, level: str = "full") -> None:
    """What must hold at every level."""
    assert study.rows, "no design was tried"
    for row in study.rows:
        where = f"design {row['number']}"
        assert row["ended"] in (*(f"refused, {name}" for name in _REFUSALS.values()), "converged"), (
            f"{where} {row['ended']}: {row['said']}"
        )
        if row["ended"] == "converged":
            assert row["states_1"] == row["asked_1"], f"{where}: {row['states_1']} states of {row['asked_1']}"
        else:
            assert row["said"], f"{where} gives no reason"
            assert "\n" not in row["said"], f"{where} gives its reason in several lines"
        if row["left_over_1"] is not None:
            assert row["left_over_1"] <= row["allowed_1"], (
                f"{where}: {row['left_over_1']:.2g} of the forces are out of balance in a state called an equilibrium"
            )
        if row["least_volume_1"] is not None:
            assert row["least_volume_1"] > 0.0, f"{where}: a point is inverted in a state called an equilibrium"
    least = 0.6 if level == "smoke" else 0.9
    assert solved_share(study) > least, f"{solved_share(study):.0%} of the designs that fit together converge"


def solved_share(study: Study) -> float:
    """Share of the designs whose parts fit together that reach all their states."""
    fit = [row for row in study.rows if row["ended"] != "refused, design"]
    return sum(row["ended"] == "converged" for row in fit) / max(len(fit), 1)


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Two cores shared with much other work; all 200 designs in one run.

* 148 of the 200 reach all their states (74%), 46 (23%) are refused when they are read, in a line that names the keys
  that clash (pillars wider than the beam, rings above the beam or below the ground), and 2 because no mesh was made.
  Of the 152 that were solved, 4 were refused on the way (numbers 38, 112, 128, 155), for a loss of stability where
  the message says so, with the step, the iteration and the element.
* Of the 419 states that were handed back all are in balance by the residual computed here (1.6e-9 of their forces at
  most, where 1e-8 is allowed), and no point is inverted. Number 194 had 3.2e-8 before states were measured by their
  own forces, too: the solver compared with the largest forces met anywhere on the path, trial iterates among them, and
  a trial of a thin beam had far larger ones than the state; it has 5e-11 now. The check is sharp: a wrong third term
  in the series for g(J) written here showed as 1e-8.
* Gmsh 4.15.2 corrupts its memory over number 49, in its tetrahedral algorithm (HXT) at just this size of mesh; 0.9 and
  1.6 times the size go well. It dies in a process of its own, and the design is refused in a line that says so.
* Mended on the way: a thin beam under a large load (35) was given up because the residual rose ten-thousandfold in
  the first iteration (its first linear step stretches what it turns; the next takes it back), and after eight failed
  tries however far it had come. Now two iterations may rise, and each way may be halved eight times.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
Finer meshes, remodelled tissue, force-length curves, rings without a junction, designs outside the ranges drawn from,
several threads.
"""


def tables(study: Study) -> list[Table]:
    """What is printed."""
    endings = list(dict.fromkeys(row["ended"] for row in study.rows))
    kinds = list(dict.fromkeys(row["preset"] for row in study.rows))
    counts = [
        (ended, *(sum(r["ended"] == ended and r["preset"] == kind for r in study.rows) for kind in kinds))
        for ended in endings
    ]
    rates = tuple((*row, sum(row[1:]), f"{sum(row[1:]) / len(study.rows):.1%}") for row in counts)
    shown = [Table("How designs end", ("ended", *kinds, "all", "share"), rates)]
    reasons = tuple((r["number"], r["ended"], r["said"]) for r in study.rows if r["said"])
    if reasons:
        shown.append(Table("Reasons", ("number", "ended", "said"), reasons))
    return shown


def write(study: Study, folder: Path) -> None:
    """CSV of all designs, and a picture of moduli, tensions and endings."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "designs.csv", study.rows)
    figure = Figure(figsize=(9.0, 4.0), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    for number, ended in enumerate(dict.fromkeys(row["ended"] for row in study.rows)):
        rows = [row for row in study.rows if row["ended"] == ended and "muscle.material.young" in row]
        young, pulls = [_value(r, "muscle.material.young") for r in rows], [_pull(r) for r in rows]
        left.loglog(young, pulls, ".", color=f"C{number}", label=ended)
        looked = [row for row in study.rows if row["ended"] == ended and row["left_over_1"] is not None]
        right.semilogy(
            [r["number"] for r in looked], [r["left_over_1"] for r in looked], ".", color=f"C{number}", label=ended
        )
    left.set_xlabel("Young's modulus of the tissue [kPa]")
    left.set_ylabel("tension [kPa]")
    left.legend(frameon=False)
    right.set_xlabel("number")
    right.set_ylabel("forces out of balance, worst state [1]")
    with replacing(folder / "random_designs.png") as temporary:
        figure.savefig(temporary, format="png")


def _value(row: Row, key: str) -> float:
    return float(row[key].split()[0])


def _pull(row: Row) -> float:
    return _value(row, "muscle.passive_tension") + _value(row, "muscle.active_tension")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--level", choices=tuple(NUMBERS), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "random_designs")
    parser.add_argument("--only", type=int, help="number of one design")
    options = parser.parse_args()
    study = run(options.level, options.only)
    show_tables(tables(study))
    write(study, options.out)
    if options.only is None:
        expect(study, options.level)
        print("every expectation holds")


if __name__ == "__main__":
    main()
