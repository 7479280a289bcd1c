"""Study: how far oxygen reaches into the tissue, and what consumption the paper's viable fractions ask for.

Question
--------
Is the field of oxygen right: against closed forms of constant consumption and against Michaelis-Menten on a fine line,
at which order? The paper has gamma = 0.83 for its ring of 1.08 mm^2 and 1 for the junction of 0.4 mm: which consumption
does each need, is there one for both, and is it one that cells have? How thick may tissue be?

Run: ``python studies/oxygen.py [--level smoke|full] [--out FOLDER]``; about two minutes at level full.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.integrate import solve_bvp

from fem_biobot.config import load_design
from fem_biobot.files import replacing
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.muscle.oxygen import OxygenField, OxygenLaw, steady_oxygen
from fem_biobot.muscle.oxygen_depth import (
    anoxic_radius,
    consumption_for,
    critical_thickness,
    largest_thickness,
    section,
    slab,
    slab_profile,
)
from fem_biobot.muscle.oxygenation import oxygen_law, oxygenation
from fem_biobot.progress import show_tables
from fem_biobot.study.outputs import write_table
from fem_biobot.tables import Table

Array = NDArray[np.float64]
Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

LAW = oxygen_law(load_design("junction_bot"))  # defaults, their sources in muscle.oxygenation
GAMMA_RING, RING_SECTION = 0.83, 1.08  # gamma_MT_ring, A_tol_MT_ring
GAMMA_JUNCTION, JUNCTION = 0.999, (2.2, 0.4)  # gamma_junction "about 1"; trench_depth, the width an assumption
CELLS = 0.5e6 / 100.0  # cells a mm^3 as seeded: cells_per_100uL
# use of oxygen, in order [mM/s]; 1 cell/mm^3 at 1 mol/s is 1e9 mM/s
USES = {
    "lung fibroblasts in fibrin, 1.3e-17 mol/s a cell, as seeded": 1.3e-17 * CELLS * 1e9,
    "C2C12 in wells, 80 pmol/min of 15 000 cells, as seeded": 80e-12 / 60.0 / 1.5e4 * CELLS * 1e9,
    "mouse leg muscle at rest, 0.63 nmol/s a gram": 0.63e-9 * 1.06e-3 * 1e9,
    "C2C12 in wells, 200 pmol/min of 15 000 cells, as seeded": 200e-12 / 60.0 / 1.5e4 * CELLS * 1e9,
    "mouse leg muscle stimulated, five times that": 5.0 * 0.63e-9 * 1.06e-3 * 1e9,
}
COUNTS = {"smoke": (8, 16, 32), "full": (8, 16, 32, 64, 128)}
DISCS = {"smoke": (2, 3), "full": (2, 3, 4)}
FINENESS = {"smoke": (2, 10), "full": (4, 48)}  # divisions of a round section, elements over half a thickness
SIZES: dict[str, tuple[float, ...]] = {"smoke": (), "full": (1.5, 0.9, 0.5)}  # mm; of the body's mesh
CONSUMPTIONS = {"smoke": (1e-3, 1e-2), "full": (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)}

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# Errors are root mean squares over the tissue, over the supply: third order for quadratic elements where the field is
# smooth. Gamma counts the quadrature points below the threshold: first order in the element size. Consumptions are
# roots in gamma, found to 1e-5.


@dataclass
class Study:
    """Errors by number of elements, consumptions that the paper's fractions need, gamma by mesh, and the rule."""

    errors: list[Row] = field(default_factory=list)
    needs: list[Row] = field(default_factory=list)
    meshes: list[Row] = field(default_factory=list)
    rule: list[Row] = field(default_factory=list)
    profiles: dict[str, tuple[Array, Array]] = field(default_factory=dict)


# --- run --------------------------------------------------------------------------------------------------------------


def on_a_line(law: OxygenLaw, radius: float, power: int) -> Callable[[Array], Array]:
    """Slab (power 0) or cylinder (1) by collocation on a line: scipy's, nothing of the package."""

    def rhs(r: Array, y: Array) -> Array:
        c = np.maximum(y[0], 0.0)
        return np.vstack([y[1], law.consumption * c / (law.half_saturation + c) / law.diffusivity])

    def ends(a: Array, b: Array) -> Array:
        return np.array([a[1], b[0] - law.supply])

    r = np.linspace(0.0, radius, 400)
    guess = law.supply * np.vstack([0.1 + 0.9 * (r / radius) ** 2, 1.8 * r / radius**2])
    S = None if power == 0 else np.array([[0.0, 0.0], [0.0, -1.0]])
    found = solve_bvp(rhs, ends, r, guess, S=S, tol=1e-9, max_nodes=50_000)
    assert found.success, found.message
    return lambda at: found.sol(at)[0]


