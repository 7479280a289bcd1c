"""The meshes that travel with the package: whole, of the presets as they are now, and used where Gmsh is missing."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import sys
from pathlib import Path

import pytest

from fem_biobot.config import geometry_digest, load_design, presets
from fem_biobot.errors import FileError, MeshError
from fem_biobot.mesh.committed import mesh_folder, sidecar, write_committed
from fem_biobot.mesh.files import committed_mesh, mesh_for, read_mesh
from fem_biobot.mesh.geometry import GMSH_COMMAND, GmshMissing, build_mesh, import_gmsh
from fem_biobot.mesh.layout import layout

FOLDER = mesh_folder()
assert FOLDER is not None
SIDECARS = sorted(FOLDER.glob("*.json"))
SOLID = [name for name in sorted(presets()) if load_design(name).kind != "walker"]


@pytest.fixture
def no_gmsh(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A machine on which Gmsh's library cannot be loaded."""
    (tmp_path / "gmsh.py").write_text("raise OSError('libXft.so.2: cannot open shared object file')\n")
    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.parametrize("path", SIDECARS, ids=lambda path: path.stem)
def test_sidecars_describe_their_meshes(path: Path) -> None:
    """Checksum, counts, volumes, quality and geometry of a sidecar are those of its file and of the preset.

    Catches: a mesh regenerated without its sidecar, a preset changed without its mesh, a file edited by hand.
    """
    about = json.loads(path.read_text())
    content = path.with_suffix(".msh").read_bytes()
    assert hashlib.sha256(content).hexdigest() == about["sha256"]
    design = load_design(about["design"])
    assert about["geometry_digest"] == geometry_digest(design)
    mesh = read_mesh(path.with_suffix(".msh"), design=design)
    mesh.checked(layout(design))
    again = sidecar(design, mesh_with_source(mesh, about), content.decode())
    quality, volumes = again.pop("quality"), again.pop("volumes_mm3")
    assert quality == pytest.approx(about.pop("quality"), rel=1e-12)
    assert volumes == pytest.approx(about.pop("volumes_mm3"), rel=1e-12)
    assert again == about


def mesh_with_source(mesh, about):
    """The mesh as its maker knew it."""
    from fem_biobot.mesh.body import BodyMesh

    source = {key: about[key] for key in ("generator", "gmsh_version", "size_mm", "grading")}
    return BodyMesh(mesh.points, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks, source)


def test_every_preset_has_a_small_and_a_medium_mesh() -> None:
    """Small and medium for each preset with a solid, the medium near the preset's own size, all together below 12 MB.

    Catches: a preset added without meshes, a default size changed without them.
    """
    stems = {path.stem for path in SIDECARS}
    for name in SOLID:
        assert {f"{name}_small", f"{name}_medium"} <= stems
        medium = json.loads((FOLDER / f"{name}_medium.json").read_text())
        assert medium["size_mm"] == pytest.approx(load_design(name).mesh.size, rel=0.25)
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 12e6


@pytest.mark.parametrize("name", SOLID)
def test_regenerating_gives_the_same_mesh(name: str) -> None:
    """The small meshes are those that the present geometry gives with the Gmsh version they were made with.

    Two per cent are allowed, for processors that round the last bit in another way.

    Catches: geometry or sizes changed without regenerating the meshes.
    """
    about = json.loads((FOLDER / f"{name}_small.json").read_text())
    try:
        version = import_gmsh().__version__
    except GmshMissing as missing:
        pytest.skip(str(missing))
    if version != about["gmsh_version"]:
        pytest.skip(f"made with Gmsh {about['gmsh_version']}, here is {version}")
    mesh = build_mesh(load_design(name), about["size_mm"])
    assert mesh.n_vertices == pytest.approx(about["counts"]["vertices"], rel=0.02)
    elements = {region: len(found) for region, found in mesh.regions.items()}
    assert elements == pytest.approx(about["counts"]["elements"], rel=0.02)
    assert mesh.region_volumes() == pytest.approx(about["volumes_mm3"], rel=1e-9)


def test_the_nearest_size_is_taken() -> None:
    """Sizes are compared by ratio, the design's own if none is given; another geometry has no mesh.

    Catches: the first that fits taken, sizes compared by difference, the digest ignored.
    """
    design = load_design("junction_bot")
    taken = {size: committed_mesh(design, size) for size in (None, 0.1, 0.95, 1.3, 1.4, 9.0)}
    sizes = {size: mesh.source["size_mm"] for size, mesh in taken.items() if mesh is not None}
    # the geometric mean of 0.9 and 2 is 1.34
    assert sizes == {None: 0.9, 0.1: 0.55, 0.95: 0.9, 1.3: 0.9, 1.4: 2.0, 9.0: 2.0}
    assert committed_mesh(load_design("junction_bot", ['skeleton.beam_width="7.5 mm"'])) is None


