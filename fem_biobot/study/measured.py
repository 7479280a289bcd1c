"""A person's measured deflections as a result: tension and modulus with intervals, table, CSV and plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.at_load import parts_of
from fem_biobot.link.inverse import Deflections, Estimate, deflections, estimate
from fem_biobot.link.measured import Measured
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.valley import Valley, valley
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.measures import eq3_stiffness
from fem_biobot.study.finding import Finding
from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.tables import Table
from fem_biobot.view.crosscheck import fitted


def sought(data: Measured) -> list[tuple[str, ...]]:
    """What is asked of data that nothing else is said about.

    With a force, tensions and modulus at once; without, the tensions with the design's modulus, and the modulus with
    the design's tensions, since deflections alone hardly tell the two apart.
    """
    tensions = ("passive", "active") if len(np.unique(data.drive)) > 1 else ("passive",)
    return [(*tensions, "stiffness")] if data.force is not None else [tensions, ("stiffness",)]


def measured_finding(
    design: Design,
    mesh: BodyMesh,
    data: Measured,
    names: Sequence[str],
    figures: Path,
    reporter: Reporter,
    notes: Sequence[str] = (),
) -> Finding:
    """Tension and modulus from measured deflections, by rods of the design's parts."""
    reduced = reduce(design)
    top = max(design.tension(drive) for drive in (0.0, design.drive.amplitude))
    plain, _ = RodSide(design, reduced).states([share * top for share in (0.2, 0.5, 1.0, 1.4)], Silent())
    rods = parts_of(design, mesh, reduced, plain, reporter)
    reporter.stage("rods of other moduli", 7)
    table = deflections(design, rods, reporter)
    asked = [tuple(names)] if names else sought(data)
    found: list[Estimate] = []
    remarks = []
    for each in asked:
        try:
            found.append(estimate(design, data, table, each))
        except ModelError as reason:
            if len(asked) == 1:
                raise
            remarks.append(f"{' and '.join(each)}: {reason}")
    if not found:
        raise ModelError(remarks[0])
    answers = [_answer(each, table, design) for each in found]
    remarks += [
        f"{' and '.join(e.names)}: correlation {e.correlation:+.4f}, so that the data hardly tell them apart"
        for e in found
        if abs(e.correlation) > 0.99
    ]
    along = _valley(design, data, table, found)
    if along is not None:
        remarks += _said(along, design)
    remarks.append(
        "of tissue twice as stiff all of this would be twice as large: muscle.material.young is the yardstick"
    )
    n = len(data.value)
    series = [
        {
            "drive_1": float(data.drive[i]),
            f"{data.quantity}_mm": float(data.value[i]),
            **({} if data.force is None else {"force_mN": float(data.force[i])}),
            **{f"fitted_{'_'.join(e.names)}_mm": float(e.fitted[i]) for e in found},
        }
        for i in range(n)
    ]
    picture = figures / "measured.png"
    curves = {"fit of " + " and ".join(e.names): e.fitted[:n] for e in found}
    fitted(
        picture,
        data.drive,
        data.value,
        found[0].deviation[:n],
        curves,
        y=f"{data.quantity} [mm]",
        title=f"{design.name}: measured and fitted",
    )
    return Finding(
        {
            "quantity": data.quantity,
            "rows_1": n,
            "answers": answers,
            **({} if along is None else {"without_force": _as_row(along)}),
        },
        [_table(found, conditional=along is not None), *([] if along is None else [_along(along)]), _means(answers)],
        {"measured": series},
        [(picture, "Measured deflections with one standard deviation, and rods at what was found.")],
        list(notes),
        remarks,
    )


