"""Tasks of Gymnasium, version 5: its models, observations, rewards, ends and limits, in this simulator.

The models are the MJCF files in Gymnasium's own package, without the margins of their geoms, into which soft contact
sinks. Ground and limits of joints are hard here: a random first state below the ground is lifted onto it, and joints
beyond their limits are as far within them. Ant and humanoid observe forces of contacts, and pay for them, only where
they are asked to: these forces are those of contacts with the ground, in the last time step of an action.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.learn.contact_observation import contact_fields, model_path
from dojo_opt.learn.first_states import first_states
from dojo_opt.learn.limit_cost import with_limit_cost
from dojo_opt.learn.randomization import Randomization
from dojo_opt.learn.survival import within
from dojo_opt.learn.task import Task, never
from sim.io.mjcf.load import load_mjcf
from sim.io.mjcf.report import MjcfMechanism, MjcfWarning
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

Fields = dict[str, Any]

__all__ = [
    "DISTURBED",
    "FUNCTIONS",
    "PUSHED",
    "TRANSFER",
    "ant",
    "cartpole",
    "half_cheetah",
    "hopper",
    "humanoid",
    "pendulum",
    "walker2d",
]

_KAPPA = 1e-4  # [N s m]
_CUTOFF = 0.3  # of learning: derivatives differ by half a percent in the median, by 6 % at most
_FASTEST = 10.0  # [m/s, rad/s] observed velocity of hopper and walker
_COORDINATES = {
    "half_cheetah.xml": 9, "hopper.xml": 6, "walker2d_v5.xml": 9, "ant.xml": 15, "humanoid.xml": 24,
    "inverted_pendulum.xml": 2,
}  # fmt: skip

# Models on which policies of the half-cheetah learn to run in other simulators, too.
TRANSFER = Randomization(
    values={"friction:*": (0.3, 0.5)},
    factors={"spring": (0.8, 1.2), "damper": (0.6, 1.4), "armature": (0.85, 1.15), "mass": (0.9, 1.1)},
    substeps=(2, 2, 3, 5),
    kappa=(10.0**-3.5, 10.0**-1.7),
    noise=0.05,
    by_row=False,
)

# The same with small pushes in every action, about as large as the differences that an action makes here and in MuJoCo
# with the time step of HalfCheetah-v5 (standard deviations by benchmarks/action_differences.py [m/s, rad/s]); half
# of the epochs have that time step.
DISTURBED = replace(
    TRANSFER,
    substeps=(2, 3, 5, 5),
    by_row=True,
    pushes=(0.05, (0.1, 0.2, 0.45, 0.8, 0.9, 2.0, 0.9, 1.5, 1.5)),
)

# Models for robots that fall: steps of milliseconds carry small impulses, which ask for a small kappa.
BALANCE = Randomization(
    factors={"friction": (0.6, 1.2), "damper": (0.7, 1.3), "armature": (0.9, 1.1), "mass": (0.9, 1.1)},
    substeps=(2, 2, 4),
    kappa=(2e-5, 1e-3),
    noise=0.02,
    by_row=False,
)
# The same under small pushes, about one in twelve actions (standard deviations [m/s, rad/s]).
PUSHED = replace(BALANCE, by_row=True, pushes=(0.1, (0.05, 0.05, 0.1, 0.5, 0.5, 1.0, 0.5, 0.5, 1.0)))
COARSE = Randomization(
    factors={"friction": (0.6, 1.2), "damper": (0.7, 1.3), "mass": (0.9, 1.1)},
    substeps=(2, 2, 3),
    kappa=(10.0**-3.5, 1e-2),
    noise=0.02,
    by_row=False,
)
# Of shac; an evaluation takes as long as several epochs.
_RARELY: dict[str, Any] = {"environments": 32, "evaluations": 5, "episodes": 4}
_CHEETAH = {
    **_RARELY, "episode": 128, "rate": 2e-3, "saturation": 0.01, "randomization": TRANSFER, "cutoff": _CUTOFF,
}  # fmt: skip
_LEGGED = {**_RARELY, "epochs": 800, "horizon": 32, "gamma": 0.997, "randomization": BALANCE}
_ANT = {**_RARELY, "epochs": 2100, "episode": 128, "rate": 3e-3, "randomization": COARSE, "cutoff": _CUTOFF}


def _model(file: str) -> MjcfMechanism:
    """A model of Gymnasium's package."""
    path = model_path(file)
    with warnings.catch_warnings():  # about collisions that could be added
        warnings.simplefilter("ignore", MjcfWarning)
        mech = load_mjcf(path)
    if mech.nq != _COORDINATES[file]:
        raise RuntimeError(
            f"{file}: expected {_COORDINATES[file]} coordinates, got {mech.nq}; this Gymnasium is unknown"
        )
    # on level ground at zero, half of the margin of a contact is its height, see sim/io/mjcf/contacts.py
    bare = [replace(contact, radius=contact.radius - contact.height, height=0.0) for contact in mech.contacts]
    return replace(mech, contacts=bare)


