"""Study: how far the machine's numbers are from those of an infinitely fine mesh, and which of them have such a limit.

Question
--------
At which rate do closing, muscle force and stress of the junction bot converge with the mesh size, how large is their
error on the preset's mesh, does the error that a run prints for itself tell the truth, and what of the stress at a
sharp re-entrant corner may be quoted at all? How well do five meshes no finer than the preset's know closing and force
at full drive? Do four quadrature points suffice?

Run: ``python studies/mesh_error.py [--level smoke|full] [--also MM ...] [--out FOLDER]``; some minutes at level
full. Needs Gmsh.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.files import replacing
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.geometry import CORNER_SHARE, build_mesh
from fem_biobot.progress import show_tables
from fem_biobot.solid.from_design import tension_step, tension_unit
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidState, solve
from fem_biobot.solid.stress import cauchy_stress, von_mises
from fem_biobot.study.compare import error_estimate
from fem_biobot.study.convergence import ConvergencePlan, energy_parts, measured_row
from fem_biobot.study.outputs import write_table
from fem_biobot.study.plan import Solver, Wanted
from fem_biobot.study.reporter import Silent
from fem_biobot.study.richardson import limit, observed_order
from fem_biobot.tables import Table

Array = NDArray[np.float64]
Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

DESIGN = "junction_bot"
FORCE = 1.0  # mN
# general element sizes [mm], coarse to fine: every zone of the mesh scales with them
SIZES = {"smoke": (4.0, 3.0, 2.0), "full": (2.0, 1.35, 0.9, 0.6, 0.45)}
# element size along the re-entrant corner lines as a share of the preset's general size, all else left as it is
CORNERS = {"smoke": (), "full": (0.4, 0.2, 0.1, 0.05)}
# at full drive: interval in which the limit lies by all that was tried (see below), from meshes of any kind
KNOWN = {"tip_closing_mm": (3.735, 3.755), "muscle_force_mN": (4.37, 4.384)}
# what a run does to estimate its error: the preset's size, and a mesh this many times coarser
COARSER = 1.6
# points this near to the short pillar's corner line count as at the corner [mm]: the radius of the ball
NEAR = 0.3

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# Closing and force are functionals of the whole solution. At a re-entrant corner of 270 degrees displacements behave
# like r to the power 0.5445 (Williams 1952), so the energy, and with it such functionals, converge like h to the power
# 2 x 0.5445 = 1.09, whatever the degree of the element, once the elements at the corner are small against the beam's
# thickness. The edges at which soft tissue ends on gel, and those of the tissue itself, are singular too. Two families
# of meshes are used: one in which every zone is refined, as a user would refine, and one in which only the corner
# lines are, which reaches far smaller elements there. The first gives the observed order and the limit, over the mean
# element size (the cube root of volume over elements, as a run's own estimate has it); the second shows the order at
# the corner alone and what the corner's share in the error is.
#
# Stress behaves like r to the power -0.4555 at the corner: its mean over a ball of fixed radius exists and converges;
# its maximum over the points of a mesh grows without end and means nothing.

THEORY = 2 * 0.5445
CONVERGING = {
    "closing_mm": f"tip closing at {FORCE:g} mN",
    "passive_closing_mm": "tip closing, passive",
    "passive_force_mN": "muscle force, passive",
    "passive_stretch_1": "fibre stretch, passive",
    "ball_kPa": "von Mises, mean over the ball",
}
PEAKS = {"corner_peak_kPa": "von Mises, highest at the corner", "peak_kPa": "von Mises, highest anywhere"}


# --- run --------------------------------------------------------------------------------------------------------------


@dataclass
class Study:
    """Rows by mesh of all families, by quantity, of the run's own estimate beside the truth, of two quadratures."""

    sizes: list[Row] = field(default_factory=list)
    corners: list[Row] = field(default_factory=list)
    orders: list[Row] = field(default_factory=list)
    estimates: list[Row] = field(default_factory=list)
    quadratures: list[Row] = field(default_factory=list)
    driven: list[Row] = field(default_factory=list)
    bars: list[Row] = field(default_factory=list)


