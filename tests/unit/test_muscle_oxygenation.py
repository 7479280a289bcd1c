"""Oxygen in a design's muscle: which faces are wetted, what the viable share does to the tension, what is refused."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import skfem

from fem_biobot.config import load_design, to_toml
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, MeshError
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.files import read_mesh
from fem_biobot.muscle import oxygenation as module
from fem_biobot.muscle.drive import active_force
from fem_biobot.muscle.oxygen_depth import slab_gamma
from fem_biobot.muscle.oxygenation import divided, oxygenation, section_gamma, viable_gamma, viable_share
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.from_design import model_from_design, tension_unit
from fem_biobot.study.muscle_findings import oxygen_notes
from fem_biobot.study.muscle_oxygen import thickness_rule
from tests.command import ROOT, call

# uses more than reaches the middle of the rings, and of the junction when that is thickened
HUNGRY = ("muscle.oxygen.consumption = 0.015 mM/s",)
PERMEABLE = ("muscle.oxygen.gel = permeable", "muscle.oxygen.gel_diffusivity = 1e-3 mm^2/s")


@cache
def body(name: str) -> BodyMesh:
    """A committed mesh."""
    return read_mesh(ROOT / "meshes" / f"{name}_small.msh")


@pytest.fixture(autouse=True)
def undivided(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fields on the bodies' own meshes, quick and coarse."""
    monkeypatch.setattr(module, "_MOST_ELEMENTS", 0)


def hungry(*more: str) -> Design:
    """The junction machine with a consumption that its rings cannot bear."""
    return load_design("junction_bot", [*HUNGRY, *more])


def test_the_medium_wets_what_is_not_on_the_gel() -> None:
    """On the interface oxygen is below the medium's, on free faces it is the medium's; a permeable gel lets more in.

    Catches: the interface wetted, free faces sealed, the gel consuming oxygen.
    """
    found = oxygenation(hungry(), body("junction_bot"))
    c, mesh = found.field.c, found.field.basis.mesh
    supply = found.field.law.supply
    vertex = c[found.field.basis.nodal_dofs[0]]
    used = np.unique(body("junction_bot").cells[:, body("junction_bot").regions["muscle"]])
    shared = np.intersect1d(used, np.unique(body("junction_bot").surfaces["interface"]))
    inner = np.searchsorted(used, shared)
    assert mesh.p[:, inner] == pytest.approx(body("junction_bot").points[:, shared])
    assert np.mean(vertex[inner] < 0.9 * supply) > 0.3
    free = np.setdiff1d(mesh.boundary_nodes(), inner)
    assert vertex[free] == pytest.approx(supply)
    through = oxygenation(hungry(*PERMEABLE), body("junction_bot"))
    assert through.gamma_whole > found.gamma_whole + 0.01
    # both counted over the muscle alone
    volume = found.field.basis.dx.sum()
    assert through.field.basis.dx[through.tissue].sum() == pytest.approx(volume)
    assert found.field.uptake < through.field.uptake < found.field.law.consumption * volume


def test_dividing_keeps_parents_and_faces() -> None:
    """Eight parts fill each tetrahedron, and the parts of the wetted faces are all that lie on them.

    Catches: parents in another order, a face whose middle part is forgotten, edges mixed up.
    """
    coarse = skfem.MeshTet.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 0.7, 3), np.linspace(0, 0.4, 2))
    top = coarse.facets_satisfying(lambda x: np.isclose(x[2], 0.4))
    fine, faces, parent = divided(coarse, top)
    assert np.bincount(parent).tolist() == [8] * coarse.nelements
    assert np.sort(faces).tolist() == np.sort(fine.facets_satisfying(lambda x: np.isclose(x[2], 0.4))).tolist()
    # the centroids of eight equal parts have that of the whole as their mean
    parts, whole = fine.p[:, fine.t].mean(axis=1), coarse.p[:, coarse.t].mean(axis=1)
    mean = np.stack([np.bincount(parent, parts[k]) / 8.0 for k in range(3)])
    assert mean == pytest.approx(whole, abs=1e-12)


