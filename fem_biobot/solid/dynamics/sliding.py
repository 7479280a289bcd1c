"""One time step of a body whose parts slide on each other: momentum, ground and Coulomb's law between parts together.

Displacements and tractions between the parts are unknowns of one matrix, that of `solid.interface.saddle` with inertia
and viscosity added. The ground's problem is condensed with it, about the forces of the iteration before: its solver
wants a symmetric compliance, which that of friction between parts is not, and where the forces no longer change it
does not matter which it was. Tractions act at the end of a step and oppose the slip within it. Both surfaces move by
backward Euler like soles on the ground, whatever the scheme: parts that meet neither bounce nor chatter. A change that
makes nothing better is shortened; what still does not end is left to shorter steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.contact import ACCEPTED, Contact, Met
from fem_biobot.solid.dynamics.settings import DynamicsSettings
from fem_biobot.solid.dynamics.step import At, BetweenForces, Interval, Made, State, Stepper
from fem_biobot.solid.interface.saddle import Saddle
from fem_biobot.solid.interface.state import LIFTED
from fem_biobot.solid.interface.touch import Pairing, Terms
from fem_biobot.solid.space import Ints
from fem_biobot.solid.step_failed import StepFailedError, Why
from fem_biobot.solid.system import InvertedError

# gaps, slips and places on the ground are met up to this, relative to the body's size
_MISSED = 1e-10
# searches for opposite points in a step
_PAIRINGS = 8
# how often a change is halved that makes nothing better than the worst of the last iterations, and how many these are
_SHORTENED, _MEMORY = 4, 2
# iterations in which what is missed has to fall by half, or the step is given up
_PATIENCE = 10
# the ground learns its compliance anew where an iteration misses it by more than this share of the one before
_SLOW = 0.2


class _Trial(NamedTuple):
    """Where an iteration stands: as in bonded bodies, then what is between the parts.

    `miss` (c, 3) [mm], `slope` (c, 3, 3) and `sticks` (c,) say how Coulomb's law is missed there, `off` how far all is
    from being solved [1].
    """

    at: At
    traction: Array
    pairing: Pairing
    terms: Terms
    miss: Array
    slope: Array
    states: Ints
    off: float

    @property
    def missed(self) -> float:
        """Largest miss [mm]."""
        return float(np.abs(self.miss).max(initial=0.0))


class _Change(NamedTuple):
    """A change of displacement and tractions, with the forces of the ground before and after it, (c, 3) [mN]."""

    u: Array
    traction: Array
    before: Array
    after: Array


class _Footing:
    """What a step knows of the ground: positions where it begins, forces, the latest answer, by how much it missed."""

    def __init__(self, contact: Contact | None, state: State, h: float) -> None:
        self.contact, self.touch, self.h = contact, state.touch, h
        self.before = np.zeros((0, 3)) if contact is None else contact.positions(state.u)
        self.force = state.touch.force
        self.met: Met | None = None
        self.missed = np.inf if contact is not None else 0.0

    @property
    def solved(self) -> bool:
        """Whether the ground's law holds in the latest answer."""
        return self.contact is None or (self.met is not None and self.met.residual <= ACCEPTED)


