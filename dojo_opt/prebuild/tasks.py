"""Tasks of a build: the optional kernels one by one, then public calls on scenes that reach all other entries.

Which entries a call reaches depends neither on sizes nor on numbers, so scenes are small and rollouts short.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

import dojo_opt as dojo
from dojo_opt.learn.critic_fit import fit_network
from dojo_opt.learn.environment_names import TASKS
from dojo_opt.learn.first_states import first_states
from dojo_opt.learn.gymnasium_tasks import FUNCTIONS
from dojo_opt.learn.network import Adam, Network
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.task import compile_functions
from dojo_opt.planning.knot_costs import KnotCosts
from sim.model.state_columns import BaseState
from sim.simulator.contact_groups import ContactGroups
from sim.simulator.simulator import Simulator
from solvers.compiler.optional import OptionalKernel, optional_kernels

__all__ = ["CONTENTS", "ENVIRONMENTS", "run", "tasks"]

CONTENTS = ("all", "examples")
_FIRST = (  # the longest, and code that later tasks would compile beside them
    "interior_point:interior_point",
    "step_gradient:gradient",
    "step:step",
    "newton:newton",
    "pair_contact:pair_kinematics",
)


# -- scenes ------------------------------------------------------------------------------------------------------------


def states(sim: Simulator) -> None:
    """Properties of a state without motion."""
    x = sim.neutral()
    sim.describe()
    sim.velocity(x)
    z = sim.maximal(x)
    sim.minimal(z)
    sim.difference(sim.integrate(x, np.zeros(sim.ndx)), x)
    sim.difference(np.stack([x, x]), np.stack([x, x]))
    sim.state_from_velocity(x[: sim.nq], x[sim.nq :])
    sim.body_states(x[: sim.nq], x[sim.nq :])
    sim.energy(x), sim.kinetic_energy(x), sim.momentum(x), sim.inactive_contacts(x)
    sim.loop_gaps(x)
    if sim.mechanism.loops:
        sim.loop_rank()
        sim.close(x)


def motions(sim: Simulator) -> None:
    """Steps and rollouts, open and closed."""
    x, us = sim.neutral(), np.zeros((2, sim.nu))
    wrenches = np.zeros((2, sim.nbody, 6))
    sim.step(x)
    sim.rollout(x, us)
    sim.rollout(x, us, wrenches=wrenches)
    sim.rollout_batch(np.stack([x] * 4), np.zeros((4, 2, sim.nu)))
    k, K = np.zeros((2, sim.nu)), np.zeros((2, sim.nu, sim.ndx))
    sim.rollout_feedback(x, us, np.stack([x] * 3), ks=k, Ks=K)


def derivatives(sim: Simulator) -> None:
    """Of steps and rollouts, by state and input."""
    x, us = sim.neutral(), np.zeros((2, sim.nu))
    sim.linearize(x, us[0], kappa=1e-3)
    sim.linearize(x, us[0], wrenches=np.zeros((sim.nbody, 6)))
    sim.linearize_rollout(x, us, kappa=1e-3)
    sim.linearize_trajectory(np.stack([x] * 3), us, kappa=1e-3)
    sim.linearize_trajectory(np.stack([x] * 100), np.zeros((99, sim.nu)), kappa=1e-3)
    sim.vjp((np.stack([x] * 3), us), np.zeros((3, sim.ndx)), kappa=1e-3)


def divisions(sim: Simulator) -> None:
    """Steps that turn a body too far, and their derivatives."""
    x, us = sim.neutral(), np.zeros((2, sim.nu))
    x[sim.nq :] = 4.0 / sim.time_step
    sim.rollout(x, us)
    sim.linearize(x, us[0])
    sim.linearize(x, us[0], wrt=("mass",))
    sim.reactions(x[None], us[:1])


def parameters(sim: Simulator) -> None:
    """Features of order 2 only: reactions, derivatives by maximal coordinates and by parameters."""
    x, us = sim.neutral(), np.zeros((2, sim.nu))
    sim.reactions(x[None], us[:1])
    sim.linearize_maximal(sim.maximal(x), us[0], kappa=1e-3)
    kinds = tuple(dict.fromkeys(name.split(":")[0].split("[")[0] for name in sim.parameters().names))
    sim.linearize(x, us[0], wrt=kinds)
    sim.linearize_rollout(x, us, wrt=kinds)
    sim.vjp(sim.rollout(x, us), np.zeros((3, sim.ndx)), wrt=("state", "input", *kinds))


def _every(sim: Simulator) -> None:
    for calls in (states, motions, derivatives, parameters):
        calls(sim)


def _pendulum(calls: Callable[[Any], None], order: int = 2) -> None:
    """Calls on the least that moves: their entries are the same for all scenes."""
    calls(dojo.Simulator(dojo.models.pendulum(), time_step=0.01, order=order))


def _divisions() -> None:
    """Divided steps without dampers, and with dampers whose impulses carry over."""
    for damper in (0.0, 0.01):
        divisions(dojo.Simulator(dojo.models.pendulum(damper=damper), time_step=0.01))


def _learning() -> None:
    """Rows of a batch, with and without derivatives, and the action of a policy."""
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
    X, U = np.stack([sim.neutral()] * 4), np.zeros((4, sim.nu))
    for derivatives in (False, True):
        sim.step_batch(X, U, 2, derivatives=derivatives)
    found = sim.step_batch(X, U, 2, contacts=True)
    assert found.contacts is not None
    ContactGroups(sim, ()).wrenches(found.x, found.contacts)
    network = Network((3, 4, 1), "tanh")
    weights, x = np.zeros(network.count), np.zeros((2, 3))
    network.backward(weights, network.forward(weights, x)[1], np.zeros((2, 1)), np.zeros(network.count))
    samples = np.zeros((2, 3)), np.zeros(2)
    fit_network(network, weights, Adam(network.count, (0.9, 0.9)), samples, [np.arange(2)], 1e-3, 1.0)
    LearnedPolicy(network, np.zeros(network.count), np.zeros(3), np.ones(3), None).action(np.zeros(3))


def _models() -> None:
    for entry in dojo.models.catalog():
        sim = dojo.Simulator(entry.build(), time_step=0.01)
        sim.linearize_maximal(sim.maximal(sim.neutral()))
        for calls in (states, motions, derivatives):
            calls(sim)


def _accurate(ground: bool) -> None:
    """Calls on a ball, or a pendulum, with steps of an accuracy."""
    mech = dojo.models.sphere() if ground else dojo.models.pendulum()
    sim = dojo.Simulator(mech, time_step=0.01, accuracy=1e-3)
    motions(sim)
    derivatives_of_order(sim)
    sim.rollout(sim.neutral(), steps=2).at([0.005])


def _accurate_loops() -> None:
    """Calls on a closed loop, with extrapolated steps of an accuracy."""
    sim = dojo.Simulator(dojo.models.fourbar(), time_step=0.05, accuracy=1e-5)
    motions(sim)
    derivatives_of_order(sim)


def derivatives_of_order(sim: Simulator) -> None:
    """Of steps and sweeps at the kappa of the simulator."""
    x, us = sim.neutral(), np.zeros((2, sim.nu))
    sim.linearize(x, us[0])
    sim.vjp(sim.rollout(x, us), np.zeros((3, sim.ndx)))


def _flight(calls: Callable[[Any], None], order: int) -> None:
    """Calls on a body above the ground, with steps of higher order."""
    foot = dojo.Contact("b", point=(0.0, 0.0, -0.1))
    above = (0.0, 0.0, 3.0, 1.0, 0.0, 0.0, 0.0)
    mech = dojo.Mechanism(
        [dojo.Body("b", 1.0, (0.1, 0.2, 0.3))], [dojo.Joint("floating", None, "b")], [foot], neutral={"b": above}
    )
    calls(dojo.Simulator(mech, time_step=0.01, order=order))


def _grounds() -> None:
    hill = dojo.Terrain.from_function(
        lambda x, y: 0.1 * np.sin(x) + 0.1 * np.cos(y), np.linspace(-2, 2, 9), [-1.0, 0.0, 1.0]
    )
    turning = {"torsional_friction": 0.01, "rolling_friction": 0.01, "restitution": 0.5}
    for more in ({}, {"terrain": hill}, {"law": "linear"}, {"law": "impact"}, {"restitution": 0.5}, turning):
        foot = dojo.Contact("ball", radius=0.1, **more)
        mech = dojo.Mechanism([dojo.Body("ball", 1.0, (0.1, 0.1, 0.1))], [dojo.Joint("floating", None, "ball")], [foot])
        _every(dojo.Simulator(mech, time_step=0.01))


def _pairs() -> None:
    apart = {"b": (0.15, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)}
    joints = [dojo.Joint("floating", None, name) for name in "ab"]
    solids = (dojo.Sphere(0.1), dojo.Box(0.1, 0.1, 0.1), dojo.Cylinder(0.1, 0.1))
    touching = [dojo.Collision("a", "b", shape, shape) for shape in (*solids, dojo.String(1.0))]
    for collision in touching:
        bodies = [dojo.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in "ab"]
        _every(dojo.Simulator(dojo.Mechanism(bodies, joints, collisions=[collision], neutral=apart), time_step=0.01))


def _joints() -> None:
    body, point = dojo.Body("a", 1.0, (0.1, 0.2, 0.3)), (0.0, 0.0, -0.1)
    joints = (
        dojo.Joint("spherical", None, "a", cone=0.5, spring=1.0, damper=0.1, child_point=point),
        dojo.Joint("orbital", None, "a", spring=1.0, damper=0.1, child_point=point),
        dojo.Joint("revolute", None, "a", limits=(-0.5, 0.5), child_point=point),
        dojo.Joint("revolute", None, "a", friction=0.1, child_point=point),
    )
    for joint in joints:
        _every(dojo.Simulator(dojo.Mechanism([body], [joint]), time_step=0.01))


def _loops() -> None:
    for build in (dojo.models.fourbar, dojo.models.delta):
        _every(dojo.Simulator(build(), time_step=0.01))


# -- planning ----------------------------------------------------------------------------------------------------------


def _swingup() -> None:
    dojo.ilqr(dojo.problems.swingup(), max_iterations=4)


def _hop() -> None:
    plan = dojo.ilqr(dojo.problems.hop())
    dojo.tracking_gains(plan.problem, plan)
    KnotCosts(plan.problem)(0, plan.x, plan.u)
    dojo.Plant(plan.problem.sim).hold(plan.u[0], 1)


def _plans() -> None:
    for problem in (dojo.problems.block(), dojo.problems.trot(), dojo.problems.jump()):
        dojo.ilqr(problem, max_iterations=4)


def _task_space() -> None:
    """Costs and constraints in task space: their entries are the same for all scenes."""
    sim = dojo.Simulator(dojo.models.block(), time_step=0.01)
    name, x, us = sim.mechanism.body_names[0], sim.neutral(), np.zeros((2, sim.nu))
    box, ball = dojo.Box(0.1, 0.1, 0.1), dojo.Sphere(0.1, center=(1.0, 0.0, 1.0))
    cost = dojo.cost
    tasks = (
        *(cost.Frame(name, x[:3], x[BaseState.QUATERNION]), cost.Velocity(name), cost.CenterOfMass()),
        *(cost.Momentum(), cost.Slip()),
        *(cost.ContactForce(), cost.FrictionUse(), cost.Clearance(name, ball, 0.1, box)),
    )
    problem = dojo.Problem(sim, x, 2, cost=tasks)
    g, H = np.zeros((3, sim.ndx + sim.nu)), np.zeros((3, sim.ndx + sim.nu, sim.ndx + sim.nu))
    for term in problem.costs:
        term.expand(np.stack([x] * 3), us, g, H)


def _users() -> None:
    """Kernels that loops around functions of the user call."""
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
    x = sim.neutral()

    def residual(x: Any, u: Any, out: Any) -> None:
        out[0] = x[0]

    tip = dojo.Kinematics(sim).compiled("pose", sim.mechanism.body_names[0])
    tip(x, np.zeros(7))
    (term,) = dojo.Problem(sim, x, 1, cost=dojo.cost.ResidualCost(residual, 1)).costs
    term.expand(np.stack([x] * 2), np.zeros((1, 1)), np.zeros((2, 3)), np.zeros((2, 3, 3)))


def _environments(batches: bool) -> None:
    """Functions of the tasks of Gymnasium's registry, those of Go2 depend on its file; and their first states."""
    first_states(dojo.models.sphere(), 2, 0.1, lambda rng, count: np.zeros(count))(np.random.default_rng(0))
    for name, (module, function, _) in TASKS.items():
        if name in FUNCTIONS:
            compile_functions(**FUNCTIONS[name](), batches=batches)
        elif name != "Go2":
            task = getattr(import_module(f"dojo_opt.learn.{module}"), function)()
            compile_functions(
                task.observation, task.reward, task.terminated, task.survival_probability, batches=batches
            )


