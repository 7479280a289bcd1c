"""The studies at smoke size: each runs, what it expects holds, and what it expects can fail."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest

from tests.studies.loading import load_study as study
from tests.studies.loading import refuses
from tests.studies.loading import smoke_of as smoke


@pytest.mark.parametrize("name", ["tension_path", "kernel_benchmark", "mesh_error"])
def test_a_study_shows_what_it_found(name: str, tmp_path: Path) -> None:
    """Every study prints tables with rows and writes tables and a picture.

    Catches: a column that a row lacks, a picture of nothing.
    """
    module, found = study(name), smoke(name)
    shown = module.tables(found) if name != "kernel_benchmark" else [module.table(benchmark) for benchmark in found]
    assert all(table.rows and all(len(row) == len(table.header) for row in table.rows) for table in shown)
    module.write(found, tmp_path / "below" / name)
    written = {path.suffix: path.stat().st_size for path in (tmp_path / "below" / name).iterdir()}
    assert set(written) == {".csv", ".png"}
    assert written[".png"] > 10_000


def test_the_tension_path_is_as_short_as_expected() -> None:
    """0 to 14 kPa with nine outputs, half-way at once and back: few factorisations, one end state, nothing left.

    Catches: a tangent without its geometric part (more factorisations), a predictor that extrapolates u alone, plain
    Newton from the last state that cannot be run.
    """
    module, found = study("tension_path"), smoke("tension_path")
    module.expect(found)
    assert [row["path"] for row in found.paths if row["method"] == module.PLAIN_FROM_LAST] == ["7 kPa at once"]
    assert {row["path"] for row in found.paths} == {"nine outputs", "7 kPa at once", "back to 0 at once"}


def test_the_path_study_refuses_a_long_or_open_path() -> None:
    """Its expectations fail on one factorisation too many, on something left after unloading, on two ends of one path.

    Catches: a limit that is never compared.
    """
    module = study("tension_path")
    for path, change, word in (
        ("nine outputs", {"factorisations_1": 31}, "31 factorisations"),
        ("back to 0 at once", {"remaining_1": 2e-8}, "remains"),
        ("7 kPa at once", {"fibre_stretch_1": 0.59}, "two paths end"),
        ("nine outputs", {"failure": "no equilibrium"}, "no equilibrium"),
    ):
        found = copy.deepcopy(smoke("tension_path"))
        next(row for row in found.paths if row["path"] == path).update(change)
        refuses(lambda found=found: module.expect(found), word)


def test_plain_newton_uses_the_stress_of_the_present_iterate() -> None:
    """Within `plain_newton` the tangent does not see the stress handed to it; outside it does again.

    Catches: a replacement that replaces nothing, or stays.
    """
    benchmark, path = study("kernel_benchmark"), study("tension_path")
    case = benchmark.Case.of(2.0)
    system, F = case.system, case.system.deformation_gradient(case.u)
    points = system.points(F, 0.0)
    true, other = system.tangent(F, points.S, points.D), system.tangent(F, 1.7 * points.S, points.D)
    assert abs(other - true).max() > 1e-3 * abs(true).max()
    with path.plain_newton():
        points = system.points(F, 0.0)
        assert (system.tangent(F, 1.7 * points.S, points.D) == true).all()
    assert (system.tangent(F, 1.7 * points.S, points.D) == other).all()


def test_all_contenders_of_the_benchmark_assemble_the_same() -> None:
    """Ours, scikit-fem's forms and, where installed, FElupe's give one matrix; ours is ten times faster than the forms.

    Catches: another law, another quadrature, or another state in one of them.
    """
    module, found = study("kernel_benchmark"), smoke("kernel_benchmark")
    module.expect(found, "smoke")
    names = {row["contender"] for row in found[0].rows}
    assert (module.FELUPE in names) == (not module.felupe_missing())


def test_the_benchmark_refuses_another_matrix_and_a_slow_kernel() -> None:
    """Its expectations fail on a matrix that differs by 1e-11, and on forms that are not slow.

    Catches: a comparison that is made and not looked at.
    """
    module = study("kernel_benchmark")
    found = copy.deepcopy(smoke("kernel_benchmark"))
    found[0].row(module.FORMS)["tangent_difference_1"] = 1e-11
    refuses(lambda: module.expect(found, "smoke"), "tangent differs")
    found = copy.deepcopy(smoke("kernel_benchmark"))
    found[0].row(module.FORMS)["both_s"] = 9.0 * found[0].row(module.OURS)["both_s"]
    refuses(lambda: module.expect(found, "smoke"), "only 9.0 times")


def test_closing_converges_and_the_peak_grows() -> None:
    """On three coarse meshes closing and force settle, the corner's peak grows, the ball's mean hardly.

    Catches: a measure read at a point that moves with the mesh, a ball whose radius follows the elements.
    """
    study("mesh_error").expect(smoke("mesh_error"), "smoke")


def test_the_mesh_study_refuses_a_peak_that_settles_and_a_mean_that_grows() -> None:
    """Its expectations fail where the peak stops growing, where the mean grows like it, where quadratures differ.

    Catches: a claim of divergence that anything fulfils.
    """
    module = study("mesh_error")
    for name, values, word in (
        ("corner_peak_kPa", (15.0, 15.1, 15.2), "does not grow"),
        ("ball_kPa", (5.0, 6.0, 7.0), "grows as the peak"),
        ("closing_mm", (0.74, 0.75, 0.74), "not increasing"),
        ("passive_force_mN", (4.0, 3.9, 3.8), "changes by"),
    ):
        found = copy.deepcopy(smoke("mesh_error"))
        for row, value in zip(found.sizes, values, strict=True):
            row[name] = value
        refuses(lambda found=found: module.expect(found, "smoke"), word)


def test_the_mesh_study_refuses_a_bar_that_misses_the_limit_or_is_wide() -> None:
    """What five meshes know passes with the closing that was found, not with 1 % less, or scatter of 0.3 %.

    Catches: a bar that is told and compared with nothing.
    """
    module = study("mesh_error")
    sizes = (0.425008, 0.384481, 0.337552, 0.305562, 0.268219)
    force = (4.431097, 4.427195, 4.420045, 4.409275, 4.405135)
    closing = (3.635768, 3.647764, 3.662554, 3.672779, 3.683002)

    def told(values: tuple[float, ...]) -> list[dict[str, float]]:
        rows = zip(sizes, values, force, strict=True)
        return module.bars([{"size_mm": h, "tip_closing_mm": u, "muscle_force_mN": f} for h, u, f in rows])

    module.expect_bars(told(closing))
    refuses(lambda: module.expect_bars(told(tuple(0.99 * u for u in closing))), "does not hold")
    uneven = tuple(u * (1.0 + 0.003 * sign) for u, sign in zip(closing, (1, -1, 1, -1, 1), strict=True))
    refuses(lambda: module.expect_bars(told(uneven)), "known to")


def test_orders_and_limits_of_a_power_are_found() -> None:
    """Richardson's order and the fit recover ``v = 2 - 0.3 h^1.37``, and no order where differences grow.

    Catches: ratios of sizes taken as equal, the finest mesh's error added instead of removed.
    """
    import numpy as np

    module = study("mesh_error")
    h = np.array([2.0, 1.35, 0.9])
    v = 2.0 - 0.3 * h**1.37
    assert module.richardson_order(h, v) == pytest.approx(1.37, abs=1e-9)
    order, limit = module.fitted(h, v)
    assert order == pytest.approx(1.37, abs=0.005)
    assert limit == pytest.approx(2.0, abs=2e-3)
    assert module.richardson_order(h, np.array([1.0, 1.1, 1.6])) is None
    theory = 2.0 - 0.3 * h**module.THEORY
    assert module._extrapolated(h, theory) == pytest.approx(2.0, abs=1e-12)
