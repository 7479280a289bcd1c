"""Waveforms of the drive: what each is over time, the measured twitch, and what is refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design_parts import Drive
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.muscle.twitch import DRENNAN_TWITCH, TWITCH, TWITCH_PEAK, Twitch, fit_twitch, potentiation
from fem_biobot.muscle.waveforms import DriveFunction, drive_function, drive_named
from fem_biobot.rod.walk import walk
from tests.command import call


def drive(**keys: object) -> DriveFunction:
    """A drive of these keys."""
    return drive_function(Drive.model_validate(keys))


def test_the_sine_has_f_strokes_a_second() -> None:
    """``|sin(pi f t)|`` peaks at half a period 1 / f and vanishes at its ends; a constant is its amplitude.

    Catches: |sin(2 pi f t)|, which has twice the strokes; an amplitude of one.
    """
    sine = drive(frequency=2.5, amplitude=0.7)
    assert sine(0.2) == pytest.approx(0.7)
    assert sine(0.4) == pytest.approx(0.0, abs=1e-12)
    assert sine(0.1) == pytest.approx(0.7 * math.sqrt(0.5))
    assert drive(waveform="constant", amplitude=0.7)(0.4) == 0.7
    assert drive_named("constant").waveform == "constant"
    with pytest.raises(DesignError, match=r"drive\.waveform: found 'square', expected one of: abs_sine, constant, p"):
        drive_named("square")


def test_pulses_act_for_their_width_and_come_in_bursts() -> None:
    """Three pulses of 8 ms at 25 Hz, twice a second, seen at steps of 1 ms: 24 of 500 are on, those that should be.

    Catches: a pulse that is a step too long by rounding, bursts that go on into the next stroke, a burst's first alone.
    """
    train = drive(waveform="pulse", frequency=2.0, amplitude=0.6, pulse_width=8e-3, pulses=3, pulse_rate=25.0)
    times = 1e-3 * np.arange(1000)
    on = np.array([train(float(t)) for t in times]) > 0.0
    expected = [s + p + k for s in (0, 500) for p in (0, 40, 80) for k in range(8)]
    assert np.flatnonzero(on).tolist() == expected
    assert train(0.5) == 0.6


def test_two_phases_decay_through_the_electrode() -> None:
    """A phase decays as exp(-t / RC), the opposite one begins anew and ends the stimulus; their mean is the integral.

    Catches: one phase only, a decay that goes through both, a tail after the second.
    """
    width, time, rate = 0.01, 4e-3, 2.0
    pair = drive(waveform="rc_biphasic", frequency=rate, pulse_width=width, rc_time=time)
    assert pair(3e-3) == pytest.approx(math.exp(-0.75))
    assert pair(0.5 + width + 3e-3) == pytest.approx(math.exp(-0.75))
    assert pair(width) == pytest.approx(1.0)
    assert pair(2.0 * width) == 0.0
    middles = (np.arange(50_000) + 0.5) * 1e-5
    mean = np.mean([pair(float(t)) for t in middles])
    assert mean == pytest.approx(2.0 * rate * time * (1.0 - math.exp(-width / time)), rel=1e-4)


def test_the_twitch_is_the_fit_to_single_twitches() -> None:
    """The package's numbers are what the fit to the measured single twitches gives, which leaves 1.4 um of 50.

    Catches: numbers that belong to other data, a fit to the trains.
    """
    found = fit_twitch()
    assert (found.twitch.order, found.twitch.time) == pytest.approx((TWITCH.order, TWITCH.time), rel=2e-3)
    assert found.peak == pytest.approx(TWITCH_PEAK, rel=1e-3)
    assert found.residual < 1.5
    assert np.all((found.delays > 0.0) & (found.delays <= 0.05))
    # a sum over frames is the area whatever their phase
    frames = 0.05 * np.sum([np.mean(seen) for seen in DRENNAN_TWITCH.values()])
    assert TWITCH.area * TWITCH_PEAK == pytest.approx(frames, rel=0.06)


def test_a_train_is_the_sum_of_its_twitches() -> None:
    """The kernel peaks at one, its area is its integral; a steady train has rate times area as mean, and the drive of
    the design tends to it.

    Catches: a kernel of another height, stimuli forgotten too soon, the first stimulus left out.
    """
    t = np.linspace(0.0, 1.0, 200_001)
    assert TWITCH(TWITCH.peak_time) == pytest.approx(1.0)
    assert TWITCH(t).max() == pytest.approx(1.0)
    assert TWITCH(np.array([-0.1, 0.0])) == pytest.approx(0.0)
    assert TWITCH.area == pytest.approx(np.trapezoid(TWITCH(t), t), rel=1e-6)
    train = TWITCH.train(12.0, (np.arange(500) + 0.5) / 500 / 12.0)
    assert train.mean() == pytest.approx(12.0 * TWITCH.area, rel=1e-6)
    ours = drive(waveform="twitch", frequency=12.0, amplitude=0.8)
    late = 2.0 + np.array([0.0, 0.013, 0.031, 0.08])
    assert [ours(float(s)) for s in late] == pytest.approx(0.8 * TWITCH.train(12.0, late), rel=1e-4)
    assert ours(0.03) == pytest.approx(0.8 * TWITCH(0.03))
    double = drive(waveform="twitch", frequency=1.0, pulses=2, pulse_rate=10.0)
    assert double(0.15) == pytest.approx(TWITCH(0.15) + TWITCH(0.05))
    for bad in ((0.0, 0.02), (3.0, -1.0)):
        with pytest.raises(ModelError, match=r"twitch: (order|time): found"):
            Twitch(*bad)
    with pytest.raises(ModelError, match="twitch: rate: found 0 Hz"):
        TWITCH.train(0.0, 0.1)


def test_frequency_exercise_and_fatigue_scale_the_drive() -> None:
    """Factors are one at 2 Hz and as published elsewhere; exercise multiplies; fatigue falls to its rest.

    Catches: a factor over another frequency, fatigue that begins low, factors that are on by default.
    """
    assert drive(frequency=7.0, waveform="constant").size == 1.0
    paper = drive(frequency=0.5, waveform="constant", amplitude_by="paper_2018", amplitude=0.8)
    assert paper(0.3) == pytest.approx(0.8 * 0.5 / 1.4)
    rings = drive(frequency=1.0, waveform="constant", amplitude_by="drennan_2025")
    assert rings(0.3) == pytest.approx(48.7 / 53.7)
    assert potentiation(20.0) == pytest.approx(60.0 / 53.7)
    assert potentiation(1.5) == pytest.approx((48.7 + 53.7) / 2 / 53.7)
    with pytest.raises(ModelError, match="frequency: found 0 Hz"):
        potentiation(0.0)
    tired = drive(waveform="constant", exercise=1.5, fatigue_time=20.0, fatigue_rest=0.4)
    assert tired(0.0) == pytest.approx(1.5)
    assert tired(20.0) == pytest.approx(1.5 * (0.4 + 0.6 / math.e))
    assert tired(1e4) == pytest.approx(0.6)
    for native, left in (("mouse_fast_2009", 0.08), ("mouse_slow_2009", 0.41)):
        assert drive(waveform="constant", fatigue=native)(95.0) == pytest.approx(left)
    for training, gain in (("none", 1.0), ("ito_2014", 4.5), ("kim_2019", 1.31)):
        assert drive(waveform="constant", training=training, exercise=1.2)(0.1) == pytest.approx(1.2 * gain)


def test_steps_that_jump_over_pulses_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A step longer than a pulse, than the electrode's time or than a quarter of a twitch's rise, in `walk` and before
    the command writes anything; the drive by another name goes to the rods too.

    Catches: pulses between two steps that drive nothing, in silence.
    """
    short = drive(waveform="pulse", pulse_width=5e-4)
    short.check_step(5e-4)
    with pytest.raises(DesignError, match=r"numerics\.step: found 0\.001 s, expected at most drive\.pulse_width"):
        short.check_step(1e-3)
    with pytest.raises(DesignError, match=r"at most drive\.rc_time \(0\.0002 s\)"):
        drive(waveform="rc_biphasic", pulse_width=5e-4, rc_time=2e-4).check_step(3e-4)
    with pytest.raises(DesignError, match="a quarter of the rise of a twitch"):
        drive(waveform="twitch").check_step(0.02)
    design = load_design("junction_bot", ["drive.waveform=pulse", "drive.pulse_width=0.5 ms"])
    with pytest.raises(DesignError, match=r"numerics\.step"):
        walk(design)
    with pytest.raises(DesignError, match=r"drive\.waveform: found 'square'"):
        walk(load_design("junction_bot"), waveform="square")
    said = call(capsys, "walk", "junction_bot", "--set", "drive.waveform=pulse", "--set", "drive.pulse_width=0.5 ms",
                "--out", tmp_path / "w")  # fmt: skip
    assert (said.code, "numerics.step" in said.complaint, (tmp_path / "w").exists()) == (2, True, False)
    said = call(capsys, "run", "junction_bot", "--set", "drive.waveform=pulse", "--set", "drive.pulse_width=300 ms",
                "--out", tmp_path / "w")  # fmt: skip
    assert (said.code, "period of 4 Hz" in said.complaint, (tmp_path / "w").exists()) == (2, True, False)
    wide = call(capsys, "walk", "junction_bot", "--set", "drive.waveform=pulse", "--set", "drive.pulse_width=100 ms",
                "--frequency", "20Hz", "--out", tmp_path / "w")  # fmt: skip
    assert (wide.code, "period of 20 Hz" in wide.complaint) == (2, True)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (("drive.waveform=pulse",), r"drive\.pulse_width: missing"),
        (("drive.waveform=rc_biphasic", "drive.pulse_width=5 ms"), r"drive\.rc_time: missing"),
        (("drive.pulse_width=5 ms",), r"drive\.pulse_width: found 0\.005 s with drive\.waveform \"abs_sine\""),
        (("drive.waveform=pulse", "drive.pulse_width=5"), r"drive\.pulse_width: found \"5\" \(no unit\)"),
        (("drive.waveform=twitch", "drive.pulses=3"), r"drive\.pulse_rate: missing"),
        (("drive.waveform=twitch", "drive.pulse_rate=9 Hz"), r"drive\.pulse_rate: found without drive\.pulses"),
        (("drive.waveform=twitch", "drive.pulses=0"), r"drive\.pulses: found 0, expected between 1 and"),
        (("drive.pulses=3",), r"drive\.pulses: found 3 with drive\.waveform \"abs_sine\", expected 1"),
        (("drive.fatigue_rest=0.3",), r"drive\.fatigue_rest: found 0\.3 without drive\.fatigue_time"),
        (
            ("drive.fatigue=mouse_fast_2009", "drive.fatigue_time=20 s"),
            r'drive\.fatigue_time: found 20 s with drive\.fatigue "mouse_fast_2009"',
        ),
        (("drive.exercise=0",), r"drive\.exercise: found 0, expected above 0"),
    ],
)
def test_drives_that_say_too_little_or_too_much_are_refused(settings: tuple[str, ...], words: str) -> None:
    """Each by its key, when the design is made.

    Catches: a parameter that is ignored in silence.
    """
    with pytest.raises(DesignError, match=words):
        load_design("junction_bot", settings)


