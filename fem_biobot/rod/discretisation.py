"""How a rod becomes elements: their shear flexibility, and the share of their mass and load that each node takes."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]

# spans that differ by less than this count as equal [1]
_EQUAL = 1e-6


class Discretisation(StrEnum):
    """Elements of a rod; both are the two-node element with strains constant along it.

    corrected
        The shear flexibility ``1 / k G A`` of an element of length L gains ``L^2 / (12 E I)`` in each plane of bending:
        what it bends under a shear force, which a constant curvature leaves out (`residual_bending`). Mass, loads
        along the rod and drag go to the nodes so that cubics are integrated exactly (`node_shares`). Deflections and
        frequencies in bending are of fourth order in L, those of a straight rod under forces on its nodes exact at
        small load. What is left at second order: bending together with twist, stretch and shear along a bent rod, and
        waves of stretch and twist.
    plain
        The section's own shear flexibility, and half of each element's mass and load on each of its ends: second
        order. Elements of the published rod codes.
    """

    corrected = "corrected"
    plain = "plain"

    @classmethod
    def of(cls, value: object, what: str) -> Discretisation:
        """The member of that name; refuses others in the name of `what`."""
        try:
            return cls(value)
        except ValueError:
            raise ModelError(f"{what}: discretisation: found {value!r}, expected {' or '.join(cls)}") from None


def residual_bending(section: Array, length: Array) -> tuple[Array, Array]:
    """Stiffnesses of corrected elements from those of their sections, and what they gain in length.

    Parameters
    ----------
    section
        ``GA1, GA2, EA`` [mN] and ``EI1, EI2, GJ`` [mN mm^2] of the sections, (m, 6).
    length
        Of the elements, (m,) [mm].

    Returns
    -------
    stiffness
        (m, 6), a new array, the first two ``1 / (1 / GA1 + L^2 / (12 EI2))`` and ``1 / (1 / GA2 + L^2 / (12 EI1))``.
    sway
        Of `Elements`, (m, 2) [1]: 6/5 of the square of bending's share of each shear.

    Notes
    -----
    Residual bending flexibility (MacNeal 1978, A simple quadrilateral shell element, Computers and Structures 8; for
    beams Hughes, Taylor and Kanoknukulchai 1977). A shear force Q makes the couple grow by Q along the element; the
    curvature Q s / EI beyond its mean moves the ends apart by ``Q L^3 / (12 EI)``, the mean strain conjugate to Q by
    ``Q L^2 / (12 EI)``. In a bent element the strain beyond the mean is that of a helix to the relative order
    ``(kappa L)^2``, so that the sum is off by ``L^4`` there.

    The slopes of that S, ``6 g (1/4 - s^2 / L^2)`` between -L/2 and L/2 for a mean g, have the mean square ``6/5 g^2``,
    and shorten the projection of the arc by half of it: the geometric stiffness ``6 T / 5 L`` of the cubic beam element
    under a tension T.
    """
    stiffness, sway = section.copy(), np.zeros((len(length), 2))
    for shear, bending in ((0, 4), (1, 3)):
        soft = 1.0 / section[:, shear] + length**2 / (12.0 * section[:, bending])
        stiffness[:, shear] = 1.0 / soft
        sway[:, shear] = 1.2 * (length**2 / (12.0 * section[:, bending]) / soft) ** 2
    return stiffness, sway


def node_shares(spans: Array, alike: Sequence[object]) -> Array:
    """Which share of an element's mass, or load, each node of a rod takes when cubics are to be integrated.

    Parameters
    ----------
    spans
        Lengths of the elements, (m,) [mm].
    alike
        What is equal for neighbours between which motion is smooth: their sections and factors of mass; m of them.

    Returns
    -------
    Array
        (m, m + 1) [1]; rows have the sum 1, and no node takes less than a third of an element in all.

    Notes
    -----
    The integral over an element of the cubic through four nodes, and at the ends of a stretch of the parabola through
    three. In a stretch of equal elements that is Gregory's rule, with the sums 3/8, 7/6, 23/24, 1, 1, ...; for two
    elements Simpson's. An element without an equal neighbour gives each end a half.
    """
    m = len(spans)
    shares = np.zeros((m, m + 1))
    cuts = [
        e + 1
        for e, (a, b) in enumerate(pairwise(range(m)))
        if alike[a] != alike[b] or abs(spans[a] - spans[b]) > _EQUAL * spans[a]
    ]
    for first, end in pairwise([0, *cuts, m]):
        if end - first == 1:
            shares[first, first : end + 1] = 0.5
            continue
        for e in range(first + 1, end - 1):
            shares[e, e - 1 : e + 3] = np.array([-1.0, 13.0, 13.0, -1.0]) / 24.0
        shares[first, first : first + 3] = np.array([5.0, 8.0, -1.0]) / 12.0
        shares[end - 1, end - 2 : end + 1] = np.array([-1.0, 8.0, 5.0]) / 12.0
    return shares


def halves(m: int) -> Array:
    """`node_shares` of plain elements: a half of each on each of its ends, (m, m + 1)."""
    return 0.5 * (np.eye(m, m + 1) + np.eye(m, m + 1, 1))
