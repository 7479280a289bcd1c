"""Eq. 1 in full: the active force of a tissue from its myotubes, and what differs between two tissues.

    F = gamma N f B chi

with N myotubes side by side in the section, B their length, f the force per length that one gains as it grows, chi the
mean of the sine of their angle from the lateral axis, and gamma the viable share. In stresses, F = gamma sigma A chi.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from fem_biobot.errors import DesignError
from fem_biobot.material.dispersion import Density, Dispersion
from fem_biobot.muscle.maturation import SEEDED, SEEDED_LENGTH


def mean_sine(theta: float, spread: float, kind: Density | str = "planar") -> float:
    """Mean of ``sin`` of the angle from the lateral axis, chi [1].

    Parameters
    ----------
    theta
        Mean angle [rad]; pi / 2 is along the machine.
    spread
        Standard deviation in a picture [rad].
    kind
        Density of the angles.

    Notes
    -----
    ``sin(theta)`` times the first moment about the mean: densities are symmetric, and the force of a fibre is counted
    along the machine with the sign of its mean, as in Eq. 1.
    """
    return math.sin(theta) * (Dispersion(spread, Density(kind)).first_moment if spread > 0.0 else 1.0)


@dataclass(frozen=True)
class Tissue:
    """What Eq. 1 asks for.

    Attributes
    ----------
    number
        Myotubes side by side in a section [1].
    length
        Of a myotube, ``B`` [mm].
    force_per_length
        What a myotube pulls with for its length [mN/mm].
    chi
        Mean sine of the angle from the lateral axis [1].
    gamma
        Viable share [1].
    """

    number: float
    length: float
    force_per_length: float
    chi: float = 1.0
    gamma: float = 1.0

    def __post_init__(self) -> None:
        for name in ("number", "length", "force_per_length", "chi", "gamma"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise DesignError(f"Eq. 1: {name}: found {value:g}, expected a finite number of at least 0")
        for name in ("chi", "gamma"):
            if getattr(self, name) > 1.0:
                raise DesignError(f"Eq. 1: {name}: found {getattr(self, name):g}, expected at most 1")

    @property
    def force(self) -> float:
        """Active force [mN]."""
        return self.gamma * self.number * self.force_per_length * self.length * self.chi


def explained(before: Tissue, after: Tissue) -> dict[str, float]:
    """Factors by which the force of one tissue exceeds another's, one for each term of Eq. 1; their product is all [1].

    Raises
    ------
    DesignError
        A tissue without force before, of which no factor can be told.
    """
    if not before.force > 0.0:
        raise DesignError("Eq. 1: force: found 0 mN before, expected a tissue that pulls")
    names = ("number", "length", "force_per_length", "chi", "gamma")
    factors = {name: getattr(after, name) / getattr(before, name) for name in names}
    return {**factors, "force": after.force / before.force}


def seeding_rows(length: float = 1.0) -> list[dict[str, object]]:
    """Tissue seeded with myoblasts beside tissue seeded with myotubes, in terms of Eq. 1.

    Myotubes of the latter are 1.5 times as long and it pulls three times as hard (section 2.2 of the paper). Length
    alone gives 1.5; the number of myotubes in the section, or what each pulls for its length, has to give the rest.

    Parameters
    ----------
    length
        Of myotubes in tissue seeded with myotubes [mm]; only ratios are known.
    """
    tubes = Tissue(1.0, length, 1.0)
    blasts = replace(tubes, length=length * SEEDED_LENGTH["myoblasts"])
    whole = SEEDED["myotubes"] / SEEDED["myoblasts"]
    by_length = explained(blasts, tubes)["force"]
    return [
        {"term": "force, as measured", "factor_1": whole, "source": "section 2.2"},
        {"term": "length of myotubes B", "factor_1": by_length, "source": "section 2.2"},
        {"term": "left for number and force per length", "factor_1": whole / by_length, "source": "what remains"},
    ]