def column(rows: Sequence[Row], name: str) -> Array:
    """A quantity on all meshes of a family, coarse to fine."""
    return np.array([row[name] for row in rows])


def run(level: str, also: Sequence[float] = ()) -> Study:
    """All meshes of a level, and of general sizes asked for besides [mm]."""
    design = load_design(DESIGN)
    preset, coarser = design.mesh.size, COARSER * design.mesh.size
    study = Study()
    pair: dict[float, tuple[BodyMesh, list[Row]]] = {}
    sizes = {*SIZES[level], *also}
    for size in sorted({*sizes, *((coarser,) if level == "full" else ())}, reverse=True):
        mesh = build_mesh(design, size)
        row, states, solver = on_mesh(design, mesh, size, CORNER_SHARE)
        if size in sizes:
            study.sizes.append(row)
        if size in (preset, coarser):
            pair[size] = (mesh, states)
        if size == preset:
            study.quadratures = quadratures(design, solver, size)
    for share in CORNERS[level]:
        same = [row for row in study.sizes if (row["size_mm"], row["corner_share_1"]) == (preset, share)]
        study.corners += same or [on_mesh(design, build_mesh(design, corner_share=share), preset, share)[0]]
    study.orders = [observed(study, name) for name in CONVERGING]
    if len(pair) == 2 and study.corners:
        study.estimates = estimates(study, pair[preset], pair[coarser])
    if level == "full":
        sizes = ConvergencePlan().falling(design)
        study.driven = [measured_row(design, build_mesh(design, size), "P2", size)[0] for size in sizes]
        study.bars = bars(study.driven)
    return study


def on_mesh(design: Design, mesh: BodyMesh, size: float, share: float) -> tuple[Row, list[Row], Solver]:
    """Numbers on one mesh, and its states as a run would list them."""
    begin = time.perf_counter()
    solver = Solver(design, mesh, Silent())
    measurer = solver.measurer
    active = _at_force(design, solver)
    passive = solver.solve(Wanted("passive", "passive", tension=design.tension(0.0))).state
    equivalent = von_mises(cauchy_stress(passive.points))
    X = solver.model.system.space.quadrature_points
    place = X[:, *np.unravel_index(equivalent.argmax(), equivalent.shape)]
    corner = design.landmarks()["corner_short"]
    near = np.hypot(X[0] - corner[0], X[2] - corner[2]) < NEAR
    row = {
        "size_mm": size,
        "corner_share_1": share,
        "corner_element_mm": _corner_size(design, mesh),
        "mean_element_mm": float(mesh.volumes.mean() ** (1.0 / 3.0)),
        "elements_1": mesh.n_elements,
        "unknowns_1": solver.model.n_dofs,
        "tension_kPa": active.step.tension * tension_unit(design),
        "closing_mm": measurer.tip_closing(active),
        "passive_closing_mm": measurer.tip_closing(passive),
        "passive_force_mN": measurer.muscle_force(passive),
        "passive_stretch_1": measurer.fibre_stretch(passive),
        "ball_kPa": measurer.ball_von_mises(passive),
        "corner_peak_kPa": float(equivalent[near].max()),
        "peak_kPa": float(equivalent.max()),
        "peak_at_mm": " ".join(f"{x:.2f}" for x in place),
        "seconds_s": time.perf_counter() - begin,
    }
    states = [
        {"key": key, "label": label, **measurer.measures(state)}
        for key, label, state in (("force_1", f"{FORCE:g} mN", active), ("passive", "passive", passive))
    ]
    return row, states, solver


