"""Tissue by seeding width and age: what follows for a design, and the laws beside what the paper measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.design_tissue import told
from fem_biobot.muscle.compaction import RATIO, compacted_section, compaction_ratio
from fem_biobot.muscle.maturation import active_force, passive_force, tensions
from fem_biobot.muscle.myotubes import mean_sine, seeding_rows
from fem_biobot.muscle.oxygenation import viable_gamma
from fem_biobot.study.finding import Finding
from fem_biobot.study.paper import MEASURED_WIDTHS
from fem_biobot.tables import Table
from fem_biobot.view.tissue import lines

_DAYS = (5.0, 10.0, 15.0)
# share of the volume with which the narrowest tissue keeps its thickness
SHARE = 1.0 / RATIO


def width_rows(tension: float, chi: float, gamma: float) -> list[dict[str, Any]]:
    """Sections by seeding width in both readings of the volume, the force of Eq. 1 in each, and the paper's forces.

    Parameters
    ----------
    tension
        Active tension along the fibres [kPa].
    chi
        Mean sine of the fibres' angle [1].
    gamma
        Viable share [1].
    """
    rows = []
    for seeded, measured in MEASURED_WIDTHS.items():
        width, depth = compacted_section(seeded)
        _, thick = compacted_section(seeded, volume_kept=SHARE)
        rows.append(
            {
                "seeded_width_mm": seeded,
                "compaction_1": compaction_ratio(seeded),
                "width_mm": width,
                "section_mm2": width * depth,
                "section_volume_mm2": width * thick,
                "eq1_force_mN": gamma * tension * width * depth * chi,
                "eq1_force_volume_mN": gamma * tension * width * thick * chi,
                **measured,
            }
        )
    return rows


def day_rows(seeding: str) -> list[dict[str, float]]:
    """Tensions by day for a seeding, and the forces they were scaled with."""
    rows = []
    for day in _DAYS:
        passive, active = tensions(day, "myoblasts" if seeding == "myoblasts" else "myotubes")
        rows.append(
            {
                "day_1": day,
                "passive_tension_kPa": passive,
                "active_tension_kPa": active,
                "paper_passive_mN": passive_force(day),
                "paper_active_mN": active_force(day),
            }
        )
    return rows


def tissue_finding(design: Design, figures: Path) -> Finding:
    """What a design's tissue is and pulls with, and the laws of width and age."""
    muscle = design.muscle
    assert muscle is not None
    chi, gamma = mean_sine(muscle.theta, muscle.spread, muscle.spread_kind), viable_gamma(design)
    standing = 1.0 if muscle.gamma_scales == "active" else gamma
    section = design.junction_section
    tissue = muscle.tissue
    numbers: dict[str, Any] = {
        "seeded_width_mm": tissue.seeded_width if tissue else None,
        "days_1": tissue.days if tissue else None,
        "seeding": tissue.seeding if tissue else None,
        "compaction_1": compaction_ratio(tissue.seeded_width) if tissue else None,
        "width_mm": muscle.junction_width or None,
        "thickness_mm": muscle.junction_thickness or None,
        "section_mm2": section,
        "passive_tension_kPa": muscle.passive_tension,
        "active_tension_kPa": muscle.active_tension,
        "mean_sine_1": chi,
        "gamma_1": gamma,
        "eq1_passive_mN": standing * muscle.passive_tension * section * chi,
        "eq1_active_mN": gamma * muscle.active_tension * section * chi,
    }
    words = {
        "seeded_width_mm": "seeded width [mm]",
        "days_1": "days",
        "seeding": "seeded with",
        "compaction_1": "compaction W0 / WF",
        "width_mm": "width between the pillars [mm]",
        "thickness_mm": "thickness [mm]",
        "section_mm2": "section [mm^2]",
        "passive_tension_kPa": "passive tension [kPa]",
        "active_tension_kPa": "active tension [kPa]",
        "mean_sine_1": "mean sine of the fibres' angle, chi",
        "gamma_1": "viable share, gamma",
        "eq1_passive_mN": "passive force, held at its length (Eq. 1) [mN]",
        "eq1_active_mN": "active force, held at its length (Eq. 1) [mN]",
    }
    widths, days = width_rows(muscle.active_tension, chi, gamma), day_rows(tissue.seeding if tissue else "myotubes")
    eq1 = seeding_rows()
    tables = [
        Table("Tissue", ("", ""), tuple((text, numbers[k]) for k, text in words.items() if numbers[k] is not None)),
        Table(
            "By seeding width, this tension: as deep as the trench | the same share of volume | measured",
            ("W0 [mm]", "W0/WF", "WF [mm]", "A [mm^2]", "A, volume", "F active [mN]", "F, volume", "measured", "+-"),
            tuple((*list(r.values())[:7], r["active_mN"], r["active_sd_mN"]) for r in widths),
        ),
        Table(
            "By day",
            ("day", "passive [kPa]", "active [kPa]", "measured passive [mN]", "measured active [mN]"),
            tuple(tuple(r.values()) for r in days),
        ),
        Table("Eq. 1: seeded with myotubes over seeded with myoblasts", ("term", "factor", "source"),
              tuple(tuple(r.values()) for r in eq1)),
    ]  # fmt: skip
    by_width, by_day = figures / "tissue_width.png", figures / "tissue_day.png"
    W0 = np.linspace(3.5, 14.0, 60)
    readings = {"as deep as the trench": None, "the same share of volume left": SHARE}
    curves = {
        name: (W0, [gamma * muscle.active_tension * chi * float(np.prod(compacted_section(w, volume_kept=kept)))
                    for w in W0.tolist()])
        for name, kept in readings.items()
    }  # fmt: skip
    at = [r["seeded_width_mm"] for r in widths]
    lines(
        by_width, curves, points={"measured by the paper": (at, [r["active_mN"] for r in widths])},
        x="seeded width [mm]", y="active force [mN]", title=f"{design.name}: Eq. 1 by seeding width",
    )  # fmt: skip
    t = np.linspace(5.0, 15.0, 41)
    pulls = np.array([tensions(float(d)) for d in t])
    lines(
        by_day, {"passive": (t, pulls[:, 0]), "active at full drive": (t, pulls[:, 1])},
        x="day", y="tension [kPa]", title="Tension by age, seeded with myotubes", log="y",
    )  # fmt: skip
    line = told(muscle)
    notes = [line] if line else ["tissue: the design states its section and tension; no [muscle.tissue] to follow from"]
    captions = [
        (by_width, "Active force of Eq. 1 at this design's tension, and the paper's; what falls is not geometry."),
        (by_day, "Tension by day, scaled with the forces that the paper measured."),
    ]
    return Finding(numbers, tables, {"tissue_width": widths, "tissue_day": days, "seeding": eq1}, captions, notes)
