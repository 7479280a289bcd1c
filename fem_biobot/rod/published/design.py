"""From a design of the kind "walker" to the published machine."""

from __future__ import annotations

import math

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.rod.published.description import SETS, ElasticaWalker, Oddity, Start
from fem_biobot.rod.published.machine import FIBRE_AT


def walker_of(design: Design) -> ElasticaWalker:
    """The machine that a design describes; refuses a design of another kind."""
    keys = design.walker
    if keys is None:
        raise ModelError(f"kind: found {design.kind}, expected walker")
    oddities = set(SETS[keys.oddities])
    for oddity in Oddity:
        choice = getattr(keys, oddity)
        if choice == "yes":
            oddities.add(oddity)
        elif choice == "no":
            oddities.discard(oddity)
    return ElasticaWalker(
        oddities=frozenset(oddities),
        start=Start(keys.start),
        base_force=keys.base_force,
        active_force=keys.active_force,
        damping_time=design.numerics.damping_time,
        static_friction=design.ground.static_friction,
        kinetic_friction=design.ground.kinetic_friction,
    )


def key_numbers(design: Design) -> dict[str, float]:
    """What tells it from other machines."""
    w = walker_of(design)
    area = len(FIBRE_AT) * math.pi * w.fibre_radius**2
    return {
        "span_mm": 0.5 * w.beam_length,
        "gel_young_kPa": w.young,
        "second_moment_mm4": 0.5 * math.pi * w.flexible_radius**4,
        "muscle_section_mm2": area,
        "passive_tension_kPa": len(FIBRE_AT) * w.base_force / area,
        "peak_tension_kPa": len(FIBRE_AT) * (w.base_force + design.drive.amplitude * w.active_force) / area,
    }