def _policy_gradients() -> None:
    """Rollouts of a policy, their gradient, and the fit of a critic: the same code for every task."""
    few: dict[str, Any] = {"epochs": 1, "evaluations": 1, "episodes": 1}
    dojo.learn.shac(dojo.learn.quadrotor(), environments=2, horizon=2, hidden=(4,), **few)


def _mpc() -> None:
    for make in (dojo.tasks.hopper_mpc, dojo.tasks.quadruped_mpc):
        mpc = make()
        dojo.closed_loop(mpc, dojo.tasks.plant(mpc), 0.1)


_CALLS: dict[str, Callable[[], None]] = {  # the first one to reach an entry compiles it; those below are disjoint
    "accuracy": lambda: _accurate(False),
    "parameters": lambda: _pendulum(parameters),
    "derivatives": lambda: _pendulum(derivatives),
    "plan": lambda: _swingup(),
    "motions": lambda: _pendulum(motions),
    "states": lambda: _pendulum(states),
    "learning": lambda: _learning(),
    "divisions": lambda: _divisions(),
    "flight": lambda: _flight(motions, 8),
    "states of higher order": lambda: _pendulum(states, 4),
    "motions of higher order": lambda: _pendulum(motions, 4),
    "accuracy on the ground": lambda: _accurate(True),
    "derivatives of a flight": lambda: _flight(derivatives, 8),
    "derivatives of higher order": lambda: _pendulum(derivatives, 4),
}
_BEYOND = {  # needed neither by the programs of README and guide nor by the models
    "accuracy through loops": _accurate_loops,
    "batches of environments": lambda: _environments(True),
}
_SCENES: dict[str, Callable[[], None]] = {  # which the above leave little to compile for
    "policy gradients": _policy_gradients,
    "hop": _hop,
    "joints": _joints,
    "grounds": _grounds,
    "pairs": _pairs,
    "loops": _loops,
    "models": _models,
    "plans": _plans,
    "closed loops": _mpc,
    "task space": _task_space,
    "functions of the user": _users,
    "environments": lambda: _environments(False),
}


# -- tasks -------------------------------------------------------------------------------------------------------------


ENVIRONMENTS = ("environments", "batches of environments", "policy gradients")


def _kernels() -> dict[str, OptionalKernel]:
    """Kernels that a scene, or a function of the user, may link, by name."""
    import_module("sim.simulator.link_kernels")
    import_module("sim.simulator.task_space.compiled_kinematics")
    return {kernel.name: kernel for kernel in optional_kernels()}


def tasks(content: str) -> list[str]:
    """Names of the tasks of a build, the longest first.

    Args:
        content: "all", or "examples": the programs of README and guide, and the models.
    """
    first = [next(name for name in _kernels() if name.endswith(f".{end}")) for end in _FIRST]
    others = [name for name in _kernels() if name not in first]
    return [*first, *(_BEYOND if content == "all" else ()), *_CALLS, *others, *_SCENES]


def run(task: str) -> None:
    """Carry out one task: its kernels are compiled, or loaded."""
    calls = _CALLS | _BEYOND | _SCENES
    if task in calls:
        calls[task]()
    else:
        _kernels()[task].address()
