"""Walks: strokes and their numbers, events, resuming, refusals."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import ModelError, SolveError
from fem_biobot.friction.kernels import SLIP, STICK
from fem_biobot.rod import rest
from fem_biobot.rod import walk as walk_module
from fem_biobot.rod.dynamics.integrate import Integrator, Motion, Settings
from fem_biobot.rod.gait import Walk
from fem_biobot.rod.ground import ContactPoints, Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Body, Muscle, Rigid, Rod
from fem_biobot.rod.reduce import ground_of, reduce
from fem_biobot.rod.rest import floating, placed, stance
from fem_biobot.rod.section import RodMaterial, Section
from fem_biobot.rod.walk import notes_of, walk


@cache
def wet() -> Design:
    """The junction bot under water: light enough for its feet to slip."""
    return load_design("junction_bot").with_values({"ground.immersion": "submerged"})


@cache
def short_walk() -> Walk:
    """Two seconds at 2.5 strokes a second."""
    return walk(wet(), frequency=2.5, duration=2.0, beam_elements=4, discard=2)


def test_steps_and_speed_are_those_of_the_path() -> None:
    """Advance per stroke, its mean after the transient, its spread and the speed follow from positions alone.

    Catches: means over the transient too, strokes of another length, speed by the sine's own frequency.
    """
    walked = short_walk()
    T = 0.4
    at = [int(np.abs(walked.times - k * T).argmin()) for k in range(6)]
    x = walked.motion.centre_of_mass[at, 0]
    assert walked.strokes == 5
    np.testing.assert_allclose(walked.advances, np.diff(x), atol=1e-12)
    assert np.abs(walked.advances).max() > 1e-3
    assert walked.step_mm == pytest.approx((x[5] - x[2]) / 3, abs=1e-12)
    assert walked.speed_mm_per_s == pytest.approx((x[5] - x[2]) / (3 * T), abs=1e-11)
    assert walked.step_spread_mm == pytest.approx(np.std(np.diff(x)[2:], ddof=1), abs=1e-12)


def test_steps_of_one_length_are_noted_where_friction_jumps() -> None:
    """A walk says so, in its summary too; not with adaptive or explicit steps, nor where nothing jumps.

    Catches: a note that every walk has, one that no walk has, reverse coefficients that are not looked at.
    """
    walked = short_walk()
    (note,) = walked.notes
    assert walked.summary()["notes"] == [note]
    assert "1 ms" in note
    assert 'numerics.largest_error = "0.2 nm"' in note
    turned = Ground(0.4, 0.4, reverse_static_friction=0.4, reverse_kinetic_friction=0.3)
    assert len(notes_of(turned, Settings(), 5e-4)) == 1
    assert "0.5 ms" in notes_of(turned, Settings(), 5e-4)[0]
    for ground, settings in (
        (Ground(0.4, 0.4, reverse_static_friction=0.2), Settings()),
        (turned, Settings(largest_error=2e-7)),
        (turned, Settings(integrator=Integrator.explicit)),
    ):
        assert notes_of(ground, settings, 1e-3) == ()


def test_closing_is_measured_along_the_chord_from_the_standing_machine() -> None:
    """Tip closing is the loss of the soles' distance, projected on the line through the span's ends, since it stood.

    Catches: the distance itself, the first sample taken with a sign, heights mixed in.
    """
    walked = short_walk()
    assert walked.start is not None

    def apart(state: RodState) -> float:
        short, long = (state.at((name, (x, 0.0, z))) for name, x, z in
                       (("pillar_short", -5.25, 0.6), ("pillar_long", 5.25, 0.0)))  # fmt: skip
        chord = state.at(("beam", -1)) - state.at(("beam", 0))
        return float((long - short) @ chord / np.linalg.norm(chord))

    i = int(walked.tip_closing.argmax())
    wanted = apart(walked.start.state) - apart(walked.motion.state(i))
    assert walked.tip_closing[i] == pytest.approx(wanted, abs=1e-12)
    assert wanted > 0.1
    assert walked.passive_closing_mm == pytest.approx(10.5 - apart(walked.start.state), abs=1e-9)


def test_sagitta_is_the_middles_distance_from_the_chord() -> None:
    """Sagitta since standing is that of the mid-span node over the line through the ends of the span.

    Catches: the height over the ground, the distance from an end.
    """
    walked = short_walk()
    i = int(walked.sagitta.argmax())

    def rise(state: RodState) -> float:
        a, m, b = (state.points("beam")[k] for k in (0, 2, 4))
        return float(np.linalg.norm(np.cross(m - a, b - a)) / np.linalg.norm(b - a))

    assert walked.start is not None
    wanted = rise(walked.motion.state(i)) - rise(walked.start.state)
    assert walked.sagitta[i] == pytest.approx(wanted, abs=1e-11)
    assert wanted > 0.01


def test_the_camera_sees_a_slow_stroke_and_misses_a_fast_one() -> None:
    """Three frames a stroke catch phases 0, 1/3 and 2/3; a stroke at the frame rate stands still; 6 are the default.

    Catches: a camera at another rate, the stroke's amplitude passed off as the camera's.
    """
    ice = Ground(0.0, 0.0)
    slow = walk(wet(), frequency=0.5, duration=6.0, step=4e-3, beam_elements=4, amplitude=0.3, ground=ice)
    frames, seen = slow.camera()
    np.testing.assert_allclose(np.diff(frames), 1.0 / 6.0)
    np.testing.assert_allclose(seen, np.interp(frames, slow.times, slow.tip_closing))
    assert slow.camera_stroke_mm == pytest.approx(np.ptp(seen))
    # nearly static on ice: the closing follows the drive, of which |sin| at a third of a period is seen
    assert slow.camera_swing(rate=1.5) / slow.stroke_mm == pytest.approx(math.sin(math.pi / 3), rel=0.03)
    assert slow.camera_swing(rate=0.5) < 0.05 * slow.stroke_mm


def test_feet_carry_the_weight_and_tell_stick_from_slip() -> None:
    """Normal forces of the feet have the mean of the weight; a foot slips in samples in which a corner does.

    Catches: forces of one corner, a foot that slips only if all corners do, shares over the transient.
    """
    walked = short_walk()
    inside = walked.times > 0.8 + 1e-9
    assert walked.foot_force[inside, :, 0].sum(axis=1).mean() == pytest.approx(walked.weight_mN, rel=0.02)
    slips = (walked.motion.touch[:, :4] == SLIP).any(axis=1)
    np.testing.assert_array_equal(walked.foot_state[:, 0] == SLIP, slips)
    assert {STICK, SLIP} <= set(walked.foot_state.ravel().tolist())
    assert 0.05 < walked.slip_fraction_1 < 0.95
    anchored = walk(wet(), frequency=2.5, duration=0.8, beam_elements=4, ground=Ground(50.0))
    assert anchored.slip_fraction_1 == 0.0


def test_work_on_the_pillars_is_that_of_the_active_force_in_shortening() -> None:
    """Positive part of the active force times the rate of shortening, integrated over the strokes kept.

    Catches: the standing tension's work, work of lengthening added or taken off, half the muscle.
    """
    walked = short_walk()
    lengths = np.array([walked.motion.state(i).muscle_length("muscle") for i in range(len(walked.times))])
    force = 1.30 * 0.88 * np.abs(np.sin(np.pi * 2.5 * walked.times))
    steps = -np.diff(lengths) * (force[1:] + force[:-1]) / 2
    inside = walked.times[1:] > 0.8 + 1e-9
    wanted = steps[inside].clip(min=0.0).sum() / 3
    assert walked.work_pillar_uJ == pytest.approx(wanted, rel=1e-9)
    assert walked.work_walk_uJ == pytest.approx(0.3 * walked.weight_mN * abs(walked.step_mm))
    assert walked.mechanical_efficiency_1 == pytest.approx(walked.work_walk_uJ / wanted, rel=1e-9)
    assert walked.efficiency_1 == pytest.approx(abs(walked.step_mm) / walked.sagitta_stroke_mm)
    assert walked.muscle_force[-1, 0] == pytest.approx(walked.motion.state(-1).muscle_force("muscle"))


def test_the_weight_of_a_submerged_machine_is_what_its_feet_feel() -> None:
    """Weight less buoyancy.

    Catches: buoyancy left out or added.
    """
    model = reduce(wet())
    volume = (model.bodies[0].volume + model.bodies[1].volume + 7 * 7 * 0.68) * 1e-6 * 9810
    tissue = sum(body.volume for body in model.bodies[2:]) * 1e-6 * 9810
    assert short_walk().weight_mN == pytest.approx(model.mass * 9810 - volume - tissue, rel=1e-9)


def test_the_summary_has_the_agreed_keys_and_goes_into_a_file() -> None:
    """Keys of a walk with units in their names; numbers that are none become null.

    Catches: a key renamed, a NaN that no reader of JSON takes, a NumPy number.
    """
    summary = short_walk().summary()
    agreed = [
        "model",
        "frequency_Hz",
        "speed_mm_per_s",
        "step_mm",
        "step_spread_mm",
        "stroke_mm",
        "slip_fraction_1",
        "work_pillar_uJ",
        "work_walk_uJ",
        "efficiency_1",
        "mechanical_efficiency_1",
        "energy_error_1",
    ]
    assert set(agreed) <= set(summary)
    assert summary["model"] == "rod"
    assert summary["step_mm"] == short_walk().step_mm
    json.dumps(summary, allow_nan=False)
    single = walk(wet(), frequency=2.5, duration=0.4, beam_elements=4).summary()
    assert single["step_spread_mm"] is None
    assert single["step_mm"] is not None


def test_a_walk_goes_on_from_a_checkpoint_bit_for_bit() -> None:
    """Two halves of a walk, joined at a stroke's end, are the whole walk to the last bit.

    Catches: a drive that begins anew, factors or impulses lost at a checkpoint, another division into strokes.
    """
    design = wet()
    model, ground = reduce(design, beam_elements=4), ground_of(design)
    standing = stance(model, ground)
    common: dict[str, Any] = {"ground": ground, "frequency": 3.0, "step": 1e-3}  # a stroke is no whole number of steps
    kept: list[Motion] = []
    whole = walk(model, start=standing, duration=1.5, keeper=kept.append, **common)
    assert len(kept) == 5  # 1.5 s are four strokes and a half
    second = walk(model, start=kept[1].final, rest=standing, duration=1.5 - kept[1].final.time, **common)
    np.testing.assert_array_equal(second.motion.x[-1], whole.motion.x[-1])
    np.testing.assert_array_equal(second.motion.book[-1], whole.motion.book[-1])
    assert second.motion.times[-1] == whole.motion.times[-1]
    assert second.tip_closing[-1] == whole.tip_closing[-1]


def test_listeners_hear_of_times() -> None:
    """The listener is told each sample's time, in order, up to the end.

    Catches: times that begin anew in each stroke.
    """
    heard: list[float] = []
    walk(wet(), frequency=5.0, duration=0.4, beam_elements=4, listener=heard.append)
    assert heard == sorted(heard)
    assert heard[-1] == pytest.approx(0.4)
    assert len(heard) == 200  # every second step of 1 ms: 100 samples a stroke


def test_a_machine_that_falls_ends_its_walk_with_an_event() -> None:
    """Thrown over its short end, it is noticed, said, and nothing after it is kept.

    Catches: a walk through the ground, an exception that loses what was done, events out of order.
    """
    design = wet()
    model, ground = reduce(design, beam_elements=4), ground_of(design)
    state = stance(model, ground).state
    spin = np.array([0.0, -40.0, 0.0])
    v = np.concatenate([np.cross(spin, state.x - state.centre_of_mass), np.tile(spin, (len(state.x), 1))], axis=1)
    thrown = RodState(model, state.x + np.array([0.0, 0.0, 3.0]), state.Q, v)
    walked = walk(model, ground=ground, start=thrown, frequency=2.0, duration=4.0)
    assert walked.ended_early
    assert walked.times[-1] < 2.0
    fall = next(event for event in walked.events if event.name == "overturned")
    assert fall.time == walked.times[-1]
    assert "overturned at" in fall.text
    assert "flight" in [event.name for event in walked.events]
    assert [e.time for e in walked.events] == sorted(e.time for e in walked.events)
    assert not short_walk().ended_early


def test_pillars_that_touch_are_noticed() -> None:
    """The small bot's standing tension swings its soles together.

    Catches: soles' middles compared, an event that is ignored.
    """
    walked = walk(load_design("ring_bot"), duration=0.5, beam_elements=4)
    (touching,) = [e for e in walked.events if e.name != "buried"]
    assert touching.name == "touching"
    gap = np.diff([[walked.motion.state(i).at((f"pillar_{n}", (s * 1.5, 0.0, z)))[0] for n, s, z in
                    (("short", -1, 0.6), ("long", 1, 0.0))] for i in (0, -1)])  # fmt: skip
    first = walked.times.searchsorted(touching.time)
    assert 0 < first < len(walked.times)
    assert gap.min() < 0.5
    assert "touching" not in [e.name for e in short_walk().events]


def test_parts_that_reach_into_the_ground_are_noticed() -> None:
    """The ring round the short pillar hangs lower than its tilted sole by what its corner's place says.

    Catches: the drawing's height in place of the standing one, a ring that is passed over because it has no contact.
    """
    walked = walk(load_design("junction_bot"), duration=0.5, beam_elements=4)
    (buried,) = [e for e in walked.events if e.name == "buried"]
    assert "ring_short" in buried.text
    # the ring's lower outer corner: 0.5 mm out from the pillar's face, 0.75 mm above the drawing's ground
    corner = ("ring_short", (-7.0 - 0.5, 0.0, 0.75))
    deepest = max(-walked.motion.state(i).at(corner)[2] for i in range(len(walked.times)))
    assert f"{deepest:.3g} mm" in buried.text
    high = load_design("junction_bot", ["muscle.ring_offset=0.35 mm"])
    assert "buried" not in [e.name for e in walk(high, duration=0.5, beam_elements=4).events]


def test_slack_muscles_are_noticed() -> None:
    """A contracted machine whose tension goes away all at once has a muscle that is pressed.

    Catches: slackness judged by the tension alone.
    """
    design = wet().with_values({"muscle.passive_tension": 0.0})
    model, ground = reduce(design, beam_elements=4), ground_of(design)
    bent, _ = placed(model, floating(model, drive=1.0), ground)
    walked = walk(model, ground=ground, start=bent, amplitude=0.0, duration=0.02)
    (slack,) = [e for e in walked.events if e.name == "slack"]
    assert slack.time == 0.0


def test_a_walk_that_fails_carries_what_was_walked(monkeypatch: pytest.MonkeyPatch) -> None:
    """The error's best is the `Walk` up to the failure.

    Catches: an empty-handed failure, the last stroke alone.
    """
    real, calls = walk_module.dynamics, []

    def failing(*args: Any, **keywords: Any) -> Motion:
        motion = real(*args, **keywords)
        calls.append(motion)
        if len(calls) == 3:
            raise SolveError("a step fails", best=motion, reason="by arrangement")
        return motion

    design = wet()
    model, ground = reduce(design, beam_elements=4), ground_of(design)
    standing = stance(model, ground)
    monkeypatch.setattr(walk_module, "dynamics", failing)
    with pytest.raises(SolveError, match="walk: a step fails") as error:
        walk(model, ground=ground, start=standing, frequency=4.0, duration=2.0)
    assert isinstance(error.value.best, Walk)
    assert error.value.best.strokes == 3
    assert error.value.exit_code == 3
    assert error.value.reason == "by arrangement"


def simple(*, feet: bool = True, muscle: bool = True) -> RodModel:
    """Two blocks joined by a rod."""
    blocks = [Body.box((s, 0.0, 0.5), (1.0, 1.0, 1.0), 1e-6, n) for s, n in ((-2.0, "a"), (2.0, "b"))]
    rod = Rod(
        np.array([[-2.0, 0.0, 1.0], [0.0, 0.0, 1.0], [2.0, 0.0, 1.0]]),
        Section.circle(0.3),
        RodMaterial(young=100, density=1e-6, poisson=0.4),
    )
    joints = [Rigid(("rod", 0), ("a", (-2.0, 0.0, 1.0))), Rigid(("rod", -1), ("b", (2.0, 0.0, 1.0)))]
    points = [[(s + i, j, 0.0) for i in (-0.5, 0.5) for j in (-0.5, 0.5)] for s in (-2.0, 2.0)]
    contacts = [ContactPoints(n, p) for n, p in zip("ab", points, strict=True)] if feet else []
    members = [Muscle(("a", (-2.0, 0.0, 0.2)), ("b", (2.0, 0.0, 0.2)), 0.1, 10.0, active=1.0)] if muscle else []
    return RodModel([rod], joints, blocks, members=members, contacts=contacts)


@pytest.mark.parametrize(
    ("model", "keywords", "words"),
    [
        (None, {"frequency": -2.0}, "frequency: found -2.0, expected a number above 0 Hz"),
        (None, {"frequency": math.nan}, "frequency: found nan"),
        (None, {"duration": 0.0}, "duration: found 0.0, expected a number above 0 s"),
        (None, {"step": -1e-3}, "step: found -0.001"),
        (None, {"amplitude": -0.1}, "amplitude: found -0.1"),
        (None, {"step": 0.3, "frequency": 4.0}, "step: found 0.3 s, expected at most the drive's period (0.25 s)"),
        (None, {"step": 0.2, "duration": 0.1}, "step: found 0.2 s, expected at most the duration (0.1 s)"),
        (simple(feet=False), {}, "found no contact points, expected feet"),
        (simple(muscle=False), {}, "found no muscle"),
    ],
)
def test_walks_that_make_no_sense_are_refused(model: RodModel | None, keywords: dict[str, float], words: str) -> None:
    """One line that names the argument, exit code 2, before anything is computed.

    Catches: a negative frequency taken for a phase, a step that jumps over strokes, a machine without feet that floats.
    """
    with pytest.raises(ModelError) as error:
        walk(model or wet(), **keywords)  # type: ignore[arg-type]
    assert words in str(error.value)
    assert "\n" not in str(error.value)
    assert error.value.exit_code == 2


def test_a_machine_that_starts_inside_the_ground_is_refused() -> None:
    """A state whose feet are below the plane is no start.

    Catches: a start that the first step throws out of the ground.
    """
    model = simple()
    state = stance(model, Ground()).state
    sunk = replace(state, x=state.x - np.array([0.0, 0.0, 0.01]))
    with pytest.raises(ModelError, match="inside the ground"):
        walk(model, start=sunk, duration=0.1)


def test_a_machine_of_ones_own_walks() -> None:
    """A model with feet and a muscle walks without a design, with the numbers stated in the docstring.

    Catches: a design needed somewhere on the way.
    """
    walked = walk(simple(), duration=1.0)
    assert walked.frequency == 2.0
    assert walked.design is None
    assert walked.anatomy.feet == ("a", "b")
    assert walked.strokes == 2
    assert math.isfinite(walked.step_mm)


def test_a_machine_that_never_comes_to_rest_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a slope just above the angle of friction it slides on, which is no stance; the error has its last state.

    Catches: a settling without end, a stance in motion.
    """
    monkeypatch.setattr(rest, "_LONGEST_SETTLING", 1.0)
    slope = Ground(math.tan(0.2) - 0.01, normal=(math.sin(0.2), 0.0, math.cos(0.2)))
    model = reduce(load_design("junction_bot"), beam_elements=4)
    with pytest.raises(SolveError, match="stance: after 1 s the machine still moves") as error:
        stance(model, slope)
    assert isinstance(error.value.best, RodState)


def test_a_stance_whose_motion_fails_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step that cannot be made while settling is a failure of the stance, with the state put on the ground.

    Catches: an error that speaks of a motion nobody asked for.
    """

    def failing(*args: Any, **keywords: Any) -> Motion:
        raise SolveError("a step fails", reason="by arrangement")

    monkeypatch.setattr(rest, "dynamics", failing)
    with pytest.raises(SolveError, match="stance: a step fails") as error:
        stance(simple(), Ground())
    assert isinstance(error.value.best, RodState)


def test_a_machine_without_feet_cannot_stand() -> None:
    """The message says what is missing.

    Catches: an index error from an empty list of points.
    """
    with pytest.raises(ModelError, match="found no contact points"):
        stance(simple(feet=False), Ground())
