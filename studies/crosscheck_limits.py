"""Study: limits in which the reasons why solid and rods differ vanish.

Question
--------
The cross-check states beforehand why a solid and its rods in closed form differ: ends of the beam yield, a wide beam
is a plate, pillars bend, rings spread the muscle's pull and lift it where it is clamped, strains are large. From rods
with constants of the mesh two more part the solid: rings yield at the strip's roots, and their middle is not the
strip's. Does each difference vanish in its own limit, and as fast as it must?

Run: ``python studies/crosscheck_limits.py [--level smoke|full] [--out FOLDER]``; five minutes at level full.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.files import replacing
from fem_biobot.link.alone import MuscleAlone, Pull, heights
from fem_biobot.link.at_load import parts_of
from fem_biobot.link.expected import causes
from fem_biobot.link.firm import line_height
from fem_biobot.link.folding import Folding
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.sections import closed_forms, flexibility
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.link.strip import strip_from_mesh
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.progress import show_tables
from fem_biobot.rod.reduce import reduce
from fem_biobot.study.outputs import write_table
from fem_biobot.study.reporter import Silent
from fem_biobot.tables import Table

Row = dict[str, Any]

# --- design -----------------------------------------------------------------------------------------------------------

DESIGN = "junction_bot"
# without Poisson's ratio a beam has no plate, whatever its width, and a narrow one has a small mesh
NARROW: dict[str, Any] = {
    "skeleton.material.poisson": 0.0,
    "skeleton.beam_width": 1.0,
    "skeleton.pillar_width": 1.0,
    "muscle.junction_width": 0.5,
}
THICKNESSES = {"smoke": (0.68, 0.34), "full": (0.68, 0.48, 0.34, 0.24)}  # mm
SPANS = {"smoke": (7.0, 14.0), "full": (7.0, 14.0, 28.0)}  # mm, of a beam 3.5 mm wide
PILLARS = {"smoke": (1.4, 1.0), "full": (2.8, 2.0, 1.4, 1.0)}  # mm along the machine
RINGS = {"smoke": (0.5, 0.25), "full": (1.0, 0.5, 0.25)}  # mm thick, of tissue without Poisson's ratio
STRIPS = {"smoke": (0.56, 0.4), "full": (0.56, 0.4, 0.28)}  # mm thick, of muscles clamped to turned bonds
PULL, TURN = 1.0, 1e-3  # kPa, with which they pull, and rad
OFFSETS = {"smoke": (0.1, 0.05), "full": (0.2, 0.1, 0.05)}  # mm, of the rings' middle below the strip's
HALF = 4.5, 0.16, 0.05  # kPa, share of the span by which bonds come closer, rad: of the machine at half its drive
TENSIONS = {"smoke": (0.2, 0.9, 1.8), "full": (0.1, 0.3, 0.6, 1.2, 2.4, 4.8)}  # kPa
SIZE = {"smoke": 2.0, "full": 1.2}  # mm, and of a beam over its thickness
# names of the limits, with the rate at which the difference must fall
RATES = {
    "slender beam": 1.0,
    "long beam": -1.0,
    "stiff pillars": -3.0,
    "thin rings": math.nan,
    "thin strip": 1.0,
    "thin roots": 1.0,
    "rings about the strip": 1.0,
    "small strain": 1.0,
}

# --- quantity, and why it can converge --------------------------------------------------------------------------------
#
# Of the first three, the motion of the bonds of the skeleton against each other under small wrenches on them, over that
# of a beam between rigid pillars in closed form, less 1; of rings, the stiffness of the muscle between its bonds over
# that of the strip alone, less 1; of the strip, by which share of the arm its line of pull is lifted at a turn of a
# radian, rings in proportion; of its roots, by how much that exceeds the lift of a rod by unit loads; of rings off the
# strip's middle, the same share without a turn; of the last, the closing of the solid over that of rods with constants
# by unit loads. Each is a ratio of displacements that converge; sharp corners converge slowly, but the share that is
# missing is the same at every point of a limit, since the mesh's size goes with the length that shrinks.
#
# * The yield of a built-in end is that of a depth of material of the order of the thickness: of the whole span, h / L.
# * Ends keep a beam from curving sideways within a width of them: of the whole span, b / L.
# * A pillar of length a along the machine bends by c^3 / (3 E I_p), and I_p is b a^3 / 12.
# * A ring takes part over its thickness w: of the muscle's whole length, w / L; one thinner than the strip with the
#   square, since the load has no way to spread. Its rate is that of what was stated.
# * A clamped strip of thickness t under a tension is lifted by sqrt(E I / N), in proportion to t, and so by its rings.
# * A ring of thickness w yields where the strip begins, not all along w as the rod through it does: to first order, w.
# * Rings whose middle is not the strip's turn its roots when they shorten, in proportion to how far they are off it.
# * Laws are linear to first order in the strain, and so is what they leave out.


@dataclass
class Study:
    """Rows of every limit: what is varied, the difference, and what was stated beforehand."""

    rows: list[Row] = field(default_factory=list)

    def of(self, limit: str) -> list[Row]:
        return [row for row in self.rows if row["limit"] == limit]

    def slope(self, limit: str, key: str = "difference_1") -> float:
        """Between the two points nearest to the limit, which come last."""
        (x0, y0), (x1, y1) = ((row["at"], row[key]) for row in self.of(limit)[-2:])
        return math.log(abs(y1 / y0)) / math.log(x1 / x0)

    def rate(self, limit: str) -> float:
        """At which the difference must fall; without one of its own that of what was stated."""
        return self.slope(limit, "stated_1") if math.isnan(RATES[limit]) else RATES[limit]


def changed(**values: Any) -> Design:
    """The reference machine with other numbers; two underscores in a name stand for a point."""
    return load_design(DESIGN).with_values({key.replace("__", "."): value for key, value in values.items()})


def excess(design: Design, size: float) -> float:
    """Turn of the bonds against each other under a couple, over that of the beam alone, less 1."""
    return float(flexibility(design, mesh_for(design, size)[0])[4, 4]) * closed_forms(design).EI / design.span - 1.0


def approach(design: Design, size: float) -> float:
    """Approach of the bonds at the junction's height under a unit force there [mm/mN]."""
    C, arm = flexibility(design, mesh_for(design, size)[0]), design.moment_arm
    return float(arm**2 * C[4, 4] + C[0, 0] - 2.0 * arm * C[0, 4])


