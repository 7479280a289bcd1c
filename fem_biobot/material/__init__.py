"""Constitutive laws: passive hyperelasticity and the active tension of muscle."""

from fem_biobot.material.active import ActiveStress, Convention, NominalTension
from fem_biobot.material.law import Law
from fem_biobot.material.laws import LAWS, law_from
from fem_biobot.material.natural_state import NaturalState
from fem_biobot.material.neo_hooke import NeoHooke

__all__ = ["LAWS", "ActiveStress", "Convention", "Law", "NaturalState", "NeoHooke", "NominalTension", "law_from"]
