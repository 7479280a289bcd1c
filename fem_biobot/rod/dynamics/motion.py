"""What the time integrators return: a sampled motion, and the checkpoint from which it goes on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.dynamics.arrays import BOOK, State
from fem_biobot.rod.ground import Ground
from fem_biobot.rod.model import RodModel, RodState

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Everything from which a motion goes on as if it had not stopped, to the last bit.

    Attributes
    ----------
    state, book
        Arrays of the integrators, and the energy book.
    time
        [s]
    steps, step, begin
        The last run with one step made so many of this length [s] since this time [s], so that times repeat exactly.
    """

    state: State
    book: Array
    time: float
    steps: int = 0
    step: float = 0.0
    begin: float = 0.0

    def arrays(self) -> dict[str, Array]:
        """For a file."""
        named = {f"state_{k}": v for k, v in self.state._asdict().items()}
        numbers = {k: np.array(getattr(self, k)) for k in ("time", "steps", "step", "begin")}
        return {**named, "book": self.book, **numbers}

    @classmethod
    def from_arrays(cls, arrays: Any) -> Checkpoint:
        """From what `arrays` gave, or an open npz file of it."""
        state = State(**{k: np.array(arrays[f"state_{k}"]) for k in State._fields})
        times = {k: float(arrays[k]) for k in ("time", "step", "begin")}
        return cls(state, np.array(arrays["book"]), steps=int(arrays["steps"]), **times)


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
        How the corners of one rigid foot share its force is not determined by mechanics; their sum is.
    touch
        Of each point at the sample: `LIFTED`, `STICK` or `SLIP` of `friction.kernels`, (s, c).
    slip_share, contact_share
        Share of the time since the sample before in which a point slipped, or bore a force, (s, c) [1].
    touch_force
        Mean force between the surfaces of each touching node and what it touches since the last sample: normal, along
        the other part's axis, and across both, (s, t, 3) [mN]. The order is that of the model's touches.
    book
        Energies at the samples, (s, 11) [uJ]; columns are `BOOK`.
    drive
        Of the muscles, (s,) [1].
    steps, iterations, factorisations, halved, divided
        How much work it was, how many steps had to be halved, and how many were divided because contact changed. Where
        the step adapts: how many tries were undone and made again in halves, and how many steps were made in parts.
    largest_residual
        Of the steps accepted, relative: of momentum for implicit steps (as `Settings.tolerance`), of the contact
        problem for explicit ones.
    final
        Where the last sample is, to go on from.
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
    touch_force: Array
    book: Array
    drive: Array
    steps: int
    iterations: int
    factorisations: int
    halved: int
    divided: int
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

    @property
    def momentum(self) -> Array:
        """Linear momentum, (s, 3) [kg mm/s]."""
        return np.einsum("n,snc->sc", self.model.assembly.inertia.mass, self.v[..., :3])

    @property
    def angular_momentum(self) -> Array:
        """About the world's origin, (s, 3) [kg mm^2/s]."""
        inertia = self.model.assembly.inertia
        body = np.einsum("nij,snjk,snk->sni", inertia.J, self.Q, self.v[..., 3:])
        spin = np.einsum("snij,sni->snj", self.Q, body)
        orbit = np.cross(self.x, inertia.mass[:, None] * self.v[..., :3])
        return (spin + orbit).sum(axis=1)


class MotionInterrupted(KeyboardInterrupt):
    """The user stopped a run; `best` is the `Motion` up to its last sample."""

    def __init__(self, best: Motion) -> None:
        super().__init__(f"dynamics: interrupted after {best.times[-1]:.6g} s")
        self.best = best
