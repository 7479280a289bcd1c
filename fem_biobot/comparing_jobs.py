"""The jobs behind `crosscheck` and `validate`: a design's models beside each other, and beside the paper.

As in `jobs`, what is slow to import is imported by the job that needs it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fem_biobot.orders import Order, given_mesh, mesh_size
from fem_biobot.telling import result_folder, safe_name, show, worked
from fem_biobot.units import parse_quantity

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.mesh.body import BodyMesh
    from fem_biobot.study.finding import Finding
    from fem_biobot.study.reporter import Reporter


def crosscheck(order: Order, pixel: str | None = None, noise: float | None = None, seed: int | None = None) -> int:
    """Solid and rods of a design side by side, also as a camera with noise sees them."""
    from fem_biobot.link.camera import Camera
    from fem_biobot.link.expected import expect

    given: dict[str, Any] = {} if seed is None else {"seed": seed}
    if pixel is not None:
        given["pixel"] = parse_quantity(pixel, "mm", "--pixel")
    camera = Camera(**given, noise=(0.5 if pixel is not None else 0.0) if noise is None else noise)

    def refuse(design: Design) -> None:
        expect(design)

    def work(design: Design, mesh: BodyMesh, figures: Path, reporter: Reporter, notes: Sequence[str]) -> Finding:
        from fem_biobot.study.crosscheck import crosscheck_finding

        return crosscheck_finding(design, mesh, figures, reporter, notes, camera)

    seen = {} if pixel is None else {"camera": f"{camera.pixel:g} mm, {camera.noise:g} pixels, seed {camera.seed}"}
    _on_a_mesh(order, "crosscheck", "cross-check", refuse, work, seen)
    return 0


def measured(order: Order, file: Path, names: Sequence[str]) -> int:
    """Tension and modulus from a person's measured deflections."""
    from fem_biobot.config import load_design
    from fem_biobot.design_files import content_of
    from fem_biobot.link.expected import expect
    from fem_biobot.link.measured import read_measured

    # refused before anything is meshed, and read by the resolved design again below
    read_measured(file, load_design(order.design, order.sets))

    def refuse(design: Design) -> None:
        expect(design)

    def work(design: Design, mesh: BodyMesh, figures: Path, reporter: Reporter, notes: Sequence[str]) -> Finding:
        from fem_biobot.study.measured import measured_finding

        return measured_finding(design, mesh, read_measured(file, design), names, figures, reporter, notes)

    given = {"measured": content_of(file), "fit": " ".join(names)}
    _on_a_mesh(order, "measured", "measured", refuse, work, given)
    return 0


def validate(order: Order) -> int:
    """The paper's printed numbers beside ours; 1 if one that is predicted lies outside."""
    from fem_biobot.link.expected import causes

    def refuse(design: Design) -> None:
        causes(design)

    def work(design: Design, mesh: BodyMesh, figures: Path, reporter: Reporter, notes: Sequence[str]) -> Finding:
        from fem_biobot.rod.compiling import compile_kernels
        from fem_biobot.study.validate import validation_finding

        compile_kernels(reporter)
        return validation_finding(design, mesh, figures, reporter, notes)

    summary = _on_a_mesh(order, "validate", "validate", refuse, work)
    found = summary["validate"]
    if not found["failed_1"]:
        return 0
    models = ("solid", "rods", "equations")
    told = sum(any(row[model] is not None for model in models) for row in found["rows"])
    failed = found["failed_1"]
    print(f"of {told} numbers predicted, {failed} lie outside what was printed", file=sys.stderr)  # noqa: T201
    return 1


def _on_a_mesh(
    order: Order,
    subject: str,
    verb: str,
    refuse: Callable[[Design], None],
    work: Callable[[Design, BodyMesh, Path, Reporter, Sequence[str]], Finding],
    others: dict[str, str] | None = None,
) -> dict[str, Any]:
    """Do a job on a design's mesh that ends in a finding, in a folder of its own, and show it; its summary."""
    from fem_biobot.config import load_design
    from fem_biobot.design_checks import refuse_unbonded, refuse_without_solid

    design, size = load_design(order.design, order.sets), mesh_size(order.size)
    refuse_without_solid(design, verb)
    refuse_unbonded(design, f"compare it ({verb})")
    folder = result_folder(design, order.out or Path("runs") / f"{safe_name(design.name)}_{subject}")
    refuse(design)  # other machines, before anything is meshed

    from fem_biobot.mesh.files import mesh_for
    from fem_biobot.mesh.own_shape import shape_notes
    from fem_biobot.solid.compiling import compile_kernels
    from fem_biobot.study.finding import examine, tables_of
    from fem_biobot.study.folder import mesh_identity

    design = design if size is None else design.with_values({"mesh.size": size})
    given = given_mesh(order, design)

    def job(reporter: Reporter) -> dict[str, Any]:
        def found(design: Design, figures: Path) -> Finding:
            mesh, notes = mesh_for(design) if given is None else (given, shape_notes(design, given))
            compile_kernels(reporter, design.mesh.element)
            return work(design, mesh, figures, reporter, notes)

        which = mesh_identity(order.mesh_file)
        return examine(
            design, folder, subject, found, mesh=which, kind="", identity=others, force=order.force, reporter=reporter
        )

    summary = worked(order, folder, job)
    show(order, summary, folder, lambda: (tables_of(summary), summary["remarks"]))
    return summary
