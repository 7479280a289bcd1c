"""The commands below `fem-biobot muscle`: the muscle as tissue, one subject a command.

Each gives a job, which runs after the arguments are parsed, as in `cli`.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from fem_biobot import muscle_jobs
from fem_biobot.options import Job, group, ordering, plainly
from fem_biobot.orders import Order

muscle = group("muscle", "The muscle as tissue: what drives it, and what it is made of.")


muscle.command("drive")(
    ordering()(
        plainly(
            muscle_jobs.drive,
            "Drive of a design over time: the waveform, its peak, mean and ripple, as table, CSV and plot.",
        )
    )
)
muscle.command("velocity")(
    ordering()(
        plainly(
            muscle_jobs.velocity,
            "Force over the rate of the fibre's stretch (muscle.force_velocity), its power, as table, CSV and plot.",
        )
    )
)
muscle.command("tissue")(
    ordering()(
        plainly(
            muscle_jobs.tissue,
            "Section and tension of the tissue, by seeding width and day, beside what the paper measured.",
        )
    )
)
muscle.command("oxygen")(
    ordering(meshes=True)(
        plainly(
            muscle_jobs.oxygen,
            "Oxygen in the tissue: the viable share gamma and where it is lost, and how thick tissue may be.",
        )
    )
)
muscle.command("fibres")(
    ordering(meshes=True)(
        plainly(
            muscle_jobs.fibres,
            "Fibre directions on the mesh: glyphs and streamlines, the field as VTK and CSV, how smoothly it turns.",
        )
    )
)


@muscle.command("orientation")
@ordering()
def _orientation_command(
    order: Order,
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Table of directions (Directionality, or two columns), or a picture.")
    ],
) -> Job:
    """Mean, spread and moments of fibre directions in a table or a picture, as a design takes them."""
    return partial(muscle_jobs.orientation, order, file)
