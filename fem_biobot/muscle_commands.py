"""The commands below `fem-biobot muscle`: the muscle as tissue, one subject a command.

Each gives a job, which runs after the arguments are parsed, as in `cli`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fem_biobot import muscle_jobs
from fem_biobot.errors import DesignError
from fem_biobot.jobs import Order
from fem_biobot.options import AsJson, Debug, DesignName, Force, MeshFile, Out, Quiet, Sets, Size

Job = Callable[[], int]

muscle = typer.Typer(
    name="muscle",
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="The muscle as tissue: what drives it, and what it is made of.",
)


@muscle.callback(invoke_without_command=True)
def _group(context: typer.Context) -> None:
    if context.invoked_subcommand is None:
        print(context.get_help())  # noqa: T201


@muscle.command("drive")
def _drive_command(
    design: DesignName,
    out: Out = None,
    sets: Sets = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
    force: Force = False,
    debug: Debug = False,
) -> Job:
    """Drive of a design over time: the waveform, its peak, mean and ripple, as table, CSV and plot."""
    return partial(muscle_jobs.drive, Order(design, out, None, None, (), sets or (), quiet, as_json, force))


@muscle.command("tissue")
def _tissue_command(
    design: DesignName,
    out: Out = None,
    sets: Sets = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
    force: Force = False,
    debug: Debug = False,
) -> Job:
    """Section and tension of the tissue, by seeding width and day, beside what the paper measured."""
    return partial(muscle_jobs.tissue, Order(design, out, None, None, (), sets or (), quiet, as_json, force))


@muscle.command("oxygen")
def _oxygen_command(
    design: DesignName,
    out: Out = None,
    size: Size = None,
    mesh: MeshFile = None,
    sets: Sets = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
    force: Force = False,
    debug: Debug = False,
) -> Job:
    """Oxygen in the tissue: the viable share gamma and where it is lost, and how thick tissue may be."""
    if size is not None and mesh is not None:
        raise DesignError("--size: found together with --mesh, expected one of them (a mesh file has its own size)")
    return partial(muscle_jobs.oxygen, Order(design, out, size, mesh, (), sets or (), quiet, as_json, force))


@muscle.command("fibres")
def _fibres_command(
    design: DesignName,
    out: Out = None,
    size: Size = None,
    mesh: MeshFile = None,
    sets: Sets = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
    force: Force = False,
    debug: Debug = False,
) -> Job:
    """Fibre directions on the mesh: glyphs and streamlines, the field as VTK and CSV, how smoothly it turns."""
    if size is not None and mesh is not None:
        raise DesignError("--size: found together with --mesh, expected one of them (a mesh file has its own size)")
    return partial(muscle_jobs.fibres, Order(design, out, size, mesh, (), sets or (), quiet, as_json, force))


@muscle.command("orientation")
def _orientation_command(
    design: DesignName,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Table of directions (Directionality, or two columns), or a picture.")
    ],
    out: Out = None,
    sets: Sets = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
    force: Force = False,
    debug: Debug = False,
) -> Job:
    """Mean, spread and moments of fibre directions in a table or a picture, as a design takes them."""
    order = Order(design, out, None, None, (), sets or (), quiet, as_json, force)
    return partial(muscle_jobs.orientation, order, file)
