"""Steps and rollouts as functions of PyTorch; their derivatives are those of `Simulator.vjp`."""

from __future__ import annotations

from typing import Any

from dojo_opt.bridges.rollouts import Functions, Rollouts
from dojo_opt.identification.parameter_space import ParameterSpace
from sim.simulator.simulator import Simulator

_CALL = "bridges.to_torch"


def to_torch(sim: Simulator, kappa: float | None = None, parameters: ParameterSpace | None = None) -> Functions:
    """step(x, u, theta=None) and rollout(x0, us, theta=None) of a simulator, for PyTorch's autograd.

        x, x0    (..., nx) states with unit quaternions
        u, us    (..., nu), (..., T, nu) inputs [N, N m]
        theta    (..., n) values of `parameters`; None: those of `sim`

    Tensors hold doubles. Leading axes are broadcast, and their rows run on all cores.

    Gradients with respect to a state have its shape; their quaternion part is tangent to the quaternion, the gradient
    of the function that first normalises it. A gradient solves the steps once more, and stores only the states; it has
    no gradient of its own.

    Args:
        sim: the simulator.
        kappa: central-path parameter of the derivatives, larger for smoother contact [N s m]; by default that of the
            simulator.
        parameters: the parameters in theta (default None: no parameters).

    Returns:
        (step, rollout): step gives the next states (..., nx), rollout all states (..., T + 1, nx), including x0.

    Raises:
        ImportError: PyTorch is not installed.
        SimulationError: in a call, a step is not solved.
        ValueError: in a call, a shape is wrong, a number not finite, or a quaternion not of unit length.
        TypeError: in a call, a tensor does not hold doubles.
    """
    try:
        import torch
    except ImportError:
        raise ImportError(f'{_CALL} needs PyTorch: pip install "dojo-opt[torch]"') from None
    core = Rollouts(_CALL, sim, kappa, parameters)
    states = _states(torch, core)

    def rollout(x0: Any, us: Any, theta: Any = None) -> Any:
        """States (..., T + 1, nx) from x0 (..., nx) under us (..., T, nu); see `to_torch`."""
        n = core.sizes(theta)
        x0, us = _doubles(torch, "x0", x0), _doubles(torch, "us", us)
        theta = us.new_zeros(0) if theta is None else _doubles(torch, "theta", theta)
        ends = {"x0": (x0, (sim.nx,)), "us": (us, ("T", sim.nu)), "theta": (theta, (n,))}
        core.check(**{name: (tuple(t.shape[-len(wanted) :]), wanted) for name, (t, wanted) in ends.items()})
        lead = torch.broadcast_shapes(x0.shape[:-1], us.shape[:-2], theta.shape[:-1])
        return states(x0.expand(*lead, -1), us.expand(*lead, -1, -1), theta.expand(*lead, -1))

    def step(x: Any, u: Any, theta: Any = None) -> Any:
        """The states (..., nx) after x (..., nx) under u (..., nu); see `to_torch`."""
        u = _doubles(torch, "u", u)
        core.check(u=(tuple(u.shape[-1:]), (sim.nu,)))
        return rollout(x, u[..., None, :], theta)[..., 1, :]

    return Functions(step, rollout)


def _doubles(torch: Any, name: str, value: Any) -> Any:
    """The argument as a tensor; one of other numbers than doubles is refused."""
    tensor = torch.as_tensor(value)
    if tensor.dtype != torch.float64:
        raise TypeError(f"{_CALL}: argument {name}: expected a tensor of doubles, got {tensor.dtype}")
    return tensor


def _states(torch: Any, core: Rollouts) -> Any:
    """`core.states` of tensors, with its pullback."""

    def array(tensor: Any) -> Any:
        return tensor.detach().cpu().numpy()

    class RolloutStates(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, x0: Any, us: Any, theta: Any) -> Any:
            xs = torch.from_numpy(core.states(*map(array, (x0, us, theta)))).to(us.device)
            ctx.save_for_backward(xs, us, theta)
            return xs

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx: Any, by_xs: Any) -> Any:
            gradients = core.pullback(*map(array, (*ctx.saved_tensors, by_xs)))
            return tuple(torch.from_numpy(g).to(by_xs.device) for g in gradients)

    return RolloutStates.apply
