"""Bridges: steps and rollouts of a simulator as differentiable functions of JAX and of PyTorch.

    step, rollout = dojo.bridges.to_jax(sim, kappa=1e-3)
    dloss = jax.grad(lambda us: loss(rollout(x0, us)))

Neither framework is imported before its function is called.
"""

from dojo_opt.bridges.jax_bridge import to_jax
from dojo_opt.bridges.rollouts import Functions
from dojo_opt.bridges.torch_bridge import to_torch

__all__ = ["Functions", "to_jax", "to_torch"]
