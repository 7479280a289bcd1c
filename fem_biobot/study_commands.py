"""The commands below `fem-biobot study`: questions asked of a design with many solutions, one a command.

Each gives a job, which runs after the arguments are parsed, as in `cli`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fem_biobot import study_jobs
from fem_biobot.options import Job, OptionError, group, ordering, plainly
from fem_biobot.orders import Order

study = group("study", "Questions that take many solutions of a design.")


@study.command("convergence")
@ordering()
def _convergence_command(
    order: Order,
    sizes: Annotated[
        str | None, typer.Option("--sizes", metavar="MM,MM,MM", help="Mesh sizes, three or more, such as 2,1.4,1 mm.")
    ] = None,
    element: Annotated[
        list[str] | None, typer.Option("--element", metavar="NAME", help="P1, P2 or P2-P1; repeat it to compare.")
    ] = None,
    error: Annotated[float, typer.Option("--error", metavar="SHARE", help="Relative error asked for.")] = 0.01,
    fillet: Annotated[
        str | None,
        typer.Option(
            "--fillet", metavar="MM", help="Fillet in which the peak is looked for, 0 for none; has a default."
        ),
    ] = None,
    refine: Annotated[
        int, typer.Option("--refine", metavar="N", help="Also N meshes refined for what the tip does, and the saving.")
    ] = 0,
) -> Job:
    """Mesh to stress: limit, error bar and order of every number, and which of them do not converge."""
    return partial(study_jobs.convergence, order, sizes, tuple(element or ("P2",)), error, fillet, refine)


@study.command("sweep")
@ordering(designs=False, resumes=True)
def _sweep_command(
    order: Order,
    file: Annotated[Path, typer.Argument(metavar="SWEEP.toml", help="Which keys take which values, and what is done.")],
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", metavar="ADDRESS", help="A Dask scheduler: tcp://10.0.0.1:8786.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", metavar="N", help="Processes on this machine; by default its processors.")
    ] = None,
) -> Job:
    """Many designs at once: solve, walk or cross-check each, on all cores or a cluster; finished cases stay."""
    if scheduler is not None and workers is not None:
        raise OptionError("--workers: found together with --scheduler, expected one of them (a cluster has its own)")
    if workers is not None and workers < 1:
        raise OptionError(f"--workers: found {workers}, expected 1 or more")
    return partial(study_jobs.sweep, replace(order, design=str(file)), scheduler, workers)


study.command("check")(
    ordering()(
        plainly(
            study_jobs.check,
            "Will it work? Closed forms in a second: bending, collapse, strains, oxygen, friction; a verdict a row.",
        )
    )
)


@study.command("search")
@ordering()
def _search_command(
    order: Order,
    vary: Annotated[
        list[str] | None,
        typer.Option("--vary", metavar="KEY=FROM..TO", help="skeleton.beam_thickness=0.4mm..1mm; one or two keys."),
    ] = None,
    target: Annotated[
        list[str] | None,
        typer.Option("--target", metavar="WHAT=VALUE", help="stroke=0.5mm, closing, sagitta, force=2mN, ..."),
    ] = None,
    model: Annotated[str, typer.Option("--model", metavar="MODEL", help="Who answers: rod or solid.")] = "rod",
    points: Annotated[int, typer.Option("--points", metavar="N", help="Values of each key tried at first.")] = 5,
) -> Job:
    """The inverse question: which value of a key gives a wanted stroke or force; ends with 1 if none does."""
    return partial(study_jobs.search, order, tuple(vary or ()), tuple(target or ()), model, points)
