"""Study: the paper's three equations beside the solid and the rods, over the range of the machine.

Question
--------
Eq. 1 is the force of a muscle from its tension, Eq. 2 that of a muscle that has shortened, Eq. 3 the force from the
sagitta of the beam. At which shortening of the muscle is each off by five and by ten per cent of the force through the
muscle, in the solid and in the rods?

Run: ``python studies/equations_of_the_paper.py [--level smoke|full] [--out FOLDER]``; two minutes at level full.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.equations import equation_1, equation_2, equation_3
from fem_biobot.files import replacing
from fem_biobot.link.alone import Pull
from fem_biobot.link.observed import Observed
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.link.strip import strip_from_mesh
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.progress import show_tables
from fem_biobot.rod.reduce import reduce
from fem_biobot.study.outputs import write_table
from fem_biobot.study.reporter import Silent
from fem_biobot.tables import Table

Array = NDArray[np.float64]
Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

DESIGN = "junction_bot"
SIZE = {"smoke": 2.0, "full": 1.2}  # mm
# nominal tensions [kPa]
TENSIONS = {
    "smoke": (0.02, 1.0, 3.0, 6.0),
    "full": (0.02, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0),
}
HELD = {"smoke": (3.0,), "full": (0.1, 5.0, 10.0, 14.0)}
MODELS = ("solid", "rods")
EQUATIONS = ("eq1", "eq2", "eq3")
PERCENT = (5, 10)

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# The force that an equation gives over the force through the muscle's mid-section, both of one state of one model. Each
# equation gets what it asks for from that state: the tension, the shortening of the fibres in the middle of the
# junction, the sagitta. The shortening of the muscle, 1 less the stretch, is what all three are drawn over.


@dataclass
class Study:
    """Rows of both models along the path, where each equation is off, and Eq. 1 of a muscle that is held."""

    rows: list[Row] = field(default_factory=list)
    answers: list[Row] = field(default_factory=list)
    held: list[Row] = field(default_factory=list)

    def of(self, model: str) -> list[Row]:
        return [row for row in self.rows if row["model"] == model]


def row_of(model: str, design: Design, state: Observed) -> Row:
    """Forces by the three equations over that of a state."""
    muscle, gel = design.value("muscle"), design.value("skeleton.material.young")
    strain, true = 1.0 - state.numbers["fibre_stretch_1"], state.numbers["muscle_force_mN"]
    area, theta = design.junction_section, muscle.theta
    # the nominal tension has gamma in it already
    forces = (
        equation_1(state.tension, area, theta),
        equation_2(state.tension, area, muscle.material.young, strain, theta),
        equation_3(state.numbers["sagitta_mm"], gel * design.second_moment, design.moment_arm, design.span),
    )
    return {
        "model": model,
        "tension_kPa": state.tension,
        "strain_1": strain,
        "force_mN": true,
        **{f"{name}_over_true_1": force / true for name, force in zip(EQUATIONS, forces, strict=True)},
    }


def run(level: str) -> Study:
    """Both models along one path, then where each equation departs."""
    design = load_design(DESIGN)
    study = Study()
    sides = (SolidSide(design, mesh_for(design, SIZE[level])[0]), RodSide(design, reduce(design)))
    for model, side in zip(MODELS, sides, strict=True):
        study.rows += [row_of(model, design, state) for state in side.states(TENSIONS[level], Silent())[0]]
        study.answers += [answer(study, model, name) for name in EQUATIONS]
    study.held = held(design, sides[0].mesh, HELD[level])
    return study


def held(design: Design, mesh: BodyMesh, tensions: Sequence[float]) -> list[Row]:
    """The muscle alone, bonded to plates that do not move: what Eq. 1 is about."""
    strip = strip_from_mesh(design, mesh, [Pull(T, 0.0, 0.0) for T in tensions])
    middle = len(strip.EA) // 2
    rows = []
    for T, passive in zip(tensions, strip.passive[:, middle], strict=True):
        force, theta = float(passive + strip.pull[middle] * T), design.value("muscle.theta")
        rows.append(
            {
                "tension_kPa": T,
                "force_mN": force,
                "eq1_over_true_1": equation_1(T, design.junction_section, theta) / force,
            }
        )
    return rows


def answer(study: Study, model: str, name: str) -> Row:
    """At which shortening an equation is off by 5 and 10 %, and how far it is off at none and at most."""
    rows = study.of(model)
    strain = np.array([row["strain_1"] for row in rows])
    off = np.array([row[f"{name}_over_true_1"] for row in rows]) - 1.0
    found: Row = {"model": model, "equation": name, "off_at_none_1": float(off[0]), "off_at_most_1": float(off[-1])}
    own = (1.0 + off) / (1.0 + off[0]) - 1.0
    for percent in PERCENT:
        found[f"strain_at_{percent}_pct_1"] = crossing(np.abs(off), strain, percent / 100.0)
        found[f"strain_at_{percent}_pct_off_its_own_at_none_1"] = crossing(np.abs(own), strain, percent / 100.0)
    return found


def crossing(values: Array, at: Array, level: float) -> float:
    """Where values first reach a level: 0 if they begin beyond it, not a number if they never do."""
    above = np.flatnonzero(values >= level)
    if not len(above):
        return math.nan
    k = int(above[0])
    if k == 0:
        return 0.0
    share = (level - values[k - 1]) / (values[k] - values[k - 1])
    return float(at[k - 1] + share * (at[k] - at[k - 1]))


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study) -> None:
    """Eq. 2 is the rods' own; at no strain Eq. 3 is exact for them; Eq. 1 misses what the tissue resists, to first
    order the same share in both models."""
    for row in study.of("rods"):
        assert abs(row["eq2_over_true_1"] - 1.0) < 1e-6, "rods: Eq. 2 is not their own law"
    first = {model: study.of(model)[0] for model in MODELS}
    assert abs(first["rods"]["eq3_over_true_1"] - 1.0) < 0.01, "rods: Eq. 3 is off at no strain"
    assert 1.0 - 0.45**2 < first["solid"]["eq3_over_true_1"] < 1.0, "solid: Eq. 3 is not short by what a plate is"
    for model in MODELS:
        # of a tissue of 10 kPa beside a skeleton: tension over tension less resistance
        ratio = first[model]["eq1_over_true_1"]
        assert 1.4 < ratio < 2.0, f"{model}: Eq. 1 gives {ratio:.2f} times the force at no strain"
        assert abs(first[model]["eq2_over_true_1"] - 1.0) < 0.05, f"{model}: Eq. 2 is off at no strain"
        strains = [row["strain_1"] for row in study.of(model)]
        assert all(b > a for a, b in pairwise(strains)), f"{model}: the muscle does not shorten"
    for row in study.held:
        assert abs(row["eq1_over_true_1"] - 1.0) < 0.03, f"held at {row['tension_kPa']:g} kPa: Eq. 1 is off"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Level full (0.02 to 14 kPa, shortening up to 42 % in the solid, 46 % in the rods), half a minute.

                                       solid                      rods
  Eq. 1 over the true force, no strain 1.64                       1.61
        at most                        2.24                       2.52
        held muscle                    0.990, at every tension    1
  Eq. 2, no strain                     1.000                      1 (their own law)
        off by 5 %, by 10 %            36 %, not reached          never
  Eq. 3, no strain                     0.845                      1.001
        off by 5 %, by 10 %            from the start             4 %, 9 % shortening
        5 %, 10 % beyond its own start 14 %, not reached          4 %, 9 %

* Eq. 1 is the force of a muscle that is held, within 1 % (rings around the pillars add that). In the machine it is 61
  to 64 % too much from the first shortening on, since tissue and skeleton share the tension: it is no estimate of the
  force on the pillars.
* Eq. 2 with the shortening as measured holds up to a shortening of 36 %, where a neo-Hookean strip has become stiffer
  than its law.
* Eq. 3 is short by the plate in the solid, 16 % at first and 9 % later; in the rods the arm grows by the sagitta, and
  it is 5 % too much at a shortening of 4 %.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
Oblique and dispersed fibres, remodelled tissue, other moduli of the gel.
"""


