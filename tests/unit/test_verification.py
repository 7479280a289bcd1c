"""The verification table: what a row is, which cases there are, and what `fem-biobot verify` prints and writes."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fem_biobot import ActiveStress, NeoHooke
from fem_biobot.errors import DesignError, FileError, MeshError, ModelError
from fem_biobot.verification import blocks, registry, report
from fem_biobot.verification.records import (
    Case,
    Claim,
    Finding,
    Row,
    extrapolated,
    observed_order,
    order,
    worst,
)
from fem_biobot.verification.registry import CASES, chosen, not_covered
from fem_biobot.verification.solid_states import S2, free_block
from fem_biobot.verification.verify import Count, verify
from tests.command import ROOT, Said, call, listing

CLAIM = Claim("length", 2.0, 0.25, "mm", "a ruler")


def case(compute: object, *claims: Claim, name: str = "S2") -> Case:
    """A case that finds what it is told."""
    return Case(name, "told", claims or (CLAIM,), compute)  # type: ignore[arg-type]


# ---------------------------------------------------------------- records


@pytest.mark.parametrize(
    ("ours", "verdict"),
    [(2.25, "pass"), (1.75, "pass"), (2.2500001, "fail"), (1.7, "fail"), (math.nan, "fail"), (math.inf, "fail")],
)
def test_a_row_passes_within_its_tolerance(ours: float, verdict: str) -> None:
    """The error is the distance from the reference, on either side; what is not a number fails.

    Catches: a signed error, a comparison that accepts what is not a number.
    """
    row = Row("S1", CLAIM, ours)
    assert row.verdict == verdict
    assert Row("S1", replace(CLAIM, tolerance=None), ours).verdict == "shown"


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"reference": math.nan}, "reference"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": math.inf}, "tolerance"),
        ({"tolerance": math.nan}, "tolerance"),
        ({"source": " "}, "source"),
        ({"unit": ""}, "unit"),
    ],
)
def test_a_claim_that_could_not_fail_or_says_nothing_is_refused(change: dict[str, object], word: str) -> None:
    """Catches: a tolerance that accepts anything, a row without its source."""
    with pytest.raises(ModelError, match=f"'length': {word}"):
        replace(CLAIM, **change)  # type: ignore[arg-type]


def test_a_failure_is_one_whatever_kind_of_number_the_reference_is() -> None:
    """A row whose reference is a number of numpy's fails by a plain False, which the command counts.

    Catches: numpy's False, which `is False` does not see.
    """
    row = Row("S1", replace(CLAIM, reference=np.float64(2.0)), 3.0)
    assert row.passed is False
    assert Row("S1", replace(CLAIM, reference=np.float64(2.0)), 2.0).passed is True


def test_a_case_finds_one_value_for_each_claim() -> None:
    """Claims are at least one and each is named once; a finding of another length is refused.

    Catches: values that slip against their claims, a row lost.
    """
    with pytest.raises(ModelError, match="each once"):
        case(None, CLAIM, CLAIM)
    with pytest.raises(ModelError, match="at least one"):
        Case("S2", "told", (), lambda: Finding(()))
    with pytest.raises(ModelError, match="found 2 values, expected 1"):
        case(None).rows(Finding.of([1.0, 2.0]))


def test_the_worst_value_is_the_farthest_and_never_hides_a_failure() -> None:
    """Catches: the largest instead of the farthest, a value that is not a number passed over."""
    assert worst([1.0, 2.0, 3.5, 4.0], 3.0) == 1.0
    assert math.isnan(worst([[1.0, math.nan], [2.0, 9.0]], 1.0))


def test_orders_and_limits_are_those_of_a_power() -> None:
    """Of ``3 + 2 h^p`` the order is p and the limit 3, by differences alone or from a known limit.

    Catches: order 2 assumed everywhere, coarse and fine exchanged.
    """
    for power in (1.0, 2.0, 3.0):
        values = [np.array([3.0 + 2.0 * h**power, -1.0]) for h in (0.4, 0.2, 0.1)]
        assert observed_order(*values) == pytest.approx(power, rel=1e-9)
        np.testing.assert_allclose(extrapolated(values[1], values[2], power), [3.0, -1.0], rtol=1e-12)
        assert order([0.4, 0.2, 0.1], [v[0] - 3.0 for v in values]) == pytest.approx(power, rel=1e-9)


def test_a_bot_without_its_committed_mesh_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches: None handed on to a solver."""
    monkeypatch.setattr(blocks, "committed_mesh", lambda design, size: None)
    with pytest.raises(MeshError, match="committed mesh"):
        blocks.committed_bot.__wrapped__(2.0)


# ---------------------------------------------------------------- registry


def test_every_case_stands_once_and_in_order() -> None:
    """All cases together with those not covered yet are the whole list, each once.

    Catches: a family left out of the table, two cases of one name.
    """
    assert len(set(registry.IDS)) == len(registry.IDS) == 15 + 9 + 8 + 3
    assert sorted([*CASES, *not_covered()], key=registry.IDS.index) == list(registry.IDS)
    assert sum(len(family.CASES) for family in registry._FAMILIES) == len(CASES)
    assert set(CASES) & set(not_covered()) == set()


