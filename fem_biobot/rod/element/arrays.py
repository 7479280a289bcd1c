"""The arrays of rod elements, as compiled kernels take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Elements(NamedTuple):
    """Two-node rod elements with constant strains, m of them; float64 and int64, C-contiguous.

    The ends of an element are rigidly tied to its nodes: at the distance `offset`, and with directors turned by `turn`
    against the node's. ``Q`` of a node has the material directors as rows, the third along the rod.

    Attributes
    ----------
    nodes
        Nodes at the two ends, (m, 2).
    offset
        From each node to the element's end, in the node's material frame, (m, 2, 3) [mm].
    turn
        Directors of each end from those of its node, ``Q_end = turn Q``, (m, 2, 3, 3) [1], rotations.
    length
        Arc length in the natural configuration, (m,) [mm].
    eps0, kappa0
        Natural shear-stretch strain and curvature-twist in material components, (m, 3) [1], [1/mm].
    stiffness
        Resultants over the element's strains: ``GA1, GA2, EA`` [mN] and ``EI1, EI2, GJ`` [mN mm^2], shear factors
        included, and in those of shear what the element bends besides (see `rod.discretisation`), (m, 6).
    section
        The same of the section alone, (m, 6).
    sway
        Stretch along the first two shears beyond the natural ones, over half the square of each, (m, 2) [1].
    """

    nodes: NDArray[np.int64]
    offset: NDArray[np.float64]
    turn: NDArray[np.float64]
    length: NDArray[np.float64]
    eps0: NDArray[np.float64]
    kappa0: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    section: NDArray[np.float64]
    sway: NDArray[np.float64]
