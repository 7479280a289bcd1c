"""What a design's stimulation does over time: every waveform of ``[drive]`` as a function that rods and plots call.

A drive is the share of the active tension that acts. Of time alone: how force depends on length and on speed is the
muscle's own affair, in the solid's laws and the rods' curves.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from fem_biobot.design_kinds import DRIVE_NEEDS as NEEDS
from fem_biobot.design_parts import Drive
from fem_biobot.errors import DesignError
from fem_biobot.muscle.drive import PAPER_ACTIVE_FORCE, paper_active_force
from fem_biobot.muscle.twitch import TWITCH, potentiation
from fem_biobot.units import format_quantity

# Gains in force of engineered tissue by training [1]. Ito et al. (2014, doi 10.1038/srep04781): pulses of 0.3 V/mm and
# 4 ms at 1 Hz without pause, force 4.5-fold at day 14. Kim et al. (2019, doi 10.1038/s41598-019-39522-6): electrical
# and mechanical stimulation in turn, 18 % more force after 3 minutes, 31 % after 20.
TRAINING: dict[str, float] = {"none": 1.0, "ito_2014": 4.5, "kim_2019": 1.31}
# Time constants of fatigue [s], with nothing left in the end. Cairns, Taberner and Loiselle (2009, J. Appl. Physiol.):
# isolated mouse muscle, 125 Hz for half of every second; after 90 to 100 s 8 % of the force is left in the fast EDL and
# 41 % in the slow soleus. That it falls as an exponential, and that engineered tissue does the same, are assumptions.
_TIRED_AFTER, _FAST_LEFT, _SLOW_LEFT = 95.0, 0.08, 0.41
FATIGUE: dict[str, float] = {
    "mouse_fast_2009": _TIRED_AFTER / math.log(1.0 / _FAST_LEFT),
    "mouse_slow_2009": _TIRED_AFTER / math.log(1.0 / _SLOW_LEFT),
}
# of the rise of a twitch that a step may take; a coarser one misses its peak by some percent
_STEPS_IN_RISE = 4.0


@dataclass(frozen=True)
class DriveFunction:
    """A drive over time.

    Attributes
    ----------
    description
        What was asked for.
    frequency, amplitude
        Strokes per second [Hz] and largest drive [1]; for twitches the peak of a single one.
    """

    description: Drive
    frequency: float
    amplitude: float

    def __call__(self, t: float) -> float:
        """Drive at a time after the beginning [s]."""
        value = self._scaled * self._shape(self, t)
        return value if self._fatigue_time is None else value * self.tiring(t)

    @cached_property
    def _fatigue_time(self) -> float | None:
        return FATIGUE.get(self.description.fatigue, self.description.fatigue_time)

    @cached_property
    def _shape(self) -> Callable[[DriveFunction, float], float]:
        return _SHAPES[self.description.waveform]

    @cached_property
    def _scaled(self) -> float:
        return self.size

    @property
    def size(self) -> float:
        """Amplitude times what depends on frequency and training."""
        d = self.description
        return self.amplitude * TRAINING[d.training] * d.exercise * _BY_FREQUENCY[d.amplitude_by](self.frequency)

    def tiring(self, t: float) -> float:
        """What fatigue has left of the force ``1 - (1 - rest) (1 - exp(-t / time))``; 1 without it."""
        rest, time = self.description.fatigue_rest, self._fatigue_time
        return 1.0 if time is None else rest + (1.0 - rest) * math.exp(-max(t, 0.0) / time)

    def since(self, t: float) -> list[float]:
        """Times since the stimuli that are still felt at a time, latest first [s]."""
        d = self.description
        reach = TWITCH.reach if d.waveform == "twitch" else 2.0 * (d.pulse_width or 0.0)
        interval = 0.0 if d.pulse_rate is None else 1.0 / d.pulse_rate
        # a time that is meant to be that of a stimulus is rounded to either side of it
        last, early = math.floor(t * self.frequency + 1e-9), -1e-8 / self.frequency
        found = []
        for stroke in range(last, -1, -1):
            begin = t - stroke / self.frequency
            if begin - (d.pulses - 1) * interval > reach:
                break
            found += [s for j in range(d.pulses) if early <= (s := begin - j * interval) <= reach]
        return found

    @property
    def finest(self) -> float | None:
        """Shortest thing in the waveform that a time step must not jump over [s]; None where there is none."""
        d = self.description
        if d.waveform == "twitch":
            return TWITCH.peak_time / _STEPS_IN_RISE
        times = [time for time in (d.pulse_width, d.rc_time) if time is not None]
        return min(times, default=None)

    def check_step(self, step: float) -> None:
        """Refuse a time step that jumps over pulses or over the rise of a twitch, or stimuli that run into each other.

        Raises
        ------
        DesignError
            One line with the key, what was found and what was expected.
        """
        check_train(self.description, self.frequency)
        if self.finest is not None and step > self.finest * (1.0 + 1e-9):
            width = self.finest == self.description.pulse_width
            what = "drive.pulse_width" if width else "drive.rc_time"
            if self.description.waveform == "twitch":
                what = "a quarter of the rise of a twitch"
            raise DesignError(
                f"numerics.step: found {format_quantity(step, 's', digits=4)}, expected at most {what} "
                f"({format_quantity(self.finest, 's', digits=4)}), which a longer step would jump over"
            )


def drive_named(waveform: str) -> Drive:
    """Description of a waveform by its name alone, for those that need no more.

    Raises
    ------
    DesignError
        No such waveform.
    """
    if waveform not in _SHAPES:
        raise DesignError(f"drive.waveform: found {waveform!r}, expected one of: {', '.join(_SHAPES)}")
    return Drive.model_validate({"waveform": waveform})


def drive_function(drive: Drive, frequency: float | None = None, amplitude: float | None = None) -> DriveFunction:
    """Drive over time of a design's ``[drive]``, with another frequency [Hz] or amplitude [1] where they are given."""
    frequency = drive.frequency if frequency is None else frequency
    amplitude = drive.amplitude if amplitude is None else amplitude
    check_train(drive, frequency)
    return DriveFunction(drive, frequency, amplitude)


