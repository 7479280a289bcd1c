"""Implicit time steps of an assembly on a frictional ground, compiled.

Unknowns are the velocities v1 at the end of the step and the impulses p of the ground and of the joints. With
``vm = theta v1 + (1 - theta) v0``, positions and directors follow from ``h vm`` (spatial rotation vectors), and

    M (v1 - v0) = h f(q at theta, strains averaged with theta) + J^T p      (momentum and spatial angular momentum)

Forces act in the configuration at ``theta`` with resultants of the averaged strains: linear momentum is kept to
rounding, with ``theta = 1/2`` angular momentum, too, and energy at second order. ``theta = 1/2 + c h`` keeps the scheme
second order in smooth motion and dissipates high frequencies.

A joint demands ``J v1 + g1 / H = 0`` and the ground ``0 <= J_n v1 + g1 / H`` complementary to its impulse, in the
configuration at the end: the velocity that closes the gap g1 left there within the next step, of length H, so positions
do not drift, nothing penetrates, and a part at rest stays where it is. The gap left is of third order; impulses act
along the directions at theta, like forces. Impacts are inelastic, first order. Rows of joints that depend on each other
have a compliance, see `rod.redundant`.

The tangent matrix and its factors are kept from step to step and renewed when convergence slows (modified Newton); the
contact problem is condensed on the nodes that carry contact points.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.compile_cache import BORROWS, BY_ADDRESS, INNER, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.assembly.kernels import (  # noqa: E402
    add_all_forces,
    add_joint_forces,
    add_stiffness,
    joint_blocks,
    joint_gaps,
    measure,
    resultants,
    tensions,
)
from fem_biobot.rod.blocks.kernels import compliance, factor, solve  # noqa: E402
from fem_biobot.rod.drag.kernels import add_drag, add_drag_tangents  # noqa: E402
from fem_biobot.rod.dynamics.ground.kernels import (  # noqa: E402
    CONTACT_ACCEPTED,
    add_contact_impulses,
    even_out,
    solve_contacts,
)
from fem_biobot.rod.dynamics.inertia.kernels import (  # noqa: E402
    angular_momentum,
    clear,
    clear_blocks,
    copy,
    spatial_matrix,
)
from fem_biobot.rod.rotation.kernels import turn  # noqa: E402
from fem_biobot.rod.touching.kernels import meet  # noqa: E402

CONVERGED, SLOW, SINGULAR, CONTACT, WOUND = 0, 1, 2, 3, 4
LARGEST_TURN = 3.0  # rad within an element, beyond which the rotation vector is no longer unique
_ROUNDING = 16.0 * 2.0**-52  # of momenta, and of forces by that of strains
_STALE = 4  # iterations after which old factors are renewed


@njit(**INNER, **BORROWS)
def _configure(x, Q, v0, h, theta, work):
    """Positions and directors at theta and at the end of the step for the velocities `work.v1`."""
    v1, vm, angle, xm, x1 = work.v1, work.vm, work.angle, work.xm, work.x1
    for i in range(x.shape[0]):
        for c in range(6):
            vm[i, c] = theta * v1[i, c] + (1.0 - theta) * v0[i, c]
        for c in range(3):
            xm[i, c] = x[i, c] + theta * h * vm[i, c]
            x1[i, c] = x[i, c] + h * vm[i, c]
            angle[i, c] = theta * h * vm[i, 3 + c]
    turn(Q, angle, work.Qm)
    for i in range(x.shape[0]):
        for c in range(3):
            angle[i, c] = h * vm[i, 3 + c]
    turn(Q, angle, work.Q1)


@njit(**INNER, **BORROWS)
def _residual(assembly, system, state, plane, h, theta, pull, load_factor, arm, work):
    """Write the unbalanced impulse ``h f + J^T lambda - M dv`` (n, 6), joint and contact data.

    Returns the scale of the impulses, negative if there is no configuration, and what rounding alone may leave.
    """
    inertia = assembly.inertia
    mass = inertia.mass
    x1, Q1, v0, v1, rhs, force, s, tension = (
        work.x1,
        work.Q1,
        state.v,
        work.v1,
        work.rhs,
        work.force,
        work.s,
        work.tension,
    )
    _configure(state.x, state.Q, v0, h, theta, work)
    if not measure(assembly, x1, Q1, work.strain, work.lengths) < LARGEST_TURN:
        return -1.0, 0.0
    rate = 1.0 / h
    resultants(assembly, state.strain, work.strain, theta, rate, s)
    tensions(
        assembly.members, assembly.activation, state.lengths, work.lengths, theta, rate, pull, tension, work.active,
        work.slopes,
    )  # fmt: skip
    clear(force)
    add_all_forces(assembly, work.xm, work.Qm, s, tension, load_factor, 1.0, force)
    scale = h * add_drag(assembly.drag, work.Qm, work.vm, force)
    angular_momentum(inertia.J, Q1, v1, work.spin)
    momentum = 0.0
    far = 0.0
    for i in range(mass.shape[0]):
        for c in range(3):
            change = v1[i, c] - v0[i, c]
            momentum = max(momentum, mass[i] * abs(v1[i, c]), abs(work.spin[i, c]) / arm)
            far = max(far, abs(x1[i, c]))
            rhs[i, c] = h * force[i, c] - mass[i] * change
            rhs[i, 3 + c] = h * force[i, 3 + c] - (work.spin[i, c] - work.spin0[i, c])
            scale = max(scale, mass[i] * (abs(assembly.gravity[c]) * h + abs(change)))
    stiffest = 0.0
    for e in range(s.shape[0]):
        for c in range(3):
            scale = max(scale, h * abs(s[e, c]))
        gain = 1.0 + rate * assembly.damping[e]
        stiffest = max(
            stiffest, h * gain * assembly.elements.stiffness[e, 2] * (1.0 + far / assembly.elements.length[e])
        )
    for k in range(tension.shape[0]):
        scale = max(scale, h * abs(tension[k]))
    for k in range(load_factor.shape[0]):
        for c in range(3):
            scale = max(scale, h * abs(load_factor[k] * assembly.loads.force[k, c]))
    joints = assembly.constraints
    if joints.rows.shape[0] > 0:
        add_joint_forces(joints, inertia.held, work.xm, work.Qm, work.joint1, rhs)
        joint_gaps(joints, inertia.held, x1, Q1, v1, work.joint_gap, work.joint_rate)
    C, T, axes, height = assembly.contacts, assembly.touches, plane.axes, plane.height
    meet(C, T, inertia.held, work.xm, work.Qm, axes, height, True, work.gap, work.push, work.push_ends)
    meet(C, T, inertia.held, x1, Q1, axes, height, False, work.gap, work.rows, work.ends)
    return scale, _ROUNDING * (momentum + stiffest)


@njit(**BY_ADDRESS, **BORROWS)
def factorise(assembly, system, h, theta, load_factor, work):
    """Fill and factorise the tangent at the present iterate; also the compliance of the nodes that touch."""
    inertia = assembly.inertia
    blocks = work.blocks
    clear_blocks(blocks)
    rate = 1.0 / h
    for e in range(work.gain.shape[0]):
        work.gain[e] = 1.0 + rate * assembly.damping[e] / theta
    add_stiffness(
        assembly, system, work.xm, work.Qm, work.s, work.gain, work.tension, work.slopes, work.lengths, 1.0,
        rate / theta, load_factor, theta * theta * h * h, blocks,
    )  # fmt: skip
    g = theta * h
    add_drag_tangents(assembly.drag, inertia.held, system.plan.diagonal, work.Qm, work.vm, g, g * g, blocks)
    for i in range(inertia.mass.shape[0]):
        B = blocks[system.plan.diagonal[i]]
        if inertia.held[i] == 1:
            clear(B)
            for c in range(6):
                B[c, c] = 1.0
            continue
        Js = spatial_matrix(inertia.J, work.Q1, i)
        for a in range(3):
            b = (a + 1) % 3
            c = (a + 2) % 3
            B[a, a] += inertia.mass[i]
            # d(Js w) = dtheta x L - Js (dtheta x w), dtheta = theta h dw
            B[3 + a, 3 + c] += g * work.spin[i, b]
            B[3 + a, 3 + b] -= g * work.spin[i, c]
            for r in range(3):
                # column a of Js [w]x
                turned = Js[3 * r + b] * work.v1[i, 3 + c] - Js[3 * r + c] * work.v1[i, 3 + b]
                B[3 + r, 3 + a] += Js[3 * r + a] + g * turned
    # multipliers are impulses and rows those of the velocity; the right sides are scaled to that
    joint_blocks(assembly.constraints, inertia.held, system.joint, work.x1, work.Q1, 1.0, blocks)
    if not factor(system.plan, blocks):
        return False
    compliance(system.plan, blocks, system.touching, work.compliance)
    return True


@njit(**INNER, **BORROWS)
def _unbalance(held, arm, rhs, column):
    """Largest entry of the impulses left, with those of the ground; moments over the length `arm`."""
    worst = 0.0
    for i in range(held.shape[0]):
        if held[i] == 0:
            for c in range(6):
                part = abs(rhs[i, c] + column[i, c]) / (1.0 if c < 3 else arm)
                if not part <= worst:  # also true for a NaN
                    worst = part
    return worst


@njit(**INNER, **BORROWS)
def _joint_gaps(joints, theta, h, n, work):
    """Write the right sides of the joints, whose gaps close within `h`; returns the largest gap [mm, rad]."""
    worst = 0.0
    for j in range(joints.rows.shape[0]):
        for r in range(6):
            work.rhs[n + j, r] = 0.0
            if joints.rows[j, r] == 1:
                gap = (work.joint_rate[j, r] + work.joint_gap[j, r] / h) / (1.0 + theta)
                work.rhs[n + j, r] = -gap - joints.soft[j, r] * work.joint1[j, r]
                worst = max(worst, abs(work.rhs[n + j, r]) * h)
    return worst


@njit(**BY_ADDRESS, **BORROWS)
def try_step(
    assembly, system, state, plane, h, theta, closing, pull, load_factor, arm, tolerance, most, fresh, calls, work,
    scratch,
):  # fmt: skip
    """Try one step of length `h` from `state`; its end goes to `work`.

    `closing` is the length of the step that follows [s], within which gaps are to close.
    `pull` (k,), what drive adds to the members' tension [mN], and `load_factor` (l,) are averages over the step; `arm`
    [mm] makes moments comparable with forces; `fresh` tells that the factors in `work.blocks` belong to this `h`.
    Returns the outcome, iterations, factorisations and residual. `calls` are `factorise` and `solve_friction` by
    address.
    """
    held = assembly.inertia.held
    rhs, free, column, v1 = work.rhs, work.free, work.column, work.v1
    n = held.shape[0]
    count = work.p.shape[0]
    angular_momentum(assembly.inertia.J, state.Q, state.v, work.spin0)
    for i in range(n):
        for c in range(6):
            v1[i, c] = 0.0 if held[i] == 1 else state.v[i, c] + h * state.change[i, c]
    copy(state.impulse, work.p)
    copy(state.joint, work.joint1)
    factorisations = 0
    since = 0
    residual = np.inf
    trouble = 0.0
    for iteration in range(most):
        scale, rounding = _residual(assembly, system, state, plane, h, theta, pull, load_factor, arm, work)
        if scale < 0.0:
            return WOUND, iteration, factorisations, residual
        if iteration == 0:
            even_out(system.foot, system.touching.shape[0], plane.axes, state.touch, work.rows, work.p)
        before = residual
        clear(column)
        add_contact_impulses(work.push_ends, work.push, work.p, column)
        residual = _unbalance(held, arm, rhs, column)
        # a joint's gap as the impulse that would close it is of the size of the others; compare lengths
        allowed = max(tolerance * scale, rounding)
        if _joint_gaps(assembly.constraints, theta * h / closing, closing, n, work) > tolerance * arm:
            residual = max(residual, 2.0 * allowed)
        if not np.isfinite(residual):
            return SLOW, iteration, factorisations, residual
        if iteration > 0 and residual <= allowed and trouble <= CONTACT_ACCEPTED:
            return CONVERGED, iteration, factorisations, tolerance * residual / max(allowed, 1e-300)
        if not fresh or (since >= _STALE and residual > 0.1 * before):
            if not calls.factorise(assembly, system, h, theta, load_factor, work):
                return SINGULAR, iteration, factorisations, residual
            factorisations += 1
            fresh = True
            since = 0
        since += 1
        for i in range(n):
            if held[i] == 1:
                for c in range(6):
                    rhs[i, c] = 0.0
        if count > 0:
            copy(rhs, free)
            solve(system.plan, work.blocks, free)
            trouble = solve_contacts(
                assembly.touches.distance, system.number, state.touch, state.slide, plane, closing, theta * h / closing,
                work.push, work.push_ends, calls.friction, work, scratch,
            )  # fmt: skip
            add_contact_impulses(work.push_ends, work.push, work.p, rhs)
        solve(system.plan, work.blocks, rhs)
        for i in range(n):
            for c in range(6):
                v1[i, c] += rhs[i, c]
        for j in range(work.joint1.shape[0]):
            for r in range(6):
                work.joint1[j, r] += rhs[n + j, r]
    return (SLOW if trouble <= CONTACT_ACCEPTED else CONTACT), most, factorisations, residual
