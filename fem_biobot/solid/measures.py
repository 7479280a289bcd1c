"""What is read off a state of a machine: forces, closing, sagitta, stretch, stress, energy; free of rigid motion.

Definitions, once: the *chord* is the line through the beam-axis points at the two ends of the flexible span, mid-width.
*tip_closing* is the decrease of the distance between the two sole centroids, projected on the chord. *sagitta* is the
distance of the beam-axis mid-span point from the chord. *muscle_force* is the resultant through the reference
mid-section of the junction along the mean current normal of that section.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from fem_biobot.design import Design
from fem_biobot.equations import equation_3
from fem_biobot.errors import MeshError
from fem_biobot.material.active_strain import ActiveStrain
from fem_biobot.material.law import PAIRS, Array, add_law, inverse, is_symmetric, volume_ratio
from fem_biobot.material.muscle_tension import MuscleTension
from fem_biobot.muscle.fibres import in_junction, junction_blocks
from fem_biobot.solid.from_design import tension_unit
from fem_biobot.solid.model import SolidModel, SolidState
from fem_biobot.solid.space import Space
from fem_biobot.solid.state import interpolation
from fem_biobot.solid.stress import Probe, ball, cauchy_stress, probe, von_mises
from fem_biobot.solid.surfaces import node_areas

BALL_RADIUS = 0.3  # mm, fixed for every mesh and design so that numbers compare


def eq3_stiffness(design: Design) -> float:
    """Sagitta stiffness ``k = 8 E I / (l L^2)`` of Pagan-Diaz et al. (2018), Eq. 3 [mN/mm].

    Linear beam theory with the muscle's moment arm ``l`` and the flexible span ``L``: off by the angle of the pillars
    once that is no longer small.
    """
    skeleton = design.skeleton
    assert skeleton is not None
    return equation_3(1.0, skeleton.material.young * design.second_moment, design.moment_arm, design.span)


@dataclass(frozen=True)
class Measurer:
    """Reads measures off states of one model; locates everything in the mesh once.

    Parameters
    ----------
    design
        What the mesh is of.
    model
        The model whose states are measured.
    """

    design: Design
    model: SolidModel

    @property
    def _space(self) -> Space:
        return self.model.system.space

    @cached_property
    def _marks(self) -> dict[str, Array]:
        """Interpolation weights of the design's landmarks, exact at vertices."""
        weights = {}
        for name, position in self.design.landmarks().items():
            index = self.model.mesh.landmarks.get(name)
            if index is None:
                weights[name] = interpolation(self.model.system, np.array(position))
            else:
                weights[name] = np.zeros(self._space.n_nodes)
                weights[name][index] = 1.0
        return weights

    def position(self, state: SolidState, name: str) -> Array:
        """Current position of a landmark, (3,) [mm]."""
        return (self._space.points + state.u) @ self._marks[name]

    @cached_property
    def _soles(self) -> dict[str, Array]:
        """Weights whose sum over the nodes is the area mean over a sole (or an end face)."""
        names = {"bot": ("foot_short", "foot_long"), "strip": ("end_minus", "end_plus"), "cantilever": ("clamp", "tip")}
        found = {}
        for name in names[self.design.kind]:
            if name not in self.model.mesh.surfaces:
                raise MeshError(f"{name}: found no such surface in the mesh, expected one to measure by")
            weights = node_areas(self._space, self.model.mesh.points, self.model.mesh.surfaces[name])
            found[name] = weights / weights.sum()
        return found

    def tip_closing(self, state: SolidState) -> float:
        """Approach of the sole centroids along the chord [mm]."""
        first, second = self._soles.values()
        X, x = self._space.points, self._space.points + state.u
        apart0, apart = X @ second - X @ first, x @ second - x @ first
        if self.design.kind != "bot":
            return float(np.linalg.norm(apart0) - np.linalg.norm(apart))
        reference = SolidState(self.model, state.step, np.zeros_like(state.u))
        return float(apart0 @ self._chord(reference) - apart @ self._chord(state))

    def closing_gradient(self, state: SolidState) -> Array:
        """Derivative of `tip_closing` by the displacement of the nodes, (3, n) [1]."""
        first, second = self._soles.values()
        between = second - first
        apart = (self._space.points + state.u) @ between
        if self.design.kind != "bot":
            return -np.outer(apart / np.linalg.norm(apart), between)
        chord = self._chord(state)
        length = float(np.linalg.norm(self.position(state, "span_long") - self.position(state, "span_short")))
        turned = (apart - (apart @ chord) * chord) / length
        return -np.outer(chord, between) - np.outer(turned, self._marks["span_long"] - self._marks["span_short"])

    def deflection_gradient(self) -> Array:
        """Derivative of a cantilever's tip deflection by the displacement of the nodes, (3, n) [1]."""
        return np.outer([0.0, 0.0, 1.0], self._soles["tip"])

    def _chord(self, state: SolidState) -> Array:
        chord = self.position(state, "span_long") - self.position(state, "span_short")
        return chord / np.linalg.norm(chord)

    def sagitta(self, state: SolidState) -> float:
        """Distance of the mid-span point of the beam axis from the chord [mm]."""
        chord = self._chord(state)
        arm = self.position(state, "span_mid") - self.position(state, "span_short")
        return float(np.linalg.norm(arm - (arm @ chord) * chord))

    @cached_property
    def _mid(self) -> float:
        low, high = junction_blocks(self.design)[0]
        return 0.5 * (low + high)

    @cached_property
    def _beyond_mid(self) -> Array:
        """One at nodes on or beyond the mid-section, else zero, (n,)."""
        tolerance = 1e-9 * np.ptp(self._space.points, axis=1).max()
        return (self._space.points[0] >= self._mid - tolerance).astype(float)

    def muscle_force(self, state: SolidState) -> float:
        """Force through the muscle's mid-section along its mean current normal [mN], positive when it pulls.

        The resultant is the internal force that the muscle elements on one side exert on the section's nodes: the
        weak form's own flux of ``P N``, in exact balance with the rest of the machine on any mesh.
        """
        space, points = self._space, state.points
        muscle = self.model.mesh.regions["muscle"]
        w = self._beyond_mid[space.nodes[:, muscle]]  # (b, e)
        cut = np.flatnonzero((w.min(axis=0) < 1.0) & (w.max(axis=0) > 0.0))
        if not cut.size:
            raise MeshError(
                f"muscle: found no tissue across x = {self._mid:g} mm, expected the junction's mid-section there"
            )
        elements = muscle[cut]
        slopes = np.einsum("bdq,dke->bkeq", space.slopes, space.to_reference[:, :, elements])
        gradient = np.einsum("be,bkeq->keq", w[:, cut], slopes)  # of the weight: carries the flux across the section
        S = np.zeros((3, 3, len(elements), space.dV.shape[1]))
        for a, (i, j) in enumerate(PAIRS):
            S[i, j] = S[j, i] = points.S[a][elements]
        F = points.F[:, :, elements]
        resultant = np.einsum("imeq,mkeq,keq,eq->i", F, S, gradient, space.dV[elements])
        cofactor = volume_ratio(F) * inverse(F).swapaxes(0, 1)
        normal = np.einsum("iseq,eq->is", cofactor, space.dV[elements])[:, 0]
        return float(resultant @ normal / np.linalg.norm(normal))

    @cached_property
    def _middle_fifth(self) -> Array:
        """Volumes of the quadrature points in the junction's middle fifth, zero elsewhere, (e, q)."""
        low, high = junction_blocks(self.design)[0]
        X = self._space.quadrature_points
        inside = in_junction(self.design, X) & (np.abs(X[0] - self._mid) <= 0.1 * (high - low))
        muscle = np.zeros(self._space.dV.shape[0], dtype=bool)
        muscle[self.model.mesh.regions["muscle"]] = True
        volumes = np.where(inside & muscle[:, None], self._space.dV, 0.0)
        if not volumes.any():
            raise MeshError(
                "muscle: found no tissue in the junction's middle fifth, expected some (is the mesh too coarse?)"
            )
        return volumes

    def fibre_stretch(self, state: SolidState) -> float:
        """Volume mean of the fibre stretch over the junction's middle fifth [1]."""
        inside = self._middle_fifth > 0.0
        return float(np.sum(state.stretch[inside] * self._middle_fifth[inside]) / self._middle_fifth.sum())

    def passive_fibre_stress(self, state: SolidState) -> float:
        """Mean over the junction's middle fifth of the PASSIVE nominal stress along the fibre, ``a . P a0`` [kPa].

        Negative while the tissue is pressed together by its own tension; zero where tissue has remodelled.
        """
        system = self.model.system
        passive = system.points(state.F, 0.0, state.pressure, moduli=False)
        inside = self._middle_fifth > 0.0
        F, volumes = state.F[:, :, inside], self._middle_fifth[inside]
        S = passive.S[:, inside]
        a0 = np.sum([c.a0 for c in system.contractions], axis=0)[:, inside]
        a = np.einsum("ik...,k...->i...", F, a0)
        stretch = np.sqrt(np.einsum("i...,i...->...", a, a))
        # a . P a0 = (F a0 / stretch) . F S a0
        Sa = np.zeros_like(a0)
        for b, (i, j) in enumerate(PAIRS):
            Sa[i] += S[b] * a0[j]
            if i != j:
                Sa[j] += S[b] * a0[i]
        along = np.einsum("i...,ik...,k...->...", a, F, Sa) / stretch
        return float(along @ volumes / volumes.sum())

    @cached_property
    def _ball(self) -> Probe:
        centre = np.array(self.design.landmarks()["corner_short"])
        return probe(self.model.system, ball(centre, BALL_RADIUS))

    def ball_von_mises(self, state: SolidState) -> float:
        """Mean von Mises stress in a ball of fixed radius about the short pillar's corner, mid-width [kPa].

        Unlike the peak at a sharp re-entrant corner, it converges with the mesh.
        """
        return float(np.mean(von_mises(self._ball.cauchy_stress(state))))

    def tension_length(self, state: SolidState) -> float:
        """Energy of the tension at factor 1, nominal ``int T1 (stretch - 1) dV`` [uJ]: what the tension works against.

        Not a number for a tension without energy (`Convention.cauchy`), and for active strain and a tension whose
        stimulated part has a curve or an activation of its own: their energy is not in proportion to the factor.
        """
        psi = np.zeros(self._space.dV.shape)
        S, D = np.zeros((6, *psi.shape)), np.zeros((0, *psi.shape))
        for c in state.model.system.contractions:
            law = c.law.stimulated if isinstance(c.law, MuscleTension) and c.law.is_plain else c.law
            if not is_symmetric(law) or isinstance(law, ActiveStrain | MuscleTension):
                return float("nan")
            add_law(law, state.F, c.elements, S, D, psi)
        return float(np.sum(psi * self._space.dV))

    def measures(self, state: SolidState) -> dict[str, float | None]:
        """All measures of one state; those that a kind of machine does not have are None."""
        bot, muscle = self.design.kind == "bot", self.design.muscle is not None
        sigma = cauchy_stress(state.points)
        equivalent = von_mises(sigma)
        sagitta = self.sagitta(state) if bot else None
        return {
            "tension_kPa": state.step.tension * tension_unit(self.design) if muscle else None,
            "muscle_force_mN": self.muscle_force(state) if muscle else None,
            "eq3_force_mN": eq3_stiffness(self.design) * sagitta if sagitta is not None else None,
            "tip_closing_mm": self.tip_closing(state) if muscle else None,
            "sagitta_mm": sagitta,
            "tip_deflection_mm": None if bot or muscle else float(state.u[2] @ self._soles["tip"]),
            "fibre_stretch_1": self.fibre_stretch(state) if muscle else None,
            "max_von_mises_kPa": float(equivalent.max()),
            "ball_von_mises_kPa": self.ball_von_mises(state) if bot else None,
            "strain_energy_uJ": state.energy,
            "smallest_volume_ratio_1": float(volume_ratio(state.F).min()),
            "residual_1": state.residual,
            "newton_iterations_1": state.newton_iterations,
            "factorisations_1": state.factorisations,
            "cg_iterations_1": state.cg_iterations,
        }


