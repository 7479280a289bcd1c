"""Every law that the shared battery runs over, with generic parameters and what is special about each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fem_biobot.material import (
    LAWS,
    ActiveStrain,
    AngularTension,
    Convention,
    Dispersion,
    FibreTension,
    ForceLength,
    Law,
    NaturalState,
    NeoHooke,
    force_length,
    law_from,
)
from fem_biobot.material.laws import has_fibres
from tests.helpers import unit
from tests.oracles.laws import PARAMETERS

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
    energetic
        Whether the law has an energy, and so a tangent with major symmetry.
    plane
        Whether the law knows a plane besides its fibre, so that it is not symmetric about that.
    """

    name: str
    make: Callable[..., Law]
    parameters: dict[str, object] = field(default_factory=dict)
    rest: Array = field(default_factory=lambda: np.eye(3))
    passive: bool = True
    fibre: Array | None = None
    energetic: bool = True
    plane: bool = False


def make_law(name: str, young: float = YOUNG, poisson: float = POISSON, a0: Array = FIBRE, **own: float) -> Law:
    """A law of the table with the battery's parameters, others by name; fibres are passed over where it has none."""
    return law_from(name, young, poisson, a0, **{**PARAMETERS[name], **own})


def _passive(name: str) -> Case:
    """The case of a law of the table: each of its parameters changed by a tenth must matter."""
    changed = {own: 1.1 * value for own, value in PARAMETERS[name].items()}
    fibres = {"a0": unit(0.3, -0.7, 0.6)} if has_fibres(name) else {}
    return Case(
        name,
        lambda **given: make_law(name, **given),
        {"young": 1.1 * YOUNG, "poisson": 1.1 * POISSON, **changed, **fibres},
        fibre=FIBRE if has_fibres(name) else None,
    )


def _natural(F0: Array = F0, law: Law | None = None) -> Law:
    return NaturalState(law or NeoHooke(YOUNG, POISSON), F0)


NORMAL = np.cross(FIBRE, unit(0.2, 0.5, 0.8))
NORMAL /= np.linalg.norm(NORMAL)
# a fibre turned in the plane of NORMAL
OTHER = np.cos(0.1) * FIBRE + np.sin(0.1) * np.cross(NORMAL, FIBRE)


def _through(pieces: list[tuple[float, float, float]], value: float) -> ForceLength:
    """Continuous curve of pieces (start, slope there, curvature), with the value at the first start."""
    rows, last = [], value
    for k, (start, slope, half) in enumerate(pieces):
        rows.append([last - slope * start + half * start**2, slope - 2.0 * half * start, half])
        if k + 1 < len(pieces):
            step = pieces[k + 1][0] - start
            last += slope * step + half * step**2
    return ForceLength(np.array([start for start, _, _ in pieces]), np.array(rows), "test")


# corners away from the stretches of the battery's deformations, so that Taylor remainders see none
CORNERED = _through([(0.0, 0.9, -0.4), (0.65, 0.7, 0.2), (1.04, -0.6, 0.1), (1.7, 0.1, 0.3)], 0.4)
SMOOTH = _through([(0.0, 1.1, -0.5)], 0.4)
LEVEL = force_length("none")


def _tension(convention: Convention) -> Callable[..., Law]:
    def make(tension: float = 7.7, a0: Array = FIBRE, curve: ForceLength = LEVEL, **options: object) -> Law:
        return FibreTension(tension, a0, convention, curve, **options)

    return make


def _dispersed(
    tension: float = 7.7, a0: Array = FIBRE, spread: float = 0.5, density: str = "planar", curve: ForceLength = LEVEL
) -> Law:
    structure = Dispersion(spread, density, NORMAL).structure(a0)
    return FibreTension(tension, a0, structure=structure, force_length=curve)


def _integrated(tension: float = 7.7, a0: Array = FIBRE, spread: float = 0.5, density: str = "planar") -> Law:
    return AngularTension(tension, a0, Dispersion(spread, density, NORMAL), force_length=SMOOTH)


def _strained(tension: float = 7.7, a0: Array = FIBRE, law: Law | None = None) -> Law:
    return ActiveStrain(tension, a0, law or NeoHooke(YOUNG, POISSON))


STRESSES = [c for c in Convention if c is not Convention.active_strain]
TENSION = {"tension": 8.0, "a0": OTHER}

CASES = [
    *(_passive(name) for name in LAWS),
    Case(
        "natural_state",
        _natural,
        {"F0": F0 + 0.05 * np.eye(3), "law": NeoHooke(1.1 * YOUNG, POISSON)},
        rest=F0,
    ),
    *(
        Case(
            f"tension_{convention}",
            _tension(convention),
            {**TENSION, "curve": CORNERED, "transverse": 0.2},
            passive=False,
            fibre=FIBRE,
            energetic=convention is not Convention.cauchy,
        )
        for convention in STRESSES
    ),
    *(
        Case(
            f"tension_{convention}_by_length",
            lambda convention=convention, **changed: _tension(convention)(**{"curve": CORNERED, **changed}),
            {**TENSION, "curve": LEVEL},
            passive=False,
            fibre=FIBRE,
            energetic=convention is not Convention.cauchy,
        )
        for convention in STRESSES
    ),
    Case(
        "tension_across",
        lambda **changed: _tension(Convention.nominal)(**{"transverse": 0.3, **changed}),
        {**TENSION, "transverse": 0.2},
        passive=False,
        fibre=FIBRE,
    ),
    Case("dispersed", _dispersed, {**TENSION, "spread": 0.3}, passive=False, fibre=FIBRE, plane=True),
    Case(
        "dispersed_in_space",
        lambda **changed: _dispersed(**{"density": "solid", "curve": CORNERED, **changed}),
        {**TENSION, "spread": 0.3, "curve": LEVEL},
        passive=False,
        fibre=FIBRE,
    ),
    Case("integrated", _integrated, {**TENSION, "spread": 0.3}, passive=False, fibre=FIBRE, plane=True),
    Case(
        "active_strain",
        _strained,
        {**TENSION, "law": NeoHooke(1.2 * YOUNG, POISSON)},
        passive=False,
        fibre=FIBRE,
    ),
]
