"""How firmly a junction's turned ends hold its line of pull, as loads on the muscle alone show it.

Where pillars turn, the ends of the junction turn with them and lift the line along which it pulls, towards the beam:
its arm is shorter, and the pillars bear less for the same force. A rod with the bending stiffness of unit loads lifts
it by a fifth to a third less than the muscle does:

* a ring yields where the strip begins, locally, as a half-space under a couple does, and carries the strip's root with
  the pillar; a rod through the ring bends all along it
* rings that do not lie around the strip's middle turn its roots when they shorten, whatever the pillars do
* the turn of an end fades within a thickness or two, a length on which sections of thick tissue do not stay plane

So the bonds of the muscle's mesh are turned, at load, and the height of the line of pull above the strip's ends is
read from the couple that they bear. What it is without a turn counts as the height of the rod's ends; its bending
stiffness is then the one with which the rod, its ends turned as far, pulls along the same line, and its resistance the
one with which it pulls as hard.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import SolveError
from fem_biobot.link.alone import Pull
from fem_biobot.link.observed import rotation
from fem_biobot.link.strip import STRIP, StripSections, stretches_of, with_strip
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Hold, Muscle
from fem_biobot.rod.statics import RodStep, statics
from fem_biobot.study.reporter import Reporter

# change of a stretch, and of the height that is asked for over itself, at which they are taken as found
_SETTLED, _CLOSE = 1e-5, 1e-3
# first step of a factor's logarithm; share of a height beyond which it is told that no factor gives it
_STEP, _NEAR = 0.2, 0.01
_MOST = 20
# factors on the bending stiffness that are tried; beyond, shear is all that gives
_RANGE = (0.1, 10.0)


def made_firm(
    design: Design, reduced: RodModel, strip: StripSections, pulls: Sequence[Pull], reporter: Reporter
) -> StripSections:
    """The strip with the bending stiffness, and the resistance, that its own pulls with turned bonds ask for.

    Parameters
    ----------
    design, reduced
        What it is of, and its rods from `reduce`.
    strip
        From `strip_from_mesh` with these pulls.
    pulls
        Of which those without a turn say nothing: their factor is that of the one before, or 1.
    reporter
        Told where no factor within a tenth and ten times gives the height that was measured.

    Raises
    ------
    SolveError
        A pull at which the rod finds no state, or not the muscle's force.
    """
    for k, pull in enumerate(pulls):
        if pull.turn:
            strip = _firm_at(design, reduced, strip, k, pull, reporter)
        elif k:
            strip = replace(strip, firmness=_changed(strip.firmness, k, strip.firmness[k - 1]))
    return strip


def _changed(values: np.ndarray, k: int, value: float | np.ndarray) -> np.ndarray:
    found = values.copy()
    found[k] = value
    return found


def _firm_at(
    design: Design, reduced: RodModel, strip: StripSections, k: int, pull: Pull, reporter: Reporter
) -> StripSections:
    """The strip whose line of pull and whose force at one of its pulls are the muscle's."""
    factor = float(strip.firmness[max(k - 1, 0)])
    for _ in range(_MOST):
        factor, line = _factor(design, reduced, strip, pull, float(strip.height[k, 1]), factor)
        strip = replace(strip, firmness=_changed(strip.firmness, k, factor))
        missing = float(strip.force[k]) - line.force
        if abs(missing) < _CLOSE * abs(strip.force[k]):
            break
        # a turned strip goes a longer way than a straight one, and is pressed together by less
        strip = replace(strip, passive=_changed(strip.passive, k, strip.passive[k] + missing))
    else:
        raise SolveError(f"junction alone: found no force of {strip.force[k]:.3g} mN at {pull.tension:.3g} kPa", None)
    if abs(line.height - strip.height[k, 1]) > _NEAR * abs(strip.height[k, 1]):
        reporter.note(
            f"junction at {pull.tension:.3g} kPa: its line of pull is {strip.height[k, 1]:.3g} mm above its ends; the "
            f"rods' is {line.height:.3g} mm, with bending {factor:.3g} times as stiff"
        )
    return strip