def tables(study: Study) -> list[Table]:
    """What is printed."""
    return [
        Table(title, tuple(rows[0]), tuple(tuple(row.values()) for row in rows))
        for title, rows in (
            ("Equations beside the models", study.rows),
            ("Where they are off", study.answers),
            ("Eq. 1 of a muscle that is held", study.held),
        )
    ]


def write(study: Study, folder: Path) -> None:
    """CSV files, and a picture of each equation over the shortening."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "path.csv", study.rows)
    write_table(folder / "answers.csv", study.answers)
    write_table(folder / "held.csv", study.held)
    figure = Figure(figsize=(11.0, 3.6), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    for panel, name in zip(figure.subplots(1, 3), EQUATIONS, strict=True):
        for model in MODELS:
            rows = study.of(model)
            ratio = [row[f"{name}_over_true_1"] for row in rows]
            panel.plot([row["strain_1"] for row in rows], ratio, "-o", markersize=3, label=model)
        panel.axhline(1.0, color="0.6", linewidth=0.8)
        panel.axhspan(0.95, 1.05, color="0.9")
        panel.set_title(f"Eq. {name[-1]}")
        panel.set_xlabel("shortening of the muscle [1]")
        panel.legend(frameon=False, fontsize=8)
    figure.axes[0].set_ylabel("over the force through the muscle [1]")
    with replacing(folder / "equations_of_the_paper.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    parser = argparse.ArgumentParser(description="Where Eq. 1, 2 and 3 depart from the models.")
    parser.add_argument("--level", choices=tuple(TENSIONS), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "equations_of_the_paper")
    options = parser.parse_args()
    study = run(options.level)
    show_tables(tables(study))
    write(study, options.out)
    expect(study)
    print("every expectation holds")


if __name__ == "__main__":
    main()