def test_meshes_that_are_coarse_for_the_depth_are_divided(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a consumption whose depth is less than an element the field is solved on parts; gamma comes nearer to that of
    the plane section, shares stay those of the body's elements, and a repeated question is not solved again.

    Catches: shares in the order of the parts, a division that changes the body's volume, a field solved at each call.
    """
    design = load_design("ring_bot", ["muscle.gamma = 1", "muscle.oxygen.consumption = 0.03 mM/s"])
    coarse = oxygenation(design, read_mesh(ROOT / "meshes" / "ring_bot_small.msh"))
    monkeypatch.setattr(module, "_MOST_ELEMENTS", 3000)
    mesh = read_mesh(ROOT / "meshes" / "ring_bot_small.msh")
    found = oxygenation(design, mesh)
    assert len(found.tissue) == 8 * len(coarse.tissue)
    assert abs(found.gamma - section_gamma(design)) < abs(coarse.gamma - section_gamma(design))
    assert found.field.basis.dx.sum() == pytest.approx(mesh.region_volumes()["muscle"])
    volumes = mesh.volumes[mesh.regions["muscle"]]
    assert found.viable @ volumes / volumes.sum() == pytest.approx(found.gamma_whole)
    assert oxygenation(design, mesh) is found


def test_a_strip_cut_from_a_plate_is_a_slab() -> None:
    """Ends of a strip are symmetry planes: oxygen does not depend on x, and a film law acts on its sides.

    Catches: wetted ends.
    """
    design = load_design("strip", ["muscle.oxygen.consumption = 0.002 mM/s"])
    found = oxygenation(design, body("strip"))
    p, vertex = found.field.basis.mesh.p, found.field.c[found.field.basis.nodal_dofs[0]]
    middle = vertex[np.abs(p[0]) < 0.2 * design.span].min()
    assert vertex[np.isclose(p[0], design.span / 2)].min() == pytest.approx(middle, rel=0.1)
    assert middle < 0.95 * found.field.law.supply


def test_viable_share_scales_the_tension_element_by_element() -> None:
    """The solid's tension is the design's times the share of each element, or times gamma, or whole.

    Catches: gamma entering twice or not at all, passive tension left out, the order of elements mixed up.
    """
    mesh = body("junction_bot")
    design = hungry()
    field = viable_share(design, mesh)
    assert np.ptp(field) > 0.5
    tension = np.asarray(model_from_design(design, mesh).active["muscle"].tension)
    assert tension == pytest.approx(tension_unit(design) * oxygenation(design, mesh).viable)
    thick = ("muscle.junction_thickness = 0.85 mm",)
    section = hungry("muscle.oxygen.tension = section", *thick)
    gamma = section_gamma(section)
    assert slab_gamma(oxygenation(section, mesh).field.law, 0.85) < gamma < 0.97
    assert np.asarray(model_from_design(section, mesh).active["muscle"].tension) == pytest.approx(gamma * 10.39)
    free = hungry("muscle.oxygen.tension = none", "muscle.gamma = 0.7", *thick)
    assert np.asarray(model_from_design(free, mesh).active["muscle"].tension) == pytest.approx(0.7 * 10.39)
    # rods have one number for the section
    assert [m.gamma for m in reduce(section).members] == [gamma]
    assert viable_gamma(free) == 0.7
    assert active_force(section) == pytest.approx(gamma * 1.3 * 2.2 * 0.85)


def test_dead_tissue_is_said_in_one_line() -> None:
    """A muscle whose middle gets no oxygen has gamma 0 and says so; one that loses a part says how much; a sound one
    says nothing.

    Catches: silence about a machine without a muscle.
    """
    mesh = body("ring_bot")

    def notes(*settings: str) -> list[str]:
        return oxygenation(load_design("ring_bot", ["muscle.gamma = 1", *settings]), mesh).notes()

    starved = ("muscle.oxygen.supply = 2.1e-3 mM", "muscle.oxygen.film = 1e-4 mm/s")
    dead = notes(*starved, "muscle.oxygen.consumption = 1 mM/s")
    assert "gamma is 0" in dead[0]
    assert oxygen_notes(hungry(), body("junction_bot")) == oxygenation(hungry(), body("junction_bot")).notes() != []
    assert oxygen_notes(load_design("junction_bot"), body("junction_bot")) == []
    no_muscle = load_design("ring_bot", ["muscle.gamma = 1", *starved, "muscle.oxygen.consumption = 1 mM/s"])
    with pytest.raises(DesignError, match=r"muscle\.oxygen: found gamma 0"):
        oxygen_notes(no_muscle, mesh)
    assert "% of the tissue gets less than 0.002 mM" in notes(*HUNGRY)[0]
    assert notes("muscle.oxygen.consumption = 1e-4 mM/s") == []
    assert any("too coarse" in line for line in notes("muscle.oxygen.consumption = 0.3 mM/s"))


def test_impossible_oxygen_is_refused_by_its_key() -> None:
    """Threshold, gel and a share stated twice are refused when the design is made; a mesh or a design without muscle
    when its oxygen is asked for.

    Catches: a message without the key, gamma applied on top of oxygen.
    """
    for settings, words in (
        (("muscle.oxygen.threshold = 0.3 mM",), r"muscle\.oxygen\.threshold: found 0\.3 mM, expected less than"),
        (("muscle.oxygen.gel = permeable",), r"muscle\.oxygen\.gel_diffusivity: missing"),
        ((PERMEABLE[1],), r"muscle\.oxygen\.gel_diffusivity: found with"),
        ((*HUNGRY, "muscle.gamma = 0.8"), r"muscle\.gamma: found 0\.8 together with muscle\.oxygen"),
        (("muscle.oxygen.consumption = 0.015",), r"muscle\.oxygen\.consumption: found \"0\.015\" \(no unit\)"),
        (("muscle.oxygen.film = 0 mm/s",), r"muscle\.oxygen\.film: found 0 mm/s, expected above"),
    ):
        with pytest.raises(DesignError, match=words):
            load_design("junction_bot", settings)
    assert load_design("junction_bot", ["muscle.oxygen.tension = none", "muscle.gamma = 0.8"])
    with pytest.raises(MeshError, match="muscle: found no such region"):
        oxygenation(hungry(), body("cantilever"))
    ring = body("ring_bot")
    moved = BodyMesh(ring.points + np.array([[50.0], [0.0], [0.0]]), ring.cells, ring.regions)
    with pytest.raises(MeshError, match="no tissue in the middle"):
        oxygenation(load_design("ring_bot"), moved)
    with pytest.raises(DesignError, match="muscle: found none"):
        oxygenation(load_design("cantilever"), body("cantilever"))
    with pytest.raises(DesignError, match="muscle: found none"):
        viable_gamma(load_design("cantilever"))


def test_a_design_with_oxygen_reads_back(tmp_path: Path) -> None:
    """The resolved file holds every key of the section, with its units.

    Catches: a nested section that is not written.
    """
    design = hungry(*PERMEABLE, "muscle.oxygen.film = 20 um/s")
    file = tmp_path / "d.toml"
    file.write_text(to_toml(design))
    assert load_design(file).muscle == design.muscle
    assert "[muscle.oxygen]" in file.read_text()
    assert (
        load_design("junction_bot", ["muscle.oxygen.diffusivity=2e-5 cm^2/s"]).value("muscle.oxygen.diffusivity")
        == 2e-3
    )


def test_the_rule_for_thickness_falls_with_consumption() -> None:
    """The table's rows: thicker for less, and always beyond what constant consumption reaches times gamma.

    Catches: rows in which the consumption is not set.
    """
    from fem_biobot.muscle.oxygenation import oxygen_law

    rows = thickness_rule(oxygen_law(load_design("junction_bot")))
    thickness = np.array([row["largest_thickness_mm"] for row in rows])
    use = np.array([row["consumption_mM_per_s"] for row in rows])
    assert thickness * np.sqrt(use) == pytest.approx(thickness[0] * np.sqrt(use[0]), rel=1e-3)
    assert np.all(thickness > [row["critical_thickness_mm"] for row in rows])


def test_the_command_tells_of_a_given_mesh(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Numbers, maps and the rule are written, notes come to standard error and into the summary; options that clash or
    a machine without tissue are refused.

    Catches: the mesh option ignored, notes lost, a picture that is not there.
    """
    mesh = ROOT / "meshes" / "junction_bot_small.msh"
    out = tmp_path / "o"
    said = call(capsys, "muscle", "oxygen", "junction_bot", "--mesh", mesh, "--set", HUNGRY[0], "--out", out, "--json")
    assert said.code == 0
    summary = json.loads(said.out)
    expected = oxygenation(hungry(), read_mesh(mesh, None, design=hungry()))
    assert summary["oxygen"]["gamma_1"] == pytest.approx(expected.gamma)
    assert summary["notes"]
    assert summary["notes"][0] in said.err
    for name in ("figures/oxygen_section.png", "figures/oxygen_thickness.png", "tables/oxygen_thickness.csv"):
        assert (out / name).stat().st_size > 100
    clash = call(capsys, "muscle", "oxygen", "junction_bot", "--mesh", mesh, "--size", "1")
    assert (clash.code, "--size" in clash.complaint) == (2, True)
    walker = call(capsys, "muscle", "oxygen", "elastica_walker", "--out", tmp_path / "w")
    assert (walker.code, "kind: found walker" in walker.complaint) == (2, True)
