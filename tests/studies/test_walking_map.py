"""The map of walking at smoke size: it runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from fem_biobot.ensembles import Nudge
from fem_biobot.rod.records import Muscle
from fem_biobot.rod.reduce import reduce
from tests.studies.loading import load_study, refuses, smoke_of


def study() -> ModuleType:
    """The study as a module."""
    return load_study("walking_map")


def smoke() -> Any:
    """What it finds at smoke size; not to be changed."""
    return smoke_of("walking_map")


def test_equal_pillars_and_frictionless_ground_give_no_step() -> None:
    """What the study expects: no step without friction or asymmetry, hardly one without inertia, else a direction.

    Catches: a ground with a direction of its own, friction left on a frictionless ground, forward and reverse swapped.
    """
    module, found = study(), smoke()
    module.expect(found)
    names = {row["mechanisms"] for row in found.mechanisms}
    assert {module.SMOOTH, module.SLOW_SMOOTH, module.EVEN_SMOOTH, module.FRICTIONLESS} < names


def test_the_study_shows_and_writes_what_it_found(tmp_path: Path) -> None:
    """Tables with rows as long as their header, four CSV files and a picture.

    Catches: a column that a row lacks, a picture of nothing.
    """
    module, found = study(), smoke()
    shown = module.tables(found)
    assert all(table.rows and all(len(row) == len(table.header) for row in table.rows) for table in shown)
    module.write(found, tmp_path / "below")
    written = {path.name: path.stat().st_size for path in (tmp_path / "below").iterdir()}
    assert set(written) == {"map.csv", "unequal.csv", "mechanisms.csv", "steps.csv", "walking_map.png"}
    assert written["walking_map.png"] > 10_000


def test_the_study_refuses_steps_out_of_nothing() -> None:
    """Its expectations fail on a step without friction, asymmetry or inertia, on a walk the wrong way, on two kinds of
    steps that do not close alike.

    Catches: a limit that is never compared.
    """
    module = study()
    for name, change, word in (
        (module.FRICTIONLESS, {"step_mm": 1e-5}, "centre of mass"),
        (module.EVEN_SMOOTH, {"step_mm": 1e-2}, "equal pillars"),
        (module.SLOW_SMOOTH, {"step_mm": 1e-2}, "without inertia"),
        (module.SMOOTH, {"direction": "toward short"}, "walks toward short"),
    ):
        found = copy.deepcopy(smoke())
        next(row for row in found.mechanisms if row["mechanisms"] == name).update(change)
        refuses(lambda found=found: module.expect(found), word)
    found = copy.deepcopy(smoke())
    found.unequal[0]["direction"] = "toward short"
    refuses(lambda: module.expect(found), "against the less resisted")
    found = copy.deepcopy(smoke())
    del found.mechanisms[0]["step_mm"]
    found.mechanisms[0]["remark"] = "it fell"
    refuses(lambda: module.expect(found), "it fell")
    for number, change, word in ((0, {"direction": "toward long"}, "stick in air"), (-1, {"stroke_mm": 9.0}, "as far")):
        found = copy.deepcopy(smoke())
        found.steps[number].update(change)
        refuses(lambda found=found: module.expect(found), word)


def test_rows_that_are_there_are_not_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that stops leaves its rows; the next one takes them, makes the others, and does over one cut off half-way.

    Catches: rows that wait for the end, rows of another machine, nudge, step or code taken for these.
    """
    module, file, made = study(), tmp_path / "rows.jsonl", list[str]()

    def numbers(case: Any) -> dict[str, Any]:
        if len(made) == 3:
            raise KeyboardInterrupt
        made.append(case.names["mechanisms"])
        return dict(case.names) | {"step_mm": 0.1 * len(made)}

    monkeypatch.setattr(module, "numbers", numbers)
    cases = module.mechanism_cases("smoke")[:5]
    with pytest.raises(KeyboardInterrupt):
        module.Rows(file).of(cases)
    lines = file.read_text().splitlines(keepends=True)
    assert len(lines) == 3
    file.write_text("".join(lines[:2]) + lines[2][:-9])
    made.clear()
    found = module.Rows(file).of([*cases[:2], cases[4], cases[3]])
    assert made == [cases[4].names["mechanisms"], cases[3].names["mechanisms"]]
    assert [row["step_mm"] for row in found] == [0.1, 0.2, 0.1, 0.2]
    whole = reduce(module.design_of(module.PUBLISHED), beam_elements=module.ELEMENTS["smoke"])
    stiff = module.design_of(module.PUBLISHED, "air", "skeleton.material.young = 320 kPa")
    machines = (
        whole,
        module.weightless_inertia(whole, 0.5),
        reduce(stiff, beam_elements=module.ELEMENTS["smoke"]),
        reduce(module.design_of(module.PUBLISHED, "submerged"), beam_elements=module.ELEMENTS["smoke"]),
        module.point_feet(whole),
        module.rebuilt(whole, damping_time=2.0 * whole.damping_time),
        module.rebuilt(
            whole, members=[replace(m, passive=0.5 * m.passive) for m in whole.members if isinstance(m, Muscle)]
        ),
    )
    assert {machine.n_nodes for machine in machines} == {whole.n_nodes}
    case = replace(cases[0], machine=whole)
    changes = [{"machine": machine} for machine in machines]
    changes += [{"nudge": Nudge(velocity=0.0)}, {"step": 1e-4}, {"error": 1e-6}, {"amplitude": 0.5}]
    keys = {replace(case, **change).key() for change in changes}
    again = reduce(module.design_of(module.PUBLISHED), beam_elements=module.ELEMENTS["smoke"])
    assert {replace(case, machine=again).key(), replace(case, nudge=Nudge()).key()} < keys | {""}
    for name in ("code_digest", "own_digest"):
        monkeypatch.setattr(module, name, lambda: "another")
        keys.add(case.key())
    assert len(keys) == len(changes) + 2
    monkeypatch.undo()
    other = tmp_path / "walking_map.py"
    other.write_text(Path(str(module.__file__)).read_text() + "\n")
    own = module.own_digest()
    monkeypatch.setattr(module, "__file__", str(other))
    assert module.own_digest() != own