class SlidingStepper(Stepper):
    """Makes the steps of one body whose parts slide on each other."""

    def __init__(self, body: MovingBody, contact: Contact | None, settings: DynamicsSettings) -> None:
        super().__init__(body, contact, settings)
        assert body.joint is not None
        self.joint = body.joint
        self._saddle: Saddle | None = None
        self._learnt = False  # whether the ground knows the compliance of steps of this length
        self._stiffness = 0.0  # of a node at the contact, for steps of this length [mN/mm]

    def weights(self, h: float) -> Array:
        """As of bonded bodies, but the end alone counts for the surfaces that slide."""
        found = super().weights(h)
        found[self.joint.nodes] = 1.0
        return found

    def _guesses(self, state: State, interval: Interval) -> tuple[Array, ...]:
        """Where it is: what sticks goes on sticking, which a guessed motion has to find anew."""
        return (state.u,)

    def _iterate(self, state: State, u: Array, interval: Interval) -> Made:
        footing = _Footing(self.contact, state, interval.h)
        now = self._first(state, u, interval, footing)
        sizes: list[float] = []
        last, whole, pairings = None, False, 1
        for iteration in range(self.settings.max_iterations + 1):
            at = now.at
            if not np.isfinite(now.off):
                raise StepFailedError("the residual is not a number", Why.no_number, iteration=iteration)
            if whole and footing.solved and footing.missed <= self._allowed and self._holds(now):
                pairing = self._paired(state, at.u, now.pairing)
                if _same(pairing, now.pairing):
                    made = self._made(state, interval, at, footing.met, iteration, iteration)
                    return self._ended(made, now)
                if pairings == _PAIRINGS:
                    text = f"contact points found other facets opposite to them {_PAIRINGS} times"
                    raise StepFailedError(text, Why.iterations, iteration=iteration)
                pairings += 1
                now = self._trial(state, at.u, interval, now.traction, pairing, at.pushed)
                sizes = []
            sizes.append(now.off)
            stuck = len(sizes) > _PATIENCE and min(sizes[-_PATIENCE:]) > 0.5 * min(sizes[:-_PATIENCE])
            if stuck or iteration == self.settings.max_iterations:
                break
            change = self._change(now, last, interval, footing)
            last = now
            now, share = self._moved(state, now, change, interval, max(sizes[-_MEMORY:]))
            footing.force, whole = change.before + share * (change.after - change.before), share == 1.0
        raise self._failed(now, footing)

    @property
    def _allowed(self) -> float:
        """How far gaps, slips and places may be missed [mm]."""
        return _MISSED * self.joint.size

    def _holds(self, now: _Trial) -> bool:
        """Whether momentum balances and Coulomb's law between the parts holds in a trial, up to the tolerances."""
        at = now.at
        enough = max(self.settings.tolerance * at.forces.scale, self._rounding(at.u))
        return at.norm <= enough and now.missed <= self._allowed

    def _paired(self, state: State, u: Array, now: Pairing | None = None) -> Pairing:
        assert state.between is not None
        return self.joint.contact.paired(u, state.between, now)

    def _first(self, state: State, u: Array, interval: Interval, footing: _Footing) -> _Trial:
        """Where the iteration begins."""
        assert state.between is not None
        traction, pushed = state.between.traction, self._pushed(footing.force)
        if self._length != interval.h:
            forces = self.forces(state, u, interval)
            data = self._tangent(forces, forces.points.S, u, interval)
            self._stiffness, self._length, self._learnt = self.joint.stiffness(data), interval.h, False
        now = self._trial(state, u, interval, traction, self._paired(state, u), pushed)
        if not np.any(now.traction):
            self.joint.guess_stick(now.slope, now.states)
        return now

    def _trial(
        self, state: State, u: Array, interval: Interval, traction: Array, pairing: Pairing, pushed: Array
    ) -> _Trial:
        """Forces at a trial, those between the parts in the unbalanced one; raises `StepFailedError`."""
        system, touching = self.body.system, self.joint.contact
        pairing, lost = touching.moved(u, pairing)
        if lost:
            text = f"{lost} contact points slid off their facets within the step"
            raise StepFailedError(text, Why.diverged)
        traction = np.where(pairing.cover[:, None] > 0.0, traction, 0.0)
        terms = touching.terms(u, traction, pairing)
        forces = self.forces(state, u, interval)
        across, held = system.to_local(terms.force).ravel(), system.held.dofs
        unbalanced = forces.unbalanced - across
        unbalanced[held] = 0.0
        at = At(u, state.p, forces._replace(unbalanced=unbalanced, reaction=forces.reaction - across[held]), pushed)
        miss, slope, states = self.joint.law(terms, traction, pairing, self._stiffness)
        off = max(_share(at), float(np.abs(miss).max(initial=0.0)) / self.joint.element)
        return _Trial(at, traction, pairing, terms, miss, slope, states, off)

    def _change(self, now: _Trial, last: _Trial | None, interval: Interval, footing: _Footing) -> _Change:
        """Newton's change from a trial, with the ground's problem condensed in it."""
        points, none = now.at.forces.points, np.zeros(0)
        S = points.S if last is None else self.body.system.carry(last.at.forces.points, points.F, none)
        saddle, k = self._factored(now, S, interval), self._stiffness
        u, traction = saddle.correction(now.at.forces.unbalanced - now.at.pushed, now.miss, k)
        ground, force = footing.contact, footing.force
        if ground is None:
            return _Change(u, traction, force, force)
        if not self._learnt:
            ground.learn(saddle)
        free = ground.positions(now.at.u + u)
        eased = free - ground.moved_by(force)
        footing.met = met = ground.solve(saddle, footing.before, eased, footing.h, footing.touch, force)
        more = saddle.correction(-self._pushed(met.force - force), np.zeros_like(traction), k)
        u, traction = u + more[0], traction + more[1]
        off = ground.positions(now.at.u + u) - free - ground.moved_by(met.force - force)
        missed, footing.missed = footing.missed, float(np.abs(off).max(initial=0.0))
        self._learnt = footing.missed <= max(self._allowed, _SLOW * missed)
        return _Change(u, traction, force, met.force)

    def _factored(self, now: _Trial, S: Array, interval: Interval) -> Saddle:
        """The factor of displacements and tractions at a trial, with the stress `S` in its geometric part."""
        if self._saddle is None or not self._saddle.fits(now.pairing):
            self._saddle = self.joint.saddle(now.pairing)
        self._saddle.pairing = now.pairing
        data = self._tangent(now.at.forces, S, now.at.u, interval)
        self._saddle.factor(data, now.terms, now.slope, self._stiffness, 0.0)
        return self._saddle

    def _moved(
        self, state: State, now: _Trial, change: _Change, interval: Interval, worst: float
    ) -> tuple[_Trial, float]:
        """The trial after a change, or after a part of it where the whole is worse than `worst`; and that part."""
        best: tuple[_Trial, float] | None = None
        failure: Exception | None = None
        for share in 0.5 ** np.arange(_SHORTENED + 1):
            pushed = self._pushed(change.before + share * (change.after - change.before))
            u, traction = now.at.u + share * change.u, now.traction + share * change.traction
            try:
                there = self._trial(state, u, interval, traction, now.pairing, pushed)
            except (InvertedError, StepFailedError) as error:
                failure = error
                continue
            if not np.isfinite(there.off):
                # it would never be the worse of two
                failure = StepFailedError("the residual is not a number", Why.no_number)
                continue
            if best is None or there.off < best[0].off:
                best = there, float(share)
            if there.off < worst or self._holds(there):
                break
        if best is None:
            assert failure is not None
            raise failure
        return best

    def _ended(self, made: Made, now: _Trial) -> Made:
        """The step with the contact's state at its end; what is lifted carries nothing, not even what is left of it."""
        touching = self.joint.contact
        traction = np.where((now.states == LIFTED)[:, None], 0.0, now.traction)
        touch = touching.touch(traction, now.states, now.terms.gaps, now.pairing)
        pressing = np.where([True, False, False], traction, 0.0)
        normal, both = (touching.terms(now.at.u, t, now.pairing, derive=False).force for t in (pressing, traction))
        return made._replace(state=made.state._replace(between=touch), between=BetweenForces(both - normal, normal))

    def _failed(self, now: _Trial, footing: _Footing) -> StepFailedError:
        if not footing.solved:
            return StepFailedError("the contact problem was not solved", Why.iterations)
        at = now.at
        text = (
            f"no convergence of parts that slide on each other (residual {_share(at):.2g} of the "
            f"forces, contact missed by {now.missed:.2g} mm)"
        )
        return StepFailedError(text, Why.iterations, element=self.body.system.loudest(at.forces.unbalanced - at.pushed))


def _share(at: At) -> float:
    """Norm of the unbalanced forces over their scale, nothing where there are no forces at all [1]."""
    scale = at.forces.scale
    return at.norm / scale if scale else 0.0


def _same(one: Pairing, other: Pairing) -> bool:
    return np.array_equal(one.point, other.point) and np.array_equal(one.facet, other.facet)
