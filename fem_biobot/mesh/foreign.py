"""A person's own skeleton, from STEP or STL, meshed with the muscle of a design; and a design's parts as such files.

The design stays what says where things are: the given skeleton has its box, its feet and the ends of its span. Its
pillars may have any shape: a fiftieth of a section or of a volume is a detail (rounded edges), and where they are no
boxes the rings follow them (`own_pillars`), and what takes boxes is told (`own_shape`). The muscle is built round the
given pillars from the design's lengths, or given too. A skeleton of other lengths lends them to the design (`fitted`).
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from scipy.spatial import KDTree

from fem_biobot.design import Design
from fem_biobot.design_checks import refuse_without_solid
from fem_biobot.errors import DesignError, MeshError
from fem_biobot.files import file_error, write_bytes
from fem_biobot.mesh.body import BodyMesh
from fem_biobot.mesh.checks import check_volumes
from fem_biobot.mesh.geometry import drawn_lengths, exported, meshed
from fem_biobot.mesh.layout import Point, layout
from fem_biobot.mesh.naming import MissingError
from fem_biobot.mesh.own_shape import DETAIL, check_shape
from fem_biobot.mesh.solids import Given, Part
from fem_biobot.mesh.stl import UNITS, read_stl

SUFFIXES = (".step", ".stp", ".stl")
REGIONS = ("skeleton", "muscle")


def import_mesh(
    design: Design,
    skeleton: str | os.PathLike[str],
    *,
    muscle: str | os.PathLike[str] | None = None,
    unit: str | None = None,
    size: float | None = None,
    align: bool = False,
    landmarks: Mapping[str, Point] | None = None,
    names: Mapping[str, str] | None = None,
) -> BodyMesh:
    """Mesh of a given skeleton with the muscle of a design, conforming, with the design's names.

    Parameters
    ----------
    design
        A bot, or a cantilever, of the skeleton's lengths.
    skeleton
        STEP or STL file; STEP says its unit itself.
    muscle
        The same of the muscle, in the skeleton's frame; by default it is built round the pillars.
    unit
        Of the numbers in STL files: mm, cm, m, um or in.
    size
        General element size [mm]; that of the design if None.
    align
        Move the parts so that the skeleton's box is the design's; its axes must be those of the design.
    landmarks
        Positions [mm] instead of the design's, for names that it knows.
    names
        Names of solids in the skeleton's STEP file to skeleton or muscle. Where solids have these names, or are mapped
        to them, the file is split by them; else all of it is skeleton.

    Returns
    -------
    BodyMesh
        Checked, with the regions, surfaces and landmarks of the design: landmarks are part of the geometry, so
        vertices.

    Raises
    ------
    GmshMissing, FileError
        Gmsh cannot be imported; a file cannot be read.
    MeshError
        A file without a closed body, of another unit or place, of another machine (box, junction or rings; volumes
        beyond 2 % where it is not the pillars' shape), without a face or point that the design names; a pillar that no
        ring can go round; a muscle that overlaps the skeleton or does not touch it; a mesh that lacks 2 % of the
        drawing's volume.
    """
    refuse_without_solid(design, "mesh")
    plan = layout(design)
    if "skeleton" not in plan.volumes:
        raise MeshError(
            f"kind: found {design.kind}, which has no skeleton; expected bot or cantilever to mesh {skeleton}"
        )
    if muscle is not None and "muscle" not in plan.volumes:
        raise MeshError(f"kind: found {design.kind}, which has no muscle; expected bot to mesh {muscle}")
    moved = dict(landmarks or {})
    unknown = sorted(set(moved) - set(plan.landmarks))
    if unknown:
        raise MeshError(f"landmark {unknown[0]}: unknown, expected one of: {', '.join(plan.landmarks)}")
    plan = replace(plan, landmarks={**plan.landmarks, **moved})
    given = _given(skeleton, muscle, unit, align, names)
    try:
        mesh = meshed(plan, design.mesh.size if size is None else size, given=given)
    except MissingError as error:
        advice = "; give its place with --landmark NAME=X,Y,Z" if error.kind == "landmark" else ""
        raise MeshError(f"{skeleton}: {error}{advice}") from None
    if "muscle" in mesh.regions and "interface" not in mesh.surfaces:
        one, other = (mesh.points[:, mesh.region_vertices(name)].T for name in REGIONS)
        gap = float(KDTree(one).query(other)[0].min())
        raise MeshError(
            f"{muscle or skeleton}: the muscle does not touch the skeleton, vertices are {gap:.3g} mm apart"
        )
    check_shape(plan, mesh)
    drawn = {name: float(str(mesh.source[f"drawn_{name}_mm3"])) for name in mesh.regions}
    slack = {name: DETAIL * volume for name, volume in drawn.items()}
    check_volumes(mesh.region_volumes(), drawn, slack, of=f"{skeleton}, as it is drawn,")
    source = {**mesh.source, "skeleton": Path(skeleton).name, "muscle": Path(muscle).name if muscle else "built"}
    return BodyMesh(mesh.points, mesh.cells, mesh.regions, mesh.surfaces, mesh.landmarks, source).checked()


def fitted(
    design: Design,
    skeleton: str | os.PathLike[str],
    *,
    muscle: str | os.PathLike[str] | None = None,
    unit: str | None = None,
    names: Mapping[str, str] | None = None,
    kept: Collection[str] = (),
) -> Design:
    """A design with the lengths of a given skeleton, and of a muscle that comes with it.

    Parameters
    ----------
    design
        A bot; its pillars are as many as the skeleton's, all else stays unless the files say otherwise.
    skeleton, muscle, unit, names
        As `import_mesh`.
    kept
        Keys that stay as the design has them.

    Raises
    ------
    GmshMissing, FileError
        Gmsh cannot be imported; a file cannot be read.
    MeshError
        A file in which beam, pillars or junction are not found, or whose lengths make no design.
    """
    refuse_without_solid(design, "mesh")
    skeleton_of, muscle_of = design.skeleton, design.muscle
    if design.kind != "bot" or skeleton_of is None or muscle_of is None:
        raise MeshError(f"kind: found {design.kind}, expected a bot to take the lengths of {skeleton}")
    given = _given(skeleton, muscle, unit, False, names)
    found = drawn_lengths(given, skeleton_of.pillar_count, looped=muscle_of.layout == "ring")
    # nanometres: what OpenCASCADE adds to its boxes is no length
    values = {key: round(value, 6) for key, value in found.items() if key not in kept}
    try:
        return design.with_values(values)
    except DesignError as error:
        told = ", ".join(f"{key} {value:g} mm" for key, value in values.items())
        raise MeshError(f"{skeleton}: its lengths make no design: {error}; found {told}") from None


def _given(
    skeleton: str | os.PathLike[str],
    muscle: str | os.PathLike[str] | None,
    unit: str | None,
    align: bool,
    names: Mapping[str, str] | None,
) -> Given:
    return Given(_part(skeleton, unit), None if muscle is None else _part(muscle, unit), align, dict(names or {}))


def export_part(design: Design, path: str | os.PathLike[str], region: str = "skeleton") -> None:
    """Write a part of a design as STEP or STL in mm, in the frame of the design.

    Parameters
    ----------
    design
        Whose part.
    path
        File ending in .step, .stp or .stl.
    region
        ``skeleton`` or ``muscle``.

    Raises
    ------
    GmshMissing, MeshError
        Gmsh cannot be imported; the design has no such part.
    FileError
        The file cannot be written.
    """
    refuse_without_solid(design, "mesh")
    suffix, plan = _suffix(path), layout(design)
    if region not in plan.volumes:
        raise MeshError(f"{path}: found no {region} in a design of kind {design.kind}, expected one to export")
    write_bytes(path, exported(plan, region, suffix))


def _suffix(path: str | os.PathLike[str]) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise MeshError(
            f"{path}: found a name that ends in {suffix or 'nothing'}, expected one of: {', '.join(SUFFIXES)}"
        )
    return suffix


def _part(path: str | os.PathLike[str], unit: str | None) -> Part:
    """A person's part, read as far as that goes without Gmsh."""
    if _suffix(path) == ".stl":
        if unit is None:
            raise MeshError(f"{path}: an STL file does not say its unit; give it with --unit {'|'.join(UNITS)}")
        return Part(str(path), read_stl(path, unit))
    if unit is not None and unit != "mm":
        raise MeshError(f"{path}: unit: found {unit}, but a STEP file says its own; leave it out")
    try:
        with Path(path).open("rb") as file:
            head = file.read(13)
    except OSError as error:
        raise file_error(error, path, doing="read") from None
    if head != b"ISO-10303-21;":
        raise MeshError(f"{path}: this is no STEP file, whose first line is ISO-10303-21;")
    # read by a helper process, which may be elsewhere
    return Part(str(Path(path).absolute()))
