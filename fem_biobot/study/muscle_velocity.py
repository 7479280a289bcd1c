"""How a design's muscle pulls while it moves: its force-velocity curve, the power that it can give, and a plot."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import DesignError
from fem_biobot.material.force_velocity import ForceVelocity
from fem_biobot.muscle.drive import active_force
from fem_biobot.study.finding import Finding
from fem_biobot.tables import Table
from fem_biobot.view.tissue import lines

_SAMPLES = 201
_SHOWN = 1.0  # of the fastest rate, in lengthening


def velocity_finding(design: Design, figures: Path) -> Finding:
    """Force over rate of stretch of a design's stimulated tension, and the power of its shortening.

    Raises
    ------
    DesignError
        A muscle without a force-velocity curve.
    """
    found = None if design.muscle is None else design.muscle.force_velocity
    if found is None:
        raise DesignError(
            "muscle.force_velocity: found none, expected a section with its fastest shortening, such as "
            'muscle.force_velocity.fastest = "10 1/s"'
        )
    curve = ForceVelocity(found.fastest, found.curvature, found.eccentric)
    rates = np.linspace(-1.0, _SHOWN, _SAMPLES) * curve.fastest
    share = curve(rates)
    best, length, force = curve.strongest, _free_length(design), active_force(design)
    numbers = {
        "fastest_1_per_s": curve.fastest,
        "curvature_1": curve.curvature,
        "eccentric_1": curve.eccentric,
        "plateau_1": curve.plateau,
        "fastest_mm_per_s": curve.fastest * length,
        "strongest_1_per_s": -best,
        "share_at_strongest_1": float(curve(best)),
        "isometric_mN": force,
        "greatest_power_uW": -best * length * force * float(curve(best)),
        "share_at_half_1": float(curve(-0.5 * curve.fastest)),
    }
    rows = (
        ("fastest shortening [1/s]", curve.fastest),
        ("the same over the free length between the pillars [mm/s]", numbers["fastest_mm_per_s"]),
        ("curvature a / F0", curve.curvature),
        ("force at half of the fastest shortening, over the isometric", numbers["share_at_half_1"]),
        ("shortening of greatest power [1/s]", -best),
        ("force there, over the isometric", numbers["share_at_strongest_1"]),
        ("greatest power of the stimulated force between two pillars [uW]", numbers["greatest_power_uW"]),
        ("bound of the force in lengthening, over the isometric", curve.eccentric),
        ("force from three times the fastest rate on", curve.plateau),
    )
    file = figures / "force_velocity.png"
    power = np.where(rates < 0.0, -rates * share, 0.0) / (-best * float(curve(best)))
    lines(
        file,
        {"force over the isometric": (rates, share), "power over the greatest": (rates[rates <= 0], power[rates <= 0])},
        x="rate of the fibre's stretch [1/s], shortening negative",
        y="share [1]",
        title=f"{design.name}: stimulated force by velocity",
        points={"isometric": ([0.0], [1.0]), "greatest power": ([best], [1.0])},
    )
    series = [{"rate_1_per_s": r, "share_1": s} for r, s in zip(rates[::4].tolist(), share[::4].tolist(), strict=True)]
    caption = "Stimulated force over that at rest, by the rate of the fibre's stretch (Hill 1938), in walks."
    assumed = (
        "muscle.force_velocity: curvature and bound in lengthening are those of native muscle unless they are given, "
        "an assumption for engineered tissue"
    )
    return Finding(
        numbers, [Table("Force and velocity", ("", ""), rows)], {"force_velocity": series}, [(file, caption)], [assumed]
    )


def _free_length(design: Design) -> float:
    """Length over which the muscle shortens: between the pillars, of a strip all of it [mm]."""
    return design.span if design.kind == "strip" else design.bay
