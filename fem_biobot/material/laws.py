"""The table of passive laws that a design can name; the shared test battery runs over every entry.

A law of a user's own needs no entry here: any object with the methods of `Law` goes into
``SolidModel(materials={"region": MyLaw(...)})``. The table is for names in design files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields

from fem_biobot.errors import ModelError
from fem_biobot.material.blemker import Blemker
from fem_biobot.material.gent import Gent
from fem_biobot.material.guccione import Guccione
from fem_biobot.material.holzapfel_ogden import HolzapfelOgden
from fem_biobot.material.law import Array, Law
from fem_biobot.material.mooney_rivlin import MooneyRivlin
from fem_biobot.material.neo_hooke import NeoHooke
from fem_biobot.material.neo_hooke_isochoric import NeoHookeIsochoric
from fem_biobot.material.yeoh import Yeoh

# made from Young's modulus, Poisson's ratio, fibres where the law has them, and its own parameters by name
LAWS: dict[str, Callable[..., Law]] = {
    "neo_hooke": NeoHooke,
    "neo_hooke_isochoric": NeoHookeIsochoric,
    "mooney_rivlin": MooneyRivlin,
    "yeoh": Yeoh,
    "gent": Gent,
    "guccione": Guccione,
    "holzapfel_ogden": HolzapfelOgden,
    "blemker": Blemker,
}


def _known(name: str) -> Callable[..., Law]:
    if name not in LAWS:
        raise ModelError(f"law: found {name!r}, expected one of {', '.join(LAWS)}")
    return LAWS[name]


def has_fibres(name: str) -> bool:
    """Whether the law of a name takes fibres."""
    return any(f.name == "a0" for f in fields(_known(name)))  # type: ignore[arg-type]


def parameters(name: str) -> dict[str, str]:
    """Names of a law's own parameters with their coherent units."""
    return {f.name: f.metadata["range"].unit for f in fields(_known(name)) if "range" in f.metadata}  # type: ignore


def law_from(name: str, young: float, poisson: float, a0: Array | None = None, **own: float) -> Law:
    """Passive law of a name.

    Parameters
    ----------
    young, poisson
        Small-strain moduli [kPa], [1]; each law says what they mean to it.
    a0
        Fibres, (3,) or (3, e) over all elements [1]; asked for by a law that has them, left alone by one that has none.
    own
        The law's own parameters by name, in coherent units; those not given keep the law's defaults.

    Raises
    ------
    ModelError
        An unknown name, a parameter that the law does not have, a law with fibres without any, a value out of range.
    """
    make, known = _known(name), parameters(name)
    for given in own:
        if given not in known:
            expected = f"one of {', '.join(known)}" if known else "none"
            raise ModelError(f"{given}: found a parameter that the law {name} does not have, expected {expected}")
    if not has_fibres(name):
        return make(young, poisson, **own)
    if a0 is None:
        raise ModelError(f"law: found {name} where there are no fibres, expected a law without fibres")
    return make(young, poisson, a0, **own)