def stated(design: Design, name: str) -> float:
    """The largest difference that a cause was expected to make in the compliance, or in the tissue's stiffness."""
    return max(abs(v) for cause in causes(design) if name in cause.name for v in (*cause.compliance, *cause.tissue))


def spread(design: Design, size: float) -> float:
    """Stiffness of the muscle between its bonds over that of the strip alone, less 1."""
    strip = strip_from_mesh(design, mesh_for(design, size)[0])
    alone = design.span / (design.value("muscle.material.young") * design.junction_section)
    return alone / float((np.diff(strip.x) / strip.EA).sum()) - 1.0


def lifted(design: Design, size: float) -> float:
    """How far a small turn of its bonds lifts the line of pull of a muscle, over the turn and the arm."""
    alone, half = MuscleAlone(design, mesh_for(design, size)[0]), design.span / 2
    states = [alone.turned(Pull(PULL, 0.0, turn)) for turn in (0.0, TURN)]
    still, turned = heights(design, states, [(-half, half)] * 2)
    return (turned - still) / (TURN * design.moment_arm)


def rooted(design: Design, size: float) -> float:
    """How far turned bonds lift the line of pull of a muscle at half the drive, over the turn and the arm.

    Less what they do to a rod with the bending stiffness of unit loads.
    """
    tension, shorter, turn = HALF
    pull, mesh = Pull(tension, shorter * design.span, turn), mesh_for(design, size)[0]
    strip = strip_from_mesh(design, mesh, [pull])
    of_rod = line_height(design, reduce(design), strip, pull, 1.0, np.full(len(strip.EA), 1.0 - shorter))[0]
    return (float(strip.height[0, 1]) - of_rod) / (turn * design.moment_arm)


def off_middle(offset: float, size: float) -> float:
    """How far a muscle between bonds that do not turn pulls above its strip, by rings that are lower, over the arm.

    Half of what lower rings do less what higher ones do, so without what an uneven mesh does.
    """
    found = []
    for sense in (-1.0, 1.0):
        design = changed(muscle__ring_offset=sense * offset)
        tension, way, half = HALF[0], HALF[1] * design.span, design.span / 2
        state = MuscleAlone(design, mesh_for(design, size)[0]).moved(0, [(tension, -way)])[0]
        found += heights(design, [state], [(-half, half - way)])
    return (found[0] - found[1]) / (2.0 * changed().moment_arm)


