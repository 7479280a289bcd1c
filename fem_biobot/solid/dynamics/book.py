"""The book of energies of a motion: what is stored, and by whose work it changed; it closes up to the tolerance.

Every entry is computed from its own quantities, none as what is left over: kinetic, strain and potential energy at the
end of a step, and the work over it of muscle, loads, viscosity, the ground's friction and normal forces, supports and
drag, and of parts that slide on each other: `rubbing` is their friction's, `pressing` that of their normal forces,
which is what impacts take, and what gaps of single points give and take where they find other facets opposite to them.
The integrator's own share is what inertia and stress take beyond the change of their energies.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.material.law import Array
from fem_biobot.solid.dynamics.body import MovingBody
from fem_biobot.solid.dynamics.contact import Contact
from fem_biobot.solid.dynamics.step import Interval, Made, State, Stepper
from fem_biobot.solid.dynamics.strain import green_lagrange, strain_change, work_of

# the first three are states, the others sums over time [uJ]
BOOK = (
    "kinetic", "strain", "weight", "muscle", "loads", "viscous", "friction", "normal", "supports", "integrator", "drag",
    "rubbing", "pressing",
)  # fmt: skip


def begun(body: MovingBody, u: Array, v: Array, p: Array) -> Array:
    """The book where a motion begins, (13,) [uJ]."""
    book = np.zeros(len(BOOK))
    passive = body.system.points(body.system.deformation_gradient(u), 0.0, p, moduli=False)
    book[:3] = kinetic(body, v), float(np.sum(passive.psi * body.system.space.dV)), -float(np.sum(body.weight * u))
    return book


def kinetic(body: MovingBody, v: Array) -> float:
    """Kinetic energy [uJ]."""
    return 0.5 * float(np.sum(v * body.momentum_of(v)))


def entered(
    book: Array, stepper: Stepper, contact: Contact | None, before: State, made: Made, interval: Interval
) -> Array:
    """The book after a step."""
    body, system, dV = stepper.body, stepper.body.system, stepper.body.system.space.dV
    after, forces = made.state, made.forces
    du = after.u - before.u
    F0, E0 = stepper.beginning(before.u)
    F = forces.points.F
    theta = stepper.settings.theta(interval.h)
    dF = (F - F0) / theta
    F1 = F if theta == 1.0 else F0 + dF
    end = system.points(F1, 0.0, after.p, moduli=False)
    passive = end.S if forces.passive is None else forces.passive
    worked = strain_change(F, dF)
    out = book.copy()
    inertia = float(np.sum(du * body.momentum_of(after.v - before.v))) / interval.h
    out[0] = kinetic(body, after.v)
    out[1] = float(np.sum(end.psi * dV))
    out[2] = -float(np.sum(body.weight * after.u))
    # a turn of the body changes no strain: what the stress does beyond the change of strain is the integrator's
    strained = green_lagrange(F1) - E0
    taken = inertia - (out[0] - book[0]) + work_of(forces.points.S, worked - strained, dV)
    taken += work_of(passive, strained, dV) - (out[1] - book[1])
    muscle = forces.points.S - passive
    if forces.viscous is not None:
        muscle -= forces.viscous
        out[5] -= work_of(forces.viscous, strained, dV)
    if system.contractions:
        out[3] -= work_of(muscle, strained, dV)
    out[4] += float(np.sum(forces.external * du))
    if contact is not None:
        moved = contact.positions(after.u) - contact.positions(before.u)
        done = np.sum(after.touch.force * moved, axis=0)
        out[6] += float(done[1] + done[2])
        out[7] += float(done[0])
    if forces.drag is not None:
        out[10] += float(np.sum(forces.drag * du))
    if made.between is not None:
        out[11] += float(np.sum(made.between.rubbing * du))
        out[12] += float(np.sum(made.between.pressing * du))
    held = system.held.dofs
    if held.size:
        out[8] += float(forces.reaction @ system.to_local(du).ravel()[held])
    out[9] -= taken
    return out


def unexplained(book: Array) -> Array:
    """What the book does not explain, (s,) [uJ], of its rows (s, 13)."""
    stored = book[:, :3].sum(axis=1)
    return stored - stored[0] - (book[:, 3:] - book[0, 3:]).sum(axis=1)
