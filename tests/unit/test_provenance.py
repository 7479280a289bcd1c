"""Every report ends with the design's sources and the status of the verification."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fem_biobot.config import load_design, presets, to_toml
from fem_biobot.study import provenance
from fem_biobot.study.provenance import STATUS, code_digest, design_table, status_of, verification_table
from fem_biobot.verification.registry import CASES


def sources(name: str, *changes: str) -> dict[str, tuple[str, str]]:
    table = design_table(load_design(name, changes))
    return {str(key): (str(value), str(source)) for key, value, source in table.rows}


def test_a_preset_names_its_sources_and_what_was_changed() -> None:
    """Catches: a source kept for a value that is no longer the preset's, a default told as measured."""
    found = sources("junction_bot", "muscle.gamma=0.9")
    assert found["skeleton.material.young"][0] == "319.4 kPa"
    assert found["skeleton.material.young"][1].startswith("facts/elastica_walker.csv: E_skeleton")
    assert found["muscle.gamma"] == ("0.9", "given, not the preset's")
    assert found["muscle.convention"] == (
        "nominal",
        "assumption: force per reference area, as in Eq. 1 and 2 of the paper",
    )
    assert found["muscle.transverse"][1] == "default of the program"


@pytest.mark.parametrize("preset", presets())
def test_every_key_of_a_design_has_a_source(preset: str) -> None:
    """Catches: keys whose values hold a sign that cuts the line, sections mixed up."""
    found = sources(preset)
    written = [line for line in to_toml(load_design(preset)).splitlines() if " = " in line]
    assert len(found) == len(written) - 2  # without name and description
    assert all(source for _, source in found.values())


def test_a_design_of_ones_own_says_what_was_given(tmp_path: Path) -> None:
    """Catches: remarks of the preset that it started from, for values that happen to be in it."""
    file = tmp_path / "mine.toml"
    file.write_text('base = "junction_bot"\nname = "mine"\n[muscle]\nactivation.formula = "where(x > 0, 1, 0) # x"\n')
    table = {row[0]: row[1:] for row in design_table(load_design(file)).rows}
    assert table["skeleton.beam_length"] == ("14 mm", "given")
    assert table["muscle.activation.formula"] == ("where(x > 0, 1, 0) # x", "given")
    assert table["muscle.fibres"] == ("piecewise", "default of the program")


def test_the_status_counts_verdicts_and_knows_its_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Catches: rows that are shown counted as passed, the code of yesterday told as that of today."""
    rows = [{"verdict": v} for v in ("pass", "fail", "pass", "shown", "pass")]
    status = status_of([{"case": "S1", "title": "stretch", "rows": rows}], {"numpy": "2"})
    assert status["cases"] == [{"case": "S1", "title": "stretch", "passed": 3, "failed": 1, "shown": 1}]
    file = tmp_path / "verified.json"
    monkeypatch.setattr(provenance, "STATUS", file)
    file.write_text(json.dumps(status))
    assert verification_table().title == "Verification: 3 known answers met, 1 not, by this very code"
    file.write_text(json.dumps({**status, "code": "0" * 16}))
    assert "earlier code" in verification_table().title
    assert verification_table().rows == (("S1", "stretch", 3, 1, 1),)


def test_what_travels_with_the_package_is_a_verification_of_its_cases() -> None:
    """A case that was added since stands there once `studies/make_verification.py` has run again.

    Catches: a status of a handful of cases, of cases that are no longer there, in another order than the table's.
    """
    status = json.loads(STATUS.read_text(encoding="utf-8"))
    held = [case["case"] for case in status["cases"]]
    assert held == [case for case in CASES if case in held]
    assert len(held) > 0.9 * len(CASES)
    assert all(case["passed"] + case["failed"] > 0 for case in status["cases"] if case["case"] != "B1")
    assert len(code_digest()) == 16
