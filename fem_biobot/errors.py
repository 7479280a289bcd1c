"""Every way the program refuses or fails: one hierarchy, each class with the exit code the command line gives it.

A message names the key or the file, what was found and what was expected, and fits on one line.
"""

from __future__ import annotations

from typing import Any


class BiobotError(Exception):
    """Base of all errors that the package raises on purpose."""

    exit_code = 1


class DesignError(BiobotError):
    """The design is wrong: a key, a unit, a range, or parts that do not fit together."""

    exit_code = 2


class MeshError(BiobotError):
    """The mesh is wrong: a missing region, an inverted or orphan part, a file that is not a tetrahedral mesh."""

    exit_code = 2


class ModelError(BiobotError):
    """A model was put together wrongly: an unknown surface, a support that holds nothing, a law that does not fit."""

    exit_code = 2


class FileError(BiobotError):
    """A file or folder cannot be read, or must not be written over."""

    exit_code = 2


class DiskError(FileError):
    """Writing failed half-way (a full disk); what was whole before is still whole."""

    exit_code = 3


class SolveError(BiobotError):
    """No equilibrium was found.

    Attributes
    ----------
    best
        What was reached before the failure (a solution with the converged states), or None.
    reason, reached, wanted
        Why the last try failed, and the steps between which it lies, where a path of steps failed.
    why, element, failed_at
        The reason as a word, the element that it happened in (or None), and the step tried last.
    iterate
        The iterate with the least residual of that step, as a state that is no equilibrium, or None.
    buckling
        Critical factors and mode of a body that lost its stability, or None.
    """

    exit_code = 3

    def __init__(
        self,
        message: str,
        best: Any = None,
        *,
        reason: str = "",
        why: str = "",
        element: int | None = None,
        reached: Any = None,
        failed_at: Any = None,
        wanted: Any = None,
        buckling: Any = None,
        iterate: Any = None,
    ) -> None:
        super().__init__(message)
        self.best = best
        self.reason, self.reached, self.wanted = reason, reached, wanted
        self.why, self.element, self.failed_at = why, element, failed_at
        self.iterate = iterate
        self.buckling = buckling

    def retold(self, message: str) -> SolveError:
        """The same failure in other words."""
        return SolveError(
            message,
            self.best,
            reason=self.reason,
            why=self.why,
            element=self.element,
            reached=self.reached,
            failed_at=self.failed_at,
            wanted=self.wanted,
            buckling=self.buckling,
            iterate=self.iterate,
        )
