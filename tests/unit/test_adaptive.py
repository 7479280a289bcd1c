"""Meshes refined for one number: influences, shares of elements in an error, sizes that follow, and what it saves."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.cli import main
from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, ModelError
from fem_biobot.mesh.geometry import GmshMissing, build_mesh, remeshed
from fem_biobot.mesh.sizes import SizeField
from fem_biobot.solid.adjoint import error_shares, influence, recovered
from fem_biobot.solid.from_design import tension_step
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, SolidState, solve
from fem_biobot.solid.records import Step
from fem_biobot.solid.space import space
from fem_biobot.study.adaptive import extrapolated, next_sizes, refine, saving
from fem_biobot.study.convergence import ConvergencePlan, along_arc, fillet_peak
from fem_biobot.study.richardson import Verdict, limit
from tests.helpers import box_mesh, committed_bot, generator


@pytest.fixture(scope="module")
def beam() -> SolidState:
    """A cantilever under its load, on a coarse mesh."""
    design = load_design("cantilever")
    try:
        model = SolidModel.from_design(design, build_mesh(design, 1.8))
    except GmshMissing as missing:
        pytest.skip(str(missing))
    return solve(model, [tension_step(design, 0.0)]).last


def test_derivatives_of_measures_are_their_differences() -> None:
    """At a displacement of a tenth of a millimetre in all directions, to the rounding of central differences.

    Catches: the turn of the chord left out, feet exchanged, the sign.
    """
    design, mesh = committed_bot()
    model = SolidModel.from_design(design, mesh)
    measurer, draw = Measurer(design, model), generator(23)
    u = 0.1 * draw.normal(size=model.system.space.points.shape)
    way = draw.normal(size=u.shape)
    state = SolidState(model, Step(1.0, 0.0), u)
    ends = [measurer.tip_closing(replace(state, u=u + s * 1e-5 * way)) for s in (1.0, -1.0)]
    assert np.sum(measurer.closing_gradient(state) * way) == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-7)


def test_an_influence_says_what_a_little_more_load_does(beam: SolidState) -> None:
    """A hundredth of the load more: the work of that load in the influence is the change of the deflection.

    To second order in the hundredth: within 1e-4 of it here, where the beam is nearly linear.
    Catches: the matrix of another state, held unknowns moved, axes of the equations taken for those of space.
    """
    design, system = load_design("cantilever"), beam.model.system
    measurer = Measurer(design, beam.model)
    z = influence(beam, measurer.deflection_gradient())
    more = solve(beam.model, [replace(beam.step, load=1.01 * beam.step.load)]).last
    change = [float(s.u[2] @ measurer._soles["tip"]) for s in (beam, more)]
    predicted = 0.01 * float(np.sum(z.T * system.dead_load)) * beam.step.load
    assert predicted == pytest.approx(change[1] - change[0], rel=2e-3)
    assert abs(predicted) > 1e-4


def test_shares_add_up_to_the_error_of_the_mesh(beam: SolidState) -> None:
    """Between a third and three halves of what is missing to a mesh of 12 times the unknowns.

    Catches: shares without volumes, of the recovered fields themselves, with the sign lost.
    """
    design = load_design("cantilever")
    measurer = Measurer(design, beam.model)
    shares = error_shares(beam, influence(beam, measurer.deflection_gradient()))
    fine = SolidModel.from_design(design, build_mesh(design, 0.6))
    there = Measurer(design, fine).measures(solve(fine, [tension_step(design, 0.0)]).last)["tip_deflection_mm"]
    here = measurer.measures(beam)["tip_deflection_mm"]
    assert there is not None
    assert here is not None
    assert 0.33 < shares.sum() / (there - here) < 1.5
    # the clamp matters more than the free end
    x = beam.model.system.space.points[0][beam.model.system.space.nodes[:4]].mean(axis=0)
    assert np.abs(shares[x < 3.0]).sum() > 5.0 * np.abs(shares[x > 11.0]).sum()


def test_recovery_keeps_linear_fields_and_jumps_between_regions() -> None:
    """Catches: vertices of two regions averaged, corners in another order than the points' weights."""
    mesh = box_mesh(3)
    own = space(mesh, "P2")
    regions = (own.points[0][own.nodes[:4]].mean(axis=0) > np.median(own.points[0])).astype(np.int64)
    assert 0 < regions.sum() < regions.size
    X = own.quadrature_points
    field = np.stack([2.0 + X[0] - 3.0 * X[2], X[1]]) + 7.0 * regions[None, :, None]
    assert np.abs(recovered(own, field, regions) - field).max() < 1e-12 * np.abs(field).max()
    mixed = recovered(own, field, np.zeros_like(regions))
    assert np.abs(mixed - field).max() > 1.0
    wavy = np.sin(9.0 * X[0])
    assert 1e-3 < np.abs(recovered(own, wavy, regions) - wavy).max() < 1.5


