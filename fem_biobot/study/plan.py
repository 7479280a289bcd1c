"""Which states a job solves for, and the solving of each: the passive path, the stroke, tissue moulded and remodelled.

States are solved in order and handed on one by one, so that a job can save each and go on from what it has.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import SolveError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.from_design import newton_settings, remodelled, tension_step, tension_unit
from fem_biobot.solid.interface.state import Touch
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, SolidState, linear_solver, solve
from fem_biobot.solid.newton import Counts, NewtonSettings, Trial
from fem_biobot.solid.records import Step
from fem_biobot.solid.space import LockingWarning
from fem_biobot.study.neighbour import Guide, Shared
from fem_biobot.study.paper import SIMULATED_FORCE_TO_DEFLECTION
from fem_biobot.study.reporter import Reporter

# relative accuracy at which a state with a wanted muscle force is met
_FORCE_TOLERANCE = 1e-4
# passive stress along the fibres that remodelled tissue may keep, as a share of its tension
_STRESS_TOLERANCE = 2e-3
# the same where results must not tell where the search began; the secant leaves far less than the last that is above
_SHARP_STRESS_TOLERANCE = 1e-7
# first and longest step of the logarithm of the natural stretch on the way to it
_FIRST_LN_STRETCH, _LONGEST_LN_STRETCH = 0.08, 0.25
# tissue that would have to shorten beyond this has no skeleton to stand against
_SHORTEST_NATURAL_STRETCH = 0.3
# residual at which a trial of a natural stretch is accepted
_TRIAL_TOLERANCE = 1e-5


@dataclass(frozen=True)
class Wanted:
    """A state asked for.

    Attributes
    ----------
    key, label
        Short word for files, and what the reader is told.
    reference
        ``as_moulded`` or ``remodelled``.
    tension
        Nominal tension [kPa]; None where `force` decides.
    force
        Muscle force to be met by tuning the tension [mN]; None where `tension` decides.
    load
        Factor on the design's load.
    """

    key: str
    label: str
    reference: str = "as_moulded"
    tension: float | None = 0.0
    force: float | None = None
    load: float = 1.0


@dataclass(frozen=True)
class Found:
    """A state that was asked for, and solved."""

    wanted: Wanted
    state: SolidState
    natural_stretch: float = 1.0


def wanted_states(design: Design) -> list[Wanted]:
    """The states of a design's main job, in the order in which they are solved."""
    if design.kind == "cantilever":
        return [Wanted(f"load_{k}", f"{k / 4:.0%} of the load", load=k / 4) for k in range(5)]
    rest, passive, peak = 0.0, design.tension(0.0), design.tension(design.drive.amplitude)
    half = 0.5 * (passive + peak)
    if design.kind == "strip":
        path = [(f"path_{k}", k / 4 * passive) for k in (1, 2, 3)]
        return [
            Wanted("rest", "at rest", tension=rest),
            *(Wanted(key, f"{t:.3g} kPa", tension=t) for key, t in path),
            Wanted("passive", f"passive, {passive:.4g} kPa", tension=passive),
            Wanted("peak", f"stimulated, {peak:.4g} kPa", tension=peak),
        ]
    sliding = design.muscle is not None and design.muscle.attachment == "contact"
    if design.muscle is not None and (sliding or design.muscle.layout == "ring"):
        forces = []  # with friction a state hangs on its path, which trials of a tension would bend back and forth
    else:
        forces = [
            Wanted(f"force_{force:g}".replace(".", "p"), f"{force:g} mN of muscle force", tension=None, force=force)
            for force, _ in SIMULATED_FORCE_TO_DEFLECTION
        ]
    remodelled = [
        Wanted("remodelled_passive", f"remodelled, passive, {passive:.4g} kPa", "remodelled", passive),
        Wanted("remodelled_peak", f"remodelled, stimulated, {peak:.4g} kPa", "remodelled", peak),
    ]
    return [
        Wanted("rest", "at rest", tension=rest),
        *forces,
        *(Wanted(f"path_{k}", f"{k / 9 * passive:.3g} kPa", tension=k / 9 * passive) for k in (5, 7)),
        Wanted("passive", f"passive, {passive:.4g} kPa", tension=passive),
        Wanted("half", f"half drive, {half:.4g} kPa", tension=half),
        Wanted("peak", f"stimulated, {peak:.4g} kPa", tension=peak),
        *([] if sliding else remodelled),
    ]