def _tailed(skipped: int, file: str, fastest: float) -> Callable[..., Any]:
    """Observation of all coordinates of a model but the first ones, and of velocities up to a limit."""
    nq = _COORDINATES[file]

    def observation(x, out):  # type: ignore[no-untyped-def]
        for i in range(skipped, x.shape[0]):
            out[i - skipped] = x[i] if i < nq else min(max(x[i], -fastest), fastest)

    return observation


def _runs(time: float, effort: float) -> Callable[..., Any]:
    """Reward of the forward velocity, minus that of the effort."""

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        total = (after[0] - x[0]) / time
        for i in range(a.shape[0]):
            total -= effort * a[i] * a[i]
        return total

    return reward


def _task(mech: MjcfMechanism, substeps: int, time_step: float, **fields: Any) -> Task:
    """A task of a model, with its gears as limits."""
    assert mech.report is not None
    sim = Simulator(mech, time_step=time_step, kappa=_KAPPA)
    return Task(sim, substeps, low=mech.report.low, high=mech.report.high, **fields)


# -- functions, apart from the models: a wheel has them compiled, and is built without Gymnasium -----------------------


def _functions_of_half_cheetah() -> Fields:
    def survival_probability(x):  # type: ignore[no-untyped-def]
        return within(x[2], -0.8, 0.8, 0.1) * within(x[1], -0.25, np.inf, 0.03)

    return {
        "observation": _tailed(1, "half_cheetah.xml", np.inf),
        "reward": _runs(0.05, 0.1),
        "survival_probability": survival_probability,
    }


def _functions_of_hopper() -> Fields:
    def terminated(x):  # type: ignore[no-untyped-def]
        for i in range(2, x.shape[0]):
            if not abs(x[i]) < 100.0:
                return True
        return not (x[1] > 0.7 and abs(x[2]) < 0.2)

    def survival_probability(x):  # type: ignore[no-untyped-def]
        return within(x[1], 0.7, np.inf, 0.02) * within(x[2], -0.2, 0.2, 0.02)

    return {
        "observation": _tailed(1, "hopper.xml", _FASTEST),
        "reward": _runs(0.008, 1e-3),
        "terminated": terminated,
        "survival_probability": survival_probability,
    }


def _functions_of_walker2d() -> Fields:
    def terminated(x):  # type: ignore[no-untyped-def]
        return not (0.8 < x[1] < 2.0 and abs(x[2]) < 1.0)

    def survival_probability(x):  # type: ignore[no-untyped-def]
        return within(x[1], 0.8, 2.0, 0.03) * within(x[2], -1.0, 1.0, 0.08)

    return {
        "observation": _tailed(1, "walker2d_v5.xml", _FASTEST),
        "reward": _runs(0.008, 1e-3),
        "terminated": terminated,
        "survival_probability": survival_probability,
    }


def _functions_of_ant() -> Fields:
    def terminated(x):  # type: ignore[no-untyped-def]
        return not 0.2 <= x[2] <= 1.0

    def survival_probability(x):  # type: ignore[no-untyped-def]
        return within(x[2], 0.2, 1.0, 0.02)

    return {
        "observation": _tailed(2, "ant.xml", np.inf),
        "reward": _runs(0.05, 0.5),
        "terminated": terminated,
        "survival_probability": survival_probability,
    }


