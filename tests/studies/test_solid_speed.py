"""The studies of speed and growth at smoke size: counts and agreement hold, and what they expect can fail."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from tests.studies.loading import load_study as study
from tests.studies.loading import refuses
from tests.studies.loading import smoke_of as smoke


@pytest.mark.parametrize("name", ["solid_speed", "growth"])
def test_it_shows_what_it_found(name: str, tmp_path: Path) -> None:
    """What is expected at smoke size holds; tables have rows, and tables and a picture are written.

    Catches: a column that a row lacks, a picture of nothing, another end of FElupe's path, iterations that grow.
    """
    module, found = study(name), smoke(name)
    module.expect(found, "smoke")
    shown = module.tables(found)
    assert all(table.rows and all(len(row) == len(table.header) for row in table.rows) for table in shown)
    module.write(found, tmp_path / name)
    written = {path.suffix: path.stat().st_size for path in (tmp_path / name).iterdir()}
    assert set(written) == {".csv", ".png"}
    assert written[".png"] > 10_000


def test_the_speed_study_refuses_what_it_should() -> None:
    """Its expectations fail on a factorisation too many, an open state, another end, a kernel faster than the machine,
    and time that no part takes.

    Catches: a limit that is never compared.
    """
    module = study("solid_speed")
    for table, change, word in (
        ("paths", {"factorisations_1": 31}, "31 factorisations"),
        ("outputs", {"residual_1": 2e-9}, "residual"),
        ("roof", {"share_1": 1.6}, "machine's limit"),
        ("parts", {"part": "rest", "of_1_share_1": 0.25}, "unnamed parts"),
    ):
        found = copy.deepcopy(smoke("solid_speed"))
        getattr(found, table)[0].update(change)
        refuses(lambda found=found: module.expect(found, "smoke"), word)
    found = copy.deepcopy(smoke("solid_speed"))
    found.contenders.append({"contender": "other", "apart_mm": 1e-4})
    refuses(lambda: module.expect(found, "smoke"), "elsewhere")
    found = copy.deepcopy(smoke("solid_speed"))
    found.paths[0]["solves_1"] = 35.5
    refuses(lambda: module.expect(found, "full"), "linear solves")


def test_the_growth_study_refuses_what_it_should() -> None:
    """Its expectations fail on an open state, on two ways that disagree, and on iterations that grow.

    Catches: a limit that is never compared.
    """
    module = study("growth")
    for place, change, word in (
        (0, {"residual_1": 2e-8}, "residual"),
        (0, {"tip_closing_mm": 0.3}, "differ"),
        (2, {"cg_of_one_1": 100}, "iterations grow"),
    ):
        found = copy.deepcopy(smoke("growth"))
        found.rows[place].update(change)
        refuses(lambda found=found: module.expect(found, "smoke"), word)


def test_a_power_is_fitted() -> None:
    """Times that grow with the power 1.3 are told to do so.

    Catches: logarithms of one side only.
    """
    module = study("growth")
    rows = [
        {"way": "iterative", "unknowns_1": n, "setup_s": 1e-6 * n, "solve_s": 1e-7 * n**1.3, "peak_GiB": 0.2 + 1e-6 * n}
        for n in (20_000, 150_000, 1_000_000)
    ]
    (found,) = module._exponents(module.Study(rows))
    assert found["solve_exponent_1"] == pytest.approx(1.3, abs=1e-9)
    assert found["memory_exponent_1"] == pytest.approx(1.0, abs=1e-6)


def test_felupes_muscle_is_ours() -> None:
    """The nominal active stress written for FElupe gives the stress and, by differences, the tangent that it should.

    Catches: slots exchanged in the tangent, the stretch left out, a tension that is not nominal.
    """
    felupe = pytest.importorskip("felupe")
    module = study("solid_speed")
    draw = np.random.default_rng(3)
    a0 = draw.normal(size=(3, 2))
    a0 /= np.linalg.norm(a0, axis=0)
    law = module.ContractingMuscle(felupe, 3.4, 50.0, a0)
    law.tension = 7.0
    F = np.eye(3)[:, :, None, None] + 0.2 * draw.normal(size=(3, 3, 1, 2))
    G = draw.normal(size=F.shape)
    P, _ = law.gradient([F, None])
    law.tension = 0.0
    active = P - law.gradient([F, None])[0]
    law.tension = 7.0
    a = np.einsum("ikqe,ke->iqe", F, a0)
    for e in range(2):
        expected = 7.0 * np.outer(a[:, 0, e] / np.linalg.norm(a[:, 0, e]), a0[:, e])
        np.testing.assert_allclose(active[:, :, 0, e], expected, rtol=0.0, atol=1e-12)
    h = 1e-5
    difference = (law.gradient([F + h * G, None])[0] - law.gradient([F - h * G, None])[0]) / (2.0 * h)
    (A4,) = law.hessian([F, None])
    np.testing.assert_allclose(np.einsum("ikjlqe,jlqe->ikqe", A4, G), difference, rtol=0.0, atol=1e-6)