@dataclass
class Solver:
    """Solves wanted states one after the other on one mesh.

    Attributes
    ----------
    history
        The latest states of the present reference, for the predictor.
    seen
        Tension and muscle force of all moulded states solved, for meeting a force.
    shared
        What is shared with other designs: a neighbour's states, beside which this one solves.
    """

    design: Design
    mesh: BodyMesh
    reporter: Reporter
    history: list[SolidState] = field(default_factory=list)
    seen: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.0)])
    natural_stretch: float = 1.0
    shared: Shared | None = None

    def __post_init__(self) -> None:
        self.settings = newton_settings(self.design)
        with warnings.catch_warnings():
            # told as a note of the job
            warnings.simplefilter("ignore", LockingWarning)
            self.model = SolidModel.from_design(self.design, self.mesh)
        self.moulded = self.model
        self.measurer = Measurer(self.design, self.model)
        self.solver = linear_solver(self.model, self.settings)
        beside = None if self.shared is None else self.shared.states()
        self.guide = None if beside is None else Guide(beside, self.design, self.moulded)

    def adopt(self, found: Found) -> None:
        """Take a state that was solved before (its model must be this solver's) as the latest."""
        self._remember(found.state)
        self.natural_stretch = found.natural_stretch

    def restore(
        self,
        wanted: Wanted,
        u: np.ndarray,
        step: Step,
        natural_stretch: float,
        work: dict[str, float],
        pressure: np.ndarray | None = None,
        touch: Touch | None = None,
    ) -> Found:
        """Rebuild a saved state on this solver's models."""
        if wanted.reference == "remodelled" and self.natural_stretch != natural_stretch:
            self.model = remodelled(self.moulded, self.design, natural_stretch)
            self.history = []
        counts = int(work["newton"]), int(work["factorisations"]), int(work["cg"])
        state = SolidState(self.model, step, u, work["residual"], *counts, pressure, touch=touch)
        found = Found(wanted, state, natural_stretch)
        self.adopt(found)
        return found

    def solve(self, wanted: Wanted) -> Found:
        """The wanted state; raises `SolveError` where there is none."""
        if wanted.reference == "remodelled" and self.model is self.moulded:
            state = self._remodel(wanted)
        elif wanted.force is not None:
            state = self._meet_force(wanted.force)
        else:
            assert wanted.tension is not None
            state = self._reach(self._step(wanted.tension, wanted.load))
        self._remember(state)
        return Found(wanted, state, self.natural_stretch)

    def _step(self, tension: float, load: float = 1.0) -> Step:
        return replace(tension_step(self.design, tension), load=load)

    def _go(
        self,
        step: Step,
        start: Sequence[SolidState],
        settings: NewtonSettings | None = None,
        trial: Trial | None = None,
    ) -> SolidState:
        settings = settings or self.settings
        try:
            found = solve(
                self.model,
                [step],
                settings=settings,
                start=start,
                trial=None if trial is None else (trial.u.T, trial.S, trial.p),
                observe=self._observe,
                solver=self.solver,
            )
            return found.last
        except SolveError as failure:
            raise self._in_kPa(failure) from None

    def _reach(self, step: Step, settings: NewtonSettings | None = None) -> SolidState:
        """The state at a step, from where the neighbour says or else along the own path."""
        before, history = self.solver.counts.copy(), self.history[-4:]
        trial = None if self.guide is None else self.guide.trial(self.model, history, step)
        if trial is None:
            return self._go(step, history, settings)
        try:
            return self._go(step, [], settings, trial)
        except SolveError:
            return self._worked(self._go(step, history, settings), before)

    def _worked(self, state: SolidState, before: Counts) -> SolidState:
        """A state with all the work done since some counts."""
        work = self.solver.counts.since(before)
        return replace(state, newton_iterations=work.newton, factorisations=work.factorisations, cg_iterations=work.cg)

    def _in_kPa(self, failure: SolveError) -> SolveError:
        """The same failure with its factors told as tensions, where tension is what was raised."""
        if self.design.muscle is None or failure.wanted is None:
            return failure
        unit, at = tension_unit(self.design), failure.buckling
        lost = "" if at is None else f"it buckles at {at.step.tension * unit:.4g} kPa; "
        text = (
            f"no equilibrium between {failure.reached.tension * unit:.4g} kPa of tension (reached) and "
            f"{failure.wanted.tension * unit:.4g} kPa (asked): {failure.reason}; {lost}try a lower tension, a stiffer "
            "design or another mesh size"
        )
        return failure.retold(text)

    def _observe(self, kind: str, values: dict[str, float]) -> None:
        if kind == "iteration":
            self.reporter.iteration(int(values["iteration"]), values["residual"])

    def _remember(self, state: SolidState) -> None:
        if not self.history or self.history[-1].step != state.step:
            self.history = [*self.history[-3:], state]
        if self.design.muscle is not None and state.model is self.moulded:
            self.seen.append((state.step.tension * tension_unit(self.design), self.measurer.muscle_force(state)))

    def _meet_force(self, force: float) -> SolidState:
        """State with a given muscle force, by interpolating the tension; work of all trials is counted in it.

        Where the neighbour leads nowhere it is met without it.
        """
        before, guide, known = self.solver.counts.copy(), self.guide, (self.history, list(self.seen))
        try:
            return self._worked(self._met(force), before)
        except SolveError:
            if guide is None:
                raise
        (self.history, self.seen), self.guide = known, None
        try:
            return self._worked(self._met(force), before)
        finally:
            self.guide = guide

    def _met(self, force: float) -> SolidState:
        """State with a given muscle force after at most eight tensions."""
        trial = replace(self.settings, check_stability=False)
        for _ in range(8):
            state = self._reach(self._step(self._tension_guess(force)), trial)
            self._remember(state)
            if abs(self.seen[-1][1] - force) <= _FORCE_TOLERANCE * force:
                self._go(state.step, [state])  # the state itself, with its stability checked
                return state
        raise SolveError(
            f"muscle force of {force:g} mN: not met in 8 tensions, the last gave {self.seen[-1][1]:.4g} mN"
        )

    def _tension_guess(self, force: float) -> float:
        """Tension at which the force is expected: by the neighbour, or through the three states nearest in force."""
        least = 0.2 * force / self.design.junction_section
        first = force / self.design.junction_section * (1.0 + self._tissue_over_skeleton())
        if self.guide is not None and (guess := self.guide.tension(force, self.seen)) is not None:
            # a neighbour may be far off: no farther than what is known here lets an own guess go
            return float(np.clip(guess, least, 2.0 * max(first, *(t for t, _ in self.seen))))
        points = sorted({(round(f, 12), t) for t, f in self.seen})
        if len(points) == 1:
            return first
        nearest = sorted(points, key=lambda p: abs(p[0] - force))[:3]
        f, t = np.array(nearest).T
        weights = [np.prod([(force - f[j]) / (f[i] - f[j]) for j in range(len(f)) if j != i]) for i in range(len(f))]
        return float(np.clip(weights @ t, least, 2.0 * max(t.max(), 1e-9)))

    def _tissue_over_skeleton(self) -> float:
        """Stiffness of the junction's tissue over that of the skeleton at the muscle, in linear theory [1].

        A first guess only: the share of the tension that the tissue spends on its own shortening follows from it.
        """
        design = self.design
        muscle, skeleton = design.muscle, design.skeleton
        assert muscle is not None
        assert skeleton is not None
        free = max(design.bay - 2.0 * muscle.ring_thickness, 0.1 * design.bay)
        tissue = muscle.material.young * design.junction_section / free
        frame = skeleton.material.young * design.second_moment / (design.moment_arm**2 * design.span)
        return tissue / frame

    def _remodel(self, wanted: Wanted) -> SolidState:
        """Passive state of tissue that is free of passive stress along its fibres in that very state.

        The natural stretch s of the junction is led down from 1 in steps of ln s, each predicted from the last states,
        until the secant of the passive stress over ln s ends at zero.
        """
        assert wanted.tension is not None
        step = self._step(wanted.tension)
        before = self.solver.counts.copy()
        state = self._go(step, self.history[-4:])  # the moulded state at this tension
        path = [(0.0, state, self.measurer.passive_fibre_stress(state))]
        longest = _FIRST_LN_STRETCH
        rough, enough = self._search()
        stress = path[-1][2]
        if (begun := self._begun(step, rough)) is not None:
            path.append(begun)
        for _ in range(40):
            ln_s, state, stress = path[-1]
            if abs(stress) <= enough * wanted.tension:
                break
            if ln_s < np.log(_SHORTEST_NATURAL_STRETCH):
                raise SolveError(
                    f"remodelled tissue: at {np.exp(ln_s):.2g} of its moulded length it is still pressed together by "
                    f"{-stress:.2g} of {wanted.tension:.4g} kPa: this skeleton cannot hold the whole standing tension; "
                    "try a stiffer beam or a lower passive tension"
                )
            ahead = -longest
            if len(path) > 1:
                ahead = float(np.clip(-stress * (ln_s - path[-2][0]) / (stress - path[-2][2]), -longest, longest))
            self.model = remodelled(self.moulded, self.design, np.exp(ln_s + ahead))
            try:
                state = self._go(step, [], rough, trial=_extrapolated(path, ln_s + ahead))
            except SolveError:
                longest *= 0.4
                if longest < 1e-3:
                    raise
                continue
            longest = min(1.6 * longest, _LONGEST_LN_STRETCH)
            stress = Measurer(self.design, self.model).passive_fibre_stress(state)
            path = [*path[-2:], (ln_s + ahead, state, stress)]
        else:
            raise SolveError(
                f"remodelled tissue: no natural stretch found in 40 trials, the last left {stress:.2g} kPa"
            )
        ln_s, state, _ = path[-1]
        self.natural_stretch = float(np.exp(ln_s))
        self.model = state.model
        state = self._go(step, [], trial=Trial(np.ascontiguousarray(state.u.T), state.points.S, state.pressure))
        self.history = []
        return self._worked(state, before)

    def _search(self) -> tuple[NewtonSettings, float]:
        """How a natural stretch is sought: settings of its trials, and what share of the tension may be left."""
        tolerance, enough = max(self.settings.tolerance, _TRIAL_TOLERANCE), _STRESS_TOLERANCE
        if self.shared is not None and self.shared.sharp and self.design.value("muscle.reference") == "remodelled":
            tolerance, enough = self.settings.tolerance, _SHARP_STRESS_TOLERANCE
        return replace(self.settings, tolerance=tolerance, check_stability=False), enough

    def _begun(self, step: Step, rough: NewtonSettings) -> tuple[float, SolidState, float] | None:
        """A state with the neighbour's natural stretch: ln of that, the state, the passive stress it leaves."""
        found = None if self.guide is None else self.guide.natural(step)
        if found is None:
            return None
        stretch, self.model, trial = found
        try:
            state = self._go(step, [], rough, trial)
        except SolveError:
            return None
        return math.log(stretch), state, Measurer(self.design, self.model).passive_fibre_stress(state)


def _extrapolated(path: Sequence[tuple[float, SolidState, float]], target: float) -> Trial:
    """Displacement, point stress and pressure at a parameter, by the polynomial through the last states."""
    at = [entry[0] for entry in path]
    last = path[-1][1]
    u, S, p = np.zeros_like(last.u), np.zeros_like(last.points.S), None
    for i, (here, state, _) in enumerate(path):
        weight = float(np.prod([(target - other) / (here - other) for j, other in enumerate(at) if j != i]))
        u += weight * state.u
        S += weight * state.points.S
        if state.pressure is not None:
            p = weight * state.pressure + (0.0 if p is None else p)
    return Trial(np.ascontiguousarray(u.T), S, p)
