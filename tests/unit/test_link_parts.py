"""Parts of the cross-check that need no solid: expected differences, what is read off points, pairs of motions."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from fem_biobot.config import load_design
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.link.crosscheck import Row, Stiffness, crosscheck, tensions_of
from fem_biobot.link.expected import causes, expect, skeleton_stiffness, tissue_stiffness
from fem_biobot.link.folding import Folding
from fem_biobot.link.modes import Motions, kind, paired, seen_positions
from fem_biobot.link.observed import Points, drawn_points, observed, rotation, stations
from fem_biobot.link.rod_side import RodSide
from fem_biobot.rod.reduce import reduce
from fem_biobot.study.reporter import Silent
from tests.helpers import generator

DESIGN = load_design("junction_bot")


def test_both_springs_are_those_of_the_linear_machine() -> None:
    """E I / (l^2 L) and E_m A / L with the numbers of the reference machine.

    Catches: the moment arm once instead of squared, the ring's section for the junction's.
    """
    assert skeleton_stiffness(DESIGN) == pytest.approx(319.4 * 7.0 * 0.68**3 / 12.0 / (2.0**2 * 7.0), rel=1e-12)
    assert tissue_stiffness(DESIGN) == pytest.approx(10.0 * 2.2 * 0.4 / 7.0, rel=1e-12)


def test_the_machine_of_one_angle_is_two_springs_at_small_tension() -> None:
    """Closing of the muscle's ends by T A / (k_b + k_m), and measures in proportion to the turn.

    Catches: the arm of one pillar, the couple of half the beam, the sagitta of a parabola's end.
    """
    T = 1e-3
    found = Folding(DESIGN).at(T)
    assert found is not None
    way = T * DESIGN.junction_section / (skeleton_stiffness(DESIGN) + tissue_stiffness(DESIGN))
    turn = way / (2.0 * DESIGN.moment_arm)
    assert found["muscle_force_mN"] == pytest.approx(skeleton_stiffness(DESIGN) * way, rel=1e-3)
    assert found["pillar_rotation_deg"] == pytest.approx(math.degrees(turn), rel=1e-3)
    assert found["tip_closing_mm"] == pytest.approx((2.8 + 3.4) * turn, rel=1e-3)
    assert found["sagitta_mm"] == pytest.approx(turn * 7.0 / 4.0, rel=1e-3)
    assert found["strain_energy_uJ"] == pytest.approx(0.5 * T * DESIGN.junction_section * way, rel=1e-3)
    assert found["fibre_stretch_1"] == pytest.approx(1.0 - way / 7.0, rel=1e-6)


def test_the_machine_of_one_angle_does_the_work_of_its_tension() -> None:
    """Along a path its energy is the work of the tension, ``int T A dd``, in every one of its variants at large turns.

    Catches: an energy of another law than the force's, of the beam without its ends; an arm that is not d's derivative.
    """
    for machine in (Folding(DESIGN), Folding(DESIGN, plate=-0.2, ends=0.3, tissue=0.2, law=0.7, rigid=0.9)):
        tensions = np.linspace(1e-6, 10.0, 81)
        states = [machine.at(float(T)) for T in tensions]
        ways = [(7.0 - machine.rigid) * (1.0 - state["fibre_stretch_1"]) for state in states if state is not None]
        work = CubicSpline(ways, tensions * DESIGN.junction_section).integrate(ways[0], ways[-1])
        last = states[-1]
        assert last is not None
        assert last["strain_energy_uJ"] == pytest.approx(float(work), rel=1e-5)
        assert last["pillar_rotation_deg"] > 20.0


def test_the_machine_of_one_angle_is_that_of_the_rods() -> None:
    """Its measures at the passive tension are those of the closed-form rods within what it leaves out.

    The beam's curvature is no longer even where the muscle's arm grows with the arch: a tenth of the middle's.

    Catches: a sign or a factor in the geometry of large turns.
    """
    T = DESIGN.tension(0.0)
    rods = RodSide(DESIGN, reduce(DESIGN)).states([0.3 * T, T], Silent())[0][-1].numbers
    found = Folding(DESIGN).at(T)
    assert found is not None
    close = {"muscle_force_mN": 0.03, "tip_closing_mm": 0.01, "pillar_rotation_deg": 0.015, "strain_energy_uJ": 0.02}
    for name, slack in {**close, "sagitta_mm": 0.07, "curvature_1_per_mm": 0.1}.items():
        assert found[name] == pytest.approx(rods[name], rel=slack), name


def test_a_machine_whose_muscle_is_too_strong_has_no_expectation() -> None:
    """No turn below 80 degrees bears it: nothing is stated, instead of a number of no state.

    Catches: the end of the search taken for a state.
    """
    strong = DESIGN.with_values({"muscle.passive_tension": 4000.0, "muscle.material.young": 1e-3})
    assert Folding(strong).at(4000.0) is None
    assert expect(strong).at(4000.0) == {}
    assert expect(strong).stroke(3999.0, 4000.0) is None


def test_expected_differences_follow_from_their_causes() -> None:
    """Of closing and force at small tension, put together by hand from what each cause does to the two springs.

    A clamped strip lifts by the turn times a length, which is no part of what happens at no turn.

    Catches: shares of skeleton and tissue exchanged, ends of intervals exchanged by a negative share.
    """
    found, T = expect(DESIGN), 1e-6
    w, springs = found.skeleton_share, [c for c in found.causes if c.key not in ("law", "clamped")]

    def summed(of: Callable[[float, float], float]) -> list[float]:
        """Least and most over both ends of each cause: a spring stiffer by t, softer by b, in series or parallel."""
        ends = [[of(c.compliance[k], c.tissue[k]) for k in (0, 1)] for c in springs]
        return [sum(map(min, ends)), sum(map(max, ends))]

    def closing(b: float, t: float) -> float:
        return 1.0 / (w / (1.0 + b) + (1.0 - w) * (1.0 + t)) - 1.0

    bands = found.at(T)
    assert bands["tip_closing_mm"] == pytest.approx(summed(closing), rel=1e-3)
    assert bands["muscle_force_mN"] == pytest.approx(
        summed(lambda b, t: (1.0 + closing(b, t)) / (1.0 + b) - 1.0), rel=1e-3
    )
    for tension in tensions_of(DESIGN):
        assert all(-0.3 < low < high < 0.3 for low, high in found.at(tension).values())
    low, high = found.stroke(DESIGN.tension(0.0), DESIGN.tension(1.0)) or (0.0, 0.0)
    assert -0.3 < low < high < 0.0


def test_causes_vanish_in_their_limits() -> None:
    """No plate without Poisson's ratio, no yielding ends of a slender beam, no law in small strain.

    Catches: a cause that does not go with what it is said to vanish with.
    """

    def of(name: str, **values: float | str) -> tuple[float, float]:
        changed = DESIGN.with_values({key.replace("__", "."): value for key, value in values.items()})
        cause = next(c for c in causes(changed) if name in c.name)
        least, most = (max(abs(cause.compliance[k]), abs(cause.tissue[k])) for k in (0, 1))
        return least, most

    assert of("plate", skeleton__material__poisson=0.0) == (0.0, 0.0)
    assert of("ends of the beam", skeleton__beam_thickness=0.068)[1] == pytest.approx(
        of("ends of the beam")[1] / 10.0, rel=1e-9
    )
    assert max(of("large strain", muscle__passive_tension=1e-6, muscle__active_tension=1e-6)) < 1e-5
    # by its square where a ring is thinner than the strip
    assert max(of("rings spread", muscle__ring_thickness=0.005)) < 1.1e-3 * max(of("rings spread"))
    thin = max(of("clamped", muscle__junction_thickness=0.004, muscle__ring_thickness=0.005))
    assert thin < 0.012 * max(of("clamped"))
    assert max(of("cannot narrow", muscle__junction_width=0.022)) < 0.01 * max(of("cannot narrow")) * 1.001


def test_a_plate_is_softer_than_rods_of_its_modulus() -> None:
    """With the plate's modulus in the rods the solid can only be softer.

    Catches: the reading of the beam left out of what is expected of it.
    """
    plain, plate = (next(c for c in causes(DESIGN, plate=p) if "plate" in c.name) for p in (False, True))
    assert plain.compliance == (pytest.approx(-(0.45**2)), 0.0)
    assert plate.compliance == (0.0, pytest.approx(1.0 / (1.0 - 0.45**2) - 1.0))


def _bent(curvature: float, tilt: float, shift: tuple[float, float, float]) -> Points:
    """The drawn machine with its beam bent to a circle, arching up, then moved rigidly."""
    drawn = drawn_points(DESIGN)
    radius, z = 1.0 / curvature, DESIGN.beam_axis_height

    def moved(p: np.ndarray, x: np.ndarray) -> np.ndarray:
        # the point's section turns about the centre below, at z - radius
        angle, out = x / radius, p[:, 2] - z + radius
        spot = np.column_stack(
            [out * np.sin(angle) + (p[:, 0] - x) * np.cos(angle), p[:, 1], z - radius + out * np.cos(angle)]
        )
        spot[:, 2] -= (p[:, 0] - x) * np.sin(angle)
        return spot @ rotation(tilt).T + np.array(shift)

    ends = np.array([-DESIGN.span / 2, DESIGN.span / 2])
    x = stations(DESIGN)
    return Points(moved(drawn.lower, x), moved(drawn.upper, x), moved(drawn.tops, ends), moved(drawn.soles, ends))


@pytest.mark.parametrize("tilt", [0.0, 0.7, -2.9])
def test_a_circle_has_one_curvature_however_it_lies(tilt: float) -> None:
    """Beam bent to a circle between rigid pillars: its curvature everywhere, pillars turned by half of its angle.

    Catches: the wrong sign of an arch, a measure that feels rigid motion, the jump of an angle at 180 degrees.
    """
    curvature = 0.05
    found = observed(DESIGN, 1.0, _bent(curvature, tilt, (3.0, -1.0, 0.5)))
    np.testing.assert_allclose(found.curvature, curvature, rtol=1e-12)
    assert found.numbers["curvature_1_per_mm"] == pytest.approx(curvature, rel=1e-12)
    half = math.degrees(curvature * DESIGN.span / 2)
    assert found.numbers["rotation_short_deg"] == pytest.approx(half, rel=1e-12)
    assert found.numbers["rotation_long_deg"] == pytest.approx(half, rel=1e-12)
    level = found.points.axis
    assert abs(level[0, 2] - level[-1, 2]) < 1e-12
    assert level[8, 2] > level[0, 2]


def test_motions_find_their_own_kind() -> None:
    """Shapes in another order, of other size and sign, and a little off, are paired with those they are like.

    Catches: pairs by rank, a likeness that depends on sign or size.
    """
    draw = generator(3)
    at = seen_positions(DESIGN)
    shapes = draw.normal(size=(4, len(at), 3))
    order = [2, 0, 3, 1]
    other = -3.0 * shapes[order] + 1e-3 * draw.normal(size=shapes.shape)
    pairs = paired(Motions(np.arange(4.0) + 1.0, shapes), Motions(np.array(order) + 1.1, other), 3)
    assert [round(p.rods - p.solid, 9) for p in pairs] == [0.1, 0.1, 0.1]
    assert all(p.likeness > 0.999 for p in pairs)


def test_motions_in_the_plane_and_across_are_told_apart() -> None:
    """A turn about y is in the plane, one about x is not though it lifts the soles' corners.

    Catches: every lift taken for motion in the plane.
    """
    at = seen_positions(DESIGN)
    arm = at - np.array([0.0, 0.0, DESIGN.beam_axis_height])
    assert kind(np.cross([0.0, 1.0, 0.0], arm)) == "in plane"
    assert kind(np.cross([1.0, 0.0, 0.0], arm)) == "across"
    assert kind(np.cross([0.0, 0.0, 1.0], arm)) == "across"


def test_a_row_judges_by_its_band() -> None:
    """Inside, outside, and not at all where nothing was stated; of a stretch, its distance from one counts.

    Catches: a band of the wrong sign, a stretch compared as a whole, which hides every difference.
    """
    band = (-0.1, 0.05)
    assert Row(1.0, "sagitta_mm", Stiffness.mesh, 0.95, 1.0, band).within is True
    assert Row(1.0, "sagitta_mm", Stiffness.mesh, 1.06, 1.0, band).within is False
    assert Row(1.0, "sagitta_mm", Stiffness.mesh, 1.06, 1.0, None).within is None
    assert Row(1.0, "fibre_stretch_1", Stiffness.mesh, 0.9, 0.8, None).difference == pytest.approx(-0.5)


def test_tensions_rise_to_full_drive() -> None:
    """Shares of the passive tension, itself, and the peak; without passive tension, of the peak.

    Catches: gamma left out, the same tension twice.
    """
    found = tensions_of(DESIGN.with_values({"muscle.gamma": 0.5}))
    assert found[-2:] == [pytest.approx(0.5 * 9.09), pytest.approx(0.5 * 10.39)]
    assert found == sorted(set(found))
    assert tensions_of(DESIGN.with_values({"muscle.passive_tension": 0.0}))[-1] == pytest.approx(1.30)
    with pytest.raises(DesignError, match="no tension"):
        tensions_of(DESIGN.with_values({"muscle.passive_tension": 0.0, "muscle.active_tension": 0.0}))


def test_machines_without_a_cross_check_are_refused() -> None:
    """A strip, three pillars, remodelled tissue, tensions that do not rise: one line each.

    Catches: a check of a machine for which nothing was derived.
    """
    with pytest.raises(ModelError, match="two pillars"):
        crosscheck(load_design("strip"))
    with pytest.raises(ModelError, match="as_moulded"):
        crosscheck(DESIGN.with_values({"muscle.reference": "remodelled"}))
    for tensions in ([], [1.0, 1.0], [0.0, 1.0]):
        with pytest.raises(ModelError, match="tensions: found"):
            crosscheck(DESIGN, tensions=tensions)
    with pytest.raises(ModelError, match="solved: found 1 states"):
        crosscheck(DESIGN, tensions=[1.0, 2.0], solved=[object()])  # type: ignore[list-item]
    assert expect(load_design("ring_bot")).at(5.0) == {}
