"""Meshes that Gmsh makes of designs: their parts are where the drawing has them, whatever the size."""

from __future__ import annotations

import math
import os
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from fem_biobot.apart import Helper
from fem_biobot.config import load_design
from fem_biobot.design import Design
from fem_biobot.errors import MeshError
from fem_biobot.mesh import geometry
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.geometry import GMSH_COMMAND, GmshMissing, build_mesh, import_gmsh
from fem_biobot.mesh.layout import layout

PRESETS = {"junction_bot": 1.5, "ring_bot": 0.9, "strip": 0.5, "cantilever": 1.2}


@pytest.fixture(scope="module", params=PRESETS)
def preset(request: pytest.FixtureRequest) -> tuple[Design, BodyMesh]:
    design = load_design(request.param)
    try:
        return design, build_mesh(design, PRESETS[request.param])
    except GmshMissing as missing:
        pytest.skip(str(missing))


def normals(mesh: BodyMesh, name: str) -> np.ndarray:
    """Area vectors of the triangles of a surface, (3, f)."""
    a, b, c = (mesh.points[:, row] for row in mesh.surfaces[name])
    return np.cross(b - a, c - a, axis=0) / 2


def test_regions_have_the_volumes_of_the_drawing(preset: tuple[Design, BodyMesh]) -> None:
    """Each region's volume is the sum of its boxes, written out here by hand for the four presets, to rounding.

    Catches: ring and junction counted twice, a pillar not cut out, beam and pillars overlapping, closed forms that are
    wrong in the same way as the geometry.
    """
    design, mesh = preset
    by_hand = {
        # beam + pillars up to the beam's lower face; rings + junction - its two ends inside the rings
        "junction_bot": {
            "skeleton": 14 * 7 * 0.68 + 3.5 * 7 * (2.8 - 0.34) + 3.5 * 7 * (3.4 - 0.34),
            "muscle": 2 * (4.5 * 8 - 3.5 * 7) * 1.1 + 7 * 2.2 * 0.4 - 2 * 0.5 * 2.2 * 0.4,
        },
        "ring_bot": {
            "skeleton": 6 * 3.84 * 0.5 + 1.5 * 2.6 * (2.4 - 0.25) + 1.5 * 2.6 * (3.0 - 0.25),
            "muscle": (7.2 * 3.8 - 6 * 2.6) * 0.9,
        },
        "strip": {"muscle": 7 * 2.2 * 0.4},
        "cantilever": {"skeleton": 14 * 7 * 0.68},
    }[design.name]
    assert mesh.region_volumes() == pytest.approx(by_hand, rel=1e-9)
    assert layout(design).volumes == pytest.approx(by_hand, rel=1e-12)


def test_landmarks_of_the_design_are_vertices(preset: tuple[Design, BodyMesh]) -> None:
    """Every landmark is a vertex at its place.

    Catches: nearest vertices taken for landmarks, landmarks not part of the geometry.
    """
    design, mesh = preset
    assert set(mesh.landmarks) == set(design.landmarks())
    for name, position in design.landmarks().items():
        assert mesh.points[:, mesh.landmarks[name]] == pytest.approx(position, abs=1e-9), name


