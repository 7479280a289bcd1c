"""What a number called active tension multiplies: the conventions, and how to go from one to another.

A fibre at the stretch ``s`` in tissue of the volume ratio ``J`` pulls, per reference area across it, with

    convention      force / (T A_0)
    nominal         1
    second_piola    s
    kirchhoff       1 / s
    cauchy          J / s

so that the same force needs these tensions, here for 10 kPa of nominal tension at constant volume:

    stretch [1]  nominal [kPa]  second_piola [kPa]  kirchhoff [kPa]  cauchy [kPa]
            0.6             10               16.67                6             6
            0.7             10               14.29                7             7
            0.8             10                12.5                8             8
            0.9             10               11.11                9             9
              1             10                  10               10            10
            1.1             10               9.091               11            11

Active strain has no such factor: its force depends on the passive law too.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.law import Array
from fem_biobot.tables import Table


class Convention(StrEnum):
    """What a number called active tension multiplies, by energy ``psi_a`` or stress, and what that does to the force.

    ``s`` is the fibre stretch, ``a`` the unit current fibre, ``A_0`` the reference and ``A`` the current area.

    * ``nominal``: ``psi_a = T (s - 1)``, ``P = T a x a0``. The force through a strip is ``T A_0`` whatever its stretch,
      as in Eq. 1 and 2 of Pagan-Diaz et al. (2018).
    * ``second_piola``: ``psi_a = T (s^2 - 1) / 2``, ``S = T a0 x a0``; the convention of the cardiac benchmarks (Land
      et al. 2015) and of FEBio's prescribed active contraction. The force is ``T A_0 s``: it falls as the muscle
      shortens, by 40 % at a stretch of 0.6.
    * ``kirchhoff``: ``psi_a = T ln s``, ``tau = T a x a``. The force is ``T A_0 / s``: it rises as the muscle shortens.
    * ``cauchy``: ``sigma = T a x a``, the force is ``T A`` with the current area, ``T A_0 J / s``: at constant volume
      that of ``kirchhoff``. It has no energy; its tangent is not symmetric.
    * ``active_strain``: no stress is added. The tissue's natural state contracts along the fibre at constant volume,
      ``psi = psi_p(F F_a^-1)``, to the stretch at which nominal tension ``T`` would leave an incompressible, free,
      uniaxial body of the same passive law. Equal to ``nominal`` there and different in shear (Ambrosi and Pezzuto
      2012; Giantesio, Musesti and Riccobelli 2019): the contracted matrix, not the fibre alone, resists.
    """

    nominal = "nominal"
    second_piola = "second_piola"
    kirchhoff = "kirchhoff"
    cauchy = "cauchy"
    active_strain = "active_strain"


# S = T s^-power a0 x a0, times J for cauchy
POWER = {Convention.nominal: 1, Convention.second_piola: 0, Convention.kirchhoff: 2, Convention.cauchy: 2}


def convention_of(name: Convention | str) -> Convention:
    """The convention of a name; refuses an unknown one."""
    try:
        return Convention(name)
    except ValueError:
        known = ", ".join(c.value for c in Convention)
        raise ModelError(f"convention: found {name!r}, expected one of {known}") from None


def force_factor(convention: Convention | str, stretch: Array | float, volume_ratio: Array | float = 1.0) -> Array:
    """Force along the fibre over tension and reference area, (...) [1].

    Refuses ``active_strain``, whose force depends on the passive law, and a stretch or volume ratio not above 0.
    """
    convention = convention_of(convention)
    if convention is Convention.active_strain:
        raise ModelError("convention: found active_strain, expected one of the active stresses for a force factor")
    s, J = np.broadcast_arrays(np.asarray(stretch, dtype=float), np.asarray(volume_ratio, dtype=float))
    for name, value in (("stretch", s), ("volume ratio", J)):
        if not np.all(value > 0.0):
            raise ModelError(f"{name}: found {np.min(value):g}, expected above 0")
    return s ** (1.0 - POWER[convention]) * (J if convention is Convention.cauchy else 1.0)


def converted_tension(
    tension: Array | float,
    given: Convention | str,
    wanted: Convention | str,
    stretch: Array | float,
    volume_ratio: Array | float = 1.0,
) -> Array:
    """Tension of the wanted convention that pulls with the same force as the given one at a stretch.

    Parameters
    ----------
    tension
        In the convention `given`, (...) [kPa].
    stretch, volume_ratio
        Fibre stretch and volume ratio at which the force is to be the same, (...) [1]. At others it differs.

    Returns
    -------
    Array
        (...) [kPa].
    """
    factors = [force_factor(convention, stretch, volume_ratio) for convention in (given, wanted)]
    return np.asarray(tension, dtype=float) * factors[0] / factors[1]


def tension_table(
    tension: float = 10.0,
    given: Convention | str = Convention.nominal,
    stretches: Sequence[float] = (0.6, 0.7, 0.8, 0.9, 1.0, 1.1),
) -> Table:
    """Table of the tensions [kPa] of all active stresses that pull alike at each stretch, at constant volume."""
    given = convention_of(given)
    rows = [(float(s), *(float(converted_tension(tension, given, c, s)) for c in POWER)) for s in stretches]
    title = f"tensions that pull as {tension:g} kPa in the convention {given.value}, at constant volume"
    return Table(title, ("stretch [1]", *(f"{c.value} [kPa]" for c in POWER)), tuple(rows))
