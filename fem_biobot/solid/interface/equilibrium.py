"""One load step of a body whose parts slide on each other: Newton's method on displacements and tractions together.

Coulomb's law stands in the equations as its natural map (Alart and Curnier 1991), which vanishes where the law holds;
semismooth Newton finds equilibrium, contact zone, stick and slip at once. Which points lie opposite to each other is
kept during the iteration, found anew when it has ended, and so on until nothing changes. Tractions at the end of a step
oppose the slip within it (backward Euler).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fem_biobot.material.law import Array, OutsideLawError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.solid.interface.joint import Joint
from fem_biobot.solid.interface.record import Sliding
from fem_biobot.solid.interface.saddle import Saddle
from fem_biobot.solid.interface.state import LIFTED, Touch
from fem_biobot.solid.interface.touch import Pairing, Terms
from fem_biobot.solid.linear import NotPositiveDefiniteError
from fem_biobot.solid.newton import Counts, Equilibrium, NewtonSettings, Observer, Trial
from fem_biobot.solid.records import Step
from fem_biobot.solid.space import Ints
from fem_biobot.solid.step_failed import Iterate, StepFailedError, Why
from fem_biobot.solid.system import InvertedError, Points, System

# gaps and slips are not met better than this, relative to the body's size
_ROUNDING = 1e-14
# steadies iterations in proportion to what is still missed
_CALM = 0.1
# an iteration that misses as much as the one before the last, to this share, goes back and forth across a kink of
# Coulomb's law, such as slip that turns back: half of the way lies nearer to it. Elsewhere it keeps iterations from
# ending that would: only the last pace does it
_CYCLE = 1e-3
# searches for opposite points in a step
_PAIRINGS = 8


class Pace(NamedTuple):
    """How bold an iteration is: by which factor it is steadied less as long as it gets on, and how long it may take.

    `halves` where it goes half of the way once it goes back and forth.
    """

    ease: float
    iterations: int
    halves: bool = False


# each is for steps that those before do not end
_PACES = (Pace(0.3, 30), Pace(1.0, 60), Pace(1.0, 60, halves=True))


class Slide(Joint):
    """Solves steps of one model with a sliding contact."""

    name = "PARDISO or SuperLU, unsymmetric, displacements and tractions"

    def __init__(self, system: System, mesh: BodyMesh, sliding: Sliding) -> None:
        """As a `Joint`."""
        super().__init__(system, mesh, sliding)
        self._saddle: Saddle | None = None

    def find(
        self,
        counts: Counts,
        step: Step,
        trial: Trial,
        last: Equilibrium,
        scale: float,
        settings: NewtonSettings,
        observe: Observer,
    ) -> tuple[Equilibrium, float]:
        """Equilibrium at `step` from a trial, after the state `last`, and the largest force scale met [mN].

        Raises
        ------
        StepFailedError
            No convergence, an inverted element, or a singular matrix.
        """
        before = last.touch if last.touch is not None else self.contact.begun()
        for pace in _PACES[:-1]:
            try:
                return self._find(counts, step, trial, before, scale, settings, observe, pace)
            except StepFailedError:
                continue
        return self._find(counts, step, trial, before, scale, settings, observe, _PACES[-1])

    def _find(
        self,
        counts: Counts,
        step: Step,
        trial: Trial,
        before: Touch,
        scale: float,
        settings: NewtonSettings,
        observe: Observer,
        pace: Pace,
    ) -> tuple[Equilibrium, float]:
        iterate = _Iterate(trial.u.copy(), trial.S, before.traction.copy(), scale)
        pairing = self.contact.paired(iterate.u, before)
        done = 0
        for _ in range(_PAIRINGS):
            found, done = self._newton(iterate, pairing, step, counts, settings, observe, done, pace)
            again = self.contact.paired(found.u, before, found.pairing)
            same = np.array_equal(again.point, pairing.point) and np.array_equal(again.facet, found.pairing.facet)
            pairing = again
            iterate = _Iterate(found.u, found.points.S, found.traction, found.scale)
            if same:
                # what is lifted carries nothing, not even what the iteration has left of it
                traction = np.where((found.state == LIFTED)[:, None], 0.0, found.traction)
                touch = self.contact.touch(traction, found.state, found.gaps, found.pairing)
                share, p = found.residual / found.scale if found.scale else 0.0, np.zeros(0)
                return Equilibrium(step, found.u, p, found.points, found.force, share, done, touch), found.scale
        text = f"contact points found other facets opposite to them {_PAIRINGS} times"
        raise StepFailedError(text, Why.iterations, iteration=done)

    def _newton(
        self,
        begin: _Iterate,
        pairing: Pairing,
        step: Step,
        counts: Counts,
        settings: NewtonSettings,
        observe: Observer,
        done: int,
        pace: Pace,
    ) -> tuple[_Found, int]:
        system, held = self.system, self.system.held
        u, traction, scale = begin.u, begin.traction.copy(), begin.scale
        traction[pairing.cover == 0.0] = 0.0
        points = self._points(u, step, done)
        S_geo = points.S if begin.S is None else begin.S
        lift = held.at(step) - system.to_local(u).ravel()[held.dofs]
        lifting = bool(np.any(np.abs(lift) > 0.0))
        best, before, missed, caution = None, np.inf, np.inf, 1.0 / pace.ease
        norm = worst = np.inf
        free = np.zeros(system.n_dofs)
        self._saddle = None
        for iteration in range(pace.iterations + 1):
            pairing, lost = self.contact.moved(u, pairing)
            if lost:
                raise StepFailedError(
                    f"{lost} contact points slid off their facets within the step", Why.diverged, iteration=done
                )
            terms = self.contact.terms(u, traction, pairing)
            force, magnitude = system.internal_force(points)
            f_ext = system.external_force(u, step)
            free = system.to_local(force - f_ext - terms.force).ravel()
            free[held.dofs] = 0.0
            scale = max(scale, float(np.linalg.norm(magnitude)), float(np.linalg.norm(f_ext)))
            norm = float(np.linalg.norm(free))
            data = system.matrix(points, S_geo, u, step)
            stiffness = self.stiffness(data)
            miss, slope, state = self.law(terms, traction, pairing, stiffness)
            if iteration == 0 and not np.any(traction):
                self.guess_stick(slope, state)
            worst = float(np.abs(miss).max(initial=0.0))
            observe("iteration", {"iteration": done, "residual": norm / scale if scale else 0.0})
            if not np.isfinite(norm) or not np.isfinite(worst):
                raise StepFailedError("the residual is not a number", Why.no_number, iteration=done, best=best)
            best = best if lifting else Iterate(u.copy(), np.zeros(0), norm / scale if scale else 0.0)
            least = 4.0 * system.rounding_force
            if (
                norm <= max(settings.tolerance * scale, least)
                and worst <= max(settings.tolerance, _ROUNDING) * self.size
                and not lifting
            ):
                return _Found(u, traction, points, force, terms.gaps, state, pairing, norm, scale), done
            if iteration == pace.iterations:
                break
            if lifting:
                full = np.zeros(system.n_dofs)
                full[held.dofs] = lift
                free = free + system.product(data, full)
                free[held.dofs] = 0.0
            system.block(data)
            earlier, before, missed = before, missed, max(norm / scale if scale else 0.0, worst / self.element)
            back = pace.halves and abs(missed - earlier) < _CYCLE * earlier
            way = 0.5 if back and not lifting else 1.0
            caution = caution * pace.ease if missed < before else min(1.0, caution / pace.ease**2)
            calm = _CALM * caution * missed
            change, by = self._solved(data, terms, slope, miss, free, pairing, stiffness, calm, done)
            counts.newton += 1
            counts.factorisations += 1
            if lifting:
                local = system.to_local(change).copy()
                local.reshape(-1)[held.dofs] = lift
                change = system.to_global(local)
                lifting = False
            u = u + way * change
            traction = traction + way * by
            done += 1
            F = self.system.deformation_gradient(u)
            S_geo = system.carry(points, F, np.zeros(0))
            points = self._points(u, step, done, F)
        share = norm / scale if scale else 0.0
        text = (
            f"no convergence in {pace.iterations} iterations (residual {share:.2g} of the force scale, contact missed "
            f"by {worst:.2g} mm)"
        )
        raise StepFailedError(text, Why.iterations, element=system.loudest(free), iteration=done, best=best)

    def _solved(
        self,
        data: Array,
        terms: Terms,
        slope: Array,
        miss: Array,
        free: Array,
        pairing: Pairing,
        stiffness: float,
        calm: float,
        done: int,
    ) -> tuple[Array, Array]:
        if self._saddle is None:
            self._saddle = self.saddle(pairing)
        try:
            self._saddle.factor(data, terms, slope, stiffness, calm)
        except NotPositiveDefiniteError:
            raise StepFailedError("the matrix of the step is singular", Why.indefinite, iteration=done) from None
        return self._saddle.correction(free, miss, stiffness)

    def _points(self, u: Array, step: Step, iteration: int, F: Array | None = None) -> Points:
        try:
            return self.system.points(self.system.deformation_gradient(u) if F is None else F, step)
        except InvertedError as error:
            text = f"an element is inverted (det F = {error.J:.3g})"
            raise StepFailedError(text, Why.inverted, element=error.element, iteration=iteration) from None
        except OutsideLawError as error:
            raise StepFailedError(str(error), Why.outside_law, element=error.element, iteration=iteration) from None


class _Iterate(NamedTuple):
    """Where an iteration begins: displacement, stress of the geometric part, tractions, scale."""

    u: Array
    S: Array | None
    traction: Array
    scale: float


class _Found(NamedTuple):
    """Where an iteration ended."""

    u: Array
    traction: Array
    points: Points
    force: Array
    gaps: Array
    state: Ints
    pairing: Pairing
    residual: float
    scale: float
