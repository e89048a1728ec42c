"""Ten coordinates of mass, centre of mass and inertia, in which every value is a physical body.

Mass m, first and second moments of a distribution of mass are a positive definite 4 x 4 matrix, and each of those is
U U^T of one upper triangle U with a positive diagonal (Rucker and Wensing, Smooth Parameterization of Rigid-Body
Inertia, RA-L 2022). With coordinates a, d (3), s (3), t (3):

    m = exp(2 a),   centre c = t,   C = m L L^T about it,   L = [e^d1 s1 s3; 0 e^d2 s2; 0 0 e^d3],   I = tr(C) 1 - C

C is the second moment about the centre, the integral of x x^T: where it is positive definite, I has principal moments
of which none exceeds the sum of the others.
"""

from __future__ import annotations

import numpy as np

from sim.mechanism import checks
from solvers.types import Floats

SIZE = 10
LABELS = ("a", "d0", "d1", "d2", "s0", "s1", "s2", "t0", "t1", "t2")
_ABOVE = ((0, 1), (1, 2), (0, 2))  # of s
_DIAGONAL, _OFF_DIAGONAL, _CENTER = slice(1, 4), slice(4, 7), slice(7, 10)  # of the coordinates, after the mass
_CENTER_OF_BODY, INERTIA = slice(1, 4), slice(4, 10)  # of a body, after the mass
_ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx, yy, zz, xy, xz, yz


def coordinates(call: str, mass: float, inertia: Floats) -> Floats:
    """(10,) of a body with its centre at the origin; inertia (6,): xx, yy, zz, xy, xz, yz [kg m^2].

    ValueError: a flat body, of which two principal moments are together as large as the third, has none.
    """
    checks.number(f"{call}: mass", mass, above=0.0)
    I = np.zeros((3, 3))
    for (r, c), x in zip(_ENTRIES, inertia, strict=True):
        I[r, c] = I[c, r] = x
    C = 0.5 * np.trace(I) * np.eye(3) - I
    least = float(np.linalg.eigvalsh(C)[0])
    if least <= 1e-12 * float(np.trace(I)):
        raise ValueError(f"{call}: the body is flat (least second moment {least:g} kg m^2); give it a thickness")
    L = np.linalg.cholesky(C[::-1, ::-1] / mass)[::-1, ::-1]
    out = np.zeros(SIZE)
    out[0], out[_DIAGONAL], out[_OFF_DIAGONAL] = 0.5 * np.log(mass), np.log(np.diag(L)), [L[r, c] for r, c in _ABOVE]
    return out


def scale(theta: Floats) -> Floats:
    """(10,) sizes of changes: 1 for the logarithms, the largest radius of gyration for the lengths."""
    out = np.ones(SIZE)
    out[_OFF_DIAGONAL] = out[_CENTER] = np.exp(theta[_DIAGONAL].max())
    return out


def body_of(theta: Floats) -> tuple[Floats, Floats]:
    """Mass, centre (3) and inertia (6) in a row, (10,), and their derivative by the coordinates (10, 10)."""
    m = np.exp(2.0 * theta[0])
    L = np.diag(np.exp(theta[_DIAGONAL]))
    for (r, c), s in zip(_ABOVE, theta[_OFF_DIAGONAL], strict=True):
        L[r, c] = s
    C = m * L @ L.T
    values, J = np.concatenate([[m], theta[_CENTER], _inertia(C)]), np.zeros((SIZE, SIZE))
    J[0, 0], J[INERTIA, 0] = 2.0 * m, 2.0 * values[INERTIA]
    J[_CENTER_OF_BODY, _CENTER] = np.eye(3)
    for k, (r, c) in enumerate((*((i, i) for i in range(3)), *_ABOVE), start=1):
        D = np.zeros((3, 3))
        D[r, c] = L[r, c] if r == c else 1.0
        J[INERTIA, k] = _inertia(m * (D @ L.T + L @ D.T))
    return values, J


def _inertia(C: Floats) -> Floats:
    """tr(C) 1 - C as xx, yy, zz, xy, xz, yz."""
    I = np.trace(C) * np.eye(3) - C
    return np.array([I[r, c] for r, c in _ENTRIES])
