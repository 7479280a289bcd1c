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
from fem_biobot.jobs import Order
from fem_biobot.options import (
    AsJson,
    Debug,
    DesignName,
    Force,
    Job,
    MeshFile,
    Out,
    Quiet,
    Sets,
    Size,
    check_mesh,
    group,
)

muscle = group("muscle", "The muscle as tissue: what drives it, and what it is made of.")


def _examining(job: Callable[[Order], int], text: str) -> Callable[..., Job]:
    """A command that asks for a design alone."""

    def command(
        design: DesignName,
        out: Out = None,
        sets: Sets = None,
        quiet: Quiet = False,
        as_json: AsJson = False,
        force: Force = False,
        debug: Debug = False,
    ) -> Job:
        return partial(job, Order(design, out, sets=sets or (), quiet=quiet, json=as_json, force=force))

    command.__doc__ = text
    return command


def _meshing(job: Callable[[Order], int], text: str) -> Callable[..., Job]:
    """A command that asks for a design and its mesh."""

    def command(
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
        check_mesh(mesh, None, size)
        return partial(job, Order(design, out, size, mesh, (), sets or (), quiet, as_json, force))

    command.__doc__ = text
    return command


muscle.command("drive")(
    _examining(
        muscle_jobs.drive,
        "Drive of a design over time: the waveform, its peak, mean and ripple, as table, CSV and plot.",
    )
)
muscle.command("tissue")(
    _examining(
        muscle_jobs.tissue,
        "Section and tension of the tissue, by seeding width and day, beside what the paper measured.",
    )
)
muscle.command("oxygen")(
    _meshing(
        muscle_jobs.oxygen,
        "Oxygen in the tissue: the viable share gamma and where it is lost, and how thick tissue may be.",
    )
)
muscle.command("fibres")(
    _meshing(
        muscle_jobs.fibres,
        "Fibre directions on the mesh: glyphs and streamlines, the field as VTK and CSV, how smoothly it turns.",
    )
)


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
    order = Order(design, out, sets=sets or (), quiet=quiet, json=as_json, force=force)
    return partial(muscle_jobs.orientation, order, file)
