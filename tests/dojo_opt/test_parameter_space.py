"""Parameters as a vector for a fit: its meaning, its derivatives, and fits that stay among possible bodies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

import dojo_opt as dojo
from dojo_opt.identification import inertia_coordinates
from support.jacobians import check_jacobian

INERTIA = np.array([0.02, 0.03, 0.04, 0.004, -0.002, 0.003])  # xx, yy, zz, xy, xz, yz


def matrix(entries: np.ndarray) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def block(friction: float = 0.5, inertia: np.ndarray = INERTIA, mass: float = 2.0) -> dojo.Simulator:
    """A block that is thrown about by a force and a torque, on four feet."""
    feet = [dojo.Contact("block", (x, y, -0.1), 0.02, friction=friction) for x in (-0.2, 0.2) for y in (-0.1, 0.1)]
    inputs = [dojo.Input(body="block", force=e) for e in np.eye(3)]
    inputs += [dojo.Input(body="block", torque=e) for e in np.eye(3)]
    body = dojo.Body("block", mass, matrix(inertia))
    mech = dojo.Mechanism([body], [dojo.Joint("floating", None, "block")], feet, inputs)
    return dojo.Simulator(mech, time_step=0.02, kappa=1e-4, tolerance=1e-12)


def test_coordinates_give_back_the_body_and_its_derivative() -> None:
    theta = inertia_coordinates.coordinates("test", 2.0, INERTIA)
    values, J = inertia_coordinates.body_of(theta)
    np.testing.assert_allclose(values, [2.0, 0.0, 0.0, 0.0, *INERTIA], atol=1e-14)
    there = theta + np.random.default_rng(0).normal(size=10)
    values, J = inertia_coordinates.body_of(there)
    check_jacobian(lambda d: inertia_coordinates.body_of(there + d)[0] - values, J, np.zeros(10), np.add, 1e-9)


def test_every_coordinate_is_a_body(rng: np.random.Generator) -> None:
    """Twelve decades of masses and shapes: `Body` takes them all."""
    for _ in range(200):
        theta = rng.normal(size=10) * (3.0, 1.5, 1.5, 1.5, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
        values, _ = inertia_coordinates.body_of(theta)
        dojo.Body("it", float(values[0]), matrix(values[4:]))


def test_a_flat_body_is_refused() -> None:
    plate = block(inertia=np.array([0.01, 0.02, 0.03, 0.0, 0.0, 0.0]))
    with pytest.raises(ValueError, match=r"body 'block': the body is flat"):
        dojo.ParameterSpace(plate, bodies=["block"])


def charts() -> tuple[dojo.ParameterSpace, np.ndarray]:
    """All that is not its own coordinate, and some that are; and a point away from the start."""
    sim = block()
    arm = dojo.Body("arm", 0.5, (0.01, 0.012, 0.013))
    ends = {"parent_point": (0.1, 0, 0.1), "child_point": (0, 0, -0.2)}
    joint = dojo.Joint("revolute", "block", "arm", axis=(0, 1, 0), damper=0.5, **ends)
    stone = dojo.Polytope.about_centroid([(0.1, 0, 0), (-0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.1), (0, -0.05, -0.1)])
    ground = dojo.Collision("arm", shape_a=stone, shape_b=dojo.HalfSpace())
    mech = dojo.Mechanism(
        [*sim.mechanism.bodies, arm], [*sim.mechanism.joints, joint], sim.mechanism.contacts, collisions=[ground]
    )
    names = ("friction:*", "damper:arm", "axis:arm", "orientation:arm", "contact_normal:block_0", "size_a", "com:arm")
    sim = dojo.Simulator(mech, time_step=0.02, kappa=1e-3, tolerance=1e-13)
    space = dojo.ParameterSpace(sim, names, bodies=["block"])
    moved = space.values + 0.1 * np.random.default_rng(3).uniform(0.1, 1.0, size=len(space.values))
    return space, moved


@pytest.mark.slow
def test_derivatives_by_coordinates() -> None:
    """Of a step and of a rollout, away from where the space was made."""
    space, theta = charts()
    sim = space.simulator(theta)
    x = sim.neutral()
    x[2] += 0.12
    x[sim.nq :] = np.random.default_rng(1).normal(size=sim.nv)
    here = sim.step(x).x
    J = space.chain(theta, sim.linearize(x, wrt=space.wrt))
    assert J.shape == (sim.ndx, len(space.labels))
    directions = np.random.default_rng(4).normal(size=(4, len(theta)))  # each coordinate is in all of them
    along = lambda s: theta + s @ directions  # noqa: E731
    stepped = lambda s: sim.difference(space.simulator(along(s)).step(x).x, here)  # noqa: E731
    check_jacobian(stepped, J @ directions.T, np.zeros(4), np.add)
    xs, line = sim.linearize_rollout(x, np.zeros((3, sim.nu)), wrt=space.wrt)
    np.testing.assert_allclose(space.chain(theta, line.parameters)[0], J, atol=1e-9 * np.abs(J).max())
    blocks = np.concatenate([line.parameters[name] for name in space.wrt], axis=2)
    np.testing.assert_allclose((blocks @ space.slopes(theta))[0], J, atol=1e-9 * np.abs(J).max())
    loss = np.zeros((4, sim.ndx))
    loss[1] = np.random.default_rng(2).normal(size=sim.ndx)
    gradient = space.chain(theta, sim.vjp((xs, np.zeros((3, sim.nu))), loss, wrt=space.wrt))
    np.testing.assert_allclose(gradient, loss[1] @ J, atol=1e-7 * np.abs(J).max())


def test_the_space_starts_where_the_simulator_is() -> None:
    space, _ = charts()
    same = space.simulator(space.values).parameters(("friction", "damper", "mass", "inertia", "axis", "contact_normal"))
    np.testing.assert_allclose(same.values, space._sim.parameters(tuple(same.rows)).values, atol=1e-14)
    assert space.labels[:2] == ("friction:*", "damper:arm")
    assert (space.low[:2] >= 0.0).all() and (space.low[:2] < 1e-5).all()
    assert space.labels[-10:] == tuple(f"block.{label}" for label in inertia_coordinates.LABELS)


def test_a_restitution_of_zero_has_a_derivative() -> None:
    """Which impacts without any do not have."""
    space = dojo.ParameterSpace(dojo.Simulator(dojo.models.block()), ("restitution:*",))
    np.testing.assert_array_equal(np.r_[space.values, space.low, space.high], [1e-6, 1e-6, 1.0])


def test_a_common_shift_is_bounded_by_the_least_parameter() -> None:
    mech = dojo.models.npendulum(3)
    sim = dojo.Simulator(mech).with_parameters({"damper": [0.1, 0.2, 0.6]})
    space = dojo.ParameterSpace(sim, ("damper:*", "mass:*"))
    np.testing.assert_allclose(space.values[0], 0.3)
    np.testing.assert_allclose(space.low[0], 0.2)
    np.testing.assert_allclose(space.simulator(space.low).parameters(("damper:*",)).values, 0.2)


def test_the_common_damper_of_joints_of_several_sizes() -> None:
    """Of the base, one for each degree of freedom, and one of all hinges."""
    sim = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.05)
    space = dojo.ParameterSpace(sim, ("damper:*", "mass:foot"))
    assert space.labels == (*(f"damper:*[{k}]" for k in range(6)), "damper:*", "mass:foot")
    moved = space.values + 0.1
    np.testing.assert_allclose(space.simulator(moved).parameters(space.wrt).values, moved)
    with pytest.raises(ValueError, match=r"'damper:\*\[0\]' is used twice"):
        dojo.ParameterSpace(sim, ("damper:*", "damper:*[0]"))


def flight(sim: dojo.Simulator) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    x, us = sim.neutral(), rng.normal(size=(40, 6)) * (20, 20, 20, 1, 1, 1)
    x[2] += 5.0
    x[7:] = rng.normal(size=6)
    return x, us


def fit(space: dojo.ParameterSpace, truth: dojo.Simulator) -> np.ndarray:
    """Least squares on the steps of a flight."""
    x0, us = flight(truth)
    xs = truth.rollout(x0, us, throw=True).x

    def errors(theta: np.ndarray) -> np.ndarray:
        sim = space.simulator(theta)
        return np.concatenate([sim.difference(sim.step(x, u).x, y) for x, u, y in zip(xs, us, xs[1:], strict=False)])

    def slopes(theta: np.ndarray) -> np.ndarray:
        sim = space.simulator(theta)
        return np.vstack([space.chain(theta, sim.linearize(x, u, wrt=space.wrt)) for x, u in zip(xs, us, strict=False)])

    return least_squares(errors, space.values, slopes, bounds=(space.low, space.high), xtol=1e-14, ftol=1e-14).x


def test_a_fit_of_a_body_stays_among_bodies() -> None:
    """From a wrong guess: ten coordinates find the body; mass and inertia alone leave the set of possible bodies."""
    truth = block(inertia=np.array([0.02, 0.03, 0.0495, 0.0, 0.0, 0.0]))  # a thin one: 2 % from the border
    guess = block(inertia=np.array([0.1, 0.11, 0.12, 0.0, 0.0, 0.0]), mass=1.0)
    space = dojo.ParameterSpace(guess, bodies=["block"])
    found = space.simulator(fit(space, truth)).parameters(("mass", "inertia"))
    np.testing.assert_allclose(found.values, truth.parameters(("mass", "inertia")).values, atol=1e-7)
    with pytest.raises(ValueError, match=r"Body\('block', inertia=...\)"):
        fit(dojo.ParameterSpace(guess, ("mass", "inertia")), truth)


@pytest.mark.parametrize(
    ("names", "bodies", "bounds", "message"),
    [
        ((), (), None, "expected names, or bodies"),
        (("mass:block",), ("block",), None, "'mass:block' is used twice"),
        (("friction", "friction:block_0"), (), None, "'friction:block_0' is used twice"),
        (("friction:*", "friction:block_0"), (), None, r"'friction:\*' covers all parts, 'friction:block_0' included"),
        (("mass:*",), ("block",), None, r"'mass:\*' covers all parts, 'mass:block' included"),
        (("contact_normal:block_0[1]",), (), None, "contact_normal is a vector; give all components"),
        (("contact_normal:*",), (), None, "contact_normal is a vector"),
        (("friction:*",), (), {"friction:*": (0.6, 1.0)}, "'friction:\\*' is 0.5, outside of 0.6 to 1"),
        (("friction:*",), (), {"mu": (0.0, 1.0)}, "'mu' is not one of: friction"),
        ((), ("leg",), None, "no parameter 'mass:leg'"),
    ],
)
def test_refusals(names, bodies, bounds, message) -> None:
    with pytest.raises(ValueError, match=message):
        dojo.ParameterSpace(block(), names, bodies, bounds)


def test_bounds_of_a_name_are_those_of_all_its_parts() -> None:
    space = dojo.ParameterSpace(block(), ("friction", "mass"), bounds={"friction": (0.4, 0.6)})
    rough = [label.startswith("friction:") for label in space.labels]
    assert sum(rough) > 1 and np.array_equal(space.high == 0.6, rough) and np.array_equal(space.low == 0.4, rough)