def test_surfaces_have_the_areas_and_normals_of_the_drawing(preset: tuple[Design, BodyMesh]) -> None:
    """Area vectors of all named surfaces.

    Catches: a face found on the wrong side, interior facets included, orientation inward, one strand of two.
    """
    design, mesh = preset
    by_hand = {
        "junction_bot": {
            "foot_short": (0, 0, -24.5),
            "foot_long": (0, 0, -24.5),
            "pillar_short_inner": (7 * (2.8 - 0.34), 0, 0),
            "pillar_short_outer": (-7 * (2.8 - 0.34), 0, 0),
            "pillar_long_inner": (-7 * (3.4 - 0.34), 0, 0),
            "pillar_long_outer": (7 * (3.4 - 0.34), 0, 0),
            "beam_top": (0, 0, 98),
            "junction_mid": (0.88, 0, 0),
            "interface": (0, 0, 0),
        },
        "ring_bot": {
            "foot_short": (0, 0, -3.9),
            "foot_long": (0, 0, -3.9),
            "pillar_short_inner": (2.6 * 2.15, 0, 0),
            "pillar_short_outer": (-2.6 * 2.15, 0, 0),
            "pillar_long_inner": (-2.6 * 2.75, 0, 0),
            "pillar_long_outer": (2.6 * 2.75, 0, 0),
            "beam_top": (0, 0, 6 * 3.84),
            "junction_mid": (1.08, 0, 0),
            "interface": (0, 0, 0),
        },
        "strip": {"end_minus": (-0.88, 0, 0), "end_plus": (0.88, 0, 0), "junction_mid": (0.88, 0, 0)},
        "cantilever": {"clamp": (-4.76, 0, 0), "tip": (4.76, 0, 0), "beam_top": (0, 0, 98)},
    }[design.name]
    assert set(mesh.surfaces) == set(by_hand)
    for name, area in by_hand.items():
        assert normals(mesh, name).sum(axis=1) == pytest.approx(area, abs=1e-8), name
    # all around the pillars of the junction bot; on three sides of those of the ring bot
    contact = {"junction_bot": 2 * 2 * (3.5 + 7) * 1.1, "ring_bot": 2 * (2 * 1.5 + 2.6) * 0.9}
    if design.name in contact:
        total = np.linalg.norm(normals(mesh, "interface"), axis=0).sum()
        assert total == pytest.approx(contact[design.name], rel=1e-9)


def test_the_thin_muscle_has_two_layers_and_is_finest(preset: tuple[Design, BodyMesh]) -> None:
    """No element of a junction or strip reaches through its thickness, and the general size is coarser.

    Catches: the middle layer lost, refinement of the junction lost.
    """
    design, mesh = preset
    thin = layout(design).thin
    if not thin:
        pytest.skip("no thin muscle")
    box = thin[0]
    margin = design.muscle.ring_thickness if design.kind == "bot" else 0.0  # type: ignore[union-attr]
    centre = mesh.points[:, mesh.cells].mean(axis=1)
    inside = (np.abs(centre[0]) < box.high[0] - margin) & (np.abs(centre[1]) < box.high[1])
    inside &= (centre[2] > box.low[2]) & (centre[2] < box.high[2])
    heights = np.ptp(mesh.points[2][mesh.cells[:, inside]], axis=0)
    assert heights.max() == pytest.approx(0.2, rel=1e-9)
    if design.kind == "bot":
        volume = mesh.volumes
        assert volume[inside].mean() < 0.1 * volume[mesh.regions["skeleton"]].mean()


@pytest.mark.parametrize("preset_name", ["junction_bot", "ring_bot"])
def test_the_same_design_gives_the_same_arrays(gmsh, preset_name: str) -> None:
    """Two calls, one of them in another thread, agree to the last bit, and Gmsh is not left running.

    Catches: a random seed, several threads, state left over from the first call, signal handlers in a thread.
    """
    design = load_design(preset_name)
    found = [build_mesh(design, 2.0)]
    thread = threading.Thread(target=lambda: found.append(build_mesh(design, 2.0)))
    thread.start()
    thread.join()
    one, other = found
    assert one.points.tobytes() == other.points.tobytes()
    assert one.cells.tobytes() == other.cells.tobytes()
    assert one.landmarks == other.landmarks
    assert not gmsh.isInitialized()


