"""Landmarks: where a machine is measured whose parts do not tell it by themselves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.anatomy import anatomy, muscle_forces, muscle_lengths, path
from fem_biobot.rod.dynamics.integrate import dynamics
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.landmarks import Landmarks
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Body, Muscle, Rigid, Rod
from fem_biobot.rod.section import RodMaterial, Section

X = (-2.0, -0.5, 1.0, 2.0)
MARKS = Landmarks(("beam", 1), ("beam", -1), ("beam", 2), [["first", "second", "third"], ["other"]])


def machine(**more: Any) -> RodModel:
    """Two blocks joined by a beam, a chain of three muscles along it, one beside, and a rod that hangs at the end."""
    blocks = [Body.box((s, 0.0, 0.5), (1.0, 1.0, 1.0), 1e-6, n) for s, n in ((-2.0, "a"), (2.0, "b"))]
    material = RodMaterial(young=100.0, density=1e-6, poisson=0.4)
    rods = [
        Rod(np.array([(x, 0.0, 1.0) for x in X]), Section.circle(0.3), material, "beam"),
        Rod(np.array([(2.0, 0.0, 1.0), (2.5, 0.0, 1.2)]), Section.circle(0.1), material, "tail"),
    ]
    joints = [Rigid(("beam", 0), ("a", (-2.0, 0.0, 1.0))), Rigid(("beam", -1), ("b", (2.0, 0.0, 1.0)))]
    joints.append(Rigid(("beam", -1), ("tail", 0)))
    chain = [
        Muscle(("beam", i), ("beam", i + 1), 0.1, 5.0, 1.0, 2.0, rest_length=1.1, name=name)
        for i, name in enumerate(("first", "second", "third"))
    ]
    beside = Muscle(("a", (-2.0, 0.0, 0.2)), ("b", (2.0, 0.0, 0.2)), 0.2, 10.0, active=1.0, name="other")
    corners = [(i, j, 0.0) for i in (-0.5, 0.5) for j in (-0.5, 0.5)]
    feet = [ContactPoints(n, np.array(corners) + np.array([s, 0.0, 0.0])) for s, n in ((-2.0, "a"), (2.0, "b"))]
    return RodModel(rods, joints, blocks, members=[*chain, beside], contacts=feet, **more)


def test_a_chain_counts_as_one_muscle() -> None:
    """As long as its members together and as strong as the middle one; without landmarks every member is a muscle.

    Catches: a chain whose members are added up in force, its first taken for the whole.
    """
    model = machine(landmarks=MARKS)
    motion = dynamics(model, 4e-3, 2e-3, ground=Ground(), drive=lambda t: 0.7)
    found = anatomy(model)
    states = [motion.state(i) for i in range(3)]
    np.testing.assert_allclose(
        muscle_lengths(motion, found),
        [
            [sum(s.muscle_length(name) for name in ("first", "second", "third")), s.muscle_length("other")]
            for s in states
        ],
        rtol=1e-12,
    )
    wanted = [[s.muscle_force(name) for name in ("second", "other")] for s in states]
    np.testing.assert_allclose(muscle_forces(motion, found), wanted, rtol=1e-12)
    assert len(anatomy(machine()).muscles) == 4


def test_places_are_the_given_ones() -> None:
    """Ends of the span and its middle are where the landmarks say, not at the ends of the last rod.

    Catches: the first and last rod of the model taken for the beam.
    """
    model = machine(landmarks=MARKS)
    motion = dynamics(model, 2e-3, 2e-3, ground=Ground())
    found = anatomy(model)
    for spot, place in ((found.start, MARKS.start), (found.end, MARKS.end), (found.crown, MARKS.crown)):
        assert spot is not None
        np.testing.assert_allclose(path(motion, spot)[0], model.drawn().at(place), atol=1e-13)


def test_landmarks_that_are_not_there_are_refused() -> None:
    """Names of muscles, nodes, and empty chains.

    Catches: a misspelt muscle left out of its chain.
    """
    for muscles, word in (([["none"]], "no muscle of the name 'none', expected one of: first"),):
        with pytest.raises(ModelError, match=f"landmarks: {word}"):
            machine(landmarks=replace(MARKS, muscles=muscles))
    with pytest.raises(ModelError, match="expected the number of one of its 4 nodes"):
        machine(landmarks=replace(MARKS, crown=("beam", 9)))
    for wrong in ([], [[]], ["first"]):
        with pytest.raises(ModelError, match="landmarks: muscles: found"):
            replace(MARKS, muscles=wrong)
