"""Solving beside a neighbour: a design whose states are known already, on the same mesh.

What the path's own predictor misses at the neighbour it misses here too, but for a part that is as small as the
difference of the two designs. So a trial is the neighbour's state at the same tension (or load), put together from its
states on both sides, and the difference of the two designs carried along from the own states solved so far.

A trial decides where the iteration begins, not where it ends: tolerance and check of stability are those of any state,
and where a trial leads nowhere the path is followed as without it. Where a body has several stable states at a tension
the neighbour's kind is found; the path alone finds that which hangs together with the undeformed body.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from fem_biobot.design import Design
from fem_biobot.errors import FileError
from fem_biobot.files import file_error, replacing
from fem_biobot.material.law import Array, OutsideLawError
from fem_biobot.solid.from_design import remodelled, tension_step, tension_unit
from fem_biobot.solid.measures import Measurer
from fem_biobot.solid.model import SolidModel, SolidState, equilibrium_of
from fem_biobot.solid.newton import Trial
from fem_biobot.solid.path import predict, residual, weights
from fem_biobot.solid.records import Step
from fem_biobot.solid.system import InvertedError

if TYPE_CHECKING:
    from fem_biobot.study.plan import Found

STATES = "states.npz"
# states of the neighbour that one of its states in between is put together from
_BETWEEN = 4
# steps nearer than this are one
_SAME = 1e-9


@dataclass(frozen=True)
class Beside:
    """A state of the neighbour.

    Attributes
    ----------
    u
        Displacement of the nodes, (3, n) [mm].
    pressure
        Pressures of the mixed form, (m,) [kPa]; None without.
    load, tension, force, natural_stretch
        Factor on the load [1], tension [kPa], muscle force [mN], natural stretch of remodelled tissue [1].
    """

    u: Array
    pressure: Array | None
    load: float
    tension: float
    force: float
    natural_stretch: float


Neighbour = Mapping[str, Beside]
"""States by their keys, in the order in which they were solved."""


@dataclass(frozen=True)
class Shared:
    """What a solve shares with the other cases of a sweep.

    Attributes
    ----------
    meshes
        Folder of generated meshes, see `mesh.store`.
    neighbour
        Folder of the result at whose states this one begins; None for one that begins from the undeformed body.
    sharp
        Whether solves of the sweep begin at neighbours: states are kept for others then, and searches end only where
        their tolerance is that of the states, so that where they begin cannot be seen.
    """

    meshes: Path
    neighbour: Path | None = None
    sharp: bool = False

    def states(self) -> Neighbour | None:
        """States of the neighbour; raises `FileError` where they are missing or not whole."""
        return None if self.neighbour is None else kept_states(self.neighbour)


def keep_states(folder: Path, found: Sequence[Found], design: Design) -> None:
    """Keep the states of a design's solve for neighbours to begin at, whole or not at all."""
    arrays: dict[str, Any] = {"keys": np.array([each.wanted.key for each in found])}
    for each in found:
        state = each.state
        force = 0.0 if design.muscle is None else Measurer(design, state.model).muscle_force(state)
        numbers = (state.step.load, state.step.tension * tension_unit(design), force, each.natural_stretch)
        arrays[f"{each.wanted.key}.u"] = state.u
        arrays[f"{each.wanted.key}.numbers"] = np.array(numbers)
        if each.state.pressure is not None:
            arrays[f"{each.wanted.key}.pressure"] = each.state.pressure
    with replacing(folder / STATES) as temporary:
        np.savez(temporary, **arrays)


def kept_states(folder: Path) -> Neighbour:
    """States that a solve kept, with all their digits.

    Raises
    ------
    FileError
        They are missing or not whole.
    """
    file = folder / STATES
    try:
        with np.load(file) as data:
            return {key: _beside(data, key) for key in data["keys"].tolist()}
    except OSError as error:
        raise file_error(error, file, doing="read") from None
    except (ValueError, KeyError, EOFError, BadZipFile) as error:
        raise FileError(f"{file}: cannot be read ({error}), expected the states of a solve") from None


def _beside(data: Mapping[str, Array], key: str) -> Beside:
    pressure = data.get(f"{key}.pressure")
    load, tension, force, stretch = data[f"{key}.numbers"].tolist()
    return Beside(data[f"{key}.u"], pressure, load, tension, force, stretch)


