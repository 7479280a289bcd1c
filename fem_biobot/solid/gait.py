"""The walk of a solid: what it did over its strokes, and the numbers that describe it, by the same names as for rods.

Everything is read from the samples of one motion. Strokes are the periods of the drive; numbers are means over those
that are left after the first few. How things are computed is the solid's own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fem_biobot.design import Design
from fem_biobot.friction.ground import Ground
from fem_biobot.friction.kernels import LIFTED, SLIP, STICK
from fem_biobot.material.law import Array
from fem_biobot.muscle.drive import active_force
from fem_biobot.solid.dynamics.motion import SolidMotion
from fem_biobot.solid.dynamics.strain import green_lagrange, work_of
from fem_biobot.solid.from_design import tension_step
from fem_biobot.solid.happenings import Happening
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidState
from fem_biobot.solid.space import Ints
from fem_biobot.solid.standing import Standing
from fem_biobot.strokes import Strokes, mean, plain


@dataclass(frozen=True, eq=False)
class SolidWalk(Strokes):
    """A walk over some strokes.

    Attributes
    ----------
    motion
        Samples of everything.
    design
        Whose solid walked.
    frequency, amplitude, waveform, step
        Of the drive: strokes per second [Hz], largest drive [1], name; time step [s].
    discarded
        Strokes at the beginning that means leave out.
    start
        The machine as it stood.
    events
        What happened, in order of time.
    notes
        What was used instead of what, one line each.
    wall_time
        Processor time of the motion [s].
    """

    motion: SolidMotion
    design: Design
    frequency: float
    amplitude: float
    waveform: str
    step: float
    discarded: int
    start: Standing
    events: tuple[Happening, ...] = ()
    notes: tuple[str, ...] = ()
    wall_time: float = 0.0

    @property
    def ground(self) -> Ground:
        """What it walked on."""
        assert self.motion.ground is not None
        return self.motion.ground

    @property
    def feet(self) -> tuple[str, ...]:
        """Names of the feet."""
        assert self.motion.feet is not None
        return self.motion.feet.names

    @property
    def times(self) -> Array:
        """Of the samples, (s,) [s]."""
        return self.motion.times

    @cached_property
    def drive(self) -> Array:
        """Share of the active tension at the samples, (s,) [1]."""
        low, high = (tension_step(self.design, self.design.tension(d)).tension for d in (0.0, 1.0))
        return np.array([(s.tension - low) / (high - low) if high > low else 0.0 for s in self.motion.drive])

    @cached_property
    def position(self) -> Array:
        """Centre of mass, (s, 3) [mm]."""
        return self.motion.centre_of_mass

    @cached_property
    def _measurer(self) -> Measurer:
        return Measurer(self.design, self.motion.body.model)

    def _measured(self, measure: Any) -> Array:
        return np.array([measure(self.motion.state(i)) for i in range(len(self.times))])

    @cached_property
    def _rest(self) -> SolidState:
        return SolidState(
            self.motion.body.model, tension_step(self.design, self.design.tension(0.0)),
            np.ascontiguousarray(self.start.checkpoint.state.u.T),
        )  # fmt: skip

    @cached_property
    def tip_closing(self) -> Array:
        """Approach of the sole centroids along the chord since the machine stood, (s,) [mm]."""
        return self._measured(self._measurer.tip_closing) - self.passive_closing_mm

    @property
    def passive_closing_mm(self) -> float:
        """Tip closing of the standing machine since the drawing."""
        return self._measurer.tip_closing(self._rest)

    @cached_property
    def sagitta(self) -> Array:
        """Rise of the beam's middle over its chord since the machine stood, (s,) [mm]."""
        return self._measured(self._measurer.sagitta) - self._measurer.sagitta(self._rest)

    @cached_property
    def muscle_force(self) -> Array:
        """Force through the junction's mid-section without its viscous part, (s,) [mN]."""
        return self._measured(self._measurer.muscle_force)

    @cached_property
    def foot_force(self) -> Array:
        """Mean force of the ground on each foot since the sample before: normal, forward, left, (s, f, 3) [mN]."""
        return np.stack([self.motion.foot_force(k) for k in range(len(self.feet))], axis=1)

    def _of(self, foot: int) -> Ints:
        assert self.motion.feet is not None
        return np.flatnonzero(self.motion.feet.owner == foot)

    @cached_property
    def foot_state(self) -> Ints:
        """`LIFTED`, `STICK` or `SLIP` of each foot, (s, f).

        By what its points that bear a force do: a foot slips when more than half of its load does.
        """
        found = []
        for k in range(len(self.feet)):
            points = self._of(k)
            load = self.motion.contact_force[:, points, 0]
            slipping = (load * (self.motion.touch[:, points] == SLIP)).sum(axis=1)
            total = load.sum(axis=1)
            found.append(np.where(total <= 0.0, LIFTED, np.where(slipping > 0.5 * total, SLIP, STICK)))
        return np.stack(found, axis=1).astype(np.int64)

    def _kept_samples(self) -> Ints:
        begin, end = self.stroke_ends[self.kept.start], self.stroke_ends[-1]
        return np.flatnonzero((self.times > begin + 1e-9) & (self.times <= end + 1e-9))

    @cached_property
    def foot_slips(self) -> Array:
        """Share of each foot's load, over the kept time, that is on points while they slip, (f,) [1]."""
        inside = self._kept_samples()
        found = []
        for k in range(len(self.feet)):
            load = self.motion.contact_force[inside][:, self._of(k), 0]
            total = load.sum()
            share = (load * self.motion.slip_share[inside][:, self._of(k)]).sum()
            found.append(share / total if total > 0.0 else 0.0)
        return np.array(found)

    @cached_property
    def foot_contacts(self) -> Array:
        """Share of the kept time in which each foot bore a force, (f,) [1]."""
        inside = self._kept_samples()
        shares = [self.motion.contact_share[inside][:, self._of(k)].max(axis=1) for k in range(len(self.feet))]
        return np.array([float(s.mean()) if len(s) else math.nan for s in shares])

    @property
    def slip_fraction_1(self) -> float:
        """Share of the feet's load that slips, weighted by their time on the ground."""
        total = self.foot_contacts.sum()
        return float(self.foot_slips @ self.foot_contacts / total) if total > 0.0 else math.nan

    @property
    def active_force_mN(self) -> float:
        """Largest force that the drive adds to a muscle held at its length."""
        return self.amplitude * active_force(self.design)

    @property
    def weight_mN(self) -> float:
        """Weight less buoyancy."""
        return float(np.linalg.norm(self.motion.body.weight.sum(axis=0)))

    @cached_property
    def added_work(self) -> Array:
        """Work of what the drive adds to the standing tension since the start, its positive parts, (s,) [uJ]."""
        system = self.motion.body.system
        standing = self._rest.step
        dV = system.space.dV

        def read(i: int) -> tuple[Array, Array]:
            state = self.motion.state(i)
            both = [
                system.points(state.F, s, passive=False, moduli=False, straining=state.straining).S
                for s in (self.motion.drive[i], standing)
            ]
            return both[0] - both[1], green_lagrange(state.F)

        done, (S, E) = [0.0], read(0)
        for i in range(1, len(self.times)):
            S_next, E_next = read(i)
            done.append(max(-work_of(0.5 * (S + S_next), E_next - E, dV), 0.0))
            S, E = S_next, E_next
        return np.cumsum(done)

    @property
    def work_pillar_uJ(self) -> float:
        """Work of the active force in a stroke, its positive part."""
        return mean(self._per_stroke(self.added_work)[self.kept])

    @property
    def work_walk_uJ(self) -> float:
        """Work of walking: what dragging the machine along its step over the same ground would take."""
        return float(self.ground.kinetic_coefficients[0]) * self.weight_mN * abs(self.step_mm)

    @property
    def energy_error_1(self) -> float:
        """Largest rest that the book leaves unexplained, over the muscle's total work (both signs added)."""
        total = float(np.abs(np.diff(self.motion.energy("muscle"))).sum())
        return float(np.abs(self.motion.energy_error).max()) / total if total > 0.0 else math.nan

    def summary(self) -> dict[str, Any]:
        """Every number with its unit in its key; None where a walk is too short for it."""
        work = {name: mean(self._per_stroke(self.motion.energy(name))[self.kept]) for name in _WORKS}
        rings = {"work_rings_friction_uJ": -work["rubbing"], "work_rings_normal_uJ": -work["pressing"]}
        sagitta, pillar = self.sagitta_stroke_mm, self.work_pillar_uJ
        found: dict[str, Any] = {
            "model": "solid",
            "frequency_Hz": self.frequency,
            "speed_mm_per_s": self.step_mm * self.frequency,
            "step_mm": self.step_mm,
            "step_spread_mm": self.step_spread_mm,
            "stroke_mm": self.stroke_mm,
            "slip_fraction_1": self.slip_fraction_1,
            "work_pillar_uJ": pillar,
            "work_walk_uJ": self.work_walk_uJ,
            "efficiency_1": abs(self.step_mm) / sagitta if sagitta > 0.0 else math.nan,
            "mechanical_efficiency_1": self.work_walk_uJ / pillar if pillar > 0.0 else math.nan,
            "energy_error_1": self.energy_error_1,
            "camera_stroke_mm": self.camera_stroke_mm,
            "sagitta_stroke_mm": sagitta,
            "passive_closing_mm": self.passive_closing_mm,
            "drift_mm": self.drift_mm,
            "amplitude_1": self.amplitude,
            "active_force_mN": self.active_force_mN,
            "weight_mN": self.weight_mN,
            "work_muscle_uJ": work["muscle"],
            "work_friction_uJ": -work["friction"],
            "work_viscous_uJ": -work["viscous"],
            "work_drag_uJ": -work["drag"],
            "work_integrator_uJ": -work["integrator"],
            **(rings if self.motion.between else {}),
            "duration_s": float(self.times[-1] - self.times[0]),
            "settling_time_s": self.start.time,
            "step_s": self.step,
            "strokes_1": self.strokes,
            "discarded_strokes_1": self.kept.start,
            "foot_slip_1": dict(zip(self.feet, self.foot_slips.tolist(), strict=True)),
            "foot_contact_1": dict(zip(self.feet, self.foot_contacts.tolist(), strict=True)),
            "unknowns_1": self.motion.body.system.n_dofs,
            "time_steps_1": self.motion.steps,
            "iterations_1": self.motion.iterations,
            "factorisations_1": self.motion.factorisations,
            "halved_steps_1": self.motion.halved,
            "largest_residual_1": self.motion.largest_residual,
            "notes": list(self.notes),
            "events": [{"name": e.name, "time_s": e.time, "text": e.text} for e in self.events],
        }
        return plain(found)


_WORKS = ("muscle", "friction", "viscous", "drag", "integrator", "rubbing", "pressing")