def test_pulses_that_do_not_fit_are_refused_by_the_drive() -> None:
    """Pulses longer than their period, overlapping within a burst, a burst longer than its stroke, and a description
    that was never part of a design.

    Catches: pulses that merge into a constant.
    """
    with pytest.raises(DesignError, match=r"drive\.pulse_width: found 0\.6 s, which takes 0\.6 s"):
        drive(waveform="pulse", pulse_width=0.6)
    with pytest.raises(DesignError, match=r"drive\.pulse_width: .* overlap"):
        drive(waveform="rc_biphasic", pulse_width=0.03, rc_time=1.0, pulses=2, pulse_rate=20.0)
    with pytest.raises(DesignError, match=r"drive\.pulses: found 12"):
        drive(waveform="pulse", pulse_width=0.01, pulses=12, pulse_rate=20.0)
    with pytest.raises(DesignError, match=r"drive\.rc_time: missing"):
        drive(waveform="rc_biphasic", pulse_width=0.03)


def test_the_command_shows_fusion(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """At 20 Hz twitches fuse: the steady mean is rate times area, with little ripple; at 2 Hz they stand apart.

    Catches: a command that shows the first stroke for the steady one.
    """
    found = {}
    for rate in (2, 20):
        said = call(capsys, "muscle", "drive", "junction_bot", "--set", "drive.waveform=twitch", "--set",
                    f"drive.frequency={rate} Hz", "--out", tmp_path / f"{rate}", "--json")  # fmt: skip
        assert said.code == 0
        found[rate] = json.loads(said.out)["drive"]
        assert found[rate]["mean_1"] == pytest.approx(rate * TWITCH.area, rel=1e-3)
    assert found[2]["ripple_1"] == pytest.approx(1.0)
    assert found[20]["ripple_1"] < 0.1
