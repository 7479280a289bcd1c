"""Motion of a solid over time: the driver of its integrators, with step control, sampling and the book of energies.

motion = solid_dynamics(
    model, 1.0, 1e-3, densities={"gel": 1.1e-6}, gravity=GRAVITY, ground=Ground(0.5, 0.3), feet=["sole"], free=True
)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.friction.ground import Ground
from fem_biobot.friction.kernels import SLIP
from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.body import MovingBody, moving_body
from fem_biobot.solid.dynamics.book import begun, entered
from fem_biobot.solid.dynamics.contact import Contact, untouched
from fem_biobot.solid.dynamics.drag import SurfaceDrag
from fem_biobot.solid.dynamics.feet import Feet, feet_of
from fem_biobot.solid.dynamics.motion import SolidCheckpoint, SolidMotion, SolidMotionInterrupted
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.dynamics.sliding import SlidingStepper
from fem_biobot.solid.dynamics.step import Interval, State, Stepper
from fem_biobot.solid.interface.state import Touch
from fem_biobot.solid.model import SolidModel, SolidState, checked_step
from fem_biobot.solid.records import Step, numbers
from fem_biobot.solid.step_failed import StepFailedError

# what drives a body at an instant [s]: a step of the model, or a factor on the tension of all muscles
Drive = Callable[[float], Step | float]

_BEGINS = 1e-3  # of a step, over which the velocity of supports is taken where they set out
_INSIDE = 1e-6  # of the body's size, that rounding may put a start into the ground


def solid_dynamics(
    model: SolidModel | MovingBody,
    duration: float,
    step: float = 1e-3,
    *,
    densities: Mapping[str, float] | None = None,
    gravity: Sequence[float] = (0.0, 0.0, 0.0),
    medium_density: float = 0.0,
    damping_time: float = 0.0,
    free: bool = False,
    drag: SurfaceDrag | None = None,
    ground: Ground | None = None,
    feet: Sequence[str] | Feet = (),
    drive: Drive | None = None,
    start: SolidState | SolidCheckpoint | None = None,
    velocity: Any = None,
    sample_every: int = 1,
    settings: DynamicsSettings | None = None,
    listener: Callable[[float], None] | None = None,
) -> SolidMotion:
    """Motion of a solid from a start.

    Parameters
    ----------
    model
        What moves; a `MovingBody` has its densities, gravity, damping and supports already.
    duration, step
        [s]. The last step is as long as the others; `duration` is rounded to a whole number of them.
    densities, gravity, medium_density, damping_time, free, drag
        See `moving_body`.
    ground, feet
        A plane with friction, and the surfaces, or the points of them, that it stops; none by default.
    drive
        What drives the body at an instant: a `Step`, or a factor on the tension of all muscles under its whole load.
        By default the whole load without tension.
    start
        A state of the model at rest at time 0, or the checkpoint of another motion, whose time goes on; by default the
        undeformed body.
    velocity
        With a state: velocity of its nodes, (3, n), or of all of them, (3,) [mm/s]; supports have their own.
    sample_every
        Steps between samples.
    settings
        Of the integrator.
    listener
        Told the time reached after each sample [s].

    Returns
    -------
    SolidMotion
        Samples at ``0, sample_every * step, ...`` and at the end.

    Raises
    ------
    ModelError
        Times that are not positive, no densities, a ground without feet, a ground, a mixed form or parts that slide
        under ``energy_momentum``, a start that does not fit or lies in the ground.
    SolveError
        A step that fails after being halved; `best` is the `SolidMotion` up to the last sample.
    SolidMotionInterrupted
        A `KeyboardInterrupt` with the same `best`.

    Notes
    -----
    Of which order: see `Scheme`. A step that does not converge is halved, never accepted. Tension per current area and
    pressures on open surfaces move with the symmetric part of their tangent; passive laws have an energy. Pressures of
    the mixed form have no mass: they act, and change of volume is met, where the stress is taken.
    """
    for what, value in (("duration", duration), ("step", step)):
        good = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
        if not good or not np.isfinite(value) or not value > 0.0:
            raise ModelError(f"solid_dynamics: {what}: found {value!r}, expected a time above 0 s")
    if step > duration * (1.0 + 1e-9):
        raise ModelError(f"solid_dynamics: step: found {step:g} s, expected at most the duration ({duration:g} s)")
    if not isinstance(sample_every, int | np.integer) or sample_every < 1:
        raise ModelError(
            f"solid_dynamics: sample_every: found {sample_every!r}, expected a whole number of steps, at least 1"
        )
    if isinstance(model, MovingBody):
        body = model
    else:
        if densities is None:
            raise ModelError("solid_dynamics: densities: found none, expected one for every region [kg/mm^3]")
        body = moving_body(
            model, densities, gravity=gravity, medium_density=medium_density, damping_time=damping_time, free=free,
            drag=drag,
        )  # fmt: skip
    run = _Run(body, ground, feet, drive, settings or DynamicsSettings())
    run.begin(start, velocity, step)
    left = round(duration / step)
    origin, done = run.time, 0
    try:
        while left:
            count = min(int(sample_every), left)
            run.clear()
            for _ in range(count):
                done += 1
                run.go(origin + done * step, step)
            left -= count
            run.sample()
            if listener is not None:
                listener(run.time)
    except KeyboardInterrupt:
        raise SolidMotionInterrupted(run.motion()) from None
    return run.motion()


class _Run:
    """An integration under way."""

    def __init__(
        self,
        body: MovingBody,
        ground: Ground | None,
        feet: Sequence[str] | Feet,
        drive: Drive | None,
        settings: DynamicsSettings,
    ) -> None:
        if ground is not None and settings.scheme is Scheme.energy_momentum:
            raise ModelError(
                f"settings: scheme: found {settings.scheme} on a ground, expected backward_euler or soft_landing, "
                "whose impacts do not bounce"
            )
        if body.joint is not None and settings.scheme is Scheme.energy_momentum:
            raise ModelError(
                f"settings: scheme: found {settings.scheme} with parts that slide on each other, expected "
                "backward_euler or soft_landing, whose parts do not bounce off each other"
            )
        if body.system.mixed is not None and settings.scheme is Scheme.energy_momentum:
            raise ModelError(
                f"settings: scheme: found {settings.scheme} with element {body.model.element}, expected "
                "backward_euler or soft_landing, whose stress is not corrected for its energy"
            )
        self.body, self.ground, self.settings = body, ground, settings
        given = isinstance(feet, Feet)
        self.feet = None if ground is None else feet if given else feet_of(body, feet)
        self.contact = None if ground is None or self.feet is None else Contact(body, self.feet, ground)
        self.stepper = (Stepper if body.joint is None else SlidingStepper)(body, self.contact, settings)
        self._drive = drive or (lambda t: Step(tension=0.0, time=t))
        self.rows: list[dict[str, Any]] = []
        self.work = np.zeros(4, dtype=np.int64)  # steps, iterations, factorisations, halved
        self.worst = 0.0

    def begin(self, start: SolidState | SolidCheckpoint | None, velocity: Any, step: float) -> None:
        """Take over the start of steps of this length [s]; refuses what cannot be."""
        system = self.body.system
        n, c = system.space.n_nodes, 0 if self.contact is None else self.contact.count
        if isinstance(start, SolidCheckpoint):
            kept = start.state
            fits = (kept.u.shape, len(kept.touch.state), len(kept.p)) == ((n, 3), c, system.n_pressures)
            if not fits or not self._fits(kept.between):
                raise ModelError("start: found a checkpoint of another body or ground, expected one of this body")
            self.state, self.book, self.time = start.state, start.book.copy(), start.time
        else:
            u = np.zeros((n, 3)) if start is None else np.ascontiguousarray(start.u.T, dtype=float)
            if u.shape != (n, 3) or not np.isfinite(u).all():
                raise ModelError(f"start: found displacements of shape {u.T.shape}, expected (3, {n}) finite numbers")
            given = np.zeros(3) if velocity is None else numbers(velocity, "velocity", "finite velocities")
            if given.shape not in ((3,), (3, n)):
                raise ModelError(f"velocity: found shape {given.shape}, expected (3,) or (3, {n})")
            v = np.array(np.broadcast_to(given.reshape(3, -1).T, (n, 3)))
            local = self.body.system.to_local(v).copy().reshape(-1)
            local[self.body.system.held.dofs] = self._supports_begin(_BEGINS * step)
            v = self.body.system.to_global(local.reshape(-1, 3))
            p = np.zeros(system.n_pressures)
            if start is not None and start.pressure is not None:
                p = np.array(start.pressure, dtype=float)
            between = None if start is None else start.touch
            if between is None and self.body.joint is not None:
                between = self.body.joint.contact.begun()
            if not self._fits(between):
                raise ModelError("start: found a state of parts that slide otherwise, expected one of this body")
            self.state = State(u, v, np.zeros((n, 3)), untouched(c), p, between)
            self.book, self.time = begun(self.body, u, v, p), 0.0
            if self.contact is not None:
                lowest = self.contact.positions(u)[:, 0]
                if lowest.min() < -_INSIDE * self.body.largest:
                    raise ModelError(
                        f"start: contact point {int(np.argmin(lowest))} lies {-lowest.min():.3g} mm inside the ground, "
                        "expected on or above it (lower the ground or lift the body)"
                    )
        self.clear()
        self.sample()

    def _fits(self, between: Touch | None) -> bool:
        """Whether a state of sliding parts is one of this body's."""
        joint = self.body.joint
        if joint is None or between is None:
            return joint is None and between is None
        return len(between.state) == joint.contact.count

    def _supports_begin(self, dt: float) -> Array:
        """Velocity at which supports set out, (held,) [mm/s]: one-sided difference of order two."""
        held = self.body.system.held
        at = [held.at(self.driven(k * dt)) for k in range(3)]
        return (4.0 * at[1] - 3.0 * at[0] - at[2]) / (2.0 * dt)

    def driven(self, time: float) -> Step:
        """What drives at an instant."""
        found = self._drive(time)
        if not isinstance(found, Step):
            if numbers(found, f"drive at {time:g} s", "a step or a finite factor").ndim:
                raise ModelError(f"drive at {time:g} s: found several numbers, expected a step or one factor")
            found = Step(tension=float(found), time=time)
        return checked_step(self.body.system, found)

    def clear(self) -> None:
        """Begin to sum up for the next sample."""
        c = 0 if self.contact is None else self.contact.count
        self.tally, self.since = np.zeros((c, 5)), 0.0

    def go(self, end: float, h: float, depth: int = 0) -> None:
        """One step that ends at a time; in two halves if it fails."""
        begin = end - h
        interval = Interval(h, self.driven(begin + self.settings.theta(h) * h), self.driven(end))
        try:
            made = self.stepper.make(self.state, interval)
        except StepFailedError as failure:
            self.work[3] += 1
            if depth == self.settings.halvings:
                raise SolveError(
                    f"solid_dynamics: no step of {h:.3g} s at {begin:.6g} s: {failure}; try a shorter step, more "
                    "damping, or a weaker drive",
                    best=self.motion(),
                    reason=str(failure),
                    why=failure.why,
                    element=failure.element,
                ) from None
            self.go(begin + 0.5 * h, 0.5 * h, depth + 1)
            self.go(end, 0.5 * h, depth + 1)
            return
        self.book = entered(self.book, self.stepper, self.contact, self.state, made, interval)
        self.state, self.time = made.state, end
        self.since += h
        self.work[:3] += (1, made.iterations, made.factorisations)
        self.worst = max(self.worst, made.residual)
        touch = made.state.touch
        self.tally[:, :3] += touch.force * h
        self.tally[:, 3] += h * (touch.state == SLIP)
        self.tally[:, 4] += h * (touch.force[:, 0] > 0.0)

    def sample(self) -> None:
        """Keep what there is now."""
        s, body = self.state, self.body
        p = body.momentum_of(s.v)
        x = body.system.space.points.T + s.u
        since = self.since or 1.0
        self.rows.append(
            {
                "times": self.time,
                "u": np.ascontiguousarray(s.u.T),
                "v": np.ascontiguousarray(s.v.T) if body.system.by_rate else np.zeros((3, 0)),
                "p": s.p.copy(),
                "momentum": p.sum(axis=0),
                "angular_momentum": np.cross(x, p).sum(axis=0),
                "contact_force": self.tally[:, :3] / since,
                "touch": s.touch.state.copy(),
                "slip_share": self.tally[:, 3] / since,
                "contact_share": self.tally[:, 4] / since,
                "book": self.book.copy(),
                "drive": self.driven(self.time),
                "between": s.between,
            }
        )
        self.final = SolidCheckpoint(self.state, self.book.copy(), self.time)
        self.kept = (len(self.rows), self.work.copy(), self.worst, self.final)

    def motion(self) -> SolidMotion:
        """Up to the last sample."""
        count, work, worst, final = self.kept
        columns: dict[str, Any] = {key: [row[key] for row in self.rows[:count]] for key in self.rows[0]}
        drive, between = (tuple(columns.pop(name)) for name in ("drive", "between"))
        steps, iterations, factorisations, halved = (int(k) for k in work)
        return SolidMotion(
            self.body, self.ground, self.feet, drive=drive, steps=steps, iterations=iterations,
            factorisations=factorisations, halved=halved, largest_residual=worst, final=final,
            between=() if self.body.joint is None else between,
            **{key: np.array(values) for key, values in columns.items()},
        )  # fmt: skip


def rigid_velocity(model: SolidModel, linear: Sequence[float], spin: Sequence[float], centre: Sequence[float]) -> Array:
    """Velocity of all nodes in a rigid motion, (3, n) [mm/s], for `solid_dynamics`.

    `linear` is that of the reference position `centre` [mm], `spin` the angular velocity [rad/s].
    """
    arm = model.system.space.points - np.asarray(centre, dtype=float)[:, None]
    return np.asarray(linear, dtype=float)[:, None] + np.cross(np.asarray(spin, dtype=float), arm, axisb=0, axisc=0)
