"""What a camera and Eq. 3 would report of a machine that is stimulated, beside what is true of it.

The machine follows its drive from equilibrium to equilibrium; a camera of few frames a second sees five points of it,
each off by its own noise: the ends and the middle of the beam's span, and the soles. Closing and sagitta are read from
those as from the models, forces by Eq. 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.observed import Array, Observed, drawn_points
from fem_biobot.muscle.waveforms import drive_function
from fem_biobot.solid.measures import eq3_stiffness

RATE = 6.0  # frames a second, the paper's
_TAKES = 200  # films of the same machine, each with another first instant and other noise


@dataclass(frozen=True)
class Camera:
    """A camera from the side.

    Attributes
    ----------
    rate
        Frames a second [1/s].
    pixel
        Size of a pixel in the machine's plane [mm].
    noise
        Deviation of a point's place from where it is [pixels].
    seed
        Of the noise and of the first instants.
    """

    rate: float = RATE
    pixel: float = 0.0
    noise: float = 0.0
    seed: int = 7

    def __post_init__(self) -> None:
        for name, value, low in (("rate", self.rate, 1e-300), ("pixel", self.pixel, 0.0), ("noise", self.noise, 0.0)):
            if not (np.isfinite(value) and value >= low):
                limit = "above 0" if name == "rate" else "of at least 0"
                raise ModelError(f"camera, {name}: found {value:g}, expected a finite number {limit}")


@dataclass(frozen=True)
class Filmed:
    """One quantity as it is, and as films of the machine say: their mean and the deviation of one film."""

    quantity: str
    true: float
    mean: float
    deviation: float

    @property
    def ratio(self) -> float:
        """Mean of the films over the truth [1]."""
        return self.mean / self.true


def filmed(design: Design, states: Sequence[Observed], camera: Camera) -> list[Filmed]:
    """Stroke, passive force and force of the stroke, as they are and as films of a model say.

    Parameters
    ----------
    design
        The machine; its drive is followed for its duration.
    states
        Of one model by rising tension, up to the largest of the drive.
    camera
        What films it.

    Returns
    -------
    list
        ``stroke_mm`` (largest less smallest closing), ``passive_force_mN`` (Eq. 3 from the sagitta of one frame
        without drive), ``stroke_force_mN`` (Eq. 3 from the largest less the smallest sagitta).

    Raises
    ------
    ModelError
        States that do not reach the drive's largest tension.

    Notes
    -----
    Noise makes the largest of many frames too large, few frames a second make it too small; a stroke whose frequency
    is in a simple ratio to the camera's is seen at the same few instants again and again.
    """
    T = np.array([0.0, *(state.tension for state in states)])
    drive = drive_function(design.drive)
    fine = np.linspace(0.0, design.drive.duration, 2001)
    tensions = np.array([design.tension(float(drive(float(t)))) for t in fine])
    if tensions.max() > T[-1] * (1.0 + 1e-9):
        raise ModelError(f"camera: found states up to {T[-1]:.4g} kPa, expected up to {tensions.max():.4g} kPa")
    drawn = drawn_points(design)
    points = [drawn.level(), *(state.points for state in states)]
    # (s, 5, 2): ends and middle of the axis, soles, in x and z
    seen = np.array([np.vstack([p.axis[[0, -1, len(p.axis) // 2]], p.soles])[:, (0, 2)] for p in points])
    path = PchipInterpolator(T, seen)
    force = PchipInterpolator(T, [0.0, *(state.numbers["muscle_force_mN"] for state in states)])
    true = _read(path(tensions), drawn.soles)
    rest = design.tension(0.0)
    k = eq3_stiffness(design)
    draw = np.random.default_rng(camera.seed)
    spread = camera.noise * camera.pixel
    takes = []
    for _ in range(_TAKES):
        first = draw.uniform(0.0, 1.0 / camera.rate)
        frames = np.arange(first, design.drive.duration, 1.0 / camera.rate)
        at = path(np.array([design.tension(float(drive(float(t)))) for t in frames]))
        closing, sagitta = _read(at + spread * draw.normal(size=at.shape), drawn.soles)
        still = path(np.array([rest]))
        _, alone = _read(still + spread * draw.normal(size=still.shape), drawn.soles)
        takes.append((np.ptp(closing), k * float(alone[0]), k * np.ptp(sagitta)))
    means, deviations = np.mean(takes, axis=0), np.std(takes, axis=0)
    truth = (np.ptp(true[0]), float(force(rest)), float(np.ptp(force(tensions))))
    names = ("stroke_mm", "passive_force_mN", "stroke_force_mN")
    columns = zip(names, truth, means, deviations, strict=True)
    return [Filmed(name, float(a), float(b), float(c)) for name, a, b, c in columns]


def _read(points: Array, soles: Array) -> tuple[Array, Array]:
    """Closing and sagitta, (f,) each [mm], from five points in frames (f, 5, 2) [mm]; `soles` as drawn, (2, 3) [mm]."""
    start, end, middle, short, long = points.transpose(1, 0, 2)
    chord = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    closing = float(soles[1, 0] - soles[0, 0]) - np.einsum("fc,fc->f", long - short, chord)
    arm = middle - start
    # signed: noise of a flat beam may not become a rise
    return closing, chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0]