def test_without_gmsh_the_committed_mesh_is_used_and_said(no_gmsh: None) -> None:
    """Where Gmsh cannot start, a preset runs on its committed mesh with one note: what, instead of what, how to mend.

    Catches: a silent fallback, a failure although a mesh is there, a mesh graded in another way, or one without the
    fine edges that were asked for, without a word.
    """
    design = load_design("ring_bot")
    mesh, notes = mesh_for(load_design("ring_bot", ["mesh.grading = closing"]), 0.45)
    assert mesh.source["size_mm"] == 0.5
    assert set(mesh.landmarks) == set(design.landmarks())
    (note,) = notes
    for part in (
        "libXft.so.2",
        "ring_bot_medium.msh",
        "0.5 mm, grading even,",
        "0.45 mm, grading closing,",
        GMSH_COMMAND,
    ):
        assert part in note
    assert "\n" not in note
    assert "overlap" not in note
    (note,) = mesh_for(design.with_values({"mesh.grading": "edges"}), 0.5)[1]
    for part in ("grading even,", "grading edges,", "coarse, and loose rings overlap them"):
        assert part in note


def test_without_gmsh_and_without_a_mesh_the_advice_is_given(no_gmsh: None) -> None:
    """A changed geometry cannot be meshed there, and the error says what is missing and what to do.

    Catches: the mesh of another geometry used.
    """
    design = load_design("junction_bot", ['skeleton.beam_width="7.5 mm"'])
    with pytest.raises(MeshError, match=r"libXft\.so\.2 is missing") as caught:
        mesh_for(design)
    assert GMSH_COMMAND in str(caught.value)


def test_with_gmsh_the_mesh_is_built() -> None:
    """Where Gmsh works, the mesh is built at the size asked for, with nothing to note.

    Catches: the committed mesh preferred.
    """
    try:
        import_gmsh()
    except GmshMissing as missing:
        pytest.skip(str(missing))
    mesh, notes = mesh_for(load_design("strip"), 0.45)
    assert mesh.source["size_mm"] == 0.45
    assert notes == []


def test_damaged_committed_meshes_are_refused(tmp_path: Path) -> None:
    """A changed mesh, a missing one, and a sidecar that is none are refused; an empty folder has no mesh.

    Catches: a mesh used that is not what its sidecar says.
    """
    design = load_design("strip")
    assert committed_mesh(design, folder=tmp_path) is None
    for suffix in (".msh", ".json"):
        shutil.copy(FOLDER / f"strip_small{suffix}", tmp_path)
    assert committed_mesh(design, folder=tmp_path) is not None
    mesh = tmp_path / "strip_small.msh"
    mesh.write_bytes(mesh.read_bytes().replace(b"1.1", b"1.2", 1))
    with pytest.raises(MeshError, match=r"strip_small\.msh: .* sidecar"):
        committed_mesh(design, folder=tmp_path)
    mesh.unlink()
    with pytest.raises(FileError, match=r"strip_small\.msh: cannot read"):
        committed_mesh(design, folder=tmp_path)
    for text in ("{}", "no json", "[]", '{"geometry_digest": 1, "sha256": 1, "size_mm": "x"}'):
        (tmp_path / "strip_small.json").write_text(text)
        with pytest.raises(MeshError, match=r"strip_small\.json: this is no sidecar"):
            committed_mesh(design, folder=tmp_path)
    (tmp_path / "strip_small.json").unlink()
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(FileError, match=r"folder\.json: cannot read"):
        committed_mesh(design, folder=tmp_path)


def test_a_mesh_is_committed_with_the_same_bytes(tmp_path: Path) -> None:
    """Writing a committed mesh again gives the file that is there.

    Catches: times or paths in the files, unordered names.
    """
    design = load_design("strip")
    mesh = committed_mesh(design, 0.8)
    assert mesh is not None
    path = write_committed(tmp_path, "strip_small", design, mesh)
    ours, theirs = path.read_text(), (FOLDER / "strip_small.msh").read_text()
    nodes = re.compile(r"\$Nodes.*\$EndNodes", re.DOTALL)
    assert nodes.findall(ours) == nodes.findall(theirs)
    about = json.loads(path.with_suffix(".json").read_text())
    assert about["counts"] == json.loads((FOLDER / "strip_small.json").read_text())["counts"]
