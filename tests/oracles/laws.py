"""Independent twins of the laws, written from their energies in other variables than the package uses.

Isotropic laws are written in principal stretches, with principal stresses derived by hand. Laws with fibres are written
in the components of a strain in axes of the fibre, and differentiated by complex steps, exact to rounding. Nothing is
imported from the package.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Own = dict[str, float]

# the parameters with which the battery runs each law: generic, and mild enough for stretches from 0.6 to 1.8
PARAMETERS: dict[str, Own] = {
    "neo_hooke": {},
    "neo_hooke_isochoric": {},
    "mooney_rivlin": {"second_share": 0.35},
    "yeoh": {"c2": -0.4, "c3": 0.3},
    "gent": {"chain_limit": 9.0},
    "guccione": {"exponent_fibre": 0.8, "exponent_across": 0.35, "exponent_shear": 0.55},
    "holzapfel_ogden": {"fibre_modulus": 6.0, "fibre_exponent": 0.6, "fibre_dispersion": 0.1},
    "blemker": {
        "ground": 0.7,
        "fibre_peak": 20.0,
        "fibre_onset": 0.3,
        "fibre_exponent": 2.5,
        "optimal_stretch": 1.05,
        "straight_stretch": 1.3,
    },
}


def lame(young: float, poisson: float) -> tuple[float, float]:
    """``lmbda, mu`` through the bulk modulus."""
    bulk, mu = young / (3.0 * (1.0 - 2.0 * poisson)), young / (2.0 + 2.0 * poisson)
    return bulk - 2.0 * mu / 3.0, mu


def bulk_modulus(young: float, poisson: float) -> float:
    """``E / (3 (1 - 2 nu))``."""
    return young / (3.0 * (1.0 - 2.0 * poisson))


# --- isotropic laws: energy and principal first Piola stresses of stretches (3,) -------------------------------------


def _neo_hooke(stretches: Array, young: float, poisson: float, own: Own) -> tuple[float, Array]:
    """``mu sum (l^2 - 1)/2 - mu ln J + lmbda/2 (ln J)^2``, ``dpsi/dl_i = mu (l_i - 1/l_i) + lmbda ln J / l_i``."""
    lmbda, mu = lame(young, poisson)
    ln_J = float(np.sum(np.log(stretches)))
    energy = 0.5 * mu * np.sum(stretches**2 - 1.0) - mu * ln_J + 0.5 * lmbda * ln_J**2
    return float(energy), mu * (stretches - 1.0 / stretches) + lmbda * ln_J / stretches


def _by_shape(
    shape: Callable[[Array], tuple[float, Array]], stretches: Array, young: float, poisson: float
) -> tuple[float, Array]:
    """A law ``W(L) + bulk/4 (J^2 - 1 - 2 ln J)`` of the stretches ``L_i = J^(-1/3) l_i``.

    With ``dL_i/dl_j = (L_i / l_j)(delta_ij - 1/3)``: ``dW/dl_j = (L_j W_j - sum(L W_)/3) / l_j``.
    """
    J, bulk = float(np.prod(stretches)), bulk_modulus(young, poisson)
    L = stretches / np.cbrt(J)
    W, W_ = shape(L)
    pull = L * W_
    energy = W + 0.25 * bulk * (J**2 - 1.0 - 2.0 * np.log(J))
    return float(energy), (pull - pull.mean() + 0.5 * bulk * (J**2 - 1.0)) / stretches


def _neo_hooke_isochoric(stretches: Array, young: float, poisson: float, own: Own) -> tuple[float, Array]:
    mu = lame(young, poisson)[1]
    return _by_shape(lambda L: (0.5 * mu * np.sum(L**2 - 1.0), mu * L), stretches, young, poisson)


def _mooney_rivlin(stretches: Array, young: float, poisson: float, own: Own) -> tuple[float, Array]:
    """Second invariant as the sum of ``L_i^-2``, which at constant volume it is."""
    mu, share = lame(young, poisson)[1], own["second_share"]

    def shape(L: Array) -> tuple[float, Array]:
        first, second = 0.5 * mu * (1.0 - share), 0.5 * mu * share
        energy = first * np.sum(L**2 - 1.0) + second * np.sum(L**-2 - 1.0)
        return energy, 2.0 * first * L - 2.0 * second * L**-3

    return _by_shape(shape, stretches, young, poisson)


def _yeoh(stretches: Array, young: float, poisson: float, own: Own) -> tuple[float, Array]:
    mu = lame(young, poisson)[1]

    def shape(L: Array) -> tuple[float, Array]:
        x = float(np.sum(L**2)) - 3.0
        c = (0.5 * mu, own["c2"], own["c3"])
        slope = sum((k + 1) * value * x**k for k, value in enumerate(c))
        return sum(value * x ** (k + 1) for k, value in enumerate(c)), 2.0 * slope * L

    return _by_shape(shape, stretches, young, poisson)


def _gent(stretches: Array, young: float, poisson: float, own: Own) -> tuple[float, Array]:
    mu, limit = lame(young, poisson)[1], own["chain_limit"]

    def shape(L: Array) -> tuple[float, Array]:
        left = 1.0 - (float(np.sum(L**2)) - 3.0) / limit
        return -0.5 * mu * limit * np.log(left), mu * L / left

    return _by_shape(shape, stretches, young, poisson)


# (stretches (3,), young, poisson, own parameters) -> energy, principal first Piola stresses (3,)
ISOTROPIC: dict[str, Callable[[Array, float, float, Own], tuple[float, Array]]] = {
    "neo_hooke": _neo_hooke,
    "neo_hooke_isochoric": _neo_hooke_isochoric,
    "mooney_rivlin": _mooney_rivlin,
    "yeoh": _yeoh,
    "gent": _gent,
}


# --- laws with fibres: energy of F in axes whose first is the fibre, for complex F -----------------------------------


def _triangular(F: NDArray) -> NDArray:
    """Upper triangular ``U`` with ``U^T U = F^T F``, by hand, so that complex numbers pass through."""
    C = F.T @ F
    u00 = np.sqrt(C[0, 0])
    u01, u02 = C[0, 1] / u00, C[0, 2] / u00
    u11 = np.sqrt(C[1, 1] - u01**2)
    u12 = (C[1, 2] - u01 * u02) / u11
    u22 = np.sqrt(C[2, 2] - u02**2 - u12**2)
    return np.array([[u00, u01, u02], [0.0, u11, u12], [0.0, 0.0, u22]])


def _volumetric(U: NDArray, young: float, poisson: float) -> tuple[complex, NDArray]:
    """Energy of the volume, and the triangular factor freed of it."""
    J = U[0, 0] * U[1, 1] * U[2, 2]
    return 0.25 * bulk_modulus(young, poisson) * (J**2 - 1.0 - 2.0 * np.log(J)), U * J ** (-1.0 / 3.0)


def _guccione(F: NDArray, young: float, poisson: float, own: Own) -> complex:
    """Components of the Green-Lagrange strain; ``c = 2 mu / bt``."""
    volume, U = _volumetric(_triangular(F), young, poisson)
    e = 0.5 * (U.T @ U - np.eye(3))
    bf, bt, bfs = own["exponent_fibre"], own["exponent_across"], own["exponent_shear"]
    Q = bf * e[0, 0] ** 2 + bt * (e[1, 1] ** 2 + e[2, 2] ** 2 + 2.0 * e[1, 2] ** 2)
    Q += 2.0 * bfs * (e[0, 1] ** 2 + e[0, 2] ** 2)
    return volume + lame(young, poisson)[1] / bt * (np.exp(Q) - 1.0)


def _holzapfel_ogden(F: NDArray, young: float, poisson: float, own: Own) -> complex:
    """Fibre stretch and trace from the triangular factor; slack fibres are cut off by the real part."""
    whole = _triangular(F)
    volume, U = _volumetric(whole, young, poisson)
    d = own["fibre_dispersion"]
    e = d * (np.sum(whole**2) - 3.0) + (1.0 - 3.0 * d) * (whole[0, 0] ** 2 - 1.0)
    fibres = 0.0
    if e.real > 0.0:
        k1, k2 = own["fibre_modulus"], own["fibre_exponent"]
        fibres = 0.5 * k1 / k2 * (np.exp(k2 * e**2) - 1.0)
    return volume + 0.5 * lame(young, poisson)[1] * (np.sum(U**2) - 3.0) + fibres


def _blemker(F: NDArray, young: float, poisson: float, own: Own) -> complex:
    """Shear along the fibre as ``(u01^2 + u02^2) / u00^2``; across it twice the logarithm of a principal stretch.

    That stretch is of the triangular factor's lower right block, freed of its area.
    """
    volume, U = _volumetric(_triangular(F), young, poisson)
    mu = lame(young, poisson)[1]
    along = (U[0, 1] ** 2 + U[0, 2] ** 2) / U[0, 0] ** 2
    trace = (U[1, 1] ** 2 + U[1, 2] ** 2 + U[2, 2] ** 2) / (U[1, 1] * U[2, 2])
    across = np.log(0.5 * (trace + np.sqrt(trace**2 - 4.0)))  # of the larger squared stretch
    s, so, p1, p2 = U[0, 0], own["optimal_stretch"], own["fibre_onset"], own["fibre_exponent"]
    x, end = s / so, own["straight_stretch"] / so

    def curved(at: complex) -> complex:
        return p1 * ((np.exp(p2 * (at - 1.0)) - 1.0) / p2 - (at - 1.0))

    fibre = 0.0
    if x.real > end:
        force, slope = p1 * (np.exp(p2 * (end - 1.0)) - 1.0), p1 * p2 * np.exp(p2 * (end - 1.0))
        fibre = curved(end) + force * (x - end) + 0.5 * slope * (x - end) ** 2
    elif x.real > 1.0:
        fibre = curved(x)
    ground = 1.5 * own["ground"] * mu * np.log(s) ** 2
    return volume + 0.5 * mu * (along + across**2) + own["fibre_peak"] * fibre + ground


FIBRES: dict[str, Callable[[NDArray, float, float, Own], complex]] = {
    "guccione": _guccione,
    "holzapfel_ogden": _holzapfel_ogden,
    "blemker": _blemker,
}


def _axes(a0: Array) -> Array:
    """Rotation whose columns are axes with the fibre first."""
    Q, _ = np.linalg.qr(np.column_stack([a0, np.eye(3)[:, [int(np.argmin(np.abs(a0))), int(np.argmax(np.abs(a0)))]]]))
    return Q


def at_point(name: str, F: Array, young: float, poisson: float, a0: Array) -> tuple[float, Array]:
    """Energy and first Piola stress (3, 3) of a law with the parameters of the battery, at one point."""
    own = PARAMETERS[name]
    if name in ISOTROPIC:
        R, stretches, Vt = np.linalg.svd(F)
        energy, P = ISOTROPIC[name](stretches, young, poisson, own)
        return energy, (R * P) @ Vt
    Q, step = _axes(a0), 1e-30
    P = np.empty((3, 3))
    for i in range(3):
        for k in range(3):
            moved = F.astype(complex)
            moved[i, k] += 1j * step
            P[i, k] = FIBRES[name](moved @ Q, young, poisson, own).imag / step
    return float(FIBRES[name](F.astype(complex) @ Q, young, poisson, own).real), P


def principal(name: str, F: Array, young: float, poisson: float) -> tuple[float, Array]:
    """`at_point` of an isotropic law."""
    return at_point(name, F, young, poisson, np.array([1.0, 0.0, 0.0]))


def linear_elasticity(young: float, poisson: float) -> Array:
    """Hooke's isotropic tensor ``A4[i, k, j, l]`` acting on displacement gradients, (3, 3, 3, 3)."""
    lmbda, mu = lame(young, poisson)
    d = np.eye(3)
    C = np.zeros((3, 3, 3, 3))
    for i in range(3):
        for k in range(3):
            for j in range(3):
                for m in range(3):
                    C[i, k, j, m] = lmbda * d[i, k] * d[j, m] + mu * (d[i, j] * d[k, m] + d[i, m] * d[k, j])
    return C
