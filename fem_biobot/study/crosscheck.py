"""The cross-check of a design as a result: tables, CSV files, plots of both models and their differences."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fem_biobot.design import Design
from fem_biobot.design_tissue import at_rest
from fem_biobot.errors import ModelError
from fem_biobot.link.camera import Camera, filmed
from fem_biobot.link.crosscheck import QUANTITIES, CrossCheck, Row, Stiffness, crosscheck, curvature_rows, root_rows
from fem_biobot.link.sections import Stiffnesses
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.study.finding import Finding
from fem_biobot.study.reporter import Reporter
from fem_biobot.study.views import both_view
from fem_biobot.tables import Table
from fem_biobot.view.crosscheck import bent_beam, both_over, differences, overlaid

_PANELS = {
    "tip_closing_mm": "tip closing [mm]",
    "muscle_force_mN": "muscle force [mN]",
    "sagitta_mm": "sagitta [mm]",
    "pillar_rotation_deg": "rotation of a pillar [deg]",
}
_WORDS = {
    "muscle_force_mN": "muscle force [mN]",
    "tip_closing_mm": "tip closing [mm]",
    "sagitta_mm": "sagitta [mm]",
    "pillar_rotation_deg": "pillar rotation [deg]",
    "curvature_1_per_mm": "curvature, middle [1/mm]",
    "strain_energy_uJ": "strain energy [uJ]",
    "fibre_stretch_1": "fibre stretch [1]",
    "stroke_mm": "stroke [mm]",
}
_MODELS = {
    Stiffness.closed_form: "rods",
    Stiffness.mesh_beam: "rods, beam from the mesh",
    Stiffness.mesh: "rods, parts from the mesh",
    Stiffness.mesh_at_load: "rods, parts from the mesh at load",
}
# what is drawn beside the solid
_DRAWN = (Stiffness.closed_form, Stiffness.mesh_at_load)


def crosscheck_finding(
    design: Design,
    mesh: BodyMesh,
    figures: Path,
    reporter: Reporter,
    notes: Sequence[str] = (),
    camera: Camera | None = None,
) -> Finding:
    """Solid and rods of a design at the same tensions, with what was expected beforehand."""
    return told(crosscheck(design, mesh, reporter=reporter), figures, notes, camera=camera)


def told(
    found: CrossCheck,
    figures: Path,
    notes: Sequence[str] = (),
    *,
    camera: Camera | None = None,
    views: bool = True,
) -> Finding:
    """A cross-check as tables, rows, figures, and, if asked for, both models to turn.

    With what a camera would say of both, by default one of 6 frames a second without noise.
    """
    still = at_rest(found.design.muscle)
    rows = {stiffness: found.rows(stiffness) for stiffness in Stiffness}
    plain = rows[Stiffness.closed_form]
    judged = [row for row in plain if row.within is not None]
    outside = [row for row in judged if not row.within]
    films, unfilmed = _films(found, camera or Camera())
    tables = [
        _closest(rows, found),
        _ingredients(rows),
        _energies(found),
        _modes(found),
        _camera(films),
        _sections(found),
        _causes(found),
    ]
    remarks = []
    if judged:
        remarks.append(f"{len(judged) - len(outside)} of {len(judged)} differences lie where they were expected")
        remarks += [
            f"outside: {_WORDS[row.quantity]} at {row.tension:.3g} kPa, {100.0 * row.difference:+.1f} %, expected "
            f"{_percent(row.expected)}"
            for row in outside
        ]
    else:
        remarks.append("no difference was stated beforehand for a muscle that is one ring around both pillars")
    return Finding(
        {**_numbers(found, rows), "camera": films},
        [table for table in tables if table.rows],
        {
            "crosscheck": [_as_row(row) for stiffness in Stiffness for row in rows[stiffness]],
            "curvature": curvature_rows(found),
            "roots": root_rows(found),
            "modes": [
                {"rods": name.value, "solid_Hz": p.solid, "rods_Hz": p.rods, "likeness_1": p.likeness, "motion": p.kind}
                for name, pairs in found.modes.items()
                for p in pairs
            ],
        },
        _draw(found, plain, figures),
        [*notes, *found.notes, *unfilmed, *([still] if still else [])],
        remarks,
        [both_view(found.design, found.levelled)] if views else [],
    )


def _films(found: CrossCheck, camera: Camera) -> tuple[list[dict[str, object]], list[str]]:
    """What a camera says of each model, or why not."""
    rows: list[dict[str, object]] = []
    for model, states in (("solid", found.solid), ("rods", found.rods[Stiffness.mesh_at_load])):
        try:
            films = filmed(found.design, states, camera)
        except ModelError as reason:
            return [], [f"left out: {reason}"]
        for film in films:
            row = {"model": model, "quantity": film.quantity, "true": film.true, "filmed": film.mean}
            rows.append({**row, "deviation": film.deviation, "filmed_over_true_1": film.ratio})
    return rows, []


def _camera(films: Sequence[dict[str, object]]) -> Table:
    words = {
        "stroke_mm": "stroke [mm]",
        "passive_force_mN": "passive force [mN], by Eq. 3",
        "stroke_force_mN": "force of the stroke [mN], by Eq. 3",
    }
    lines = [
        (f["model"], words[str(f["quantity"])], f["true"], f["filmed"], f["deviation"], f["filmed_over_true_1"])
        for f in films
    ]
    header = ("model", "quantity", "true", "as filmed", "+- of one film", "filmed over true [1]")
    return Table("As a camera and Eq. 3 say it", header, tuple(lines))


def _numbers(found: CrossCheck, rows: dict[Stiffness, list[Row]]) -> dict[str, object]:
    """For the summary."""
    return {
        "mesh": dict(found.mesh),
        "skeleton_share_1": None if np.isnan(found.expectation.skeleton_share) else found.expectation.skeleton_share,
        "rows": [_as_row(row) for stiffness in Stiffness for row in rows[stiffness]],
        "frequencies": [
            {"rods": name.value, "solid_Hz": p.solid, "rods_Hz": p.rods, "likeness_1": p.likeness}
            for name, pairs in found.modes.items()
            for p in pairs
        ],
        "sections": {name: _stiffnesses(getattr(found.sections, name)) for name in ("closed_form", "mesh")},
    }


def _as_row(row: Row) -> dict[str, object]:
    low, high = row.expected or (None, None)
    return {
        "tension_kPa": row.tension,
        "quantity": row.quantity,
        "rods": row.stiffness.value,
        "solid_value": row.solid,
        "rods_value": row.rods,
        "difference_1": row.difference,
        "expected_low_1": low,
        "expected_high_1": high,
        "within": row.within,
    }


def _stiffnesses(found: Stiffnesses) -> dict[str, float]:
    return {
        "EI_mN_mm2": found.EI,
        "EI_middle_mN_mm2": found.EI_along[len(found.EI_along) // 2],
        "EI_lateral_mN_mm2": found.EI_lateral,
        "GJ_mN_mm2": found.GJ,
        "EA_mN": found.EA,
        "GA_mN": found.GA,
        "GA_lateral_mN": found.GA_lateral,
    }


def _percent(interval: tuple[float, float] | None) -> str:
    return "" if interval is None else f"{100.0 * interval[0]:+.1f} to {100.0 * interval[1]:+.1f} %"


def _closest(rows: dict[Stiffness, list[Row]], found: CrossCheck) -> Table:
    """Both models at the lowest tension, at the highest, and the stroke."""
    tensions = sorted({row.tension for row in rows[Stiffness.closed_form]})
    shown = (tensions[0], tensions[-1])
    other = {(row.tension, row.quantity): row for row in rows[Stiffness.mesh_at_load]}
    lines = []
    for row in rows[Stiffness.closed_form]:
        if row.tension not in shown:
            continue
        own = other.get((row.tension, row.quantity))
        lines.append(
            (
                row.tension,
                _WORDS[row.quantity],
                row.solid,
                row.rods,
                f"{100.0 * row.difference:+.1f} %",
                _percent(row.expected),
                {True: "yes", False: "no", None: ""}[row.within],
                "" if own is None else f"{100.0 * own.difference:+.1f} %",
            )
        )
    header = (
        "tension [kPa]",
        "quantity",
        "solid",
        "rods",
        "solid/rods - 1",
        "expected",
        "within",
        "parts from the mesh",
    )
    return Table(f"Solid and rods, {found.mesh['unknowns_1']} unknowns", header, tuple(lines))


def _ingredients(rows: dict[Stiffness, list[Row]]) -> Table:
    """The largest difference over all tensions that each source of the rods' constants leaves, by quantity."""
    lines = []
    for name, label in _MODELS.items():
        cells = []
        for quantity in _WORDS:
            apart = [row.difference for row in rows[name] if row.quantity == quantity]
            cells.append(f"{100.0 * max(apart, key=abs):+.1f} %" if apart else "")
        lines.append((label, *cells))
    return Table("Largest difference that is left", ("solid beside", *_WORDS.values()), tuple(lines))


