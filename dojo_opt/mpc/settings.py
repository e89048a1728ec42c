"""Settings of `MPC`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.mpc.adaptation import Adaptation
from dojo_opt.mpc.rescue import Rescue
from dojo_opt.planning.options import Options, Stage
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.short_repr import short_repr
from solvers.types import Vector

# penalties that grew with every tick would never stop; a second line search would take its time
OPTIONS = Options(halvings=4, penalty_growth=1.0, tolerance=1e-6, multiple_shooting_below=0.0)
GUESSES = ("states", "feedback", "open loop")

__all__ = ["GUESSES", "OPTIONS", "MPCSettings"]


@dataclass(frozen=True)
class MPCSettings:
    """Settings of `MPC`.

    Attributes:
        period: time between plans [s] (default None: one knot).
        kappa: smoothing of the contacts in rollouts [N s m] (default 1e-4).
        kappa_grad: smoothing of the contacts in derivatives [N s m] (default None: that of the rollouts, which saves
            a linearisation per tick).
        guess: first trajectory of a tick: "states" keeps the shifted states, "feedback" rolls out from the measured
            state under the gains, "open loop" without them (default "states").
        step_limit: changes of coordinates in an iteration, a number or (nv,), within which a tick takes the full step
            of its linear model without a rollout, the real-time iteration of Diehl, Bock and Schloeder (2005) [m, rad].
            Other steps are searched for. Ticks take less time, and plans may get worse; `inf` leaves a coordinate free.
            Multipliers of constraints change after searched steps only (default None: all steps are searched for).
        patience: ticks in a row without a new plan after which the next one begins with rollouts, whatever `guess` is;
            None never does. Manipulators get out of stalled plans, while a robot that balances may fall
            (default None).
        rescue: further starts of a tick whose plan is rejected, a `Rescue` (default None: the previous plan stays in
            force).
        gain_scale: factor of the feedback between plans; 0 applies the planned inputs without feedback (default 1).
        delay: time from a measurement to the input that it causes [s]; plans start later by this time (default 0).
        computation: time that a plan takes [s]: a plan takes effect this long after its measurement. It starts from the
            predicted state at that time, and the previous plan stays in force until then (default 0). Unlike `delay`,
            measurements act at once, through the feedback.
        servo: (kp, kd), each a number or (nu,), of servos that follow the plan in place of the planner's gains [N/m,
            N m/rad; N s/m, N m s/rad]; or the mechanism of the robot, where the springs and dampers that the model's
            driven joints have beyond it are servos: the controller then returns the forces of their actuators. See
            `dojo_opt.mpc.servo` (default None).
        feedforward: whether the planned inputs are applied, too; without them a servo is required (default True).
        time_limit: limit of the wall time of a tick, checked before each iteration [s] (default inf).
        mean_velocity: whether the velocity is computed from the coordinates one step of the model earlier (default
            True), unless the model has velocities at nodes (an order of 4 to 8, or an accuracy); see
            `dojo_opt.mpc.measurement`.
        friction: coefficient of friction that plans assume (default None: that of the model). A value below that of the
            ground is safer.
        shrinkage: reduction of the radius of one sphere or capsule of every collision in the model of the plans [m]:
            about the gap across which smooth contact presses, kappa over the impulse of a knot, so that fingers that
            follow a plan touch the object (default 0).
        learn_ground: whether to estimate the height of the ground from the stance contacts; "slope" estimates their
            plane, for a robot on a floating base, and turns the references with it (default False).
        adapt: parameters of the model that are estimated from the measurements while the controller runs, an
            `Adaptation`: plans are made with the estimate, `MPC.estimator` has it (default None).
        options: settings of the planner in a tick (default None: `OPTIONS`); its stage is made from kappa and
            kappa_grad.
        first: settings of the planner for the first plan (default None: those of `ilqr`).
        log: number of the last ticks that `MPC.log` keeps, about 1 kB each; None keeps all (default 10,000).
    """

    period: float | None = None
    kappa: float = 1e-4
    kappa_grad: float | None = None
    guess: str = "states"
    step_limit: ArrayLike | None = None
    patience: int | None = None
    rescue: Rescue | None = None
    gain_scale: float = 1.0
    delay: float = 0.0
    computation: float = 0.0
    servo: tuple[ArrayLike, ArrayLike] | Mechanism | None = None
    feedforward: bool = True
    time_limit: float = float("inf")
    mean_velocity: bool = True
    friction: float | None = None
    shrinkage: float = 0.0
    learn_ground: bool | str = False
    adapt: Adaptation | None = None
    options: Options | None = None
    first: Options | None = None
    log: int | None = 10_000

    __repr__ = short_repr

    def __post_init__(self) -> None:
        checks.one_of("MPC(guess=...)", self.guess, GUESSES)
        for name in ("options", "first"):
            value = getattr(self, name)
            if value is not None and not isinstance(value, Options):
                raise TypeError(f"MPC({name}=...): expected Options, got {value!r}")
        for name, above in (("kappa", 0.0), ("time_limit", 0.0), ("period", 0.0), ("kappa_grad", 0.0)):
            value = getattr(self, name)
            if value is not None:
                checks.number(f"MPC({name}=...)", value, above=above, finite=name.startswith("kappa"))
        for name in ("gain_scale", "delay", "computation", "shrinkage"):
            checks.number(f"MPC({name}=...)", getattr(self, name), at_least=0.0)
        if self.delay and self.computation:
            raise ValueError("MPC(delay=..., computation=...): give one of them, got both")
        if not checks.flag("MPC(feedforward=...)", self.feedforward) and self.servo is None:
            raise ValueError(
                "MPC(feedforward=False): without a servo nothing would drive the robot; give servo=(kp, kd)"
            )
        if not (isinstance(self.learn_ground, bool) or str(self.learn_ground) == "slope"):
            given = checks.shown(self.learn_ground)
            raise ValueError(f"MPC(learn_ground=...): expected False, True or 'slope', got {given}")
        if self.rescue is not None and not isinstance(self.rescue, Rescue):
            raise TypeError(f"MPC(rescue=...): expected a Rescue, got {self.rescue!r}")
        if self.adapt is not None and not isinstance(self.adapt, Adaptation):
            raise TypeError(f"MPC(adapt=...): expected an Adaptation, got {self.adapt!r}")
        for name in ("log", "patience"):
            if getattr(self, name) is not None:
                whole_number(f"MPC({name}=...)", getattr(self, name))
        if self.step_limit is not None:
            limit = checks.floats("MPC(step_limit=...)", self.step_limit)
            if limit.ndim > 1 or not np.all(limit > 0.0):
                raise ValueError(f"MPC(step_limit=...): expected numbers > 0, got {checks.shown(self.step_limit)}")
        if self.friction is not None:
            checks.number("MPC(friction=...)", self.friction, at_least=0.0)

    def steps(self, nv: int) -> Vector | None:
        """The step limit of each coordinate.

        Args:
            nv: number of coordinates' velocities.

        Returns:
            (nv,) limits [m, rad]; None without.

        Raises:
            ValueError: for a limit of another shape.
        """
        if self.step_limit is None:
            return None
        limit = checks.floats("MPC(step_limit=...)", self.step_limit)
        if limit.shape not in ((), (nv,)):
            raise ValueError(f"MPC(step_limit=...): expected a number or ({nv},), got {limit.shape}")
        return np.broadcast_to(limit, (nv,)).copy()

    def planner(self, iterations: int) -> Options:
        """Options of the planner for one tick.

        Args:
            iterations: number of iterations.

        Returns:
            The options, with a single stage.
        """
        base = self.options or OPTIONS
        stage = Stage(self.kappa, self.kappa_grad or self.kappa, base.tolerance, iterations)
        settings = {name: getattr(base, name) for name in base.__dataclass_fields__}
        return Options(**(settings | {"stages": (stage,), "time_limit": self.time_limit}))
