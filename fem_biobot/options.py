"""Options that several commands share, as typer reads them; `cli` and the groups of commands below it use them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from fem_biobot.errors import BiobotError
from fem_biobot.orders import Order

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
Command = Callable[..., Job]

# what an `Order` is made of besides the design, as the help lists it, and what each is where it is not given
_SHARED: dict[str, tuple[Any, Any]] = {
    "out": (Out, None),
    "size": (Size, None),
    "mesh": (MeshFile, None),
    "rename": (Rename, None),
    "sets": (Sets, None),
    "quiet": (Quiet, False),
    "as_json": (AsJson, False),
    "force": (Force, False),
    "resume": (Resume, False),
}
_OF_MESHES = ("size", "mesh", "rename")


class OptionError(BiobotError):
    """Options that do not go together."""

    exit_code = 2


def ordering(
    *, design: str | None = None, designs: bool = True, meshes: bool = False, resumes: bool = False
) -> Callable[[Command], Command]:
    """Give a command the options that commands share: it gets an `Order` first, then its own as it declares them.

    Parameters
    ----------
    design
        Design where none is named; a name is asked for if None.
    designs
        Whether the command is about one design, with `--set`.
    meshes
        Whether it takes `--size`, `--mesh` and `--rename`.
    resumes
        Whether it takes `--resume`.
    """

    def decorate(command: Command) -> Command:
        own = [
            each.replace(kind=inspect.Parameter.KEYWORD_ONLY)
            for each in list(inspect.signature(command, eval_str=True).parameters.values())[1:]
        ]
        left_out = {
            *(() if designs else ("sets",)), *(() if meshes else _OF_MESHES), *(() if resumes else ("resume",))
        }  # fmt: skip
        first = [_parameter("design", DesignName, inspect.Parameter.empty if design is None else design)]
        shared = [_parameter(name, *what) for name, what in _SHARED.items() if name not in left_out]
        parameters = [*(first if designs else []), *own, *shared, _parameter("debug", Debug, False)]

        def called(**given: Any) -> Job:
            mine = {each.name: given[each.name] for each in own}
            return command(_order(given), **mine)

        called.__name__, called.__doc__ = getattr(command, "__name__", "command"), command.__doc__
        called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]  # what typer reads
        called.__annotations__ = {each.name: each.annotation for each in parameters}
        return called

    return decorate


def plainly(job: Callable[[Order], int], text: str) -> Command:
    """A command without options of its own, for `ordering`: the job of its order, and what its help says."""

    def command(order: Order) -> Job:
        return partial(job, order)

    command.__doc__ = text
    return command


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


def _order(given: dict[str, Any]) -> Order:
    """The order that shared options make; options that do not go together are refused."""
    value = {name: given.get(name, default) for name, (_, default) in _SHARED.items()}
    check_mesh(value["mesh"], value["rename"], value["size"])
    if value["force"] and value["resume"]:
        raise OptionError("--resume: found together with --force, expected one of them")
    return Order(
        given.get("design", ""),
        value["out"],
        value["size"],
        value["mesh"],
        value["rename"] or (),
        value["sets"] or (),
        value["quiet"],
        value["as_json"],
        value["force"],
        value["resume"],
    )


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
