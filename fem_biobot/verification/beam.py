"""Euler-Bernoulli beam between two rigid pillars that a force pulls together below its axis; small strain.

The force F at depth h below the axis bends the span L by the constant moment F h and compresses it by F.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EccentricStrip:
    """Beam of modulus `E`, width `b`, thickness `t`, span `L`, pulled at depth `h` below its axis."""

    E: float
    b: float
    t: float
    L: float
    h: float

    @property
    def EI(self) -> float:
        """Bending stiffness."""
        return self.E * self.b * self.t**3 / 12.0

    @property
    def EA(self) -> float:
        """Stretching stiffness."""
        return self.E * self.b * self.t

    def end_rotation(self, F: float) -> float:
        """``F h L / (2 E I)``."""
        return F * self.h * self.L / (2.0 * self.EI)

    def closure(self, F: float) -> float:
        """Approach of the pillars at depth h, ``F h^2 L / (E I) + F L / (E A)``."""
        return F * self.h**2 * self.L / self.EI + F * self.L / self.EA

    def tip_closing(self, F: float, depths: tuple[float, float]) -> float:
        """Approach of two points at other depths below the axis."""
        return self.end_rotation(F) * sum(depths) + F * self.L / self.EA

    def rise(self, F: float) -> float:
        """Mid-span rise, ``F h L^2 / (8 E I)``."""
        return F * self.h * self.L**2 / (8.0 * self.EI)

    def curvature(self, F: float) -> float:
        """``F h / (E I)``."""
        return F * self.h / self.EI

    def strip_force(self, tension: float, area: float, E_strip: float) -> float:
        """Force of an elastic strip with tension T in series with the beam, ``T A / (1 + E A c / L)``."""
        return tension * area / (1.0 + E_strip * area * self.closure(1.0) / self.L)