def error(found: OxygenField, exact: Callable[[Array], Array]) -> float:
    """Root mean square over the mesh, over the supply."""
    X = np.asarray(found.basis.global_coordinates())
    r, dx = np.sqrt((X**2).sum(axis=0)), found.basis.dx
    off = found.points - exact(r.ravel()).reshape(r.shape)
    return float(np.sqrt((dx * off**2).sum() / dx.sum())) / found.law.supply


def errors(level: str) -> list[Row]:
    """Slab and cylinder, constant consumption and Michaelis-Menten, by number of elements."""
    rows = []
    hungry = replace(LAW, consumption=0.015)
    constant = replace(hungry, half_saturation=1e-9 * LAW.supply)
    radius, thin, thick = 0.4146, 0.9 * critical_thickness(constant), 0.8
    core = anoxic_radius(constant, radius)

    def krogh(r: Array) -> Array:
        out = np.maximum(r, core)
        turned = out**2 - core**2 - 2.0 * core**2 * np.log(out / core)
        return constant.consumption * turned / (4.0 * constant.diffusivity)

    slabs: dict[str, tuple[OxygenLaw, float, Callable[[Array], Array]]] = {
        "slab, constant, oxygen throughout": (constant, thin, lambda x: slab_profile(constant, thin, x)),
        "slab, constant, anoxic core": (constant, thick, lambda x: slab_profile(constant, thick, x)),
        "slab, Michaelis-Menten": (hungry, thick, on_a_line(hungry, thick / 2, 0)),
    }
    for name, (law, thickness, exact) in slabs.items():
        for n in COUNTS[level]:
            rows.append({"case": name, "elements_1": n, "error_1": error(slab(law, thickness, n), exact)})
    discs: dict[str, tuple[OxygenLaw, Callable[[Array], Array]]] = {
        "cylinder, constant, anoxic core": (constant, krogh),
        "cylinder, Michaelis-Menten": (hungry, on_a_line(hungry, radius, 1)),
    }
    for name, (law, exact) in discs.items():
        for n in DISCS[level]:
            mesh = skfem.MeshTri2.init_circle(n).scaled(radius)
            rows.append({"case": name, "elements_1": 2**n, "error_1": error(steady_oxygen(mesh, law), exact)})
    for row, before in zip(rows[1:], rows, strict=False):
        same = row["case"] == before["case"] and min(row["error_1"], before["error_1"]) > 1e-11
        rate = math.log(before["error_1"] / row["error_1"]) / math.log(row["elements_1"] / before["elements_1"])
        row["order_1"] = rate if same and row["error_1"] > 1e-9 else None
    return [{"order_1": None, **row} for row in rows]


def round_gamma(area: float, level: str) -> Callable[[OxygenLaw], float]:
    """Viable share of a round section wetted all round, by its law."""
    radius = math.sqrt(area / math.pi)
    mesh = skfem.MeshTri2.init_circle(FINENESS[level][0]).scaled(radius)

    def share(law: OxygenLaw) -> float:
        found = steady_oxygen(mesh, law)
        if found.c.min() >= law.threshold:
            return 1.0
        # the field depends on the radius alone, so the core's edge is where its sorted values pass the threshold
        order = np.argsort(found.c)
        edge = np.interp(law.threshold, found.c[order], np.sqrt((found.basis.doflocs**2).sum(axis=0))[order])
        return 1.0 - float(edge / radius) ** 2

    return share


def needs(level: str) -> list[Row]:
    """Consumption that the paper's gamma asks for, by what the section is taken to be."""
    rectangle, across = (RING_SECTION / 2.0 / 0.5, 0.5), FINENESS[level][1]
    cases: list[tuple[str, float, Callable[[OxygenLaw], float]]] = [
        ("ring, one round strand of 1.08 mm^2", GAMMA_RING, round_gamma(RING_SECTION, level)),
        ("ring, two round strands of 0.54 mm^2", GAMMA_RING, round_gamma(RING_SECTION / 2.0, level)),
        ("ring, two strands of 0.5 by 1.08 mm", GAMMA_RING, lambda law: section(law, *rectangle, across).gamma()),
        ("junction, 2.2 by 0.4 mm: at most", GAMMA_JUNCTION, lambda law: section(law, *JUNCTION, across).gamma()),
    ]
    rows = []
    for name, gamma, share in cases:
        start = replace(LAW, consumption=0.01)
        mm = consumption_for(share, start, gamma)
        rows.append(
            {
                "section": name,
                "gamma_1": gamma,
                "consumption_mM_per_s": mm,
                "over_resting_muscle_1": mm / USES["mouse leg muscle at rest, 0.63 nmol/s a gram"],
                "mol_per_cell_and_s": mm / (CELLS * 1e9),
            }
        )
    rows.append(
        {
            "section": "diffusion limit of 0.2 mm, constant use",
            "gamma_1": None,
            "consumption_mM_per_s": (mm := 2.0 * LAW.diffusivity * LAW.supply / 0.2**2),
            "over_resting_muscle_1": mm / USES["mouse leg muscle at rest, 0.63 nmol/s a gram"],
            "mol_per_cell_and_s": mm / (CELLS * 1e9),
        }
    )
    return rows


