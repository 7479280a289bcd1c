"""Compiled kernels of the solid: deformation gradient, internal force and tangent.

Shape letters: ``e`` elements, ``q`` quadrature points, ``b`` nodes of an element, ``n`` nodes. Tensor axes first, point
axes last, but nodal vectors are (n, 3) so that one node lies together. Symmetric tensors are packed as in
`material.law.PAIRS`. Every kernel writes only to the buffers named in its first line.

The element kernels take packs of elements, one in each lane of the last axis of small arrays of their own, so that the
innermost loops become vector instructions; the last pack is filled up with its last element, which counts once. What
that rests on: those arrays have constant sizes but for one axis, loops over lanes are innermost but for loops of
constant length, and products may be contracted with sums ("contract" reorders nothing, so results repeat).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from llvmlite import ir  # noqa: E402  (numba looks for its cache folder when it loads)
from numba import njit, types  # noqa: E402
from numba.extending import intrinsic  # noqa: E402

# entry of a component (a, b) of a symmetric 6 by 6 matrix in its upper triangle by rows
_ENTRY = np.array(
    [
        [0, 1, 2, 3, 4, 5],
        [1, 6, 7, 8, 9, 10],
        [2, 7, 11, 12, 13, 14],
        [3, 8, 12, 15, 16, 17],
        [4, 9, 13, 16, 18, 19],
        [5, 10, 14, 17, 19, 20],
    ]
)
# Elements in a pack: two of the widest vectors. The compiler unrolls loops of half that length whole and then finds no
# vector instructions for them.
_LANES = 16


@njit(cache=True, nogil=True, fastmath={"contract"})
def deformation_gradient(elements, u, nodes, slopes, to_reference, F):
    """Write ``F = I + du/dX`` of `elements`, (3, 3, e, q); `slopes` (b, 3, q) are on the unit cell."""
    n_basis = nodes.shape[0]
    n_elements = elements.shape[0]
    R = np.empty((3, 3, _LANES))
    moved = np.empty((n_basis, 3, _LANES))
    H = np.empty((3, 3, _LANES))
    out = np.empty((3, 3, _LANES))
    for first in range(0, n_elements, _LANES):
        filled = min(_LANES, n_elements - first)
        for lane in range(_LANES):
            e = elements[min(first + lane, n_elements - 1)]
            for d in range(3):
                for k in range(3):
                    R[d, k, lane] = to_reference[d, k, e]
            for a in range(n_basis):
                for i in range(3):
                    moved[a, i, lane] = u[nodes[a, e], i]
        for q in range(slopes.shape[2]):
            H[:] = 0.0
            for a in range(n_basis):
                s0, s1, s2 = slopes[a, 0, q], slopes[a, 1, q], slopes[a, 2, q]
                for lane in range(_LANES):
                    for i in range(3):
                        H[i, 0, lane] += moved[a, i, lane] * s0
                        H[i, 1, lane] += moved[a, i, lane] * s1
                        H[i, 2, lane] += moved[a, i, lane] * s2
            for lane in range(_LANES):
                for i in range(3):
                    for k in range(3):
                        out[i, k, lane] = (
                            H[i, 0, lane] * R[0, k, lane]
                            + H[i, 1, lane] * R[1, k, lane]
                            + H[i, 2, lane] * R[2, k, lane]
                        )
                    out[i, i, lane] += 1.0
            for lane in range(filled):
                e = elements[first + lane]
                for i in range(3):
                    for k in range(3):
                        F[i, k, e, q] = out[i, k, lane]


@njit(cache=True, nogil=True, fastmath={"contract"})
def internal_force(elements, nodes, slopes, to_reference, dV, F, S, force, magnitude):
    """Add to `force` (n, 3) the internal force of `elements`, to `magnitude` the sizes of its element parts."""
    n_basis = nodes.shape[0]
    n_elements = elements.shape[0]
    R = np.empty((3, 3, _LANES))
    f = np.empty((3, 3, _LANES))
    s = np.empty((6, _LANES))
    T = np.empty((3, 3, _LANES))
    local = np.empty((n_basis, 3, _LANES))
    for first in range(0, n_elements, _LANES):
        filled = min(_LANES, n_elements - first)
        for lane in range(_LANES):
            e = elements[min(first + lane, n_elements - 1)]
            for d in range(3):
                for k in range(3):
                    R[d, k, lane] = to_reference[d, k, e]
        local[:] = 0.0
        for q in range(slopes.shape[2]):
            for lane in range(_LANES):
                e = elements[min(first + lane, n_elements - 1)]
                w = dV[e, q]
                for i in range(3):
                    for k in range(3):
                        f[i, k, lane] = F[i, k, e, q]
                for a in range(6):
                    s[a, lane] = S[a, e, q] * w
            # the first Piola stress, its second slot on the unit cell
            for i in range(3):
                for lane in range(_LANES):
                    f0, f1, f2 = f[i, 0, lane], f[i, 1, lane], f[i, 2, lane]
                    p0 = f0 * s[0, lane] + f1 * s[3, lane] + f2 * s[5, lane]
                    p1 = f0 * s[3, lane] + f1 * s[1, lane] + f2 * s[4, lane]
                    p2 = f0 * s[5, lane] + f1 * s[4, lane] + f2 * s[2, lane]
                    for d in range(3):
                        T[i, d, lane] = p0 * R[d, 0, lane] + p1 * R[d, 1, lane] + p2 * R[d, 2, lane]
            for a in range(n_basis):
                s0, s1, s2 = slopes[a, 0, q], slopes[a, 1, q], slopes[a, 2, q]
                for lane in range(_LANES):
                    for i in range(3):
                        local[a, i, lane] += T[i, 0, lane] * s0 + T[i, 1, lane] * s1 + T[i, 2, lane] * s2
        for lane in range(filled):
            e = elements[first + lane]
            for a in range(n_basis):
                node = nodes[a, e]
                for i in range(3):
                    force[node, i] += local[a, i, lane]
                    magnitude[node, i] += abs(local[a, i, lane])


# places in the matrix are unsigned: signed ones would be checked for counting from the end at every access
_ZERO, _ONE, _TWO, _THREE, _FOUR, _EIGHT = (np.uint64(number) for number in (0, 1, 2, 3, 4, 8))


@njit(cache=True, nogil=True, fastmath={"contract"})
def tangent(elements, nodes, slopes, to_reference, dV, F, S, D, place, turned, turns, data):
    """Add to `data` the tangent's upper triangle of `elements`, ``int dN_a A4 dN_b`` with ``A4 = I x S + F D F``.

    `S` is the stress of the geometric part, `D` the material tangent at `F`. `place` (e, p, 2) says for every pair
    ``a <= b`` of an element's nodes where its block begins in `data` and how long its first row is there, negative
    where the later node comes first; see `solid.pattern`. Nodes with ``turned[node] >= 0`` (an empty `turned` if there
    are none) are assembled in the axes ``turns[:, :, turned[node]]`` (rows are the local axes). Same as the
    scikit-fem form in tests/oracles.
    """
    n_basis = nodes.shape[0]
    n_points = slopes.shape[2]
    n_elements = elements.shape[0]
    turning = turned.shape[0] > 0
    R = np.empty((3, 3, _LANES))
    f = np.empty((3, 3, _LANES))
    s = np.empty((6, _LANES))
    d_packed = np.empty((21, _LANES))
    strain = np.empty((9, 6, _LANES))
    stress = np.empty((9, 6, _LANES))
    moduli = np.empty((n_points, 3, 3, 9, _LANES))
    half = np.empty((n_points, 3, 9, _LANES))
    K = np.empty((n_basis, 9, _LANES))
    block = np.empty((3, 3))
    other = np.empty((3, 3))
    for first in range(0, n_elements, _LANES):
        filled = min(_LANES, n_elements - first)
        for lane in range(_LANES):
            e = elements[min(first + lane, n_elements - 1)]
            for d in range(3):
                for k in range(3):
                    R[d, k, lane] = to_reference[d, k, e]
        # Moduli: A4[i, k, j, l] times the volume with its slots k, l carried to the unit cell, so that gradients of the
        # basis there, the same for all elements, apply to it: moduli[q, d, g, 3 i + j].
        for q in range(n_points):
            for lane in range(_LANES):
                e = elements[min(first + lane, n_elements - 1)]
                w = dV[e, q]
                for i in range(3):
                    for k in range(3):
                        f[i, k, lane] = F[i, k, e, q]
                for a in range(6):
                    s[a, lane] = S[a, e, q] * w
                for entry in range(21):
                    d_packed[entry, lane] = D[entry, e, q] * w
            # strain[3 i + d]: the Green strain (shears doubled) of du_i/dxi_d = 1; stress: D times it
            for i in range(3):
                for d in range(3):
                    for lane in range(_LANES):
                        f0, f1, f2 = f[i, 0, lane], f[i, 1, lane], f[i, 2, lane]
                        r0, r1, r2 = R[d, 0, lane], R[d, 1, lane], R[d, 2, lane]
                        strain[3 * i + d, 0, lane] = f0 * r0
                        strain[3 * i + d, 1, lane] = f1 * r1
                        strain[3 * i + d, 2, lane] = f2 * r2
                        strain[3 * i + d, 3, lane] = f0 * r1 + f1 * r0
                        strain[3 * i + d, 4, lane] = f1 * r2 + f2 * r1
                        strain[3 * i + d, 5, lane] = f0 * r2 + f2 * r0
            for c in range(9):
                for lane in range(_LANES):
                    e0, e1, e2 = strain[c, 0, lane], strain[c, 1, lane], strain[c, 2, lane]
                    e3, e4, e5 = strain[c, 3, lane], strain[c, 4, lane], strain[c, 5, lane]
                    for a in range(6):
                        stress[c, a, lane] = (
                            d_packed[_ENTRY[a, 0], lane] * e0
                            + d_packed[_ENTRY[a, 1], lane] * e1
                            + d_packed[_ENTRY[a, 2], lane] * e2
                            + d_packed[_ENTRY[a, 3], lane] * e3
                            + d_packed[_ENTRY[a, 4], lane] * e4
                            + d_packed[_ENTRY[a, 5], lane] * e5
                        )
            for i in range(3):
                for d in range(3):
                    for j in range(i, 3):
                        for lane in range(_LANES):
                            e0, e1, e2 = (
                                strain[3 * i + d, 0, lane],
                                strain[3 * i + d, 1, lane],
                                strain[3 * i + d, 2, lane],
                            )
                            e3, e4, e5 = (
                                strain[3 * i + d, 3, lane],
                                strain[3 * i + d, 4, lane],
                                strain[3 * i + d, 5, lane],
                            )
                            for g in range(3):
                                value = (
                                    e0 * stress[3 * j + g, 0, lane]
                                    + e1 * stress[3 * j + g, 1, lane]
                                    + e2 * stress[3 * j + g, 2, lane]
                                    + e3 * stress[3 * j + g, 3, lane]
                                    + e4 * stress[3 * j + g, 4, lane]
                                    + e5 * stress[3 * j + g, 5, lane]
                                )
                                moduli[q, d, g, 3 * i + j, lane] = value
                                # major symmetry: A4[i, k, j, l] = A4[j, l, i, k]
                                moduli[q, g, d, 3 * j + i, lane] = value
            for d in range(3):
                for lane in range(_LANES):
                    r0, r1, r2 = R[d, 0, lane], R[d, 1, lane], R[d, 2, lane]
                    t0 = r0 * s[0, lane] + r1 * s[3, lane] + r2 * s[5, lane]
                    t1 = r0 * s[3, lane] + r1 * s[1, lane] + r2 * s[4, lane]
                    t2 = r0 * s[5, lane] + r1 * s[4, lane] + r2 * s[2, lane]
                    for g in range(3):
                        value = t0 * R[g, 0, lane] + t1 * R[g, 1, lane] + t2 * R[g, 2, lane]
                        moduli[q, d, g, 0, lane] += value
                        moduli[q, d, g, 4, lane] += value
                        moduli[q, d, g, 8, lane] += value
        pair = 0
        for a in range(n_basis):
            # fetched while the arithmetic goes on, for else most of the adding would be waiting
            for lane in range(filled):
                _fetch_blocks(np.uint64(a), np.uint64(n_basis), np.uint64(pair), place[elements[first + lane]], data)
            for q in range(n_points):
                s0, s1, s2 = slopes[a, 0, q], slopes[a, 1, q], slopes[a, 2, q]
                for lane in range(_LANES):
                    for g in range(3):
                        for c in range(9):
                            half[q, g, c, lane] = (
                                s0 * moduli[q, 0, g, c, lane]
                                + s1 * moduli[q, 1, g, c, lane]
                                + s2 * moduli[q, 2, g, c, lane]
                            )
            for b in range(a, n_basis):
                K[b] = 0.0
                for q in range(n_points):
                    s0, s1, s2 = slopes[b, 0, q], slopes[b, 1, q], slopes[b, 2, q]
                    for lane in range(_LANES):
                        for c in range(9):
                            K[b, c, lane] += (
                                half[q, 0, c, lane] * s0 + half[q, 1, c, lane] * s1 + half[q, 2, c, lane] * s2
                            )
            for lane in range(filled):
                e = elements[first + lane]
                if turning:
                    for b in range(a, n_basis):
                        ta, tb = turned[nodes[a, e]], turned[nodes[b, e]]
                        if ta >= 0 or tb >= 0:
                            for c in range(9):
                                block[c // 3, c % 3] = K[b, c, lane]
                            _turn(block, other, turns, ta, tb)
                            for c in range(9):
                                K[b, c, lane] = block[c // 3, c % 3]
                _add_blocks(np.uint64(a), np.uint64(n_basis), np.uint64(pair), K, np.uint64(lane), place[e], data)
            pair += n_basis - a


def _typed_prefetch(typing_context, array, index):
    """Ask the processor for the cache line of ``array[index]``, which is about to be changed; does nothing else."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address.type, number, number, number])
        ask = builder.module.declare_intrinsic("llvm.prefetch", [address.type], kind)
        # to write, into the nearest cache, data
        builder.call(ask, [address, number(1), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate


# called from kernels, without the first argument
_prefetch: Any = intrinsic(_typed_prefetch)


@njit(cache=True, nogil=True)
def _fetch_blocks(a, n_basis, pair, place, data):
    """Fetch the parts of rows that `_add_blocks` with the same `a` and `pair` will add to."""
    for _ in range(a, n_basis):
        at = np.uint64(place[pair, _ZERO])
        length = np.uint64(abs(np.int64(place[pair, _ONE])))
        pair += _ONE
        # a row of three may lie in two cache lines
        _prefetch(data, at)
        _prefetch(data, at + _TWO)
        _prefetch(data, at + length)
        _prefetch(data, at + length + _ONE)
        at += length + length
        _prefetch(data, at - _THREE)
        _prefetch(data, at - _ONE)


@njit(cache=True, nogil=True)
def _add_blocks(a, n_basis, pair, K, lane, place, data):
    """Add to `data` the blocks of node `a` with itself and with the later nodes of its element, the first at `pair`."""
    for b in range(a, n_basis):
        at = np.uint64(place[pair, _ZERO])
        length = np.int64(place[pair, _ONE])
        pair += _ONE
        # The block of the later node under the earlier one is the transpose; no branch, for it is a toss-up.
        down = _THREE if length > 0 else _ONE
        across = _FOUR - down
        length = np.uint64(abs(length))
        # rows of one node: lengths L, L - 1, L - 2
        data[at] += K[b, _ZERO, lane]
        data[at + _ONE] += K[b, across, lane]
        data[at + _TWO] += K[b, _TWO * across, lane]
        at += length - _ONE
        data[at + _ONE] += K[b, _FOUR, lane]
        data[at + _TWO] += K[b, down + _TWO * across, lane]
        if b > a:  # a diagonal block has its upper half only
            data[at] += K[b, down, lane]
        at += length - _TWO
        data[at + _TWO] += K[b, _EIGHT, lane]
        if b > a:
            data[at] += K[b, _TWO * down, lane]
            data[at + _ONE] += K[b, _TWO * down + across, lane]


@njit(cache=True, nogil=True)
def _turn(block, other, turns, ta, tb):
    """Carry a 3 by 3 block into the axes of its row's and its column's node, in place; -1 leaves a side as it is."""
    if ta >= 0:
        for i in range(3):
            for j in range(3):
                other[i, j] = (
                    turns[i, 0, ta] * block[0, j] + turns[i, 1, ta] * block[1, j] + turns[i, 2, ta] * block[2, j]
                )
        block[:] = other
    if tb >= 0:
        for i in range(3):
            for j in range(3):
                other[i, j] = (
                    block[i, 0] * turns[j, 0, tb] + block[i, 1] * turns[j, 1, tb] + block[i, 2] * turns[j, 2, tb]
                )
        block[:] = other
