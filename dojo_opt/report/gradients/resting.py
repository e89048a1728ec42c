"""The kappa that the gradient of a resting contact needs.

A contact that carries its load m g, with the free gap d = -g h^2 and m w (d + h w) = kappa, has

    w = g h,   -h dw/dd = h w / (d + 2 h w) = 1 / (1 + b),   b = kappa / (m g^2 h^3)

so that its gradient is off by the share b.
"""

from __future__ import annotations

GRAVITY = 9.81  # [m/s^2]
STEPS = (1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)  # [s]
ALLOWED = 0.01  # bias of a resting contact that a time step is given its kappa for


def resting_kappa(mass: float, time_step: float, gravity: float = GRAVITY) -> float:
    """kappa [N s m] at which the gradient of a contact that carries `mass` [kg] is off by ALLOWED:  b m g^2 h^3."""
    return ALLOWED * mass * gravity**2 * time_step**3