def test_sizes_follow_shares_and_the_number_of_elements(beam: SolidState) -> None:
    """Catches: small elements where the share is small, a growth that is not met, sizes beyond the largest."""
    mesh = beam.model.mesh
    x = mesh.points[0][mesh.cells].mean(axis=0)
    sizes = next_sizes(mesh, 1e-3 * np.exp(-x), 2.0, 1.5)
    assert sizes.n_elements == pytest.approx(2.0 * mesh.n_elements, rel=0.35)
    near, far = sizes.values[mesh.points[0] < 2.0], sizes.values[mesh.points[0] > 12.0]
    assert np.median(far) > 1.8 * np.median(near)
    assert sizes.values.max() <= 1.5 * (1.0 + 1e-12)
    again = remeshed(load_design("cantilever"), sizes)
    assert 0.5 < again.n_elements / sizes.n_elements < 2.0
    left = (again.points[0][again.cells].mean(axis=0) < 2.0).sum() / again.n_elements
    assert left > 1.3 * (x < 2.0).mean()


def test_a_size_field_counts_its_elements() -> None:
    """A box of volume 1 asked for regular tetrahedra of 0.1, of volume 0.1^3 / (6 sqrt 2).

    Catches: edges cubed for volumes.
    """
    mesh = box_mesh(2)
    volume = float(mesh.volumes.sum())
    field = SizeField(np.asarray(mesh.points), np.asarray(mesh.cells), np.full(mesh.n_vertices, 0.1))
    assert field.n_elements == pytest.approx(volume * 6.0 * math.sqrt(2.0) / 1e-3)


def test_a_saving_is_read_off_a_power_of_the_unknowns() -> None:
    """Errors 8 / n^(1/2): one of 0.1 needs 6400 unknowns, 16 times 400.

    Catches: the ratio turned round, logarithms of another base, a saving where errors do not fall.
    """
    n = [100.0, 400.0, 900.0]
    assert saving(n, [8.0 / math.sqrt(k) for k in n], 400.0, 0.1) == pytest.approx(16.0, rel=1e-12)
    assert math.isnan(saving(n, [1.0, 2.0, 3.0], 400.0, 0.1))
    assert math.isnan(saving(n, [3.0, 2.0, 1.0], 400.0, 0.0))


def test_a_limit_is_where_nothing_is_missing_any_more() -> None:
    """Estimates that see 0.4 of the error: the limit all the same.

    Catches: the estimate added as if it were the whole error, a line of the wrong slope trusted.
    """
    errors = np.array([0.5, 0.2, 0.1])
    assert extrapolated((3.0 - errors).tolist(), (0.4 * errors).tolist()) == pytest.approx(3.0, rel=1e-12)
    assert extrapolated([1.0, 2.0], [0.1, 0.2]) == pytest.approx(2.2)
    assert extrapolated([1.0], [0.1]) == pytest.approx(1.1)


def test_what_cannot_be_refined_for_is_refused() -> None:
    """Catches: an influence of half an equation, rounds that are none."""
    with pytest.raises(DesignError, match=r"mesh\.element: found P2-P1, expected P2"):
        refine(load_design("cantilever", ["mesh.element=P2-P1"]), 2)
    design, mesh = committed_bot()
    model = SolidModel.from_design(design.with_values({"mesh.element": "P2-P1"}), mesh)
    state = SolidState(model, Step(1.0, 0.0), np.zeros_like(model.system.space.points))
    with pytest.raises(ModelError, match="influence: found element P2-P1"):
        influence(state, np.zeros_like(state.u))
    for given, word in (({"rounds": -1}, "--refine"), ({"rounds": 1}, "--refine"), ({"fillet": -0.1}, "--fillet")):
        with pytest.raises(DesignError, match=word):
            ConvergencePlan(**given)
    with pytest.raises(DesignError, match="expected P2 among them"):
        ConvergencePlan(elements=("P1",), rounds=2)


