"""What a rod's cross-section and material amount to: areas, moments, shear factors, and the six section stiffnesses.

Directors 1 and 2 lie in the section along its principal axes, director 3 along the rod. Moments of area carry the
director that they are about: ``I1`` resists curvature about director 1. Knows nothing of nodes, elements or designs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import zeta

from fem_biobot.errors import ModelError

Array = NDArray[np.float64]
Point = tuple[float, float]


def _number(what: str, value: object, unit: str, *, zero: bool = False) -> float:
    """The value as a float; refuses what is not a finite number above zero (or zero, if `zero`)."""
    good = isinstance(value, int | float | np.floating | np.integer) and not isinstance(value, bool)
    if not good or not np.isfinite(value) or value < 0.0 or (value == 0.0 and not zero):  # type: ignore[operator]
        limit = "at least" if zero else "above"
        raise ModelError(f"{what}: found {value!r}, expected a finite number {limit} 0 {unit}")
    return float(value)  # type: ignore[arg-type]


def _poisson(value: object) -> float:
    """Poisson's ratio of a stable isotropic material; refuses what is not above -1 and at most 1/2."""
    good = isinstance(value, int | float | np.floating) and not isinstance(value, bool)
    if not good or not -1.0 < value <= 0.5:  # type: ignore[operator]
        raise ModelError(f"poisson: found {value!r}, expected a number above -1 and at most 0.5")
    return float(value)  # type: ignore[arg-type]


@dataclass(frozen=True)
class Section:
    """Cross-section of a rod about its centroid; made by `circle`, `tube`, `rectangle` or `given`.

    Attributes
    ----------
    area
        Area [mm^2].
    shear_factors
        Factors k1, k2 of the shear stiffnesses ``k G area`` along directors 1 and 2 [1].
    I1, I2
        Second moments of area about directors 1 and 2 [mm^4]; no product of inertia.
    J
        Torsion constant [mm^4]; the polar moment for round sections alone.
    radius
        Outer radius of a round section, which touches along its surface [mm]; None for others.
    corners
        Corners in the plane of directors 1 and 2, counter-clockwise [mm]; empty for round sections.
    stretch_factor
        Factor of the stretch stiffness ``E area`` [1]: 0 where a member along the rod carries its stretch.

    Notes
    -----
    Shear factors. The section's shear strain is constant in this theory, the true one is not; the factor corrects the
    energy. By default they are those of G. R. Cowper (1966, The shear coefficient in Timoshenko's beam theory) for
    Poisson's ratio `poisson`, 0 unless given: 5/6 for a rectangle and 6/7 for a circle, which rise to 0.857 and 0.9 at
    one half. They are static, and Cowper's rectangle does not see its aspect. ``shear_factor`` replaces them.

    Limits: torsion is Saint-Venant's, free to warp; sections do not change with strain.
    """

    area: float
    shear_factors: tuple[float, float]
    I1: float
    I2: float
    J: float
    radius: float | None = None
    corners: tuple[Point, ...] = ()
    stretch_factor: float = 1.0

    def __post_init__(self) -> None:
        _number("section area", self.area, "mm^2")
        _number("section stretch_factor", self.stretch_factor, "", zero=True)
        for factor in self.shear_factors:
            _number("section shear_factor", factor, "")
        for name in ("I1", "I2", "J"):
            _number(f"section {name}", getattr(self, name), "mm^4")
        if self.radius is not None:
            _number("section radius", self.radius, "mm")
        if self.corners and (len(self.corners) < 3 or not np.isfinite(self.corners).all()):
            raise ModelError(f"section corners: found {self.corners!r}, expected at least three finite points")

    @property
    def polar(self) -> float:
        """Polar moment ``I1 + I2``, for the rotary inertia about the rod [mm^4]."""
        return self.I1 + self.I2

    def outline(self, n: int = 24) -> Array:
        """Points around the section in the plane of directors 1 and 2, counter-clockwise, (p, 2) [mm].

        Its corners; `n` points for a round section, and on the circle of the same area where nothing else is known.
        """
        if self.corners:
            return np.array(self.corners)
        radius = math.sqrt(self.area / math.pi) if self.radius is None else self.radius
        angle = 2.0 * math.pi * np.arange(n) / n
        return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    @classmethod
    def circle(cls, radius: float, *, poisson: float = 0.0, shear_factor: float | None = None) -> Section:
        """Full circle of `radius` [mm]."""
        return cls.tube(_number("circle radius", radius, "mm"), 0.0, poisson=poisson, shear_factor=shear_factor)

    @classmethod
    def tube(cls, outer: float, inner: float, *, poisson: float = 0.0, shear_factor: float | None = None) -> Section:
        """Circle of radius `outer` with a concentric hole of radius `inner`, below `outer` [mm]."""
        outer, inner = _number("tube outer", outer, "mm"), _number("tube inner", inner, "mm", zero=True)
        if inner >= outer:
            raise ModelError(f"tube inner: found {inner:g} mm, expected less than the outer radius, {outer:g} mm")
        nu = _poisson(poisson)
        # Cowper's factor by m = inner / outer
        full, hole = (1.0 + (inner / outer) ** 2) ** 2, (inner / outer) ** 2
        k = 6.0 * (1.0 + nu) * full / ((7.0 + 6.0 * nu) * full + (20.0 + 12.0 * nu) * hole)
        k = k if shear_factor is None else shear_factor
        wall = (outer - inner) * (outer + inner)
        I = 0.25 * math.pi * wall * (outer**2 + inner**2)  # noqa: E741
        return cls(math.pi * wall, (k, k), I, I, 2.0 * I, radius=outer)

    @classmethod
    def rectangle(
        cls, width: float, height: float, *, poisson: float = 0.0, shear_factor: float | None = None
    ) -> Section:
        """Rectangle, `width` along director 1 and `height` along director 2 [mm]."""
        b, h = _number("rectangle width", width, "mm"), _number("rectangle height", height, "mm")
        nu = _poisson(poisson)
        k = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu) if shear_factor is None else shear_factor
        corners = ((-b / 2, -h / 2), (b / 2, -h / 2), (b / 2, h / 2), (-b / 2, h / 2))
        J = rectangle_torsion(b, h)
        return cls(b * h, (k, k), b * h**3 / 12.0, h * b**3 / 12.0, J, corners=corners)

    @classmethod
    def given(
        cls,
        area: float,
        I1: float,
        I2: float,
        J: float,
        *,
        shear_factors: float | tuple[float, float],
        radius: float | None = None,
        corners: Sequence[Point] = (),
    ) -> Section:
        """Section of known constants; `shear_factors` for both directions or for each, an outline if it has one."""
        both = shear_factors if isinstance(shear_factors, tuple) else (shear_factors, shear_factors)
        return cls(area, both, I1, I2, J, radius, tuple((float(a), float(b)) for a, b in corners))


