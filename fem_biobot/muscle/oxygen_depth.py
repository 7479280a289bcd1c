"""How deep oxygen reaches: closed forms for constant consumption, slabs and sections, and the largest thickness.

Closed forms take consumption for constant wherever there is oxygen (half saturation zero) and are what the field of
`muscle.oxygen` tends to. The slab solved on a fine line serves the design rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.optimize import brentq

from fem_biobot.errors import ModelError
from fem_biobot.muscle.oxygen import OxygenField, OxygenLaw, steady_oxygen

Array = NDArray[np.float64]
_LINE = 400


def critical_thickness(law: OxygenLaw) -> float:
    """Thickness of a slab, wetted on both sides, whose middle just gets oxygen at constant consumption [mm].

    Notes
    -----
    Without a film ``sqrt(8 D c_0 / V)``; with one the positive root of ``V t^2 / 8 D + V t / 2 h = c_0``.
    """
    D, V, c = law.diffusivity, law.consumption, law.supply
    if V == 0.0:
        return math.inf
    if law.film is None:
        return math.sqrt(8.0 * D * c / V)
    a, b = V / (8.0 * D), V / (2.0 * law.film)
    return (-b + math.sqrt(b * b + 4.0 * a * c)) / (2.0 * a)


def slab_profile(law: OxygenLaw, thickness: float, x: Array) -> Array:
    """Concentration in a slab at constant consumption, (k,) [mM], at distances from its middle [mm].

    Notes
    -----
    ``c = c_s - V (a^2 - x^2) / 2 D`` with ``a`` half the thickness and ``c_s = c_0 - V a / h``; with an anoxic core of
    half width ``a_0``, ``c = V (|x| - a_0)^2 / 2 D`` outside it.
    """
    D, V = law.diffusivity, law.consumption
    half = thickness / 2.0
    if thickness <= critical_thickness(law):
        surface = law.supply - (0.0 if law.film is None else V * half / law.film)
        return surface - V * (half**2 - x**2) / (2.0 * D)
    # the depth that oxygen reaches is half of what a slab of critical thickness has
    core = half - critical_thickness(law) / 2.0
    return V * np.maximum(np.abs(x) - core, 0.0) ** 2 / (2.0 * D)


def anoxic_radius(law: OxygenLaw, radius: float) -> float:
    """Radius of the anoxic core of a long cylinder wetted all round, at constant consumption [mm]; 0 without one.

    Notes
    -----
    Krogh and Hill's profile ``c = V (r^2 - r_0^2 - 2 r_0^2 ln(r / r_0)) / 4 D``, with ``c`` at the surface ``c_0``
    less ``V (R^2 - r_0^2) / 2 R h`` across the film.
    """
    D, V = law.diffusivity, law.consumption

    def missing(core: float) -> float:
        log = core**2 * math.log(radius / core) if core > 0.0 else 0.0
        film = 0.0 if law.film is None else V * (radius**2 - core**2) / (2.0 * radius * law.film)
        return V * (radius**2 - core**2 - 2.0 * log) / (4.0 * D) + film - law.supply

    if missing(0.0) <= 0.0:
        return 0.0
    return _root(missing, 0.0, radius, 1e-14 * radius)


def slab(law: OxygenLaw, thickness: float, elements: int = _LINE) -> OxygenField:
    """Oxygen across half of a slab wetted on both sides, from its middle (0) to its surface, finer toward it."""
    if not (math.isfinite(thickness) and thickness > 0.0):
        raise ModelError(f"thickness: found {thickness:g} mm, expected above 0 mm")
    mesh = skfem.MeshLine(np.linspace(0.0, thickness / 2.0, elements + 1))
    return steady_oxygen(mesh, law, np.array([elements]))


def slab_gamma(law: OxygenLaw, thickness: float) -> float:
    """Viable share of a slab wetted on both sides [1]; the edge of the core is found between the nodes."""
    field = slab(law, thickness)
    at = field.basis.doflocs[0]
    order = np.argsort(at)
    x, excess = at[order], field.c[order] - law.threshold
    if excess[0] >= 0.0:
        return 1.0
    if excess[-1] < 0.0:
        return 0.0
    k = int(np.argmax(excess >= 0.0))
    edge = x[k - 1] - excess[k - 1] * (x[k] - x[k - 1]) / (excess[k] - excess[k - 1])
    return float(1.0 - edge / x[-1])


def largest_thickness(law: OxygenLaw, gamma: float = 0.95) -> float:
    """Largest thickness of a slab, wetted on both sides, of which the share `gamma` is viable [mm].

    Infinite without consumption.

    Raises
    ------
    ModelError
        A share outside (0, 1).
    """
    if not 0.0 < gamma < 1.0:
        raise ModelError(f"gamma: found {gamma:g}, expected a share between 0 and 1")
    if law.consumption == 0.0:
        return math.inf
    high = 2.0 * critical_thickness(replace(law, half_saturation=1e-9 * law.supply)) / gamma
    # half saturation slows the use of oxygen in the depth, so tissue may be thicker than constant consumption allows
    for _ in range(60):
        if slab_gamma(law, high) < gamma:
            break
        high *= 1.5
    low = 1e-3 * high
    while slab_gamma(law, low) < gamma:
        low *= 0.1
    return _root(lambda t: slab_gamma(law, t) - gamma, low, high, 1e-6 * high)


def _root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    found = brentq(function, low, high, xtol=tolerance)
    assert isinstance(found, float)
    return found


def section(law: OxygenLaw, width: float, thickness: float, across: int = 48) -> OxygenField:
    """Oxygen in a quarter of a rectangular section wetted all round, `across` elements over half the thickness."""
    small, large = sorted((width / 2.0, thickness / 2.0))
    along = round(across * min(large / small, 3.0))
    # elements crowd where the section ends; in its middle it is a slab
    s = np.linspace(0.0, 1.0, along + 1)
    long_side = large * (1.0 - (1.0 - s) ** 1.5)
    mesh = skfem.MeshQuad.init_tensor(long_side, np.linspace(0.0, small, across + 1))
    middle = mesh.p[:, mesh.facets].mean(axis=1)
    wet = (np.abs(middle[0] - large) < 1e-9 * large) | (np.abs(middle[1] - small) < 1e-9 * small)
    return steady_oxygen(mesh, law, np.flatnonzero(wet))


def consumption_for(share: Callable[[OxygenLaw], float], law: OxygenLaw, gamma: float) -> float:
    """Consumption at which the viable share of some tissue falls to `gamma` [mM/s].

    Parameters
    ----------
    share
        Viable share of the tissue under a law, falling with its consumption.
    law
        The law, whose own consumption is where the search begins.
    gamma
        Wanted, between 0 and 1 [1].

    Raises
    ------
    ModelError
        A share that is not between 0 and 1, or that no consumption up to a million times the first one reaches.
    """
    if not 0.0 < gamma < 1.0:
        raise ModelError(f"gamma: found {gamma:g}, expected a share between 0 and 1")

    def over(log: float) -> float:
        return share(replace(law, consumption=math.exp(log))) - gamma

    low = math.log(law.consumption)
    step = math.log(2.0)
    while over(low) < 0.0:
        low -= step
    high = low + step
    while over(high) > 0.0:
        high += step
        if high > low + 20.0 * step:
            raise ModelError(f"gamma: found a share above {gamma:g} at any consumption, expected one that falls to it")
    return math.exp(_root(over, high - step, high, 1e-5))
