"""The machine of one angle: both pillars turn by it, the beam is an arc, the muscle a string between them.

What a rod model of closed forms says of a bot of two pillars, in one equation, so that a cause of difference can be
put in by itself and what it does be read off at any tension. ``E I`` is that of the beam, ``L`` its span, ``l`` the
muscle's arm, ``A`` its section; ``p`` the turn of the pillars, of which the beam bends by ``q``:

* beam: an arc of the curvature ``2 q / L``, its energy ``2 E I q^2 / L``
* muscle: shorter by ``d = L (1 - sin q / q) + 2 l sin p``, tensile force ``N = T A - R(1 - d / L)``, with Eq. 2's
  ``R = E_m A (1 - s) / s``
* equilibrium: what the beam resists is what the muscle does, ``4 E I q / L dq/dp = N dd/dp``

Large turns are in it, the stretch of the beam, its shear and its weight are not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from fem_biobot.design import Design

_LARGEST = 1.4  # turn that is looked for [rad]
_SHEAR = 5.0 / 6.0
_RING = 100  # slices of a ring over which compliances are summed


@dataclass(frozen=True)
class Folding:
    """A bot of two pillars as one angle, and what may be changed of it.

    Attributes
    ----------
    design
        Whose numbers count.
    plate
        Fraction by which the beam is more compliant within its span [1].
    ends
        Compliance of its ends and of the pillars, over that of the span [1].
    tissue
        Fraction by which the tissue resists more [1].
    law
        From Eq. 2, 0, to a neo-Hookean strip, 1.
    rigid
        Length of the muscle that cannot shorten [mm].
    clamped
        From a muscle whose ends turn freely, 0, to one whose ends turn with the pillars, 1.
    """

    design: Design
    plate: float = 0.0
    ends: float = 0.0
    tissue: float = 0.0
    law: float = 0.0
    rigid: float = 0.0
    clamped: float = 0.0

    def at(self, tension: float) -> dict[str, float] | None:
        """What the cross-check compares, at a nominal tension [kPa]; None where there is no equilibrium."""
        if not self._unbalanced(_LARGEST, tension) > 0.0:
            return None
        found: Any = brentq(self._unbalanced, 1e-9, _LARGEST, (tension,), xtol=1e-13)
        p = float(found)
        L, s = self.design.span, self.design.value("skeleton")
        q, way = p / (1.0 + self.ends), self._way(p)
        h = s.short_pillar_height + s.long_pillar_height
        stiffness = (self._unbalanced(p + 1e-5, tension) - self._unbalanced(p - 1e-5, tension)) / 2e-5
        return {
            "muscle_force_mN": self._force(way, tension),
            "tip_closing_mm": L * (1.0 - math.sin(q) / q) + h * math.sin(p) + s.pillar_length * (1.0 - math.cos(p)),
            "sagitta_mm": L * (1.0 - math.cos(q)) / (2.0 * q),
            "pillar_rotation_deg": math.degrees(p),
            "curvature_1_per_mm": 2.0 * q / L,
            "strain_energy_uJ": 0.5 * self._couple(p) * p + quad(self._resistance, 0.0, way)[0],
            "fibre_stretch_1": 1.0 - way / (L - self.rigid),
            "frequency_Hz": math.sqrt(max(stiffness, 0.0)),  # in an arbitrary unit: of ratios alone
        }

    def _couple(self, p: float) -> float:
        """What bent beam and ends resist with, by the turn [uJ]."""
        skeleton = self.design.value("skeleton")
        EI = skeleton.material.young * self.design.second_moment / (1.0 + self.plate)
        return 4.0 * EI * p / (self.design.span * (1.0 + self.ends))

    def _way(self, p: float) -> float:
        """Approach of the muscle's ends [mm]."""
        q, L = p / (1.0 + self.ends), self.design.span
        return L * (1.0 - math.sin(q) / q) + 2.0 * self.design.moment_arm * math.sin(p)

    def _strip(self, way: float) -> tuple[float, float]:
        """Stretch of what can shorten, and the modulus ratio of its tangent, of Eq. 2 or of a neo-Hookean strip."""
        s = max(1.0 - way / (self.design.span - self.rigid), 0.05)
        return s, (1.0 - self.law) * s**-2 + self.law * (1.0 + 2.0 * s**-3) / 3.0

    def _resistance(self, way: float) -> float:
        """Passive force of the tissue against an approach [mN]."""
        s, _ = self._strip(way)
        law = (1.0 - self.law) * (1.0 - s) / s + self.law * (s**-2 - s) / 3.0
        return (1.0 + self.tissue) * self.design.value("muscle.material.young") * self.design.junction_section * law

    def _force(self, way: float, tension: float) -> float:
        m = self.design.value("muscle")
        return tension * self.design.junction_section * math.sin(m.theta) - self._resistance(way)

    def lift(self, way: float, force: float) -> float:
        """How far clamped ends lift the line of a pull N, by the turn of a pillar [mm].

        A tensed beam of bending stiffness ``E I`` and shear stiffness ``S`` whose end is turned resists with the couple
        ``z = sqrt(E I N')`` by the turn, ``N' = N / (1 + N / S)``: Timoshenko's beam under axial force, in which the
        turn of the sections fades as ``exp(-x N' / z)``. Between pillar and strip there is a ring of thickness ``w``
        and of ``z_r``, ``N'_r``, in which the load spreads by 45 degrees on every side; together
        ``z_r (z + z_r h) / (z_r + z h)`` with ``h = tanh(w N'_r / z_r)``, over N. Without a ring that is ``z / N``, of
        a rigid one ``w`` more. ``E`` is the tangent of the strip's law, over ``1 - nu^2``: a clamped end is flat.
        """
        if self.clamped == 0.0 or not force > 0.0:
            return 0.0
        m, (_, tangent) = self.design.value("muscle"), self._strip(way)
        area, E, t, w = self.design.junction_section, m.material.young, m.junction_thickness, m.ring_thickness
        nu, width = m.material.poisson, m.junction_width
        EI = tangent * E / (1.0 - nu**2) * area * t**2 / 12.0
        S = _SHEAR * E / (2.0 * (1.0 + nu)) * area
        # height and width of what bears the load over the ring's thickness, over the strip's
        x = w * (np.arange(_RING) + 0.5) / _RING
        height = np.minimum(t + 2.0 * x, max(m.ring_height, t)) / t
        across = np.minimum(width + 2.0 * x, max(self.design.value("skeleton.pillar_width"), width)) / width
        sheared, bent = (float(np.mean(1.0 / (across * height**power))) for power in (1, 3))
        pull, pull_of_ring = force / (1.0 + force / S), force / (1.0 + force * sheared / S)
        strip, ring = math.sqrt(EI * pull), math.sqrt(EI / bent * pull_of_ring)
        h = math.tanh(w * pull_of_ring / ring)
        return self.clamped * ring * (strip + ring * h) / (ring + strip * h) / force

    def _unbalanced(self, p: float, tension: float) -> float:
        """What resists a turn less what drives it [uJ]."""
        way, h = self._way(p), 1e-6
        force = self._force(way, tension)
        arm = (self._way(p + h) - self._way(max(p - h, 1e-12))) / (p + h - max(p - h, 1e-12))
        return self._couple(p) - force * (arm - 2.0 * self.lift(way, force) * p)
