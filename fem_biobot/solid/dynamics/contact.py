"""The frictional contact problem of a time step, condensed on the contact points with the factor at hand.

With the tangent ``K`` of the step (inertia included) a force ``q`` at the contact points moves them by
``B K^-1 B^T q``, so that velocities over the step are ``w = b + W p`` with impulses ``p = h q`` and
``W = B K^-1 B^T / h^2``: the problem
that `friction.kernels` solves, point by point with static or kinetic friction. The normal velocity is the gap at the
END of the step over h: unilateral on positions. Only points that come near take part; the others are looked at again
with the answer, and taken in where they would be in the ground.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.friction.ground import Ground
from fem_biobot.friction.kernels import LIFTED, STICK, settle, solve_friction
from fem_biobot.friction.scratch import ContactScratch, scratch
from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.feet import Feet
from fem_biobot.solid.linear import Solver
from fem_biobot.solid.space import Ints

TOLERANCE = 1e-12  # residual asked of the contact problem
ACCEPTED = 1e-9  # residual with which a step may be accepted
_ITERATIONS = 150
_NEAR = 2e-3  # of the body's size: gap without contact below which a point takes part at once


class Touch(NamedTuple):
    """What is known of the contact points between steps.

    `force` (c, 3) of the ground on each [mN]: normal, forward, left; `state` LIFTED, STICK or SLIP of
    `friction.kernels`, (c,); `slide` velocity along the ground of those that slip, (c, 2) [mm/s].
    """

    force: Array
    state: Ints
    slide: Array


class Met(NamedTuple):
    """An answer of the contact problem: forces, residual, iterations, and what settles the points' states."""

    force: Array
    residual: float
    iterations: int
    near: Ints
    b: Array
    w: Array
    marked: Ints


def untouched(c: int) -> Touch:
    """Points that carry nothing; they count as sticking, so that a body at rest on the ground does not slip off."""
    return Touch(np.zeros((c, 3)), np.full(c, STICK, dtype=np.int64), np.zeros((c, 2)))


