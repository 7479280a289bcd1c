"""Printed numbers of other machines than the junction bot: the small ring bot, Raman's ring, the swimmer's twitches.

Each is predicted with what is printed of its machine and no more; where that is not enough, the reason is told.
"""

from __future__ import annotations

import numpy as np

from fem_biobot.config import load_design
from fem_biobot.equations import equation_1
from fem_biobot.errors import BiobotError
from fem_biobot.link.observed import Observed
from fem_biobot.link.rod_side import RodSide
from fem_biobot.link.solid_side import SolidSide
from fem_biobot.mesh.committed import mesh_for
from fem_biobot.muscle.twitch import DRENNAN_TRAINS, fit_twitch
from fem_biobot.rod.reduce import Strands, reduce
from fem_biobot.study.claims import Claim
from fem_biobot.study.paper import RING_BOT_FORCE, Printed
from fem_biobot.study.reporter import Reporter, Silent

_SIZE = 1.0  # mm, of the ring bot's mesh; its force changes by 0.4 % from there to 0.7 mm
_SHARES = (0.3, 0.6, 1.0)  # of the passive tension, along the path there
# facts/validation_robots.csv, Raman et al. 2016 as quoted in abstracts
_RAMAN_PASSIVE, _RAMAN_ACTIVE = (1.7, 3.2), (0.300, 0.56)  # mN, kPa
_RAMAN = "Raman et al. 2016, abstracts, facts/validation_robots.csv"
_DRENNAN = "Drennan et al. 2025, raw data, facts/drennan_force_frequency.csv"
_SWIMMER_FITTED = 2.0  # Hz; single twitches up to here are what the kernel was fitted to


def other_machines(reporter: Reporter) -> list[Claim]:
    """Claims of the ring bot, Raman's ring and the swimmer, and those of the paper that need no machine."""
    reporter.stage("other machines", 1)
    found = [*_ring_bot(reporter), *_raman(), *_swimmer(), *_plain()]
    reporter.advance("ring bot, Raman's ring, the swimmer's twitches")
    return found


def _ring_bot(reporter: Reporter) -> list[Claim]:
    """The small ring bot's force by both models; rods in both readings of a ring that passes its pillars."""
    design = load_design("ring_bot").with_values({"mesh.size": _SIZE})
    tensions = [share * design.tension(0.0) for share in _SHARES]
    seen: dict[str, Observed] = {}
    try:
        mesh, notes = mesh_for(design)
        for note in notes:
            reporter.note(f"ring bot: {note}")
        seen["solid"] = SolidSide(design, mesh).states(tensions, Silent())[0][-1]
        for strands in Strands:
            seen[strands] = RodSide(design, reduce(design, strands=strands)).states(tensions, Silent())[0][-1]
    except BiobotError as failure:
        reporter.note(f"ring bot: {failure}")
    force = {name: state.numbers["muscle_force_mN"] for name, state in seen.items()}
    closing = ", ".join(f"{words} {seen[name].numbers['tip_closing_mm']:.2f} mm" for name, words in
                        (("solid", "the solid closes by"), (Strands.slide, "rods whose ring slides by"),
                         (Strands.bonded, "rods whose ring is stuck by")) if name in seen)  # fmt: skip
    printed = "the paper's Eq. 2 with a strain that it does not print; its drawing is assumed"
    return [
        Claim(
            "force of the ring bot",
            RING_BOT_FORCE,
            force.get("solid"),
            force.get(Strands.slide),
            why=f"{printed}; {closing}: the solid's ring, bonded and going around, is between the two",
        ),
        Claim(
            "force of the ring bot, its ring stuck",
            RING_BOT_FORCE,
            rods=force.get(Strands.bonded),
            why=f"{printed}; over half the length, so it resists twice as much per closing",
        ),
        Claim(
            "force of the small walker before", Printed(0.2, "mN", "section 1, of an earlier work"),
            why="neither its tissue nor its drawing is printed",
        ),
    ]  # fmt: skip


def _raman() -> list[Claim]:
    """Of one section the passive force and stress give it, and the active stress then its force."""
    section = _RAMAN_PASSIVE[0] / _RAMAN_PASSIVE[1]
    drawing = "the ring's force is printed, the drawing of its machine is not"
    return [
        Claim(
            "active force of Raman's ring",
            Printed(_RAMAN_ACTIVE[0], "mN", _RAMAN),
            equations=float(equation_1(_RAMAN_ACTIVE[1], section, np.pi / 2, 1.0)),
            why=f"Eq. 1 with the section of {section:.2f} mm^2 that its passive force and stress have; {drawing}",
        ),
        Claim("speed of Raman's machine", Printed(310.0, "um/s", _RAMAN), why=drawing),
    ]


def _swimmer() -> list[Claim]:
    """Trains of twitches as sums of the single twitch, at rates that the single one was not taken from."""
    fit = fit_twitch()
    claims = []
    for rate, (_, steady, _) in DRENNAN_TRAINS.items():
        if rate <= _SWIMMER_FITTED:
            continue
        whole = fit.peak * fit.twitch.train(rate, np.linspace(0.0, 1.0 / rate, 501))
        claims.append(
            Claim(
                f"swimmer's ring, largest at {rate:g} Hz",
                Printed(steady, "um", _DRENNAN),
                equations=float(whole.max()),
                why="sum of equal twitches, fitted to single ones at 0.5 to 2 Hz alone",
            )
        )
    claims.append(
        Claim(
            "speed of the swimmer", Printed(86.8, "um/s", "Drennan et al. 2025, abstract"),
            why="it swims by a tail in a fluid, of which neither model knows",
        )
    )  # fmt: skip
    return claims


def _plain() -> list[Claim]:
    """What the paper prints of tissue alone."""
    return [
        Claim(
            "force expected of 1 mm^2 of muscle",
            Printed(10.0, "mN", "section 2.3"),
            equations=float(equation_1(10.39, 1.0, np.pi / 2, 1.0)),
            bound=">",
            why="Eq. 1 with the printed stress",
        ),
        Claim(
            "length of myotube- over myoblast-seeded fibres", Printed(1.5, "1", "section 2.2"),
            why="growth of myotubes is not modelled",
        ),
        Claim(
            "largest force of a biohybrid tissue before", Printed(1.18, "mN", "section 1, of an earlier work"),
            why="a cardiac stack, of which nothing else is printed",
        ),
    ]  # fmt: skip
