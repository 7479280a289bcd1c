"""The three equations of the paper (Pagan-Diaz et al. 2018) as functions of plain numbers; the package computes more.

Where each stops being true is the subject of a study of its own, `studies/equations_of_the_paper.py`.
"""

from __future__ import annotations

import math

from fem_biobot.errors import ModelError


def equation_1(tension: float, area: float, theta: float = math.pi / 2, gamma: float = 1.0) -> float:
    """Eq. 1: force of a muscle held at its length, ``gamma sigma A sin(theta)`` [mN].

    Parameters
    ----------
    tension, area
        Tension of its fibres [kPa] and its section [mm^2].
    theta
        Angle of the fibres to the lateral axis [rad]; along the actuation at a right angle.
    gamma
        Viable fraction [1].

    Notes
    -----
    A continuum pulls with the square of the sine along the actuation where the fibres' own frame cannot turn.
    """
    return gamma * tension * area * math.sin(theta)


def equation_2(
    tension: float, area: float, young: float, strain: float, theta: float = math.pi / 2, gamma: float = 1.0
) -> float:
    """Eq. 2: force of a muscle that has shortened, ``A (gamma sigma sin(theta) - E eps / (1 - eps))`` [mN].

    Parameters
    ----------
    tension, area, theta, gamma
        As in `equation_1`.
    young
        Modulus of its passive resistance [kPa].
    strain
        Shortening over the length as moulded, positive, below 1 [1].

    Raises
    ------
    ModelError
        A muscle that has shortened to nothing.
    """
    if not strain < 1.0:
        raise ModelError(f"strain: found {strain:g}, expected a shortening below 1")
    return equation_1(tension, area, theta, gamma) - area * young * strain / (1.0 - strain)


def equation_3(sagitta: float, bending: float, arm: float, span: float) -> float:
    """Eq. 3: force that bends a beam to a sagitta, ``8 E I sagitta / (l L^2)`` [mN].

    Parameters
    ----------
    sagitta
        Of the beam's axis at mid-span [mm].
    bending
        Its bending stiffness ``E I`` [mN mm^2].
    arm, span
        From the muscle to the beam's axis, and between the pillars [mm].

    Notes
    -----
    Linear beam theory: small turns, an arm that stays, a beam whose section may curve sideways, rigid pillars.
    """
    return 8.0 * bending * sagitta / (arm * span**2)
