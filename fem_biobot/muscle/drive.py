"""How strong a design's muscle is, and which amplitude of the drive gives it the forces of the paper's simulation.

A drive is the share of the active tension that acts, mostly between 0 and 1; more than 1 is a muscle stronger than the
design's. What it does over time is in `muscle.waveforms`.
"""

from __future__ import annotations

import math

from fem_biobot.design import Design
from fem_biobot.equations import equation_1
from fem_biobot.errors import DesignError
from fem_biobot.muscle.oxygenation import viable_gamma

# sim_active_force in facts/seed_simulation.csv: what the paper's own simulation applied, by frequency [Hz: mN]
PAPER_ACTIVE_FORCE = {0.5: 0.5, 1.0: 1.0, 2.0: 1.4}


def active_force(design: Design) -> float:
    """Force that full drive adds to a muscle held at its length, all strands together [mN]: Eq. 1 of the paper."""
    muscle = design.value("muscle")
    if muscle is None:
        raise DesignError(f"muscle: found none (kind {design.kind}), expected one for an active force")
    return float(equation_1(muscle.active_tension, design.junction_section, muscle.theta, viable_gamma(design)))


def amplitude_for_force(design: Design, force: float) -> float:
    """Drive at which the muscle's active force is `force` [mN]; may be more than 1.

    The force is that of the muscle held at its length. On the pillars of a moving machine less arrives, by what the
    shortening tissue resists.
    """
    full = active_force(design)
    if not full > 0.0:
        raise DesignError(f"muscle.active_tension: found an active force of {full:g} mN, expected one above 0 mN")
    return force / full


def paper_active_force(frequency: float) -> tuple[float, str]:
    """Active force that the paper's simulation applied at a frequency [mN], and where it is from.

    Notes
    -----
    Printed at 0.5, 1 and 2 Hz: 0.5, 1.0 and 1.4 mN. Between, linear in frequency; outside, that of the nearest printed
    frequency. No force is printed at 4 Hz: that of 2 Hz is taken there, an assumption, which the second value says.
    """
    if not (math.isfinite(frequency) and frequency > 0.0):
        raise DesignError(f"drive.frequency: found {frequency:g} Hz, expected above 0 Hz")
    printed = sorted(PAPER_ACTIVE_FORCE)
    if frequency in PAPER_ACTIVE_FORCE:
        return PAPER_ACTIVE_FORCE[frequency], "printed (sim_active_force)"
    if frequency <= printed[0] or frequency >= printed[-1]:
        nearest = printed[0] if frequency < printed[0] else printed[-1]
        return PAPER_ACTIVE_FORCE[nearest], f"assumption: none printed, that of {nearest:g} Hz"
    above = next(f for f in printed if f > frequency)
    below = printed[printed.index(above) - 1]
    share = (frequency - below) / (above - below)
    low, high = PAPER_ACTIVE_FORCE[below], PAPER_ACTIVE_FORCE[above]
    return low + share * (high - low), f"assumption: between those of {below:g} and {above:g} Hz"


def paper_amplitude(design: Design, frequency: float) -> tuple[float, str]:
    """Drive amplitude with which a design's muscle has `paper_active_force`, and where that is from."""
    force, source = paper_active_force(frequency)
    return amplitude_for_force(design, force), source
