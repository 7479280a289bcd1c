"""A walk: what a machine did over its strokes, and the numbers that describe it.

Everything is read from the samples of one motion; nothing is integrated again. Strokes are the periods of the drive,
``k / f`` to ``(k + 1) / f``; numbers are means over those that are left after the first few, the transient.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.design import Design
from fem_biobot.friction.kernels import LIFTED, SLIP, STICK
from fem_biobot.rod.anatomy import Anatomy, added_forces, anatomy, closing, muscle_forces, muscle_lengths, path, sagitta
from fem_biobot.rod.dynamics.integrate import Motion
from fem_biobot.rod.events import Event
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.rest import Stance
from fem_biobot.strokes import Strokes, mean, plain

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Walk(Strokes):
    """A walk over some strokes.

    Attributes
    ----------
    motion
        Samples of everything.
    frequency, amplitude, waveform
        Of the drive: strokes per second [Hz], largest drive [1], name.
    discarded
        Strokes at the beginning that means leave out.
    start
        The machine as it stood; None if the walk began otherwise.
    design
        Whose model walked; None for a model of one's own.
    events
        What happened, in order of time.
    notes
        What it is to be read with, one line each.
    wall_time
        Processor time of the motion [s].
    """

    motion: Motion
    frequency: float
    amplitude: float
    waveform: str
    step: float
    discarded: int
    start: Stance | None = None
    design: Design | None = None
    events: tuple[Event, ...] = ()
    notes: tuple[str, ...] = ()
    wall_time: float = 0.0

    @property
    def model(self) -> RodModel:
        """What walked."""
        return self.motion.model

    @property
    def ground(self) -> Ground:
        """On what."""
        assert self.motion.ground is not None
        return self.motion.ground

    @property
    def times(self) -> Array:
        """Of the samples, (s,) [s]."""
        return self.motion.times

    @cached_property
    def anatomy(self) -> Anatomy:
        """Where feet, beam and muscles are."""
        return anatomy(self.model)

    @property
    def ended_early(self) -> bool:
        """Whether an event ended it."""
        return any(event.name == "overturned" for event in self.events)

    @cached_property
    def position(self) -> Array:
        """Centre of mass, (s, 3) [mm]."""
        return self.motion.centre_of_mass

    @cached_property
    def tip_closing(self) -> Array:
        """Decrease of the distance between the outer soles, along the chord, since the start, (s,) [mm]."""
        found = closing(self.motion, self.anatomy)
        return found - self._at_rest(closing, found)

    @cached_property
    def sagitta(self) -> Array:
        """Rise of the beam's middle over its chord since the start, (s,) [mm]."""
        found = sagitta(self.motion, self.anatomy)
        return found - self._at_rest(sagitta, found)

    def _at_rest(self, measure: Any, found: Array) -> float:
        if self.start is None:
            return float(found[0])
        still = self.start.state
        rest = _Still(self.model, self.ground, still.x[None], still.Q[None], np.zeros(1), np.zeros(1))
        return float(measure(rest, self.anatomy)[0])

    @property
    def passive_closing_mm(self) -> float:
        """Tip closing of the standing machine since the drawing."""
        return float(closing(self.motion, self.anatomy)[0] - self.tip_closing[0])

    @cached_property
    def foot_force(self) -> Array:
        """Mean force of the ground on each foot since the sample before: normal, forward, left, (s, f, 3) [mN]."""
        return np.stack([self.motion.contact_force[:, c].sum(axis=1) for c in self.anatomy.corners], axis=1)

    @cached_property
    def foot_state(self) -> NDArray[np.int64]:
        """`LIFTED`, `STICK` or `SLIP` (of `friction.kernels`) of each foot, (s, f).

        A foot slips when a corner does, sticks when one touches and none slips, and is lifted when all are.
        """
        found = []
        for corners in self.anatomy.corners:
            touch = self.motion.touch[:, corners]
            found.append(
                np.where((touch == SLIP).any(axis=1), SLIP, np.where((touch == STICK).any(axis=1), STICK, LIFTED))
            )
        return np.stack(found, axis=1).astype(np.int64)

    def _foot_share(self, name: str) -> Array:
        """Share of the time since the last sample, largest over a foot's corners, (s, f)."""
        return np.stack([getattr(self.motion, name)[:, c].max(axis=1) for c in self.anatomy.corners], axis=1)

    @cached_property
    def foot_slips(self) -> Array:
        """Share of the kept time in which each foot slipped while it bore a force, (f,) [1]."""
        slip = np.minimum(self._foot_share("slip_share"), self._foot_share("contact_share"))
        return self._kept_mean(slip)

    @cached_property
    def foot_contacts(self) -> Array:
        """Share of the kept time in which each foot bore a force, (f,) [1]."""
        return self._kept_mean(self._foot_share("contact_share"))

    def _kept_mean(self, values: Array) -> Array:
        inside = (self.times > self.stroke_ends[self.kept.start] + 1e-9) & (self.times <= self.stroke_ends[-1] + 1e-9)
        weights = np.diff(self.times, prepend=self.times[0])[inside]
        return weights @ values[inside] / weights.sum() if weights.sum() > 0.0 else np.full(values.shape[1], math.nan)

    @property
    def slip_fraction_1(self) -> float:
        """Share of the feet's time on the ground in which they slip."""
        touching = self.foot_contacts.sum()
        return float(self.foot_slips.sum() / touching) if touching > 0.0 else math.nan

    @cached_property
    def foot_path(self) -> Array:
        """Middle of each sole, (s, f, 3) [mm]."""
        return np.stack([path(self.motion, sole) for sole in self.anatomy.soles], axis=1)

    @cached_property
    def muscle_force(self) -> Array:
        """Tensile force of each muscle without its viscous part, (s, m) [mN]."""
        return muscle_forces(self.motion, self.anatomy)

    @cached_property
    def muscle_length(self) -> Array:
        """Of each muscle, (s, m) [mm]."""
        return muscle_lengths(self.motion, self.anatomy)

    @property
    def active_force_mN(self) -> float:
        """Largest force that the drive adds, all muscles together."""
        pull = self.model.pull(self.amplitude) - self.model.pull(0.0)
        return float(pull[self.anatomy.muscles].sum())

    @property
    def weight_mN(self) -> float:
        """Weight less buoyancy."""
        a, g = self.model.assembly, self.model.assembly.gravity
        lifted = a.loads.force[a.loads.following == 0].sum(axis=0) if len(a.loads.node) else np.zeros(3)
        return float(np.linalg.norm(self.model.mass * g + lifted))

    @property
    def work_pillar_uJ(self) -> float:
        """Work of the active force on the pillars in a stroke, its positive part.

        The active force is what the drive adds to the standing tension; it does work while the muscle shortens.
        """
        pull = added_forces(self.motion, self.anatomy)
        done = -0.5 * (pull[1:] + pull[:-1]) * np.diff(self.muscle_length, axis=0)
        total = np.concatenate([[0.0], np.maximum(done, 0.0).sum(axis=1).cumsum()])
        return mean(self._per_stroke(total)[self.kept])

    @property
    def work_muscle_uJ(self) -> float:
        """Net work of the muscles' tension in a stroke, standing and active, from the energy book."""
        work = np.interp(self.stroke_ends, self.times, self.motion.energy("muscle"))
        return mean(np.diff(work)[self.kept])

    @property
    def work_friction_uJ(self) -> float:
        """Lost in friction in a stroke, from the energy book."""
        work = np.interp(self.stroke_ends, self.times, self.motion.energy("friction"))
        return -mean(np.diff(work)[self.kept])

    @property
    def work_walk_uJ(self) -> float:
        """Work of walking: what dragging the machine along its step over the same ground would take.

        Kinetic friction times weight times the step's size.
        """
        return self.ground.kinetic_friction * self.weight_mN * abs(self.step_mm)  # type: ignore[operator]

    @property
    def efficiency_1(self) -> float:
        """The paper's: work ``F step`` over work ``F sagitta`` of the same force, so step over the sagitta's swing."""
        return abs(self.step_mm) / self.sagitta_stroke_mm if self.sagitta_stroke_mm > 0.0 else math.nan

    @property
    def mechanical_efficiency_1(self) -> float:
        """Work of walking over the positive work on the pillars."""
        return self.work_walk_uJ / self.work_pillar_uJ if self.work_pillar_uJ > 0.0 else math.nan

    @property
    def energy_error_1(self) -> float:
        """Largest rest that the energy book leaves unexplained, over the muscles' total work (both signs added)."""
        total = float(np.abs(np.diff(self.motion.energy("muscle"))).sum())
        return float(np.abs(self.motion.energy_error).max()) / total if total > 0.0 else math.nan

    def summary(self) -> dict[str, Any]:
        """Every number with its unit in its key; None where a walk is too short for it."""
        found: dict[str, Any] = {
            "model": "rod",
            "frequency_Hz": self.frequency,
            "speed_mm_per_s": self.speed_mm_per_s,
            "step_mm": self.step_mm,
            "step_spread_mm": self.step_spread_mm,
            "stroke_mm": self.stroke_mm,
            "slip_fraction_1": self.slip_fraction_1,
            "work_pillar_uJ": self.work_pillar_uJ,
            "work_walk_uJ": self.work_walk_uJ,
            "efficiency_1": self.efficiency_1,
            "mechanical_efficiency_1": self.mechanical_efficiency_1,
            "energy_error_1": self.energy_error_1,
            "camera_stroke_mm": self.camera_stroke_mm,
            "sagitta_stroke_mm": self.sagitta_stroke_mm,
            "passive_closing_mm": self.passive_closing_mm,
            "drift_mm": self.drift_mm,
            "amplitude_1": self.amplitude,
            "active_force_mN": self.active_force_mN,
            "weight_mN": self.weight_mN,
            "work_muscle_uJ": self.work_muscle_uJ,
            "work_friction_uJ": self.work_friction_uJ,
            "duration_s": float(self.times[-1] - self.times[0]),
            "settling_time_s": None if self.start is None else self.start.time,
            "step_s": self.step,
            "strokes_1": self.strokes,
            "discarded_strokes_1": self.kept.start,
            "foot_slip_1": dict(zip(self.anatomy.feet, self.foot_slips.tolist(), strict=True)),
            "foot_contact_1": dict(zip(self.anatomy.feet, self.foot_contacts.tolist(), strict=True)),
            "time_steps_1": self.motion.steps,
            "iterations_1": self.motion.iterations,
            "factorisations_1": self.motion.factorisations,
            "halved_steps_1": self.motion.halved,
            "largest_residual_1": self.motion.largest_residual,
            "events": [{"name": e.name, "time_s": e.time, "text": e.text} for e in self.events],
            "notes": list(self.notes),
        }
        return plain(found)


@dataclass(frozen=True, eq=False)
class _Still:
    """What measures read of a motion, of one state."""

    model: RodModel
    ground: Ground
    x: Array
    Q: Array
    times: Array
    drive: Array