def _energies(found: CrossCheck) -> Table:
    """Where the energy is, at the lowest tension and at the highest that all reached."""
    last = min(len(found.solid), *(len(states) for states in found.rods.values())) - 1
    parts = {
        "skeleton, bent": "energy_skeleton_uJ",
        "muscle, shortened": "energy_muscle_uJ",
        "rings on their pillars": "energy_rings_uJ",
    }
    lines = []
    for k in sorted({0, last}):
        for words, key in parts.items():
            solid = found.solid[k].numbers[key]
            rods = [states[k].numbers.get(key) for states in found.rods.values()]
            apart = ["" if value is None else f"{100.0 * (solid / value - 1.0):+.1f} %" for value in rods]
            lines.append((found.solid[k].tension, words, solid, *apart))
    header = ("tension [kPa]", "part", "solid [uJ]", *(f"beside {label}" for label in _MODELS.values()))
    return Table("Where the strain energy is; that of the rings is in no other row", header, tuple(lines))


def _modes(found: CrossCheck) -> Table:
    # of all motions a frequency was stated for the closing alone, the slowest in the machine's plane
    closed = found.modes[Stiffness.closed_form]
    first = next((k for k, p in enumerate(closed) if p.kind == "in plane"), None)
    folding = found.expectation.at(found.modes_at).get("frequency_Hz")
    lines = [
        (
            _MODELS[name],
            p.kind,
            p.solid,
            p.rods,
            f"{100.0 * (p.solid / p.rods - 1.0):+.1f} %",
            _percent(folding if name is Stiffness.closed_form and k == first else None),
            p.likeness,
        )
        for name, pairs in found.modes.items()
        for k, p in enumerate(pairs)
    ]
    header = ("rods", "motion", "solid [Hz]", "rods [Hz]", "solid/rods - 1", "expected", "likeness [1]")
    return Table("Natural motions about the tensioned state", header, tuple(lines))


