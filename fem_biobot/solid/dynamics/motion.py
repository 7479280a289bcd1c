"""What the solid's time integrators return: a sampled motion, and the checkpoint from which it goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fem_biobot.friction.ground import Ground
from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.book import BOOK, unexplained
from fem_biobot.solid.dynamics.contact import Touch
from fem_biobot.solid.dynamics.feet import Feet
from fem_biobot.solid.dynamics.step import State
from fem_biobot.solid.interface.state import Touch as Between
from fem_biobot.solid.model import SolidState
from fem_biobot.solid.records import Step
from fem_biobot.solid.space import Ints


@dataclass(frozen=True, eq=False)
class SolidCheckpoint:
    """Everything from which a motion goes on.

    Attributes
    ----------
    state, book
        Of the body, and of the energies.
    time
        [s]
    """

    state: State
    book: Array
    time: float

    def arrays(self) -> dict[str, Array]:
        """For a file."""
        s = self.state
        named = {"u": s.u, "v": s.v, "change": s.change, **s.touch._asdict()}
        named["p"] = s.p
        if s.between is not None:
            named |= {f"between_{k}": v for k, v in s.between._asdict().items()}
        return {**named, "book": self.book, "time": np.array(self.time)}

    @classmethod
    def from_arrays(cls, arrays: Any) -> SolidCheckpoint:
        """From what `arrays` gave, or an open npz file of it."""
        touch = Touch(*(np.array(arrays[k]) for k in Touch._fields))
        u, v, change, p = (np.array(arrays[k]) for k in ("u", "v", "change", "p"))
        between = None
        if "between_state" in arrays:
            between = Between(*(np.array(arrays[f"between_{k}"]) for k in Between._fields))
        state = State(u, v, change, touch, p, between)
        return cls(state, np.array(arrays["book"]), float(arrays["time"]))


@dataclass(frozen=True, eq=False)
class SolidMotion:
    """A motion of a solid, sampled.

    Attributes
    ----------
    body, ground, feet
        What moved, on what, and where it may touch; None without a ground.
    times
        Of the samples, (s,) [s].
    u
        Displacement of the nodes, vertices first, (s, 3, n) [mm].
    v
        Their velocity, (s, 3, n) [mm/s], where a muscle's tension depends on it; else (s, 3, 0).
    p
        Pressures of the mixed form, (s, m) [kPa].
    momentum, angular_momentum
        Linear, and about the world's origin, (s, 3) [kg mm/s, kg mm^2/s].
    contact_force
        Mean force of the ground on each contact point since the last sample: normal, forward, left, (s, c, 3) [mN].
        How the points of a facet share it is not unique; their sum is, and `pressure` is.
    touch
        LIFTED, STICK or SLIP of `friction.kernels` at the sample, (s, c).
    slip_share, contact_share
        Share of the time since the last sample in which a point slipped, or bore a force, (s, c) [1].
    book
        Energies at the samples, (s, 13) [uJ]; columns are `solid.dynamics.book.BOOK`.
    drive
        What drove it at each sample.
    between
        Of parts that slide on each other at each sample; none where all is bonded.
    steps, iterations, factorisations, halved
        Work: steps made, Newton iterations, factorisations, steps that had to be halved.
    largest_residual
        Of the steps accepted, over the size of the forces [1].
    final
        Where the last sample is, to go on from.
    """

    body: MovingBody
    ground: Ground | None
    feet: Feet | None
    times: Array
    u: Array
    v: Array
    p: Array
    momentum: Array
    angular_momentum: Array
    contact_force: Array
    touch: Ints
    slip_share: Array
    contact_share: Array
    book: Array
    drive: tuple[Step, ...]
    steps: int
    iterations: int
    factorisations: int
    halved: int
    largest_residual: float
    final: SolidCheckpoint
    between: tuple[Between, ...] = ()

    def state(self, i: int) -> SolidState:
        """The sample `i`, whose stress is that of its laws and muscles (without viscosity)."""
        between = self.between[i] if self.between else None
        moving = self.v[i] if self.v.shape[-1] else None
        return SolidState(self.body.model, self.drive[i], self.u[i], velocity=moving, pressure=self.p[i], touch=between)

    def energy(self, name: str) -> Array:
        """A column of the book, (s,) [uJ]."""
        return self.book[:, BOOK.index(name)]

    @property
    def energy_error(self) -> Array:
        """What the book does not explain, (s,) [uJ]."""
        return unexplained(self.book)

    @property
    def centre_of_mass(self) -> Array:
        """(s, 3) [mm]"""
        X, mass = self.body.system.space.points, self.body.node_mass
        return (X @ mass + self.u @ mass) / mass.sum()

    def foot_force(self, foot: int) -> Array:
        """Mean force of the ground on a foot since the last sample: normal, forward, left, (s, 3) [mN]."""
        assert self.feet is not None
        return self.contact_force[:, self.feet.owner == foot].sum(axis=1)


def joined(motions: Sequence[SolidMotion]) -> SolidMotion:
    """Motions that each begin where the one before ended, as one; counts are added, the worst residual kept."""
    values: dict[str, Any] = {}
    for each in fields(SolidMotion):
        parts = [getattr(motion, each.name) for motion in motions]
        if isinstance(parts[0], np.ndarray):
            values[each.name] = np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
        elif isinstance(parts[0], tuple):
            values[each.name] = parts[0] + sum((part[1:] for part in parts[1:]), ())
        elif isinstance(parts[0], int):
            values[each.name] = sum(parts)
        elif isinstance(parts[0], float):
            values[each.name] = max(parts)
        else:
            values[each.name] = parts[-1] if each.name == "final" else parts[0]
    return SolidMotion(**values)


class SolidMotionInterrupted(KeyboardInterrupt):
    """The user stopped a motion; `best` is the `SolidMotion` up to its last sample."""

    def __init__(self, best: SolidMotion) -> None:
        super().__init__(f"solid_dynamics: interrupted after {best.times[-1]:.6g} s")
        self.best = best