def meshes(level: str, consumption: float) -> list[Row]:
    """Gamma on meshes of both machines at one consumption."""
    rows = []
    for name in ("junction_bot", "ring_bot"):
        settings = ["muscle.gamma = 1", f"muscle.oxygen.consumption = {consumption!r} mM/s"]
        for size in SIZES[level]:
            design = load_design(name, settings)
            mesh, _ = mesh_for(design, size)
            found = oxygenation(design, mesh)
            rows.append(
                {
                    "machine": name,
                    "size_mm": size,
                    "tissue_elements_1": len(found.middle),
                    "solved_elements_1": len(found.tissue),
                    "gamma_1": found.gamma,
                    "gamma_whole_1": found.gamma_whole,
                    "undershoot_1": found.field.undershoot,
                }
            )
    return rows


def run(level: str) -> Study:
    """All parts of a level."""
    study = Study(errors(level), needs(level))
    both = study.needs[1]["consumption_mM_per_s"]
    study.meshes = meshes(level, both)
    for consumption in CONSUMPTIONS[level]:
        law = replace(LAW, consumption=consumption)
        row = {"consumption_mM_per_s": consumption, "critical_mm": critical_thickness(law)}
        study.rule.append({**row, **{f"gamma_{g}_mm": largest_thickness(law, g) for g in (0.95, 0.83)}})
    for name, law in {"constant": replace(LAW, consumption=both, half_saturation=1e-9), "Michaelis-Menten": replace(
        LAW, consumption=both)}.items():  # fmt: skip
        found = slab(law, 0.8)
        order = np.argsort(found.basis.doflocs[0])
        study.profiles[name] = (found.basis.doflocs[0][order], found.c[order])
    return study


# --- expectations -----------------------------------------------------------------------------------------------------


def expect(study: Study) -> None:
    """What the study expects."""
    for case in dict.fromkeys(row["case"] for row in study.errors):
        rows = [row for row in study.errors if row["case"] == case]
        limit = 1e-3 if "anoxic" in case else 2e-4
        assert rows[-1]["error_1"] < limit, f"{case}: an error of {rows[-1]['error_1']:.1e} is left"
        if "Michaelis" in case:
            last = rows[-1]["order_1"]
            assert last is not None, f"{case}: no order"
            assert last > 2.6, f"{case}: order {last:.2f}"
    two, junction = (study.needs[k]["consumption_mM_per_s"] for k in (1, 3))
    assert two < 1.2 * junction, f"no consumption gives both fractions: {two:.3g} for the ring, {junction:.3g} at most"
    for row in study.rule:
        assert row["gamma_0.95_mm"] > row["critical_mm"], "tissue is thinner than constant use allows"
    whole = [row["gamma_whole_1"] for row in study.meshes if row["machine"] == "junction_bot"]
    for before, after in pairwise(whole):
        assert abs(after - before) < 0.03, f"junction_bot: gamma of all tissue moves from {before:.3f} to {after:.3f}"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
* The field: the parabola of constant consumption to 2e-9 of the supply, the anoxic core of a slab to 2e-6; with
  Michaelis-Menten order 3.00 in a slab (8e-5 on 8 elements, 2e-8 on 128) and 2.96 in a cylinder (2e-5 on 16 across).
  The cylinder's anoxic core, whose edge lies inside elements, to 1.5e-4.
* gamma = 0.83 in 1.08 mm^2 needs 0.011 mM/s in one round strand, 0.021 in two, 0.031 in two strands of 0.5 by 1.08 mm.
  The junction of 0.4 mm stays whole up to 0.030 mM/s. So one consumption, 0.01 to 0.03 mM/s, gives both of the paper's
  fractions, and its diffusion limit of 0.2 mm (0.017 mM/s at constant use) lies in the same range: consistent.