def test_the_command_tells_what_refinement_saves(tmp_path: Path) -> None:
    """Two rounds for a cantilever's deflection: half the error of an even mesh of as many unknowns, or better.

    Both find one limit: refined meshes by their estimates, even ones by Richardson's extrapolation, within 1 %.
    Catches: rounds on the same mesh, a saving of the wrong mesh, a view that does not go into the report.
    """
    out = tmp_path / "out"
    assert (
        main(
            [
                "study",
                "convergence",
                "cantilever",
                "--sizes",
                "1.8,1.2,0.8",
                "--refine",
                "2",
                "--out",
                str(out),
                "--quiet",
            ]
        )
        == 0
    )
    found = json.loads((out / "summary.json").read_text())["convergence"]
    refined = found["refined"]
    unknowns = [line["unknowns_1"] for line in refined["rounds"]]
    assert unknowns[0] < unknowns[1] < unknowns[2]
    assert refined["rounds"][-1]["even_unknowns_over_these_1"] > 2.0
    (limit,) = [row["value"] for row in found["limits"] if row["quantity"] == "tip_deflection_mm"]
    assert refined["limit_mm"] == pytest.approx(limit, rel=0.01)
    assert "size of the elements [mm]" in (out / "report.html").read_text(encoding="utf-8")
    assert (out / "figures" / "refined.png").stat().st_size > 10_000


def test_fillets_stand_in_for_sharp_corners_only() -> None:
    """Catches: the radius of a design of its own replaced, fillets in machines that have no corners."""
    sharp, own = load_design("junction_bot"), load_design("junction_bot", ["skeleton.fillet_radius=0.35 mm"])

    def radius(plan: ConvergencePlan, design: Design) -> float | None:
        found = plan.rounded(design)
        return None if found is None else found.value("skeleton.fillet_radius")

    assert radius(ConvergencePlan(), sharp) == pytest.approx(0.3 * 0.68)
    assert radius(ConvergencePlan(fillet=0.25), sharp) == 0.25
    assert radius(ConvergencePlan(), own) == pytest.approx(0.35)
    assert radius(ConvergencePlan(fillet=0.0), sharp) is None
    assert radius(ConvergencePlan(), load_design("cantilever")) is None


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_peak_is_looked_for_along_the_arc(sign: float) -> None:
    """From the beam's lower face to the pillar's side, all as far from the centre of the arc.

    Catches: the arc of the other side of the corner, a quarter of another circle.
    """
    x, z, r = 0.7 * sign, 3.0, 0.4
    places = np.array(along_arc(((x, -2.0, z), (x, 3.0, z), sign), r))
    assert places[0] == pytest.approx([x + sign * r, 0.5, z])
    assert places[-1] == pytest.approx([x, 0.5, z - r])
    centre = np.array([x + sign * r, 0.5, z - r])
    assert np.linalg.norm(places - centre, axis=1) == pytest.approx(np.full(len(places), r))


@pytest.mark.slow
def test_the_peak_in_a_fillet_converges_where_that_of_a_corner_does_not() -> None:
    """At 1 kPa, sizes 2.6, 1.7 and 1.1 mm: 2.25, 2.49 and 2.54 kPa; the changes of a sharp corner's peak do not shrink.

    Catches: a mesh that leaves the fillet as it was, a peak at the kinks between straight elements.
    """
    design = load_design("junction_bot", ["muscle.passive_tension=0.9 kPa", "muscle.active_tension=0.1 kPa"])
    sizes = (2.6, 1.7, 1.1)
    rounded = ConvergencePlan().rounded(design)
    assert rounded is not None
    found = [fillet_peak(rounded, size, sizes[0], "P2") for size in sizes]
    assert abs(found[2] - found[1]) < 0.4 * abs(found[1] - found[0])
    assert limit(sizes, found, 0.05).verdict is not Verdict.not_converging
