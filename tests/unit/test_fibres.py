"""Piecewise fibre directions of a design: the junction at theta, rings around their pillars, one loop, a strip."""

from __future__ import annotations

import numpy as np
import pytest

from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import DesignError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.committed import committed_mesh
from fem_biobot.muscle.fibres import fibre_field, in_junction, junction_blocks, junction_direction
from tests.helpers import unchanged


def _case(name: str, *overrides: str) -> tuple[Design, BodyMesh, np.ndarray, np.ndarray]:
    """Design, mesh, fibres and centroids of the muscle."""
    design = load_design(name, ["muscle.fibres=piecewise", *overrides])
    mesh = committed_mesh(design, 2.0)
    assert mesh is not None
    with unchanged(mesh.points, mesh.cells):
        fibres = fibre_field(design, mesh)
    return design, mesh, fibres, mesh.points[:, mesh.cells[:, mesh.regions["muscle"]]].mean(axis=1)


@pytest.mark.parametrize(("degrees", "expected"), [(90.0, (1, 0, 0)), (0.0, (0, 1, 0)), (30.0, (0.5, 3**0.5 / 2, 0))])
def test_theta_is_measured_from_the_lateral_axis(degrees: float, expected: tuple) -> None:
    """90 degrees point along the machine, 0 across it, 30 by half along it.

    Catches: sine and cosine exchanged, the other sense of turning.
    """
    np.testing.assert_allclose(junction_direction(np.radians(degrees)), expected, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("name", ["junction_bot", "ring_bot", "strip"])
@pytest.mark.parametrize("theta", ["90 deg", "67 deg", "130 deg"])
def test_fibres_are_unit_vectors_in_the_muscle_plane(name: str, theta: str) -> None:
    """Every fibre has unit length and no component along z, one for each muscle element.

    Catches: an unnormalised tangent, one fibre short.
    """
    _, mesh, fibres, _ = _case(name, f"muscle.theta={theta}")
    assert fibres.shape == (3, len(mesh.regions["muscle"]))
    np.testing.assert_allclose(np.linalg.norm(fibres, axis=0), 1.0, rtol=0.0, atol=1e-14)
    assert not fibres[2].any()


def test_the_junction_has_theta_and_the_rings_follow_their_pillars() -> None:
    """The block between the pillar faces is at theta; tissue beside and behind a pillar runs along its faces.

    Catches: theta applied to the rings; the junction's ends inside the rings left out; x and y faces exchanged.
    """
    design, mesh, fibres, X = _case("junction_bot", "muscle.theta=67 deg")
    along = junction_direction(np.radians(67.0))
    # preset: pillar faces at |x| = 3.5, junction 2.2 wide and 0.4 thick at z = 1.4
    block = (np.abs(X[0]) < 3.5) & (np.abs(X[1]) < 1.1) & (np.abs(X[2] - 1.4) < 0.2)
    np.testing.assert_array_equal(in_junction(design, X), block)
    assert mesh.volumes[mesh.regions["muscle"][block]].sum() == pytest.approx(7.0 * 2.2 * 0.4, rel=1e-10)
    np.testing.assert_allclose(fibres[:, block], np.repeat(along[:, None], block.sum(), axis=1), rtol=0.0, atol=1e-15)
    beside = ~block & (np.abs(np.abs(X[0]) - 5.25) < 1.75)  # at |y| beyond the pillar
    behind = ~block & (np.abs(X[1]) < 3.5) & ~beside
    assert beside.sum() > 50
    assert behind.sum() > 50
    np.testing.assert_allclose(np.abs(fibres[0, beside]), 1.0, rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(np.abs(fibres[1, behind]), 1.0, rtol=0.0, atol=1e-14)


def test_fibres_turn_smoothly_about_a_pillars_corner() -> None:
    """At a corner the fibre is normal to the line from the pillar's corner.

    Catches: the nearest face taken at corners, a centre of turning in the pillar's middle.
    """
    _, _, fibres, X = _case("junction_bot")
    corner = (np.abs(X[0]) > 7.0) & (np.abs(X[1]) > 3.5)
    assert corner.sum() > 5
    out = np.stack([X[0] - np.sign(X[0]) * 7.0, X[1] - np.sign(X[1]) * 3.5, 0 * X[0]])[:, corner]
    np.testing.assert_allclose(np.einsum("ie,ie->e", out, fibres[:, corner]), 0.0, atol=1e-14)


def test_a_loop_runs_along_its_strands_and_around_its_ends() -> None:
    """One loop: along x beside both pillars and between them, along y at its ends; theta turns all of it.

    Catches: each pillar given a ring of its own, strands between the pillars without direction, theta turned the other
    way.
    """
    design, mesh, fibres, X = _case("ring_bot")
    half_length = design.value("skeleton.beam_length") / 2
    half_width = design.value("skeleton.pillar_width") / 2
    strand = np.abs(X[0]) < half_length
    np.testing.assert_allclose(np.abs(fibres[0, strand]), 1.0, rtol=0.0, atol=1e-14)
    end = np.abs(X[1]) < half_width
    assert end.sum() > 5
    np.testing.assert_allclose(np.abs(fibres[1, end]), 1.0, rtol=0.0, atol=1e-14)
    assert in_junction(design, X).sum() > 0
    assert np.all(np.abs(X[0, in_junction(design, X)]) < design.span / 2)
    turned = fibre_field(load_design("ring_bot", ["muscle.theta=60 deg", "muscle.fibres=piecewise"]), mesh)
    np.testing.assert_allclose(np.einsum("ie,ie->e", turned, fibres), np.sin(np.radians(60.0)), rtol=0.0, atol=1e-14)
    # in the sense of a junction's theta: (sin, cos) in both strands, whose fibres run to and fro
    wanted = junction_direction(np.radians(60.0))
    np.testing.assert_allclose(np.abs(wanted @ turned[:, strand]), 1.0, rtol=0.0, atol=1e-14)


def test_a_strip_is_one_block_at_theta() -> None:
    """All of a strip is junction, from end to end, at theta.

    Catches: a strip's ends treated as rings.
    """
    design, _, fibres, X = _case("strip", "muscle.theta=40 deg")
    assert junction_blocks(design) == [(-3.5, 3.5)]
    assert np.all(in_junction(design, X))
    expected = junction_direction(np.radians(40.0))
    np.testing.assert_array_equal(fibres, np.repeat(expected[:, None], X.shape[1], axis=1))


def test_each_bay_has_its_block() -> None:
    """Three pillars have two junction blocks, between their faces.

    Catches: one block from the first to the last pillar.
    """
    design = load_design("junction_bot", ["skeleton.pillar_count=3", "skeleton.pillar_length=2 mm"])
    # centres at -6, 0, 6: faces at -5, -1, 1, 5
    np.testing.assert_allclose(junction_blocks(design), [(-5.0, -1.0), (1.0, 5.0)], rtol=1e-14)


def test_a_design_without_muscle_has_no_fibres() -> None:
    """A cantilever is refused with its kind.

    Catches: an empty field that later looks like a muscle without tension.
    """
    design = load_design("cantilever")
    mesh = committed_mesh(design)
    with pytest.raises(DesignError, match=r"muscle: found none \(kind cantilever\)"):
        fibre_field(design, mesh)
    with pytest.raises(DesignError, match="muscle: found none"):
        in_junction(design, np.zeros((3, 1)))


def test_tissue_inside_a_pillar_is_refused() -> None:
    """A mesh whose muscle lies where the design has a pillar is not one of this design.

    Catches: a division by zero, and NaN fibres.
    """
    _, mesh, _, _ = _case("junction_bot")
    # longer pillars, whose outline covers the rings of the mesh
    for fibres in ("piecewise", "smooth"):
        other = load_design("junction_bot", ["skeleton.pillar_length=5 mm", f"muscle.fibres={fibres}"])
        with pytest.raises(DesignError, match="inside the outline of a pillar"):
            fibre_field(other, mesh)
