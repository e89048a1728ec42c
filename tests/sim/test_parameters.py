"""Derivatives by parameters: of a step, of a rollout, and of maximal states; names, and values put in their place."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import dojo_opt as dojo
from sim.derivatives.parameters.parameters import KINDS
from sim.simulator import simulator_parameters
from support.coupled_scenes import COUPLED, kinds
from support.jacobians import check_jacobian, check_step
from support.parameter_case import Case
from support.parameter_errors import error
from support.scenes import KINDS as JOINTS
from support.scenes import chain, random_state
from support.situations import CASES

ALL = {**CASES, **COUPLED}
GEOMETRY = ("parent_point", "child_point", "orientation", "axis", "pitch")
case_of = functools.cache(lambda name: ALL[name]())


@pytest.mark.sweep(6)
@pytest.mark.parametrize("name", ALL)
def test_every_kind_in_every_situation(name: str) -> None:
    case = case_of(name)
    errors = {kind: error(case, kind) for kind in kinds(name, case)}
    assert all(e < 1e-6 for e in errors.values()), errors


@pytest.mark.parametrize("kind", [kind for kind in JOINTS if kind not in ("fixed", "floating")])
def test_every_kind_of_joint(kind: str) -> None:
    """Geometry of joints with dampers; and from the second step of a motion on, which carries the one before on."""
    rng = np.random.default_rng(2)
    sim = dojo.Simulator(chain(kind, 2, damper=0.5, spring=2.0), time_step=0.02, tolerance=1e-12)
    x, u = random_state(sim, rng, speed=2.0), rng.normal(size=sim.nu)
    case = Case(sim, x, u)
    errors = {name: error(case, name) for name in case.kinds() if name in GEOMETRY}
    assert "axis" in errors or kind in ("spherical", "fixed_orientation")
    assert all(e < 1e-6 for e in errors.values()), errors
    names = sim.parameters().names
    xs, line = sim.linearize_rollout(x, np.tile(u, (3, 1)), wrt=names, throw=True)
    for t in range(3):
        step = sim.linearize(xs[t], u, wrt=names)
        for name, block in line.parameters.items():
            np.testing.assert_allclose(block[t], step[name], rtol=1e-7, atol=1e-8)


def test_derivatives_by_the_state_prepare_none_by_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    """To prepare them takes as long as hundreds of steps."""
    monkeypatch.setattr(simulator_parameters, "select", None)
    sim, x, u = case_of("sliding")
    fresh = sim.with_parameters({"friction:*": 0.3})
    assert np.isfinite(fresh.linearize(x, u)[0]).all()
    with pytest.raises(TypeError):
        fresh.linearize(x, u, wrt=("mass",))


def test_no_kind_is_left_out() -> None:
    assert {kind for name in CASES for kind in case_of(name).kinds()} == set(KINDS)


def test_the_situations_match_their_names() -> None:
    def impulse(name: str) -> np.ndarray:
        case = case_of(name)
        contacts = case.sim.step(case.x, case.u).contacts
        return np.linalg.norm(contacts.impulse, axis=1).max()

    for name in ("bouncing", "on terrain", "colliding, bouncing"):
        sim, x, u = case_of(name)
        assert np.abs(sim.linearize(x, u, wrt=("restitution",))["restitution"]).max() > 0.1
    assert impulse("flying") < 1e-3 < 0.01 < impulse("touching") < impulse("sticking")
    assert min(impulse(name) for name in CASES if name.startswith(("sliding", "colliding"))) > 0.05


def test_a_pair_out_of_reach_leaves_nothing_behind() -> None:
    """After a step with a contact, where the pair has no force at all."""
    case = case_of("colliding, box and sphere")
    far = case.x.copy()
    far[:3] += 50.0
    fresh = case.sim.replace(friction=0.5)
    expected = fresh.linearize(far, wrt=("com", "orientation"))
    assert np.abs(case.sim.linearize(case.x, wrt=("com",))["com"]).max() > 0.1
    found = case.sim.linearize(far, wrt=("com", "orientation"))
    for name, block in expected.items():
        assert np.isfinite(block).all(), name
        np.testing.assert_array_equal(found[name], block)


def test_a_joint_with_two_rotations_in_a_loop() -> None:
    """Its curvature needs the residual wrenches, before the loops use their place."""
    case = case_of("in a loop, orbital")
    check_step(case.sim, case.x, case.u)


def rollout(case: Case, steps: int = 4) -> tuple[dojo.Trajectory, np.ndarray, np.ndarray]:
    """A few steps, a random loss gradient, and the inputs."""
    rng = np.random.default_rng(4)
    us = case.u + 0.1 * rng.normal(size=(steps, case.sim.nu))
    t = case.sim.rollout(case.x, us, throw=True)
    return t, rng.normal(size=(steps + 1, case.sim.ndx)), us


@pytest.mark.parametrize(
    "name", ["sliding", "in a loop", "in a loop, acting", "geared", "colliding, boxes", "at a cone"]
)
def test_the_sweep_is_the_chain_of_the_steps(name: str) -> None:
    case = case_of(name)
    t, loss, us = rollout(case)
    names = case.sim.parameters().names
    got = case.sim.vjp(t, loss, wrt=("state", "input", *names))
    costate, inputs, parameters = loss[-1], [], np.zeros(len(names))
    for x, u, row in zip(t.x[-2::-1], us[::-1], loss[-2::-1], strict=True):
        blocks = case.sim.linearize(x, u, wrt=("state", "input", *names))
        parameters += np.array([costate @ blocks[n][:, 0] for n in names])
        inputs.append(costate @ blocks["input"])
        costate = row + costate @ blocks["state"]
    np.testing.assert_allclose(got["state"], costate, rtol=1e-9, atol=1e-9 * np.abs(costate).max())
    np.testing.assert_allclose(got["input"], inputs[::-1], rtol=1e-8, atol=1e-10)
    found = np.array([got[n][0] for n in names])
    np.testing.assert_allclose(found, parameters, rtol=1e-7, atol=1e-8 * np.abs(parameters).max())


@pytest.mark.slow
def test_the_sweep_against_differences_of_the_rollout() -> None:
    case = case_of("sliding")
    sim = case.sim
    t, loss, us = rollout(case)
    wrt = ("friction", "mass", "com:body1", "time_step", "contact_height:*", "spring:body1")
    got = sim.vjp(t, loss, wrt=("state", "input", *wrt))
    values = sim.parameters(wrt)
    scale = np.array([sim.time_step / 10 if name == "time_step" else 1.0 for name in values.names])

    def change(simulator: dojo.Simulator, x: np.ndarray, inputs: np.ndarray) -> np.ndarray:
        moved = simulator.rollout(x, inputs)
        return np.array([np.sum(loss * sim.difference(moved.x, t.x))]) if moved.success else np.array([np.nan])

    def by_parameters(dp: np.ndarray) -> np.ndarray:
        new = {name: values[name] + (scale * dp)[values.rows[name]] for name in wrt}
        return change(sim.with_parameters(new), case.x, us)

    gradient = (scale * np.concatenate([got[name] for name in wrt]))[None]
    check_jacobian(by_parameters, gradient, np.zeros(len(gradient[0])), np.add)
    check_jacobian(lambda x: change(sim, x, us), got["state"][None], case.x, sim.integrate)
    flat = us.ravel()
    check_jacobian(lambda u: change(sim, case.x, u.reshape(us.shape)), got["input"].reshape(1, -1), flat, np.add)


@pytest.mark.parametrize("name", ["sliding", "at a limit"])
def test_maximal_coordinates(name: str) -> None:
    case = case_of(name)
    sim = case.sim
    z = sim.maximal(case.x)
    A, B = sim.linearize_maximal(z, case.u)
    next_z = sim.maximal(sim.step(case.x, case.u).x)

    def moved(z: np.ndarray, dz: np.ndarray) -> np.ndarray:
        out = z.copy()
        for row, d in zip(out, dz.reshape(-1, 12), strict=True):
            row[:6] += d[:6]
            row[6:10] = _times(row[6:10], _exp(d[6:9]))
            row[10:] += d[9:]
        return out

    def tangent(z: np.ndarray) -> np.ndarray:
        rows = [
            np.r_[a[:6] - b[:6], 2.0 * _times(b[6:10] * (1, -1, -1, -1), a[6:10])[1:], a[10:] - b[10:]]
            for a, b in zip(z, next_z, strict=True)
        ]
        return np.concatenate(rows)

    def step(z: np.ndarray, u: np.ndarray) -> np.ndarray:
        return tangent(sim.maximal(sim.step(sim.minimal(z, joint_tolerance=np.inf), u).x))

    check_jacobian(lambda zz: step(zz, case.u), A, z, moved)
    check_jacobian(lambda u: step(z, u), B, case.u, np.add)


def _times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.r_[a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])]


def _exp(w: np.ndarray) -> np.ndarray:
    angle = np.linalg.norm(w)
    return np.r_[np.cos(angle / 2), 0.5 * np.sinc(angle / 2 / np.pi) * w]


def test_names_stand_for_their_parameters() -> None:
    sim = case_of("sliding").sim
    found = sim.parameters(("friction", "com:body1", "gravity[2]", "mass:*"))
    assert found.names == ("friction:body1", "com:body1[0]", "com:body1[1]", "com:body1[2]", "gravity[2]", "mass:*")
    assert list(found) == ["friction", "com:body1", "gravity[2]", "mass:*"] and "com:body1" in found
    np.testing.assert_allclose(found["gravity[2]"], -9.81)
    heavier = sim.with_parameters({"mass:*": found["mass:*"] + 1.0})
    np.testing.assert_allclose(heavier.parameters("mass").values, sim.parameters("mass").values + 1.0)
    blocks = sim.linearize(case_of("sliding").x, wrt=("mass", "mass:*"))
    np.testing.assert_allclose(blocks["mass"].sum(axis=1), blocks["mass:*"][:, 0], rtol=1e-9, atol=1e-12)


def test_a_body_that_a_closing_joint_divides_is_one_to_its_parameters() -> None:
    """A closing joint that acts carries half of its child: mass, inertia and com stay those that the user wrote."""
    sim = case_of("in a loop, acting").sim
    assert sim.mechanism.body_names[-1] == "b0.last"
    whole = sim.parameters(("mass", "inertia:b0"))
    assert whole.names[:4] == ("mass:b0", "mass:b1", "mass:b2", "mass:b3")
    np.testing.assert_allclose(whole["mass"], [1.0, 1.3, 1.6, 1.9])
    np.testing.assert_allclose(whole["inertia:b0"], [0.02, 0.03, 0.04, 0.0, 0.0, 0.0])
    heavier = sim.with_parameters({"mass:b0": 3.0, "inertia:b0[xx]": 0.03, "com:b0[2]": 0.1}).mechanism
    parts = [b for b in heavier.bodies if b.name.startswith("b0")]
    assert [b.mass for b in parts] == [1.5, 1.5]
    assert [np.asarray(b.inertia)[0, 0] for b in parts] == [0.015, 0.015]
    points = [j.child_point for j in (*heavier.joints, *heavier.loops) if j.child.startswith("b0")]
    assert [p[2] for p in points] == [-0.1, -0.1, -0.1]  # the floating joint, the closing one and the weld


def test_without_wrt_nothing_changes() -> None:
    case = case_of("sliding")
    A, B = case.sim.linearize(case.x, case.u)
    blocks = case.sim.linearize(case.x, case.u, wrt=("input", "state"))
    assert list(blocks.keys()) == ["input", "state"]
    np.testing.assert_array_equal(blocks["state"], A)
    np.testing.assert_array_equal(blocks["input"], B)


def test_every_value_can_be_put_in_its_place() -> None:
    sim = case_of("colliding, boxes").sim
    found = sim.parameters()
    rng = np.random.default_rng(2)
    values = found.values + 1e-3 * rng.uniform(size=len(found.values))
    moved = sim.with_parameters(dict(zip(found.names, values, strict=True))).parameters()
    for name, value, was in zip(found.names, moved.values, values, strict=True):
        if not name.startswith(("com", "orientation", "child_point", "parent_point", "shape")):  # from where they are
            assert abs(value - was) < 1e-12, name


@pytest.mark.parametrize(
    ("wrt", "message"),
    [
        (("weight",), r"wrt=.*kind.*'weight'"),
        (("friction:hand",), r"no parameter 'friction:hand'.*friction:body1"),
        (("cone",), r"no parameter 'cone'.*none"),
        (("mass", "mass"), "mass"),
        ((3,), "expected a name, got 3"),
    ],
)
def test_bad_names(wrt: tuple[str, ...], message: str) -> None:
    case = case_of("sliding")
    with pytest.raises(ValueError, match=message):
        case.sim.linearize(case.x, case.u, wrt=wrt)


def test_parameters_of_orders_above_two_are_refused() -> None:
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01, order=4)
    refusal = r"linearize\(wrt=...\): expected a simulator of order 2, got order 4; use replace\(order=2\)"
    with pytest.raises(ValueError, match=refusal):
        sim.linearize(sim.neutral(), wrt=("mass",))
    with pytest.raises(ValueError, match=r"vjp\(wrt=...\): expected a simulator of order 2"):
        sim.vjp((np.tile(sim.neutral(), (2, 1)), np.zeros((1, sim.nu))), np.ones((2, sim.ndx)), wrt=("mass",))


def test_bad_values_and_shapes() -> None:
    case = case_of("sliding")
    sim = case.sim
    with pytest.raises(ValueError, match="mass"):
        sim.with_parameters({"mass:body1": -1.0})
    with pytest.raises(ValueError, match=r"with_parameters.*'com:body1'"):
        sim.with_parameters({"com:body1": 0.1})
    t, loss, _ = rollout(case)
    with pytest.raises(ValueError, match=r"vjp\(dL_dx\)"):
        sim.vjp(t, loss[:-1])
    fast = t.x.copy()
    fast[:, sim.nq :] += 20.0
    with pytest.raises(dojo.SimulationError, match=r"Simulator.vjp: step 3"):
        sim.replace(max_iterations=1).vjp((fast, t.u), loss, throw=True)
