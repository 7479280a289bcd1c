"""Rods that close as far as a solid does: the same with the tensions at which they do, at rest and at full drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from fem_biobot.design import Design
from fem_biobot.errors import ModelError
from fem_biobot.link.observed import Array
from fem_biobot.link.rod_side import RodSide
from fem_biobot.rod.model import RodModel
from fem_biobot.rod.records import Muscle
from fem_biobot.study.reporter import Silent

# shares of a tension about which rods are asked how far they close
_SHARES = (0.7, 0.85, 1.0, 1.15)
_APART = 1e-6  # of a tension; nearer ones are asked once, since their slope would be the solver's tolerance


def closings(design: Design, model: RodModel, tensions: Sequence[float]) -> Array:
    """Closing of a design's rods afloat at tensions that rise [kPa], (k,) [mm]."""
    return np.array([s.numbers["tip_closing_mm"] for s in RodSide(design, model).states(tensions, Silent())[0]])


def tensions_at(curve: PchipInterpolator, closing: float) -> list[float]:
    """Tensions at which a curve of closings by tension has one, rising [kPa]; none where it does not reach it."""
    return sorted(float(T) for T in curve.solve(closing, extrapolate=False))


def closing_as(design: Design, model: RodModel, wanted: tuple[float, float]) -> tuple[RodModel, list[float]]:
    """Rods that close as far as wanted afloat at rest and at full drive [mm], and the tensions at which they do [kPa].

    The model's muscles are given that passive tension and the active one that is left; all else stays. For models
    whose muscles alone are driven, such as those of `rod.reduce` and `link.at_load`.

    Raises
    ------
    ModelError
        A closing that is not reached between 0.7 and 1.15 times the design's own tensions; a design without standing or
        active tension; a model whose beam has not as many elements as are observed.
    """
    rest, full = design.tension(0.0), design.tension(1.0)
    if not full > rest > 0.0:
        raise ModelError(
            f"muscle.passive_tension, muscle.active_tension: found {rest:.3g} kPa at rest and {full:.3g} kPa at full "
            "drive, expected both above 0 kPa, full drive above rest"
        )
    asked = list[float]()
    # those about rest may reach beyond those about full drive
    for T in sorted(share * T for T in (rest, full) for share in _SHARES):
        if not asked or T > (1.0 + _APART) * asked[-1]:
            asked.append(T)
    # monotone through what was asked; rods about a load do not close by nothing under none
    found = PchipInterpolator(asked, closings(design, model, asked))
    own: list[float] = []
    for closing in wanted:
        roots = tensions_at(found, closing)
        if not roots:
            raise ModelError(
                f"closing: found rods that close by {float(found(asked[0])):.3g} to {float(found(asked[-1])):.3g} mm "
                f"at {asked[0]:.3g} to {asked[-1]:.3g} kPa, expected {closing:.3g} mm among them"
            )
        own.append(roots[0])
    shares = own[0] / rest, (own[1] - own[0]) / (full - rest)
    members = [
        replace(m, passive=m.passive * shares[0], active=m.active * shares[1]) if isinstance(m, Muscle) else m
        for m in model.members
    ]
    parts = (model.rods, model.joints, model.bodies, model.supports, model.loads, members, model.contacts)
    return RodModel(*parts, model.damping_time, model.touches, model.landmarks), own