def measures(state: SolidState, design: Design) -> dict[str, float | None]:
    """All measures of one state of a design; see `Measurer`, which serves many states."""
    return Measurer(design, state.model).measures(state)


def muscle_work(tension_factors: Sequence[float], lengths: Sequence[float], start_length: float = 0.0) -> list[float]:
    """Work done by the muscle from the unstressed body to each state of a path [uJ], positive in shortening.

    Parameters
    ----------
    tension_factors
        Tension factor of each state in the order of the path [1]; it starts at zero before the first.
    lengths
        `Measurer.tension_length` of each state [uJ].
    start_length
        Its value where the path starts, at tension zero.

    Notes
    -----
    ``-int s dL`` of the cubic spline through the states (trapezoids where the tension does not rise); its error falls
    with the fourth power of the spacing of the states. At equilibrium without loads it equals the strain energy, which
    the summary can be checked by.
    """
    s = np.concatenate([[0.0], np.asarray(tension_factors, dtype=float)])
    length = np.concatenate([[start_length], np.asarray(lengths, dtype=float)])
    if len(s) >= 4 and np.all(np.diff(s) > 0.0):
        spline = CubicSpline(s, length)
        # integrate by parts: int s dL = s L - int L ds
        return [float(-(x * y - spline.integrate(0.0, x))) for x, y in zip(s[1:], length[1:], strict=True)]
    return list(np.cumsum(-0.5 * (s[1:] + s[:-1]) * np.diff(length)))
