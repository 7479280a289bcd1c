"""Gaits told apart by groups of strokes: whole groups, their means, their shares with intervals over the walks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import t as student

from fem_biobot.errors import ModelError
from fem_biobot.rod.groups import group_gaits, stroke_groups
from tests.helpers import unchanged

THREE, LONG = [0.12, 0.1, -0.04], [0.12, 0.11, 0.13, 0.09, -0.05]


def test_groups_end_with_a_stroke_that_fails_and_are_whole() -> None:
    """What comes before the first that fails, and after the last, is no group; nor is what is discarded.

    Catches: a group that begins with the failing stroke, the rest of a group counted, strokes of the transient.
    """
    advances = np.array([0.1, -0.01, *THREE, *LONG, 0.12, 0.1])
    with unchanged(advances):
        found = stroke_groups(advances)
    assert [group.tolist() for group in found] == [THREE, LONG]
    assert [group.tolist() for group in stroke_groups(advances, discard=2)] == [LONG]
    assert [group.tolist() for group in stroke_groups(advances, limit=-0.045)] == []
    assert [len(group) for group in stroke_groups(advances, limit=0.095)] == [3, 4, 1]


def test_gaits_have_means_of_their_strokes_and_shares_of_all() -> None:
    """Two walks: three threes and one long group, then two and two; the most frequent length comes first.

    Catches: means of groups in place of strokes, shares of groups, an interval over strokes that depend on each other.
    """
    walks = [np.array([-0.02, *THREE, *THREE, *THREE, *LONG]), np.array([-0.02, *THREE, *LONG, *THREE, *LONG])]
    first, second = group_gaits(walks)
    assert (first.length, second.length) == (3, None)
    assert (first.groups, second.groups) == (5, 3)
    assert first.advance_mm == pytest.approx(0.06, rel=1e-12)
    assert second.advance_mm == pytest.approx(0.08, rel=1e-12)
    # alike in every walk
    assert first.reach_mm == pytest.approx(0.0, abs=1e-15)
    # 9 of 14 strokes, 6 of 16
    shares = np.array([9 / 14, 6 / 16])
    assert first.share == pytest.approx(shares.mean(), rel=1e-12)
    assert first.share + second.share == pytest.approx(1.0, rel=1e-12)
    half = student.ppf(0.975, 1) * shares.std(ddof=1) / math.sqrt(2)
    assert first.share_interval == (0.0, 1.0) == (max(0.0, shares.mean() - half), min(1.0, shares.mean() + half))


def test_a_share_of_many_walks_has_an_interval_over_the_walks() -> None:
    """Student's, of the walks' own shares; one walk alone says nothing of it.

    Catches: a normal for Student's distribution, the spread in place of the mean's error.
    """
    mixes = [[THREE, THREE, LONG], [THREE, THREE, THREE, LONG], [THREE, THREE, LONG, THREE], [THREE, LONG, THREE]]
    walks = [np.concatenate([[-0.1], *mix]) for mix in mixes]
    low, high = group_gaits(walks)[0].share_interval
    shares = np.array([6 / 11, 9 / 14, 9 / 14, 6 / 11])
    half = student.ppf(0.975, 3) * shares.std(ddof=1) / 2.0
    np.testing.assert_allclose([low, high], [shares.mean() - half, shares.mean() + half], rtol=1e-12)
    alone = group_gaits(walks[:1])[0]
    assert alone.share_interval == (0.0, 1.0)
    assert math.isnan(alone.reach_mm)


def test_the_reach_of_a_mean_is_that_of_a_ratio() -> None:
    """Walks of three strokes each with means 0.06 and 0.09: ``t s / sqrt(2)`` of two values, as for equal weights.

    Catches: the reach of a sum, walks without the gait counted among those that have it.
    """
    walks = [np.array([-0.1, *THREE]), np.array([-0.1, 0.15, 0.16, -0.04]), np.array([-0.1, *LONG])]
    first, _ = group_gaits(walks)
    assert first.advance_mm == pytest.approx(0.075, rel=1e-12)
    assert first.reach_mm == pytest.approx(student.ppf(0.975, 1) * 0.03 / math.sqrt(2) / math.sqrt(2), rel=1e-12)


def test_settled_groups_have_one_of_their_length_on_either_side() -> None:
    """Of five threes between long groups the inner three alone; their median has nothing of one that leaves.

    Catches: groups next to a change counted as settled, the first or last of a walk, a mean for the median.
    """
    inner, leaving = [0.13, 0.1, -0.02], [0.13, 0.1, -0.05]
    walk = np.array([-0.1, *LONG, *THREE, *inner, *inner, *leaving, *THREE, *LONG, *THREE, *THREE])
    first, second = group_gaits([walk])
    assert (first.settled, second.settled) == (3, 0)
    assert first.settled_mm == pytest.approx(0.07, rel=1e-12)
    assert math.isnan(second.settled_mm)


def test_walks_without_failing_strokes_have_no_groups_and_no_walks_are_refused() -> None:
    """Catches: one group made of a whole walk, a mean of nothing."""
    assert group_gaits([np.array([0.1, 0.12, 0.11]), np.array([0.1, -0.1, 0.1])]) == ()
    with pytest.raises(ModelError, match="walks: found none, expected at least one"):
        group_gaits([])