def test_kinds_of_strokes_are_told_where_they_differ() -> None:
    """Three strokes that come again and again are three kinds; strokes that differ by little are one, and not told.

    Catches: a mean over strokes of which none is like it.
    """
    module = study()
    strokes = np.tile([0.122, 0.097, -0.035], 4)
    found = module.kinds(strokes, 0.4)
    assert sorted(mean for mean, _, _ in found) == pytest.approx([-0.035, 0.097, 0.122])
    assert [share for _, _, share in found] == pytest.approx([1 / 3] * 3)
    assert "-0.035 +- 0.000 (33%)" in module.shown_kinds(found)
    alike = module.kinds(0.1 + np.linspace(0.0, 1e-4, 6), 0.4)
    assert alike[0][::2] == pytest.approx((0.10005, 1.0))
    assert module.shown_kinds(alike) is None


def test_lighter_machines_are_driven_in_shorter_steps() -> None:
    """A tenth of the mass takes a quarter of the step, since time goes with its root; all are held to one error.

    Catches: a step that rings too fast for its parts, an error that is let grow where it is hard to hold.
    """
    module = study()
    cases = module.mechanism_cases("full")
    steps = {case.names["inertia_1"]: case.step for case in cases}
    assert steps == pytest.approx({1.0: 5e-4, 0.3: 2.5e-4, 0.1: 1.25e-4, 0.03: 5e-4 / 6, 0.01: 5e-5})
    assert {case.error for case in [*cases, *module.unequal_cases("full")]} == {2e-7}


def test_mechanisms_are_switched_off_one_at_a_time() -> None:
    """Less inertia keeps weight, stiffness and feet; point feet keep mass and width, and lose their length.

    Catches: gravity scaled the wrong way, a foot of one point that could fall sideways, buoyancy that grows.
    """
    module = study()
    whole = reduce(module.design_of(module.PUBLISHED, "submerged"), beam_elements=4)
    light, pointed = module.weightless_inertia(whole, 0.03), module.point_feet(whole)
    a, b = whole.assembly, light.assembly
    np.testing.assert_allclose(b.inertia.mass, 0.03 * a.inertia.mass, rtol=1e-12, atol=0.0)
    scale = float(np.abs(a.inertia.J).max())
    np.testing.assert_allclose(b.inertia.J, 0.03 * a.inertia.J, rtol=1e-12, atol=1e-12 * scale)
    np.testing.assert_allclose(b.inertia.mass[:, None] * b.gravity, a.inertia.mass[:, None] * a.gravity, rtol=1e-12)
    np.testing.assert_allclose(b.loads.force, a.loads.force, rtol=1e-12, atol=0.0)
    assert np.abs(a.loads.force).max() > 0.0
    np.testing.assert_array_equal(b.elements.stiffness, a.elements.stiffness)
    for before, after in zip(whole.contacts, pointed.contacts, strict=True):
        old, new = np.array(before.points), np.array(after.points)
        assert len(new) == 2
        assert np.ptp(new[:, 0]) == 0.0
        assert new[0, 0] == pytest.approx(old[:, 0].mean(), rel=1e-15)
        assert np.ptp(new[:, 1]) == np.ptp(old[:, 1])
    assert pointed.mass == whole.mass
