"""One time step of a solid: Newton's method on the momentum balance at the end of the step, contact condensed in it.

The tangent's factor is kept from iteration to iteration and from step to step, and renewed where convergence slows;
contact forces are solved anew in each iteration, for the motion linearised there, so that what comes out obeys contact
exactly and the momentum balance to the tolerance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fem_biobot.material.force_velocity import Straining
from fem_biobot.material.law import Array, OutsideLawError
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.contact import ACCEPTED, Contact, Met, Touch
from fem_biobot.solid.dynamics.settings import DynamicsSettings, Scheme
from fem_biobot.solid.dynamics.strain import green_lagrange, stress_of, stretch_of
from fem_biobot.solid.interface.state import Touch as Sliding
from fem_biobot.solid.linear import Factorisation, NotPositiveDefiniteError, factorisation
from fem_biobot.solid.records import Step
from fem_biobot.solid.step_failed import StepFailedError, Why
from fem_biobot.solid.system import InvertedError, Points

# iterations that are waited for with an old factor; a new one, with the compliance of the feet, costs more than these
_PATIENCE = 12.0
# the energy correction is left out where the strain changes by less: there it is below rounding
_STILL = 1e-5
# compliance beside that of the pressures, in shear moduli, with which the mixed form's matrix is factored: iterations
# converge the faster the smaller it is, and no pivot vanishes where tissue is incompressible
_STEADY = 1e-6


class State(NamedTuple):
    """Where a body is and how it moves.

    Attributes
    ----------
    u, v
        Displacement and velocity of the nodes, (n, 3) [mm, mm/s].
    change
        Change of `v` in the last step, per time, from which the next is guessed, (n, 3) [mm/s^2].
    touch
        Of the contact points.
    p
        Pressures of the mixed form, (m,) [kPa]; none without.
    between
        Of parts that slide on each other; None where all is bonded.
    """

    u: Array
    v: Array
    change: Array
    touch: Touch
    p: Array
    between: Sliding | None = None


class Interval(NamedTuple):
    """A step to be made.

    Attributes
    ----------
    h
        Its length [s].
    drive
        What drives it where the scheme asks: at its end, or inside it.
    end
        What drives it at its end, where supports prescribe displacements.
    """

    h: float
    drive: Step
    end: Step


class Forces(NamedTuple):
    """What acts in a trial of a step.

    Attributes
    ----------
    points
        Gradient with which stresses act, total stress, moduli and passive energy density at the end of the step.
    passive, viscous
        Parts of the stress, (6, e, q) [kPa]; None where there is no muscle, or no viscosity.
    unbalanced
        Internal plus inertial less external force without contact, in local axes, zero where held, then the volume
        residual of the mixed form, (dofs,) [mN].
    reaction
        What it is where held: the force of the supports, (held,) [mN].
    external
        Of loads and foundations, (n, 3) [mN].
    speed
        Mean velocity of the nodes over the step, (n, 3) [mm/s], at which the medium drags.
    drag
        Of the medium, (n, 3) [mN]; None without.
    scale
        Norm of the summed sizes of forces [mN].
    """

    points: Points
    passive: Array | None
    viscous: Array | None
    unbalanced: Array
    reaction: Array
    external: Array
    speed: Array
    drag: Array | None
    scale: float


class At:
    """Where an iteration stands: displacement, pressures, forces, and what the ground does, (dofs,) [mN]."""

    def __init__(self, u: Array, p: Array, forces: Forces, pushed: Array) -> None:
        self.u, self.p, self.forces, self.pushed = u, p, forces, pushed
        self.norm = float(np.linalg.norm(forces.unbalanced - pushed))


class BetweenForces(NamedTuple):
    """Forces of parts on each other at the end of a step: of their friction, and along their normals, (n, 3) [mN]."""

    rubbing: Array
    pressing: Array


class Made(NamedTuple):
    """A step that converged, and the work it took."""

    state: State
    forces: Forces
    met: Met | None
    residual: float
    iterations: int
    factorisations: int
    between: BetweenForces | None = None


class Stepper:
    """Makes the steps of one body; keeps the factor between them."""

    def __init__(self, body: MovingBody, contact: Contact | None, settings: DynamicsSettings) -> None:
        self.body, self.contact, self.settings = body, contact, settings
        self.factor: Factorisation = factorisation(body.system.pattern)
        self._length = 0.0  # of the step that the factor belongs to
        self._massive: tuple[float, Array] | None = None  # inertial part of the tangent for a step's length
        self._begun: tuple[Array, Array, Array] | None = None  # displacement, gradient and strain where a step begins

    def beginning(self, u: Array) -> tuple[Array, Array]:
        """Gradient and strain at the displacement where a step begins."""
        if self._begun is None or self._begun[0] is not u:
            F = self.body.system.deformation_gradient(u)
            self._begun = (u, F, green_lagrange(F))
        return self._begun[1:]

    def weights(self, h: float) -> Array:
        """Weight of the end of a step in the motion of each node, (n, 1) [1]."""
        found = np.full((self.body.system.space.n_nodes, 1), self.settings.theta(h))
        if self.contact is not None:
            found[self.contact.feet.nodes] = 1.0
        return found

    def velocity(self, state: State, u: Array, h: float) -> Array:
        """Velocity at the end of a step to the displacement `u`, (n, 3) [mm/s]."""
        theta = self.weights(h)
        return ((u - state.u) / h - (1.0 - theta) * state.v) / theta

    def forces(self, state: State, u: Array, interval: Interval, p: Array | None = None) -> Forces:
        """Forces with which the step would end at the displacement `u` (n, 3).

        The pressures `p` (m,) [kPa] of the mixed form, by default those before, act where the stress does: at the end,
        or inside the step. Raises `InvertedError` and `OutsideLawError`.
        """
        p = state.p if p is None else p
        body, system, h = self.body, self.body.system, interval.h
        F0, E0 = self.beginning(state.u)
        F1 = system.deformation_gradient(u)
        E1 = green_lagrange(F1)
        muscle = bool(system.contractions)
        theta = self.settings.theta(h)
        straining = Straining(E0, (E1 - E0) / h, h, theta) if system.by_rate else None
        if self.settings.scheme is Scheme.backward_euler:
            F = F1
            points = system.points(F1, interval.drive, p, straining=straining)
            S, D, passive, volume = points.S, points.D, None, points.volume
        else:
            F = F0 + theta * (F1 - F0)
            R = stretch_of(E0 + theta * (E1 - E0))
            found = system.points(R, 0.0, p)
            passive, volume = found.S, found.volume
            if self.settings.scheme is Scheme.energy_momentum:
                passive = passive + self._correction(found.S, F0, F1, E1 - E0)
            S, D = passive.copy(), found.D.copy()
            if muscle:
                active = system.points(R, interval.drive, passive=False, straining=straining)
                S += active.S
                D += active.D
        inertia = body.momentum_of((self.velocity(state, u, h) - state.v) / h)
        at = state.u + theta * (u - state.u)
        viscous = None
        if body.viscosity is not None:
            viscous = stress_of(body.viscosity, E1 - E0) / h
            S = S + viscous
            D = D + body.viscosity / (theta * h)
        points = Points(F, S, D, np.zeros(0), volume)
        internal, magnitude = system.internal_force(points)
        external = system.external_force(at, interval.drive)
        speed = (u - state.u) / h
        drag = None if body.drag is None else body.drag.force(speed)
        outside = external + body.weight if drag is None else external + body.weight + drag
        unbalanced = system.residual(points, internal + inertia, outside)
        reaction = unbalanced[system.held.dofs]
        unbalanced[system.held.dofs] = 0.0
        momentum = body.node_mass[:, None] * (np.abs(state.v) + np.abs(u - state.u) / h) / h
        given = (magnitude, external, body.weight, momentum, *(() if drag is None else (drag,)))
        scale = max(float(np.linalg.norm(part)) for part in given)
        return Forces(points, passive, viscous, unbalanced, reaction, external, speed, drag, scale)

    def _correction(self, S: Array, F0: Array, F1: Array, dE: Array) -> Array:
        """Stress along the change of strain that makes the work of the passive stress the change of its energy."""
        system = self.body.system
        psi = [system.points(F, 0.0, moduli=False).psi for F in (F0, F1)]
        tensor = dE.copy()
        tensor[3:] *= 0.5
        size = np.einsum("aeq,aeq->eq", tensor, dE)
        missing = psi[1] - psi[0] - np.einsum("aeq,aeq->eq", S, dE)
        return np.where(size > _STILL**2, missing / np.where(size > 0.0, size, 1.0), 0.0) * tensor

    def _factorise(self, forces: Forces, S: Array, u: Array, interval: Interval) -> None:
        """Factor the step's tangent; where it is not positive definite, without its geometric part.

        A body that the ground holds up may topple without it: then the tangent without contact has a negative
        direction in long steps. The part left out makes iterations more, not the answer another.
        """
        self._length = 0.0
        try:
            self._factor(self._tangent(forces, S, u, interval))
        except NotPositiveDefiniteError:
            self._factor(self._tangent(forces, np.zeros_like(S), u, interval))
        self._length = interval.h
        if self.contact is not None:
            self.contact.renew()

    def _factor(self, data: Array) -> None:
        """Factor a matrix that has as many negative eigenvalues as pressures; raises `NotPositiveDefiniteError`."""
        system = self.body.system
        if system.mixed is not None:
            data[system.mixed.compliance_places] += _STEADY * system.mixed.steadying
        self.factor.factor(data)
        if self.factor.negative_pivots != system.n_pressures:
            raise NotPositiveDefiniteError

    def _tangent(self, forces: Forces, S: Array, u: Array, interval: Interval) -> Array:
        """Upper triangle of the derivative of the unbalanced force, with the stress `S` in its geometric part.

        Where tension or pressure has no potential, of its symmetric part: the ground's problem asks for a symmetric
        compliance. What comes out obeys the exact balance; iterations are some more. In the mixed form the unknowns of
        the matrix are pressures over `theta`, which keeps it symmetric.
        """
        system, drag = self.body.system, self.body.drag
        matrix = system.matrix(forces.points, S, u, interval.drive)
        data = self.settings.theta(interval.h) * (matrix if system.symmetric else matrix[0])
        data += self._inertia(interval.h)
        if drag is not None:
            data[drag.to.places] += drag.stiffness(forces.speed) / interval.h
        system.block(data)
        return data

    def _inertia(self, h: float) -> Array:
        """Upper triangle of the derivative of the inertial force; between foot and body its symmetric mean."""
        if self._massive is None or self._massive[0] != h:
            p = self.body.system.pattern
            share = np.ones(p.n_dofs)  # pressures have no mass
            share[: p.n_dofs - p.n_pressures] = np.repeat(1.0 / np.sqrt(self.weights(h).ravel()), 3)
            rows = np.repeat(np.arange(p.n_dofs), np.diff(p.starts))
            self._massive = (h, self.body.mass * share[rows] * share[p.columns] / h**2)
        return self._massive[1]

    def make(self, state: State, interval: Interval) -> Made:
        """Make one step; raises `StepFailedError`."""
        try:
            for guess in self._guesses(state, interval):
                try:
                    return self._iterate(state, self._held(guess, interval.end), interval)
                except InvertedError:
                    if guess is state.u:
                        raise
            raise AssertionError
        except InvertedError as error:
            text = f"an element is inverted (det F = {error.J:.3g})"
            raise StepFailedError(text, Why.inverted, element=error.element) from None
        except OutsideLawError as error:
            raise StepFailedError(str(error), Why.outside_law, element=error.element) from None
        except NotPositiveDefiniteError:
            raise StepFailedError("the step's tangent is not positive definite", Why.indefinite) from None

    def _guesses(self, state: State, interval: Interval) -> tuple[Array, ...]:
        """Displacements to begin from, the last where the step begins; the next is tried where one is inverted."""
        h, share = interval.h, self.settings.theta(interval.h)
        return state.u + h * (state.v + share * h * state.change), state.u

    def _held(self, u: Array, drive: Step) -> Array:
        """The displacement with what supports prescribe."""
        held = self.body.system.held
        if not held.dofs.size:
            return u.copy()
        local = self.body.system.to_local(u).copy()
        local.reshape(-1)[held.dofs] = held.at(drive)
        return self.body.system.to_global(local)

    def _iterate(self, state: State, u: Array, interval: Interval) -> Made:
        system, settings, contact = self.body.system, self.settings, self.contact
        rounding = self._rounding(u)
        before = contact.positions(state.u) if contact is not None else np.zeros((0, 3))
        theta = settings.theta(interval.h)
        at, met, force = (
            At(u, state.p, self.forces(state, u, interval), self._pushed(state.touch.force)),
            None,
            state.touch.force,
        )
        factorisations, fresh, old = 0, None, None
        for iteration in range(settings.max_iterations + 1):
            if not np.isfinite(at.norm):
                raise StepFailedError("the residual is not a number", Why.no_number, iteration=iteration)
            solved = contact is None or (met is not None and met.residual <= ACCEPTED)
            allowed = max(settings.tolerance * at.forces.scale, rounding)
            if iteration > 0 and solved and at.norm <= allowed:
                return self._made(state, interval, at, met, iteration, factorisations)
            if iteration == settings.max_iterations:
                break
            slow = old is not None and _iterations_left(at.norm, old.norm, allowed) > _PATIENCE
            if slow and fresh is None and old is not None:
                at = old  # an old factor misled
            if self._length != interval.h or slow:
                points = at.forces.points
                # after a whole Newton step the stress carried along from before it: see `solid.newton`
                S = points.S if fresh is None else system.carry(fresh.forces.points, points.F, at.p - fresh.p)
                self._factorise(at.forces, S, at.u, interval)
                factorisations, fresh = factorisations + 1, at
            else:
                fresh = None
            old = at
            change = self.factor.solve(-at.forces.unbalanced)
            pushed = at.pushed
            if contact is not None:
                free = contact.positions(at.u + system.parts(change)[0])
                met = contact.solve(self.factor, before, free, interval.h, state.touch, force)
                force, pushed = met.force, self._pushed(met.force)
                if np.any(force):
                    change += self.factor.solve(pushed)
            moved, pressed = system.parts(change)
            u, p = at.u + moved, at.p + theta * pressed
            at = At(u, p, self.forces(state, u, interval, p), pushed)
        if met is not None and met.residual > ACCEPTED:
            raise StepFailedError("the contact problem was not solved", Why.iterations)
        share = at.norm / at.forces.scale
        text = f"no convergence in {settings.max_iterations} iterations (residual {share:.2g} of the forces)"
        raise StepFailedError(text, Why.iterations, element=system.loudest(at.forces.unbalanced - at.pushed))

    def _rounding(self, u: Array) -> float:
        """Norm of the unbalanced force that rounding alone leaves at a displacement [mN]."""
        return 4.0 * self.body.system.rounding_force * (1.0 + float(np.abs(u).max()) / self.body.largest)

    def _pushed(self, force: Array) -> Array:
        """Forces of the ground on the unknowns, zero where these are held, (dofs,) [mN]."""
        system = self.body.system
        if self.contact is None:
            return np.zeros(system.n_dofs)
        pushed = np.zeros(system.n_dofs)
        pushed[: system.n_dofs - system.n_pressures] = system.to_local(self.contact.nodal(force)).ravel()
        pushed[system.held.dofs] = 0.0
        return pushed

    def _made(
        self, state: State, interval: Interval, at: At, met: Met | None, iterations: int, factorisations: int
    ) -> Made:
        h = interval.h
        v = self.velocity(state, at.u, h)
        touch = state.touch if met is None or self.contact is None else self.contact.settled(met)
        end = State(at.u, v, (v - state.v) / h, touch, at.p)
        scale = at.forces.scale
        return Made(end, at.forces, met, at.norm / scale if scale else 0.0, iterations, factorisations)


def _iterations_left(norm: float, before: float, allowed: float) -> float:
    """Iterations until a residual that goes on falling as it did is small enough; infinite if it does not fall."""
    if norm >= before:
        return np.inf
    return float(np.log(norm / allowed) / np.log(before / norm)) if norm > allowed else 0.0
