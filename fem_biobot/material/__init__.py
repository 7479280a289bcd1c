"""Constitutive laws: passive hyperelasticity and the active tension of muscle."""

from fem_biobot.material.active import ActiveStress, Convention, NominalTension
from fem_biobot.material.law import Law
from fem_biobot.material.laws import LAWS, law_from
from fem_biobot.material.natural_state import NaturalState
from fem_biobot.material.neo_hooke import NeoHooke
from fem_biobot.material.volume import LINEAR, LOG, QUADRATIC, SplitLaw, Volumetric

__all__ = [
    "LAWS",
    "LINEAR",
    "LOG",
    "QUADRATIC",
    "ActiveStress",
    "Convention",
    "Law",
    "NaturalState",
    "NeoHooke",
    "NominalTension",
    "SplitLaw",
    "Volumetric",
    "law_from",
]
