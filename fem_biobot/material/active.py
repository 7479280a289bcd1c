"""The active tension of a region of muscle: its record, and the law that a solver makes of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.material.active_strain import ActiveStrain
from fem_biobot.material.conventions import Convention, convention_of
from fem_biobot.material.dispersion import AngularTension, Dispersion
from fem_biobot.material.fibre_tension import FibreTension, check_tension, check_transverse, check_unit
from fem_biobot.material.force_length import CONSTANT, ForceLength, force_length
from fem_biobot.material.force_velocity import ForceVelocity
from fem_biobot.material.law import Array, Law
from fem_biobot.material.muscle_tension import Activation, MuscleTension

__all__ = ["Activation", "ActiveLaw", "ActiveStress", "Convention", "active_law"]


class ActiveLaw(Law, Protocol):
    """A law of active tension: any `Law` that can be had at a multiple of its tension."""

    def scaled(self, factor: float) -> ActiveLaw: ...


@dataclass(frozen=True)
class ActiveStress:
    """Active tension of one region, at full drive.

    Parameters
    ----------
    tension
        Tension at step factor 1 [kPa], a number or one value an element of the region, (e,); at least 0.
    a0
        Unit fibre direction in the reference body: one vector (3,), or one an element of the region, (3, e) [1].
    convention
        See `Convention`.
    force_length
        Dependence of the stimulated tension on the fibre stretch: a curve, or the name of one in `FORCE_LENGTH`; none
        by default.
    transverse
        Tension across the fibre as a share of that along it, in [0, 1]; see `FibreTension`.
    dispersion
        Spread of the fibres about `a0`; by default none.
    integrate
        Sum over the directions of the dispersion, the slow reference, in place of its structure tensor.
    standing
        How much of `tension` is there without stimulation [kPa], a number or one value an element of the region; none
        by default. As the tension rises with the step's factor it comes first. Neither `force_length` nor
        `force_velocity` nor `activation` acts on it: such curves are measured on what stimulation adds.
    activation
        Share of the stimulated tension over space and time: a function of reference positions (3, k) [mm] and the
        step's time [s] with values (k,) of at least 0; 1 everywhere by default. See `muscle.activation` for formulas,
        tables and pictures.
    force_velocity
        Dependence of the stimulated tension on the rate of the fibre's stretch, where there is time; none by default.
    """

    tension: float | Array
    a0: Array
    convention: Convention | str = Convention.nominal
    force_length: ForceLength | str = CONSTANT
    transverse: float = 0.0
    dispersion: Dispersion | None = None
    integrate: bool = False
    standing: float | Array = 0.0
    activation: Activation | None = None
    force_velocity: ForceVelocity | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "convention", convention_of(self.convention))
        a0 = np.array(self.a0, dtype=float)
        if a0.ndim not in (1, 2) or a0.shape[0] != 3:
            raise ModelError(f"a0: found shape {a0.shape}, expected (3,) or (3, e)")
        check_unit(a0)
        check_tension(self.tension)
        a0.setflags(write=False)
        object.__setattr__(self, "a0", a0)
        curve = force_length(self.force_length) if isinstance(self.force_length, str) else self.force_length
        object.__setattr__(self, "force_length", curve)
        check_transverse(self.transverse, curve)
        extras = {
            "force_length": not curve.is_constant,
            "transverse": self.transverse > 0.0,
            "dispersion": self.dispersion is not None,
            "activation": self.activation is not None,
            "force_velocity": self.force_velocity is not None,
        }
        if self.convention is Convention.active_strain and any(extras.values()):
            found = next(name for name, given in extras.items() if given)
            raise ModelError(f"{found}: found with convention active_strain, expected it with an active stress only")
        if self.integrate and (self.dispersion is None or self.transverse):
            raise ModelError("integrate: found without a dispersion, or with transverse tension, expected neither")
        check_tension(self.standing)
        if np.any(np.asarray(self.standing) > np.asarray(self.tension) * (1.0 + 1e-12)):
            raise ModelError(
                f"standing: found {np.max(self.standing):g} kPa, expected at most the tension, of which it is a part"
            )
        if self.activation is not None and not callable(self.activation):
            raise ModelError(f"activation: found {self.activation!r}, expected a function of position and time")
        if self.force_velocity is not None:
            if not isinstance(self.force_velocity, ForceVelocity):
                raise ModelError(f"force_velocity: found {self.force_velocity!r}, expected a ForceVelocity")
            if self.transverse:
                raise ModelError(
                    f"transverse: found {self.transverse:g} together with a force-velocity curve, expected one of the "
                    "two (how tension across fibres depends on their rate is not known)"
                )
        if self.integrate and (np.any(self.standing) or self.activation is not None or self.force_velocity is not None):
            raise ModelError(
                "integrate: found with a standing tension, an activation or a force-velocity curve, expected none"
            )

    @property
    def has_parts(self) -> bool:
        """Whether the standing and the stimulated tension differ in more than their size."""
        curved = isinstance(self.force_length, ForceLength) and not self.force_length.is_constant
        alone = self.activation is not None or self.force_velocity is not None
        return alone or (curved and bool(np.any(self.standing)))


def active_law(
    muscle: ActiveStress, n_elements: int, elements: np.ndarray, passive: Law, X: Array | None = None
) -> ActiveLaw:
    """The law of a region's active tension over all elements of a mesh, without tension outside the region.

    Parameters
    ----------
    n_elements
        Elements of the mesh.
    elements
        Those of the region, (k,), in the order of the arrays of `muscle`.
    passive
        Passive law of the region; only active strain asks for it.
    X
        Reference positions of the points of all elements, (3, e, q) [mm]; only an activation asks for them.
    """
    tension = np.zeros(n_elements)
    tension[elements] = muscle.tension
    if muscle.a0.ndim == 1:
        a0 = muscle.a0
    else:
        # a direction for elements without fibres too, which no tension acts along
        a0 = np.repeat(muscle.a0[:, :1], n_elements, axis=1)
        a0[:, elements] = muscle.a0
    convention = Convention(muscle.convention)
    if convention is Convention.active_strain:
        return ActiveStrain(tension, a0, passive)
    assert isinstance(muscle.force_length, ForceLength)
    if muscle.integrate:
        assert muscle.dispersion is not None
        return AngularTension(tension, a0, muscle.dispersion, convention, muscle.force_length)
    structure = None if muscle.dispersion is None else muscle.dispersion.structure(a0)
    whole = FibreTension(tension, a0, convention, muscle.force_length, muscle.transverse, structure)
    if not muscle.has_parts:
        return whole
    kept = np.zeros(n_elements)
    kept[elements] = muscle.standing
    standing = FibreTension(kept, a0, convention, CONSTANT, muscle.transverse, structure)
    return MuscleTension(whole, standing, muscle.activation, X, elements, muscle.force_velocity)
