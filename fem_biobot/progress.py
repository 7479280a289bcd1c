"""What a running job shows: a live display on a terminal, short plain lines elsewhere, nothing when told so.

Everything here goes to standard error, so that standard output holds results alone. Also draws tables, since it is the
one module beside `cli` that knows rich.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import IO

from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TaskID
from rich.table import Table as DrawnTable
from rich.text import Text

from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.tables import Table, stacked

# a stage shorter than this is told of only when it is over [s]
PATIENCE = 1.5


def is_terminal(stream: IO[str]) -> bool:
    """Whether a stream is a terminal that can move its cursor."""
    try:
        return stream.isatty() and os.environ.get("TERM", "") != "dumb"
    except ValueError:  # closed
        return False


@contextmanager
def reporting(quiet: bool = False, stream: IO[str] | None = None) -> Iterator[Reporter]:
    """The reporter that suits the stream (standard error by default), shown while the block runs."""
    out = sys.stderr if stream is None else stream
    if quiet:
        yield Silent()
    elif is_terminal(out):
        with LiveReporter(out) as live:
            yield live
    else:
        with LineReporter(out) as lines:
            yield lines


def span(seconds: float) -> str:
    """A duration in words: ``0.4 s``, ``12 s``, ``3 min 20 s``, ``2 h 05 min``."""
    if seconds < 9.95:
        return f"{max(seconds, 0.0):.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"


class Count:
    """Parts of a stage: how many are done, how long they took, how long the rest will take."""

    def __init__(self, total: int | None) -> None:
        self.total, self.done = total, 0
        self.begun = self.last = time.monotonic()

    def one_more(self) -> None:
        """One part is done now."""
        self.done += 1
        self.last = time.monotonic()
        if self.total is not None:
            # a job may do more parts than it announced, never fewer than it did
            self.total = max(self.total, self.done)

    @property
    def elapsed(self) -> float:
        """Since the stage began, up to its last part where all are done [s]."""
        return (self.last if self.over else time.monotonic()) - self.begun

    @property
    def over(self) -> bool:
        """Whether all parts are done; not known for a stage without a number of parts."""
        return self.total is not None and self.done >= self.total

    @property
    def each(self) -> float | None:
        """Mean time of a part [s]; None before the first is done."""
        return (self.last - self.begun) / self.done if self.done else None

    @property
    def left(self) -> float | None:
        """Time that the remaining parts will take at this rate [s]; None where that cannot be known."""
        if self.total is None or self.each is None:
            return None
        return max(self.each * (self.total - self.done) - (time.monotonic() - self.last), 0.0)

    def words(self) -> str:
        """For a line: ``3 of 9`` or ``3``."""
        return str(self.done) if self.total is None else f"{self.done} of {self.total}"


class LineReporter:
    """Plain lines without control characters: one when a stage is over or lasts, one for each of its parts.

    Parameters
    ----------
    stream
        Where to write; that it is closed or full does not stop the job.
    patience
        How long a stage may last before it is announced [s].
    """

    def __init__(self, stream: IO[str], patience: float = PATIENCE) -> None:
        self._stream, self._patience = stream, patience
        self._lock = threading.Lock()
        self._name, self._count = "", Count(None)
        self._timer: threading.Timer | None = None
        self._told: set[str] = set()

    def __enter__(self) -> LineReporter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        self._end(finished=kind is None)

    def stage(self, name: str, total: int | None = None) -> None:
        """Begin a stage."""
        self._end(finished=True)
        self._name, self._count = name, Count(total)
        parts = "" if total in (None, 1) else f" ({total} parts)"
        self._timer = threading.Timer(self._patience, self._line, [f"{name}{parts} ..."])
        self._timer.daemon = True
        self._timer.start()

    def advance(self, done: str = "") -> None:
        """Tell of a part that is done, with rate and time left."""
        self._still()
        self._count.one_more()
        count = self._count
        if count.total == 1:
            texts = [done or "done", span(count.elapsed)]
        else:
            texts = [count.words(), done, f"{span(count.each or 0.0)} each"]
        if count.left is not None and not count.over:
            texts.append(f"about {span(count.left)} left")
        self._line(f"{self._name}: " + ", ".join(text for text in texts if text))

    def iteration(self, number: int, residual: float) -> None:
        """Not shown: one line for each iteration is too many."""

    def note(self, text: str) -> None:
        """Tell a note, once."""
        if text not in self._told:
            self._told.add(text)
            self._line(f"note: {' '.join(text.split())}")

    def _still(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _end(self, finished: bool) -> None:
        self._still()
        if self._name and finished and not self._count.over:
            self._line(f"{self._name}: done, {span(self._count.elapsed)}")
        self._name = ""

    def _line(self, text: str) -> None:
        # progress is no reason to lose a result: a reader that went away, a full disk, a stream closed meanwhile
        with self._lock, suppress(OSError, ValueError):
            self._stream.write(text + "\n")
            self._stream.flush()


class LiveReporter:
    """Live display: every stage one line with its bar, iteration and residual, elapsed time, rate and time left."""

    def __init__(self, stream: IO[str]) -> None:
        self._console = Console(file=stream, highlight=False)
        columns = SpinnerColumn(finished_text="+"), BarColumn(bar_width=16), _Words()
        self._progress = Progress(*columns, console=self._console, refresh_per_second=4)
        self._stage: _Stage | None = None
        self._task = TaskID(0)
        self._told: set[str] = set()

    def __enter__(self) -> LiveReporter:
        self._progress.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        self._end("" if kind is None else "stopped")
        self._progress.stop()

    def stage(self, name: str, total: int | None = None) -> None:
        """Begin a stage on a line of its own."""
        self._end()
        self._stage = _Stage(name, Count(total))
        self._task = self._progress.add_task(name, total=total, stage=self._stage)

    def advance(self, done: str = "") -> None:
        """Move the bar on."""
        if self._stage is None:
            return
        self._stage.count.one_more()
        self._stage.part, self._stage.iteration = done, ""
        if self._stage.count.total is not None:
            # rich takes a full bar for a finished task, which is for `_end` to say
            total = max(self._stage.count.total, self._stage.count.done + 0.01)
            self._progress.update(self._task, completed=self._stage.count.done, total=total)

    def iteration(self, number: int, residual: float) -> None:
        """Show the iteration behind the part that was done last."""
        if self._stage is not None:
            self._stage.iteration = f"iteration {number}, residual {residual:.1e}"

    def note(self, text: str) -> None:
        """Print a note above the display, once."""
        if text not in self._told:
            self._told.add(text)
            self._console.print(f"note: {' '.join(text.split())}", markup=False, soft_wrap=True, style="yellow")

    def _end(self, why: str = "") -> None:
        if self._stage is None:
            return
        self._stage.part, self._stage.iteration = why, ""
        self._stage.took = self._stage.count.elapsed
        if not why:
            self._progress.update(self._task, total=1, completed=1)
        self._progress.stop_task(self._task)
        self._stage = None


@dataclass
class _Stage:
    """What the display says of a stage."""

    name: str
    count: Count
    part: str = ""
    iteration: str = ""
    took: float | None = None

    def words(self) -> str:
        """The line behind the bar."""
        count = self.count
        counted = count.done > 0 if count.total is None else count.total != 1
        texts = [f"{self.name} {count.words()}" if counted else self.name]
        texts.append(span(count.elapsed if self.took is None else self.took))
        if count.each is not None and count.total != 1:
            texts.append(f"{span(count.each)} each")
        if self.took is None and not count.over and count.left is not None:
            texts.append(f"about {span(count.left)} left")
        return ", ".join(texts) + "".join(f" | {text}" for text in (self.part, self.iteration) if text)


class _Words(ProgressColumn):
    """Column with the words of the stage, made anew at every refresh."""

    max_refresh = None

    def render(self, task: Task) -> Text:
        """The words."""
        return Text(task.fields["stage"].words(), overflow="ellipsis", no_wrap=True)


def show_tables(tables: Sequence[Table], stream: IO[str] | None = None) -> None:
    """Print tables to a stream (standard output by default): drawn on a terminal, aligned text elsewhere."""
    out = sys.stdout if stream is None else stream
    if not is_terminal(out):
        out.write(stacked(tables) + "\n")
        return
    console = Console(file=out, highlight=False)
    for table in tables:
        drawn = DrawnTable(title=Text(table.title, style="bold") if table.title else None, title_justify="left")
        drawn.box, drawn.show_header = box.SIMPLE, any(table.header)
        for name, right in zip(table.header, table.numeric(), strict=True):
            drawn.add_column(Text(name), justify="right" if right else "left", overflow="fold")
        for row in table.cells():
            drawn.add_row(*(Text(text) for text in row))
        console.print(drawn)