def _factor(
    design: Design, reduced: RodModel, strip: StripSections, pull: Pull, wanted: float, before: float
) -> tuple[float, Line]:
    """With which the rod's line of pull is as high as wanted [mm], or nearly, and that line; secants in logarithms."""
    low, high = np.log(_RANGE)
    one = float(np.clip(np.log(before), low, high - _STEP))
    two = one + _STEP
    line = line_of_pull(design, reduced, strip, pull, np.exp(one))
    if abs(line.height - wanted) < _CLOSE * abs(wanted):
        return float(np.exp(one)), line
    first = line.height
    line = line_of_pull(design, reduced, strip, pull, np.exp(two), line.stretch)
    for _ in range(_MOST):
        if abs(line.height - wanted) < _CLOSE * abs(wanted) or line.height == first or two == one:
            break
        ahead = float(np.clip(two + (wanted - line.height) * (two - one) / (line.height - first), low, high))
        one, two, first = two, ahead, line.height
        line = line_of_pull(design, reduced, strip, pull, np.exp(ahead), line.stretch)
    return float(np.exp(two)), line


class Line(NamedTuple):
    """Height of a rod's line of pull above the strip's ends [mm], its force [mN], and the rod's stretches, (s,) [1]."""

    height: float
    force: float
    stretch: np.ndarray


def line_of_pull(
    design: Design,
    reduced: RodModel,
    strip: StripSections,
    pull: Pull,
    firmness: float,
    stretch: np.ndarray | None = None,
) -> Line:
    """Along which a rod pulls whose ends are moved as a pull moves the bonds; its stretches are looked for from some.

    Raises
    ------
    SolveError
        No state, or stretches about which the constants do not settle.
    """
    rise = strip.clamped(pull.approach)[1]
    if stretch is None:
        stretch = np.full(len(strip.EA), 1.0 - pull.approach / design.span)
    for _ in range(_MOST):
        state = _held(design, reduced, strip, pull, firmness, rise, stretch)
        points = state.points(STRIP)
        before, stretch = stretch, stretches_of(strip, points)
        if np.abs(stretch - before).max() < _SETTLED:
            middle = (len(points) - 1) // 2
            muscle = state.model.members[middle]
            assert isinstance(muscle, Muscle)
            force = state.muscle_force(muscle.name) + float(state.resultants(STRIP)[0][middle, 2])
            # the vertical force is none, so the line is level, and at mid-length there is no couple
            height = float(points[len(points) // 2, 2]) - design.value("muscle.junction_height")
            return Line(height, force, stretch)
    raise SolveError(f"junction alone: found no end within {_MOST} rounds at {pull.tension:.3g} kPa", None)


def _held(
    design: Design,
    reduced: RodModel,
    strip: StripSections,
    pull: Pull,
    firmness: float,
    rise: float,
    stretch: np.ndarray,
) -> RodState:
    """The strip alone as a rod whose ends are moved as a pull moves them, about given stretches."""
    made = with_strip(reduced, design, strip, stretch=stretch, firmness=firmness, height=rise)
    rod = next(each for each in made.rods if each.name == STRIP)
    holds = []
    for end, inwards in ((0, 1.0), (-1, -1.0)):
        arm = np.array([0.0, 0.0, rise])
        moved = rotation(inwards * pull.turn) @ arm - arm
        way = (float(moved[0]) + 0.5 * inwards * pull.approach, 0.0, float(moved[2]))
        # from x towards z is a turn against y
        holds.append(Hold((STRIP, end), displacement=way, turn=(0.0, -inwards * pull.turn, 0.0)))
    alone = RodModel([rod], [], [], holds, [], made.members)
    drive = design.drive.amplitude
    return statics(alone, [RodStep(1.0, pull.tension / design.tension(drive))], drive=drive).last