def test_a_running_gmsh_is_left_as_it_was(gmsh, capfd: pytest.CaptureFixture[str]) -> None:
    """Models and options of a caller's own session survive, do not change the mesh, and do not make it talk.

    Catches: finalising another's session, its options leaking in either direction.
    """
    design = load_design("strip")
    alone = build_mesh(design, 0.5)
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.model.add("mine")
        gmsh.option.setNumber("Mesh.Algorithm3D", 4)
        gmsh.option.setNumber("Mesh.MeshSizeFactor", 0.3)
        capfd.readouterr()
        within = build_mesh(design, 0.5)
        assert capfd.readouterr() == ("", "")
        assert gmsh.isInitialized()
        assert gmsh.model.getCurrent() == "mine"
        assert gmsh.model.list() == ["", "mine"]
        assert gmsh.option.getNumber("Mesh.Algorithm3D") == 4
        assert gmsh.option.getNumber("Mesh.MeshSizeFactor") == 0.3
    finally:
        gmsh.finalize()
    assert alone.points.tobytes() == within.points.tobytes()


def test_nothing_is_printed(gmsh, capfd: pytest.CaptureFixture[str]) -> None:
    """Not a character reaches the terminal, also not from compiled code.

    Catches: Gmsh's log, a warning of OpenCASCADE.
    """
    build_mesh(load_design("cantilever"), 1.5)
    assert capfd.readouterr() == ("", "")


def test_fillets_round_the_corners_and_stay_within_their_slack(gmsh) -> None:
    """With a fillet the corner landmark is on the arc, no vertex is in the cut-off corner, and the volume grows.

    Catches: fillet on the outer faces, radius as diameter, landmark left at the sharp corner.
    """
    design = load_design("junction_bot", ['skeleton.fillet_radius="0.5 mm"'])
    mesh = build_mesh(design, 1.5)
    r, x, z = 0.5, 3.5, 3.4 - 0.34
    for name, sign in (("corner_short", 1), ("corner_long", -1)):
        px, _, pz = mesh.points[:, mesh.landmarks[name]]
        # distance from the arc's axis, which lies r away from both faces
        assert math.hypot(px - sign * (-x + r), pz - (z - r)) == pytest.approx(r, rel=1e-9)
    sharp = layout(load_design("junction_bot")).volumes["skeleton"]
    added = mesh.region_volumes()["skeleton"] - sharp
    assert 2 * 7 * r**2 * (1 - math.pi / 4) < added < 2 * 7 * r**2 / 2
    foot = normals(mesh, "pillar_short_inner").sum(axis=1)
    assert foot == pytest.approx((7 * (2.8 - 0.34 - r), 0, 0), abs=1e-8)


def test_three_and_four_pillars(gmsh) -> None:
    """Each pillar has a foot, each bay a junction with its mid-section.

    Catches: middle pillars without ring, junctions that run through pillars, feet at the wrong height.
    """
    for count, length in ((3, 20), (4, 26)):
        design = load_design("junction_bot", [f"skeleton.pillar_count={count}", f'skeleton.beam_length="{length} mm"'])
        mesh = build_mesh(design, 2.5)
        feet = ["foot_short", *(f"foot_middle_{k}" for k in range(1, count - 1)), "foot_long"]
        heights = np.linspace(2.8, 3.4, count)
        for name, height in zip(feet, heights, strict=True):
            assert mesh.points[2, mesh.surfaces[name]] == pytest.approx(3.4 - height, abs=1e-9)
            assert normals(mesh, name)[2].sum() == pytest.approx(-24.5, rel=1e-9)
            assert f"{name}_centre" in mesh.landmarks
        bays = [name for name in mesh.surfaces if name.startswith("junction_mid_")]
        assert len(bays) == count - 1
        for name in ("junction_mid", *bays):
            assert normals(mesh, name)[0].sum() == pytest.approx(0.88, rel=1e-9)


def test_other_lengths_work_as_well(gmsh) -> None:
    """Random valid designs are meshed and pass every check, volumes included.

    Catches: geometry that works for the presets' numbers only. (Forty-five designs were tried once; six are kept.)
    """
    draw = np.random.default_rng(20)
    base = load_design("junction_bot")
    done = 0
    while done < 6:
        names = [
            *(f"skeleton.{k}" for k in ("beam_width", "beam_thickness", "pillar_length", "pillar_width")),
            *(f"skeleton.{k}" for k in ("short_pillar_height", "long_pillar_height")),
            *(f"muscle.{k}" for k in ("junction_width", "junction_thickness", "junction_height")),
            *(f"muscle.{k}" for k in ("ring_thickness", "ring_height")),
        ]
        values = {name: base.value(name) * draw.uniform(0.75, 1.3) for name in names}
        if done % 2:
            values["skeleton.fillet_radius"] = draw.uniform(0.1, 0.4)
        try:
            design = base.with_values(values)
        except Exception:  # not every draw fits together
            continue
        assert build_mesh(design, draw.uniform(1.5, 2.5)).quality().minimum > 0.0
        done += 1


