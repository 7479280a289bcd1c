"""The study of what the solid teaches the rods, at smoke size."""

from __future__ import annotations

import copy

import pytest

from tests.studies.loading import load_study, refuses, smoke_of

pytestmark = pytest.mark.slow


def test_what_is_measured_on_the_solid_changes_the_rods_as_it_must() -> None:
    """The plate and the lifted muscle shorten the stroke, a longer span does not; tables have whole rows.

    Catches: a lesson that is measured and not used, stiffness over length for stiffness.
    """
    module, found = load_study("solid_teaches_rods"), smoke_of("solid_teaches_rods")
    module.expect(found, "smoke")
    names = [row["machine"] for row in found.rows]
    assert names == [
        "solid",
        "rods",
        *(f"rods, {lesson}" for lesson in ("plate", "span", "arm", "feet", "all four", "stroke")),
    ]
    assert all(
        table.rows and all(len(row) == len(table.header) for row in table.rows) for table in module.tables(found)
    )
    # the long foot is slenderer below its bond
    assert found.measured["foot_long_along_mN_per_mm"] < found.measured["foot_short_along_mN_per_mm"]


def test_the_study_refuses_what_no_solid_teaches() -> None:
    """A plate that is none, a span below the drawing's, lessons that close nothing, feet that matter afloat.

    Catches: expectations that hold for anything.
    """
    module = load_study("solid_teaches_rods")
    for what, key, value, word in (
        (None, "plate_1", 0.9, "plate:"),
        (None, "span_mm", 6.0, "span:"),
        ("rods, plate", "closed_floating_stroke_1", 0.0, "plate: closes"),
        ("rods, span", "closed_floating_stroke_1", 0.2, "span: a longer"),
        ("rods, arm", "closed_floating_stroke_1", 0.0, "arm: closes"),
        ("rods, feet", "closed_floating_stroke_1", 0.2, "feet:"),
        ("rods, stroke", "closed_floating_stroke_1", 0.5, "stroke: is not"),
        ("solid", "floating_stroke_mm", 5.0, "closes further"),
    ):
        found = copy.deepcopy(smoke_of("solid_teaches_rods"))
        (found.measured if what is None else found.row(what))[key] = value
        refuses(lambda found=found: module.expect(found, "smoke"), word)
