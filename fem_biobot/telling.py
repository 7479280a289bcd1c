"""Where the results of jobs go and what is said of them: folders, standard output, JSON, how work that fails ends."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fem_biobot.errors import FileError, SolveError

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.orders import Order
    from fem_biobot.study.reporter import Reporter
    from fem_biobot.tables import Table


def worked(order: Order, folder: Path, work: Callable[[Reporter], dict[str, Any]]) -> dict[str, Any]:
    """Summary of a job that is told of while it runs; its end says where to find what was reached."""
    from fem_biobot.progress import reporting

    try:
        with standard_output_free(order.json), reporting(order.quiet) as reporter:
            summary = work(reporter)
            # those of a result that was there already have been told to nobody yet
            for note in summary["notes"]:
                reporter.note(note)
            return summary
    except SolveError as failure:
        raise SolveError(f"{failure}; what was reached is in {folder}", failure.best) from failure
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{folder}: files are whole, the same command goes on from there") from None


def show(
    order: Order,
    summary: Mapping[str, Any],
    folder: Path,
    words: Callable[[], tuple[Sequence[Table], Sequence[str]]],
) -> None:
    """A result on standard output: as JSON, as the folder's path, or as tables and where to look."""
    if order.json:
        print_json(summary)
        return
    if order.quiet:
        say(str(folder))
        return

    from fem_biobot.progress import show_tables
    from fem_biobot.results import where_to_look

    tables, lines = words()
    show_tables(tables)
    say("", *lines, *where_to_look(folder))


def result_folder(design: Design, out: Path | None) -> Path:
    """Folder of the result, refused at once where it cannot be made or written; nothing is made yet."""
    return usable_folder(Path("runs") / safe_name(design.name) if out is None else out)


def usable_folder(folder: Path) -> Path:
    """The folder, refused where it cannot be made or written; nothing is made yet."""
    if folder.exists() and not folder.is_dir():
        raise FileError(f"{folder}: found a file, expected a folder for the result")
    above = folder.absolute()
    place = next(parent for parent in (above, *above.parents) if parent.exists())
    if not place.is_dir():
        raise FileError(f"{folder}: cannot be made: {place} is a file, expected a folder")
    if not os.access(place, os.W_OK | os.X_OK):
        raise FileError(f"{folder}: cannot be written: no permission in {place}, expected a folder of your own")
    return folder


def safe_name(name: str) -> str:
    """A design's name as the name of a file."""
    return re.sub(r"[^\w.-]+", "_", name).strip("._")[:100] or "unnamed"


@contextmanager
def standard_output_free(needed: bool) -> Iterator[None]:
    """Whatever the work prints goes to standard error where standard output is for JSON alone."""
    if not needed:
        yield
        return
    with redirect_stdout(sys.stderr):
        yield


def print_json(value: Any) -> None:
    """JSON in plain ASCII, so that no terminal's encoding can spoil it."""
    say(json.dumps(value, indent=2, allow_nan=False, default=_plain))


def _plain(value: object) -> object:
    tolist = getattr(value, "tolist", None)
    if tolist is None:
        raise TypeError(f"no JSON form for {type(value).__name__}")
    return tolist()


def say(*lines: str) -> None:
    sys.stdout.write("".join(f"{line}\n" for line in lines))