def run(level: str) -> Study:
    """Every limit, from far to near."""
    study = Study()

    def add(limit: str, at: float, difference: float, expected: float) -> None:
        study.rows.append({"limit": limit, "at": at, "difference_1": difference, "stated_1": expected})

    coarse = SIZE[level]
    for h in THICKNESSES[level]:
        design = changed(skeleton__beam_thickness=h, **NARROW)
        add("slender beam", h / design.span, excess(design, coarse * h), stated(design, "ends of the beam"))
    for span in SPANS[level]:
        width: dict[str, Any] = {"skeleton.beam_width": 3.5, "skeleton.pillar_width": 3.5, "muscle.junction_width": 1.0}
        free, plate = (
            excess(changed(skeleton__beam_length=span + 7.0, skeleton__material__poisson=nu, **width), 1.5)
            for nu in (0.0, 0.45)
        )
        design = changed(skeleton__beam_length=span + 7.0, **width)
        add("long beam", span / 3.5, (1.0 + plate) / (1.0 + free) - 1.0, stated(design, "plate"))
    tall = {**NARROW, "skeleton.short_pillar_height": 6.8, "skeleton.long_pillar_height": 7.4}

    def standing(length: float) -> Design:
        return changed(skeleton__pillar_length=length, skeleton__beam_length=7.0 + 2.0 * length, **tall)

    rigid = approach(standing(14.0), 1.5)
    for length in PILLARS[level]:
        design = standing(length)
        more = approach(design, 1.5) / rigid - 1.0
        add("stiff pillars", length, more, stated(design, "pillars bend"))
    for w in RINGS[level]:
        design = changed(muscle__ring_thickness=w, muscle__material__poisson=0.0)
        add(
            "thin rings",
            w / design.span,
            spread(design, 2.0 if level == "smoke" else 1.2),
            stated(design, "rings spread"),
        )
    for t in STRIPS[level]:
        design = changed(muscle__junction_thickness=t, muscle__ring_thickness=1.25 * t, **NARROW)
        of_strip = Folding(design, clamped=1.0).lift(0.0, PULL * design.junction_section) / design.moment_arm
        add("thin strip", t, lifted(design, 1.5 * t), of_strip)
    for w in RINGS[level]:
        design = changed(muscle__ring_thickness=w)
        add("thin roots", w, rooted(design, 2.0 if level == "smoke" else 1.2), math.nan)
    for offset in OFFSETS[level]:
        add("rings about the strip", offset, off_middle(offset, 1.2), math.nan)
    for row in strained(level):
        study.rows.append(row)
    return study


def strained(level: str) -> list[Row]:
    """Closing of the solid over that of rods by unit loads, less 1 and less what is left of it at no strain."""
    design = load_design(DESIGN).with_values({"mesh.size": SIZE[level]})
    mesh, tensions = mesh_for(design)[0], sorted(TENSIONS[level], reverse=True)
    reduced = reduce(design)
    rods = parts_of(design, mesh, reduced, RodSide(design, reduced).states(sorted(tensions), Silent())[0], Silent())
    none = 1e-3
    levels = [none, *sorted(tensions)]
    solid, by_unit_loads = (side.states(levels, Silent())[0] for side in (SolidSide(design, mesh), rods.side()))
    name = "tip_closing_mm"
    apart = [a.numbers[name] / b.numbers[name] - 1.0 for a, b in zip(solid, by_unit_loads, strict=True)]
    pairs = sorted(zip(levels[1:], apart[1:], strict=True), reverse=True)
    return [
        {"limit": "small strain", "at": T, "difference_1": d - apart[0], "stated_1": math.nan, "left_1": apart[0]}
        for T, d in pairs
    ]


# --- expect -----------------------------------------------------------------------------------------------------------


def expect(study: Study) -> None:
    """Each difference falls towards its limit at its rate; plate, pillars, rings stay within what was stated."""
    for limit in RATES:
        rate = study.rate(limit)
        sizes = [abs(row["difference_1"]) for row in study.of(limit)]
        falls = limit != "stiff pillars"  # whose last point is the farthest from the limit
        assert all((b < a) == falls for a, b in pairwise(sizes)), f"{limit}: the difference does not fall"
        # of the pillars, what bends besides them dies out from below; of roots, what the strip itself does stays
        band = {"stiff pillars": 0.6, "thin roots": 0.3}.get(limit, 0.15)
        slope = study.slope(limit)
        assert abs(slope - rate) < band, f"{limit}: the difference falls with power {slope:.2f}, expected {rate:g}"
    for limit in ("long beam", "stiff pillars", "thin rings"):
        for row in study.of(limit):
            assert 0.0 < abs(row["difference_1"]) < row["stated_1"], f"{limit}: beyond what was stated at {row['at']:g}"
    for row in study.of("thin strip"):
        off = row["difference_1"] / row["stated_1"] - 1.0
        assert abs(off) < 0.15, f"thin strip: {off:+.1%} off what was stated at {row['at']:g} mm"
    left = study.of("small strain")[0]["left_1"]
    assert abs(left) < 0.02, f"small strain: {left:+.1%} is left at none"


