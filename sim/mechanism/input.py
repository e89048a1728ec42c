"""Input: an entry of u, as the force of a joint, a wrench on a body, or the target of a servo."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.positional import few_positional


@few_positional
@dataclass(frozen=True)
class Input:
    """One entry of u: a force or torque on a joint coordinate, or a wrench on a body at its centre of mass.

        Input("knee")                                 the torque of a joint with one degree of freedom [N m]
        Input("base", dof=3)                          its fourth degree of freedom [N or N m]
        Input(body="block", force=(1, 0, 0))          u newtons along x, world axes
        Input(body="drone", force=(0, 0, 1), torque=(0, 0, 0.02), frame="body")
        Input("knee", servo="position", stiffness=80, damping=2)    u is the angle it turns to [rad]
        Input("wheel", servo="velocity", damping=5)                 u is the rate it turns at [rad/s]

    The force of a servo is kp (u - q) - kd v, or kd (u - v). Like all springs and dampers of a step it is implicit, so
    it is stable for every gain. In energies it is a spring with its rest at zero. `force_limits` hold as exactly as
    contacts; the force is then that of a drive in energies, and the damper is of first order in the time step.

    Attributes:
        joint: name of the joint (default None: the input acts on a body).
        dof: number of the degree of freedom of the joint (default 0).
        body: name of the body (default None: the input acts on a joint).
        force: (3,) force on the body per unit of the input (default zero).
        torque: (3,) torque on the body per unit of the input [m] (default zero).
        frame: axes of force and torque, "world" or "body" (default "world").
        name: name of the input (default that of the joint or the body; with several degrees of freedom, numbered).
        limits: (lo, hi) of the force or torque, or of the target of a servo, as a file gives them: default control
            limits of problems and plants; a simulator does not clip [N, N m; m, rad; m/s, rad/s] (default inf).
        speed: largest speed of the joint's coordinate, used by `dojo.constraint.SpeedLimits` only [m/s, rad/s] (default
            inf).
        servo: "position" or "velocity": the input is the target of its joint (default None: a force or torque).
        stiffness: kp of a position servo [N/m, N m/rad] (default 0).
        damping: kd of a servo [N s/m, N m s/rad] (default 0).
        force_limits: (lo, hi) of the force of a servo, both finite [N, N m] (default inf: no limits).

    Raises:
        ValueError: for both a joint and a body or neither, a servo without its gain, or a value out of range.
    """

    joint: str | None = None
    dof: int = 0
    _: KW_ONLY
    body: str | None = None
    force: ArrayLike = (0.0, 0.0, 0.0)
    torque: ArrayLike = (0.0, 0.0, 0.0)
    frame: str = "world"
    name: str = ""
    limits: tuple[float, float] = (-np.inf, np.inf)
    speed: float = np.inf
    servo: str | None = None
    stiffness: float = 0.0
    damping: float = 0.0
    force_limits: tuple[float, float] = (-np.inf, np.inf)

    def __post_init__(self) -> None:
        if (self.joint is None) == (self.body is None):
            raise ValueError("Input(...): give either a joint or body=...")
        owner, target = ("body=...", self.body) if self.joint is None else ("joint", self.joint)
        target = checks.name(f"Input({owner})", target)
        call = f"Input({checks.name_or('Input(name=...)', self.name, target)!r}"
        checks.whole_number(f"{call}, dof=...)", self.dof, 0)
        for field in ("force", "torque"):
            object.__setattr__(self, field, checks.vector(f"{call}, {field}=...)", getattr(self, field), 3))
        checks.one_of(f"{call}, frame=...)", self.frame, ("world", "body"))
        wrench = np.array([self.force, self.torque], dtype=np.float64)
        if self.body is not None and not wrench.any():
            raise ValueError(f"{call}): give a force=... or a torque=... per unit of the input")
        if self.joint is not None and wrench.any():
            raise ValueError(f"{call}): force and torque are for an input on a body")
        object.__setattr__(self, "limits", checks.bounds(f"{call}, limits=...)", self.limits))
        if not (isinstance(self.speed, int | float) and self.speed > 0.0):
            raise ValueError(f"{call}, speed=...): expected a number > 0, got {self.speed!r}")
        check_servo(call, self)

    @property
    def gain(self) -> float:
        """Force or torque on the joint per unit of u: 1, or kp or kd of a servo."""
        return {None: 1.0, "position": self.stiffness, "velocity": self.damping}[self.servo]


def check_servo(call: str, part: Input) -> None:
    """Check that gains are given for servos, and that servos act on joints."""
    for field in ("stiffness", "damping"):
        value = checks.number(f"{call}, {field}=...)", getattr(part, field), at_least=0.0)
        object.__setattr__(part, field, value)
    limits = checks.bounds(f"{call}, force_limits=...)", part.force_limits)
    object.__setattr__(part, "force_limits", limits)
    if np.isfinite(limits[0]) != np.isfinite(limits[1]):
        raise ValueError(f"{call}, force_limits=...): expected two finite numbers, got {part.force_limits!r}")
    if part.servo is None:
        if np.isfinite(limits[0]):
            raise ValueError(f"{call}, force_limits=...): for servos only; use limits=... for a force")
        if part.stiffness or part.damping:
            raise ValueError(f'{call}): stiffness and damping are for servos; add servo="position"')
        return
    checks.one_of(f"{call}, servo=...)", part.servo, ("position", "velocity"))
    if part.joint is None:
        raise ValueError(f"{call}, servo=...): a servo drives a joint")
    if part.servo == "velocity" and part.stiffness:
        raise ValueError(f"{call}, stiffness=...): a velocity servo has none; give its damping=...")
    if part.gain == 0.0:
        missing = "stiffness" if part.servo == "position" else "damping"
        raise ValueError(f"{call}, servo={part.servo!r}): expected {missing}=... above 0")
