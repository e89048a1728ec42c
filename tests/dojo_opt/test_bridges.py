"""Bridges: gradients by a framework's tensors equal central differences, batches equal rows, errors keep their text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.bridges.cotangents import Cotangents
from dojo_opt.bridges.rollouts import Rollouts

HOPPER = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.02, kappa=1e-3, tolerance=1e-11)
PENDULUM = dojo.Simulator(dojo.models.pendulum(), time_step=0.05, tolerance=1e-12)
LOOP = dojo.Simulator(dojo.models.fourbar(), time_step=0.01, tolerance=1e-12)
SPACE = dojo.ParameterSpace(HOPPER, ("friction:*",), bodies=("foot",))


def motions(count: int, steps: int = 6) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hoppers that stand askew on the ground and are pushed: states, inputs, and weights of a loss on their states."""
    rng = np.random.default_rng(3)
    x0 = HOPPER.integrate(HOPPER.neutral(), 0.05 * rng.normal(size=(count, HOPPER.ndx)))
    x0[:, 2] += 0.05
    us = np.array([1.0, 1.0, 10.0]) * rng.normal(size=(count, steps, 3)) + [0.0, 0.0, 41.0]
    return x0, us, rng.normal(size=(count, steps + 1, HOPPER.nx))


def unit(x: np.ndarray) -> np.ndarray:
    """The state with a quaternion of length one."""
    out = x.copy()
    out[3:7] /= np.linalg.norm(x[3:7])
    return out


