"""What a running job shows: lines without control characters in a pipe, a live display on a terminal."""

from __future__ import annotations

import io
import re
import time
from collections.abc import Callable

import pytest

from fem_biobot import progress
from fem_biobot.progress import Count, LineReporter, LiveReporter, reporting, show_tables, span
from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.tables import Table, cell, plain


class Clock:
    """A clock that moves when told."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """The clock of the progress module."""
    found = Clock()
    monkeypatch.setattr(progress, "time", found)
    return found


class Terminal(io.StringIO):
    """A stream that calls itself a terminal."""

    def isatty(self) -> bool:
        return True


def job(reporter: Reporter, clock: Clock) -> None:
    """A job of two stages: 3 s of mesh, four parts of which two are done in 2 s each."""
    reporter.stage("mesh", 1)
    clock.now += 3.0
    reporter.advance("812 elements")
    clock.now += 1.0
    reporter.stage("solve", 4)
    for k in range(2):
        clock.now += 2.0
        reporter.iteration(3, 1.3e-9)
        reporter.advance(f"{k} kPa")
    reporter.note("first [mm]\nand on")
    reporter.note("first [mm]\nand on")


def test_lines_say_stage_part_rate_and_time_left(clock: Clock) -> None:
    """One line for each part; with two of four done in 2 s each, 4 s are left.

    Catches: time left of the parts done, the time between stages counted as work, iterations as lines.
    """
    out = io.StringIO()
    with LineReporter(out, patience=1e6) as reporter:
        job(reporter, clock)
        reporter.stage("report")
        clock.now += 75.0
    assert out.getvalue().splitlines() == [
        "mesh: 812 elements, 3.0 s",
        "solve: 1 of 4, 0 kPa, 2.0 s each, about 6.0 s left",
        "solve: 2 of 4, 1 kPa, 2.0 s each, about 4.0 s left",
        "note: first [mm] and on",
        "solve: done, 4.0 s",
        "report: done, 1 min 15 s",
    ]


def test_a_stage_that_fails_leaves_no_line(clock: Clock) -> None:
    """Bad input found in a stage is told in one line, the error's own.

    Catches: "done" printed for a stage that raised, a stage announced at once.
    """
    out = io.StringIO()

    def fail() -> None:
        with LineReporter(out, patience=1e6) as reporter:
            reporter.stage("mesh", 1)
            raise ValueError("bad")

    with pytest.raises(ValueError, match="bad"):
        fail()
    assert out.getvalue() == ""


def test_a_stage_that_lasts_is_announced() -> None:
    """Somebody who reads along learns what takes so long, before it is over.

    Catches: a first compilation that looks stuck, an announcement after the stage's end.
    """
    out = io.StringIO()
    with LineReporter(out, patience=0.02) as reporter:
        reporter.stage("compiling", 3)
        deadline = time.monotonic() + 5.0
        while not out.getvalue() and time.monotonic() < deadline:
            time.sleep(0.005)
        assert out.getvalue() == "compiling (3 parts) ...\n"
    assert out.getvalue().splitlines()[1].startswith("compiling: done, ")


def test_a_reader_that_went_away_does_not_stop_the_job(clock: Clock) -> None:
    """Progress on a closed or full stream is lost, the job goes on.

    Catches: a run of an hour that dies since nobody reads its progress.
    """

    class Full(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(28, "No space left on device")

    closed = io.StringIO()
    closed.close()
    for stream in (Full(), closed):
        with LineReporter(stream, patience=1e6) as reporter:
            job(reporter, clock)


def test_the_live_display_shows_iteration_rate_and_time_left(clock: Clock) -> None:
    """On a terminal the same facts and the Newton iteration under way stand behind a bar.

    Catches: an iteration that is never shown, one that outlives its part, brackets of a note eaten as markup.
    """
    out = Terminal()
    with LiveReporter(out) as reporter:
        job(reporter, clock)
        reporter.iteration(2, 4.4e-5)
        stage = reporter._stage
        assert stage is not None
        clock.now += 1.0
        assert stage.words() == (
            "solve 2 of 4, 5.0 s, 2.0 s each, about 3.0 s left | 1 kPa | iteration 2, residual 4.4e-05"
        )
        reporter.advance("2 kPa")
        assert "iteration" not in stage.words()
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", out.getvalue())
    assert text.count("note: first [mm] and on") == 1
    assert "mesh, 3.0 s" in text
    # the cursor is shown again
    assert out.getvalue().rindex("\x1b[?25h") > out.getvalue().rindex("\x1b[?25l")


def test_the_live_display_gives_the_cursor_back_after_a_failure(clock: Clock) -> None:
    """An exception ends the display too; its stage is called stopped.

    Catches: a terminal without cursor after Ctrl-C, a failed stage shown as finished.
    """
    out = Terminal()

    def fail() -> None:
        with LiveReporter(out) as reporter:
            job(reporter, clock)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert out.getvalue().rindex("\x1b[?25h") > out.getvalue().rindex("\x1b[?25l")
    assert "stopped" in out.getvalue()


@pytest.mark.parametrize(
    ("stream", "quiet", "kind"),
    [
        (Terminal, True, Silent),
        (io.StringIO, True, Silent),
        (Terminal, False, LiveReporter),
        (io.StringIO, False, LineReporter),
    ],
)
def test_the_reporter_suits_the_stream(
    monkeypatch: pytest.MonkeyPatch, stream: Callable[[], io.StringIO], quiet: bool, kind: type
) -> None:
    """Live on a terminal, lines in a pipe, silence when asked for.

    Catches: control characters in a log, --quiet without effect.
    """
    monkeypatch.setenv("TERM", "xterm")
    out = stream()
    with reporting(quiet, out) as reporter:
        assert isinstance(reporter, kind)
        reporter.note("hello")
    assert ("hello" in out.getvalue()) is not quiet


def test_a_dumb_terminal_gets_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal that cannot move its cursor is treated as a pipe.

    Catches: escape sequences on a terminal that prints them.
    """
    monkeypatch.setenv("TERM", "dumb")
    out = Terminal()
    with reporting(False, out) as reporter:
        assert isinstance(reporter, LineReporter)
        reporter.note("hello")
    assert "\x1b" not in out.getvalue()


