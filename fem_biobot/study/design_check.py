"""Will it work? A design judged row by row: by closed forms, and by its states and walks where there are any.

A verdict says on which side of its limit a number lies; numbers within a fifth of the limit are called close. Limits
say where they come from, or that they are assumptions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from fem_biobot.design import Design
from fem_biobot.errors import DesignError
from fem_biobot.muscle.oxygenation import viable_gamma
from fem_biobot.study.bow import Bow, bow, buckling_load, full_pull, held_closing, weight
from fem_biobot.study.bow_view import bow_view
from fem_biobot.study.finding import Finding
from fem_biobot.tables import Table

Numbers = Mapping[str, Any]

# a number that is on the right side of its limit by less than this share is called close
_CLOSE = 0.2
# rise of the beam over its span that counts as bent
LEAST_RISE = 0.01
# shortest fibre that still pulls, over its length of greatest force
SHORTEST_FIBRE = 1.27 / 2.125
# nominal strain that the gel bears
MOST_GEL_STRAIN = 0.3
# tissue that oxygen is taken to reach from one side [mm]
DIFFUSION_LIMIT = 0.2
LEAST_GAMMA = 0.95


class Verdict(StrEnum):
    """Side of the limit: good, close to it, bad."""

    good = "good"
    close = "close"
    bad = "bad"


@dataclass(frozen=True)
class Check:
    """One row.

    Attributes
    ----------
    name
        What is asked.
    by
        Who answers: closed form, solid or rods.
    value, limit
        In `unit`; no number where the answer is none.
    at_least
        Whether the value must be above the limit, or below.
    verdict, why
        And the reason in words.
    source
        Of the limit.
    """

    name: str
    by: str
    value: float | None
    limit: float | None
    unit: str
    at_least: bool
    verdict: Verdict
    why: str
    source: str


def design_check(
    design: Design,
    *,
    solid: Numbers | None = None,
    gel_strain: float | None = None,
    walks: Sequence[Numbers] = (),
) -> tuple[Check, ...]:
    """Rows of a design; none for a machine without a muscle or without feet.

    Parameters
    ----------
    design
        A bot, or any other.
    solid
        Summary of its solid, ``states`` and ``stroke``, as a run has it.
    gel_strain
        Strain that one percent of the gel exceeds at full drive, see `solid.strains` [1].
    walks
        Summaries of its walks.
    """
    if design.kind != "bot":
        return ()
    drive = design.drive.amplitude
    rest, full = bow(design, 0.0), bow(design, drive)
    rows = [_bends(design, full.sagitta, "closed form", full), *_collapses(design, full), *_strains(full)]
    peak, stroke = _of_full_drive(design, solid)
    if peak is not None:
        rows.append(_bends(design, float(peak["sagitta_mm"]), "solid", None))
        rows.append(_touches(str(peak["touching"])))
        rows.append(_fibre(float(peak["fibre_stretch_1"]), "solid"))
    if gel_strain is not None:
        rows.append(_gel(gel_strain, "solid"))
    rows += _oxygen(design)
    if len(design.pillars) == 2:
        rows.append(_slides(design, full.closing - rest.closing, "closed form"))
        if stroke is not None:
            rows.append(_slides(design, stroke, "solid"))
    rows += _walked(design, walks)
    return tuple(rows)


def check_finding(design: Design) -> Finding:
    """The closed forms alone, as a result of their own."""
    rows = as_numbers(design_check(design))
    remark = {"good": "nothing speaks against it", "close": "close to a limit", "bad": "it will not work"}
    text = remark[str(overall(rows))] + (f": {against(rows)}" if against(rows) else "")
    return Finding(
        {"rows": rows, "verdict": overall(rows)},
        [check_table(rows)],
        {"design_check": rows},
        remarks=[text],
        views=[bow_view(design)],
    )


def refuse_without_feet(design: Design) -> None:
    """Refuse a machine of which nothing is asked here."""
    if design.kind != "bot":
        raise DesignError(f"kind: found {design.kind}, expected a bot, a skeleton that its muscle bends, to check")


def overall(rows: Sequence[Numbers]) -> str | None:
    """The worst verdict of rows as the summary holds them; None where there are none."""
    order = [verdict.value for verdict in Verdict]
    return max((row["verdict"] for row in rows), key=order.index) if rows else None


def against(rows: Sequence[Numbers]) -> str:
    """Names of the rows that are not good, the bad ones first."""
    worse = [row["name"] for verdict in ("bad", "close") for row in rows if row["verdict"] == verdict]
    return "; ".join(dict.fromkeys(worse))


def as_numbers(rows: Sequence[Check]) -> list[dict[str, Any]]:
    """Rows for the summary."""
    return [{**asdict(row), "verdict": row.verdict.value} for row in rows]


def check_table(rows: Sequence[Numbers]) -> Table:
    """Table of rows as the summary holds them."""
    header = ("question", "by", "value", "limit", "unit", "verdict", "why")
    lines = tuple(
        (
            row["name"], row["by"], row["value"],
            None if row["limit"] is None else f"{'>' if row['at_least'] else '<'} {row['limit']:.3g}",
            row["unit"], row["verdict"], f"{row['why']} [{row['source']}]" if row["source"] else row["why"],
        )
        for row in rows
    )  # fmt: skip
    return Table("Will it work?", header, lines)


def _judged(
    name: str, by: str, value: float, limit: float, unit: str, why: str, source: str, *, at_least: bool = False
) -> Check:
    good = value > limit if at_least else value < limit
    verdict = Verdict.bad if not good else Verdict.close if abs(value / limit - 1.0) < _CLOSE else Verdict.good
    return Check(name, by, value, limit, unit, at_least, verdict, why, source)


def _bends(design: Design, sagitta: float, by: str, estimate: Bow | None) -> Check:
    pull = f", pulled with {estimate.force:.3g} mN" if estimate is not None else ""
    return _judged(
        "the muscle bends the skeleton", by, sagitta / design.bay, LEAST_RISE, "1",
        f"the beam rises by {sagitta:.3g} mm over its chord at full drive{pull}",
        "Eq. 2 and 3, Pagan-Diaz et al. 2018; limit: assumption, of the span", at_least=True,
    )  # fmt: skip


def _collapses(design: Design, full: Bow) -> list[Check]:
    rows = [
        _judged(
            "the pillars stay apart", "closed form", design.bay - full.gap, design.bay, "mm",
            f"{max(full.gap, 0.0):.3g} mm are left between them or their rings at full drive, each turned by "
            f"{full.half_angle * 57.29578:.3g} degrees", "limit: the distance as drawn",
        )
    ]  # fmt: skip
    pull = full_pull(design, design.drive.amplitude)
    if pull > 0.0:
        load = buckling_load(design)
        rows.append(
            _judged(
                "the beam bears the muscle", "closed form", load / pull, 1.0, "1",
                f"it buckles at {load:.3g} mN; the muscle pulls with {pull:.3g} mN where it has not shortened, and "
                "again once it has remodelled", "Euler's load over Eq. 1", at_least=True,
            )
        )  # fmt: skip
    return rows


def _strains(full: Bow) -> list[Check]:
    return [_fibre(1.0 - full.shortening, "closed form"), _gel(full.gel_strain, "closed form")]


def _fibre(stretch: float, by: str) -> Check:
    return _judged(
        "the tissue bears its shortening", by, stretch, SHORTEST_FIBRE, "1",
        f"its fibres are {stretch:.3g} times as long as made at full drive; shorter ones pull no more",
        "Gordon, Huxley and Julian 1966, frog, as usually quoted; that tissue is made at its best length: assumption",
        at_least=True,
    )  # fmt: skip


def _gel(strain: float, by: str) -> Check:
    return _judged(
        "the gel bears its strain", by, strain, MOST_GEL_STRAIN, "1",
        "largest at the beam's faces" if by == "closed form" else "what one percent of its volume exceeds",
        "assumption: no measured strength at hand",
    )  # fmt: skip


def _touches(touching: str) -> Check:
    verdict = Verdict.bad if "skeleton against skeleton" in touching else Verdict.close if touching else Verdict.good
    why = touching or "nothing runs into anything at full drive"
    return Check("the machine does not run into itself", "solid", None, None, "", False, verdict, why, "")


def _oxygen(design: Design) -> list[Check]:
    muscle = design.value("muscle")
    gamma = viable_gamma(design)
    given = muscle.oxygen is None or muscle.oxygen.tension == "none"
    why = "as the design has it" if given else "from the oxygen in the section between the pillars"
    lives = Verdict.good if gamma >= LEAST_GAMMA else Verdict.bad
    rows = [
        Check("the tissue lives", "closed form", gamma, LEAST_GAMMA, "1", True, lives, f"viable share gamma, {why}",
              "what is asked of a design: assumption")
    ]  # fmt: skip
    if given:
        ring = muscle.layout == "ring"
        sides = (
            (muscle.ring_thickness, muscle.ring_height) if ring else (muscle.junction_width, muscle.junction_thickness)
        )
        half = 0.5 * min(sides)
        # tissue as thick as twice the limit is what the paper made: at the limit, not beyond it
        verdict = Verdict.good if half <= DIFFUSION_LIMIT * (1.0 + 1e-9) else Verdict.bad
        why = "from its middle to the medium; [muscle.oxygen] computes what this estimates"
        rows.append(
            Check("oxygen reaches the tissue", "closed form", half, DIFFUSION_LIMIT, "mm", False, verdict, why,
                  "Pagan-Diaz et al. 2018, sections 2.1 and 2.3")
        )  # fmt: skip
    return rows


def _slides(design: Design, stroke: float, by: str) -> Check:
    """Whether the stroke is larger than what feet that stick give by."""
    ground, share, yields = design.ground, 0.5 * weight(design), held_closing(design)
    first = ground.static_friction * share * yields
    both = (ground.static_friction + ground.kinetic_friction) * share * yields
    verdict = Verdict.bad if stroke <= first else Verdict.close if stroke <= both else Verdict.good
    told = {
        Verdict.bad: "feet that stick hold it",
        Verdict.close: f"a foot slides once and then sticks for good below {both:.3g} mm",
        Verdict.good: "a foot slides to and fro at every stroke",
    }
    why = f"{told[verdict]}; half of {2.0 * share:.3g} mN on each foot"
    return Check(
        "the stroke overcomes friction", by, stroke, first, "mm", True, verdict, why,
        "friction of half the weight on the beam's linear stiffness at the soles",
    )  # fmt: skip


def _of_full_drive(design: Design, solid: Numbers | None) -> tuple[Numbers | None, float | None]:
    """State and stroke of the solid at full drive, of the tissue that the design asks for."""
    if solid is None:
        return None, None
    own = design.value("muscle.reference")
    key = "remodelled_peak" if own == "remodelled" else "peak"
    state = next((s for s in solid.get("states", ()) if s["key"] == key), None)
    stroke = (solid.get("stroke") or {}).get(own, {}).get("stroke_mm")
    return state, stroke


def _walked(design: Design, walks: Sequence[Numbers]) -> list[Check]:
    """Whether it walked, where it stands as the design says."""
    own = [walk for walk in walks if walk.get("immersion") == design.ground.immersion]
    if not own:
        return []
    best = max(own, key=lambda walk: float(walk["slip_fraction_1"]))
    slip = float(best["slip_fraction_1"])
    step = best.get("step_mm")
    advance = f", {step:.3g} mm a stroke" if step is not None else ""
    verdict = Verdict.good if slip > 0.0 else Verdict.bad
    why = f"share of the time at {best['frequency_Hz']:g} Hz{advance}" if slip > 0.0 else "no foot ever slides"
    return [Check("a foot slides as it walks", "rods", slip, 0.0, "1", True, verdict, why, "")]
