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
stiffness is then the one with which the rod, its ends turned as far, pulls along the same line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import SolveError
from fem_biobot.link.alone import Pull
from fem_biobot.link.observed import rotation
from fem_biobot.link.strip import STRIP, StripSections, stretches_of, with_strip
from fem_biobot.rod.model import RodModel, RodState
from fem_biobot.rod.records import Hold
from fem_biobot.rod.statics import RodStep, reaction, statics
from fem_biobot.study.reporter import Reporter

# change of a stretch, and of the height that is asked for over itself, at which they are taken as found
_SETTLED, _CLOSE = 1e-5, 1e-3
_MOST = 20
# factors on the bending stiffness that are tried; beyond, shear is all that gives
_RANGE = (0.1, 10.0)


def made_firm(
    design: Design, reduced: RodModel, strip: StripSections, pulls: Sequence[Pull], reporter: Reporter
) -> StripSections:
    """The strip with the factors on its bending stiffness that its own pulls ask for.

    Parameters
    ----------
    design, reduced
        What it is of, and its rods from `reduce`.
    strip
        From `pulled` with these pulls.
    pulls
        Of which those without a turn say nothing: their factor is that of the one before, or 1.
    reporter
        Told where no factor within a tenth and ten times gives the height that was measured.

    Raises
    ------
    SolveError
        A pull at which the rod finds no state.
    """
    found: list[float] = []
    for pull, (_, wanted) in zip(pulls, strip.height, strict=True):
        before = found[-1] if found else 1.0
        found.append(_factor(design, reduced, strip, pull, wanted, before, reporter) if pull.turn else before)
    return replace(strip, firmness=np.array(found))


def _factor(
    design: Design,
    reduced: RodModel,
    strip: StripSections,
    pull: Pull,
    wanted: float,
    before: float,
    reporter: Reporter,
) -> float:
    """With which the rod's line of pull is as high as wanted [mm]: secants through logarithms, from a guess."""
    stretch = np.full(len(strip.EA), 1.0 - pull.approach / design.span)

    def height(factor: float) -> float:
        nonlocal stretch
        found, stretch = line_height(design, reduced, strip, pull, factor, stretch)
        return found

    low, high = np.log(_RANGE)
    one, two = np.log(before), np.log(before) + 0.2
    first, second = height(np.exp(one)), height(np.exp(two))
    for _ in range(_MOST):
        if abs(second - wanted) < _CLOSE * abs(wanted) or second == first or two == one:
            break
        ahead = np.clip(two + (wanted - second) * (two - one) / (second - first), low, high)
        one, two, first, second = two, ahead, second, height(np.exp(ahead))
    if not abs(second - wanted) < _CLOSE * abs(wanted):
        reporter.note(
            f"junction at {pull.tension:.3g} kPa: its line of pull is {wanted:.3g} mm above its ends, the rods' "
            f"{second:.3g} mm with bending {np.exp(two):.3g} times as stiff, the nearest found; trust the rods' arm "
            "no further, and try a finer mesh"
        )
    return float(np.exp(two))


def line_height(
    design: Design, reduced: RodModel, strip: StripSections, pull: Pull, firmness: float, stretch: np.ndarray
) -> tuple[float, np.ndarray]:
    """Height of a rod's line of pull above the strip's ends as the bonds move them [mm], and its stretches, from some.

    Raises
    ------
    SolveError
        No state, or stretches about which the constants do not settle.
    """
    rise = strip.clamped(pull.approach)[1]
    for _ in range(_MOST):
        state = _held(design, reduced, strip, pull, firmness, rise, stretch)
        points = state.points(STRIP)
        before, stretch = stretch, stretches_of(strip, points)
        if np.abs(stretch - before).max() < _SETTLED:
            # from the ends' couples, as in `alone.heights`: a short or slack strip has one at mid-length, too
            held = [(points[end, 2], reaction(state, (STRIP, end))) for end in (0, -1)]
            lines = [z + wrench[4] / wrench[0] for z, wrench in held]
            return float(np.mean(lines)) - design.value("muscle.junction_height"), stretch
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
