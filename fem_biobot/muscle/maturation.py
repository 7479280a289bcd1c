"""Maturation of tissue: its tension by day, and how it was seeded.

Laws of numbers alone, after Pagan-Diaz et al. 2018 (Adv. Funct. Mater.): section 2.4 and Fig. 5 for days, 2.2 for
seeding. The tensions at 15 days are the split of the paper's 10.39 kPa (its section 2.3); at other days they are scaled
with the forces measured then, the section unchanged. Forces by day contain whatever alignment the tissue had by then.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

from fem_biobot.errors import DesignError

Seeding = Literal["myotubes", "myoblasts"]

# day: passive force [mN], and active over total force [1]; on day 5 no more than 3 % is printed
PASSIVE_FORCE = {5.0: 7.99, 10.0: 8.38, 15.0: 8.45}
ACTIVE_SHARE = {5.0: 0.03, 10.0: 0.075, 15.0: 0.125}
FIRST_DAY, LAST_DAY = 5.0, 15.0
# tension of the tissue at 15 days [kPa], 87.5 and 12.5 % of 10.39
PASSIVE_TENSION, ACTIVE_TENSION = 9.09, 1.30
# active force of tissue seeded with each, over that seeded with myotubes (MT_vs_MB_force)
SEEDED = {"myotubes": 1.0, "myoblasts": 1.0 / 3.0}
# length of myotubes likewise (MT_vs_MB_length)
SEEDED_LENGTH = {"myotubes": 1.0, "myoblasts": 1.0 / 1.5}


def passive_force(days: float) -> float:
    """Passive force that the paper measured [mN], linear between its days; inferred by its Eq. 3."""
    return _between(days, PASSIVE_FORCE)


def active_force(days: float) -> float:
    """Active force [mN]: ``passive share / (1 - share)``, on day 5 its upper bound."""
    return _between(days, {day: PASSIVE_FORCE[day] * s / (1.0 - s) for day, s in ACTIVE_SHARE.items()})


def tensions(days: float, seeding: Seeding = "myotubes") -> tuple[float, float]:
    """Passive tension and what full drive adds to it, by day and seeding [kPa].

    Notes
    -----
    The threefold force of tissue seeded with myotubes is taken for the active force; that the standing tension does
    not depend on seeding is an assumption.

    Raises
    ------
    DesignError
        A day outside those measured, or another seeding.
    """
    if seeding not in SEEDED:
        raise DesignError(f"seeding: found {seeding}, expected one of: {', '.join(SEEDED)}")
    passive = PASSIVE_TENSION * passive_force(days) / passive_force(LAST_DAY)
    active = ACTIVE_TENSION * active_force(days) / active_force(LAST_DAY)
    return passive, active * SEEDED[seeding]


def _between(days: float, table: dict[float, float]) -> float:
    if not FIRST_DAY <= days <= LAST_DAY:
        raise DesignError(
            f"days: found {days:g}, expected between {FIRST_DAY:g} and {LAST_DAY:g}, where forces were measured"
        )
    # read with every design: numpy would make the command line slow to start
    (low, high) = next((a, b) for a, b in pairwise(table) if days <= b)
    share = (days - low) / (high - low)
    return (1.0 - share) * table[low] + share * table[high]
