"""The jobs behind `fem-biobot muscle`: each examines one side of a design's muscle and writes a folder of its own.

As in `jobs`, parts that are slow to import are imported by the job that needs them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fem_biobot.orders import Order, given_mesh, mesh_size
from fem_biobot.telling import result_folder, safe_name, show, worked

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.mesh.body import BodyMesh
    from fem_biobot.study.finding import Finding
    from fem_biobot.study.reporter import Reporter

Work = Callable[["Design", Path], "Finding"]


def drive(order: Order) -> int:
    """The drive of a design over time."""
    from fem_biobot.study.muscle_drive import drive_finding

    return examined(order, "drive", drive_finding, tissue=False)


def velocity(order: Order) -> int:
    """Force over velocity of a design's muscle."""
    from fem_biobot.study.muscle_velocity import velocity_finding

    return examined(order, "velocity", velocity_finding)


def tissue(order: Order) -> int:
    """Width, section, tension and age of a design's tissue."""
    from fem_biobot.study.muscle_tissue import tissue_finding

    return examined(order, "tissue", tissue_finding)


def oxygen(order: Order) -> int:
    """Oxygen in the muscle of a design, on its mesh."""
    from fem_biobot.study.muscle_oxygen import oxygen_finding

    return _on_its_mesh(order, "oxygen", oxygen_finding)


def fibres(order: Order) -> int:
    """Fibre directions of a design's muscle, on its mesh."""
    from fem_biobot.study.muscle_fibres import fibres_finding

    def work(design: Design, mesh: BodyMesh, figures: Path) -> Finding:
        return fibres_finding(design, mesh, figures, vtk=figures.parent / "fibres.vtu")

    return _on_its_mesh(order, "fibres", work)


def _on_its_mesh(order: Order, subject: str, work: Callable[[Design, BodyMesh, Path], Finding]) -> int:
    """As `examined`, of a design and its mesh; a given one is read before anything is written."""
    from fem_biobot.config import load_design
    from fem_biobot.mesh.files import mesh_for
    from fem_biobot.study.folder import mesh_identity

    size, given = mesh_size(order.size), given_mesh(order, load_design(order.design, order.sets))

    def meshed(design: Design, figures: Path) -> Finding:
        mesh, notes = mesh_for(design, size) if given is None else (given, [])
        found = work(design, mesh, figures)
        return replace(found, notes=[*notes, *found.notes])

    which = mesh_identity(order.mesh_file)
    return examined(order, subject, meshed, mesh=which if size is None else f"{which}, {size:g} mm")


def orientation(order: Order, file: Path) -> int:
    """Orientation of fibres in a file, seen from a design's axis."""
    from fem_biobot.design_files import content_of
    from fem_biobot.study.muscle_orientation import orientation_finding

    def work(design: Design, figures: Path) -> Finding:
        return orientation_finding(design, file, figures)

    return examined(order, "orientation", work, mesh=content_of(file))


def examined(order: Order, subject: str, work: Work, *, mesh: str = "none", tissue: bool = True) -> int:
    """Examine one subject of an order's design and show what was found.

    Parameters
    ----------
    order
        Options of the command.
    subject
        Last word of the command; names the default folder too.
    work
        Does it: the design and the folder of figures in, a `Finding` out.
    mesh
        What else tells this result from another of the same design.
    tissue
        Whether the subject asks for a muscle with a volume; rods with muscles will do otherwise.

    Raises
    ------
    BiobotError
        A design without a muscle, before anything is written, and as `examine`.
    """
    from fem_biobot.config import load_design
    from fem_biobot.design_checks import refuse_without_muscle
    from fem_biobot.study.finding import examine, tables_of

    design = load_design(order.design, order.sets)
    refuse_without_muscle(design, f"examine its {subject}", tissue=tissue)
    folder = result_folder(design, order.out or Path("runs") / f"{safe_name(design.name)}_{subject}")

    def job(reporter: Reporter) -> dict[str, Any]:
        return examine(design, folder, subject, work, mesh=mesh, force=order.force, reporter=reporter)

    summary = worked(order, folder, job)
    show(order, summary, folder, lambda: (tables_of(summary), summary["remarks"]))
    return 0
