"""The drive: amplitudes that give the printed forces."""

from __future__ import annotations

import math

import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import DesignError
from fem_biobot.muscle.drive import (
    active_force,
    amplitude_for_force,
    paper_active_force,
    paper_amplitude,
)


def test_amplitudes_give_the_printed_forces() -> None:
    """At 0.5, 1 and 2 Hz the drive makes the active force that the paper's simulation had; 4 Hz is said to be assumed.

    Catches: tension taken for force, gamma or the sine left out, an assumption passed off as printed.
    """
    design = load_design("junction_bot").with_values({"muscle.gamma": 0.8, "muscle.theta": 1.1})
    assert active_force(design) == pytest.approx(0.8 * 1.30 * 0.88 * math.sin(1.1))
    for frequency, force in ((0.5, 0.5), (1.0, 1.0), (2.0, 1.4)):
        amplitude, source = paper_amplitude(design, frequency)
        assert amplitude * active_force(design) == pytest.approx(force)
        assert source.startswith("printed")
    force, source = paper_active_force(4.0)
    assert force == 1.4
    assert "assumption" in source
    assert "2 Hz" in source
    force, source = paper_active_force(1.5)
    assert force == pytest.approx(1.2)
    assert "assumption" in source
    assert paper_active_force(0.2)[0] == 0.5
    with pytest.raises(DesignError, match="found -1 Hz"):
        paper_active_force(-1.0)
    with pytest.raises(DesignError, match=r"muscle\.active_tension: found an active force of 0"):
        amplitude_for_force(load_design("junction_bot").with_values({"muscle.active_tension": 0.0}), 1.0)
    with pytest.raises(DesignError, match="muscle: found none"):
        active_force(load_design("cantilever"))
