"""Touches between rods: the nearest point and its derivatives, what is refused, and the analyses that do not know."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from fem_biobot.errors import ModelError
from fem_biobot.rod.dynamics.integrate import dynamics
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.modes import modes
from fem_biobot.rod.records import Hold, Rod
from fem_biobot.rod.rotation.kernels import turn
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.statics import statics
from fem_biobot.rod.touch import Touch
from fem_biobot.rod.touching.kernels import touch
from tests.helpers import generator
from tests.rods import straight

MATERIAL = RodMaterial(young=10.0, density=1e-6, poisson=0.3)
ROUND = Section.circle(0.4)


def _pair(touches: list[Touch] | None = None, section: Section = ROUND) -> RodModel:
    """A rod above and across another of two elements with a corner."""
    upper = Rod(straight(2, 2.0, (0.2, 1.0, 0.1)) + np.array([0.7, -1.0, 1.0]), ROUND, MATERIAL, name="upper")
    lower = Rod(np.array([[0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [2.0, -0.2, 0.1]]), section, MATERIAL, name="lower")
    return RodModel([upper, lower], supports=[Hold(("lower", 0))], touches=touches or [Touch("upper", "lower")])


WALL = (0.3, 0.2, 0.9)


@pytest.mark.parametrize("along", [None, WALL])
@pytest.mark.parametrize("endless", [False, True])
def test_rows_are_the_derivatives_of_the_gap(along: tuple[float, float, float] | None, endless: bool) -> None:
    """The normal row times small motions of the nodes is the change of the gap, at every node of the upper rod.

    Catches: shares of the segment's ends exchanged, arms of the wrong sign, a nearest point of another segment, a wall
    whose normal leans.
    """
    model = _pair([Touch("upper", "lower", along=along, endless=endless, distance=0.1)])
    state, rng = model.drawn(), generator(5)
    T = model.assembly.touches
    v = rng.normal(size=(model.n_nodes, 6))
    seen = set()
    for k in range(3):
        rows, ends = np.zeros((3, 3, 6)), np.zeros(3, dtype=np.int64)
        touch(T, k, state.x, state.Q, rows, ends)
        seen.add(tuple(ends[1:]))
        slope = sum(rows[0, e] @ v[ends[e]] for e in range(3))
        h, gaps = 1e-6, []
        for sign in (1.0, -1.0):
            Q = np.empty_like(state.Q)
            turn(state.Q, sign * h * v[:, 3:], Q)
            gaps.append(touch(T, k, state.x + sign * h * v[:, :3], Q, np.zeros((3, 3, 6)), ends))
        assert (gaps[0] - gaps[1]) / (2 * h) == pytest.approx(slope, abs=1e-8)
    assert len(seen) >= 1


def test_gap_is_the_distance_to_the_nearest_segment() -> None:
    """Against a dense sampling of the chain.

    Catches: the line through a segment taken beyond its ends, the first segment always.
    """
    model = _pair()
    points = model.rods[1].points
    dense = np.concatenate([a + np.linspace(0, 1, 4001)[:, None] * (b - a) for a, b in pairwise(points)])
    state = model.drawn()
    for k in range(3):
        ends = np.zeros(3, dtype=np.int64)
        gap = touch(model.assembly.touches, k, state.x, state.Q, np.zeros((3, 3, 6)), ends)
        nearest = np.linalg.norm(dense - model.rods[0].points[k], axis=1).min() - 0.8
        assert gap == pytest.approx(nearest, abs=1e-6)


def test_a_wall_goes_on_along_its_direction_and_an_endless_one_beyond_its_ends() -> None:
    """Gaps are distances in the plane across the wall, from the segments, or from the lines through the outer ones.

    Catches: the height over the chain counted, an inner segment taken as endless, the wrong end continued.
    """
    w = np.array(WALL) / np.linalg.norm(WALL)
    across = np.eye(3) - np.outer(w, w)
    model = _pair([Touch("upper", "lower", along=WALL, endless=endless, distance=0.1) for endless in (False, True)])
    T, state = model.assembly.touches, model.drawn()
    chain, nodes = model.rods[1].points @ across, model.rods[0].points @ across
    ends = np.zeros(3, dtype=np.int64)
    for k in range(6):
        spans = [(0.0, 1.0), (0.0, 1.0)] if k < 3 else [(-9.0, 1.0), (0.0, 10.0)]
        apart = []
        for (a, b), (low, high) in zip(pairwise(chain), spans, strict=True):
            t = np.clip((nodes[k % 3] - a) @ (b - a) / ((b - a) @ (b - a)), low, high)
            apart.append(np.linalg.norm(nodes[k % 3] - a - t * (b - a)))
        gap = touch(T, k, state.x, state.Q, np.zeros((3, 3, 6)), ends)
        assert gap == pytest.approx(min(apart) - 0.1, abs=1e-12)


def test_forces_on_a_wall_are_opposite_and_across_it() -> None:
    """What a unit of normal impulse does to all nodes: no sum, no part along the wall.

    Catches: a leaning normal that would lift what it pushes.
    """
    model = _pair([Touch("upper", "lower", along=WALL, endless=True, distance=0.1)])
    state, w = model.drawn(), np.array(WALL) / np.linalg.norm(WALL)
    for k in range(3):
        rows, ends = np.zeros((3, 3, 6)), np.zeros(3, dtype=np.int64)
        touch(model.assembly.touches, k, state.x, state.Q, rows, ends)
        np.testing.assert_allclose(rows[0, :, :3].sum(axis=0), 0.0, atol=1e-14)
        np.testing.assert_allclose(rows[0, :, :3] @ w, 0.0, atol=1e-14)


def test_surfaces_at_rest_against_each_other_have_no_slip() -> None:
    """A common rigid motion of both parts moves neither along nor off the other.

    Catches: arms from the axes (the surfaces then slip in a common turn), weights that do not sum up to one.
    """
    model = _pair()
    state, rng = model.drawn(), generator(8)
    spin, centre, velocity = rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)
    v = np.concatenate([velocity + np.cross(spin, state.x - centre), np.tile(spin, (model.n_nodes, 1))], axis=1)
    for k in range(3):
        rows, ends = np.zeros((3, 3, 6)), np.zeros(3, dtype=np.int64)
        touch(model.assembly.touches, k, state.x, state.Q, rows, ends)
        slip = sum(rows[:, e] @ v[ends[e]] for e in range(3))
        np.testing.assert_allclose(slip, 0.0, atol=1e-13)


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Touch("upper", "lower", distance=0.0), "touch of upper: distance: found 0.0"),
        (lambda: Touch("upper", "lower", friction=-0.1), "touch of upper: friction: found -0.1"),
        (lambda: Touch("upper", [("lower", 0)]), "against: found 1 places, expected at least 2"),
        (lambda: _pair([Touch("other", "lower")]), "rod: no rod of the name 'other', expected one of: upper, lower"),
        (lambda: _pair([Touch("upper", "other")]), "against: no rod of the name 'other'"),
        (lambda: _pair([Touch("upper", "upper")]), "found the rod itself"),
        (lambda: _pair([Touch("upper", "lower", nodes=[3])]), "nodes: found 3, expected numbers of its 3 nodes"),
        (lambda: _pair([Touch("upper", [("lower", 0), ("lower", 1)])]), "chain of places without distance"),
        (lambda: _pair([Touch("upper", [("lower", 0), ("lower", 0)], distance=1.0)]), "drawn at one point"),
        (lambda: _pair([Touch("upper", "lower")], Section.rectangle(1.0, 0.5)), "a section that is not round"),
        (lambda: Touch("upper", "lower", along=(0.0, 0.0, 0.0)), "along: found"),
        (lambda: Touch("upper", "lower", along=(0.0, 1.0)), "along: found"),  # type: ignore[arg-type]
        (lambda: _pair([Touch("upper", [("lower", 0), ("lower", 1)], distance=1.0, along=(2.0, 0.2, 0.0))]), "itself"),
        (lambda: statics(_pair(), [1.0]), "statics: found 1 touches"),
        (lambda: modes(_pair()), "modes: found 1 touches"),
        (lambda: dynamics(_pair([Touch("upper", "lower", distance=1.3)]), 1e-3), "inside what it touches"),
    ],
)
def test_what_cannot_be_is_refused(make: Callable[[], object], word: str) -> None:
    """One line that names the record.

    Catches: a missing part taken for none, an analysis that ignores touches in silence, a start with parts in others.
    """
    with pytest.raises(ModelError, match=word) as found:
        make()
    assert "\n" not in str(found.value)