def _at_force(design: Design, solver: Solver) -> SolidState:
    """State at the wanted force, one secant closer than a run asks for, so that only the mesh's error is left."""
    near = solver.solve(Wanted("force", "force", tension=None, force=FORCE)).state
    t1, f1 = solver.seen[-1]
    t0, f0 = [pair for pair in solver.seen if abs(pair[1] - f1) > 1e-9][-1]
    tension = t1 + (FORCE - f1) * (t1 - t0) / (f1 - f0)
    state = solve(solver.model, [tension_step(design, tension)], start=[near], solver=solver.solver).last
    assert abs(solver.measurer.muscle_force(state) - FORCE) < 1e-5 * FORCE
    return state


def _corner_size(design: Design, mesh: BodyMesh) -> float:
    """Edge of the even tetrahedron whose volume is the mean of those at the re-entrant corner lines [mm]."""
    x, _, z = design.landmarks()["corner_short"]
    on_line = (np.abs(np.abs(mesh.points[0]) - abs(x)) < 1e-9) & (np.abs(mesh.points[2] - z) < 1e-9)
    return float((6.0 * math.sqrt(2.0) * mesh.volumes[on_line[mesh.cells].any(axis=0)].mean()) ** (1.0 / 3.0))


def observed(study: Study, name: str) -> Row:
    """Orders and limits of one quantity: of all zones together over the mean element, of the corners alone."""
    h, v = column(study.sizes, "mean_element_mm"), column(study.sizes, name)
    order, limit = fitted(h, v)
    row = {"quantity": name, "order_1": order, "limit": limit, "first_order_limit": fitted(h, v, (1.0,))[1]}
    if study.corners:
        c, w = column(study.corners, "corner_element_mm"), column(study.corners, name)
        at_corner = [_shown(richardson_order(c[k : k + 3], w[k : k + 3])) for k in range(len(c) - 2)]
        row |= {"corner_orders_1": " ".join(at_corner), "corner_limit": _extrapolated(c, w)}
    return row


def _shown(order: float | None) -> str:
    return "none" if order is None else f"{order:.2f}"


def _extrapolated(h: Array, v: Array) -> float:
    """Limit from the two finest meshes with the order of the theory."""
    return float(v[-1] + (v[-1] - v[-2]) / ((h[-2] / h[-1]) ** THEORY - 1.0))


def richardson_order(h: Array, v: Array) -> float | None:
    """Order that holds on three meshes; None where none between 0.05 and 6 does."""
    return observed_order(h, v, 0.05, 6.0)


def fitted(h: Array, v: Array, orders: Iterable[float] = tuple(np.linspace(0.1, 3.0, 291))) -> tuple[float, float]:
    """Order and limit of ``v = limit + c h^p`` by least squares over all meshes, p out of `orders`."""
    found = []
    for p in orders:
        A = np.stack([np.ones_like(h), h**p], axis=1)
        x, *_ = np.linalg.lstsq(A, v, rcond=None)
        found.append((float(np.linalg.norm(A @ x - v)), float(p), float(x[0])))
    return min(found)[1:]


def estimates(study: Study, fine: tuple[BodyMesh, list[Row]], coarse: tuple[BodyMesh, list[Row]]) -> list[Row]:
    """What a run on the preset's mesh prints as its error, beside the distance to the limits found here."""
    (mesh, states), (coarse_mesh, coarse_states) = fine, coarse
    ratio = (mesh.n_elements / coarse_mesh.n_elements) ** (1.0 / 3.0)
    names = {
        ("force_1", "tip_closing_mm"): "closing_mm",
        ("passive", "tip_closing_mm"): "passive_closing_mm",
        ("passive", "muscle_force_mN"): "passive_force_mN",
        ("passive", "fibre_stretch_1"): "passive_stretch_1",
        ("passive", "ball_von_mises_kPa"): "ball_kPa",
    }
    printed = {(row["state"], row["quantity"]): row for row in error_estimate(states, coarse_states, ratio)}
    labels = {state["key"]: state["label"] for state in states}
    limits = {row["quantity"]: (row["limit"], row["first_order_limit"]) for row in study.orders}
    rows = []
    for (key, quantity), name in names.items():
        row = printed[labels[key], quantity]
        value, other = row["this mesh"], row["coarser mesh"]
        error = row["estimated error"]
        truths = [abs(value - limit) for limit in limits[name]]
        rows.append(
            {
                "quantity": name,
                "preset": value,
                "coarser": other,
                "ratio_used_1": ratio,
                "printed_error": error,
                "printed_1": error / abs(value),
                "true_error": truths[0],
                "true_error_1": truths[0] / abs(value),
                "true_at_first_order_1": truths[1] / abs(value),
                "printed_over_true_1": error / truths[0],
                "printed_over_first_order_1": error / truths[1],
                "ratio_of_sizes_over_true_1": abs(value - other) / (COARSER - 1.0) / truths[0],
            }
        )
    return rows


