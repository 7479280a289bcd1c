"""Motion of an assembly over time: the driver of both integrators, with step control, sampling and the energy book.

motion = dynamics(model, duration=1.0, step=1e-3, ground=Ground(0.5, 0.3), drive=lambda t: abs(np.sin(2 * np.pi * t)))
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.friction.kernels import solve_friction
from fem_biobot.friction.scratch import scratch
from fem_biobot.rod.address.kernels import by_address, entry
from fem_biobot.rod.assembly import kernels as assembly_kernels
from fem_biobot.rod.dynamics import kernels
from fem_biobot.rod.dynamics.adaptive import kernels as adaptive_kernels
from fem_biobot.rod.dynamics.arrays import BOOK, copied, work_for
from fem_biobot.rod.dynamics.book.kernels import accept
from fem_biobot.rod.dynamics.motion import Checkpoint, Motion, MotionInterrupted
from fem_biobot.rod.dynamics.run.kernels import AFTER, implicit_run
from fem_biobot.rod.dynamics.settings import Integrator, Settings
from fem_biobot.rod.dynamics.start import fits, plane_of, refuse_inside, refuse_massless, state_of
from fem_biobot.rod.explicit import kernels as explicit_kernels
from fem_biobot.rod.explicit.stability import longest_step
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.system import without_ground

__all__ = ["Checkpoint", "Drive", "Integrator", "Motion", "MotionInterrupted", "Settings", "dynamics"]

Array = NDArray[np.float64]
Drive = Callable[[float], float]

_MOST_ITERATIONS = 25
_HALVINGS = 12
_OUTCOMES = {
    kernels.SLOW: "Newton's iteration did not end",
    kernels.SINGULAR: "the tangent is singular (a part without mass that nothing holds?)",
    kernels.CONTACT: "the contact problem was not solved",
    kernels.WOUND: "an element turns by more than 3 rad or left the numbers",
    adaptive_kernels.INACCURATE: "its error stays above settings.largest_error",
}


def dynamics(
    model: RodModel,
    duration: float,
    step: float = 1e-3,
    *,
    ground: Ground | None = None,
    drive: Drive | None = None,
    start: RodState | Checkpoint | None = None,
    sample_every: int = 1,
    settings: Settings | None = None,
    listener: Callable[[float], None] | None = None,
) -> Motion:
    """Motion of an assembly from a start.

    Parameters
    ----------
    model
        What moves.
    duration, step
        [s]. The last step is as long as the others; `duration` is rounded to a whole number of them.
    ground
        None for no ground: contact points are then ignored.
    drive
        Drive of the muscles over time [1], at least 0; none by default.
    start
        State to begin from (velocities included) at time 0, or the checkpoint of another motion of the model, whose
        time goes on; by default as drawn, at rest.
    sample_every
        Steps between samples.
    settings
        Of the integrator.
    listener
        Told the time reached after each sample [s].

    Returns
    -------
    Motion
        Samples at ``0, sample_every * step, ...`` and at the end. A motion that goes on from the checkpoint of one of
        them, with the same step, repeats the uninterrupted one to the last bit.

    Raises
    ------
    ModelError
        Times that are not positive, a drive or load that is not a number, a start that does not fit or lies in the
        ground, explicit steps longer than stability allows or of parts without mass.
    SolveError
        A step that fails after being halved twelve times; `best` is the `Motion` up to the last sample.
    MotionInterrupted
        A `KeyboardInterrupt` with the same `best`.

    Notes
    -----
    Order two in smooth motion and one across impacts and changes of stick and slip (see `rod.dynamics.kernels`). A step
    that does not converge is halved, never accepted. Where the step adapts (`Settings.largest_error`, see
    `rod.dynamics.adaptive.kernels`) drive and loads are linear within a step, however short its parts.
    """
    for what, value in (("duration", duration), ("step", step)):
        good = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
        if not good or not np.isfinite(value) or not value > 0.0:
            raise ModelError(f"dynamics: {what}: found {value!r}, expected a time above 0 s")
    if step > duration * (1.0 + 1e-9):
        raise ModelError(f"dynamics: step: found {step:g} s, expected at most the duration ({duration:g} s)")
    if not isinstance(sample_every, int | np.integer) or sample_every < 1:
        raise ModelError(
            f"dynamics: sample_every: found {sample_every!r}, expected a whole number of steps, at least 1"
        )
    run = _Run(model, ground, drive or (lambda t: 0.0), settings or Settings(), float(step))
    run.begin(start)
    left = round(duration / step)
    try:
        while left:
            count = min(int(sample_every), left)
            run.go(count)
            left -= count
            run.sample()
            if listener is not None:
                listener(run.time)
    except KeyboardInterrupt:
        raise MotionInterrupted(run.motion()) from None
    return run.motion()


class _StepCalls(NamedTuple):
    factorise: Any
    friction: Any


class _ImplicitCalls(NamedTuple):
    step: Any
    within: _StepCalls
    accept: Any


class _ExplicitCalls(NamedTuple):
    joint_masses: Any
    friction: Any


class _Kept(NamedTuple):
    """What is known at the last sample, replaced in one go so that an interrupt finds it whole."""

    samples: int
    final: Checkpoint
    iterations: int
    factorisations: int
    halved: int
    divided: int
    worst: float


class _Run:
    """An integration under way."""

    def __init__(self, model: RodModel, ground: Ground | None, drive: Drive, settings: Settings, step: float) -> None:
        self.model, self.ground, self.drive, self.settings, self.step = model, ground, drive, settings, step
        self.samples: list[dict[str, Any]] = []
        self.iterations = self.factorisations = self.halved = self.divided = 0
        self.worst = self.reached = 0.0

    def begin(self, start: RodState | Checkpoint | None) -> None:
        """Arrays of the start; refuses what cannot be."""
        model = self.model
        self.assembly, self.system = model.assembly, model.system
        if self.ground is None:
            self.assembly, self.system = without_ground(self.assembly, self.system)
        self.points = len(self.assembly.contacts.node)
        c = self.points + len(self.assembly.touches.node)
        self.plane = plane_of(self.ground, self.points, self.assembly.touches.friction)
        explicit = self.settings.integrator is Integrator.explicit
        if explicit:
            refuse_massless(model, self.assembly)
        if isinstance(start, Checkpoint):
            if not fits(start.state, state_of(self.assembly, model.drawn())):
                raise ModelError("start: found a checkpoint of another model or ground, expected one of this model")
            self.state, self.book = copied(start.state), start.book.copy()
            same = start.step == self.step
            self.origin = start.begin if same else start.time
            self.n_steps = start.steps if same else 0
            if self.settings.largest_error is None:  # a count of steps, and no level of parts
                np.minimum(self.state.alert, AFTER, out=self.state.alert)
        else:
            self.state, self.book = state_of(self.assembly, start or model.drawn()), np.zeros(len(BOOK))
            self.origin, self.n_steps = 0.0, 0
            if self.settings.largest_error is not None:
                self.state.alert[0] = adaptive_kernels.BEGINNING
            refuse_inside(self.assembly, self.plane, self.state)
            there = RodState(model, self.state.x, self.state.Q, self.state.v)
            parts = assembly_kernels.energies(self.assembly, self.state.x, self.state.strain, self.state.lengths)
            self.book[:3] = there.kinetic_energy, *parts
        self.n_first = self.n_steps
        self.pull_by = model.pull(1.0) - model.pull(0.0)
        sizes = (self.system.n_blocks, len(self.system.touching), len(self.assembly.touches.node))
        self.work = work_for(self.state, *sizes)
        self.scratch = scratch(c)
        self.tally = np.zeros((c, 5))
        lengths = self.assembly.elements.length
        span = float(np.linalg.norm(np.ptp(model.built.x, axis=0)))
        self.arm = float(lengths.mean()) if len(lengths) else (span or 1.0)
        self.since = 1.0
        if explicit:
            pull = self._tables(np.array([self.time]))[0][0]
            # the slope of a force by velocity damps most at full drive, whenever that comes
            lagging = self.assembly.activation.curve[:, 1] >= 0
            pull = np.where(lagging, np.maximum(pull, self.pull_by), pull)
            longest = longest_step(self.assembly, self.system, self.state, pull, self.step)
            if longest < self.step:
                raise ModelError(
                    f"dynamics: step: found {self.step:g} s, expected at most {longest:.3g} s for explicit steps of "
                    "this model (its stiffest mode grows otherwise)"
                )
        self._prepare(explicit)
        self.sample()

    def _prepare(self, explicit: bool) -> None:
        """Compile or load the kernels, and bind what stays the same in all steps."""
        A, S, W, P, state = self.assembly, self.system, self.work, self.plane, self.state
        row, rooms = np.zeros(0), (W, self.scratch, self.book, self.tally)
        pulls, factors = self._tables(np.array([self.time]))
        near = W.near
        friction = by_address(
            solve_friction, W.operator, near.b, near.static, near.kinetic, near.touch, near.slide, near.p, near.w,
            self.scratch, 0.0, 0,
        )  # fmt: skip
        if explicit:
            calls: Any = _ExplicitCalls(by_address(explicit_kernels.joint_masses, A, S, W), friction)
            run = entry(explicit_kernels.explicit_run, A, S, state, P, 0.0, pulls, factors, calls, *rooms)
            self.run = lambda h, after, pulls, factors: run(A, S, state, P, h, pulls, factors, calls, *rooms)
            return
        within = _StepCalls(by_address(kernels.factorise, A, S, 0.0, 0.0, row, W), friction)
        sizes = (self.arm, self.settings.tolerance, _MOST_ITERATIONS)
        step = by_address(
            kernels.try_step, A, S, state, P, 0.0, 0.0, 0.0, row, row, *sizes, True, within, W, self.scratch
        )
        made = by_address(accept, A, S, state, 0.0, 0.0, row, W, self.book, self.tally)
        limits = (*sizes, _ImplicitCalls(step, within, made))
        allowed, divided = self.settings.largest_error, self.settings.division
        if allowed is not None:
            weight, located = float(self.settings.dissipation), (divided - 1).bit_length()
            run = entry(
                adaptive_kernels.adaptive_run, A, S, state, P, 0.0, weight, located, allowed, pulls, factors, *limits,
                *rooms,
            )  # fmt: skip
            self.run = lambda h, after, pulls, factors: run(
                A, S, state, P, h, weight, located, allowed, pulls, factors, *limits, *rooms
            )
            return
        theta = self.settings.theta
        run = entry(implicit_run, A, S, state, P, 0.0, 0.0, 0.0, divided, 0.0, pulls, factors, *limits, *rooms)
        self.run = lambda h, after, pulls, factors: run(
            A, S, state, P, h, theta(h), theta(h / divided), divided, after, pulls, factors, *limits, *rooms
        )

    @property
    def time(self) -> float:
        """Reached [s]."""
        return self.origin + self.n_steps * self.step

    def _tables(self, times: Array) -> tuple[Array, Array]:
        """What drive adds to tensions (s, k) and load factors (s, l) at times; refuses what is not a number."""
        drive = np.array([self.drive(float(t)) for t in times], dtype=float)
        bad = np.flatnonzero(~(np.isfinite(drive) & (drive >= -1e-9)))
        if len(bad):
            t = times[bad[0]]
            raise ModelError(f"dynamics: drive: found {drive[bad[0]]} at {t:g} s, expected a number of at least 0")
        factors = np.ones((len(times), len(self.model.built.histories)))
        for column, history in enumerate(self.model.built.histories):
            if history is not None:
                factors[:, column] = [history(float(t)) for t in times]
        if not np.isfinite(factors).all():
            t = times[np.flatnonzero(~np.isfinite(factors).all(axis=1))[0]]
            raise ModelError(f"dynamics: history of a load: not a finite number at {t:g} s, expected one at every time")
        return drive[:, None] * self.pull_by, factors

    def go(self, count: int) -> None:
        """`count` steps; one that fails is halved as often as it takes, where the step does not adapt by itself."""
        self.tally[:] = 0.0
        self.since = count * self.step
        left = count
        while left:
            made = self._advance(self.time + self.step * np.arange(left + 1, dtype=float), self.step)
            self.n_steps += made
            left -= made
            if left:
                if self.settings.largest_error is not None:
                    part = self.step / 2**adaptive_kernels.FINEST
                    self._fail(self.time + self.reached * self.step, part, _OUTCOMES[self.outcome])
                self._halved(self.time, self.step, self.step, 1)
                self.n_steps += 1
                left -= 1

    def _advance(self, times: Array, h: float, after: float | None = None) -> int:
        """Steps of length `h` between the times, as many as succeed; one of length `after`, or as long, follows."""
        pulls, factors = self._tables(times)
        made, self.outcome, *work = self.run(h, after or h, pulls, factors)
        if self.settings.integrator is Integrator.implicit:
            iterations, factorisations, residual, *work = work
            if self.settings.largest_error is None:
                (divided,) = work
            else:
                undone, divided, self.reached = work
                self.halved += undone
            self.iterations += iterations
            self.factorisations += factorisations
            self.divided += divided
        else:
            residual = work[0]
        self.worst = max(self.worst, residual)
        return made

    def _halved(self, time: float, h: float, after: float, depth: int) -> None:
        """One step, before one of length `after`, in two halves, each halved again if it fails."""
        self.halved += 1
        for half in range(2):
            begin = time + half * h / 2
            following = after if half else h / 2
            if self._advance(np.array([begin, begin + h / 2]), h / 2, following) == 1:
                continue
            if depth == _HALVINGS:
                self._fail(begin, h / 2, _OUTCOMES[self.outcome])
            self._halved(begin, h / 2, following, depth + 1)

    def _fail(self, time: float, h: float, reason: str) -> None:
        raise SolveError(
            f"dynamics: at {time:.6g} s a step of {h:.3g} s fails: {reason}", best=self.motion(), reason=reason
        )

    def sample(self) -> None:
        """Keep what there is now."""
        s = self.state
        self.samples.append(
            {
                "times": self.time,
                "x": s.x.copy(),
                "Q": s.Q.copy(),
                "v": s.v.copy(),
                "contact_force": self.tally[: self.points, :3] / self.since,
                "touch": s.touch[: self.points].copy(),
                "slip_share": self.tally[: self.points, 3] / self.since,
                "contact_share": self.tally[: self.points, 4] / self.since,
                "touch_force": self.tally[self.points :, :3] / self.since,
                "book": self.book.copy(),
                "drive": float(self.drive(self.time)),
            }
        )
        final = Checkpoint(copied(s), self.book.copy(), self.time, self.n_steps, self.step, self.origin)
        counts = (self.iterations, self.factorisations, self.halved, self.divided, self.worst)
        self.kept = _Kept(len(self.samples), final, *counts)

    def motion(self) -> Motion:
        """Up to the last sample."""
        kept = self.kept
        columns: dict[str, Any] = {
            key: np.array([s[key] for s in self.samples[: kept.samples]]) for key in self.samples[0]
        }
        return Motion(
            self.model,
            self.ground,
            **columns,
            steps=kept.final.steps - self.n_first,
            iterations=kept.iterations,
            factorisations=kept.factorisations,
            halved=kept.halved,
            divided=kept.divided,
            largest_residual=kept.worst,
            final=kept.final,
        )
