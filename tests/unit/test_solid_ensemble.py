"""Ensembles of the solid: starts paired with the rods', one body and one standing machine for all, gaits."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.ensembles import Nudge, generator_of
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.rod import ensemble as of_rods
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.rest import stance
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.motion import SolidCheckpoint
from fem_biobot.solid.ensemble import nudged, solid_ensemble
from fem_biobot.solid.gait import SolidWalk
from fem_biobot.solid.standing import Standing, stand
from fem_biobot.solid.walk import solid_ground, walking_body

# the coarsest mesh and few steps, for properties and no numbers
SETS = (
    "muscle.passive_tension=0.9 kPa", "muscle.active_tension=2.7 kPa", "numerics.step=10 ms", "mesh.size=14 mm",
)  # fmt: skip
NUDGE = Nudge(0.03, 1.3, 0.7)


@cache
def machine() -> tuple[Design, MovingBody, Standing]:
    """A design, its body, and how it stands."""
    design = load_design("junction_bot", SETS)
    body = walking_body(design, mesh_for(design)[0])
    return design, body, stand(design, body, solid_ground(design))


def pushed(number: int, seed: int = 5) -> SolidCheckpoint:
    _, body, stood = machine()
    return nudged(body, stood, NUDGE, generator_of(seed, number))


def test_starts_are_those_of_the_rods() -> None:
    """The same seed and number lift solid and rods alike, and give both centres of mass the same velocity, both bodies
    the same spin; the shape stays, nothing touches, and the book begins with the energy of that rigid motion.

    Catches: numbers drawn in another order, a spin about the origin, a node or a foot that keeps its velocity or force.
    """
    design, body, stood = machine()
    rods = of_rods.nudged(stance(reduce(design, beam_elements=4), ground_of(design)), NUDGE, generator_of(5, 3))
    made, still = pushed(3), stood.checkpoint.state
    lift = made.state.u - still.u
    rods_lift = rods.x - stance(rods.model, ground_of(design)).state.x
    np.testing.assert_allclose(lift, np.tile(rods_lift[0], (len(lift), 1)), atol=1e-12)
    total, spin = body.total_mass, float(rods.v[0, 4])
    velocity = body.momentum_of(made.state.v).sum(axis=0) / total
    mass = rods.model.assembly.inertia.mass
    np.testing.assert_allclose(velocity, mass @ rods.v[:, :3] / mass.sum(), atol=1e-12)
    x = body.system.space.points.T + made.state.u
    # a rigid motion: no two nodes part, and each turns about the lateral axis with the spin
    arm = x - x[0]
    np.testing.assert_allclose(made.state.v - made.state.v[0], np.cross([0.0, spin, 0.0], arm), atol=1e-12)
    assert not made.state.touch.force.any()
    assert not made.state.change.any()
    turning = made.state.v - velocity
    inertia = np.sum(turning * body.momentum_of(turning)) / spin**2
    assert made.book[0] == pytest.approx(0.5 * total * velocity @ velocity + 0.5 * inertia * spin**2, rel=1e-9)
    assert made.time == 0.0


def test_starts_follow_from_seed_and_number() -> None:
    """Another number or seed is another start; the same is the same to the last bit.

    Catches: a generator that goes on from start to start.
    """
    np.testing.assert_array_equal(pushed(1).state.v, pushed(1).state.v)
    for other in (pushed(2), pushed(1, 6)):
        assert np.abs(pushed(1).state.v - other.state.v).max() > 1e-3


def test_an_ensemble_walks_from_its_starts() -> None:
    """Each walk begins at its own nudged start, on one body and from one standing machine, from which closings count;
    gaits hold every start; the summary is a file's.

    Catches: walks from the standing machine itself, a stance found for each, a listener told in another order.
    """
    design, body, stood = machine()
    heard: list[tuple[int, SolidWalk]] = []
    made = solid_ensemble(
        design, body, 4.0, starts=2, seed=5, nudge=NUDGE, start=stood, duration=0.25, sample_every=5,
        listener=lambda number, walk: heard.append((number, walk)),
    )  # fmt: skip
    assert [number for number, _ in heard] == [0, 1]
    assert all(walk is each for (_, walk), each in zip(heard, made.walks, strict=True))
    for number, each in enumerate(made.walks):
        np.testing.assert_array_equal(each.motion.u[0].T, pushed(number).state.u)
        assert each.start is stood
        assert each.motion.body is body
        assert each.tip_closing[0] == pytest.approx(0.0, abs=1e-9)
        assert each.strokes == 1
    assert sorted(k for gait in made.gaits for k in gait.members) == [0, 1]
    assert made.step_mm == pytest.approx(np.mean([each.step_mm for each in made.walks]), rel=1e-12)
    summary = json.loads(json.dumps(made.summary(), allow_nan=False))
    assert (summary["model"], summary["starts_1"], summary["seed"]) == ("solid", 2, 5)
    assert summary["stroke_mm"] == pytest.approx(made.values("stroke_mm").mean(), rel=1e-12)


def test_what_cannot_walk_is_refused() -> None:
    """No starts, and a design whose solid does not walk.

    Catches: an ensemble of nothing, whose mean is none.
    """
    design, body, stood = machine()
    with pytest.raises(ModelError, match="solid_ensemble: starts: found 0"):
        solid_ensemble(design, body, starts=0, start=stood)
    remodelled = design.with_values({"muscle.reference": "remodelled"})
    with pytest.raises(DesignError, match=r"muscle\.reference"):
        solid_ensemble(remodelled, body, starts=1, start=stood)
