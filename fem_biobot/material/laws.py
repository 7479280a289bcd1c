"""The table of passive laws that a design can name; the shared test battery runs over every entry."""

from __future__ import annotations

from collections.abc import Callable

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Law
from fem_biobot.material.neo_hooke import NeoHooke

LAWS: dict[str, Callable[[float, float], Law]] = {
    "neo_hooke": NeoHooke,
}


def law_from(name: str, young: float, poisson: float) -> Law:
    """Passive law of the given name with its small-strain moduli [kPa], [1]; refuses an unknown name."""
    if name not in LAWS:
        raise ModelError(f"law: found {name!r}, expected one of {', '.join(LAWS)}")
    return LAWS[name](young, poisson)
