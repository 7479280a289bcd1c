"""What the compiled kernels read of the muscles' activation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fem_biobot.rod.activation.curve import KNOTS, MuscleCurve
from fem_biobot.rod.arrays import Activation
from fem_biobot.rod.records import Muscle, Spring


def activations(members: Sequence[Muscle | Spring]) -> Activation:
    """Standing forces and curves of all members; a curve that several muscles share is kept once."""
    curves: list[MuscleCurve] = []
    number = np.full((len(members), 2), -1, dtype=np.int64)
    standing = np.zeros(len(members))
    for k, member in enumerate(members):
        if not isinstance(member, Muscle):
            continue
        standing[k] = member.isometric(0.0)
        for column, curve in enumerate((member.force_length, member.force_velocity)):
            if curve is not None:
                if curve not in curves:
                    curves.append(curve)
                number[k, column] = curves.index(curve)
    table = np.array([c.table for c in curves], dtype=float).reshape(len(curves), KNOTS, 2)
    low, spacing = (np.array(column, dtype=float) for column in ([c.low for c in curves], [c.spacing for c in curves]))
    return Activation(standing, number, low, spacing, table)