@pytest.mark.parametrize("size", [0.0, -1.0, math.nan, math.inf])
def test_impossible_sizes_are_refused(size: float) -> None:
    """A size that is no length is refused before Gmsh is asked.

    Catches: an endless or empty mesh.
    """
    with pytest.raises(MeshError, match="positive length"):
        build_mesh(load_design("strip"), size)


def test_a_size_that_would_fill_the_machine_is_refused() -> None:
    """A micrometre is taken for a slip.

    Catches: a run that eats all memory.
    """
    with pytest.raises(MeshError, match="larger size"):
        build_mesh(load_design("junction_bot"), 1e-3)


def test_a_failure_of_gmsh_is_one_line(gmsh, monkeypatch: pytest.MonkeyPatch) -> None:
    """What Gmsh raises becomes a mesh error, and Gmsh is not left running.

    Catches: bare exceptions with a traceback, a session that stays open.
    """

    def fails(*_: object) -> None:
        raise Exception("first line\nPLC Error: facets intersect")

    monkeypatch.setattr(geometry, "set_sizes", fails)
    with pytest.raises(MeshError, match=r"at size 0\.5 mm: PLC Error: facets intersect$"):
        geometry.tetrahedra(layout(load_design("strip")), 0.5)
    assert not gmsh.isInitialized()


def test_gmsh_dies_alone(gmsh, monkeypatch: pytest.MonkeyPatch) -> None:
    """A signal that ends Gmsh is a line of text here, and the next mesh is made.

    Catches: Gmsh in the caller's own process, a helper that stays dead.
    """
    design = load_design("strip")
    with monkeypatch.context() as patch:
        patch.setattr(geometry._GMSH, "call", lambda _, *arguments: Helper.call(geometry._GMSH, os.abort))
        with pytest.raises(MeshError, match=r"size 0\.5 mm: it ended by SIGABRT.*different mesh\.size"):
            build_mesh(design, 0.5)
    assert build_mesh(design, 0.5).quality().minimum > 0.0


def test_corners_take_the_share_asked_for(gmsh) -> None:
    """Elements at re-entrant corners follow `corner_share`, the others do not.

    Catches: a share that does not reach Gmsh.
    """
    design = load_design("junction_bot")
    usual, finer = build_mesh(design, 2.0), build_mesh(design, 2.0, corner_share=0.15)
    assert finer.cells.shape[1] > 1.3 * usual.cells.shape[1]
    assert build_mesh(design, 2.0, corner_share=0.4).cells.shape == usual.cells.shape


def test_missing_libraries_are_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where the wheel's library cannot be loaded, the error names what is missing and the one command.

    Catches: an import error that reaches the user, a library name lost.
    """
    reason = "libGLU.so.1: cannot open shared object file: No such file or directory"
    (tmp_path / "gmsh.py").write_text(f"raise OSError({reason!r})\n")
    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(GmshMissing) as caught:
        build_mesh(load_design("strip"))
    assert caught.value.library == "libGLU.so.1"
    assert "libGLU.so.1 is missing" in str(caught.value)
    assert GMSH_COMMAND in str(caught.value)
    assert GMSH_COMMAND == "apt-get install -y libglu1-mesa libgl1 libxcursor1 libxft2 libxinerama1 libgomp1"


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where gmsh is not installed, the advice is to install it, not its libraries.

    Catches: apt recommended to someone who needs pip.
    """
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(GmshMissing, match="gmsh is missing; install it with: pip install gmsh"):
        import_gmsh()