def differences(loss: Any, at: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Central differences of a scalar."""
    out = np.empty(at.size)
    for i in range(at.size):
        sides = []
        for sign in (1.0, -1.0):
            moved = at.copy()
            moved.flat[i] += sign * step
            sides.append(loss(moved))
        out[i] = (sides[0] - sides[1]) / (2.0 * step)
    return out.reshape(at.shape)


@pytest.fixture
def jax() -> Iterator[Any]:
    jax = pytest.importorskip("jax")
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield jax
    jax.config.update("jax_enable_x64", before)


@pytest.mark.parametrize("setting", [{"order": 4}, {"accuracy": 1e-3}])
def test_parameters_without_derivatives_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"f\(parameters=\.\.\.\): expected a simulator of order 2"):
        Rollouts("f", PENDULUM.replace(**setting), None, dojo.ParameterSpace(PENDULUM, ("mass",)))


def test_pullback_is_the_gradient_of_the_rollout_from_states_made_unit() -> None:
    core = Rollouts("here", HOPPER, None, SPACE)
    (x0,), (us,), (weight,) = motions(1)
    theta = SPACE.values
    xs = core.states(x0, us, theta)
    by_x0, by_us, by_theta = core.pullback(xs, us, theta, weight)
    scale = max(np.abs(by_x0).max(), np.abs(by_us).max(), np.abs(by_theta).max())
    expected = differences(lambda x: np.sum(weight * core.states(unit(x), us, theta)), x0)
    np.testing.assert_allclose(by_x0, expected, atol=1e-6 * scale)
    expected = differences(lambda u: np.sum(weight * core.states(x0, u, theta)), us)
    np.testing.assert_allclose(by_us, expected, atol=1e-6 * scale)
    expected = differences(lambda p: np.sum(weight * core.states(x0, us, p)), theta)
    np.testing.assert_allclose(by_theta, expected, atol=1e-6 * scale)
    assert abs(x0[3:7] @ by_x0[3:7]) < 1e-12 * scale  # tangent to the quaternion


def test_tangent_and_ambient_gradients_are_two_views_of_one() -> None:
    maps, rng = Cotangents(HOPPER), np.random.default_rng(0)
    (x,), _, _ = motions(1)
    g, dx = rng.normal(size=HOPPER.ndx), 1e-6 * rng.normal(size=HOPPER.ndx)
    by_x = maps.ambient(x[None], g[None])[0]
    np.testing.assert_allclose(maps.tangent(x[None], by_x[None])[0], g, atol=1e-14)
    assert by_x @ (HOPPER.integrate(x, dx) - HOPPER.integrate(x, -dx)) == pytest.approx(2.0 * g @ dx, rel=1e-9)


def test_batches_are_their_rows() -> None:
    x0, us, weight = motions(5)
    for space in (None, SPACE):
        core = Rollouts("here", HOPPER, 1e-2, space)
        theta = np.zeros((5, 0)) if space is None else SPACE.values * np.linspace(0.9, 1.1, 5)[:, None]
        xs = core.states(x0, us, theta)
        gradients = core.pullback(xs, us, theta, weight)
        for i in range(5):
            np.testing.assert_allclose(core.states(x0[i], us[i], theta[i]), xs[i], atol=1e-12)
            for whole, row in zip(gradients, core.pullback(xs[i], us[i], theta[i], weight[i]), strict=True):
                np.testing.assert_allclose(whole[i], row, atol=1e-9)
    assert core.states(x0[None], us[None], theta[None]).shape == (1, *xs.shape)


def test_jax_has_gradients_through_jit_and_vmap(jax: Any) -> None:
    x0, us, weight = motions(4)
    _, rollout = dojo.bridges.to_jax(HOPPER, parameters=SPACE)
    core = Rollouts("here", HOPPER, None, SPACE)

    def loss(x: Any, u: Any, theta: Any, w: Any) -> Any:
        return jax.numpy.sum(w * rollout(x, u, theta))

    gradient = jax.jit(jax.vmap(jax.grad(loss, argnums=(0, 1, 2)), in_axes=(0, 0, None, 0)))
    found = gradient(x0, us, SPACE.values, weight)
    theta = np.tile(SPACE.values, (4, 1))
    expected = core.pullback(core.states(x0, us, theta), us, theta, weight)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-8 * np.abs(theirs).max())


@pytest.mark.parametrize("sim", [PENDULUM, PENDULUM.replace(order=4), LOOP], ids=["tree", "order 4", "loop"])
def test_jax_step_has_the_jacobians_of_the_simulator(jax: Any, sim: dojo.Simulator) -> None:
    step, rollout = dojo.bridges.to_jax(sim)
    x, u = sim.state_from_velocity(sim.neutral()[: sim.nq], np.zeros(sim.nv)), np.full(sim.nu, 0.3)
    A, B = jax.jacrev(step, argnums=(0, 1))(x, u)
    for ours, theirs in zip((A, B), sim.linearize(x, u), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max())
    np.testing.assert_array_equal(step(x, u), sim.step(x, u).x)
    for steps in (0, 3):
        us = np.zeros((steps, sim.nu))
        np.testing.assert_array_equal(rollout(x, us), sim.rollout(x, us).x)
    np.testing.assert_array_equal(jax.grad(lambda x: rollout(x, us[:0])[0, 0])(x), np.eye(sim.nx)[0])


def test_jax_large_batches_come_back(jax: Any) -> None:
    step, _ = dojo.bridges.to_jax(PENDULUM)
    x = np.random.default_rng(0).normal(size=(20_000, 2))
    total = jax.jit(lambda x: jax.numpy.sum(jax.vmap(step)(x, jax.numpy.zeros((len(x), 1))) ** 2))
    expected = PENDULUM.rollout_batch(x, np.zeros((len(x), 1, 1))).x[:, 1]
    assert float(total(x)) == pytest.approx(np.sum(expected**2))


def test_jax_names_the_error(jax: Any) -> None:
    step, rollout = dojo.bridges.to_jax(PENDULUM)
    with pytest.raises(ValueError, match=r"to_jax: argument us: expected shape \(T, 1\), got \(1,\)"):
        rollout(np.zeros(2), np.zeros(1))
    with pytest.raises(ValueError, match=r"argument u: expected shape \(1,\), got \(2,\)"):
        step(np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match="no parameters are declared"):
        step(np.zeros(2), np.zeros(1), np.ones(3))
    whole, _ = dojo.bridges.to_jax(PENDULUM.replace(divide=False))
    with pytest.raises(Exception, match=r"SimulationError: bridges.to_jax: row 1: .*half a turn"):
        jax.vmap(whole)(np.array([[0.0, 0.0], [0.0, 100.0]]), np.zeros((2, 1))).block_until_ready()
    with pytest.raises(Exception, match="expected finite numbers, got nan at index 1"):
        step(np.array([0.0, np.nan]), np.zeros(1)).block_until_ready()
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(ValueError, match=r"jax.config.update\(.jax_enable_x64., True\)"):
        step(np.zeros(2), np.zeros(1))
    with pytest.raises(TypeError, match=r"to_jax\(sim\): expected a Simulator"):
        jax.config.update("jax_enable_x64", True)
        dojo.bridges.to_jax(PENDULUM.mechanism)


def test_torch_has_gradients_with_leading_axes() -> None:
    torch = pytest.importorskip("torch")
    x0, us, weight = motions(4)
    step, rollout = dojo.bridges.to_torch(HOPPER, parameters=SPACE)
    core = Rollouts("here", HOPPER, None, SPACE)
    leaves = [torch.tensor(a, requires_grad=True) for a in (x0, us, SPACE.values)]
    (torch.tensor(weight) * rollout(*leaves)).sum().backward()
    theta = np.tile(SPACE.values, (4, 1))
    by_x0, by_us, by_theta = core.pullback(core.states(x0, us, theta), us, theta, weight)
    for leaf, expected in zip(leaves, (by_x0, by_us, by_theta.sum(axis=0)), strict=True):  # theta is broadcast
        np.testing.assert_allclose(leaf.grad.numpy(), expected, atol=1e-8 * np.abs(expected).max())
    assert step(torch.tensor(x0), torch.tensor(us[:, 0])).shape == (4, HOPPER.nx)


def test_torch_agrees_with_its_own_differences_and_names_the_error() -> None:
    torch = pytest.importorskip("torch")
    step, rollout = dojo.bridges.to_torch(PENDULUM)
    x, us = torch.tensor([0.4, -1.0]).double(), torch.full((2, 4, 1), 0.3).double()
    assert torch.autograd.gradcheck(rollout, (x.requires_grad_(), us.requires_grad_()))
    with pytest.raises(TypeError, match=r"to_torch: argument u: expected a tensor of doubles, got torch.float32"):
        step(x, torch.zeros(1))
    with pytest.raises(ValueError, match=r"argument us: expected shape \(T, 1\), got \(4, 2\)"):
        rollout(x, torch.zeros((4, 2)).double())
    whole, _ = dojo.bridges.to_torch(PENDULUM.replace(divide=False))
    with pytest.raises(dojo.SimulationError, match="half a turn"):
        whole(torch.tensor([0.0, 100.0]).double(), torch.zeros(1).double())


def test_torch_maps_rows_and_refuses_second_derivatives() -> None:
    torch = pytest.importorskip("torch")
    _, rollout = dojo.bridges.to_torch(PENDULUM)
    xs, us = torch.tensor(np.eye(2)), torch.tensor(np.arange(8.0).reshape(2, 4, 1) / 8.0)
    assert torch.equal(torch.vmap(rollout)(xs, us), rollout(xs, us))
    assert torch.equal(torch.vmap(rollout, in_dims=(None, 1))(xs[0], us.movedim(0, 1)), rollout(xs[0], us))
    jacobians = torch.vmap(torch.func.jacrev(rollout))(xs, us)
    expected = torch.autograd.functional.jacobian(rollout, (xs[1], us[1]))[0]
    torch.testing.assert_close(jacobians[1], expected, rtol=0.0, atol=1e-12)
    assert torch.equal(torch.compile(rollout, backend="eager")(xs, us), rollout(xs, us))
    with pytest.raises(NotImplementedError, match="a gradient has no gradient of its own"):
        torch.autograd.functional.hessian(lambda x: rollout(x, us[0]).sum(), xs[0])  # linear in the states


def test_torch_names_arguments_without_numbers() -> None:
    torch = pytest.importorskip("torch")
    _, rollout = dojo.bridges.to_torch(PENDULUM)
    x, us = torch.zeros(2).double(), torch.zeros((4, 1)).double()
    for wrong in (None, "a", x.to_sparse(), x.to("meta")):
        with pytest.raises(TypeError, match="to_torch: argument x0: expected a (dense )?tensor"):
            rollout(wrong, us)
    with pytest.raises(ValueError, match=r"leading axes that broadcast, got x0 \(3,\), us \(4,\), theta \(\)"):
        rollout(x.expand(3, 2), us.expand(4, 4, 1))


@pytest.mark.parametrize(("name", "extra"), [("to_jax", "jax"), ("to_torch", "torch")])
def test_a_framework_that_is_not_there_is_named(name: str, extra: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, extra, None)
    with pytest.raises(ImportError, match=rf'bridges.{name} needs .*pip install "dojo-opt\[{extra}\]"'):
        getattr(dojo.bridges, name)(PENDULUM)
