"""Oxygen in a design's muscle: the viable share, where it is lost, and how thick tissue may be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.muscle.oxygen import OxygenLaw
from fem_biobot.muscle.oxygen_depth import critical_thickness, largest_thickness
from fem_biobot.muscle.oxygenation import Oxygenation, oxygen_law, oxygen_of, oxygenation, section_gamma
from fem_biobot.study.finding import Finding
from fem_biobot.study.tissue_views import oxygen_view
from fem_biobot.tables import Table
from fem_biobot.view.tissue import cloud, lines

# consumption of the rule's table [mM/s], from slow cells to muscle at work
CONSUMPTIONS = (2e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)
WANTED = 0.95


def thickness_rule(law: OxygenLaw, wanted: float = WANTED) -> list[dict[str, float]]:
    """Largest thickness with the share `wanted` viable, and that of constant consumption, by consumption."""
    rows = []
    for consumption in CONSUMPTIONS:
        here = replace(law, consumption=consumption)
        rows.append(
            {
                "consumption_mM_per_s": consumption,
                "largest_thickness_mm": largest_thickness(here, wanted),
                "critical_thickness_mm": critical_thickness(here),
            }
        )
    return rows


def oxygen_finding(design: Design, mesh: BodyMesh, figures: Path) -> Finding:
    """Oxygen of a design's muscle on a mesh, and the rule for its thickness."""
    asked = design.muscle is not None and design.muscle.oxygen is not None
    found, law = oxygenation(design, mesh), oxygen_law(design)
    numbers = oxygen_numbers(design, found)
    rule = thickness_rule(law)
    notes = found.notes()
    if not asked:
        notes.append("oxygen: the design has no [muscle.oxygen], so its tension does not depend on what is told here")
    maps = (figures / "oxygen_section.png", "Oxygen over the section between the pillars; below the threshold: red.")
    rules = (figures / "oxygen_thickness.png", f"Largest thickness, wetted on both sides, with {WANTED:.0%} viable.")
    X = np.asarray(found.field.basis.global_coordinates())[:, found.between].reshape(3, -1)
    c = np.maximum(found.field.points[found.between].ravel(), 0.0)
    # enough points for a picture
    thin = max(1, c.size // 40_000)
    X, c = X[:, ::thin], c[::thin]
    cloud(
        maps[0], X[1], X[2], c, x="y [mm]", y="z [mm]", value="oxygen [mM]", below=law.threshold,
        title=f"{design.name}: oxygen in the middle fifth, gamma {found.gamma:.3f}",
    )  # fmt: skip
    at = [row["consumption_mM_per_s"] for row in rule]
    own = {"this design": ([law.consumption], [_thickness(design)])} if law.consumption > 0.0 else {}
    lines(
        rules[0],
        {
            f"{WANTED:.0%} viable": (at, [row["largest_thickness_mm"] for row in rule]),
            "oxygen just reaches the middle, constant use": (at, [row["critical_thickness_mm"] for row in rule]),
        },
        points=own, log="xy", x="consumption [mM/s]", y="thickness [mm]", title="How thick tissue may be",
    )  # fmt: skip
    words = {
        "gamma_1": "gamma, between the pillars",
        "gamma_whole_1": "viable share of all tissue",
        "gamma_section_1": "gamma of the plane section, as rods take it",
        "least_mM": "least oxygen [mM]",
        "thickness_mm": "thickness between the pillars [mm]",
        "largest_thickness_mm": f"largest thickness with {WANTED:.0%} viable [mm]",
        "critical_thickness_mm": "thickness that constant use lets through [mm]",
        "consumption_mM_per_s": "consumption [mM/s]",
        "uptake_nmol_per_s": "oxygen used by the muscle [nmol/s]",
    }
    tables = [
        Table("Oxygen", ("", ""), tuple((text, numbers[key]) for key, text in words.items())),
        Table(
            f"Largest thickness with {WANTED:.0%} viable, wetted on both sides",
            ("consumption [mM/s]", "thickness [mm]", "constant use reaches the middle of [mm]"),
            tuple(tuple(row.values()) for row in rule),
        ),
    ]
    return Finding(numbers, tables, {"oxygen_thickness": rule}, [maps, rules], notes, views=[oxygen_view(found)])


def oxygen_numbers(design: Design, found: Oxygenation) -> dict[str, Any]:
    """What is told of the oxygen in a muscle, each number with its unit."""
    law, oxygen = oxygen_law(design), oxygen_of(design)
    given: Mapping[str, Any] = oxygen.model_dump()
    finite = law.consumption > 0.0
    return {
        "gamma_1": found.gamma,
        "gamma_whole_1": found.gamma_whole,
        "gamma_section_1": section_gamma(design),
        "least_mM": max(found.least, 0.0),
        "thickness_mm": _thickness(design),
        "largest_thickness_mm": largest_thickness(law, WANTED) if finite else None,
        "critical_thickness_mm": critical_thickness(law) if finite else None,
        "supply_mM": law.supply,
        "diffusivity_mm2_per_s": law.diffusivity,
        "consumption_mM_per_s": law.consumption,
        "half_saturation_mM": law.half_saturation,
        "threshold_mM": law.threshold,
        "film_mm_per_s": law.film,
        "gel": given["gel"],
        "acts_on_tension": given["tension"],
        # mM mm^3 is nmol
        "uptake_nmol_per_s": found.field.uptake,
        "newton_iterations_1": found.field.iterations,
        "undershoot_1": found.field.undershoot,
    }


def _thickness(design: Design) -> float:
    """Smaller side of the section between the pillars [mm]."""
    muscle = design.muscle
    assert muscle is not None
    if muscle.layout == "ring" and design.kind == "bot":
        return min(muscle.ring_thickness, muscle.ring_height)
    return min(muscle.junction_width, muscle.junction_thickness)
