"""Constitutive laws: passive hyperelasticity and the active tension of muscle."""

from fem_biobot.material.active import ActiveStress
from fem_biobot.material.active_strain import ActiveStrain
from fem_biobot.material.blemker import Blemker
from fem_biobot.material.conventions import Convention, converted_tension, force_factor, tension_table
from fem_biobot.material.dispersion import AngularTension, Density, Dispersion
from fem_biobot.material.fibre_tension import FibreTension
from fem_biobot.material.force_length import FORCE_LENGTH, ForceLength, force_length
from fem_biobot.material.force_velocity import ForceVelocity
from fem_biobot.material.gent import Gent
from fem_biobot.material.guccione import Guccione
from fem_biobot.material.holzapfel_ogden import HolzapfelOgden
from fem_biobot.material.law import Law, OutsideLawError
from fem_biobot.material.laws import LAWS, law_from
from fem_biobot.material.mooney_rivlin import MooneyRivlin
from fem_biobot.material.natural_state import NaturalState
from fem_biobot.material.neo_hooke import NeoHooke
from fem_biobot.material.neo_hooke_isochoric import NeoHookeIsochoric
from fem_biobot.material.volume import LINEAR, LOG, QUADRATIC, SplitLaw, Volumetric
from fem_biobot.material.yeoh import Yeoh

__all__ = [
    "FORCE_LENGTH",
    "LAWS",
    "LINEAR",
    "LOG",
    "QUADRATIC",
    "ActiveStrain",
    "ActiveStress",
    "AngularTension",
    "Blemker",
    "Convention",
    "Density",
    "Dispersion",
    "FibreTension",
    "ForceLength",
    "ForceVelocity",
    "Gent",
    "Guccione",
    "HolzapfelOgden",
    "Law",
    "MooneyRivlin",
    "NaturalState",
    "NeoHooke",
    "NeoHookeIsochoric",
    "OutsideLawError",
    "SplitLaw",
    "Volumetric",
    "Yeoh",
    "converted_tension",
    "force_factor",
    "force_length",
    "law_from",
    "tension_table",
]
