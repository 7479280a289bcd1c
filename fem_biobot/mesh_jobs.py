"""The job behind `fem-biobot mesh`: a design's mesh, a person's own mesh or skeleton, and drawings to give away.

As in `jobs`, what is slow to import is imported by the job that needs it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fem_biobot.errors import DesignError, FileError
from fem_biobot.files import file_error, write_text
from fem_biobot.orders import Order, mesh_size, region_names
from fem_biobot.telling import print_json, safe_name, say, standard_output_free, usable_folder

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.mesh.body import BodyMesh


@dataclass(frozen=True)
class MeshOrder:
    """What the options of `mesh` say beside an `Order`.

    Attributes
    ----------
    skeleton, muscle
        STEP or STL files instead of the design's parts.
    unit
        Of STL files.
    align
        Whether to move them to the design's place.
    landmarks
        Texts such as ``corner_short=-3.5,0,3.06``.
    export, export_muscle
        Files for the design's parts.
    fit
        Whether the design takes its lengths from the files.
    """

    skeleton: Path | None = None
    muscle: Path | None = None
    unit: str | None = None
    align: bool = False
    landmarks: Sequence[str] = ()
    export: Path | None = None
    export_muscle: Path | None = None
    fit: bool = False


def mesh(order: Order, own: MeshOrder) -> int:
    """Mesh a design into a file, with parts of a person's own if there are any, or check a given mesh."""
    from fem_biobot.config import load_design
    from fem_biobot.design_checks import refuse_without_solid

    design = load_design(order.design, order.sets) if order.design else None
    if design is not None:
        refuse_without_solid(design, "mesh")
    size, names, marks = mesh_size(order.size), region_names(order.rename), landmark_places(own.landmarks)
    if order.out is not None:
        usable_folder(order.out)
    if own.export or own.export_muscle:
        assert design is not None
        return _export(order, own, design)

    from fem_biobot.mesh.files import mesh_for, read_mesh
    from fem_biobot.mesh.own_shape import shape_notes
    from fem_biobot.mesh.tagged import mesh_text
    from fem_biobot.progress import reporting, show_tables
    from fem_biobot.results import mesh_summary, mesh_tables

    with standard_output_free(order.json), reporting(order.quiet) as reporter:
        notes: list[str] = []
        found: BodyMesh
        if order.mesh_file is not None:
            found = read_mesh(order.mesh_file, names or None, design=design)
        elif own.skeleton is not None:
            from fem_biobot.mesh.foreign import fitted, import_mesh

            assert design is not None
            parts = {"muscle": own.muscle, "unit": own.unit, "names": names}
            if own.fit:
                asked = [text.partition("=")[0].strip() for text in order.sets]
                design = fitted(design, own.skeleton, **parts, kept=asked)
            found = import_mesh(design, own.skeleton, size=size, align=own.align, landmarks=marks, **parts)
        else:
            assert design is not None
            found, notes = mesh_for(design, size)
        if design is not None and (order.mesh_file is not None or own.skeleton is not None):
            notes += shape_notes(design, found)
        for note in notes:
            reporter.note(note)
    file = None
    if order.mesh_file is None or order.out is not None:
        title = design.name if design is not None else order.mesh_file.stem if order.mesh_file is not None else ""
        file = (order.out or Path()) / f"{safe_name(title)}.msh"
        _write(file, mesh_text(found), order.force)
        if own.fit and design is not None:
            from fem_biobot.config import to_toml

            _write(file.with_suffix(".toml"), to_toml(design), order.force)
    summary = {**mesh_summary(found, design), "file": str(file or order.mesh_file), "notes": notes}
    if order.json:
        print_json(summary)
    elif order.quiet:
        say(summary["file"])
    else:
        show_tables(mesh_tables(summary))
        if own.fit:
            say("", f"lengths taken from {own.skeleton}: {file.with_suffix('.toml') if file else ''}")
        say("", summary["file"] if file is not None else f"{order.mesh_file}: a sound mesh; nothing was written")
    return 0


def landmark_places(texts: Sequence[str]) -> Mapping[str, tuple[float, float, float]]:
    """Positions [mm] by name, from texts such as ``corner_short=-3.5,0,3.06``."""
    found: dict[str, tuple[float, float, float]] = {}
    for text in texts:
        name, _, place = (part.strip() for part in text.partition("="))
        try:
            x, y, z = (float(part) for part in place.split(","))
        except ValueError:
            raise DesignError(
                f"--landmark: found {text!r}, expected NAME=X,Y,Z in mm, such as corner_short=-3.5,0,3.06"
            ) from None
        if not name or name in found:
            raise DesignError(f"--landmark: found {text!r}, expected a name that is given once")
        found[name] = (x, y, z)
    return found


def _export(order: Order, own: MeshOrder, design: Design) -> int:
    """Write the design's parts as drawings."""
    from fem_biobot.mesh.foreign import export_part

    files = {"skeleton": own.export, "muscle": own.export_muscle}
    wanted = {region: file for region, file in files.items() if file is not None}
    for file in wanted.values():
        if file.exists() and not order.force:
            raise FileError(f"{file}: found a file, expected none; give another name, or --force to replace it")
    for region, file in wanted.items():
        export_part(design, file, region)
    if order.json:
        print_json({"design": design.name, "files": {region: str(file) for region, file in wanted.items()}})
    else:
        say(*map(str, wanted.values()))
    return 0


def _write(file: Path, text: str, force: bool) -> None:
    """Write a file; another one of that name stays unless forced."""
    if file.exists() and not force:
        try:
            same = file.read_bytes() == text.encode()
        except OSError as error:
            raise file_error(error, file, doing="read") from None
        if same:
            return
        what = "mesh" if file.suffix == ".msh" else "design"
        raise FileError(f"{file}: found another {what}, expected none; give another --out, or --force to replace it")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise file_error(error, file.parent, doing="make the folder") from None
    write_text(file, text)
