"""Motion of an assembly over time: the driver of both integrators, with step control, sampling and the energy book."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import ModelError, SolveError
from fem_biobot.rod.arrays import Contacts
from fem_biobot.rod.assembly import kernels as assembly_kernels
from fem_biobot.rod.contact.kernels import STICK
from fem_biobot.rod.contact.scratch import scratch
from fem_biobot.rod.dynamics import kernels
from fem_biobot.rod.dynamics.arrays import BOOK, Plane, State, copied, work_for
from fem_biobot.rod.explicit import kernels as explicit_kernels
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.parts.kernels import contact
from fem_biobot.rod.records import Ground

Array = NDArray[np.float64]
Drive = Callable[[float], float]

_MOST_ITERATIONS = 25
_HALVINGS = 12
_OUTCOMES = {
    kernels.SLOW: "Newton's iteration did not end",
    kernels.SINGULAR: "the tangent is singular (a part without mass that nothing holds?)",
    kernels.CONTACT: "the contact problem was not solved",
    kernels.WOUND: "an element turns by more than 3 rad or left the numbers",
}


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion, sampled.

    Attributes
    ----------
    model, ground
        What moved, and on what.
    times
        Of the samples, (s,) [s].
    x, Q, v
        Nodes: positions (s, n, 3) [mm], directors (s, n, 3, 3), velocities (s, n, 6).
    contact_force
        Mean force of the ground on each contact point since the last sample, normal and two tangential, (s, c, 3) [mN].
    touch
        Of each point at the sample: `LIFTED`, `STICK` or `SLIP` of `rod.contact.kernels`, (s, c).
    slip_share, contact_share
        Share of the time since the sample before in which a point slipped, or bore a force, (s, c) [1].
    book
        Energies at the samples, (s, 10) [uJ]; columns are `BOOK`.
    drive
        Of the muscles, (s,) [1].
    steps, iterations, factorisations, halved
        How much work it was, and how many steps had to be halved.
    largest_residual
        Of the steps accepted, relative.
    final
        Where it ended, to go on from.
    """

    model: RodModel
    ground: Ground | None
    times: Array
    x: Array
    Q: Array
    v: Array
    contact_force: Array
    touch: NDArray[np.int64]
    slip_share: Array
    contact_share: Array
    book: Array
    drive: Array
    steps: int
    iterations: int
    factorisations: int
    halved: int
    largest_residual: float
    final: Checkpoint

    def state(self, i: int) -> RodState:
        """The sample `i`."""
        return RodState(
            self.model, self.x[i].copy(), self.Q[i].copy(), self.v[i].copy(), float(self.drive[i]), float(self.times[i])
        )

    def energy(self, name: str) -> Array:
        """A column of the book, (s,) [uJ]."""
        return self.book[:, BOOK.index(name)]

    @property
    def energy_error(self) -> Array:
        """What the book does not explain, (s,) [uJ]: states now less states at first less all sums."""
        stored = self.book[:, :3].sum(axis=1)
        return stored - stored[0] - (self.book[:, 3:] - self.book[0, 3:]).sum(axis=1)

    @property
    def centre_of_mass(self) -> Array:
        """(s, 3) [mm]"""
        mass = self.model.assembly.inertia.mass
        return np.einsum("n,snc->sc", mass, self.x) / mass.sum()


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Everything from which a motion goes on as if it had not stopped."""

    state: State
    book: Array
    time: float
    steps: int = 0

    def arrays(self) -> dict[str, Array]:
        """For a file."""
        named = {f"state_{k}": v for k, v in self.state._asdict().items()}
        return {**named, "book": self.book, "time": np.array(self.time), "steps": np.array(self.steps)}

    @classmethod
    def from_arrays(cls, arrays: dict[str, Any]) -> Checkpoint:
        """From what `arrays` gave."""
        state = State(**{k: np.array(arrays[f"state_{k}"]) for k in State._fields})
        return cls(state, np.array(arrays["book"]), float(arrays["time"]), int(arrays["steps"]))


def plane_of(ground: Ground | None, c: int) -> Plane:
    """Arrays of the ground."""
    g = ground or Ground()
    axes = g.axes
    # slip against `forward` meets the reverse coefficient; sideways the forward one
    return Plane(
        np.ascontiguousarray(axes),
        float(g.height),
        np.array(g.velocity, dtype=float),
        np.tile(g.static_coefficients, (c, 1)),
        np.tile(g.kinetic_coefficients, (c, 1)),
    )


def at_rest(model: RodModel, start: RodState | None, velocity: Array | None = None) -> State:
    """State of the integrators for a start."""
    start = start or model.drawn()
    assembly = model.assembly
    n, c, j = model.n_nodes, len(assembly.contacts.node), len(assembly.constraints.rows)
    strain, lengths = np.zeros((len(assembly.damping), 6)), np.zeros(len(assembly.members.law))
    assembly_kernels.measure(assembly, start.x, start.Q, strain, lengths)
    v = start.v if velocity is None else np.asarray(velocity, dtype=float)
    if v.shape != (n, 6):
        raise ModelError(f"velocity: found shape {v.shape}, expected ({n}, 6)")
    return State(
        np.array(start.x),
        np.array(start.Q),
        np.array(v),
        np.zeros((n, 6)),
        np.zeros((c, 3)),
        np.full(c, STICK, dtype=np.int64),
        np.zeros((c, 2)),
        np.zeros((j, 6)),
        strain,
        lengths,
    )


class Integrator(StrEnum):
    """How time is stepped: see `rod.dynamics.kernels` and `rod.explicit.kernels`."""

    implicit = "implicit"
    explicit = "explicit"


@dataclass(frozen=True)
class Settings:
    """Of the integrators.

    Attributes
    ----------
    integrator
        Implicit for work; explicit as an independent witness, which needs steps below 2 over the highest angular
        frequency of the model.
    dissipation
        Implicit only: c in ``theta = 1/2 + c step`` [1/s]: a mode of angular frequency w loses energy as with the damping ratio
        ``c step^2 w``, on top of its own.
    tolerance
        Implicit only: unbalanced impulse relative to the largest that acts [1].
    """

    integrator: Integrator = Integrator.implicit
    dissipation: float = 20.0
    tolerance: float = 1e-9

    def theta(self, step: float) -> float:
        """Weight of the end of the step [1]."""
        return min(0.5 + self.dissipation * step, 1.0)


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
    """Motion of an assembly from a start, by implicit time steps.

    Parameters
    ----------
    model
        What moves.
    duration, step
        [s]. The last step is as long as the others; `duration` is rounded to a whole number of them.
    ground
        None for no ground: contact points are then ignored.
    drive
        Drive of the muscles over time [1]; none by default.
    start
        State to begin from (velocities included), or the checkpoint of another motion; by default as drawn, at rest.
    sample_every
        Steps between samples.
    settings
        Of the integrator.
    listener
        Told the time reached after each sample [s].

    Returns
    -------
    Motion
        Samples at ``0, sample_every * step, ...``.

    Raises
    ------
    ModelError
        Times that are not positive, a start inside the ground.
    SolveError
        A step that fails after being halved twelve times; `best` is the `Motion` up to there.

    Notes
    -----
    Order two in smooth motion and one across impacts and changes of stick and slip (see `rod.dynamics.kernels`). A step
    that does not converge is halved, never accepted. Bodies without rotation about an axis keep their angular momentum
    up to terms of the third order a step.
    """
    if not (np.isfinite(duration) and duration > 0.0) or not (np.isfinite(step) and step > 0.0):
        raise ModelError(f"dynamics: found duration {duration!r} and step {step!r}, expected times above 0 s")
    if sample_every < 1:
        raise ModelError(f"dynamics: found sample_every {sample_every!r}, expected a whole number of at least 1")
    run = _Run(model, ground, drive or (lambda t: 0.0), settings or Settings(), step)
    run.begin(start)
    total = max(1, round(duration / step))
    done = 0
    while done < total:
        count = min(sample_every, total - done)
        run.go(count)
        done += count
        run.sample()
        if listener is not None:
            listener(run.time)
    return run.motion()


@dataclass
class _Run:
    """An integration under way."""

    model: RodModel
    ground: Ground | None
    drive: Drive
    settings: Settings
    step: float
    samples: list[dict[str, Any]] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("iterations", "factorisations", "halved"), 0))
    worst: float = 0.0

    def begin(self, start: RodState | Checkpoint | None) -> None:
        model = self.model
        self.assembly = model.assembly
        if self.ground is None and len(self.assembly.contacts.node):
            no_points: list[Any] = [np.ascontiguousarray(a[:0]) for a in self.assembly.contacts]
            self.assembly = self.assembly._replace(contacts=Contacts(*no_points))
        system = model.system
        if self.ground is None:
            system = system._replace(touching=system.touching[:0].copy(), foot=system.foot[:0].copy())
        self.system = system
        c = len(self.assembly.contacts.node)
        self.plane = plane_of(self.ground, c)
        if isinstance(start, Checkpoint):
            self.state = copied(start.state)
            self.book, self.first, self.n_steps = start.book.copy(), start.time, start.steps
        else:
            made = at_rest(model, start)
            self.state = made._replace(
                impulse=made.impulse[:c].copy(), touch=made.touch[:c].copy(), slide=made.slide[:c].copy()
            )
            self.book, self.first, self.n_steps = np.zeros(len(BOOK)), 0.0, 0
            self._refuse_start_inside()
            self._enter_start()
        self._refuse_massless()
        self.origin = self.n_steps
        self.work = work_for(self.state, system.n_blocks, len(system.touching))
        self.scratch = scratch(c)
        self.tally = np.zeros((c, 5))
        lengths = self.assembly.elements.length
        span = np.ptp(self.model.built.x, axis=0)
        self.arm = float(lengths.mean()) if len(lengths) else max(float(np.linalg.norm(span)), 1.0)
        self.since = 1.0
        self.sample()

    @property
    def time(self) -> float:
        return self.first + (self.n_steps - self.origin) * self.step

    def _refuse_start_inside(self) -> None:
        contacts, size = self.assembly.contacts, 1.0 + float(np.abs(self.state.x).max())
        rows = np.zeros((3, 6))
        for k in range(len(contacts.node)):
            gap = contact(contacts, k, self.state.x, self.state.Q, self.plane.axes, self.plane.height, rows)
            if gap < -1e-6 * size:
                raise ModelError(
                    f"start: contact point {k} lies {-gap:.3g} mm inside the ground, expected on or above it "
                    "(lower the ground or lift the machine)"
                )

    def _refuse_massless(self) -> None:
        inertia = self.assembly.inertia
        free = inertia.held == 0
        if self.settings.integrator is Integrator.explicit and free.any():
            least = np.minimum(inertia.mass, np.linalg.eigvalsh(inertia.J)[:, 0])[free].min()
            if not least > 0.0:
                raise ModelError("dynamics: a part has no mass or no inertia, expected some for explicit steps")

    def _enter_start(self) -> None:
        state = RodState(self.model, self.state.x, self.state.Q, self.state.v)
        elastic, weight = assembly_kernels.energies(self.assembly, self.state.x, self.state.strain, self.state.lengths)
        self.book[:3] = state.kinetic_energy, elastic, weight

    def go(self, count: int) -> None:
        """`count` steps; a failing one is halved as often as it takes."""
        self.tally[:] = 0.0
        self.since = count * self.step
        left = count
        while left:
            times = self.time + self.step * np.arange(left + 1, dtype=float)
            made = self._advance(times, self.step)
            self.n_steps += made
            left -= made
            if left:
                self._halved(self.time, self.step, 1)
                self.n_steps += 1
                left -= 1

    def _advance(self, times: Array, h: float) -> int:
        pulls = np.array([self.model.pull(self.drive(t)) for t in times])
        factors = np.array([self.model.load_factors(t) for t in times])
        pulls, factors = pulls.reshape(len(times), -1), factors.reshape(len(times), -1)
        if self.settings.integrator is Integrator.explicit:
            made, self.outcome, residual = explicit_kernels.explicit_run(
                self.assembly, self.system, self.state, self.plane, h, pulls, factors,
                self.work, self.scratch, self.book, self.tally,
            )  # fmt: skip
            self.worst = max(self.worst, residual)
            return made
        made, self.outcome, iterations, factorisations, residual = kernels.implicit_run(
            self.assembly, self.system, self.state, self.plane, h, self.settings.theta(h), pulls, factors,
            self.arm, self.settings.tolerance, _MOST_ITERATIONS, self.work, self.scratch, self.book, self.tally,
        )  # fmt: skip
        self.counts["iterations"] += iterations
        self.counts["factorisations"] += factorisations
        if self.outcome == kernels.CONVERGED:
            self.worst = max(self.worst, residual)
        return made

    def _halved(self, time: float, h: float, depth: int) -> None:
        """One step in two halves, each halved again if it fails."""
        self.counts["halved"] += 1
        for half in range(2):
            begin = time + half * h / 2
            if self._advance(np.array([begin, begin + h / 2]), h / 2) == 1:
                continue
            if depth == _HALVINGS:
                raise SolveError(
                    f"dynamics: at {begin:.6g} s a step of {h / 2:.3g} s fails: {_OUTCOMES[self.outcome]}",
                    best=self.motion(),
                    reason=_OUTCOMES[self.outcome],
                )
            self._halved(begin, h / 2, depth + 1)

    def sample(self) -> None:
        s = self.state
        self.samples.append(
            {
                "times": self.time,
                "x": s.x.copy(),
                "Q": s.Q.copy(),
                "v": s.v.copy(),
                "contact_force": self.tally[:, :3] / self.since,
                "touch": s.touch.copy(),
                "slip_share": self.tally[:, 3] / self.since,
                "contact_share": self.tally[:, 4] / self.since,
                "book": self.book.copy(),
                "drive": float(self.drive(self.time)),
            }
        )

    def motion(self) -> Motion:
        columns: dict[str, Any] = {key: np.array([s[key] for s in self.samples]) for key in self.samples[0]}
        end = Checkpoint(copied(self.state), self.book.copy(), self.time, self.n_steps)
        return Motion(
            self.model,
            self.ground,
            **columns,
            steps=self.n_steps - self.origin,
            iterations=self.counts["iterations"],
            factorisations=self.counts["factorisations"],
            halved=self.counts["halved"],
            largest_residual=self.worst,
            final=end,
        )
