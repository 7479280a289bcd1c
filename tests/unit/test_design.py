"""The design record: what follows from it, what it refuses and in which words."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import ValidationError

from fem_biobot.config import load_design
from fem_biobot.design import Design, Key, keys, sections, unknown_key
from fem_biobot.design_checks import needed_keys, unused_keys
from fem_biobot.design_parts import Muscle, Skeleton
from fem_biobot.errors import DesignError
from fem_biobot.rod.reduce import reduce


@pytest.fixture(scope="module")
def bot() -> Design:
    return load_design("junction_bot")


@pytest.fixture(scope="module")
def ring() -> Design:
    return load_design("ring_bot")


@pytest.fixture(scope="module")
def strip() -> Design:
    return load_design("strip")


@pytest.fixture(scope="module")
def cantilever() -> Design:
    return load_design("cantilever")


def refusal(design: Design, values: dict[str, Any]) -> str:
    """Message with which changed values are refused; one line by assertion."""
    with pytest.raises(DesignError) as caught:
        design.with_values(values)
    message = str(caught.value)
    assert "\n" not in message
    return message


def test_derived_lengths_of_the_junction_bot(bot: Design) -> None:
    """Span, arm, section and second moment follow from the drawing's numbers.

    Catches: one pillar subtracted instead of two, the ring's height in the arm, width and thickness swapped in I.
    """
    assert bot.span == pytest.approx(14 - 2 * 3.5, rel=1e-15)
    assert bot.bay == pytest.approx(7.0, rel=1e-15)
    assert bot.beam_axis_height == 3.4
    assert bot.moment_arm == pytest.approx(2.0, rel=1e-15)
    assert bot.junction_section == pytest.approx(0.88, rel=1e-15)
    # facts/elastica_walker.csv: two rods of radius 0.5842 mm, 2 pi r^4 / 4 = 0.18296 mm^4, plate rounded to 0.68
    assert bot.second_moment == pytest.approx(0.18296, rel=3e-3)


def test_ring_bot_has_the_printed_sections(ring: Design) -> None:
    """The small machine meets the published second moment and muscle section.

    Catches: one strand counted instead of two, the junction's section used for a ring.
    """
    assert ring.second_moment == pytest.approx(0.04, rel=1e-12)
    assert ring.junction_section == pytest.approx(1.08, rel=1e-12)
    assert ring.moment_arm == pytest.approx(1.4, rel=1e-12)
    assert ring.tension(1.0) * ring.junction_section == pytest.approx(0.83 * 10.39 * 1.08, rel=1e-12)


def test_tension_scales_both_parts_by_gamma(bot: Design) -> None:
    """T = gamma (passive + drive active).

    Catches: gamma on the active part alone, drive on the passive part.
    """
    weaker = bot.with_values({"muscle.gamma": 0.7})
    assert weaker.tension(0.0) == pytest.approx(0.7 * 9.09, rel=1e-15)
    assert weaker.tension(0.4) == pytest.approx(0.7 * (9.09 + 0.4 * 1.30), rel=1e-15)


def test_gamma_may_scale_the_active_part_alone(bot: Design) -> None:
    """T = passive + gamma drive active where the standing tension is that of all tissue; the rods pull with the same.

    Catches: an option that is read and not used, by either model.
    """
    weaker = bot.with_values({"muscle.gamma": 0.7, "muscle.gamma_scales": "active"})
    assert weaker.tension(0.0) == pytest.approx(9.09, rel=1e-15)
    assert weaker.tension(0.4) == pytest.approx(9.09 + 0.7 * 0.4 * 1.30, rel=1e-15)
    rods = reduce(weaker)
    for drive in (0.0, 0.7):
        assert rods.pull(drive).sum() == pytest.approx(weaker.tension(drive) * weaker.junction_section, rel=1e-14)
    oxygen = ["muscle.gamma_scales = active", "muscle.oxygen.tension = section"]
    with pytest.raises(DesignError, match=r'muscle\.gamma_scales: found "active" together with muscle\.oxygen'):
        load_design("junction_bot", oxygen)


def test_pillars_stand_equally_spaced_with_heights_in_line(bot: Design) -> None:
    """Three pillars: ends at the beam's ends, the middle one between in place and height.

    Catches: spacing by the beam's length instead of the pillar centres, heights in the wrong order.
    """
    three = bot.with_values({"skeleton.pillar_count": 3, "skeleton.pillar_length": 2.0})
    assert [x for x, _ in three.pillars] == pytest.approx([-6.0, 0.0, 6.0], rel=1e-12)
    assert [height for _, height in three.pillars] == pytest.approx([2.8, 3.1, 3.4], rel=1e-12)
    assert three.bay == pytest.approx((14 - 3 * 2.0) / 2, rel=1e-12)
    assert bot.pillars == ((-5.25, 2.8), (5.25, 3.4))


def test_landmarks_of_a_bot(bot: Design) -> None:
    """Named points lie where the drawing has them; a fillet moves the corner to the middle of its arc.

    Catches: short and long swapped, the axis taken for the lower face, the arc's middle put at radius from the corner.
    """
    points = bot.landmarks()
    expected = {
        "span_short": (-3.5, 0, 3.4),
        "span_long": (3.5, 0, 3.4),
        "span_mid": (0, 0, 3.4),
        "corner_short": (-3.5, 0, 3.06),
        "corner_long": (3.5, 0, 3.06),
        "edge_short": (-3.5, 3.5, 3.06),
        "edge_long": (3.5, 3.5, 3.06),
        "foot_short_centre": (-5.25, 0, 0.6),
        "foot_long_centre": (5.25, 0, 0),
    }
    assert set(points) == set(expected)
    for name, point in expected.items():
        assert points[name] == pytest.approx(point, abs=1e-14 * 14)
    round_corner = bot.with_values({"skeleton.fillet_radius": 0.5}).landmarks()["corner_long"]
    centre = (3.5 - 0.5, 0.0, 3.06 - 0.5)
    assert math.dist(round_corner, centre) == pytest.approx(0.5, rel=1e-12)
    assert 3.5 - round_corner[0] == pytest.approx(3.06 - round_corner[2], rel=1e-12)
    assert round_corner[0] > centre[0]


def test_landmarks_of_strip_and_cantilever(strip: Design, cantilever: Design) -> None:
    """The strip is centred at its height, the cantilever runs from the origin with its axis at z = 0.

    Catches: the strip starting at x = 0, the beam centred.
    """
    assert strip.landmarks() == {
        "end_minus_centre": (-3.5, 0.0, 0.2),
        "end_plus_centre": (3.5, 0.0, 0.2),
        "mid": (0.0, 0.0, 0.2),
    }
    assert cantilever.landmarks() == {"clamp_centre": (0.0, 0.0, 0.0), "tip_centre": (14.0, 0.0, 0.0)}
    assert (strip.span, cantilever.span) == (7.0, 14.0)
    assert (strip.pillars, cantilever.pillars) == ((), ())


def test_a_missing_part_is_named_when_asked_about(strip: Design, cantilever: Design) -> None:
    """A quantity that the kind of machine lacks is refused, not zero.

    Catches: a moment arm of 0 for a strip.
    """
    with pytest.raises(DesignError, match=r"skeleton: found none .kind strip., expected one for the second moment"):
        _ = strip.second_moment
    with pytest.raises(DesignError, match=r"muscle: found none .kind cantilever., expected one for the tension"):
        cantilever.tension(0.5)


def test_records_cannot_be_changed(bot: Design) -> None:
    """A design and its parts are frozen, and a changed copy leaves the original alone.

    Catches: frozen=True lost, a copy that shares a changed part.
    """
    with pytest.raises(ValidationError, match=r"frozen"):
        bot.name = "other"  # type: ignore[misc]
    assert bot.skeleton is not None
    with pytest.raises(ValidationError, match=r"frozen"):
        bot.skeleton.beam_length = 3.0  # type: ignore[misc]
    longer = bot.with_values({"skeleton.beam_length": 15.0})
    assert longer.value("skeleton.beam_length") == 15.0
    assert bot.value("skeleton.beam_length") == 14.0
    assert len({bot, longer, load_design("junction_bot")}) == 2


RANGES = [
    ("skeleton.beam_length", -14.0, "found -14 mm, expected above 0 mm"),
    ("skeleton.beam_width", 0.0, "found 0 mm, expected above 0 mm"),
    ("skeleton.fillet_radius", -1.0, "found -1 mm, expected 0 mm or more"),
    ("skeleton.beam_thickness", math.nan, "found nan, expected above 0 mm"),
    ("muscle.theta", math.radians(190), "found 190 deg, expected between 0 deg and 180 deg"),
    ("muscle.theta", -0.1, "expected between 0 deg and 180 deg"),
    ("muscle.gamma", 1.1, "found 1.1, expected between 0 and 1"),
    ("muscle.gamma", -0.1, "expected between 0 and 1"),
    (
        "muscle.spread",
        math.radians(55),
        "found 55 deg, expected between 0 deg and 51.5 deg (fibres without preference have 51.96 deg)",
    ),
    ("muscle.passive_tension", -1.0, "found -1 kPa, expected 0 kPa or more"),
    ("muscle.junction_height", math.inf, "found inf, expected a finite value"),
    ("muscle.material.poisson", 0.5, 'found 0.5, expected between 0 and 0.499 with mesh.element "P2", which locks'),
    ("skeleton.material.poisson", 0.4995, 'mesh.element "P2-P1" does not'),
    ("skeleton.material.poisson", -0.1, "found -0.1, expected between 0 and 0.5"),
    ("skeleton.material.poisson", 0.51, "found 0.51, expected between 0 and 0.5"),
    ("skeleton.material.young", 0.0, "found 0 kPa, expected above 0 kPa"),
    ("muscle.material.density", -1e-6, "found -0.001 g/mm^3, expected 0 g/mm^3 or more"),
    ("drive.frequency", 0.0, "found 0 Hz, expected above 0 Hz"),
    ("drive.duration", 0.0, "expected above 0 s"),
    ("drive.amplitude", 2.0, "expected between 0 and 1"),
    ("ground.static_friction", -0.1, "found -0.1, expected 0 or more"),
    ("mesh.size", 0.0, "expected above 0 mm"),
    ("numerics.tolerance", 0.1, "found 0.1, expected between 1e-13 and 0.001"),
    ("numerics.damping_time", -1.0, "expected 0 s or more"),
    ("numerics.linear", "both", "auto"),
    ("skeleton.pillar_count", 1, "found 1, expected between 2 and 100"),
    ("skeleton.pillar_count", 10**400, "found a huge whole number, expected between 2 and 100"),
    ("name", "two\nlines", 'found "two\\nlines", expected printable text'),
    ("name", " ", "expected printable text"),
    ("description", "x" * 300, "expected printable text on one line, up to 200 characters"),
]


@pytest.mark.parametrize(("key", "value", "words"), RANGES)
def test_values_outside_their_range_are_refused(bot: Design, key: str, value: object, words: str) -> None:
    """Each range is kept, and the message has the full key, the finding and the expectation.

    Catches: an open end closed or the reverse, a range not applied to a nested key.
    """
    message = refusal(bot, {key: value})
    assert message.startswith(f"{key}: found ")
    assert words in message


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("muscle.theta", 0.0),
        ("muscle.theta", math.pi),
        ("muscle.gamma", 0.0),
        ("muscle.gamma", 1.0),
        ("muscle.material.poisson", 0.0),
        ("muscle.material.poisson", 0.499),
        ("muscle.passive_tension", 1e4),
        ("muscle.active_tension", 0.0),
        ("skeleton.long_pillar_height", 2.8),
        ("skeleton.fillet_radius", 1.0),
        ("ground.static_friction", 0.3),
        ("numerics.damping_time", 0.0),
        ("numerics.linear", "iterative"),
        ("drive.amplitude", 0.0),
        ("muscle.reference", "remodelled"),
    ],
)
def test_values_at_the_edge_of_their_range_are_accepted(bot: Design, key: str, value: object) -> None:
    """The ends that belong to a range, equal pillars included, make a design.

    Catches: a check that is stricter than its message.
    """
    assert bot.with_values({key: value}).value(key) == value


CHOICES = [
    ("muscle.convention", "kirchhof", "nominal, second_piola, kirchhoff, cauchy, active_strain"),
    ("muscle.force_length", "hill", "none, blemker_2005, gordon_1966"),
    ("muscle.spread_kind", "woven", "planar, planar_von_mises, solid"),
    (
        "muscle.material.law",
        "ogden",
        "neo_hooke, neo_hooke_isochoric, mooney_rivlin, yeoh, gent, guccione, holzapfel_ogden, blemker",
    ),
    ("muscle.reference", "grown", "as_moulded, remodelled"),
    ("muscle.layout", "loop", "junction, ring"),
    ("drive.waveform", "sine", "abs_sine, constant, pulse, rc_biphasic, twitch"),
    ("ground.immersion", "water", "air, submerged"),
    ("mesh.element", "P1", "P2, P2-P1"),
    ("kind", "robot", "bot, strip, cantilever, walker"),
]


@pytest.mark.parametrize(("key", "value", "known"), CHOICES)
def test_unknown_choices_list_what_exists(bot: Design, key: str, value: str, known: str) -> None:
    """A law, convention or the like that does not exist is refused with those that do.

    Catches: a free text accepted, a list that drifts from the type.
    """
    assert refusal(bot, {key: value}) == f'{key}: found "{value}", expected one of: {known}'


# Each clash with the two keys that a person could change.
CLASHES: list[tuple[dict[str, Any], tuple[str, ...]]] = [
    ({"muscle.junction_height": 3.0}, ("muscle.junction_height: found 3 mm", "junction's top", "touches the beam")),
    # 3.06 - 0.2 exactly: only rounding between the junction and the beam
    ({"muscle.junction_height": 2.86, "muscle.ring_offset": -0.35}, ("junction's top", "skeleton.beam_thickness")),
    ({"muscle.junction_height": 2.65}, ("ring's top", "muscle.ring_height 1.1 mm", "touches the beam")),
    ({"skeleton.fillet_radius": 1.4}, ("muscle.junction_height", "touches the fillet (skeleton.fillet_radius)")),
    ({"muscle.junction_height": 1.2}, ("ring's bottom at z = 0.55 mm", "skeleton.short_pillar_height")),
    ({"muscle.junction_height": 0.7, "muscle.ring_offset": 0.3}, ("junction's bottom", "sole of the short pillar")),
    ({"muscle.junction_width": 7.5}, ("muscle.junction_width: found 7.5 mm", "skeleton.pillar_width (7 mm)")),
    ({"muscle.ring_thickness": 3.5}, ("muscle.ring_thickness: found 3.5 mm", "half the distance between pillars")),
    ({"muscle.junction_thickness": 1.15}, ("muscle.junction_thickness", "muscle.ring_height (1.1 mm)")),
    ({"muscle.ring_offset": 0.4}, ("muscle.ring_offset: found 0.4 mm", "-0.35 mm and 0.35 mm", "ends within the ring")),
    ({"skeleton.pillar_length": 7.0}, ("skeleton.pillar_length: found 7 mm", "2 pillars overlap", "beam_length 14 mm")),
    ({"skeleton.pillar_count": 4}, ("4 pillars overlap",)),
    ({"skeleton.pillar_width": 7.5}, ("skeleton.pillar_width: found 7.5 mm", "skeleton.beam_width (7 mm)")),
    ({"skeleton.short_pillar_height": 3.5}, ("skeleton.short_pillar_height", "skeleton.long_pillar_height (3.4 mm)")),
    ({"skeleton.short_pillar_height": 0.34}, ("skeleton.short_pillar_height", "half of skeleton.beam_thickness")),
    ({"skeleton.fillet_radius": 2.5}, ("skeleton.fillet_radius: found 2.5 mm, expected less than 2.46 mm",)),
    ({"ground.kinetic_friction": 0.5}, ("ground.kinetic_friction: found 0.5", "ground.static_friction (0.42)")),
    ({"numerics.step": 6.0}, ("numerics.step: found 6 s", "drive.duration (5 s)")),
    (
        {"numerics.linear": "iterative", "mesh.element": "P2-P1"},
        ("numerics.linear", "without pressures"),
    ),
]


@pytest.mark.parametrize(("values", "words"), CLASHES)
def test_parts_in_each_others_way_are_refused(bot: Design, values: dict[str, Any], words: tuple[str, ...]) -> None:
    """Parts that touch, overlap or stick out are refused with the keys on both sides.

    Catches: a clash judged by mid-planes, the fillet left out of the clearance, a limit of the wrong part.
    """
    message = refusal(bot, values)
    assert ", expected " in message
    for word in words:
        assert word in message


@pytest.mark.parametrize(
    ("preset", "values", "message"),
    [
        (
            "ring_bot",
            {"muscle.junction_width": 1.0},
            'found 1 mm, expected no such key for kind "bot" with muscle.layout',
        ),
        ("ring_bot", {"skeleton.pillar_count": 3}, "skeleton.pillar_count: found 3, expected no such key"),
        ("ring_bot", {"muscle.ring_height": 0.0}, "muscle.ring_height: found 0 mm, expected above 0 mm"),
        (
            "junction_bot",
            {"muscle.junction_length": 7.0},
            "muscle.junction_length: found 7 mm, expected no such key for",
        ),
        ("junction_bot", {"load.tip_force": 1.0}, 'load: found a section, expected none for kind "bot"'),
        ("junction_bot", {"skeleton": None}, "skeleton: found a single value, expected one of its keys"),
        ("strip", {"muscle.ring_height": 1.0}, 'muscle.ring_height: found 1 mm, expected no such key for kind "strip"'),
        ("strip", {"muscle.layout": "ring"}, 'muscle.layout: found ring, expected junction for kind "strip"'),
        ("strip", {"kind": "bot"}, 'skeleton: missing, expected the section [skeleton] for kind "bot"'),
        ("cantilever", {"skeleton.pillar_length": 1.0}, "skeleton.pillar_length: found 1 mm, expected no such key"),
        ("cantilever", {"kind": "strip"}, 'skeleton: found a section, expected none for kind "strip"'),
    ],
)
def test_keys_of_parts_that_a_machine_lacks_are_refused(preset: str, values: dict[str, Any], message: str) -> None:
    """A key without meaning for the kind of machine is refused rather than ignored, and a needed one asked for.

    Catches: a ring's junction width silently dropped.
    """
    assert message in refusal(load_design(preset), values)


def test_python_callers_get_the_same_messages(bot: Design) -> None:
    """Names and types wrong in Python give the package's own one-line error too.

    Catches: pydantic's many-line error reaching a user.
    """
    data = bot.model_dump()
    with pytest.raises(DesignError, match=r"^muscle.thetta: unknown key; did you mean muscle.theta\?$"):
        Design.model_validate({**data, "muscle": {**data["muscle"], "thetta": 1.0}})
    with pytest.raises(DesignError, match=r'^muscle.theta: found "90 deg", expected an angle with its unit'):
        Design.model_validate({**data, "muscle": {**data["muscle"], "theta": "90 deg"}})
    with pytest.raises(DesignError, match=r"^mesh: missing, expected a section$"):
        Design.model_validate({k: v for k, v in data.items() if k != "mesh"})
    with pytest.raises(DesignError, match=r"^muscle.ring_height: missing, expected a length with its unit"):
        Design.model_validate({**data, "muscle": {k: v for k, v in data["muscle"].items() if k != "ring_height"}})
    with pytest.raises(DesignError, match=r"^skeleton.pillar_count: found 2.5, expected a whole number$"):
        bot.with_values({"skeleton.pillar_count": 2.5})
    with pytest.raises(DesignError, match=r"^name: found 3, expected a text$"):
        bot.with_values({"name": 3})


@pytest.mark.parametrize(
    ("name", "nearest"),
    [
        ("skeleton.beam_lenght", "skeleton.beam_length"),
        ("skeletn.beam_length", "skeleton.beam_length"),
        ("beam_length", "skeleton.beam_length"),
        ("skeleton.young", "skeleton.material.young"),
        ("muscle.poisson", "muscle.material.poisson"),
        ("muscle.active_tention", "muscle.active_tension"),
        ("skelton", "skeleton"),
    ],
)
def test_unknown_keys_are_answered_with_the_nearest(name: str, nearest: str) -> None:
    """A misspelt key, section or a key in the wrong section finds the one that was meant.

    Catches: the other section's key of the same name proposed.
    """
    assert unknown_key(name) == f"{name}: unknown key; did you mean {nearest}?"


def test_keys_that_resemble_nothing_list_what_the_section_has() -> None:
    """No far-fetched proposal; the names of the section instead, on one line.

    Catches: a suggestion at any distance, a raw line break from a quoted TOML key.
    """
    message = unknown_key("mesh.qqqqq")
    assert message == "mesh.qqqqq: unknown key, expected one of: size, grading, element"
    assert "skeleton.material" in unknown_key("foo.bar")
    assert "\n" not in unknown_key("mesh.a\nb")


def test_every_key_tells_its_meaning_and_unit() -> None:
    """Each key has a line of description, and a quantity's line ends with its coherent unit.

    Catches: a field added without a description or with the wrong unit.
    """
    assert {"skeleton", "skeleton.material", "muscle", "muscle.material", "drive", "load"} <= set(sections())
    for name, key in keys().items():
        description = key.field.description
        assert description, name
        if key.quantity is not None:
            assert description.endswith(f"[{key.quantity.unit}]"), name
        elif key.field.annotation is float:
            pytest.fail(f"{name} has no dimension")
    assert isinstance(keys()["muscle.theta"], Key)


def test_needed_and_unused_keys_exist_and_are_apart(bot: Design, ring: Design, strip: Design) -> None:
    """The lists of parts by kind name real keys, and no key is both needed and unused.

    Catches: a key renamed in the record but not in the lists.
    """
    for design in (bot, ring, strip):
        needed, unused = set(needed_keys(design)), unused_keys(design)
        assert not needed & unused
        assert needed | unused <= set(keys())
    assert set(Skeleton.model_fields) | set(Muscle.model_fields) >= {
        name.rpartition(".")[2] for name in unused_keys(bot) | unused_keys(strip)
    }
