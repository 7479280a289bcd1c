"""Compiled end of an implicit step: its energies are entered and its state is taken over."""

from __future__ import annotations

from fem_biobot.compile_cache import BORROWS, BY_ADDRESS, INNER, ensure_cache_folder

ensure_cache_folder()

from numba import njit  # noqa: E402  (numba looks for its cache folder when it loads)

from fem_biobot.rod.assembly.kernels import add_joint_forces, energies  # noqa: E402
from fem_biobot.rod.drag.kernels import add_drag  # noqa: E402
from fem_biobot.rod.dynamics.ground.kernels import enter_contacts, settle_contacts  # noqa: E402
from fem_biobot.rod.dynamics.inertia.kernels import (  # noqa: E402
    clear,
    copy,
    copy_frames,
    copy_row,
    kinetic_energy,
    power_of,
    spatial_matrix,
)
from fem_biobot.rod.parts.kernels import add_loads, add_member_forces  # noqa: E402


@njit(**INNER, **BORROWS)
def enter_damping(assembly, h, before, after, lengths_before, lengths_after, book):
    """Enter the work of viscous resultants and members; returns the elastic energy of the change of strain, doubled."""
    E = assembly.elements
    M = assembly.members
    stored = 0.0
    damping = 0.0
    for e in range(before.shape[0]):
        total = 0.0
        for r in range(6):
            change = after[e, r] - before[e, r]
            total += E.stiffness[e, r] * change * change
        stored += E.length[e] * total
        damping += E.length[e] * total * assembly.damping[e] / h
    for k in range(M.law.shape[0]):
        change = lengths_after[k] - lengths_before[k]
        damping += M.viscosity[k] * change * change / h
    book[5] -= damping
    return stored


@njit(**BY_ADDRESS, **BORROWS)
def accept(assembly, system, state, h, theta, load_factor, work, book, tally):
    """Take over the end of a converged step; enter energies into `book` (see `dynamics.arrays.BOOK`) and `tally`."""
    inertia = assembly.inertia
    n = inertia.mass.shape[0]
    v0, v1, vm, column = state.v, work.v1, work.vm, work.column
    # what theta above one half takes: from changes of velocity, and of strain
    lost = enter_damping(assembly, h, state.strain, work.strain, state.lengths, work.lengths, book)
    for i in range(n):
        Js = spatial_matrix(inertia.J, work.Q1, i)
        for a in range(3):
            change = v1[i, a] - v0[i, a]
            lost += inertia.mass[i] * change * change
            turned = v1[i, 3 + a] - v0[i, 3 + a]
            lost += turned * (
                Js[3 * a] * (v1[i, 3] - v0[i, 3])
                + Js[3 * a + 1] * (v1[i, 4] - v0[i, 4])
                + Js[3 * a + 2] * (v1[i, 5] - v0[i, 5])
            )
        for c in range(6):
            vm[i, c] = theta * v1[i, c] + (1.0 - theta) * v0[i, c]
    book[9] -= (theta - 0.5) * lost
    clear(column)
    add_member_forces(assembly.members, work.xm, work.Qm, work.active, column)
    book[3] += h * power_of(column, vm)
    clear(column)
    add_loads(assembly.loads, load_factor, work.Qm, column)
    book[4] += h * power_of(column, vm)
    if assembly.drag.node.shape[0] > 0:
        clear(column)
        add_drag(assembly.drag, work.Qm, vm, column)
        book[10] += h * power_of(column, vm)
    enter_contacts(work.push_ends, work.push, work.p, work.touch, vm, h, book, tally)
    if work.joint1.shape[0] > 0:
        clear(column)
        add_joint_forces(assembly.constraints, inertia.held, work.xm, work.Qm, work.joint1, column)
        book[8] += power_of(column, vm)
    book[0] = kinetic_energy(inertia.mass, work.spin, v1)
    book[1], book[2] = energies(assembly, work.x1, work.strain, work.lengths)
    for i in range(n):
        for c in range(6):
            state.change[i, c] = (v1[i, c] - v0[i, c]) / h
    copy(work.x1, state.x)
    copy_frames(work.Q1, state.Q)
    copy(v1, state.v)
    copy(work.p, state.impulse)
    settle_contacts(work)
    copy_row(work.settled, state.touch)
    copy(work.slid, state.slide)
    copy(work.joint1, state.joint)
    copy(work.strain, state.strain)
    copy_row(work.lengths, state.lengths)
    state.length[0] = h
