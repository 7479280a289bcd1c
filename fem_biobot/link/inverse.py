"""Tension of the tissue and modulus of the gel from measured deflections, with intervals: rod statics the other way.

Rods of the design's parts (`link.at_load`) are solved on a grid of moduli and tensions once; between them deflections
are smooth. What is sought is found by least squares. The tissue's own modulus is the yardstick: with it twice as large,
everything that is found is twice as large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import least_squares
from scipy.stats import norm
from scipy.stats import t as student

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.at_load import LoadedRods
from fem_biobot.link.measured import Measured
from fem_biobot.link.observed import Array
from fem_biobot.link.sections import MeshSections, Stiffnesses
from fem_biobot.study.reporter import Reporter, Silent

PARAMETERS = ("tension", "passive", "active", "stiffness")
CONFIDENCE = 0.95
# moduli over the design's, and tensions over the largest, at which rods are solved
_FACTORS = (0.3, 0.45, 0.67, 1.0, 1.5, 2.2, 3.3)
_SHARES = tuple(k / 8 for k in range(1, 9))
_TOP = 1.8  # largest tension over the design's
_DRAWS = 200


@dataclass(frozen=True)
class Deflections:
    """Closing, sagitta [mm] and muscle force [mN] of a machine by modulus of its gel and tension [kPa]."""

    young: Array
    tension: Array
    closing: Array
    sagitta: Array
    force: Array

    def at(self, name: str, young: float, tension: Array) -> Array:
        """One of them, (r,), at a modulus and tensions (r,) [kPa]."""
        grid = np.concatenate([[0.0], self.tension])
        values = np.pad(getattr(self, name), ((0, 0), (1, 0)))
        spline = RectBivariateSpline(np.log(self.young), grid, values, kx=3, ky=3, s=0)
        return np.asarray(spline.ev(np.full(np.shape(tension), np.log(young)), tension), dtype=float)


def scaled(found: MeshSections, factor: float) -> MeshSections:
    """Sections of the same gel with another modulus."""

    def times(s: Stiffnesses) -> Stiffnesses:
        plain = {name: factor * getattr(s, name) for name in ("EI", "EI_lateral", "GJ", "EA", "GA", "GA_lateral")}
        return replace(s, **plain, EI_along=tuple(factor * v for v in s.EI_along))

    stiffer = {"moments": factor * found.moments, "torsion": factor * found.torsion}
    return replace(found, mesh=times(found.mesh), closed_form=times(found.closed_form), **stiffer)


def deflections(design: Design, rods: LoadedRods, reporter: Reporter | None = None) -> Deflections:
    """Deflections of a machine on the grid."""
    reporter = reporter or Silent()
    top = _TOP * max(design.tension(drive) for drive in (0.0, design.drive.amplitude, 1.0))
    tensions = [share * top for share in _SHARES]
    rows = []
    for factor in _FACTORS:
        part = replace(rods, sections=scaled(rods.sections, factor))
        rows.append(part.states(tensions, Silent())[0])
        reporter.advance(f"{factor:g} times the modulus")
    reached = min(len(row) for row in rows)
    if reached < 4:
        raise ModelError(f"measured: found rods up to {tensions[reached - 1]:.3g} kPa alone, expected more to fit with")

    def of(name: str) -> Array:
        return np.array([[state.numbers[name] for state in row[:reached]] for row in rows])

    young = design.value("skeleton.material.young") * np.array(_FACTORS)
    shapes = [of(name) for name in ("tip_closing_mm", "sagitta_mm", "muscle_force_mN")]
    return Deflections(young, np.array(tensions[:reached]), *shapes)


@dataclass(frozen=True)
class Estimate:
    """What was found.

    Attributes
    ----------
    names
        Out of `PARAMETERS`, in the order of the rest.
    value, low, high
        (p,) [kPa]; the interval of 95 % from the covariance.
    drawn
        The same interval from refits of drawn data, (2, p) [kPa].
    correlation
        Of the first two; not a number for one alone.
    passive, active, young
        Tensions and modulus that all this means [kPa].
    fitted, deviation
        Deflections, and forces after them where there are any, (r,) or (2 r,) [mm], [mN]; and one standard deviation
        of each, given or from what is left.
    misfit
        Sum of the squares of what is left over the deviation, over the degrees of freedom [1].
    """

    names: tuple[str, ...]
    value: Array
    low: Array
    high: Array
    drawn: Array
    correlation: float
    passive: float
    active: float
    young: float
    fitted: Array
    deviation: Array
    misfit: float


def _stacked(data: Measured) -> tuple[Array, Array]:
    """All that was measured, and the deviation of each; without any given, the size of their largest."""
    deviation = np.full_like(data.value, np.abs(data.value).max() or 1.0) if data.deviation is None else data.deviation
    if data.force is None:
        return data.value, deviation
    other = np.full_like(data.force, np.abs(data.force).max() or 1.0)
    of_force = other if data.force_deviation is None else data.force_deviation
    return np.concatenate([data.value, data.force]), np.concatenate([deviation, of_force])


def estimate(
    design: Design,
    data: Measured,
    table: Deflections,
    names: Sequence[str] = ("tension", "stiffness"),
    seed: int = 7,
    draws: int | None = None,
) -> Estimate:
    """Tension and modulus from measured deflections.

    Parameters
    ----------
    design
        The machine; what is not sought keeps its value.
    data
        Measurements.
    table
        From `deflections`.
    names
        What is sought: ``tension`` (passive and active in the design's ratio; the passive one is told), or ``passive``
        and ``active`` by themselves, and ``stiffness``, the modulus of the gel.
    seed, draws
        Of the refits, and how many; 200 by default.

    Raises
    ------
    ModelError
        Names that do not go together; fewer measurements than it takes; an estimate at the edge of the grid.

    Notes
    -----
    Intervals are those of the linearised problem, of the given deviations or else of what is left with Student's t; the
    draws repeat the fit on data with that deviation about it, and see what bends in between. Deflection is nearly in
    proportion to tension over modulus: what tells the two apart is the tissue's own stiffness and the bend of the
    curve, so both at once need a force as well, or very good data.
    """
    names = tuple(dict.fromkeys(names))
    if not names or not set(names) <= set(PARAMETERS) or ("tension" in names and {"passive", "active"} & set(names)):
        raise ModelError(
            f"fit: found {', '.join(names) or 'nothing'}, expected some of {', '.join(PARAMETERS)}, tension without "
            "passive and active"
        )
    values, weight = _stacked(data)
    freedom = len(values) - len(names)
    if freedom < (0 if data.deviation is not None else 1):
        least = len(names) + (data.deviation is None)
        raise ModelError(
            f"measured: found {len(values)} numbers, expected at least {least} to find {' and '.join(names)}"
        )
    start = {
        "passive": design.tension(0.0),
        "active": design.tension(1.0) - design.tension(0.0),
        "stiffness": design.value("skeleton.material.young"),
    }

    def meant(p: Array) -> dict[str, float]:
        found = dict(start)
        for name, value in zip(names, p, strict=True):
            if name == "tension":
                found |= {key: value * start[key] / scale["tension"] for key in ("passive", "active")}
            else:
                found[name] = value
        return found

    # told by the passive tension, or by the active one of tissue that has no other
    scale = {"tension": start["passive"] or start["active"], **start}

    def predicted(p: Array) -> Array:
        m = meant(p)
        tension = m["passive"] + data.drive * m["active"]
        found = table.at("closing" if data.quantity == "stroke" else data.quantity, m["stiffness"], tension)
        if data.quantity == "stroke":
            found = found - table.at("closing", m["stiffness"], np.array([m["passive"]]))
        if data.force is None:
            return found
        return np.concatenate([found, table.at("force", m["stiffness"], tension)])

    first = np.array([scale[name] or 0.1 * scale["tension"] for name in names])
    low = np.array([table.young[0] if name == "stiffness" else 0.0 for name in names])
    high = np.array([table.young[-1] if name == "stiffness" else table.tension[-1] for name in names])

    def solved(values: Array, at: Array) -> tuple[Array, Array, Array]:
        result = least_squares(
            lambda p: (predicted(p) - values) / weight, at, bounds=(low, high), x_scale=first, xtol=1e-12, ftol=1e-12
        )
        return result.x, result.jac, result.fun

    p, J, left = solved(values, np.clip(first, low * 1.01 + 1e-9, high * 0.99))
    m = meant(p)
    most = m["passive"] + float(data.drive.max()) * m["active"]
    for name, value, a, b in zip(names, p, low, high, strict=True):
        if not a + 1e-3 * (b - a) < value < b - 1e-3 * (b - a) or most > table.tension[-1]:
            raise ModelError(
                f"fit: found {name} of {value:.3g} kPa, expected inside {a:.3g} to {b:.3g} kPa and no tension above "
                f"{table.tension[-1]:.3g} kPa, for which rods were solved: does the design's geometry fit the data?"
            )
    if np.linalg.matrix_rank(J * first) < len(names):
        raise ModelError(
            f"fit: found data that do not tell {' and '.join(names)} apart, expected fewer or other drives"
        )
    misfit = float(left @ left / freedom) if freedom else float("nan")
    noise = weight if data.deviation is not None else weight * np.sqrt(misfit)
    covariance = np.linalg.inv(J.T @ J) * (1.0 if data.deviation is not None else misfit)
    spread = np.sqrt(np.diag(covariance))
    reach = norm.ppf(0.5 + CONFIDENCE / 2) if data.deviation is not None else student.ppf(0.5 + CONFIDENCE / 2, freedom)
    draw, fitted = np.random.default_rng(seed), predicted(p)
    again = np.array(
        [
            solved(fitted + noise * draw.normal(size=len(fitted)), p)[0]
            for _ in range(_DRAWS if draws is None else draws)
        ]
    )
    ends = np.percentile(again, [50.0 * (1.0 - CONFIDENCE), 50.0 * (1.0 + CONFIDENCE)], axis=0)
    both = len(names) > 1
    return Estimate(
        names,
        p,
        p - reach * spread,
        p + reach * spread,
        ends,
        float(covariance[0, 1] / (spread[0] * spread[1])) if both else float("nan"),
        m["passive"],
        m["active"],
        m["stiffness"],
        fitted,
        noise,
        misfit,
    )