class Guide:
    """What a solve makes of its neighbour: trials of states, guesses of tensions and of the natural stretch.

    Parameters
    ----------
    neighbour
        Its states.
    design
        The own design.
    model
        That of the own design, as moulded.

    Raises
    ------
    FileError
        The states are of another mesh.
    """

    def __init__(self, neighbour: Neighbour, design: Design, model: SolidModel) -> None:
        self.neighbour, self.design, self.model = neighbour, design, model
        own = (model.system.space.n_nodes, model.system.n_pressures)
        for key, each in neighbour.items():
            found = (each.u.shape[1], 0 if each.pressure is None else each.pressure.size)
            if found != own:
                raise FileError(f"{STATES}: {key}: found {found} nodes and pressures, expected {own}: the same mesh")

    @cached_property
    def _moulded(self) -> list[SolidState]:
        """The neighbour's moulded states along its path."""
        found = [each for key, each in self.neighbour.items() if not key.startswith("remodelled")]
        return _risen([self._own(self.model, each) for each in found])

    @cached_property
    def _natural(self) -> SolidModel | None:
        """The own model with the neighbour's natural stretch; None where it has no remodelled state."""
        passive = self.neighbour.get("remodelled_passive")
        return None if passive is None else remodelled(self.model, self.design, passive.natural_stretch)

    @cached_property
    def _remodelled(self) -> list[SolidState]:
        """The neighbour's remodelled states along its path."""
        found = [each for key, each in self.neighbour.items() if key.startswith("remodelled")]
        return [] if self._natural is None else _risen([self._own(self._natural, each) for each in found])

    def _own(self, model: SolidModel, each: Beside) -> SolidState:
        """A displacement of the neighbour with the own laws, and so with the stresses that these give it."""
        step = replace(tension_step(self.design, each.tension), load=each.load)
        return SolidState(model, step, each.u, pressure=each.pressure)

    def trial(self, model: SolidModel, history: Sequence[SolidState], step: Step) -> Trial | None:
        """Where to begin at a step after the last states of the own path; None where its own predictor serves better.

        Within the neighbour's path the neighbour serves; beyond its end, whichever leaves the smaller residual. Within,
        residuals do not tell: most of what a trial of a thin part leaves is membrane stress, which the first iteration
        takes back.
        """
        path = self._moulded if model is self.model else self._remodelled
        if not path:
            return None
        try:
            found, within = _beside_path(path, history, step)
            left = residual(model.system, found, step)
            if not within and history:
                own = predict(model.system, [equilibrium_of(state) for state in history], step)
                if residual(model.system, own, step) < left:
                    return None
        except (InvertedError, OutsideLawError):
            return None
        return found

    def tension(self, force: float, seen: Sequence[tuple[float, float]]) -> float | None:
        """Tension at which a muscle force is expected, by the neighbour's [kPa].

        Parameters
        ----------
        force
            Wanted [mN].
        seen
            Tensions and muscle forces of the own states solved so far [kPa, mN].
        """
        moulded = [each for key, each in self.neighbour.items() if not key.startswith("remodelled")]
        points = sorted({round(each.force, 12): each.tension for each in moulded}.items())
        if len(points) < 2 or points[0][0] < 0.0:
            return None
        forces, tensions = np.array(points).T

        def beside(at: float) -> float:
            nearest = np.sort(np.argsort(np.abs(forces - at), kind="stable")[:_BETWEEN])
            return float(lagrange(forces[nearest], at) @ tensions[nearest])

        # own tensions over the neighbour's at equal force change slowly along the path
        ratios = {round(f, 12): t / beside(f) for t, f in seen if f > 0.0 and beside(f) > 0.0}
        nearest = sorted(ratios, key=lambda f: abs(f - force))[:3]
        ratio = float(lagrange(np.array(nearest), force) @ [ratios[f] for f in nearest]) if nearest else 1.0
        return ratio * beside(force)

    def natural(self, step: Step) -> tuple[float, SolidModel, Trial] | None:
        """The neighbour's natural stretch, the own model with it and a trial there; None where the neighbour has none.

        Remodelled tissue bears its tension alone, whatever its stiffness, so that neighbours' natural stretches differ
        by what their tensions and skeletons do.
        """
        if self._natural is None:
            return None
        trial = self.trial(self._natural, [], step)
        return None if trial is None else (self.neighbour["remodelled_passive"].natural_stretch, self._natural, trial)


def _risen(states: Sequence[SolidState]) -> list[SolidState]:
    """States by rising load and tension, each once."""
    found: list[SolidState] = []
    for state in sorted(states, key=lambda s: (s.step.load, s.step.tension)):
        if not found or _apart(found[-1].step, state.step) > _SAME:
            found.append(state)
    return found


def _apart(here: Step, there: Step) -> float:
    return abs(there.load - here.load) + abs(there.tension - here.tension)


def _place(path: Sequence[SolidState], step: Step) -> float:
    """Where a step lies on a path: its tension, or its load where that is what the path raises."""
    return step.load if path[0].step.load != path[-1].step.load else step.tension


def _between(path: Sequence[SolidState], step: Step) -> dict[int, float]:
    """Weights of the neighbour's states, by number, that put together its state at a step."""
    places = np.array([_place(path, state.step) for state in path])
    at = _place(path, step)
    if at > places[-1]:
        first = max(0, len(path) - _BETWEEN)
        return {first + number: w for number, w in weights([state.step for state in path[first:]], step)}
    nearest = np.sort(np.argsort(np.abs(places - at), kind="stable")[:_BETWEEN])
    return dict(zip(nearest.tolist(), lagrange(places[nearest], at).tolist(), strict=True))


def lagrange(places: Array, at: float) -> Array:
    """Weights of values at some places, (n,), in the polynomial through them, at another."""
    own = places.tolist()
    return np.array([math.prod((at - b) / (a - b) for b in own if b != a) for a in own])


def _beside_path(path: Sequence[SolidState], history: Sequence[SolidState], step: Step) -> tuple[Trial, bool]:
    """The neighbour's state at a step with what the own last states differ by from its, carried along.

    And whether the step lies within the neighbour's path.
    """
    theirs = _between(path, step)
    own = weights([state.step for state in history], step) if history else []
    for number, w in own:
        for other, share in _between(path, history[number].step).items():
            theirs[other] = theirs.get(other, 0.0) - w * share
    terms = [(history[number], w) for number, w in own] + [(path[number], theirs[number]) for number in sorted(theirs)]
    u, S = np.zeros_like(path[0].u), np.zeros_like(path[0].points.S)
    p = None if path[0].pressure is None else np.zeros_like(path[0].pressure)
    for state, w in terms:
        u += w * state.u
        S += w * state.points.S
        if p is not None and state.pressure is not None:
            p += w * state.pressure
    return Trial(np.ascontiguousarray(u.T), S, p), _place(path, step) <= _place(path, path[-1].step)
