"""Every law that the shared battery runs over, with generic parameters and what is special about each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem_biobot.material import LAWS, Law, NaturalState, NeoHooke, NominalTension
from tests.helpers import unit

Array = NDArray[np.float64]

YOUNG, POISSON = 12.3, 0.37
FIBRE = unit(0.36, -0.72, 0.55)
# a natural state that is neither symmetric nor volume-preserving
F0 = np.array([[0.81, 0.14, -0.09], [-0.06, 1.17, 0.12], [0.05, -0.11, 0.93]])


@dataclass(frozen=True)
class Case:
    """One law of the battery.

    Attributes
    ----------
    make
        The law; keyword arguments replace parameters.
    parameters
        Other values that must change the stress or the tangent, by name.
    rest
        Deformation gradient without energy, (3, 3).
    passive
        Whether the stress is zero there too.
    fibre
        The fibre, for a transversely isotropic law.
    """

    name: str
    make: Callable[..., Law]
    parameters: dict[str, object] = field(default_factory=dict)
    rest: Array = field(default_factory=lambda: np.eye(3))
    passive: bool = True
    fibre: Array | None = None


def _passive(name: str) -> Callable[..., Law]:
    def make(young: float = YOUNG, poisson: float = POISSON) -> Law:
        return LAWS[name](young, poisson)

    return make


def _natural(F0: Array = F0, law: Law | None = None) -> Law:
    return NaturalState(law or NeoHooke(YOUNG, POISSON), F0)


def _nominal(tension: float = 7.7, a0: Array = FIBRE) -> Law:
    return NominalTension(tension, a0)


CASES = [
    *(Case(name, _passive(name), {"young": 1.1 * YOUNG, "poisson": 1.1 * POISSON}) for name in LAWS),
    Case(
        "natural_state",
        _natural,
        {"F0": F0 + 0.05 * np.eye(3), "law": NeoHooke(1.1 * YOUNG, POISSON)},
        rest=F0,
    ),
    Case("nominal_tension", _nominal, {"tension": 8.0, "a0": unit(0.3, -0.7, 0.6)}, passive=False, fibre=FIBRE),
]
