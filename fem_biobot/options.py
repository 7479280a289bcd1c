"""Options that several commands share, as typer reads them; `cli` and the groups of commands below it use them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from fem_biobot.errors import BiobotError

DesignName = Annotated[str, typer.Argument(metavar="DESIGN", help="Name of a preset, or path of a TOML file.")]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="DIR", help="Folder of the result; by default runs/<design>.")
]
Size = Annotated[
    str | None, typer.Option("--size", metavar="MM", help='Mesh size, such as "0.8 mm"; a bare number is in mm.')
]
MeshFile = Annotated[
    Path | None, typer.Option("--mesh", metavar="FILE.msh", help="A tagged mesh to use instead of generating one.")
]
Rename = Annotated[
    list[str] | None,
    typer.Option("--rename", metavar="NAME=REGION", help="Region of a volume of the mesh file, such as gel=skeleton."),
]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar='KEY="VALUE UNIT"', help='Change a key of the design: muscle.theta="80 deg".'),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors and the path of the result.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the summary alone, as JSON; all else on standard error.")]
Force = Annotated[bool, typer.Option("--force", help="Redo a result that is there, also another design's.")]
Resume = Annotated[bool, typer.Option("--resume", help="Insist on going on from an unfinished result.")]
NoWalk = Annotated[bool, typer.Option("--no-walk", help="Leave out the walking.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")]

Job = Callable[[], int]


class OptionError(BiobotError):
    """Options that do not go together."""

    exit_code = 2


def check_mesh(mesh: Path | None, rename: Sequence[str] | None, size: str | None) -> None:
    """Refuse a size or regions that have no mesh to go with."""
    if rename and mesh is None:
        raise OptionError("--rename: found without --mesh, expected the mesh file whose volumes it names")
    if size is not None and mesh is not None:
        raise OptionError("--size: found together with --mesh, expected one of them (a mesh file has its own size)")


def group(name: str, text: str) -> typer.Typer:
    """Commands below a word of their own; the word alone prints their help."""
    found = typer.Typer(
        name=name, add_completion=False, context_settings={"help_option_names": ["-h", "--help"]}, help=text
    )

    @found.callback(invoke_without_command=True)
    def _alone(context: typer.Context) -> None:
        if context.invoked_subcommand is None:
            print(context.get_help())  # noqa: T201

    return found
