"""Explicit time steps of an assembly on a frictional ground, compiled: kick and drift with impulses.

A step drifts positions and directors over half of it, takes the forces there once, changes momentum and spatial angular
momentum by them and by the impulses of joints and ground, and drifts the other half:

    q_half = q0 + h/2 v0,   M v1 = M v0 + h f(q_half) + J^T p,   q1 = q_half + h/2 v1

Without damping and contact this is the position form of Stoermer-Verlet: second order, momentum and angular momentum to
rounding, energy bounded. Stable for steps below 2 over the highest angular frequency (see `rod.explicit.stability`).
Drag is taken at the velocity in the middle of the kick, extrapolated from the last one.

A joint demands ``J v1 + g_half / h = 0`` and the ground ``0 <= J_n v1 + g_half / h`` complementary to its impulse: the
gaps of the next half step are closed, not those of this one, so nothing penetrates there and nothing bounces. Nothing
but the force and contact kernels is shared with the implicit integrator: no tangent, no iteration, no numerical
dissipation.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import ALLOCATES, BORROWS, BY_ADDRESS, INNER, KERNEL, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.assembly.kernels import (  # noqa: E402
    add_all_forces,
    energies,
    joint_blocks,
    joint_gaps,
    measure,
    resultants,
    tensions,
)
from fem_biobot.rod.blocks.kernels import compliance, factor, solve  # noqa: E402
from fem_biobot.rod.drag.kernels import add_drag  # noqa: E402
from fem_biobot.rod.dynamics.book.kernels import enter_damping  # noqa: E402
from fem_biobot.rod.dynamics.ground.kernels import (  # noqa: E402
    CONTACT_ACCEPTED,
    add_contact_impulses,
    enter_contacts,
    even_out,
    settle_contacts,
    solve_contacts,
)
from fem_biobot.rod.dynamics.inertia.kernels import (  # noqa: E402
    angular_momentum,
    angular_velocity,
    clear,
    clear_blocks,
    copy,
    copy_row,
    inverses,
    kinetic_energy,
    power_of,
    spatial_matrix,
    spin_up,
)
from fem_biobot.rod.dynamics.kernels import CONTACT, CONVERGED, LARGEST_TURN, SINGULAR, WOUND  # noqa: E402
from fem_biobot.rod.parts.kernels import add_loads, add_member_forces  # noqa: E402
from fem_biobot.rod.rotation.kernels import turn  # noqa: E402
from fem_biobot.rod.touching.kernels import meet  # noqa: E402


@njit(**INNER, **BORROWS)
def _drift(inverse, x, Q, v, spin, h, angle, quarter, to_x, to_Q):
    """Move freely for `h`: constant momentum and spatial angular momentum; second order for any inertia."""
    for i in range(x.shape[0]):
        for c in range(3):
            to_x[i, c] = x[i, c] + h * v[i, c]
            angle[i, c] = 0.5 * h * v[i, 3 + c]
    turn(Q, angle, quarter)
    for i in range(x.shape[0]):
        w = angular_velocity(inverse, quarter, i, spin[i, 0], spin[i, 1], spin[i, 2])
        for c in range(3):
            angle[i, c] = h * w[c]
    turn(Q, angle, to_Q)
    spin_up(inverse, to_Q, spin, v)


@njit(**BY_ADDRESS, **BORROWS)
def joint_masses(assembly, system, work):
    """Fill and factorise masses with joints at the half step; compliance of the nodes that touch from them."""
    inertia = assembly.inertia
    blocks, joints = work.blocks, assembly.constraints
    clear_blocks(blocks)
    for i in range(inertia.mass.shape[0]):
        B = blocks[system.plan.diagonal[i]]
        held = inertia.held[i] == 1
        Js = spatial_matrix(inertia.J, work.Qm, i)
        for a in range(3):
            B[a, a] = 1.0 if held else inertia.mass[i]
            B[3 + a, 3 + a] = 1.0
            if not held:
                for b in range(3):
                    B[3 + a, 3 + b] = Js[3 * a + b]
    joint_gaps(joints, inertia.held, work.xm, work.Qm, work.v1, work.joint_gap, work.joint_rate)
    joint_blocks(joints, inertia.held, system.joint, work.xm, work.Qm, 1.0, blocks)
    if not factor(system.plan, blocks):
        return False
    compliance(system.plan, blocks, system.touching, work.compliance)
    return True


@njit(**INNER, **BORROWS)
def _free_compliance(inertia, inverse, touching, work):
    """Velocity by impulse of the nodes that touch, without joints, (6 f, 6 f), and `work.free`."""
    clear(work.compliance)
    for f in range(touching.shape[0]):
        i = touching[f]
        if inertia.held[i] == 0:
            Js = spatial_matrix(inverse, work.Qm, i)
            for a in range(3):
                work.compliance[6 * f + a, 6 * f + a] = 1.0 / inertia.mass[i]
                work.free[i, a] = work.rhs[i, a] / inertia.mass[i]
                work.free[i, 3 + a] = 0.0
                for b in range(3):
                    work.compliance[6 * f + 3 + a, 6 * f + 3 + b] = Js[3 * a + b]
                    work.free[i, 3 + a] += Js[3 * a + b] * work.rhs[i, 3 + b]


@njit(**INNER, **BORROWS)
def _drag(drags, Q, v, change, h, middle, drag, force):
    """Write the drag in the middle of a kick to `drag` (n, 6) and add it to `force`; `middle` (n + j, 6) is scratch.

    The velocity there is that before the kick and half of the last change (Adams and Bashforth): second order.
    """
    for i in range(v.shape[0]):
        for a in range(6):
            middle[i, a] = v[i, a] + 0.5 * h * change[i, a]
    clear(drag)
    add_drag(drags, Q, middle, drag)
    for i in range(v.shape[0]):
        for a in range(6):
            force[i, a] += drag[i, a]


@njit(**KERNEL, **ALLOCATES)
def explicit_run(assembly, system, state, plane, h, pulls, load_factors, calls, work, scratch, book, tally):
    """Make steps of length `h`; parameters and tallies as in `rod.dynamics.run.kernels.implicit_run`.

    `state.strain` and `state.lengths` hold those of the last half step, from which rates are taken. Returns the steps
    made, the outcome and the largest residual of the contact problem.
    """
    inertia = assembly.inertia
    mass, held = inertia.mass, inertia.held
    n = mass.shape[0]
    count = work.p.shape[0]
    jointed = work.joint1.shape[0] > 0
    dragged = assembly.drag.node.shape[0] > 0
    spin, v1, vm, rhs, force, column, xm, Qm = (
        work.spin, work.v1, work.vm, work.rhs, work.force, work.column, work.xm, work.Qm,
    )  # fmt: skip
    inverse = np.empty((n, 3, 3))
    pull = np.empty(pulls.shape[1])
    factors = np.empty(load_factors.shape[1])
    inverses(inertia, inverse)
    angular_momentum(inertia.J, state.Q, state.v, spin)
    copy(state.v, v1)
    copy(state.impulse, work.p)
    worst = 0.0
    made = 0
    outcome = CONVERGED
    while made < pulls.shape[0] - 1:
        for k in range(pull.shape[0]):
            pull[k] = 0.5 * (pulls[made, k] + pulls[made + 1, k])
        for k in range(factors.shape[0]):
            factors[k] = 0.5 * (load_factors[made, k] + load_factors[made + 1, k])
        _drift(inverse, state.x, state.Q, v1, spin, 0.5 * h, work.angle, work.Q1, xm, Qm)
        copy(v1, vm)
        if not measure(assembly, xm, Qm, work.strain, work.lengths) < LARGEST_TURN:
            outcome = WOUND
            break
        resultants(assembly, state.strain, work.strain, 1.0, 1.0 / h, work.s)
        tensions(
            assembly.members, assembly.activation, state.lengths, work.lengths, 1.0, 1.0 / h, pull, work.tension,
            work.active, work.slopes,
        )  # fmt: skip
        clear(force)
        add_all_forces(assembly, xm, Qm, work.s, work.tension, factors, 1.0, force)
        if dragged:
            _drag(assembly.drag, Qm, v1, state.change, h, column, work.drag, force)
        for i in range(n):
            for a in range(6):
                rhs[i, a] = h * force[i, a] if held[i] == 0 else 0.0
        if jointed:
            if not calls.joint_masses(assembly, system, work):
                outcome = SINGULAR
                break
            for j in range(work.joint_gap.shape[0]):
                for r in range(6):
                    rhs[n + j, r] = -(work.joint_rate[j, r] + work.joint_gap[j, r] / h)
        if count > 0:
            feet, touches, axes, height = assembly.contacts, assembly.touches, plane.axes, plane.height
            meet(feet, touches, held, xm, Qm, axes, height, True, work.gap, work.push, work.push_ends)
            meet(feet, touches, held, xm, Qm, axes, height, False, work.gap, work.rows, work.ends)
            if jointed:
                copy(rhs, work.free)
                solve(system.plan, work.blocks, work.free)
            else:
                _free_compliance(inertia, inverse, system.touching, work)
            even_out(system.foot, system.touching.shape[0], plane.axes, state.touch, work.rows, work.p)
            trouble = solve_contacts(
                assembly.touches.distance, system.number, state.touch, state.slide, plane, h, 0.0, work.push,
                work.push_ends, calls.friction, work, scratch,
            )  # fmt: skip
            if not trouble <= CONTACT_ACCEPTED:
                outcome = CONTACT
                break
            worst = max(worst, trouble)
            add_contact_impulses(work.push_ends, work.push, work.p, rhs)
            copy(work.p, state.impulse)
            settle_contacts(work)
            copy_row(work.settled, state.touch)
            copy(work.slid, state.slide)
        if jointed:
            solve(system.plan, work.blocks, rhs)
            for i in range(n):
                for a in range(6):
                    v1[i, a] += rhs[i, a]
            # the rest of the solution are the impulses of the joints
            for j in range(state.joint.shape[0]):
                for r in range(6):
                    state.joint[j, r] = rhs[n + j, r]
            angular_momentum(inertia.J, Qm, v1, spin)
        else:
            for i in range(n):
                if held[i] == 0:
                    for a in range(3):
                        v1[i, a] += rhs[i, a] / mass[i]
                        spin[i, a] += rhs[i, 3 + a]
            spin_up(inverse, Qm, spin, v1)
        if dragged:
            for i in range(n):
                for a in range(6):
                    state.change[i, a] = (v1[i, a] - vm[i, a]) / h
        # forces and impulses work on the mean of the velocities before and after them
        for i in range(n):
            for a in range(6):
                vm[i, a] = 0.5 * (vm[i, a] + v1[i, a])
        enter_contacts(work.push_ends, work.push, work.p, state.touch, vm, h, book, tally)
        clear(column)
        add_member_forces(assembly.members, xm, Qm, work.active, column)
        book[3] += h * power_of(column, vm)
        clear(column)
        add_loads(assembly.loads, factors, Qm, column)
        book[4] += h * power_of(column, vm)
        if dragged:
            book[10] += h * power_of(work.drag, vm)
        enter_damping(assembly, h, state.strain, work.strain, state.lengths, work.lengths, book)
        copy(work.strain, state.strain)
        copy_row(work.lengths, state.lengths)
        _drift(inverse, xm, Qm, v1, spin, 0.5 * h, work.angle, work.Q1, state.x, state.Q)
        made += 1
    if outcome != CONVERGED:  # back to the last step's end, where the drift began
        spin_up(inverse, state.Q, spin, v1)
    copy(v1, state.v)
    measure(assembly, state.x, state.Q, work.strain, work.lengths)
    book[0] = kinetic_energy(mass, spin, v1)
    book[1], book[2] = energies(assembly, state.x, work.strain, work.lengths)
    return made, outcome, worst