def test_cases_are_chosen_by_name_in_the_order_of_the_table() -> None:
    """In either case of letters, each once; all where none is named.

    Catches: the order of the arguments, a case computed twice.
    """
    assert [c.id for c in chosen(["r2", "S1", "R2"])] == ["S1", "R2"]
    assert len(chosen([])) == len(CASES)


def test_an_unknown_case_is_told_from_one_that_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches: a name ignored, "not covered yet" said of a name that never was."""
    with pytest.raises(DesignError, match="found 'S99', expected one of S1"):
        chosen(["S99"])
    # another table, not this one less a case: put back, it would come last
    without = {name: case for name, case in CASES.items() if name != "S4"}
    monkeypatch.setattr(registry, "CASES", without)
    with pytest.raises(DesignError, match="S4: not covered yet"):
        chosen(["s4"])
    assert not_covered() == ("S4",)
    assert report.uncovered_line() == "not covered yet: S4"
    assert "\nNot covered yet: S4.\n" in report.markdown([])


# ---------------------------------------------------------------- verify


def test_a_case_that_breaks_off_fails_and_the_others_go_on() -> None:
    """Its rows have no number and fail, also those that are only shown count; with `raising` its error passes.

    Catches: a table that ends at the first failure, a case that vanishes from it.
    """

    def broken() -> Finding:
        raise ZeroDivisionError("by\nzero")

    cases = [case(broken, name="S2"), case(lambda: Finding.of([2.1]), name="S3")]
    first, second = verify(cases)
    assert first.failure == "ZeroDivisionError: by zero"
    assert [row.verdict for row in first.rows] == ["fail"]
    assert first.failed
    assert not second.failed
    assert Count.of([first, second]) == Count(1, 1, 0, 1)
    only_shown = case(broken, replace(CLAIM, tolerance=None))
    assert not Count.of(verify([only_shown])).good
    with pytest.raises(ZeroDivisionError):
        verify(cases, raising=True)


def test_an_interrupt_is_no_result() -> None:
    """Catches: Ctrl-C recorded as a failed case."""

    def stopped() -> Finding:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        verify([case(stopped)])


# ---------------------------------------------------------------- the command


@pytest.fixture
def whole(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> tuple[Path, Said]:
    """S2 and S3 by the command."""
    out = tmp_path / "below" / "table"
    return out, call(capsys, "verify", "s3", "S2", "--out", out)


def test_the_command_prints_and_writes_the_table(whole: tuple[Path, Said]) -> None:
    """Rows of both cases with the verdict and what is not covered; CSV with all digits, page, pictures, summary.

    Catches: a table that is printed and not written, digits cut off in the CSV, a picture of another case.
    """
    out, said = whole
    assert said.code == 0
    assert "0.8575651716" in said.out
    assert "FEBio test suite, ma20" in said.out
    assert "not covered yet" not in said.out
    assert "7 rows pass, 0 fail" in said.out
    assert "2 of 2, S3: 6 rows pass" in said.err
    assert set(listing(out)) == {
        "figures", "figures/S2.png", "figures/S3.png", "summary.json", "verification.csv", "verification.md",
    }  # fmt: skip
    rows = list(csv.DictReader((out / "verification.csv").open()))
    assert [row["case"] for row in rows] == ["S2"] + ["S3"] * 6
    assert abs(float(rows[0]["ours"]) - 0.8575651716) == pytest.approx(float(rows[0]["error"]), rel=1e-6)
    assert float(rows[0]["error"]) <= float(rows[0]["tolerance"])
    summary = json.loads((out / "summary.json").read_text())
    assert summary["complete"] is True
    assert summary["verification"] == {
        "rows_passed_1": 7, "rows_failed_1": 0, "rows_shown_1": 0, "cases_broken_off_1": 0,
    }  # fmt: skip
    page = (out / "verification.md").read_text()
    assert report.static_rows(page) == report.registered_rows([CASES["S2"], CASES["S3"]])
    assert "](figures/S3.png)" in page


def test_json_is_the_summary_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Standard output is one object, the same as on disk, in the default folder.

    Catches: the table on standard output too, a number that JSON does not know.
    """
    monkeypatch.chdir(tmp_path)
    said = call(capsys, "verify", "S2", "--json")
    assert said.code == 0
    assert json.loads(said.out) == json.loads((tmp_path / "runs/verification/summary.json").read_text())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(("S99",), ("S99", "S1,")), (("S1", "walk"), ("walk",)), (("--cases",), ("--cases",))],
)
def test_an_unknown_case_is_one_line_with_code_2(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    words: tuple[str, ...],
) -> None:
    """Nothing is computed or written.

    Catches: a traceback, an empty table called a success.
    """
    monkeypatch.chdir(tmp_path)
    said = call(capsys, "verify", *arguments)
    assert (said.code, said.out) == (2, "")
    assert len(said.err.splitlines()) == 1
    assert [word for word in words if word not in said.err] == []
    assert listing(tmp_path) == {}


