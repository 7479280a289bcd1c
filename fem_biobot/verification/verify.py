"""Compute cases one after the other, and say of each row whether it passes.

A case that breaks off fails with all its rows; the others are computed all the same.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from fem_biobot.study.reporter import Reporter, Silent
from fem_biobot.study.versions import versions
from fem_biobot.verification.records import Case, Finding, Graph, Row


@dataclass(frozen=True)
class Outcome:
    """A case that was tried.

    Attributes
    ----------
    rows
        One for each claim; ours is not a number where the case broke off.
    seconds
        What it took [s].
    graph
        Its picture, if it has one.
    failure
        Why it broke off; empty if it did not.
    """

    case: Case
    rows: tuple[Row, ...]
    seconds: float
    graph: Graph | None = None
    failure: str = ""

    @property
    def failed(self) -> bool:
        """Whether a row failed, or the case broke off."""
        return bool(self.failure) or any(row.passed is False for row in self.rows)

    @property
    def words(self) -> str:
        """For progress: ``S1: 8 rows pass``."""
        if self.failure:
            return f"{self.case.id}: broke off"
        judged = [row.passed for row in self.rows if row.passed is not None]
        bad = judged.count(False)
        return f"{self.case.id}: " + (f"{bad} of {len(judged)} rows fail" if bad else f"{len(judged)} rows pass")


def verify(
    cases: Sequence[Case],
    *,
    reporter: Reporter | None = None,
    on_outcome: Callable[[Outcome], None] | None = None,
    raising: bool = False,
) -> list[Outcome]:
    """Outcomes of cases, in order.

    Parameters
    ----------
    cases
        See `registry.chosen`.
    reporter
        Told of each case that is done.
    on_outcome
        Given each outcome as soon as it is there.
    raising
        Let the error of a case that breaks off pass, to look for its cause.
    """
    reporter = reporter or Silent()
    reporter.stage("verify", len(cases))
    outcomes = []
    for case in cases:
        outcomes.append(_tried(case, raising))
        if on_outcome is not None:
            on_outcome(outcomes[-1])
        reporter.advance(outcomes[-1].words)
    return outcomes


def _tried(case: Case, raising: bool) -> Outcome:
    begun = time.perf_counter()
    try:
        finding = case.compute()
        rows, failure = case.rows(finding), ""
    except Exception as error:
        if raising:
            raise
        # whatever it is, the answer is not there, and the other cases have theirs
        failure = " ".join(f"{type(error).__name__}: {error}".split())
        finding = Finding((math.nan,) * len(case.claims))
        rows = case.rows(finding)
    return Outcome(case, rows, time.perf_counter() - begun, finding.graph, failure)


@dataclass(frozen=True)
class Count:
    """Rows by verdict, and cases that broke off."""

    passed: int
    failed: int
    shown: int
    broken: int

    @classmethod
    def of(cls, outcomes: Iterable[Outcome]) -> Count:
        """Of all rows of outcomes."""
        tried = list(outcomes)
        verdicts = [row.verdict for outcome in tried for row in outcome.rows]
        return cls(
            verdicts.count("pass"),
            verdicts.count("fail"),
            verdicts.count("shown"),
            sum(bool(outcome.failure) for outcome in tried),
        )

    @property
    def good(self) -> bool:
        """Whether nothing failed."""
        return not self.failed and not self.broken

    def words(self) -> str:
        """The verdict in one line."""
        shown = f", {self.shown} shown" if self.shown else ""
        broken = f", {self.broken} cases broke off" if self.broken else ""
        return f"{self.passed} rows pass, {self.failed} fail{shown}{broken}"


def summary(outcomes: Sequence[Outcome], not_covered: Sequence[str], *, complete: bool) -> dict[str, Any]:
    """The object of ``summary.json``: every row, what is not covered, versions and times."""
    count = Count.of(outcomes)
    return {
        "complete": complete,
        "verification": {
            "rows_passed_1": count.passed,
            "rows_failed_1": count.failed,
            "rows_shown_1": count.shown,
            "cases_broken_off_1": count.broken,
        },
        "cases": [
            {
                "case": outcome.case.id,
                "title": outcome.case.title,
                "failure": outcome.failure,
                "time_s": outcome.seconds,
                "rows": [row_numbers(row) for row in outcome.rows],
            }
            for outcome in outcomes
        ],
        "not_covered": list(not_covered),
        "versions": versions(),
        "timings_s": {"total": sum(outcome.seconds for outcome in outcomes)},
    }


def row_numbers(row: Row) -> dict[str, Any]:
    """A row as plain values; None for what is not a number."""

    def number(value: float) -> float | None:
        return value if math.isfinite(value) else None

    return {
        "quantity": row.claim.quantity,
        "reference": row.claim.reference,
        "ours": number(row.ours),
        "error": number(row.error),
        "tolerance": row.claim.tolerance,
        "unit": row.claim.unit,
        "verdict": row.verdict,
        "source": row.claim.source,
    }