def _functions_of_humanoid() -> Fields:
    def terminated(x):  # type: ignore[no-untyped-def]
        return not 1.0 < x[2] < 2.0

    def survival_probability(x):  # type: ignore[no-untyped-def]
        return within(x[2], 1.0, 2.0, 0.03)

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        total = 1.25 * (after[0] - x[0]) / 0.015
        for i in range(a.shape[0]):
            total -= 0.1 * (0.4 * a[i]) ** 2  # of Gymnasium's controls, up to 0.4
        return total

    return {
        "observation": _tailed(2, "humanoid.xml", np.inf),
        "reward": reward,
        "terminated": terminated,
        "survival_probability": survival_probability,
    }


def _functions_of_cartpole() -> Fields:
    def terminated(x):  # type: ignore[no-untyped-def]
        return not abs(x[1]) <= 0.2

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        return 0.0

    return {
        "observation": _tailed(0, "inverted_pendulum.xml", np.inf),
        "reward": reward,
        "terminated": terminated,
    }


FUNCTIONS: dict[str, Callable[[], Fields]] = {  # of the tasks whose models are Gymnasium's
    "HalfCheetah": _functions_of_half_cheetah,
    "Hopper": _functions_of_hopper,
    "Walker2d": _functions_of_walker2d,
    "Ant": _functions_of_ant,
    "Humanoid": _functions_of_humanoid,
    "Cartpole": _functions_of_cartpole,
}


# -- tasks -------------------------------------------------------------------------------------------------------------


def half_cheetah() -> Task:
    """HalfCheetah-v5: run forward; 17 observations, 6 actions, 0.05 s each.

    Episodes go on where the robot lies on its back or drags its head, and many policies would learn to slide along like
    that, at a third of the speed: `shac` takes a pitch of .8 rad and a torso 25 cm low for the end.

    Returns:
        The task.
    """
    mech = _model("half_cheetah.xml")
    return _task(
        mech, 5, 0.01, observations=17, start=first_states(mech, 1, 0.1, lambda rng, n: 0.1 * rng.standard_normal(n)),
        name="HalfCheetah", settings=_CHEETAH, **_functions_of_half_cheetah(),
    )  # fmt: skip


def _legged(name: str, file: str, observations: int, limit_cost: float = 0.0) -> Task:
    """A robot in a plane that moves forward on one leg or two, and ends where it falls."""
    mech, functions = _model(file), FUNCTIONS[name]()
    limits = mech.coordinate_limits
    functions["reward"] = with_limit_cost(f"dojo.learn.{name.lower()}", functions["reward"], limits, limit_cost)
    return _task(
        mech, 4, 0.002, observations=observations,
        start=first_states(mech, 1, 5e-3, lambda rng, n: rng.uniform(-5e-3, 5e-3, n)), survival=1.0, name=name,
        settings=_LEGGED, **functions,
    )  # fmt: skip


def hopper() -> Task:
    """Hopper-v5: hop forward without falling; 11 observations, 3 actions, 0.008 s each.

    Returns:
        The task.
    """
    return _legged("Hopper", "hopper.xml", 11)


def walker2d(limit_cost: float = 0.0) -> Task:
    """Walker2d-v5: walk forward without falling; 17 observations, 6 actions, 0.008 s each.

    Policies learn to stand with their joints on the limits, which are hard here and give way in MuJoCo, so that the
    robot tips over backwards there before it has made a step. With a small cost of joints near their limits they do
    not: learn with it and under pushes (`PUSHED`), and evaluate without.

    Args:
        limit_cost: cost of an action for every radian that a joint is within .1 rad of a limit or beyond it (default
            0, as Gymnasium's; 1 is enough).

    Returns:
        The task.
    """
    return _legged("Walker2d", "walker2d_v5.xml", 17, limit_cost)


