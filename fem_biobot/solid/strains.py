"""Strains of a state as one number a region that converges with the mesh."""

from __future__ import annotations

import numpy as np

from fem_biobot.errors import ModelError
from fem_biobot.solid.state import SolidState


def exceeded_strain(state: SolidState, region: str, share: float = 0.01) -> float:
    """Largest principal nominal strain that a share of a region's volume exceeds [1].

    Parameters
    ----------
    state
        Of the solid.
    region
        Of its mesh.
    share
        Of the volume [1]. The strain at a sharp corner grows without limit with the mesh; what a percent of the volume
        exceeds does not.

    Raises
    ------
    ModelError
        A region that the mesh does not have, a share that is none.
    """
    mesh = state.model.mesh
    if region not in mesh.regions:
        raise ModelError(f"region: found {region!r}, expected one of: {', '.join(mesh.regions)}")
    if not 0.0 < share < 1.0:
        raise ModelError(f"share: found {share:g}, expected above 0 and below 1")
    elements = mesh.regions[region]
    F = np.moveaxis(state.F[:, :, elements], (0, 1), (-2, -1))
    stretch = np.sqrt(np.linalg.eigvalsh(F.swapaxes(-1, -2) @ F)[..., -1]).ravel()
    volume = state.model.system.space.dV[elements].ravel()
    order = np.argsort(stretch)[::-1]
    beyond = np.cumsum(volume[order])
    return float(stretch[order][np.searchsorted(beyond, share * beyond[-1])] - 1.0)
