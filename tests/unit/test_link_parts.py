"""Parts of the cross-check that need no solid: expected differences, what is read off points, pairs of motions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.link.crosscheck import Row, Stiffness, crosscheck, tensions_of
from fem_biobot.link.expected import causes, expect, skeleton_stiffness, tissue_stiffness
from fem_biobot.link.modes import Motions, kind, paired, seen_positions
from fem_biobot.link.observed import Points, drawn_points, observed, rotation, stations
from tests.helpers import generator

DESIGN = load_design("junction_bot")


def test_both_springs_are_those_of_the_linear_machine() -> None:
    """E I / (l^2 L) and E_m A / L with the numbers of the reference machine.

    Catches: the moment arm once instead of squared, the ring's section for the junction's.
    """
    assert skeleton_stiffness(DESIGN) == pytest.approx(319.4 * 7.0 * 0.68**3 / 12.0 / (2.0**2 * 7.0), rel=1e-12)
    assert tissue_stiffness(DESIGN) == pytest.approx(10.0 * 2.2 * 0.4 / 7.0, rel=1e-12)


def test_expected_differences_follow_from_their_causes() -> None:
    """Of closing and force, put together by hand from what each cause does to the two springs.

    Catches: shares of skeleton and tissue exchanged, ends of intervals exchanged by a negative share.
    """
    found = expect(DESIGN)
    w = found.skeleton_share
    softer = [sum(c.compliance[k] for c in found.causes) for k in (0, 1)]
    stiffer = [sum(c.tissue[k] for c in found.causes) for k in (0, 1)]
    low, high = found.of["tip_closing_mm"]
    assert low == pytest.approx(w * softer[0] - (1 - w) * stiffer[1], rel=1e-12)
    assert high == pytest.approx(w * softer[1] - (1 - w) * stiffer[0], rel=1e-12)
    low, high = found.of["muscle_force_mN"]
    assert low == pytest.approx(-(1 - w) * (softer[1] + stiffer[1]), rel=1e-12)
    assert high == pytest.approx(-(1 - w) * (softer[0] + stiffer[0]), rel=1e-12)
    assert all(-0.3 < low < high < 0.3 for low, high in found.of.values())


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
    assert expect(load_design("ring_bot")).of == {}
