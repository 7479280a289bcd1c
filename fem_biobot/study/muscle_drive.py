"""What drives a design's muscle over time: the waveform sampled, its peak, mean and ripple, and a plot."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fem_biobot.design import Design
from fem_biobot.muscle.drive import waveform
from fem_biobot.study.finding import Finding
from fem_biobot.study.reporter import Reporter
from fem_biobot.tables import Table
from fem_biobot.view.tissue import lines

_SAMPLES = 400  # in a stroke


def drive_finding(design: Design, figures: Path, reporter: Reporter) -> Finding:
    """The drive of a design over two strokes."""
    d = design.drive
    drive = waveform(d.waveform, d.frequency, d.amplitude)
    times = np.linspace(0.0, 2.0 / d.frequency, 2 * _SAMPLES + 1)
    values = np.array([drive(float(t)) for t in times])
    numbers = {
        "waveform": d.waveform,
        "frequency_Hz": d.frequency,
        "amplitude_1": d.amplitude,
        "peak_1": float(values.max()),
        "trough_1": float(values[_SAMPLES:].min()),
        "mean_1": float(values[:-1].mean()),
    }
    rows: list[tuple[object, ...]] = [(name.rpartition("_")[0] or name, value) for name, value in numbers.items()]
    file = figures / "drive.png"
    lines(file, {d.waveform: (times, values)}, x="time [s]", y="drive [1]", title=f"{design.name}: drive")
    return Finding(
        numbers,
        [Table("Drive", ("", ""), tuple(rows))],
        {"drive": [{"time_s": t, "drive_1": v} for t, v in zip(times.tolist(), values.tolist(), strict=True)]},
        [(file, "Drive over two strokes; 1 is the whole active tension.")],
    )
