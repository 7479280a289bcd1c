"""Energies written in invariants: tensors from scalar derivatives, and invariants freed of the volume.

A law says its energy's first and second derivatives by the invariants; everything with tensors in it is here once. The
invariants are ``I1 = tr C``, ``I2 = (I1^2 - tr C^2)/2``, with a unit fibre ``a0`` also ``I4 = a0 . C a0`` and
``I5 = a0 . C^2 a0``, and ``J = det F``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fem_biobot.material.law import Array, inverse, volume_ratio

# the invariant with number 1, 2, 4, 5 is this degree in C: freed of the volume by J^(-2/3) to that power
_DEGREE = {1: 1, 2: 2, 4: 1, 5: 2}


class Scalars(NamedTuple):
    """Energy of a law and its derivatives by the invariants numbered 1, 2, 4, 5; absent ones are zero.

    ``first[1]`` is ``dW/dI1``, ``second[1, 4]`` is ``d2W/dI1 dI4`` (the lower number first), (...) [kPa] each. An
    invariant in ``second`` is in ``first`` too.
    """

    energy: Array
    first: Mapping[int, Array | float]
    second: Mapping[tuple[int, int], Array | float]


class Derivatives(NamedTuple):
    """Energy and its derivatives by all invariants, J last: ``first`` (n, ...), ``second`` (n (n + 1)/2, ...)."""

    energy: Array
    first: Array
    second: Array


def order(fibres: bool) -> tuple[int, ...]:
    """Numbers of the invariants before J in their order."""
    return (1, 2, 4, 5) if fibres else (1, 2)


def invariants(F: Array, a0: Array | None) -> Array:
    """Invariants of ``F`` (3, 3, ...) with fibres `a0` (3, ...) or none, J last, (5 or 3, ...) [1]."""
    J = volume_ratio(F)
    C = np.einsum("ni...,nj...->ij...", F, F)
    I1 = np.einsum("ii...->...", C)
    I2 = 0.5 * (I1**2 - np.einsum("ij...,ij...->...", C, C))
    if a0 is None:
        return np.stack([I1, I2, J])
    Ca = np.einsum("ij...,j...->i...", C, a0)
    I4 = np.einsum("i...,i...->...", a0, Ca)
    return np.stack([I1, I2, I4, np.einsum("i...,i...->...", Ca, Ca), J])


def without_volume(values: Array) -> dict[int, Array]:
    """Invariants of ``J^(-1/3) F`` by their number, from those of ``F`` with J last, (n, ...) [1]."""
    shrink = _powers(values[-1])
    return {number: shrink[_DEGREE[number]] * values[k] for k, number in enumerate(order(len(values) == 5))}


def _powers(J: Array) -> list[Array]:
    """``J^(-2/3)`` to the powers 0 to 4."""
    one = 1.0 / np.cbrt(J) ** 2
    two = one * one
    return [np.ones_like(J), one, two, two * one, two * two]


def assembled(
    values: Array, isochoric: Scalars, direct: Scalars | None, volumetric: tuple[Array, Array, Array]
) -> Derivatives:
    """Derivatives by the invariants of ``F`` of an energy in three parts.

    Parameters
    ----------
    values
        Invariants, J last, (n, ...) [1].
    isochoric
        Part in the invariants without volume.
    direct
        Part in the invariants themselves, if any.
    volumetric
        Energy of the change of volume and its first two derivatives by J, (...) [kPa] each.

    Notes
    -----
    With ``K_a = J^(-p_a) I_a`` and p = 2/3, 4/3, 2/3, 4/3 the chain rule gives ``W_a = w_a J^(-p_a)``,
    ``W_J = -sum p_a w_a K_a / J`` and so on.
    """
    J, numbers = values[-1], order(len(values) == 5)
    n, bar, shrink = len(values), without_volume(values), _powers(values[-1])
    place = {(a, b): a * n - a * (a - 1) // 2 + b - a for a in range(n) for b in range(a, n)}
    first = np.zeros_like(values)
    second = np.zeros((n * (n + 1) // 2, *values.shape[1:]))
    energy = isochoric.energy + volumetric[0]
    first[-1] += volumetric[1]
    second[-1] += volumetric[2]
    index = {number: k for k, number in enumerate(numbers)}
    slide: dict[int, Array | float] = dict.fromkeys(numbers, 0.0)  # sum over b of w_ab p_b K_b
    for (a, b), w in isochoric.second.items():
        second[place[index[a], index[b]]] += w * shrink[_DEGREE[a] + _DEGREE[b]]
        slide[a] = slide[a] + w * (2.0 / 3.0 * _DEGREE[b]) * bar[b]
        if a != b:
            slide[b] = slide[b] + w * (2.0 / 3.0 * _DEGREE[a]) * bar[a]
    for a in numbers:
        if a not in isochoric.first:
            continue
        p, w = 2.0 / 3.0 * _DEGREE[a], isochoric.first[a]
        per_volume = bar[a] / J
        first[index[a]] += w * shrink[_DEGREE[a]]
        first[-1] -= p * w * per_volume
        second[place[index[a], n - 1]] -= shrink[_DEGREE[a]] / J * (p * w + slide[a])
        second[-1] += p * per_volume / J * ((1.0 + p) * w + slide[a])
    if direct is not None:
        energy = energy + direct.energy
        for a, w in direct.first.items():
            first[index[a]] += w
        for (a, b), w in direct.second.items():
            second[place[index[a], index[b]]] += w
    return Derivatives(energy, first, second)


def _gradients(F: Array, a0: Array | None) -> tuple[list[Array], Array, Array]:
    """Derivatives of the invariants by ``F``, each (3, 3, ...), and ``C`` and ``F^-1``."""
    C = np.einsum("ni...,nj...->ij...", F, F)
    g, J = inverse(F), volume_ratio(F)
    I1 = np.einsum("ii...->...", C)
    FC = np.einsum("im...,mk...->ik...", F, C)
    found = [2.0 * F, 2.0 * (I1 * F - FC)]
    if a0 is not None:
        Fa, Ca, FCa = (np.einsum("ij...,j...->i...", A, a0) for A in (F, C, FC))
        found.append(2.0 * np.einsum("i...,k...->ik...", Fa, a0 * np.ones_like(I1)))
        found.append(2.0 * (np.einsum("i...,k...->ik...", Fa, Ca) + np.einsum("i...,k...->ik...", FCa, a0)))
    found.append(J * g.swapaxes(0, 1))
    return found, C, g


def first_piola(F: Array, a0: Array | None, derivatives: Derivatives) -> Array:
    """First Piola stress from the derivatives by the invariants, (3, 3, ...) [kPa]."""
    gradients, _, _ = _gradients(F, a0)
    total = np.zeros_like(F)
    for w, G in zip(derivatives.first, gradients, strict=True):
        total += w * G
    return total


def tangent(F: Array, a0: Array | None, derivatives: Derivatives) -> Array:
    """Tangent ``dP/dF`` from the derivatives by the invariants, (3, 3, 3, 3, ...) [kPa]; has major symmetry."""
    G, C, g = _gradients(F, a0)
    n, place = len(G), 0
    A4 = np.zeros((3, 3, *F.shape))
    for a in range(n):
        for b in range(a, n):
            both = np.einsum("ik...,jl...->ikjl...", G[a], G[b])
            A4 += derivatives.second[place] * (both if a == b else both + np.moveaxis(both, (2, 3), (0, 1)))
            place += 1
    eye = np.eye(3)
    I1, J = np.einsum("ii...->...", C), volume_ratio(F)
    b = np.einsum("in...,jn...->ij...", F, F)
    identity = np.einsum("ij,kl->ikjl", eye, eye).reshape((3, 3, 3, 3) + (1,) * (F.ndim - 2))
    w = derivatives.first
    A4 += 2.0 * w[0] * identity
    A4 += (
        w[1]
        * 2.0
        * (
            2.0 * np.einsum("ik...,jl...->ikjl...", F, F)
            + I1 * identity
            - np.einsum("ij,kl...->ikjl...", eye, C)
            - np.einsum("il...,jk...->ikjl...", F, F)
            - np.einsum("ij...,kl->ikjl...", b, eye)
        )
    )
    if a0 is not None:
        a = a0 * np.ones_like(I1)
        Fa, Ca = np.einsum("ij...,j...->i...", F, a), np.einsum("ij...,j...->i...", C, a)
        A4 += w[2] * 2.0 * np.einsum("ij,k...,l...->ikjl...", eye, a, a)
        A4 += (
            w[3]
            * 2.0
            * (
                np.einsum("ij,k...,l...->ikjl...", eye, Ca, a)
                + np.einsum("ij,k...,l...->ikjl...", eye, a, Ca)
                + np.einsum("i...,j...,kl->ikjl...", Fa, Fa, eye)
                + np.einsum("i...,jk...,l...->ikjl...", Fa, F, a)
                + np.einsum("il...,j...,k...->ikjl...", F, Fa, a)
                + np.einsum("ij...,k...,l...->ikjl...", b, a, a)
            )
        )
    wJ = w[-1] * J
    A4 += wJ * (np.einsum("ki...,lj...->ikjl...", g, g) - np.einsum("kj...,li...->ikjl...", g, g))
    return A4
