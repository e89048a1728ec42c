"""Steps and rollouts as functions of JAX: callbacks to the simulator, with the derivatives of `Simulator.vjp`."""

from __future__ import annotations

from typing import Any

from dojo_opt.bridges.jax_call import called
from dojo_opt.bridges.rollouts import Functions, Rollouts
from dojo_opt.identification.parameter_space import ParameterSpace
from sim.mechanism.checks import shown
from sim.simulator.simulator import Simulator

_CALL = "bridges.to_jax"


def _jax() -> Any:
    """JAX with numbers of 64 bits."""
    try:
        import jax
    except ImportError:
        raise ImportError(f'{_CALL} needs JAX: pip install "dojo-opt[jax]"') from None
    if not jax.config.jax_enable_x64:
        raise ValueError(
            f"{_CALL}: steps are solved to more digits than the seven of JAX's floats; call "
            'jax.config.update("jax_enable_x64", True) before arrays are made'
        )
    return jax


def to_jax(sim: Simulator, kappa: float | None = None, parameters: ParameterSpace | None = None) -> Functions:
    """step(x, u, theta=None) and rollout(x0, us, theta=None) of a simulator, for `jax.grad`, `jax.jit` and `jax.vmap`.

        x, x0    (nx,) states with unit quaternions
        u, us    (nu,), (T, nu) inputs [N, N m]
        theta    (n,) values of `parameters`; None: those of `sim`

    Gradients with respect to a state have its shape; their quaternion part is tangent to the quaternion, the gradient
    of the function that first normalises it. Under vmap, rollouts run on all cores. A gradient solves the steps once
    more, and stores only the states. There is no forward mode (`jax.jvp`, `jax.jacfwd`): `Simulator.linearize` has
    Jacobians. Callbacks run on the processor, whatever the device.

    Args:
        sim: the simulator.
        kappa: central-path parameter of the derivatives, larger for smoother contact [N s m]; by default that of the
            simulator.
        parameters: the parameters in theta, order 2 without accuracy only (default None: no parameters).

    Returns:
        (step, rollout): step gives the next state (nx,), rollout all states (T + 1, nx), including x0.

    Raises:
        ImportError: JAX is not installed.
        ValueError: JAX computes with 32 bits, or the steps of the simulator have no derivatives by `parameters`. Errors
            of the simulator in a call (SimulationError: an unsolved step; ValueError: numbers that are not finite,
            quaternions of another length) appear in JAX's own error.
    """
    jax = _jax()
    core = Rollouts(_CALL, sim, kappa, parameters)
    states = _states(jax, core)

    def rollout(x0: Any, us: Any, theta: Any = None) -> Any:
        """States (T + 1, nx) from x0 (nx,) under us (T, nu); see `to_jax`."""
        n = core.sizes(theta)
        x0, us = _doubles(jax, "x0", x0), _doubles(jax, "us", us)
        theta = jax.numpy.zeros(0) if theta is None else _doubles(jax, "theta", theta)
        core.check(x0=(x0.shape, (sim.nx,)), us=(us.shape, ("T", sim.nu)), theta=(theta.shape, (n,)))
        return states(x0, us, theta)

    def step(x: Any, u: Any, theta: Any = None) -> Any:
        """The state (nx,) after x (nx,) under u (nu,); see `to_jax`."""
        u = _doubles(jax, "u", u)
        core.check(u=(u.shape, (sim.nu,)))
        return rollout(x, u[None], theta)[1]

    return Functions(step, rollout)


def _doubles(jax: Any, name: str, value: Any) -> Any:
    """The argument as an array of doubles; one that does not hold real numbers is refused."""
    _jax()  # which may have been told to use 32 bits since
    try:
        array = None if isinstance(value, str) else jax.numpy.asarray(value)
    except (TypeError, ValueError, OverflowError):
        array = None
    if array is None or jax.numpy.iscomplexobj(array):
        raise TypeError(f"{_CALL}: argument {name}: expected real numbers, got {shown(value)}")
    return array.astype("float64")


def _states(jax: Any, core: Rollouts) -> Any:
    """`core.states` of arrays of JAX, with its pullback."""
    nx = core.sim.nx

    @jax.custom_vjp
    def states(x0: Any, us: Any, theta: Any) -> Any:
        return called(core.all_states, ((us.shape[0] + 1, nx),), x0, us, theta)[0]

    def forward(x0: Any, us: Any, theta: Any) -> Any:
        xs = states(x0, us, theta)
        return xs, (xs, us, theta)

    def backward(kept: Any, by_xs: Any) -> Any:
        xs, us, theta = kept
        return called(core.pullback, ((nx,), us.shape, theta.shape), xs, us, theta, by_xs)

    states.defvjp(forward, backward)
    return states
