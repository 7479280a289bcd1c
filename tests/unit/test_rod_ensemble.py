"""Ensembles: gaits told apart, starts that are paired, means."""

from __future__ import annotations

import json
import math
from functools import cache

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.ensembles import gaits
from fem_biobot.errors import ModelError
from fem_biobot.rod.ensemble import walk_ensemble


@cache
def wet() -> Design:
    """The junction bot under water: light enough for its feet to slip."""
    return load_design("junction_bot").with_values({"ground.immersion": "submerged"})


def test_gaits_are_told_apart_by_gaps_wider_than_their_spread() -> None:
    """Two groups of steps give two gaits with their shares; values spread evenly give one.

    Catches: every value a gait, a gap judged without the spread, shares of the wrong group.
    """
    steps = np.array([0.29, 0.171, 0.17, 0.291, 0.169, 0.1705, 0.2895, 0.17])
    first, second = gaits(steps)
    assert first.members == (4, 2, 7, 5, 1)
    assert first.share == 0.625
    assert second.step_mm == pytest.approx(0.290166666667)
    assert second.interval_mm[0] < 0.2895 < second.interval_mm[1]
    # Wilson: (p + z^2/2n -+ z sqrt(p q/n + z^2/4n^2)) / (1 + z^2/n) with p = 5/8, n = 8, z = 1.96
    np.testing.assert_allclose(first.share_interval, [0.3057, 0.8632], atol=1e-4)
    assert len(gaits(np.linspace(0.1, 0.3, 9))) == 1
    assert len(gaits(np.array([0.2, 0.2, 0.2]))) == 1
    (alone,) = gaits(np.array([0.1]))
    assert math.isnan(alone.spread_mm)


def test_ensembles_are_paired_by_their_seed() -> None:
    """The same seed gives the same starts, whatever the mesh; another seed others; starts differ.

    Catches: a generator that goes on from walk to walk, perturbations drawn per node.
    """

    def starts(elements: int, seed: int) -> np.ndarray:
        made = walk_ensemble(wet(), 5.0, starts=2, seed=seed, duration=0.2, beam_elements=elements)
        return np.array([w.motion.v[0, 0, 3:] for w in made.walks] + [w.foot_path[0, 0] for w in made.walks])

    coarse, fine, other = starts(4, 5), starts(8, 5), starts(4, 6)
    np.testing.assert_allclose(coarse[:2], fine[:2], rtol=1e-12)
    assert np.abs(coarse[0] - coarse[1]).max() > 1e-3
    assert np.abs(coarse[:2] - other[:2]).max() > 1e-3


def test_an_ensemble_tells_means_and_gaits() -> None:
    """Means and spread are over its starts; its summary goes into a file; the listener sees each walk.

    Catches: the spread of strokes for that of starts, a gait that loses members.
    """
    heard: list[int] = []
    made = walk_ensemble(wet(), 4.0, starts=3, duration=1.0, beam_elements=4, listener=lambda k, w: heard.append(k))
    steps = [each.step_mm for each in made.walks]
    assert made.step_mm == pytest.approx(np.mean(steps))
    assert made.step_spread_mm == pytest.approx(np.std(steps, ddof=1))
    assert sorted(k for gait in made.gaits for k in gait.members) == [0, 1, 2] == heard
    summary = made.summary()
    assert summary["starts_1"] == 3
    assert summary["steps_mm"] == steps
    assert summary["notes"] == list(made.walks[0].notes) != []
    json.dumps(summary, allow_nan=False)
    assert all(each.start is made.walks[0].start is not None for each in made.walks)
    with pytest.raises(ModelError, match="starts: found 0"):
        walk_ensemble(wet(), 4.0, starts=0)


def test_walks_side_by_side_are_those_one_after_the_other() -> None:
    """Three threads give the walks of one, in their order, to the last bit, and tell the listener in that order.

    Catches: walks that share what they write to, starts drawn in the order in which threads come by.
    """
    heard: list[int] = []
    alone, beside = (
        walk_ensemble(
            wet(), 4.0, starts=3, duration=0.5, beam_elements=4, threads=threads, listener=lambda k, w: heard.append(k)
        )
        for threads in (1, 3)
    )
    assert heard == [0, 1, 2, 0, 1, 2]
    for one, other in zip(alone.walks, beside.walks, strict=True):
        np.testing.assert_array_equal(one.motion.v, other.motion.v)
        np.testing.assert_array_equal(one.foot_path, other.foot_path)
    with pytest.raises(ModelError, match="threads: found 0"):
        walk_ensemble(wet(), 4.0, starts=2, threads=0)