def check_train(drive: Drive, frequency: float) -> None:
    """Refuse pulses that do not fit into a stroke at this frequency [Hz], or that lack what they are made of."""
    for key in NEEDS.get(drive.waveform, ()):
        if getattr(drive, key) is None:
            raise DesignError(f'drive.{key}: missing, expected a time for drive.waveform "{drive.waveform}"')
    if drive.waveform not in ("pulse", "rc_biphasic", "twitch"):
        return
    phases = 2.0 if drive.waveform == "rc_biphasic" else 1.0
    width = phases * (drive.pulse_width or 0.0)
    period, interval = 1.0 / frequency, 0.0 if drive.pulse_rate is None else 1.0 / drive.pulse_rate
    if drive.pulses > 1 and width > interval * (1.0 + 1e-9):
        raise DesignError(
            f"drive.pulse_width: found {_s(drive.pulse_width)}, expected at most {_s(interval / phases)}: "
            f"pulses at drive.pulse_rate {drive.pulse_rate:g} Hz overlap"
        )
    if (drive.pulses - 1) * interval + width > period * (1.0 + 1e-9):
        key = "drive.pulse_width" if drive.pulses == 1 else "drive.pulses"
        found = _s(drive.pulse_width) if drive.pulses == 1 else drive.pulses
        raise DesignError(
            f"{key}: found {found}, which takes {_s((drive.pulses - 1) * interval + width)}, expected at most the "
            f"period of {frequency:g} Hz ({_s(period)})"
        )


def _s(value: float | None) -> str:
    return format_quantity(value or 0.0, "s", digits=4)


def _abs_sine(drive: DriveFunction, t: float) -> float:
    return abs(math.sin(math.pi * drive.frequency * t))


def _pulse(drive: DriveFunction, t: float) -> float:
    width = drive.description.pulse_width or 0.0
    return float(any(s < width * (1.0 - 1e-9) for s in drive.since(t)))


def _rc_biphasic(drive: DriveFunction, t: float) -> float:
    """Size of the current through an electrode: ``exp(-s / RC)`` in a phase, and again in the opposite one after it."""
    width, time = drive.description.pulse_width or 0.0, drive.description.rc_time or math.inf
    for s in drive.since(t):
        if s < 2.0 * width * (1.0 - 1e-9):
            # a time that rounding leaves just short of the second phase belongs to it
            return math.exp(-(max(s + 1e-9 * width, 0.0) % width) / time)
    return 0.0


def _twitch(drive: DriveFunction, t: float) -> float:
    n, peak = TWITCH.order, TWITCH.peak_time
    return sum(math.exp(n * (math.log(s / peak) + 1.0 - s / peak)) for s in drive.since(t) if s > 0.0)


def _relative_paper(frequency: float) -> float:
    return paper_active_force(frequency)[0] / PAPER_ACTIVE_FORCE[2.0]


_SHAPES: dict[str, Callable[[DriveFunction, float], float]] = {
    "abs_sine": _abs_sine,
    "constant": lambda drive, t: 1.0,
    "pulse": _pulse,
    "rc_biphasic": _rc_biphasic,
    "twitch": _twitch,
}
_BY_FREQUENCY: dict[str, Callable[[float], float]] = {
    "given": lambda frequency: 1.0,
    "paper_2018": _relative_paper,
    "drennan_2025": potentiation,
}