def test_parts_may_outnumber_what_was_announced(clock: Clock) -> None:
    """More parts than told raise the total, and no time is left then.

    Catches: "5 of 4", negative time left.
    """
    count = Count(1)
    for _ in range(3):
        clock.now += 1.0
        count.one_more()
    assert count.words() == "3 of 3"
    assert count.left == 0.0
    assert Count(None).left is None
    clock.now += 50.0
    assert count.elapsed == 3.0


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (-1.0, "0.0 s"),
        (0.04, "0.0 s"),
        (9.94, "9.9 s"),
        (9.96, "10 s"),
        (59.6, "1 min 00 s"),
        (200.0, "3 min 20 s"),
        (7500.0, "2 h 05 min"),
    ],
)
def test_durations_are_written_as_people_say_them(seconds: float, text: str) -> None:
    """Seconds, minutes and hours, rounded once.

    Catches: "60 s", "9.96 s" beside "10 s", minutes above sixty.
    """
    assert span(seconds) == text


# ---------------------------------------------------------------- tables


TABLE = Table("Numbers", ("name", "value [mm]"), (("a", 1.23456), ("b [x]", None), ("long name", 12)))


def test_plain_tables_are_aligned() -> None:
    """Text left, numbers right with four digits, a dash for nothing.

    Catches: numbers left-aligned because one is missing, digits cut from whole numbers.
    """
    assert plain(TABLE).splitlines() == [
        "Numbers",
        "  name       value [mm]",
        "  a               1.235",
        "  b [x]               -",
        "  long name          12",
    ]
    assert cell(123456) == "123456"
    assert (cell(True), cell(False)) == ("yes", "no")


def test_long_texts_are_wrapped_in_the_last_column() -> None:
    """A width keeps lines short without breaking the alignment.

    Catches: a wrapped line that begins below the first column.
    """
    table = Table("", ("part", "found"), (("x", "one two three four five six seven eight"),))
    assert plain(table, 30).splitlines() == [
        "part  found",
        "x     one two three four five",
        "      six seven eight",
    ]


def test_tables_on_a_terminal_hold_the_same_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawn for a terminal, written plainly elsewhere; brackets are text in both.

    Catches: "[mm]" swallowed as markup, control characters in a pipe.
    """
    monkeypatch.setenv("TERM", "xterm")
    drawn, piped = Terminal(), io.StringIO()
    show_tables([TABLE], drawn)
    show_tables([TABLE], piped)
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", drawn.getvalue())
    for word in ("Numbers", "value [mm]", "1.235", "b [x]"):
        assert word in text
    assert piped.getvalue() == plain(TABLE) + "\n"


def test_a_closed_stream_is_no_terminal() -> None:
    """Asked after it was closed, a stream is simply none.

    Catches: ValueError from a daemon without standard error.
    """
    closed = io.StringIO()
    closed.close()
    assert progress.is_terminal(closed) is False
