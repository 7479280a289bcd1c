"""What a camera and Eq. 3 report, of a made-up machine whose motion is in proportion to its tension."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.cli import main
from fem_biobot.config import load_design
from fem_biobot.errors import ModelError
from fem_biobot.link.camera import Camera, Filmed, filmed
from fem_biobot.link.observed import Observed, drawn_points
from fem_biobot.solid.measures import eq3_stiffness

DESIGN = load_design("junction_bot")
CLOSING, SAGITTA, FORCE = 0.36, 0.08, 0.41  # per kPa: mm, mm, mN


def _state(tension: float) -> Observed:
    """Soles that approach and a middle that rises by their shares, the chord in place."""
    drawn = drawn_points(DESIGN).level()
    rise = SAGITTA * tension * (1.0 - np.linspace(-1.0, 1.0, len(drawn.axis)) ** 2)[:, None] * np.array([0.0, 0.0, 1.0])
    nearer = 0.5 * CLOSING * tension * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    points = replace(drawn, lower=drawn.lower + rise, upper=drawn.upper + rise, soles=drawn.soles + nearer)
    return Observed(tension, {"muscle_force_mN": FORCE * tension}, points, np.zeros(16))


STATES = [_state(T) for T in (3.0, 6.0, 9.09, 10.39)]


def _by_name(camera: Camera) -> dict[str, Filmed]:
    return {film.quantity: film for film in filmed(DESIGN, STATES, camera)}


def test_a_fast_camera_without_noise_sees_the_truth() -> None:
    """Stroke, and what Eq. 3 makes of the sagitta; the true forces are the muscle's.

    At 2000 frames a second a sine of 2 Hz is missed by (pi f / rate)^2 / 2 < 1e-5 at its top, and by pi f / rate at
    its foot, 3e-3 of the stroke.

    Catches: closing in frames of another machine, a force that is not of the sagitta, truth and film exchanged.
    """
    found, k = _by_name(Camera(rate=2000.0)), eq3_stiffness(DESIGN)
    assert found["stroke_mm"].true == pytest.approx(1.30 * CLOSING, rel=1e-4)
    assert found["stroke_mm"].mean == pytest.approx(1.30 * CLOSING, rel=4e-3)
    assert found["passive_force_mN"].true == pytest.approx(9.09 * FORCE, rel=1e-9)
    assert found["passive_force_mN"].mean == pytest.approx(9.09 * SAGITTA * k, rel=1e-9)
    assert found["stroke_force_mN"].true == pytest.approx(1.30 * FORCE, rel=1e-4)
    assert found["stroke_force_mN"].ratio == pytest.approx(SAGITTA * k / FORCE, rel=4e-3)


def test_six_frames_a_second_see_a_part_of_a_stroke_at_two_hertz() -> None:
    """Three instants of each stroke, the same ones again and again: the mean range over where they fall, by hand.

    200 films tell a mean to 0.01 of the stroke.

    Catches: frames that begin with the stroke always, a rate for a period.
    """
    first = np.linspace(0.0, 0.5, 10_000, endpoint=False)
    drive = np.abs(np.sin(2.0 * np.pi * (first[:, None] + np.arange(3) / 6.0)))
    share = float(np.ptp(drive, axis=1).mean())
    found = _by_name(Camera())["stroke_mm"]
    assert share < 0.85
    assert found.mean / (1.30 * CLOSING) == pytest.approx(share, abs=0.02)


def test_noise_of_points_is_that_of_the_force() -> None:
    """One frame: the middle's own noise and half of each end's, root of 1.5, times pixel, noise and Eq. 3's stiffness.

    200 films tell a deviation to 5 %, three times that allowed.

    Catches: noise in pixels for millimetres, noise on the middle alone.
    """
    found = _by_name(Camera(pixel=0.02, noise=0.5, seed=5))["passive_force_mN"]
    assert found.deviation == pytest.approx(eq3_stiffness(DESIGN) * 0.01 * np.sqrt(1.5), rel=0.15)
    assert _by_name(Camera(pixel=0.02, noise=0.5, seed=5))["passive_force_mN"] == found
    assert _by_name(Camera(pixel=0.02, noise=0.5, seed=6))["passive_force_mN"] != found


def test_cameras_that_are_none_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Negative numbers, states that end below the drive's tension, noise without a pixel, a pixel without its unit.

    Catches: motion beyond the last state made up.
    """
    for name, value in (("rate", 0.0), ("pixel", -0.1), ("noise", float("nan"))):
        with pytest.raises(ModelError, match=name):
            replace(Camera(), **{name: value})
    with pytest.raises(ModelError, match=r"found states up to 9\.09 kPa"):
        filmed(DESIGN, STATES[:3], Camera())
    for options, word in ((["--noise", "0.5"], "without --pixel"), (["--pixel", "0.02"], "--pixel: found")):
        assert main(["crosscheck", "junction_bot", "--out", str(tmp_path / "no"), *options]) == 2
        told = capsys.readouterr().err.strip().splitlines()
        assert len(told) == 1
        assert word in told[0]
