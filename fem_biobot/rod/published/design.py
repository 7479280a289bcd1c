"""From a design of the kind "walker" to the published machine."""

from __future__ import annotations

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.rod.published.description import SETS, ElasticaWalker, Oddity, Start


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
