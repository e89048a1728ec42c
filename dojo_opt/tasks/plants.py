"""The plant of a closed-loop task."""

from __future__ import annotations

from typing import Any

from dojo_opt.mpc.controller import MPC
from dojo_opt.plant.plant import Plant
from sim.mechanism import checks

__all__ = ["plant"]


def plant(mpc: MPC, time_step: float = 1e-3, kappa: float = 1e-8, **perturbation: Any) -> Plant:
    """The plant of an MPC: the simulator of its problem with a time step and kappa of its own, perturbed.

    Args:
        mpc: the controller.
        time_step: time step of the plant [s].
        kappa: central-path parameter of the plant [N s m].
        **perturbation: fields of `dojo.Perturbation` by name.

    Returns:
        The plant, which starts where the problem does.

    Raises:
        TypeError: `mpc` is not an MPC, or for an unknown field.
        ValueError: for an argument out of range.
    """
    if not isinstance(mpc, MPC):
        raise TypeError(f"tasks.plant(mpc): expected an MPC, got {mpc!r}")
    call, longest = "tasks.plant(time_step=...)", mpc.nominal.time_step
    if checks.number(call, time_step, above=0.0) > longest * (1.0 + 1e-9):
        raise ValueError(f"{call}: expected at most that of the model, {longest:g} s, got {time_step}")
    return Plant(mpc.nominal.replace(time_step=time_step, kappa=kappa), mpc.start, **perturbation)
