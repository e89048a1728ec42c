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

    Tensors hold doubles. Leading axes are broadcast, and their rows run on all cores. `torch.func` (`vmap`, `grad`,
    `jacrev`) takes both; `torch.compile` calls them as they are.

    Gradients with respect to a state have its shape; their quaternion part is tangent to the quaternion, the gradient
    of the function that first normalises it. A gradient solves the steps once more, and stores only the states; it has
    no gradient of its own, and asking for one is an error.

    Args:
        sim: the simulator.
        kappa: central-path parameter of the derivatives, larger for smoother contact [N s m]; by default that of the
            simulator.
        parameters: the parameters in theta, order 2 without accuracy only (default None: no parameters).

    Returns:
        (step, rollout): step gives the next states (..., nx), rollout all states (..., T + 1, nx), including x0.

    Raises:
        ImportError: PyTorch is not installed.
        SimulationError: in a call, a step is not solved.
        ValueError: the steps of the simulator have no derivatives by `parameters`. In a call, a shape is wrong, a
            number not finite, or a quaternion not of unit length.
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
        lead = _common_axes(torch, x0=x0.shape[:-1], us=us.shape[:-2], theta=theta.shape[:-1])
        return states(x0.expand(*lead, -1), us.expand(*lead, -1, -1), theta.expand(*lead, -1))

    def step(x: Any, u: Any, theta: Any = None) -> Any:
        """The states (..., nx) after x (..., nx) under u (..., nu); see `to_torch`."""
        u = _doubles(torch, "u", u)
        core.check(u=(tuple(u.shape[-1:]), (sim.nu,)))
        return rollout(x, u[..., None, :], theta)[..., 1, :]

    return Functions(step, rollout)


def _doubles(torch: Any, name: str, value: Any) -> Any:
    """The argument as a tensor; one of other numbers than doubles, or without an array of numbers, is refused."""
    try:
        tensor = torch.as_tensor(value)
    except (RuntimeError, TypeError, ValueError) as error:
        raise TypeError(f"{_CALL}: argument {name}: expected a tensor of doubles, got {value!r:.60}") from error
    if tensor.dtype != torch.float64:
        raise TypeError(f"{_CALL}: argument {name}: expected a tensor of doubles, got {tensor.dtype}")
    if tensor.layout is not torch.strided or tensor.is_meta:
        kind = "one without numbers (meta)" if tensor.is_meta else str(tensor.layout)
        raise TypeError(f"{_CALL}: argument {name}: expected a dense tensor, got {kind}")
    return tensor


def _common_axes(torch: Any, **axes: Any) -> Any:
    """The leading axes to which all arguments are broadcast."""
    try:
        return torch.broadcast_shapes(*axes.values())
    except RuntimeError as error:
        found = ", ".join(f"{name} {tuple(shape)}" for name, shape in axes.items())
        raise ValueError(f"{_CALL}: expected leading axes that broadcast, got {found}") from error


def _states(torch: Any, core: Rollouts) -> Any:
    """`core.states` of tensors with equal leading axes, with its pullback, for autograd and for torch.func.

    The pullback is a function of its own: a gradient of a gradient has to raise an error. `once_differentiable` raises
    none where the loss is linear in the states, since it looks at the gradients by the states alone.
    """

    def array(tensor: Any) -> Any:
        return tensor.detach().resolve_neg().cpu().numpy()

    def mapped(function: Any, info: Any, dims: tuple[int | None, ...], *tensors: Any) -> Any:
        """Results of rows along `dims` [-], which become the first leading axis."""
        rows = (
            t.expand(info.batch_size, *t.shape) if dim is None else t.movedim(dim, 0)
            for t, dim in zip(tensors, dims, strict=True)
        )
        return function.apply(*rows)

    class Pullback(torch.autograd.Function):
        @staticmethod
        def forward(xs: Any, us: Any, theta: Any, by_xs: Any) -> Any:
            gradients = core.pullback(*map(array, (xs, us, theta, by_xs)))
            return tuple(torch.from_numpy(g).to(by_xs.device) for g in gradients)

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            pass

        @staticmethod
        def backward(ctx: Any, *by_gradients: Any) -> Any:
            raise NotImplementedError(f"{_CALL}: a gradient has no gradient of its own (first derivatives only)")

        @staticmethod
        def vmap(info: Any, in_dims: Any, *tensors: Any) -> Any:
            return mapped(Pullback, info, in_dims, *tensors), (0, 0, 0)

    class RolloutStates(torch.autograd.Function):
        @staticmethod
        def forward(x0: Any, us: Any, theta: Any) -> Any:
            return torch.from_numpy(core.states(*map(array, (x0, us, theta)))).to(us.device)

        @staticmethod
        def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
            ctx.save_for_backward(output, *inputs[1:])

        @staticmethod
        def backward(ctx: Any, by_xs: Any) -> Any:
            return Pullback.apply(*ctx.saved_tensors, by_xs)

        @staticmethod
        def vmap(info: Any, in_dims: Any, *tensors: Any) -> Any:
            return mapped(RolloutStates, info, in_dims, *tensors), 0

    return torch.compiler.disable(RolloutStates.apply)