* It is not what cells at rest use: 16 to 45 times mouse muscle at rest, 3 to 9 times the same muscle stimulated, 160 to
  480 times fibroblasts at the seeded density. Either the cells work and are several times denser than seeded (human
  myobundles used 20 times as much when stimulated: Davis et al. 2019), the medium holds less than 0.2 mM at the muscle
  (a film: required consumption falls with it), or 0.83 is not oxygen's doing. At the default consumption, that of
  resting muscle, every preset is viable throughout.
* The rule: thickness wetted on both sides with 95 % viable is 0.070 mm divided by the root of the consumption in mM/s:
  2.2 mm at 0.001, 0.70 mm at 0.01, 0.49 mm at 0.02. It exceeds what constant use allows by a third, since cells use
  less where there is little.
* On meshes at 0.021 mM/s the body's own elements are too coarse for the depth of 0.18 mm: undivided they leave 0.82
  to 0.84 of all tissue of the junction machine viable. Meshes are therefore divided where elements exceed 0.6 of the
  depth: 0.767, 0.761 and 0.738 at 1.5, 0.9 and 0.5 mm, still falling. The junction is whole on all; what dies are the
  rings' sides on the pillars. The ring machine: 0.89 to 0.94, the plane section 0.91.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
Cells that die, move away or adapt, myoglobin, consumption that rises with work in the same muscle, the medium's own
depth (a film lowers every thickness here), glucose; cell density after compaction, which raises every use per volume.
"""


def tables(study: Study) -> list[Table]:
    """What is printed."""

    def table(title: str, rows: list[Row]) -> Table:
        names = tuple(dict.fromkeys(name for row in rows for name in row))
        return Table(title, names, tuple(tuple(row.get(name) for name in names) for row in rows))

    uses = Table("Uses of oxygen", ("whose", "consumption [mM/s]"), tuple(USES.items()))
    shown = [table("Errors", study.errors), table("Consumption that the paper's gamma needs", study.needs), uses]
    if study.meshes:
        shown.append(table("Gamma on meshes, at the consumption of two round strands", study.meshes))
    return [*shown, table("Largest thickness, wetted on both sides", study.rule)]


def write(study: Study, folder: Path) -> None:
    """Tables and a picture: errors, profiles, the rule."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "errors.csv", study.errors)
    write_table(folder / "consumption.csv", study.needs)
    write_table(folder / "thickness.csv", study.rule)
    if study.meshes:
        write_table(folder / "meshes.csv", study.meshes)
    figure = Figure(figsize=(13.0, 4.2), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    left, middle, right = figure.subplots(1, 3)
    for case in dict.fromkeys(row["case"] for row in study.errors):
        rows = [row for row in study.errors if row["case"] == case]
        left.loglog([r["elements_1"] for r in rows], [r["error_1"] for r in rows], "-o", markersize=3, label=case)
    left.set_xlabel("elements across")
    left.set_ylabel("error over the supply [1]")
    left.legend(frameon=False, fontsize=6.5)
    for name, (x, c) in study.profiles.items():
        middle.plot(x, c, label=name)
    middle.axhline(LAW.threshold, color="0.6", linestyle=":", linewidth=1.0)
    middle.set_xlabel("from the middle of a slab of 0.8 mm [mm]")
    middle.set_ylabel("oxygen [mM]")
    middle.legend(frameon=False, fontsize=8)
    at = [row["consumption_mM_per_s"] for row in study.rule]
    for key, text in (("gamma_0.95_mm", "95 % viable"), ("gamma_0.83_mm", "83 %"), ("critical_mm", "constant use")):
        right.loglog(at, [row[key] for row in study.rule], label=text)
    for name, use in USES.items():
        right.axvline(use, color="0.75", linewidth=0.8)
        right.annotate(name.split(",")[0], (use, 0.3), rotation=90, fontsize=5.5, ha="right", va="bottom")
    right.axhline(0.4, color="C3", linestyle=":", linewidth=1.0)
    right.set_xlabel("consumption [mM/s]")
    right.set_ylabel("largest thickness [mm]")
    right.legend(frameon=False, fontsize=8)
    with replacing(folder / "oxygen.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--level", choices=tuple(COUNTS), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "oxygen")
    options = parser.parse_args()
    study = run(options.level)
    show_tables(tables(study))
    write(study, options.out)
    print(f"\nfiles in {options.out}")
    expect(study)
    print("every expectation holds")


if __name__ == "__main__":
    main()