# --- what was found ---------------------------------------------------------------------------------------------------

FOUND = """
Level full, five minutes.

  limit                          from            to              power    must be    stated beforehand
  slender beam, h / L            11.8 % at 0.097  4.1 % at 0.034  1.04     1          8.6 to 3.0 %
  long beam, L / b               -5.6 % at 2      -1.5 % at 8     -0.96    -1         at most 20 %
  pillar along the machine [mm]  13.2 % at 1.0    0.3 % at 2.8    -3.4     -3         15.4 to 0.8 %
  ring over span, w / L          18.2 % at 0.14   1.9 % at 0.036  1.67     1.54       19.1 to 2.6 %
  strip [mm], rings in proportion 49.4 % at 0.56  25.9 % at 0.28  0.98     1          47.1 to 23.7 %
  roots, ring [mm]               17.2 % at 1.0   5.0 % at 0.25   0.82     1          -
  rings off the middle [mm]      0.74 % at 0.2   0.16 % at 0.05  0.95     1          -
  tension [kPa]                  -2.1 % at 4.8    -0.03 % at 0.1  1.04     1          -

* Each difference vanishes with its cause, at its rate.
* The ends of the beam yield by 1.37 times what a half-space would (O'Donnell 1960): the beam ends in the upper corner
  of a pillar, flush with its top, where there is material below and none above.
* Pillars yield by what was stated, less a rest that does not fall with their stiffness as fast: at the reference's
  3.5 mm it cannot be told from the corners.
* A rod with the bending of unit loads lifts the line of pull by less than the muscle does, at half the drive by 9 % of
  the arm and turn for the reference's rings of 0.5 mm: that falls with the rings, and a line through the last two
  points leaves 1.2 % for the strip itself. Rods at load take what turned bonds of the muscle show (`link.firm`).
* Rings that lie 0.1 mm below the strip lift its pull by 0.3 % of the arm where nothing turns.
* At no strain the solid closes by 0.7 % less than rods with constants by unit loads.
"""

# --- what was not looked at -------------------------------------------------------------------------------------------

NOT_LOOKED_AT = """
Several limits at once; torsion and motion across; slender beams that are wide (their plate and their ends mix).
"""


def tables(study: Study) -> list[Table]:
    """What is printed."""
    lines = [(r["limit"], r["at"], 100.0 * r["difference_1"], 100.0 * r["stated_1"]) for r in study.rows]
    slopes = [(limit, study.slope(limit), study.rate(limit)) for limit in RATES]
    return [
        Table("Differences", ("limit", "at", "difference [%]", "stated beforehand [%]"), tuple(lines)),
        Table("Powers", ("limit", "found", "expected"), tuple(slopes)),
    ]


def write(study: Study, folder: Path) -> None:
    """CSV file, and a picture of each difference with its slope."""
    folder.mkdir(parents=True, exist_ok=True)
    write_table(folder / "limits.csv", [{"left_1": math.nan, **row} for row in study.rows])
    figure = Figure(figsize=(16.0, 6.4), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    names = ("thickness over span [1]", "span over width [1]", "length of a pillar [mm]")
    names = (*names, "ring over span [1]", "thickness of the strip [mm]", "thickness of a ring [mm]")
    names = (*names, "middle of the rings [mm]", "tension [kPa]")
    for panel, limit, name in zip(figure.subplots(2, 4).ravel(), RATES, names, strict=True):
        rate = study.rate(limit)
        x, y = (np.array([abs(row[key]) for row in study.of(limit)]) for key in ("at", "difference_1"))
        panel.loglog(x, 100.0 * y, "o-", markersize=4, label=f"found, power {study.slope(limit):.2f}")
        panel.loglog(x, 100.0 * y[-1] * (x / x[-1]) ** rate, "k--", linewidth=0.8, label=f"power {rate:.3g}")
        panel.set_xlabel(name)
        panel.set_title(limit, fontsize=9)
        panel.legend(frameon=False, fontsize=8)
    figure.axes[0].set_ylabel("difference [%]")
    with replacing(folder / "crosscheck_limits.png") as temporary:
        figure.savefig(temporary, format="png")


def main() -> None:
    parser = argparse.ArgumentParser(description="Limits in which solid and rods meet.")
    parser.add_argument("--level", choices=tuple(THICKNESSES), default="full")
    parser.add_argument("--out", type=Path, default=Path("runs") / "studies" / "crosscheck_limits")
    options = parser.parse_args()
    study = run(options.level)
    show_tables(tables(study))
    write(study, options.out)
    expect(study)
    print("every expectation holds")


if __name__ == "__main__":
    main()
