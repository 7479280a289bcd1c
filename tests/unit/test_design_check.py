"""Will it work? The closed forms beside rods and walks, and a verdict for every way in which a machine fails."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.link.rod_side import RodSide
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Hold, PointLoad
from fem_biobot.rod.reduce import reduce
from fem_biobot.rod.statics import statics
from fem_biobot.rod.walk import walk
from fem_biobot.solid.state import SolidState
from fem_biobot.solid.strains import exceeded_strain
from fem_biobot.study.bow import Bow, bow, buckling_load, full_pull, held_closing, weight
from fem_biobot.study.design_check import (
    Check,
    Verdict,
    against,
    as_numbers,
    check_table,
    design_check,
    overall,
    refuse_without_feet,
)
from fem_biobot.study.reporter import Silent
from tests.command import call

# I = 0.04 mm^4 of the paper's small skeleton, at the large one's width: 7 t^3 / 12
SMALL_BEAM = f"skeleton.beam_thickness={(12 * 0.04 / 7) ** (1 / 3):.4f} mm"


def bot(*sets: str, base: str = "junction_bot") -> Design:
    return load_design(base, list(sets))


def row(rows: Sequence[Check], name: str, by: str = "closed form") -> Check:
    return next(r for r in rows if r.name == name and r.by == by)


@pytest.mark.parametrize(
    ("base", "sets"),
    [
        ("junction_bot", ()),
        ("junction_bot", ("skeleton.beam_thickness=0.9 mm", "muscle.gamma=0.9")),
        ("junction_bot", ("muscle.theta=60 deg", "muscle.junction_width=1.5 mm")),
        ("junction_bot", (SMALL_BEAM,)),
        ("ring_bot", ()),
    ],
)
def test_the_bow_is_near_the_rods(base: str, sets: tuple[str, ...]) -> None:
    """Force, closing, sagitta and shortening at full drive, without a common formula: within 2, 4, 6 and 3 %.

    Catches: Eq. 3's constant moment arm, a beam without its compression, gamma twice, a ring pulling like a junction.
    """
    design = bot(*sets, base=base)
    found = bow(design, 1.0)
    observed, _ = RodSide(design, reduce(design)).states([design.tension(0.0) / 2, design.tension(1.0)], Silent())
    rods = observed[-1].numbers
    assert found.force == pytest.approx(rods["muscle_force_mN"], rel=0.02)
    assert found.closing == pytest.approx(rods["tip_closing_mm"], rel=0.04)
    assert found.sagitta == pytest.approx(rods["sagitta_mm"], rel=0.06)
    assert 1.0 - found.shortening == pytest.approx(rods["fibre_stretch_1"], rel=0.03)


def test_a_small_force_is_eq_3() -> None:
    """The sagitta of a thousandth of the tension is ``F l L^2 / (8 E I)``, to the share of the buckling load.

    Catches: a factor of the arc, a moment arm from the ground.
    """
    design = bot("muscle.passive_tension=9 Pa", "muscle.active_tension=3 Pa")
    found, EI = bow(design, 1.0), 319.4 * 7.0 * 0.68**3 / 12.0
    eq3 = found.force * 2.0 * 7.0**2 / (8.0 * EI)
    assert found.sagitta == pytest.approx(eq3, rel=2.0 * found.force / buckling_load(design))
    # and the force is Eq. 1's but for what the shortened tissue takes
    assert full_pull(design, 1.0) == pytest.approx(0.88 * 0.012, rel=1e-12)
    e = found.shortening
    assert found.force == pytest.approx(0.88 * (0.012 - 10.0 * e / (1.0 - e)), rel=1e-6)


def test_gamma_scales_what_the_design_says() -> None:
    """The pull of plain gamma is the design's tension times its section, whichever parts gamma scales.

    Catches: gamma on the standing tension where it scales the active one alone.
    """
    for scales in ("both", "active"):
        design = bot("muscle.gamma=0.7", f"muscle.gamma_scales={scales}", "muscle.theta=70 deg")
        for drive in (0.0, 0.6):
            expected = design.tension(drive) * 0.88 * math.sin(math.radians(70.0))
            assert full_pull(design, drive) == pytest.approx(expected, rel=1e-12)


def test_the_gap_is_where_pillars_or_rings_come_nearest() -> None:
    """At a known angle by drawing: inner edges of the short sole against the long pillar, or ring against ring.

    Catches: the long pillar's depth, rings forgotten.
    """
    design = bot("muscle.passive_tension=6 kPa", "muscle.ring_thickness=0.05 mm")
    found = bow(design, 1.0)
    phi = found.half_angle
    chord = 7.0 * math.sin(phi) / phi
    assert found.gap == pytest.approx(chord - 2.0 * 2.8 * math.sin(phi), rel=1e-12)
    thick = bow(bot("muscle.passive_tension=6 kPa", "muscle.ring_thickness=1 mm"), 1.0)
    # rings from 1.55 to 2.65 mm below the axis
    assert thick.gap == pytest.approx(chord - 2.0 * (2.65 * math.sin(phi) + math.cos(phi)), rel=1e-12)


def test_feet_that_stick_yield_as_the_rods_do() -> None:
    """Forces on the soles of rods close them by `held_closing`, to the rods' shear and second order (5 %).

    Catches: equal pillars, one end's moment alone, a third for a half.
    """
    design = bot()
    whole = reduce(design)
    (xa, ha), (xb, hb) = design.pillars
    z = design.beam_axis_height
    places = (("pillar_short", (xa, 0.0, z - ha)), ("pillar_long", (xb, 0.0, z - hb)))
    force = 0.02
    loads = [PointLoad(place, force=(sign * force, 0.0, 0.0)) for place, sign in zip(places, (1.0, -1.0), strict=True)]
    # in balance: their moment is that of the unequal heights
    loads += [
        PointLoad(place, force=(0.0, 0.0, sign * force * (hb - ha) / (xb - xa)))
        for place, sign in zip(places, (-1.0, 1.0), strict=True)
    ]
    model = RodModel(whole.rods, whole.joints, whole.bodies, [Hold(("beam", 0))], loads)
    state = statics(model, [1.0]).last
    short, long = (np.array(state.at(place)) for place in places)
    chord = state.points("beam")[-1] - state.points("beam")[0]
    closing = (xb - xa) - (long - short) @ chord / np.linalg.norm(chord)
    assert closing == pytest.approx(force * held_closing(design), rel=0.05)


def test_weight_is_that_of_the_rods() -> None:
    """Gel and tissue, in air and submerged.

    Catches: buoyancy of the gel alone, a density for both.
    """
    for place in ("air", "submerged"):
        design = bot(f"ground.immersion={place}", "muscle.material.density=1.3e-3 g/mm^3")
        model = reduce(design)
        medium = 1e-6 if place == "submerged" else 0.0
        rods = sum(b.mass - medium * b.volume for b in model.bodies)
        rods += (1.12e-6 - medium) * 7.0 * 7.0 * 0.68
        assert weight(design) == pytest.approx(9810.0 * rods, rel=1e-9)


@pytest.mark.parametrize(
    ("active", "verdict"), [(1.3, Verdict.bad), (2.0, Verdict.close), (2.7, Verdict.good), (3.6, Verdict.good)]
)
def test_the_verdict_on_friction_is_what_walking_shows(active: float, verdict: Verdict) -> None:
    """Bad: no foot slides. Close: feet slide, then stick, and the machine stays. Good: every stroke advances it.

    Catches: static friction alone, the whole weight on each foot, closing without the feet's stiffness.
    """
    design = bot("muscle.passive_tension=0.9 kPa", f"muscle.active_tension={active} kPa")
    assert row(design_check(design), "the stroke overcomes friction").verdict is verdict
    walked = walk(design, frequency=1.0, duration=3.0)
    assert (walked.foot_slips.max() > 0.0) == (verdict is not Verdict.bad)
    assert (walked.step_mm > 0.05) == (verdict is Verdict.good)


def test_the_small_skeleton_collapses_under_the_large_muscle() -> None:
    """The beam of the paper's small machine at the large one's span buckles at 2.6 mN, under 9 mN; its own does not.

    Catches: a margin upside down, a moment of area of another axis.
    """
    small, own = (row(design_check(d), "the beam bears the muscle") for d in (bot(SMALL_BEAM), bot()))
    assert small.verdict is Verdict.bad
    assert small.value == pytest.approx(math.pi**2 * 319.4 * 0.04 / 49.0 / (0.88 * 10.39), rel=1e-3)
    assert own.verdict is Verdict.good
    # once its tissue no longer resists, it folds, and the rods find no equilibrium either
    remodelled = bot(SMALL_BEAM, "muscle.reference=remodelled")
    assert row(design_check(remodelled), "the pillars stay apart").verdict is Verdict.bad
    assert bow(remodelled, 1.0).half_angle == 0.5 * math.pi


@pytest.mark.parametrize(
    ("name", "sets", "verdict"),
    [
        ("the muscle bends the skeleton", ("skeleton.beam_thickness=2 mm", "muscle.theta=5 deg"), Verdict.bad),
        ("the muscle bends the skeleton", (), Verdict.good),
        ("the tissue bears its shortening", ("muscle.material.young=40 kPa",), Verdict.good),
        ("the tissue bears its shortening", (SMALL_BEAM,), Verdict.bad),
        ("the gel bears its strain", ("muscle.reference=remodelled", SMALL_BEAM), Verdict.bad),
        ("the gel bears its strain", (), Verdict.good),
        ("the tissue lives", ("muscle.gamma=0.94",), Verdict.bad),
        ("the tissue lives", ("muscle.gamma=0.95",), Verdict.good),
        ("oxygen reaches the tissue", ("muscle.junction_thickness=0.42 mm",), Verdict.bad),
        ("oxygen reaches the tissue", (), Verdict.good),
    ],
)
def test_every_row_can_fail_and_pass(name: str, sets: tuple[str, ...], verdict: Verdict) -> None:
    """One design on either side of each limit.

    Catches: a comparison the wrong way round, a limit that nothing reaches.
    """
    assert row(design_check(bot(*sets)), name).verdict is verdict


def test_tissue_with_oxygen_is_judged_by_its_gamma_alone() -> None:
    """Its viable share, not its thickness; a muscle without tension bends nothing and has no margin.

    Catches: the given gamma where oxygen decides, a division by no force.
    """
    rows = design_check(bot("muscle.oxygen.consumption=0.05 mM/s"))
    assert row(rows, "the tissue lives").value != 1.0
    assert "oxygen reaches the tissue" not in [r.name for r in rows]
    none = design_check(bot("muscle.passive_tension=0 kPa", "muscle.active_tension=0 kPa"))
    assert row(none, "the muscle bends the skeleton").value == 0.0
    assert "the beam bears the muscle" not in [r.name for r in none]


def test_solid_and_walks_answer_too() -> None:
    """The state at full drive of the tissue asked for, the stroke, what touches what; walks where the design stands.

    Catches: the passive state, the other tissue's stroke, walks in another place.
    """
    design = bot()
    peak = {"key": "peak", "sagitta_mm": 0.8, "fibre_stretch_1": 0.66, "touching": ""}
    other = {**peak, "key": "passive", "sagitta_mm": 0.1, "touching": "skeleton against skeleton at 3 vertices"}
    stroke = {"as_moulded": {"stroke_mm": 1.5}, "remodelled": {"stroke_mm": 0.1}}
    walks = [
        {"immersion": "submerged", "slip_fraction_1": 0.3, "frequency_Hz": 2.0, "step_mm": 0.1},
        {"immersion": "air", "slip_fraction_1": 0.0, "frequency_Hz": 2.0, "step_mm": None},
    ]
    rows = design_check(design, solid={"states": [other, peak], "stroke": stroke}, gel_strain=0.4, walks=walks)
    assert row(rows, "the muscle bends the skeleton", "solid").value == pytest.approx(0.8 / 7.0)
    assert row(rows, "the tissue bears its shortening", "solid").value == 0.66
    assert row(rows, "the gel bears its strain", "solid").verdict is Verdict.bad
    assert row(rows, "the stroke overcomes friction", "solid").verdict is Verdict.good
    assert row(rows, "the machine does not run into itself", "solid").verdict is Verdict.good
    assert row(rows, "a foot slides as it walks", "rods").verdict is Verdict.bad
    for touching, verdict in (
        ("muscle against muscle at 4 vertices", Verdict.close),
        ("muscle against muscle, skeleton against skeleton at 4 vertices", Verdict.bad),
    ):
        state = {**peak, "touching": touching}
        rows = design_check(design, solid={"states": [state], "stroke": {}}, walks=walks[:1])
        assert row(rows, "the machine does not run into itself", "solid").verdict is verdict
    slides = design_check(bot("ground.immersion=submerged"), walks=walks)
    assert row(slides, "a foot slides as it walks", "rods").verdict is Verdict.good


def test_the_worst_row_decides_and_is_named() -> None:
    """Bad before close before good, each question once; a machine of which nothing is asked has no verdict.

    Catches: the alphabet's order of verdicts, the first row's.
    """
    good = Check("a", "x", 1.0, 2.0, "1", False, Verdict.good, "", "")
    close, bad = replace(good, name="b", verdict=Verdict.close), replace(good, name="c", verdict=Verdict.bad)
    rows = as_numbers([good, close, bad, bad])
    assert overall(rows) == "bad"
    assert overall(rows[:2]) == "close"
    assert overall([]) is None
    assert against(rows) == "c; b"
    assert check_table(rows).rows[0][3] == "< 2"
    assert design_check(load_design("strip")) == ()
    with pytest.raises(DesignError, match="kind: found strip, expected a bot"):
        refuse_without_feet(load_design("strip"))


def test_the_bow_changes_with_everything_it_reads() -> None:
    """Each number of the design that matters moves it.

    Catches: an inert parameter.
    """

    def seen(found: Bow) -> tuple[float, ...]:
        return found.force, found.closing, found.gap, found.sagitta, found.shortening, found.gel_strain

    before = seen(bow(bot(), 1.0))
    for change in (
        "skeleton.material.young=300 kPa", "muscle.material.young=9 kPa", "muscle.gamma=0.9", "muscle.theta=80 deg",
        "muscle.junction_height=1.5 mm", "skeleton.beam_width=6.9 mm", "muscle.junction_thickness=0.41 mm",
    ):  # fmt: skip
        after = seen(bow(bot(change, "skeleton.pillar_width=6.5 mm"), 1.0))
        assert all(a != b for a, b in zip(after, before, strict=True)), change


def test_strain_that_a_share_of_the_volume_exceeds() -> None:
    """A fifth of a body is stretched by 1.5, the rest by 1.1, all pressed across: the share decides, not a turn.

    Catches: a share of the points instead of the volume, the smallest stretch, strain of a rotation.
    """
    from fem_biobot.material.neo_hooke import NeoHooke
    from fem_biobot.solid.model import SolidModel
    from fem_biobot.solid.records import Fix, Step

    # a tetrahedron of height 1 on the face z = 0 and one of 0.25 below it: a fifth of the volume
    points = np.array([[0, 1, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1.0, -0.25]])
    cells = np.array([[0, 0], [1, 2], [2, 1], [3, 4]])
    mesh = BodyMesh(points, cells, {"skeleton": np.arange(2)}, surfaces={"side": np.array([[0], [3], [1]])})
    model = SolidModel(mesh, {"skeleton": NeoHooke(319.4, 0.45)}, supports=[Fix("side")])
    X = model.system.space.points
    c, s = math.cos(0.7), math.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    x = X.copy()
    x[0] *= 0.9
    x[2] *= np.where(X[2] > 0.0, 1.1, 1.5)
    state = SolidState(model, Step(1.0, 0.0), turn @ x - X)
    for share, strain in ((0.01, 0.5), (0.19, 0.5), (0.21, 0.1), (0.99, 0.1)):
        assert exceeded_strain(state, "skeleton", share) == pytest.approx(strain, rel=1e-12)
    with pytest.raises(ModelError, match="region: found 'gel', expected one of: skeleton"):
        exceeded_strain(state, "gel")
    with pytest.raises(ModelError, match="share: found 1"):
        exceeded_strain(state, "skeleton", 1.0)


def test_the_command_judges_in_seconds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A table, a verdict in words, rows in the summary; what has no feet is refused.

    Catches: rows without reasons, a verdict of another design.
    """
    said = call(capsys, "study", "check", "junction_bot", "--set", SMALL_BEAM, "--out", tmp_path / "out", "--json")
    assert said.code == 0
    rows = json.loads(said.out)["design_check"]["rows"]
    assert {r["name"]: r["verdict"] for r in rows}["the beam bears the muscle"] == "bad"
    assert all(r["why"] for r in rows)
    assert (tmp_path / "out" / "tables" / "design_check.csv").exists()
    again = call(capsys, "study", "check", "junction_bot", "--set", SMALL_BEAM, "--out", tmp_path / "out")
    assert "it will not work: the beam bears the muscle" in again.out
    refused = call(capsys, "study", "check", "cantilever", "--out", tmp_path / "no")
    assert (refused.code, "expected a bot" in refused.complaint) == (2, True)