def bars(driven: Sequence[Row], wanted: float = 0.01) -> list[Row]:
    """Limits at full drive as `study convergence` tells them, with their bars, beside the intervals of `KNOWN`."""
    h = [float(row["size_mm"]) for row in driven]
    rows = []
    for name, (low, high) in KNOWN.items():
        found = limit(h, [float(row[name]) for row in driven], wanted, THEORY)
        reach = found.bar * abs(found.finest)
        rows.append(
            {
                "quantity": name,
                "finest": found.finest,
                "limit": found.value,
                "known_to_1": found.bar,
                "from": found.value - reach,
                "to": found.value + reach,
                "error_of_finest_1": found.error,
                "known_from": low,
                "known_to": high,
            }
        )
    return rows


def quadratures(design: Design, solver: Solver, size: float) -> list[Row]:
    """Passive state with four points (degree 2) and with fourteen (degree 5)."""
    path = [tension_step(design, share * design.tension(0.0)) for share in (1 / 3, 2 / 3, 1.0)]
    found = []
    for degree in (2, 5):
        model = replace(solver.moulded, quadrature_degree=degree)
        state = solve(model, path).last
        found.append((Measurer(design, model).measures(state), energy_parts(design, state)))
    (two, parts_two), (five, parts_five) = found
    names = (
        "tip_closing_mm",
        "sagitta_mm",
        "muscle_force_mN",
        "fibre_stretch_1",
        "ball_von_mises_kPa",
        "strain_energy_uJ",
    )
    pairs = [(name, two[name], five[name]) for name in names]
    pairs += [(part, parts_two[part], parts_five[part]) for part in parts_two]
    return [
        {"size_mm": size, "quantity": name, "degree_2": a, "degree_5": b, "difference_1": a / b - 1.0}
        for name, a, b in pairs
    ]


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study, level: str) -> None:
    """What converges does; what does not is caught at it."""

    def changes(name: str) -> Array:
        v = column(study.sizes, name)
        return np.abs(np.diff(v)) / np.abs(v[1:])

    for name in ("closing_mm", "passive_closing_mm"):
        # displacement elements are too stiff, less so on finer meshes
        assert np.all(np.diff(column(study.sizes, name)) > 0.0), f"{name}: not increasing"
    for name in ("closing_mm", "passive_closing_mm", "passive_force_mN", "passive_stretch_1"):
        assert changes(name).max() < 0.015, f"{name}: changes by {changes(name).max():.1%} between two meshes"
    # the peak at the corner grows on every finer mesh, without slowing down, the ball's mean hardly
    h, peak, ball = (column(study.sizes, name) for name in ("size_mm", "corner_peak_kPa", "ball_kPa"))
    growth = np.diff(np.log(peak)) / -np.diff(np.log(h))
    assert np.all(growth > 0.15), f"the peak at the corner does not grow: {peak}"
    assert ball[-1] / ball[0] - 1.0 < 0.3 * (peak[-1] / peak[0] - 1.0), "the ball's mean grows as the peak does"
    for row in study.quadratures:
        limit = 0.002 if "energy" not in row["quantity"] else 0.05
        assert abs(row["difference_1"]) < limit, f"{row['quantity']}: quadratures differ by {row['difference_1']:.2%}"
    if level == "smoke":
        return
    assert growth[-1] > 0.8 * growth[0], f"the growth of the peak slows down: {growth}"
    corner_h, corner_peak, corner_ball = (
        column(study.corners, name) for name in ("corner_element_mm", "corner_peak_kPa", "ball_kPa")
    )
    exponent = math.log(corner_peak[-1] / corner_peak[-2]) / math.log(corner_h[-2] / corner_h[-1])
    # r to the power -0.4555, give or take a point of quadrature
    assert 0.3 < exponent < 0.65, f"the peak grows with the exponent {exponent:.2f}"
    assert abs(corner_ball[-1] / corner_ball[-2] - 1.0) < 0.005, f"the ball's mean does not settle: {corner_ball}"
    orders = {row["quantity"]: row for row in study.orders}
    at_corner = float(orders["closing_mm"]["corner_orders_1"].split()[-1])
    assert 0.7 * THEORY < at_corner < 1.3 * THEORY, f"closing: order {at_corner:.2f} at the corner"
    for name in ("closing_mm", "passive_closing_mm"):
        # it must not be taken for the order 4 of smooth solutions, nor be far below one
        assert 0.7 < orders[name]["order_1"] < 2.0, f"{name}: order {orders[name]['order_1']:.2f}"
    expect_bars(study.bars)
    for row in study.estimates:
        if row["quantity"].endswith("closing_mm"):
            share = min(row["printed_over_true_1"], row["printed_over_first_order_1"])
            assert share > 0.9, f"{row['quantity']}: a run admits {share:.0%} of its error"


