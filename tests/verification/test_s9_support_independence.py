"""S9 beyond its rows in the table: a self-equilibrated machine does not feel how it is held.

Problem: the junction bot at 4 kPa, held against its six rigid motions at three vertices, chosen in two ways.
Exact answer: the same shape up to a rigid motion, and supports without force (statically determinate, no load).
Measured: closing, sagitta, force and stretch of the measures, distances between landmarks, reactions.
Tolerance: 1e-8 relative and 1e-9 of the muscle force, a hundred times what the residual of 1e-12 leaves.
Cannot see: whether the shape is right.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from fem_biobot.solid.measures import measures
from fem_biobot.verification.solid_machine import held_in_two_ways


def test_shapes_do_not_depend_on_the_supports() -> None:
    """Distances between landmarks are the same, though the two stand differently.

    Catches: a support that holds more than six motions.
    """
    design, states = held_in_two_ways()
    assert measures(states[0], design)["tip_closing_mm"] > 0.3  # far from small rotations
    places = list(design.landmarks().values())
    shapes = [[np.array(X) + state.at(X) for X in places] for state in states]
    assert np.abs(np.array(shapes[0]) - np.array(shapes[1])).max() > 0.1  # they do stand differently
    for a, b in itertools.combinations(range(len(places)), 2):
        first, second = (np.linalg.norm(x[a] - x[b]) for x in shapes)
        assert first == pytest.approx(second, rel=1e-8)