def rectangle_torsion(width: float, height: float) -> float:
    """Torsion constant of a rectangle [mm^4], to rounding for every aspect.

    Saint-Venant's series (S. P. Timoshenko and J. N. Goodier, Theory of Elasticity, section on rectangular bars), for
    sides ``a >= b``: ``J = a b^3 (1/3 - 64 b / (pi^5 a) sum tanh(n pi a / 2 b) / n^5)`` over odd n.
    """
    a, b = max(width, height), min(width, height)
    # tanh = 1 - 2 / (exp + 1): the sum of 1 / n^5 is known, the rest falls like exp(-n pi)
    total = 31.0 / 32.0 * float(zeta(5.0))
    for n in range(1, 15, 2):
        total -= 2.0 / n**5 * math.exp(-n * math.pi * a / b) / (1.0 + math.exp(-n * math.pi * a / b))
    return a * b**3 * (1.0 / 3.0 - 64.0 * b / (math.pi**5 * a) * total)


@dataclass(frozen=True, kw_only=True)
class RodMaterial:
    """Linear elastic material of a rod, by exactly one of Poisson's ratio and the shear modulus.

    Parameters
    ----------
    young, density
        Young's modulus [kPa] and mass per volume [kg/mm^3], which may be zero.
    poisson
        Poisson's ratio [1], above -1 and at most 1/2: ``G = young / (2 (1 + poisson))``.
    shear_modulus
        G itself [kPa], free of any relation to `young`.

    Notes
    -----
    Resultants are linear in the strains of the rod. Sound while the material's own strains stay small, however far the
    rod turns; in a slender rod they do.
    """

    young: float
    density: float
    poisson: float | None = None
    shear_modulus: float | None = None

    def __post_init__(self) -> None:
        _number("young", self.young, "kPa")
        _number("density", self.density, "kg/mm^3", zero=True)
        if (self.poisson is None) == (self.shear_modulus is None):
            found = "neither" if self.poisson is None else "both"
            raise ModelError(f"rod material: found {found}, expected one of poisson and shear_modulus")
        if self.poisson is not None:
            _poisson(self.poisson)
        if self.shear_modulus is not None:
            _number("shear_modulus", self.shear_modulus, "kPa")

    @property
    def G(self) -> float:
        """Shear modulus [kPa]."""
        if self.shear_modulus is not None:
            return self.shear_modulus
        assert self.poisson is not None
        return self.young / (2.0 * (1.0 + self.poisson))


def stiffness(section: Section, material: RodMaterial) -> Array:
    """Stiffnesses ``GA1, GA2, EA`` [mN] and ``EI1, EI2, GJ`` [mN mm^2] of a section, (6,), shear factors included."""
    E, G = material.young, material.G
    k1, k2 = section.shear_factors
    shear = [G * k1 * section.area, G * k2 * section.area]
    stretch = E * section.stretch_factor * section.area
    return np.array([*shear, stretch, E * section.I1, E * section.I2, G * section.J])