def ant(include_cfrc_ext_in_observation: bool = False, contact_cost_weight: float = 0.0) -> Task:
    """Ant-v5: run along x; 27 observations, or 105 with forces of contacts, 8 actions, 0.05 s each.

    Args:
        include_cfrc_ext_in_observation: whether the observation ends with torque and force on each of MuJoCo's 13
            bodies, clipped to 1 (default False; that of Gymnasium is True).
        contact_cost_weight: of the squares of the clipped torques and forces (default 0; that of Gymnasium is 5e-4).

    Returns:
        The task.
    """
    mech, functions = _model("ant.xml"), _functions_of_ant()
    fields = contact_fields(
        mech, "ant.xml", (functions["observation"], 27, functions["reward"]), include_cfrc_ext_in_observation,
        contact_cost_weight, 1.0, np.inf,
    )  # fmt: skip
    return _task(
        mech, 5, 0.01, start=first_states(mech, 2, 0.1, lambda rng, n: 0.1 * rng.standard_normal(n)), survival=1.0,
        name="Ant", settings=_ANT, **{**functions, **fields},
    )  # fmt: skip


def humanoid(include_cfrc_ext_in_observation: bool = False, contact_cost_weight: float = 0.0) -> Task:
    """Humanoid-v5: run along x; 45 observations, or 123 with forces of contacts, 17 actions, 0.015 s each.

    Inertias, velocities of bodies and forces of actuators are not observed, and the forward velocity is that of the
    torso instead of the centre of mass; over an episode they differ little. The knees start within their limits,
    3 degrees bent.

    Args:
        include_cfrc_ext_in_observation: whether the observation ends with torque and force on each of MuJoCo's 13
            bodies (default False; that of Gymnasium is True).
        contact_cost_weight: of the squares of the torques and forces, at most 10 in all (default 0; that of Gymnasium
            is 5e-7).

    Returns:
        The task.
    """
    mech, functions = _model("humanoid.xml"), _functions_of_humanoid()
    home = np.array(mech.neutral)
    for knee in ("right_knee", "left_knee"):
        home[mech.q_slice(knee)] = np.deg2rad(-3.0)
    fields = contact_fields(
        mech, "humanoid.xml", (functions["observation"], 45, functions["reward"]), include_cfrc_ext_in_observation,
        contact_cost_weight, np.inf, 10.0,
    )  # fmt: skip
    return _task(
        mech, 3, 0.005, start=first_states(mech, 2, 0.01, lambda rng, n: rng.uniform(-0.01, 0.01, n), home),
        survival=5.0, name="Humanoid", **{**functions, **fields},
    )  # fmt: skip


def cartpole() -> Task:
    """InvertedPendulum-v5: balance a pole on a cart; 4 observations, 1 action, 0.04 s each.

    Returns:
        The task.
    """
    mech = _model("inverted_pendulum.xml")
    return _task(
        mech, 2, 0.02, observations=4, start=first_states(mech, -1, 0.01, lambda rng, n: rng.uniform(-0.01, 0.01, n)),
        survival=1.0, name="Cartpole", **_functions_of_cartpole(),
    )  # fmt: skip


def pendulum() -> Task:
    """Pendulum-v1: swing up with little torque; 3 observations, 1 action, 0.05 s each. Speed has no limit here.

    Returns:
        The task.
    """
    rod = Body("rod", 1.0, (1.0 / 12.0, 1.0 / 12.0, 1e-3))
    pivot = Joint("revolute", None, "rod", child_point=(0.0, 0.0, -0.5), axis=(0.0, 1.0, 0.0), name="pivot")
    mech = Mechanism([rod], [pivot], [], [Input("pivot")], gravity=(0.0, 0.0, -10.0), name="pendulum")

    def observation(x, out):  # type: ignore[no-untyped-def]
        out[0], out[1], out[2] = np.cos(x[0]), np.sin(x[0]), x[1]

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        angle = (x[0] + np.pi) % (2.0 * np.pi) - np.pi
        return -(angle**2) - 0.1 * x[1] ** 2 - 0.001 * (2.0 * a[0]) ** 2

    return Task(
        Simulator(mech, time_step=0.05), 1, observation, 3, reward, np.array([-2.0]), np.array([2.0]),
        lambda rng: rng.uniform([-np.pi, -1.0], [np.pi, 1.0]), never, steps=200, name="Pendulum",
    )  # fmt: skip
