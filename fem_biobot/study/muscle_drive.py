"""What drives a design's muscle over time: the waveform sampled, its peak, mean and ripple, and a plot."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fem_biobot.design import Design
from fem_biobot.muscle.waveforms import drive_function
from fem_biobot.study.finding import Finding
from fem_biobot.tables import Table
from fem_biobot.view.tissue import lines

_SAMPLES = 2000  # in a stroke
_LONGEST = 20_000


def drive_finding(design: Design, figures: Path) -> Finding:
    """The drive of a design: its first strokes, and a steady one, sampled as finely as its pulses ask for."""
    drive = drive_function(design.drive)
    d, period = design.drive, 1.0 / design.drive.frequency
    count = _SAMPLES if drive.finest is None else int(np.clip(20 * period / drive.finest, _SAMPLES, _LONGEST))
    # the second of two strokes, or what is steady once the first twitches are over
    before = 1 if d.waveform != "twitch" else max(1, int(np.ceil(0.6 * d.frequency)))
    steps = np.arange(count * (before + 1) + 1)
    times = steps * period / count
    values = np.array([drive(float(t)) for t in times])
    steady = values[count * before :]
    steps_of_ours = design.numerics.step
    numbers = {
        "waveform": d.waveform,
        "frequency_Hz": d.frequency,
        "amplitude_1": d.amplitude,
        "by_frequency_1": drive.size / (d.amplitude * d.exercise) if d.amplitude else 0.0,
        "peak_1": float(values.max()),
        "steady_peak_1": float(steady.max()),
        "steady_trough_1": float(steady.min()),
        "ripple_1": float(np.ptp(steady) / steady.max()) if steady.max() > 0.0 else 0.0,
        "mean_1": float(steady[:-1].mean()),
        "finest_s": drive.finest,
        "step_s": steps_of_ours,
    }
    words = {
        "waveform": "waveform",
        "frequency_Hz": "strokes a second [Hz]",
        "amplitude_1": "amplitude",
        "by_frequency_1": "factor of the frequency",
        "peak_1": "largest drive",
        "steady_peak_1": "largest, second stroke or steady",
        "steady_trough_1": "smallest",
        "ripple_1": "ripple, share of the largest",
        "mean_1": "mean",
        "finest_s": "time that a step must not jump over [s]",
        "step_s": "numerics.step [s]",
    }
    rows = tuple((text, numbers[key]) for key, text in words.items() if numbers[key] is not None)
    file = figures / "drive.png"
    lines(file, {d.waveform: (times, values)}, x="time [s]", y="drive [1]", title=f"{design.name}: drive")
    thin = max(1, len(times) // 4000)
    series = [{"time_s": t, "drive_1": v} for t, v in zip(times[::thin].tolist(), values[::thin].tolist(), strict=True)]
    caption = (file, f"Drive over time, {d.waveform} at {d.frequency:g} Hz; 1 is the whole active tension.")
    return Finding(numbers, [Table("Drive", ("", ""), rows)], {"drive": series}, [caption])