def _sections(found: CrossCheck) -> Table:
    mesh, closed = _stiffnesses(found.sections.mesh), _stiffnesses(found.sections.closed_form)
    words = {
        "EI_mN_mm2": "E I, whole span [mN mm^2]",
        "EI_middle_mN_mm2": "E I, middle of the span [mN mm^2]",
        "EI_lateral_mN_mm2": "E I across [mN mm^2]",
        "GJ_mN_mm2": "G J [mN mm^2]",
        "EA_mN": "E A [mN]",
        "GA_mN": "k G A [mN]",
        "GA_lateral_mN": "k G A across [mN]",
    }
    lines = [(words[key], closed[key], mesh[key], mesh[key] / closed[key]) for key in words]
    return Table("Stiffness of the beam", ("", "closed form", "unit loads on the mesh", "ratio [1]"), tuple(lines))


def _causes(found: CrossCheck) -> Table:
    lines = [
        (
            cause.name,
            _percent(cause.compliance),
            _percent(cause.tissue),
            cause.formula,
            cause.vanishes,
            "before the first comparison" if cause.foreseen else "after it",
        )
        for cause in found.expectation.causes
    ]
    header = ("cause", "skeleton softer", "tissue stiffer", "formula", "vanishes with", "derived")
    return Table("Why they differ, by closed forms", header, tuple(lines))


def _draw(found: CrossCheck, plain: list[Row], figures: Path) -> list[tuple[Path, str]]:
    """Plots; every curve over the tensions that all models reached."""
    name = found.design.name
    count = min(len(found.solid), *(len(states) for states in found.rods.values()))
    tension = [state.tension for state in found.solid[:count]]
    panels = {
        label: {
            "solid": [state.numbers[key] for state in found.solid[:count]],
            **{_MODELS[k]: [s.numbers[key] for s in found.rods[k][:count]] for k in _DRAWN},
        }
        for key, label in _PANELS.items()
    }
    both, apart = figures / "crosscheck.png", figures / "differences.png"
    along, side = figures / "curvature.png", figures / "overlaid.png"
    both_over(both, tension, panels, x="tension [kPa]", title=f"{name}: solid and rods")
    kept = list(QUANTITIES)
    differences(
        apart,
        tension,
        {_WORDS[k]: [r.difference for r in plain if r.quantity == k][:count] for k in kept},
        {_WORDS[k]: [r.expected for r in plain if r.quantity == k and r.expected][:count] for k in kept},
        title=f"{name}: difference, and where it was expected",
    )
    rows = curvature_rows(found)
    curves = {"solid": "solid_1_per_mm", **{_MODELS[k]: f"rods_{k}_1_per_mm" for k in _DRAWN}}
    roots = {row["model"]: (row["short_deg"], row["long_deg"]) for row in root_rows(found)}
    bent_beam(
        along,
        [row["x_mm"] for row in rows],
        {label: [row[key] for row in rows] for label, key in curves.items()},
        {label: roots[key.removesuffix("_1_per_mm")] for label, key in curves.items()},
        title=f"{name}: curvature of the beam, and what its roots yield",
    )
    overlaid(
        side,
        {label: solid for label, (solid, _) in found.outlines.items()},
        {label: lines for label, (_, lines) in found.outlines.items()},
        title=f"{name}: solid (grey) and rods",
    )
    return [
        (both, "Solid and rods at the same tensions; nothing is fitted."),
        (apart, "Difference of the solid from the rods in closed form; grey: where it was expected beforehand."),
        (along, "Curvature along the beam at the highest tension, and what its roots in the pillars yield besides."),
        (side, "Both from the side, at the standing tension and at full drive."),
    ]