def expect_bars(rows: Sequence[Row]) -> None:
    """Five meshes no finer than the preset's know both limits within 1 %, and their bars hold them."""
    for row in rows:
        inside = row["from"] <= row["known_from"] and row["known_to"] <= row["to"]
        assert inside, f"{row['quantity']}: {row['from']:.4f} to {row['to']:.4f} does not hold what is known"
        assert row["known_to_1"] < 0.01, f"{row['quantity']}: known to {row['known_to_1']:.2%} only"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Five sizes of 18 816 to 210 036 unknowns, four meshes refined at the corner lines alone, and once one more size, 0.33
mm with 458 982 unknowns (5.5 GB, nine minutes). Numbers in brackets are with it.

* Tip closing at 1 mN: 0.7464, 0.7517, 0.7571, 0.7603, 0.7625 mm [0.7660]. Over the mean element size the observed
  order is 1.3 [1.1], the limit 0.771 [0.774] mm: the preset's mesh is 1.8 [2.2] % off. Passive closing: 3.270, 3.287,
  3.304, 3.311, 3.321 mm [3.332], order 1.4 [1.0], limit 3.342 [3.360] mm: 1.2 [1.7] % off. The limits still move with
  a finer mesh, so the last digit of the percentages is not sure.
* Muscle force, passive: 3.982 to 3.962 mN [3.955], fibre stretch 0.6927 to 0.6913 [0.6909]: 0.6 % and 0.2 % off if
  the order is one; the observed ones are 0.7 and 1.1 [0.4 and 0.7], so the force may be off by 1 to 2 %.
* A run prints 3.4 % for the closing at 1 mN and 2.2 % for the passive one: first order over the mean element size,
  from two meshes. That order is the one observed, and the printed errors are 1.9 [1.3 to 1.6] times the distance to
  the limit: right, and on the safe side. The ratio of the sizes asked for (1.6 instead of the 1.26 of the elements)
  would give 0.8 [0.5 to 0.7] of it and must not be used.
* Four fifths [two thirds] of the error at 1 mN come from the re-entrant corners: refining these lines alone gives
  0.7571, 0.7604, 0.7644 and 0.7663 mm, at last with order 1.2 (theory 1.09), to 0.768 mm. A quarter of the corner's
  element size costs 78 % more elements and takes away more of the error than half the general size, which costs 257 %
  more. Of the passive closing's error a third [a fifth] is the corners'; most of the rest is the junction's: half its
  elements' size and the rings' adds 0.010 mm, the rings' alone 0.001 mm (tried once, not in the tables).
