"""Small mechanisms for the tests, by the public interface, and measures of them."""

from __future__ import annotations

from itertools import product

import numpy as np
from naive import rotation as rot

import dojo_opt as dojo

KINDS = (
    "fixed",
    "prismatic",
    "planar",
    "fixed_orientation",
    "revolute",
    "cylindrical",
    "planar_axis",
    "free_revolute",
    "orbital",
    "prismatic_orbital",
    "planar_orbital",
    "free_orbital",
    "spherical",
    "cylindrical_free",
    "planar_free",
    "floating",
    "screw",
)
PITCH = {"screw": 1.5}  # [m/rev]
LAWS = ("impact", "linear", "nonlinear")
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def tilted(angle: float, size: float = 9.81) -> np.ndarray:
    """Gravity on a slope that falls along x by `angle` [rad], in the axes of the slope."""
    return size * np.array([np.sin(angle), 0.0, -np.cos(angle)])


def block(side=0.5, mass=1.0, friction=0.5, law="nonlinear", gravity=(0.0, 0.0, -9.81), **contact) -> dojo.Mechanism:
    """A cube that touches the ground z = 0 with its eight corners."""
    contacts = [dojo.Contact("block", point=0.5 * side * c, friction=friction, law=law, **contact) for c in CORNERS]
    body = dojo.Body("block", mass, inertia=np.full(3, mass * side**2 / 6.0))
    return dojo.Mechanism([body], [dojo.Joint("floating", None, "block")], contacts, gravity=gravity)


def ball(radius=0.1, mass=1.0, friction=0.5, law="nonlinear", gravity=(0.0, 0.0, -9.81)) -> dojo.Mechanism:
    """A solid sphere on the ground z = 0, pushed by a force and a torque at its centre."""
    body = dojo.Body("ball", mass, inertia=np.full(3, 0.4 * mass * radius**2))
    inputs = [dojo.Input(body="ball", force=e) for e in np.eye(3)] + [
        dojo.Input(body="ball", torque=e) for e in np.eye(3)
    ]
    return dojo.Mechanism(
        [body],
        [dojo.Joint("floating", None, "ball")],
        [dojo.Contact("ball", radius=radius, friction=friction, law=law)],
        inputs,
        gravity,
    )


def free_body(inertia=(0.1, 0.2, 0.3)) -> dojo.Mechanism:
    """One body in space, pushed by a wrench in body axes."""
    inputs = [dojo.Input(body="body", torque=e, frame="body") for e in np.eye(3)]
    return dojo.Mechanism(
        [dojo.Body("body", 1.0, inertia)], [dojo.Joint("floating", None, "body")], inputs=inputs, gravity=np.zeros(3)
    )


def chain(kind: str, links: int = 1, gravity=(0.0, 0.0, 0.0), base="floating", **options) -> dojo.Mechanism:
    """Asymmetric bodies: the base (floating, or `kind` itself if base is None), then `links` joints of it."""
    rng = np.random.default_rng(5)
    bodies, joints = [], []
    for i in range(links + 1):
        inertia = np.diag([0.11, 0.17, 0.23]) * (1.0 + 0.3 * i)
        inertia[0, 1] = inertia[1, 0] = 0.01
        bodies.append(dojo.Body(f"body{i}", 1.0 + 0.5 * i, inertia))
        first = i == 0 and base is not None
        if first:
            joints.append(dojo.Joint(base, None, "body0"))
            continue
        offset = rot.exp(rng.normal(size=3))
        axis = rng.normal(size=3)
        joints.append(
            dojo.Joint(
                kind,
                f"body{i - 1}" if i else None,
                f"body{i}",
                parent_point=rng.normal(size=3) / 4,
                child_point=rng.normal(size=3) / 4,
                axis=axis,
                orientation=offset,
                pitch=PITCH.get(kind, 0.0),
                **options,
            )
        )
    inputs = [dojo.Input(j.name, dof=d) for j in joints[0 if base is None else 1 :] for d in range(j.nv)]
    return dojo.Mechanism(bodies, joints, inputs=inputs, gravity=gravity)


def limited(kind: str) -> dojo.Mechanism:
    """Two joints of a kind, each plain coordinate between -0.3 and 0.3 and each quaternion within a cone of 0.6."""
    joint = dojo.Joint(kind, None, "b", pitch=PITCH.get(kind, 0.0))
    ntrans, nrot = joint.ntrans, joint.nrot
    plain = ntrans + (nrot if nrot < 3 else 0)
    limits = [(-0.3, 0.3)] * plain + [None] * (ntrans + nrot - plain)
    return chain(kind, 1, base=None, damper=0.1, limits=limits or None, cone=0.6 if nrot == 3 else None)


def pendulum(links: int = 1, length=1.0, mass=1.0, **joint) -> dojo.Mechanism:
    """Rods that turn about x, hanging at zero."""
    inertia = mass * length**2 / 12.0 * np.array([1.0, 1.0, 0.01])
    up = np.array([0.0, 0.0, 0.5 * length])
    bodies = [dojo.Body(f"rod{i}", mass, inertia) for i in range(links)]
    joints = [
        dojo.Joint(
            "revolute",
            f"rod{i - 1}" if i else None,
            f"rod{i}",
            axis=(1, 0, 0),
            child_point=up,
            parent_point=-up if i else (0, 0, 0),
            **joint,
        )
        for i in range(links)
    ]
    return dojo.Mechanism(bodies, joints)


def slider(mass=1.0, gravity=(0.0, 0.0, 0.0), **joint) -> dojo.Mechanism:
    """A mass on a rail along x."""
    body = dojo.Body("mass", mass, inertia=np.full(3, 0.1))
    return dojo.Mechanism([body], [dojo.Joint("prismatic", None, "mass", axis=(1, 0, 0), **joint)], gravity=gravity)


def random_state(sim: dojo.Simulator, rng: np.random.Generator, speed: float = 1.0, spread: float = 1.0) -> np.ndarray:
    """A state away from the neutral one, on the manifold."""
    dx = np.concatenate((spread * rng.normal(size=sim.nv), speed * rng.normal(size=sim.nv)))
    x = np.array(sim.neutral())
    x[sim.nq :] = 0.0
    return sim.integrate(x, dx)


def gaps(sim: dojo.Simulator, x: np.ndarray) -> np.ndarray:
    """Distance of every contact to the ground, (..., ncontact) [m]; states stacked on leading axes."""
    mech, xs = sim.mechanism, np.atleast_2d(x)
    out = np.empty((len(xs), len(mech.contacts)))
    for t, state in enumerate(xs):
        z = sim.maximal(state)
        for c, contact in enumerate(mech.contacts):
            body = z[mech.body_names.index(contact.body)]
            center = body[:3] + rot.rotate(body[6:10], np.asarray(contact.point))
            out[t, c] = center @ np.asarray(contact.normal) - contact.radius - contact.height
    return out[0] if np.ndim(x) == 1 else out


def run(sim: dojo.Simulator, x: np.ndarray, steps: int, u: np.ndarray | None = None) -> np.ndarray:
    """States of a rollout under a constant input, (steps + 1, nx); every step must be solved."""
    us = np.zeros((steps, sim.nu)) if u is None else np.tile(u, (steps, 1))
    trajectory = sim.rollout(x, us)
    assert trajectory.status == 0, (trajectory.status, trajectory.solved_steps)
    return np.asarray(trajectory.x)


def order(errors) -> np.ndarray:
    """Orders of convergence when the time step is halved."""
    return np.log2(np.divide(errors[:-1], errors[1:]))
