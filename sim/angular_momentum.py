"""Angular momentum of a body over an interval, from its discrete Lagrangian, and its Jacobian.

L_d = (2/h) s.J s psi(c)        of the rotation (c, s), c = cos(angle/2) > 0; see dynamics.py for psi
"""

from __future__ import annotations

from sim.model import Matrix
from sim.rotation import Mat3, Vec3, rotate
from solvers.compiler import kernel


@kernel
def spin(
    J: Matrix, i: int, c: float, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float, float]:
    """m = c J s + s x J s,  k = s.J s  and J s, for s = (x, y, z): returns (m, J s, k) as seven numbers."""
    jx, jy, jz = rotate(J, i, x, y, z)
    k = x * jx + y * jy + z * jz
    return c * jx + y * jz - z * jy, c * jy + z * jx - x * jz, c * jz + x * jy - y * jx, jx, jy, jz, k


@kernel
def angular_momentum(J: Matrix, i: int, h: float, c: float, x: float, y: float, z: float) -> Vec3:
    """P = (2/h) (psi m - k psi'/2 s): momentum at the start of an interval with rotation (c, s).

    The momentum at the end of an interval, with J at the end, is -P(c, -s).   J: (n, 9) world axes.
    """
    psi = 2.0 / 3.0 + 1.0 / (3.0 * c * c)
    dpsi = -2.0 / (3.0 * c * c * c)
    mx, my, mz, _, _, _, k = spin(J, i, c, x, y, z)
    a = 2.0 / h * psi
    b = -k * dpsi / h
    return a * mx + b * x, a * my + b * y, a * mz + b * z


@kernel
def angular_momentum_jacobian(J: Matrix, i: int, h: float, c: float, x: float, y: float, z: float) -> Mat3:
    """dP/dphi, phi the world rotation of the end of the interval:

    h dP/dphi = psi ((c J + [s] J - [J s]) (c I - [s]) - J s s^T)
                - psi' (m s^T + s m^T + k/2 (c I - [s])) + (k/2) psi'' s s^T
    """
    psi = 2.0 / 3.0 + 1.0 / (3.0 * c * c)
    dpsi = -2.0 / (3.0 * c * c * c)
    mx, my, mz, jx, jy, jz, k = spin(J, i, c, x, y, z)
    e = k / (c * c * c * c)  # k psi'' / 2
    # T = c J + [s] J - [J s]
    t00 = c * J[i, 0] - z * J[i, 3] + y * J[i, 6]
    t01 = c * J[i, 1] - z * J[i, 4] + y * J[i, 7] + jz
    t02 = c * J[i, 2] - z * J[i, 5] + y * J[i, 8] - jy
    t10 = c * J[i, 3] + z * J[i, 0] - x * J[i, 6] - jz
    t11 = c * J[i, 4] + z * J[i, 1] - x * J[i, 7]
    t12 = c * J[i, 5] + z * J[i, 2] - x * J[i, 8] + jx
    t20 = c * J[i, 6] - y * J[i, 0] + x * J[i, 3] + jy
    t21 = c * J[i, 7] - y * J[i, 1] + x * J[i, 4] - jx
    t22 = c * J[i, 8] - y * J[i, 2] + x * J[i, 5]
    g = -0.5 * dpsi * k
    a = psi / h
    b = -dpsi / h
    gc = g * c / h
    gx, gy, gz = g * x / h, g * y / h, g * z / h
    e /= h
    return (
        a * (c * t00 - t01 * z + t02 * y - jx * x) + 2.0 * b * mx * x + e * x * x + gc,
        a * (c * t01 + t00 * z - t02 * x - jx * y) + b * (mx * y + x * my) + e * x * y + gz,
        a * (c * t02 - t00 * y + t01 * x - jx * z) + b * (mx * z + x * mz) + e * x * z - gy,
        a * (c * t10 - t11 * z + t12 * y - jy * x) + b * (my * x + y * mx) + e * y * x - gz,
        a * (c * t11 + t10 * z - t12 * x - jy * y) + 2.0 * b * my * y + e * y * y + gc,
        a * (c * t12 - t10 * y + t11 * x - jy * z) + b * (my * z + y * mz) + e * y * z + gx,
        a * (c * t20 - t21 * z + t22 * y - jz * x) + b * (mz * x + z * mx) + e * z * x + gy,
        a * (c * t21 + t20 * z - t22 * x - jz * y) + b * (mz * y + z * my) + e * z * y - gx,
        a * (c * t22 - t20 * y + t21 * x - jz * z) + 2.0 * b * mz * z + e * z * z + gc,
    )
