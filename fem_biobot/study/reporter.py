"""What long work tells its surroundings while it goes on; the command line shows it, scripts may ignore it."""

from __future__ import annotations

from typing import Protocol


class Reporter(Protocol):
    """Listener of a running job. Calls come from the job's own thread."""

    def stage(self, name: str, total: int | None = None) -> None:
        """A named stage begins, with the number of its parts where it is known."""
        ...

    def advance(self, done: str = "") -> None:
        """One part of the stage is done; says which."""
        ...

    def iteration(self, number: int, residual: float) -> None:
        """A Newton iteration of the part under way, with its relative residual."""
        ...

    def note(self, text: str) -> None:
        """Something the user must know, such as what is used instead of what."""
        ...


class Silent:
    """A reporter that says nothing."""

    def stage(self, name: str, total: int | None = None) -> None:
        """Ignored."""

    def advance(self, done: str = "") -> None:
        """Ignored."""

    def iteration(self, number: int, residual: float) -> None:
        """Ignored."""

    def note(self, text: str) -> None:
        """Ignored."""


class Keeping:
    """A reporter that passes on what it is told and keeps the notes, for those who read the result later."""

    def __init__(self, to: Reporter) -> None:
        self._to = to
        self.notes: list[str] = []

    def stage(self, name: str, total: int | None = None) -> None:
        """Passed on."""
        self._to.stage(name, total)

    def advance(self, done: str = "") -> None:
        """Passed on."""
        self._to.advance(done)

    def iteration(self, number: int, residual: float) -> None:
        """Passed on."""
        self._to.iteration(number, residual)

    def note(self, text: str) -> None:
        """Passed on, and kept once."""
        if text not in self.notes:
            self.notes.append(text)
        self._to.note(text)