* Von Mises at the short pillar's corner: the mean in the ball is 5.80 kPa on the preset's mesh and 6.00 once the
  corner's elements are below 0.1 mm, where it has settled to 0.2 %; refined with all zones it is on its way there
  (5.91 [5.94]), without an order worth the name. A run's 3.5 % is right. The peak goes 14.0, 15.1, 16.4, 18.2, 20.1
  [22.4] and, with the corner's elements alone, 16.4, 16.5, 20.6, 28.0 kPa: at last like h to the power -0.44 (theory
  -0.456). The highest value anywhere sits in the muscle at the ring's corners, where the fibres turn about an edge,
  and grows from 15.9 to 31.0 [35.0] kPa. Neither is a result.
* At full drive (10.39 kPa; tried once, not in the tables) the preset's mesh gives 3.683 mm and 4.405 mN. Where its
  error sits, by halving one zone after the other of a graded mesh of 51 045 unknowns (3.6965 mm): the edges by which
  the junction enters the rings, where the fibres turn, from 0.10 to 0.05 mm add 0.0091 mm, the re-entrant corners from
  0.18 to 0.09 mm 0.0051 mm, the beam's span 0.0040, the rings' legs beside the junction 0.0039, the rings 0.0024. At
  first order as much again is left: a limit of 3.745 mm. Three even meshes (2.3, 1.44 and 0.9 mm) give 3.750 mm at the
  order 1.2 that they show, meshes refined for the closing (`study convergence --refine`) 3.735 mm over their estimated
  errors, of which they see a third to a half: 3.745 mm, give or take 0.01. The preset's mesh is 1.7 % off, and the
  force 0.6 %: it still falls, to 4.384 mN with 203 568 unknowns, where the closing is 3.718 mm.
* Graded by hand (`mesh.grading`), with elements half again as long along y, as all these edges and the beam's bending
  are: at 3.58, 2.24, 1.4, 1.15 and 0.9 mm 19 368, 29 478, 51 762, 68 106 and 101 526 unknowns give 3.665, 3.677, 3.696,
  3.703 and 3.710 mm, 4.417, 4.405, 4.397, 4.393 and 4.390 mN. With elements as long as wide such meshes took 56 598
  unknowns for 3.693 mm and 94 998 for 3.702; made longer, the preset's loses 0.004 mm and a quarter of its unknowns.
  The way to full drive takes 22 iterations with 51 762 unknowns, 15 with the preset's, and as long (8 s).
* The changes of this sequence, 0.013, 0.019, 0.007 and 0.007 mm, do not shrink with one order: the edges and corners
  come into their own one after the other. No mesh of it up to 100 000 unknowns is within 1 % by its own bar.
* What even meshes up to the preset's size know of the limit: 2.304, 1.821, 1.44, 1.138 and 0.9 mm (16 503 to 61 617
  unknowns, mean elements of 0.4250, 0.3845, 0.3376, 0.3056 and 0.2682 mm) give 3.6358, 3.6478, 3.6626, 3.6728 and
  3.6830 mm, 4.4311, 4.4272, 4.4200, 4.4093 and 4.4051 mN at full drive. Laws that values and theory admit put the
  limits at 3.734 mm, known to 0.80 % (3.704 to 3.763), and 4.383 mN, known to 0.94 % (4.342 to 4.425): within 1 %
  both, and both hold what is known by other means. The meshes' scatter is 0.02 and 0.06 %. Most of the bar is the
  order's: the closing shows 1.2, but admits up to 2.1, which would put it at 3.709 mm; theory's puts it at 3.757. The
  force shows no order; with one of 0.5, which theory excludes, it would be 4.297 mN. Three of these meshes give
  3.753 mm to 0.5 %, of whose scatter they know nothing, and no order of the force. The preset's mesh itself stays 1.4 %
  below and 0.5 % above these limits, with 2.2 and 1.4 % as its bars.
