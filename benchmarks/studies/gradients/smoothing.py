"""Cost of smoothing: the derivative of a step at kappa against hard contact, which has a closed form for a point mass.

A point of 1 kg over the ground, one step of 20 ms; with the free velocity f = v + g h and the normal impulse p,

    flying    v+ = f
    sticking  v+ = (0, 0, -z/h)
    sliding   v+ = (f_x - mu p / m, 0, -z/h),   p = m (-z/h - f_z),   moving along x
    touching  z + h f_z = 0: the hard answer jumps; the mean of flying and pressed is the derivative at every kappa

The benefit is the distance at which a contact is felt, of the size sqrt(kappa h / m). The error at a contact that
carries its load m g depends far more on the time step: with the free gap d = -g h^2 and m w (d + h w) = kappa,

    w = g h,   -h dw/dd = h w / (d + 2 h w) = 1 / (1 + b),   b = kappa / (m g^2 h^3)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import dojo_opt as dojo
from dojo_opt.report.gradients.resting import GRAVITY
from sim.simulator.simulator import Simulator
from solvers.types import Matrix, Vector

H, MASS, FRICTION = 0.02, 1.0, 0.5
FLIGHT = 0.01  # [m] gap after the step of the flying point
KAPPAS = tuple(float(kappa) for kappa in 10.0 ** np.arange(-10.0, -0.5, 0.5))
FELT = 0.01  # of 1/h: a contact is felt where the gradient of the velocity by the height reaches this
_TOLERANCE = 1e-14


class Regime(NamedTuple):
    """A state of the point, and the hard derivative of its next velocity."""

    name: str
    height: float  # [m]
    velocity: tuple[float, float, float]  # [m/s]
    exact: Matrix  # (3, 6) by position and velocity; touching: (1, 6) the normal row, the others are not defined


def regimes() -> list[Regime]:
    """Flying, touching, sticking, sliding."""
    fall = GRAVITY * H**2
    zero, one = np.zeros((3, 3)), np.eye(3)
    normal = np.array([0.0, 0.0, -1.0 / H, 0.0, 0.0, 0.0])
    sticking = np.zeros((3, 6))
    sticking[2] = normal
    sliding = sticking.copy()
    sliding[0] = [0.0, 0.0, FRICTION / H, 1.0, 0.0, FRICTION]  # mu dp/m = mu (-dz/h - df_z)
    sliding[1, 4] = 1.0 - FRICTION * GRAVITY * H  # friction turns with the velocity of 1 m/s: 1 - mu p / m v_x
    touching = 0.5 * (normal + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
    return [
        Regime("flying, 10 mm above", FLIGHT + fall, (0.0, 0.0, 0.0), np.concatenate([zero, one], axis=1)),
        Regime("touching", fall, (0.0, 0.0, 0.0), touching[None]),
        Regime("sticking", 0.0, (0.05, 0.0, 0.0), sticking),
        Regime("sliding", 0.0, (1.0, 0.0, 0.0), sliding),
    ]


def bias(regime: Regime, kappas: tuple[float, ...] = KAPPAS) -> Vector:
    """Largest error of d(next velocity)/d(position / h, velocity) at every kappa; the entries are numbers around 1."""
    errors = []
    unit = np.array([H, H, H, 1.0, 1.0, 1.0])
    for kappa in kappas:
        A = _gradient(kappa, regime.height, regime.velocity)
        found = A[6:9][:, [0, 1, 2, 6, 7, 8]]
        errors.append(np.abs((found[-len(regime.exact) :] - regime.exact) * unit).max())
    return np.array(errors)


def reach(kappa: float) -> float:
    """Gap after a free step [m] at which the point still feels the ground: its gradient there is FELT / h.

        m w (d + h w) = kappa,  w = v+ - v_free   gives   -dw/dd = w / (d + 2 h w)

    which is FELT / h at w = FELT d / h (1 - 2 FELT), and with that  m w (d + h w) = kappa  gives d.
    """
    share = FELT / (1.0 - 2.0 * FELT)  # h w / d
    return float(np.sqrt(kappa * H / (MASS * share * (1.0 + share))))


def resting_bias(kappa: float, time_step: float) -> float:
    """1 + h d(next vertical velocity)/d(height) of the point that lies on the ground: 0 for hard contact."""
    sim = _simulator(kappa, time_step)
    x = np.r_[0.0, 0.0, kappa / (MASS * GRAVITY * time_step), 1.0, np.zeros(9)]  # it floats by kappa / impulse
    return float(1.0 + time_step * sim.linearize(x, kappa=kappa)[0][8, 2])


def gradient_at(kappa: float, gap: float) -> float:
    """-h d(next vertical velocity)/d(height), by our step, where a free step would end `gap` above the ground."""
    return float(-H * _gradient(kappa, gap + GRAVITY * H**2, (0.0, 0.0, 0.0))[8, 2])


def _gradient(kappa: float, height: float, velocity: tuple[float, float, float]) -> Matrix:
    x = np.r_[0.0, 0.0, height, 1.0, np.zeros(3), velocity, np.zeros(3)]
    return _simulator(kappa, H).linearize(x, kappa=kappa)[0]


def _simulator(kappa: float, time_step: float) -> Simulator:
    point = dojo.Mechanism(
        [dojo.Body("point", MASS, inertia=np.full(3, 1e-2))],
        [dojo.Joint("floating", None, "point")],
        [dojo.Contact("point", friction=FRICTION)],
        gravity=(0.0, 0.0, -GRAVITY),
    )
    return Simulator(point, time_step=time_step, kappa=kappa, tolerance=_TOLERANCE)
