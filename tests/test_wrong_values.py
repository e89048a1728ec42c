"""Every argument of parts, shapes, ground, simulators and problems, with values that it does not expect.

A call answers by a result without NaN, by a status, or by a ValueError or TypeError that names itself or the argument.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from support.refusals import check_refused
from support.wrong_values import fault, wrong

Calls = dict[str, tuple[Callable[..., Any], dict[str, Any]]]


def usual(function: Callable[..., Any], **given: Any) -> dict[str, Any]:
    """The default arguments of a function, and the given ones."""
    parameters = inspect.signature(function).parameters.values()
    named = [p for p in parameters if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
    return {p.name: p.default for p in named if p.default is not p.empty} | given


AXIS = np.linspace(-0.6, 0.6, 9)
GRID = np.sqrt(AXIS[:, None, None] ** 2 + AXIS[None, :, None] ** 2 + AXIS[None, None, :] ** 2) - 0.4
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))
SHAPES = {
    "Sphere": dojo.Sphere(0.1),
    "Box": dojo.Box(1, 2, 3),
    "Capsule": dojo.Capsule(0.1, 1.0),
    "Cylinder": dojo.Cylinder(0.1, 1.0),
    "Ellipsoid": dojo.Ellipsoid(1, 2, 3),
    "Polytope": dojo.Polytope(CORNERS),
    "SignedDistance": dojo.SignedDistance(GRID, (-0.6,) * 3, 0.15),
}
TERRAIN = dojo.Terrain(np.zeros((4, 5)))
HOPPER = dojo.models.hopper()
ARM = dojo.Body("arm", 1.0, (1.0, 1.0, 1.0))
HINGE = dojo.Joint("floating", None, "arm", name="joint")


def parts() -> Calls:
    """Constructors of bodies, joints, contacts and the like."""
    return {
        "Body": (dojo.Body, usual(dojo.Body, name="arm", inertia=(1.0, 1.0, 1.0))),
        "Joint": (dojo.Joint, usual(dojo.Joint, kind="revolute", parent=None, child="arm")),
        "Contact": (dojo.Contact, usual(dojo.Contact, body="arm")),
        "Collision": (dojo.Collision, usual(dojo.Collision, a="arm", b="leg")),
        "Input": (dojo.Input, usual(dojo.Input, joint="hip")),
        "Gear": (dojo.Gear, usual(dojo.Gear, joint="hip", other="knee")),
        "Visual": (dojo.Visual, usual(dojo.Visual, shape=SHAPES["Box"])),
        "Push": (dojo.Push, usual(dojo.Push, time=0.0, impulse=(0.0, 0.0, 1.0))),
        "Perturbation": (dojo.Perturbation, usual(dojo.Perturbation)),
        "Mechanism": (dojo.Mechanism, usual(dojo.Mechanism, bodies=[ARM], joints=[HINGE])),
        "Mechanism.add": (HOPPER.add, usual(HOPPER.add, other=dojo.models.block())),
        "Mechanism.with_terrain": (HOPPER.with_terrain, {"terrain": TERRAIN, "contacts": None, "bodies": ()}),
        "Mechanism.with_obstacle": (
            HOPPER.with_obstacle,
            {"shape": SHAPES["Box"], "bodies": [HOPPER.bodies[0].name], "name": "wall"},
        ),
        "Terrain": (dojo.Terrain, usual(dojo.Terrain, heights=np.zeros((4, 5)), plane=((0.0, 0.0, 1.0), 0.0))),
        "Terrain.slope": (dojo.Terrain.slope, usual(dojo.Terrain.slope, angle=0.1)),
        "Terrain.steps": (dojo.Terrain.steps, usual(dojo.Terrain.steps, rises=(0.1, 0.2))),
        "Polytope": (dojo.Polytope, usual(dojo.Polytope, vertices=CORNERS)),
    }


def methods() -> Calls:
    """Methods of shapes, ground and contacts."""
    found: Calls = {}
    for name, shape in SHAPES.items():
        found[f"{name}("] = type(shape), {f: getattr(shape, f) for f in ("center", "friction", "restitution", "name")}
        for method in ("inertia", "central_inertia", "principal"):
            found[f"{name}.{method}"] = getattr(shape, method), {"mass": 1.0}
        found[f"{name}.place"] = shape.place, {"points": np.zeros((4, 3))}
        found[f"{name}.support"] = shape.support, {"n": np.array([0.0, 0.0, 1.0])}
        del found[f"{name}("]
    for name in ("height", "normal"):
        found[f"Terrain.{name}"] = getattr(TERRAIN, name), {"x": np.zeros(3), "y": np.zeros(3)}
    for name in ("offset", "surface", "radius_rate"):
        found[f"Terrain.{name}"] = getattr(TERRAIN, name), {"radius": 0.1}
    contact = dojo.Contact("arm", terrain=TERRAIN)
    found["Contact.gap"] = contact.gap, {"centers": np.zeros((2, 3))}
    found["Contact.normal_at"] = contact.normal_at, {"centers": np.zeros((2, 3))}
    function = dojo.SignedDistance.from_function
    found["SignedDistance.from_function"] = (
        lambda **given: function(lambda p: np.linalg.norm(p, axis=1) - 0.4, **given),
        {"bounds": [[-0.6] * 3, [0.6] * 3], "spacing": 0.15},
    )
    return found


def simulated() -> Calls:
    """Methods of a simulator and its kinematics."""
    sim = dojo.Simulator(dojo.models.pendulum(), 0.05)
    x, u, us = np.array([0.3, 0.2]), np.zeros(1), np.zeros((3, 1))
    run, q, v = sim.rollout(x, us), x[:1], x[1:]
    kin, z = dojo.Kinematics(sim), sim.maximal(x)
    body = sim.mechanism.bodies[0].name
    return {
        "Simulator": (dojo.Simulator, usual(dojo.Simulator, mechanism=sim.mechanism)),
        "step": (sim.step, {"x": x, "u": u, "wrenches": None, "throw": False}),
        "rollout": (sim.rollout, {"x": x, "us": us, "wrenches": None, "throw": False}),
        "rollout_batch": (sim.rollout_batch, {"x0s": x[None], "us": us[None], "throw": False}),
        "linearize": (sim.linearize, {"x": x, "u": u, "kappa": None, "wrt": ("state",), "throw": False}),
        "linearize_rollout": (sim.linearize_rollout, {"x": x, "us": us, "wrt": ()}),
        "linearize_trajectory": (sim.linearize_trajectory, {"xs": run.x, "us": us}),
        "vjp": (sim.vjp, {"trajectory": run, "dL_dx": np.zeros((4, 2)), "wrt": ("state",)}),
        "parameters": (sim.parameters, {"wrt": None}),
        "with_parameters": (sim.with_parameters, {"values": {}}),
        "minimal": (sim.minimal, {"z": z, "joint_tolerance": 1e-6}),
        "integrate": (sim.integrate, {"x": x, "dx": np.zeros(2)}),
        "difference": (sim.difference, {"x1": x, "x0": x}),
        "inactive_contacts": (sim.inactive_contacts, {"x": x, "u": u}),
        "reactions": (sim.reactions, {"x": x, "u": u, "frame": "world"}),
        "stepper": (sim.stepper, {"substeps": 1, "contacts": False}),
        "step_batch": (
            sim.step_batch,
            {"X": x[None], "U": us[:1], "derivatives": False, "parameters": None, "contacts": False},
        ),
        "contact_forces": (kin.contact_forces, {"q": q, "v": v, "acceleration": v, "contacts": None}),
        "pose": (kin.pose, {"frame": body, "q": q}),
        "jacobian": (kin.jacobian, {"frame": body, "q": q}),
        "inverse_dynamics": (kin.inverse_dynamics, {"q": q, "v": v, "acceleration": v}),
    }


def planned() -> Calls:
    """Problems, options, references and closed loops."""
    sim = dojo.Simulator(dojo.models.pendulum(), 0.05)
    x, cost = np.zeros(2), [dojo.cost.Effort(1.0)]
    problem = dojo.Problem(sim, x, horizon=4, cost=cost)
    states, plant = np.zeros((5, 2)), dojo.Plant(sim)
    path = dojo.SampledReference
    found: Calls = {
        "Problem": (dojo.Problem, usual(dojo.Problem, sim=sim, start=x, horizon=4, cost=cost)),
        "Problem.cost": (problem.cost, {"xs": states, "us": np.zeros((4, 1))}),
        "Problem.violation": (problem.violation, {"xs": states, "us": np.zeros((4, 1))}),
        "with_own_terms": (problem.with_own_terms, {"sim": None, "fixed_start": True}),
        "ilqr": (dojo.Options, usual(dojo.Options)),
        "SampledReference": (path, {"time": np.arange(5.0), "rows": states, "sim": sim, "cycle": None}),
        "AnchoredReference": (dojo.AnchoredReference, usual(dojo.AnchoredReference, sim=sim, begin=x)),
        "MPC": (lambda **given: dojo.MPC(problem, **given), usual(type(dojo.MPC(problem).settings))),
        "Disturbances": (dojo.Disturbances, usual(dojo.Disturbances, nv=1)),
        "Adaptation": (dojo.Adaptation, usual(dojo.Adaptation, parameters=("friction:*",))),
        "closed_loop": (
            lambda **given: dojo.closed_loop(lambda time, x: np.zeros(1), plant, 0.1, **given),
            {"control_step": None, "fallen": None, "finished": None},
        ),
    }
    residual = {"function": residual_of_angle, "dimension": 1, "weight": 1.0, "knots": None, "scale": 1.0}
    found["ResidualCost"] = lambda **given: dojo.Problem(sim, x, 4, cost=[dojo.cost.ResidualCost(**given)]), residual
    return found


def residual_of_angle(x: Any, u: Any, out: Any) -> None:
    out[0] = x[0]


ROOMS = {"parts": parts, "methods": methods, "simulated": simulated, "planned": planned}


@pytest.mark.slow
@pytest.mark.parametrize("room", ROOMS)
def test_wrong_values_are_refused_by_name(room: str) -> None:
    faults = []
    for name, (call, usual_arguments) in ROOMS[room]().items():
        call(**usual_arguments)
        for argument, value in usual_arguments.items():
            for bad in wrong(value):
                found = fault(call, (argument, name.rpartition(".")[2]), **{**usual_arguments, argument: bad})
                if found:
                    faults.append(f"{name}({argument}={bad!r:.40}): {found:.150}")
    assert not faults, "\n".join(faults[:40])


def test_states_too_large_to_solve_have_a_status() -> None:
    """A damped robot so far away that its mass matrix is singular."""
    sim = dojo.Simulator(HOPPER, 0.02)
    for k in range(sim.nx):
        x = np.array(sim.neutral())
        x[k] = 1e150
        for result in (sim.step(x), sim.rollout(x, steps=2), sim.linearize(x)):
            end = result.x_next if isinstance(result, dojo.Jacobian) else result.x
            assert not result.success or np.isfinite(end).all(), (k, result)


ANSWERS: tuple[Any, ...] = (np.full(2, np.nan), None, "a", np.zeros(3), np.ones(2) * 1j, object(), [], np.zeros((1, 2)))


def test_wrong_answers_of_users_functions_are_refused_by_name() -> None:
    plant = dojo.Plant(dojo.Simulator(dojo.models.pendulum(), 0.05))
    for answer in ANSWERS:
        check_refused(
            lambda answer=answer: dojo.closed_loop(
                lambda time, x: np.zeros(1), plant, 0.1, reference=lambda times: answer
            ),
            "closed_loop(reference=...)",
        )
        lines = np.linspace(0.0, 1.0, 4)
        check_refused(
            lambda answer=answer, lines=lines: dojo.Terrain.from_function(lambda X, Y: answer, lines, lines),
            "Terrain.from_function(f)",
        )
    for answer in (np.zeros(2), np.zeros((2, 2))):
        for name in ("fallen", "finished"):
            check_refused(
                lambda answer=answer, name=name: dojo.closed_loop(
                    lambda time, x: np.zeros(1), plant, 0.1, **{name: lambda *given: answer}
                ),
                f"closed_loop: the answer of {name}",
            )