* What is refined at those edges folds sooner. With 0.09 mm there no equilibrium is stable above 14.2 kPa, and the way
  to 14 kPa takes 54 iterations; with 0.126 mm (1.4 mm) it takes 26, in the preset's mesh 17, and 18 kPa are reached.
* The strain energy, 12.44, 12.47 and 12.83 uJ on even meshes of 2.3, 1.44 and 0.9 mm, has no order: that of the rings
  goes from 2.9 to 3.2 uJ and back with the mesh, nearly half of it within 0.4 mm of the edges of the pillars, which
  elements of 0.6 mm do not resolve. The skeleton's stays between 5.49 and 5.55 uJ beyond 35 000 unknowns.
* Four quadrature points against fourteen on the preset's mesh: closing and force differ by 0.10 and 0.09 %, stretch
  by 0.01 %, the ball's mean by 0.03 %: three digits, not four, and a tenth of the mesh's own error. The strain energy
  differs by 1.1 %, all of it in the rings (4.3 % there), at their corners.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
Fillets, the remodelled tissue, other designs, a fibre field that turns smoothly into the rings, sizes of junction and
ring refined alone.
"""


def tables(study: Study) -> list[Table]:
    """What is printed."""
    parts = {
        "Meshes, every zone refined": study.sizes,
        "Meshes, only the corner lines refined": study.corners,
        "Orders and limits": study.orders,
        "What a run on the preset's mesh prints as its error, and the truth": study.estimates,
        "Quadrature, passive state": study.quadratures,
        "Full drive, five meshes": study.driven,
        "Full drive, what five meshes know": study.bars,
    }
    return [
        Table(title, tuple(rows[0]), tuple(tuple(row.values()) for row in rows))
        for title, rows in parts.items()
        if rows
    ]


def write(study: Study, folder: Path) -> None:
    """CSV of all tables and a picture of what converges and what does not."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("sizes", "corners", "orders", "estimates", "quadratures", "driven", "bars"):
        if rows := getattr(study, name):
            write_table(folder / f"{name}.csv", rows)
    figure = Figure(figsize=(10.0, 4.0), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    h = column(study.sizes, "mean_element_mm")
    for row in study.orders:
        error = np.abs(column(study.sizes, row["quantity"]) / row["limit"] - 1.0)
        left.loglog(h, error, "-o", markersize=3, linewidth=1.0, label=CONVERGING[row["quantity"]])
    left.loglog(h, 0.05 * h / h[0], "k:", linewidth=1.0, label="order 1")
    left.set_xlabel("mean element [mm]")
    left.set_ylabel("relative distance to the limit [1]")
    left.legend(frameon=False, fontsize=7)
    families = {"-o": study.sizes, "--s": study.corners}
    for number, (name, label) in enumerate({**PEAKS, "ball_kPa": CONVERGING["ball_kPa"]}.items()):
        for style, rows in families.items():
            if rows:
                h, v = column(rows, "corner_element_mm"), column(rows, name)
                right.loglog(h, v, style, color=f"C{number}", markersize=3, label=label if style == "-o" else None)
    right.set_xlabel("elements at the re-entrant corner [mm]")
    right.set_title("full: every zone refined, dashed: corner lines only", fontsize=9)
    right.set_ylabel("stress, passive state [kPa]")
    right.legend(frameon=False, fontsize=7)
    with replacing(folder / "mesh_error.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--level", choices=tuple(SIZES), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "mesh_error")
    parser.add_argument("--also", type=float, nargs="*", default=(), metavar="MM", help="further mesh sizes [mm]")
    options = parser.parse_args()
    study = run(options.level, options.also)
    show_tables(tables(study))
    write(study, options.out)
    print(f"\n{os.cpu_count()} processors; files in {options.out}")
    expect(study, options.level)
    print("every expectation holds")


if __name__ == "__main__":
    main()