class Contact:
    """The contact problem of one body on one ground; holds the compliance that belongs to the present factor."""

    def __init__(self, body: MovingBody, feet: Feet, ground: Ground) -> None:
        if abs(float(np.dot(ground.axes[0], ground.velocity))) > 1e-9 * float(np.linalg.norm(ground.velocity)):
            raise ModelError(
                f"ground: velocity: found {ground.velocity} with a part along the normal, expected one within the plane"
            )
        self.body, self.feet, self.ground = body, feet, ground
        self.X = np.ascontiguousarray(body.system.space.points.T)
        self.axes = np.ascontiguousarray(ground.axes)
        self.belt = self.axes @ np.asarray(ground.velocity, dtype=float)
        m = len(feet.nodes)
        self._compliance = np.zeros((m, 3, m, 3))  # displacement of a point along an axis by a force on another
        self._known = np.zeros(m, dtype=bool)
        self._room: ContactScratch | None = None

    @property
    def count(self) -> int:
        """Number of contact points."""
        return len(self.feet.nodes)

    def renew(self) -> None:
        """Forget the compliance: the factor has changed."""
        self._known[:] = False

    def learn(self, factor: Solver) -> None:
        """Keep the symmetric part of the compliance of all points until it is asked for again."""
        self.renew()
        self._learn(factor, np.arange(self.count))
        m = 3 * self.count
        whole = self._compliance.reshape(m, m)
        self._compliance = (0.5 * (whole + whole.T)).reshape(self._compliance.shape)

    def moved_by(self, force: Array) -> Array:
        """By how much forces (c, 3) [mN] move the points by the compliance that was learnt, (c, 3) [mm]."""
        return np.einsum("makb,kb->ma", self._compliance, force)

    def positions(self, u: Array) -> Array:
        """Along normal, forward and left, the normal one above the plane, (c, 3) [mm]."""
        x = (self.X[self.feet.nodes] + u[self.feet.nodes]) @ self.axes.T
        x[:, 0] -= self.ground.height
        return x

    def nodal(self, force: Array) -> Array:
        """Nodal forces (n, 3) of forces at the points, (c, 3) [mN]."""
        out = np.zeros_like(self.X)
        out[self.feet.nodes] = force @ self.axes
        return out

    def solve(self, factor: Solver, before: Array, after: Array, h: float, touch: Touch, guess: Array) -> Met:
        """Forces at the points at the end of a step.

        Parameters
        ----------
        factor
            Holds the factor of the step's tangent.
        before, after
            Positions of the points at the beginning of the step, and at its end without the forces asked for, (c, 3).
        h
            Length of the step [s].
        touch
            At its beginning.
        guess
            Forces to begin from, (c, 3) [mN].
        """
        gap = after[:, 0]
        velocity = (after - before) / h - self.belt
        velocity[:, 0] = gap / h
        inside = (gap < _NEAR * self.body.largest) | (guess[:, 0] > 0.0)
        iterations = 0
        force = np.zeros_like(guess)
        while True:  # each round takes in more points
            near = np.flatnonzero(inside)
            if not near.size:
                empty = np.zeros((0, 3))
                return Met(force, 0.0, 0, near, empty, empty, np.zeros(0, dtype=np.int64))
            self._learn(factor, near)
            size = 3 * len(near)
            W = self._compliance[near][:, :, near].reshape(size, size) / h**2
            W = 0.5 * (W + W.T)
            b = np.ascontiguousarray(velocity[near])
            p, w = np.ascontiguousarray(guess[near] * h), np.empty_like(b)
            marked = touch.state[near].copy()
            mu = np.tile(self.ground.static_coefficients, (len(near), 1))
            mu_kinetic = np.tile(self.ground.kinetic_coefficients, (len(near), 1))
            residual, used = solve_friction(
                W, b, mu, mu_kinetic, marked, np.ascontiguousarray(touch.slide[near]), p, w, self._scratch(len(near)),
                TOLERANCE, _ITERATIONS,
            )  # fmt: skip
            iterations += used
            force = np.zeros_like(guess)
            force[near] = p / h
            # where the others come to lie: their gap moves by the forces as well
            moved = gap + np.einsum("cnb,nb->c", self._compliance[:, 0, near], force[near])
            fallen = (moved < 0.0) & ~inside
            if not np.any(fallen):
                return Met(force, residual, iterations, near, b, w, marked)
            inside |= fallen

    def settled(self, met: Met) -> Touch:
        """State of the points after a step that was accepted."""
        state = np.full(self.count, LIFTED, dtype=np.int64)
        slide = np.zeros((self.count, 2))
        if met.near.size:
            near_state, near_slide = met.marked.copy(), np.zeros((len(met.near), 2))
            settle(met.b, met.w, near_state, near_slide, TOLERANCE)
            state[met.near], slide[met.near] = near_state, near_slide
        return Touch(met.force, state, slide)

    def _scratch(self, c: int) -> ContactScratch:
        if self._room is None or len(self._room.held) < c:
            self._room = scratch(c)
        return self._room

    def _learn(self, factor: Solver, points: Ints) -> None:
        """Columns of the compliance for these points."""
        missing = points[~self._known[points]]
        held = self.body.system.held.dofs
        n = len(self.X)
        for part in np.array_split(missing, max(1, -(-len(missing) // 32))):
            if not part.size:
                continue
            right = np.zeros((len(part), 3, n, 3))
            for k, node in enumerate(self.feet.nodes[part]):
                right[k, :, node] = self.axes
            right = right.reshape(3 * len(part), -1)
            right[:, held] = 0.0
            right = np.pad(right, ((0, 0), (0, self.body.system.n_pressures)))
            found = factor.solve(right)[:, : 3 * n].reshape(len(part), 3, n, 3)[:, :, self.feet.nodes]
            self._compliance[:, :, part] = np.einsum("kbmc,ac->makb", found, self.axes)
            self._known[part] = True
