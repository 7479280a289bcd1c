"""Rods that close as far as something else does."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import ModelError
from fem_biobot.link.closing import closing_as, closings
from fem_biobot.rod.records import Muscle
from fem_biobot.rod.reduce import reduce


def test_rods_get_the_tensions_at_which_they_close_as_wanted() -> None:
    """Asked for what they close by at 0.85 of the passive tension and at the whole one, rods get these; active tension
    is what is left to full drive, and nothing else changes. What they do not reach is refused.

    Catches: the active tension scaled as the whole one, a muscle that keeps its own, the nearest end taken instead.
    """
    design = load_design("junction_bot", ["muscle.passive_tension = 0.9 kPa", "muscle.active_tension = 2.7 kPa"])
    model = reduce(design)
    rest, full = design.tension(0.0), design.tension(1.0)
    low, high = closings(design, model, [0.85 * rest, full])
    made, own = closing_as(design, model, (float(low), float(high)))
    np.testing.assert_allclose(own, [0.85 * rest, full], rtol=1e-6)
    for given, found in zip(model.members, made.members, strict=True):
        assert isinstance(given, Muscle)
        assert isinstance(found, Muscle)
        assert found.passive == pytest.approx(0.85 * given.passive, rel=1e-6)
        # (full - 0.85 rest) / (full - rest) with rest = full / 4
        assert found.active == pytest.approx(given.active * (1.0 - 0.85 / 4.0) / 0.75, rel=1e-6)
    assert (made.rods, made.bodies, made.damping_time) == (model.rods, model.bodies, model.damping_time)
    with pytest.raises(ModelError, match="closing: found rods that close by"):
        closing_as(design, model, (float(low), 2.0 * float(high)))


def test_a_stroke_that_is_small_beside_the_standing_tension_is_closed_alike() -> None:
    """With the bot's own 9.09 and 10.39 kPa tensions about rest reach beyond those about full drive; where the two
    coincide one is asked. Rods get back the tensions at which they were asked.

    Catches: tensions asked in no order, one asked twice.
    """
    design = load_design("junction_bot")
    model = reduce(design)
    for active in (1.30, 0.15 * 9.09):  # with the latter 1.15 of rest is full drive, but for rounding
        own = design.with_values({"muscle.active_tension": active})
        rest, full = own.tension(0.0), own.tension(1.0)
        low, high = closings(own, model, [rest, full])
        np.testing.assert_allclose(closing_as(own, model, (float(low), float(high)))[1], [rest, full], rtol=1e-6)


def test_rods_without_stroke_or_of_other_elements_are_refused() -> None:
    """No standing tension, no active one, or a beam of eight elements where sixteen are observed: one line each.

    Catches: a division by nothing, an error of shapes.
    """
    design = load_design("junction_bot")
    model = reduce(design)
    for key in ("muscle.passive_tension", "muscle.active_tension"):
        with pytest.raises(ModelError, match=r"found .* kPa at rest and .* expected both above 0"):
            closing_as(design.with_values({key: 0.0}), model, (0.1, 0.2))
    with pytest.raises(ModelError, match=r"rods: found a beam of 8 elements, expected the 16 between"):
        closing_as(design, reduce(design, beam_elements=8), (0.1, 0.2))