def test_a_wrong_answer_fails_the_row_and_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cube of S2 solved with nominal instead of second Piola tension: one row fails by what the two differ by.

    Catches: a command that says what is wrong and calls it a success; the row of another case failed with it.
    """

    def wrong() -> Finding:
        muscle = ActiveStress(0.5, blocks.unit(0.3, -0.5, 0.8), "nominal", transverse=1.0)
        (state,) = free_block(NeoHooke(1.0, 0.3), muscle, [1.0], "P2")
        return Finding.of([worst(state.stretch, S2.claims[0].reference)])

    monkeypatch.setitem(registry.CASES, "S2", replace(S2, compute=wrong))
    out = tmp_path / "table"
    said = call(capsys, "verify", "S2", "S3", "--out", out)
    assert said.code == 1
    assert "6 rows pass, 1 fail" in said.out
    assert said.complaint.startswith("S2: every stretch")
    assert "expected 0.8575651716 within 5e-11" in said.complaint
    (row,) = json.loads((out / "summary.json").read_text())["cases"][0]["rows"]
    assert row["verdict"] == "fail"
    # mu (s - 1/s) + 3 lmbda ln(s)/s + T0 = 0
    law, s = NeoHooke(1.0, 0.3), row["ours"]
    assert law.mu * (s - 1.0 / s) + 3.0 * law.lmbda * np.log(s) / s + 0.5 == pytest.approx(0.0, abs=1e-9)
    assert row["error"] > 1e-3
    quiet = call(capsys, "verify", "S2", "--out", out, "--quiet")
    assert (quiet.code, quiet.out) == (1, f"{out}\n")
    assert len(quiet.err.splitlines()) == 1


def test_a_broken_case_fails_the_command_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its rows have no number in table, CSV and JSON; no traceback unless asked for.

    Catches: NaN in the JSON, a traceback, exit code 0.
    """

    def broken() -> Finding:
        raise ValueError("no mesh")

    monkeypatch.setitem(registry.CASES, "S2", replace(S2, compute=broken))
    said = call(capsys, "verify", "S2", "--json", "--out", tmp_path / "a")
    assert said.code == 1
    found = json.loads(said.out)["cases"][0]
    assert (found["failure"], found["rows"][0]["ours"]) == ("ValueError: no mesh", None)
    assert said.complaint == "S2: broke off: ValueError: no mesh"
    assert "Traceback" not in said.err
    debug = call(capsys, "verify", "S2", "--debug", "--out", tmp_path / "b")
    assert debug.code == 1
    assert "Traceback" in debug.err


def test_an_interrupted_table_is_whole_and_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cases done before are on disk in whole files, marked incomplete; a later table takes their place.

    Catches: a summary that calls itself complete, pictures of an earlier table left beside a new one.
    """

    def stopped() -> Finding:
        raise KeyboardInterrupt

    out = tmp_path / "table"
    with monkeypatch.context() as patch:
        patch.setitem(registry.CASES, "S3", replace(CASES["S3"], compute=stopped))
        said = call(capsys, "verify", "S2", "S3", "--out", out)
    assert said.code == 130
    assert "1 of 2" in said.complaint
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["complete"], [c["case"] for c in summary["cases"]]) == (False, ["S2"])
    assert (out / "figures" / "S2.png").stat().st_size > 0
    assert call(capsys, "verify", "S3", "--out", out, "--quiet").code == 0
    assert "figures/S2.png" not in listing(out)


@pytest.mark.parametrize("file", ["notes.txt", "summary.json"])
def test_a_folder_of_something_else_is_left_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], file: str
) -> None:
    """Files that no verification wrote are refused before anything is computed.

    Catches: a result of a design written over.
    """
    (tmp_path / file).write_text('{"design_digest": "1"}')
    before = listing(tmp_path)
    said = call(capsys, "verify", "S2", "--out", tmp_path)
    assert said.code == 2
    assert str(tmp_path) in said.complaint
    assert listing(tmp_path) == before


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    """Catches: an operating system's error let through."""
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="file"):
        report.clear(tmp_path / "file" / "below")


# ---------------------------------------------------------------- the committed page


def test_the_committed_page_is_the_tables() -> None:
    """VERIFICATION.md has the registry's rows: quantities, references, tolerances and sources; README links it.

    Renewed by studies/make_verification.py.
    Catches: a page that has drifted from the cases.
    """
    page = (ROOT / "studies" / "VERIFICATION.md").read_text(encoding="utf-8")
    assert report.static_rows(page) == report.registered_rows()
    assert "](studies/VERIFICATION.md)" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert not_covered() == ()
    assert "ot covered yet" not in page
    assert "| fail |" not in page


def test_a_page_with_another_digit_is_told_apart() -> None:
    """Catches: a comparison of pages that looks at names only; a bar in a cell that shifts its columns."""
    told = case(lambda: Finding.of([2.1]), replace(CLAIM, source="|a| = 2"))
    page = report.markdown(verify([told]))
    (row,) = report.static_rows(page)
    assert row == report.registered_rows([told])[0] | {"source": "\\|a\\| = 2"}
    assert row["reference"] == "2"
    changed = report.static_rows(page.replace("| 2 |", "| 2.1 |", 1))
    assert changed != report.registered_rows([told])
