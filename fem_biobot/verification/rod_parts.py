"""Rods by their stiffnesses, straight or drawn as arcs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fem_biobot import Rod, RodMaterial, Section


def straight(n: int, length: float = 1.0, along: Sequence[float] = (1.0, 0.0, 0.0)) -> np.ndarray:
    """Points of a straight rod of `n` elements from the origin, (n + 1, 3) [mm]."""
    return np.linspace(0.0, length, n + 1)[:, None] * np.array(along) / np.linalg.norm(along)


def arc(n: int, radius: float, angle: float) -> np.ndarray:
    """Points on an arc in the plane of x and y that starts at the origin along x and turns to y, (n + 1, 3) [mm]."""
    a = np.linspace(0.0, angle, n + 1)
    return radius * np.stack([np.sin(a), 1.0 - np.cos(a), 0.0 * a], axis=1)


def rod_of(points: Any, stiffness: Sequence[float], *, mass_per_length: float = 0.0, **more: Any) -> Rod:
    """A rod of stiffnesses GA1, GA2, EA [mN], EI1, EI2, GJ [mN mm^2]; its rotary inertia goes with E I / E A."""
    GA1, GA2, EA, EI1, EI2, GJ = stiffness
    section = Section.given(EA, EI1, EI2, GJ, shear_factors=(GA1 / EA, GA2 / EA))
    return Rod(points, section, RodMaterial(young=1.0, density=mass_per_length / EA, shear_modulus=1.0), **more)


def stiff(bending: float = 1.0, other: float = 1e8, twist: float = 1.0) -> tuple[float, ...]:
    """Stiffnesses of a rod that bends and twists and hardly does anything else."""
    return (other, other, other, bending, bending, twist)