def _answer(e: Estimate, table: Deflections, design: Design) -> dict[str, Any]:
    """Numbers of an estimate, and the forces that it means at no drive and at full drive."""
    both = np.array([e.passive, e.passive + e.active])
    force, sagitta = (table.at(name, e.young, both) for name in ("force", "sagitta"))
    return {
        "sought": " and ".join(e.names),
        **{
            f"{name}_{end}_kPa": float(values[k])
            for k, name in enumerate(e.names)
            for end, values in (("found", e.value), ("low", e.low), ("high", e.high))
        },
        "passive_tension_kPa": e.passive,
        "active_tension_kPa": e.active,
        "young_kPa": e.young,
        "passive_force_mN": float(force[0]),
        "passive_eq3_force_mN": eq3_stiffness(design) * float(sagitta[0]),
        "stroke_force_mN": float(force[1] - force[0]),
        "stroke_eq3_force_mN": eq3_stiffness(design) * float(sagitta[1] - sagitta[0]),
        "misfit_1": e.misfit,
        "correlation_1": e.correlation if len(e.names) > 1 else None,
    }


def _valley(design: Design, data: Measured, table: Deflections, found: Sequence[Estimate]) -> Valley | None:
    """What deflections without a force say of tension and modulus together; None with a force, or without tensions."""
    if data.force is not None:
        return None
    names = next((e.names for e in found if "stiffness" not in e.names), None)
    return None if names is None else valley(design, data, table, names)


def _said(along: Valley, design: Design) -> list[str]:
    (low, high), (below, above) = along.span, along.open
    ends = f"{'below ' if below else ''}{low:.3g} to {'above ' if above else ''}{high:.3g} kPa"
    young, c = float(design.value("skeleton.material.young")), along.exponent
    return [
        "no force was given: deflections do not separate tension from modulus; moduli from "
        f"{ends} all fit within 95 %, each with a tension of its own",
        f"what they determine is {along.names[0]} tension / (modulus / {young:g} kPa)^{c:.2f} = {along.value:.3g} kPa, "
        f"95 % from {along.low:.3g} to {along.high:.3g} kPa: of a gel 10 % stiffer a tension {10.0 * c:.0f} % larger",
    ]


def _as_row(along: Valley) -> dict[str, Any]:
    return {
        "sought": along.names[0],
        "exponent_1": along.exponent,
        "value_kPa": along.value,
        "low_kPa": along.low,
        "high_kPa": along.high,
        "young_low_kPa": along.span[0],
        "young_high_kPa": along.span[1],
        "young_open_below": along.open[0],
        "young_open_above": along.open[1],
    }


def _along(along: Valley) -> Table:
    lines = [
        (E, T, T / along.value, S, "yes" if inside else "no")
        for E, T, S, inside in zip(along.young, along.tension, along.misfit, along.fits, strict=True)
    ]
    header = ("assumed modulus [kPa]", f"{along.names[0]} tension [kPa]", "over that of the design's", "misfit", "fits")
    return Table("Tension by the modulus that is assumed", header, tuple(lines))


def _table(found: Sequence[Estimate], *, conditional: bool) -> Table:
    words = {
        "tension": "passive tension, with the active one [kPa]",
        "passive": "passive tension [kPa]",
        "active": "active tension [kPa]",
        "stiffness": "modulus of the gel [kPa]",
    }
    lines = [
        (" and ".join(e.names), words[name], *(float(v[k]) for v in (e.value, e.low, e.high, *e.drawn)))
        for e in found
        for k, name in enumerate(e.names)
    ]
    header = ("sought", "", "found", "95 % from", "to", "drawn, from", "to")
    words = "Found, each as if the others were exactly as designed" if conditional else "Found"
    return Table(words, header, tuple(lines))


def _means(answers: Sequence[dict[str, Any]]) -> Table:
    keys = (
        "passive_tension_kPa", "active_tension_kPa", "young_kPa", "passive_force_mN", "passive_eq3_force_mN",
        "stroke_force_mN", "stroke_eq3_force_mN", "misfit_1",
    )  # fmt: skip
    header = ("sought", *(key.replace("_", " ") for key in keys))
    return Table("What it means", header, tuple((a["sought"], *(a[key] for key in keys)) for a in answers))
