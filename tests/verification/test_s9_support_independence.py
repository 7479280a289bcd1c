"""S9: a self-equilibrated machine does not feel how it is held.

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

from fem_biobot.design import Design
from fem_biobot.solid.from_design import model_from_design, tension_step
from fem_biobot.solid.measures import measures
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.newton import NewtonSettings
from fem_biobot.solid.records import Fix
from tests.helpers import committed_bot

OTHER = (
    Fix("foot_short_centre", "xyz"),
    Fix("foot_long_centre", "yz"),
    # along one oblique axis only
    Fix("span_long", "y", axes=((1.0, 0.0, 0.0), (0.0, 0.8, 0.6), (0.0, -0.6, 0.8))),
)
MEASURES = ("tip_closing_mm", "sagitta_mm", "muscle_force_mN", "fibre_stretch_1", "eq3_force_mN", "strain_energy_uJ")


@pytest.fixture(scope="module")
def held() -> tuple[Design, list[SolidState]]:
    """The machine under its own supports and under others."""
    design, mesh = committed_bot()
    own = model_from_design(design, mesh)
    models = [own, SolidModel(mesh, own.materials, own.active, OTHER)]
    tight = NewtonSettings(tolerance=1e-12)
    return design, [solve(model, [tension_step(design, 4.0)], settings=tight).last for model in models]


def test_measures_do_not_depend_on_the_supports(held: tuple[Design, list[SolidState]]) -> None:
    """Closing, sagitta, forces, stretch and energy are the same, and so are all distances between landmarks.

    Catches: a closing along the global x, a sagitta from u_z, a force along a fixed axis.
    """
    design, states = held
    one, other = (measures(state, design) for state in states)
    for key in MEASURES:
        assert one[key] == pytest.approx(other[key], rel=1e-8), key
    assert one["tip_closing_mm"] > 0.3  # far from small rotations
    places = list(design.landmarks().values())
    shapes = [[np.array(X) + state.at(X) for X in places] for state in states]
    assert np.abs(np.array(shapes[0]) - np.array(shapes[1])).max() > 0.1  # they do stand differently
    for a, b in itertools.combinations(range(len(places)), 2):
        first, second = (np.linalg.norm(x[a] - x[b]) for x in shapes)
        assert first == pytest.approx(second, rel=1e-8)


def test_supports_carry_nothing(held: tuple[Design, list[SolidState]]) -> None:
    """Each of the three reactions vanishes beside the muscle's force.

    Catches: a support that holds more than six motions, a load left in the model.
    """
    design, states = held
    for state in states:
        force = measures(state, design)["muscle_force_mN"]
        for support in state.model.supports:
            assert np.abs(state.reaction(support.where)).max() < 1e-9 * force
