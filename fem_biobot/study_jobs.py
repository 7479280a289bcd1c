"""The jobs behind `fem-biobot study`; as in `jobs`, what is slow to import is imported by the job that needs it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fem_biobot.design_checks import refuse_unbonded, refuse_without_solid
from fem_biobot.errors import DesignError
from fem_biobot.orders import Order, length, mesh_size
from fem_biobot.telling import result_folder, safe_name, show, usable_folder, worked

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.study.finding import Finding
    from fem_biobot.study.reporter import Reporter


def convergence(
    order: Order, sizes: str | None, elements: tuple[str, ...], error: float, fillet: str | None, rounds: int
) -> int:
    """One state of a design on several meshes."""
    from fem_biobot.config import load_design

    design = load_design(order.design, order.sets)
    refuse_without_solid(design, "mesh")
    refuse_unbonded(design, "compare meshes and elements")
    numbers = None
    if sizes is not None:
        numbers = tuple(mesh_size(part) or 0.0 for part in sizes.replace("mm", "").split(",") if part.strip())

    from fem_biobot.study.convergence import ConvergencePlan, convergence_finding

    radius = None if fillet is None else length(fillet, "--fillet")
    plan = ConvergencePlan(numbers, elements, error, radius, rounds)
    folder = result_folder(design, order.out or Path("runs") / f"{safe_name(design.name)}_convergence")

    from fem_biobot.solid.compiling import compile_kernels
    from fem_biobot.study.finding import examine, tables_of

    asked = ", ".join(f"{size:g}" for size in plan.falling(design))
    peak = "" if radius is None else f"; fillet {radius:g} mm"
    meshes = f"{asked} mm; {', '.join(elements)}; {error:g}{peak}" + (f"; {rounds} refined" if rounds else "")

    def job(reporter: Reporter) -> dict[str, Any]:
        def work(design: Design, figures: Path) -> Finding:
            for element in elements:
                compile_kernels(reporter, element)
            return convergence_finding(design, plan, figures, reporter)

        return examine(
            design, folder, "convergence", work, mesh=meshes, kind="study", force=order.force, reporter=reporter
        )

    summary = worked(order, folder, job)
    show(order, summary, folder, lambda: (tables_of(summary), summary["remarks"]))
    return 0


def sweep(order: Order, scheduler: str | None, workers: int | None) -> int:
    """Many designs, on this machine or on a cluster."""
    from fem_biobot.study.sweep_file import Task, read_sweep

    plan = read_sweep(Path(order.design))
    if plan.task is not Task.walk:
        refuse_without_solid(plan.base, plan.task.value)
    folder = usable_folder(order.out or Path("runs") / safe_name(plan.name))

    from fem_biobot.study.finding import tables_of
    from fem_biobot.study.sweep import sweep as carry_out
    from fem_biobot.study.sweep_runner import LocalRunner, Runner

    def runner(place: Path) -> Runner:
        if scheduler is None:
            return LocalRunner(workers)
        from fem_biobot.study.sweep_cluster import ClusterRunner

        return ClusterRunner(scheduler, place)

    def work(reporter: Reporter) -> dict[str, Any]:
        return carry_out(plan, folder, runner=runner, force=order.force, resume=order.resume, reporter=reporter)

    summary = worked(order, folder, work)
    show(order, summary, folder, lambda: (tables_of(summary), summary["remarks"]))
    return 0


def check(order: Order) -> int:
    """A design judged by closed forms."""
    from fem_biobot.config import load_design
    from fem_biobot.study.design_check import check_finding, refuse_without_feet

    design = load_design(order.design, order.sets)
    refuse_without_feet(design)
    folder = result_folder(design, order.out or Path("runs") / f"{safe_name(design.name)}_check")

    from fem_biobot.study.finding import examine, tables_of

    def job(reporter: Reporter) -> dict[str, Any]:
        def work(design: Design, figures: Path) -> Finding:
            return check_finding(design)

        return examine(design, folder, "design_check", work, kind="study", force=order.force, reporter=reporter)

    summary = worked(order, folder, job)
    show(order, summary, folder, lambda: (tables_of(summary), summary["remarks"]))
    return 0


def search(order: Order, vary: tuple[str, ...], targets: tuple[str, ...], model: str, points: int) -> int:
    """Which values of one or two keys give a wanted stroke or force; 1 if none does."""
    from fem_biobot.config import load_design
    from fem_biobot.study.search import SearchPlan, parse_range, parse_target
    from fem_biobot.study.search_models import Model, refuse_without_stroke

    design = load_design(order.design, order.sets)
    refuse_without_stroke(design)
    if model not in list(Model):
        raise DesignError(f"--model: found {model}, expected one of: {', '.join(Model)}")
    ranges, wanted = tuple(map(parse_range, vary)), tuple(map(parse_target, targets))
    plan = SearchPlan(ranges, wanted, Model(model), points)
    folder = result_folder(design, order.out or Path("runs") / f"{safe_name(design.name)}_search")

    from fem_biobot.study.finding import examine, tables_of
    from fem_biobot.study.search_finding import search_finding

    def job(reporter: Reporter) -> dict[str, Any]:
        def work(design: Design, figures: Path) -> Finding:
            if plan.model is Model.solid:
                from fem_biobot.solid.compiling import compile_kernels

                compile_kernels(reporter, design.mesh.element)
            return search_finding(design, plan, figures, reporter)

        return examine(
            design, folder, "search", work, mesh=plan.text, kind="study", force=order.force, reporter=reporter
        )

    summary = worked(order, folder, job)
    show(order, summary, folder, lambda: (tables_of(summary), summary["remarks"]))
    if not summary["search"]["reached"]:
        print(summary["remarks"][0], file=sys.stderr)  # noqa: T201
        return 1
    return 0
