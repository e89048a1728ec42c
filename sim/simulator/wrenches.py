"""External wrenches: forces and torques on bodies over time, in the calls of a Simulator.

A body that is pushed gets six inputs more, in a simulator of its own that is made when it is first needed. So wrenches
are exact in a step and in its derivatives, and cost nothing where there are none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.parts import Input
from sim.simulator.border import whole
from sim.simulator.policies import Feedback
from sim.simulator.reactions import Reactions
from sim.simulator.reactions import reactions as transmitted
from sim.simulator.results import Linearization, Shot, StepResult, Trajectory, carried

if TYPE_CHECKING:
    from sim.simulator.simulator import Simulator

Floats = NDArray[np.float64]
Wrenches = ArrayLike | Mapping[str, ArrayLike]

Blocks = dict[str, Floats]

__all__ = [
    "Wrenches", "closed_loop", "linearize", "linearize_by", "linearize_rollout", "linearize_trajectory", "reactions",
    "rollout", "step", "vjp",
]  # fmt: skip


def _table(sim: Simulator, call: str, wrenches: Any, steps: int) -> dict[str, Floats]:
    """(steps, 6) force and torque of every body that is pushed at all."""
    names = sim.mechanism.body_names
    if isinstance(wrenches, Mapping):
        for name in wrenches:
            checks.one_of(f"{call}: body", name, names)
        given = {name: (value, (6,)) for name, value in wrenches.items()}
    else:
        shape = (len(names), 6)
        lead = (steps,) if np.ndim(wrenches) == 3 else ()
        all_of_them = checks.array(call, wrenches, (*lead, *shape))
        given = {name: (all_of_them[..., i, :], (6,)) for i, name in enumerate(names)}
    table = {}
    for name, (value, last) in given.items():
        lead = (steps,) if np.ndim(value) == 2 else ()
        rows = checks.array(f"{call}: body {name!r}", value, (*lead, *last))
        if rows.any():
            table[name] = np.broadcast_to(rows, (steps, 6))
    return table


def _pushed(sim: Simulator, method: str, wrenches: Any, us: Floats) -> tuple[Simulator, Floats]:
    """The simulator with six inputs more for every body that is pushed, and its inputs (steps, nu + 6 n)."""
    table = _table(sim, f"Simulator.{method}(wrenches=...)", wrenches, len(us))
    if not table:
        return sim, us
    kept: dict[tuple[str, ...], Simulator] = sim.__dict__.setdefault("_pushed", {})
    key = tuple(table)
    if key not in kept:
        unit = np.eye(6)
        more = [
            Input(body=body, force=row[:3], torque=row[3:], name=f"wrench on {body} [{k}]")
            for body in key
            for k, row in enumerate(unit)
        ]
        kept[key] = sim.replace(mechanism=replace(sim.mechanism, inputs=[*(sim.mechanism.inputs or ()), *more]))
    return kept[key], np.concatenate([us, *table.values()], axis=1)


def _inputs(sim: Simulator, method: str, name: str, us: ArrayLike) -> Floats:
    """Inputs (steps, nu), checked."""
    return checks.array(f"Simulator.{method}({name})", us, ("T", sim.nu))


def step(sim: Simulator, x: ArrayLike, u: ArrayLike | None, wrenches: Wrenches, throw: bool) -> StepResult:
    """`Simulator.step` under wrenches (nbody, 6)."""
    us = _inputs(sim, "step", "u", np.zeros((1, sim.nu)) if u is None else np.asarray(u)[None])
    other, inputs = _pushed(sim, "step", wrenches, us)
    return other.step(x, inputs[0], throw=throw)


def rollout(
    sim: Simulator, x: ArrayLike, us: ArrayLike | Feedback, wrenches: Wrenches, throw: bool, steps: int | None = None
) -> Trajectory:
    """`Simulator.rollout` under wrenches (T, nbody, 6)."""
    if callable(us):
        steps = whole("Simulator.rollout(steps=...)", steps)
        other, rows = _pushed(sim, "rollout", wrenches, np.zeros((steps, sim.nu)))

        def policy(time: float, state: Floats) -> Floats:
            more = rows[round(time / sim.time_step), sim.nu :]
            return np.concatenate([checks.floats("Simulator.rollout(us)", us(time, state)), more])

        inputs: Any = policy
    else:
        other, rows = _pushed(sim, "rollout", wrenches, _inputs(sim, "rollout", "us", us))
        inputs = rows
    table = _table(sim, "Simulator.rollout(wrenches=...)", wrenches, len(rows))

    def own(found: Trajectory) -> Trajectory:
        """Without the six inputs more, but with the wrenches that they were."""
        given = np.zeros((found.knot, sim.nbody, 6))
        for name, wrench in table.items():
            given[:, sim.mechanism.body_names.index(name)] = wrench[: found.knot]
        return replace(found, simulator=sim, u=np.ascontiguousarray(found.u[:, : sim.nu]), wrenches=given)

    return carried(lambda: other.rollout(x, inputs, steps=steps, throw=throw), own)


def closed_loop(sim: Simulator, x0: ArrayLike, us: ArrayLike, wrenches: Wrenches, **options: Any) -> Shot:
    """`Simulator.closed_loop` under wrenches (T, nbody, 6), which no gain changes."""
    other, inputs = _pushed(sim, "closed_loop", wrenches, _inputs(sim, "closed_loop", "us", us))
    more = other.nu - sim.nu
    for name, axis in (("ks", 1), ("Ks", 1)):
        if options.get(name) is not None:
            part = checks.floats(f"Simulator.closed_loop({name}=...)", options[name])
            pad = [(0, more if k == axis else 0) for k in range(part.ndim)]
            options[name] = np.pad(part, pad)
    if options.get("limits") is not None:
        free = np.full(more, np.inf)
        low, high = sim._border.limits("Simulator.closed_loop", options["limits"])
        options["limits"] = np.concatenate([low, -free]), np.concatenate([high, free])
    return carried(
        lambda: other.closed_loop(x0, inputs, **options),
        lambda found: replace(found, u=np.ascontiguousarray(found.u[:, : sim.nu])),
    )


def linearize(
    sim: Simulator, x: ArrayLike, u: ArrayLike | None, wrenches: Wrenches, kappa: float | None
) -> tuple[Floats, Floats]:
    """`Simulator.linearize` of the step under wrenches (nbody, 6)."""
    us = _inputs(sim, "linearize", "u", np.zeros((1, sim.nu)) if u is None else np.asarray(u)[None])
    other, inputs = _pushed(sim, "linearize", wrenches, us)
    A, B = other.linearize(x, inputs[0], kappa)
    return A, np.ascontiguousarray(B[:, : sim.nu])


def linearize_trajectory(
    sim: Simulator, xs: ArrayLike, us: ArrayLike, wrenches: Wrenches, substeps: int, kappa: float | None
) -> Linearization:
    """`Simulator.linearize_trajectory` under wrenches (T, nbody, 6)."""
    method = "linearize_trajectory"
    other, inputs = _pushed(sim, method, wrenches, _inputs(sim, method, "us", us))
    found = other.linearize_trajectory(xs, inputs, substeps, kappa)
    return replace(found, B=np.ascontiguousarray(found.B[..., : sim.nu]))


def linearize_by(
    sim: Simulator, x: ArrayLike, u: ArrayLike | None, wrenches: Wrenches, kappa: float | None, wrt: Sequence[str]
) -> Blocks:
    """`Simulator.linearize` by names, of the step under wrenches (nbody, 6)."""
    us = _inputs(sim, "linearize", "u", np.zeros((1, sim.nu)) if u is None else np.asarray(u)[None])
    other, inputs = _pushed(sim, "linearize", wrenches, us)
    return _own(sim, other.linearize(x, inputs[0], kappa, wrt=_known(sim, "linearize", wrt)))


def linearize_rollout(
    sim: Simulator, x: ArrayLike, us: ArrayLike, wrenches: Wrenches, kappa: float | None, wrt: Sequence[str]
) -> tuple[Floats, Linearization]:
    """`Simulator.linearize_rollout` under wrenches (T, nbody, 6)."""
    method = "linearize_rollout"
    other, inputs = _pushed(sim, method, wrenches, _inputs(sim, method, "us", us))
    xs, found = other.linearize_rollout(x, inputs, kappa, _known(sim, method, wrt) if wrt else ())
    B = np.ascontiguousarray(found.B[..., : sim.nu])
    return xs, replace(found, B=B, parameters=_own(sim, found.parameters))


def vjp(
    sim: Simulator,
    path: tuple[ArrayLike, ArrayLike],
    dL_dx: ArrayLike,
    wrenches: Wrenches,
    kappa: float | None,
    wrt: Sequence[str],
) -> Blocks:
    """`Simulator.vjp` of a rollout under wrenches (T, nbody, 6); path: its states and inputs."""
    other, inputs = _pushed(sim, "vjp", wrenches, _inputs(sim, "vjp", "trajectory", path[1]))
    return _own(sim, other.vjp((path[0], inputs), dL_dx, _known(sim, "vjp", wrt), kappa))


def reactions(sim: Simulator, x: ArrayLike, u: ArrayLike | None, wrenches: Wrenches | None, frame: str) -> Reactions:
    """`Simulator.reactions` under wrenches, if any: (nbody, 6) or, of a trajectory, (T, nbody, 6)."""
    if wrenches is None:
        return transmitted(sim, x, u, frame)
    states = checks.floats("Simulator.reactions(x)", x)
    if states.ndim > 2:
        raise ValueError(f"Simulator.reactions(wrenches=...): expected x of shape (nx,) or (T, nx), got {states.shape}")
    rows = np.atleast_2d(states)
    us = np.zeros((len(rows), sim.nu)) if u is None else checks.floats("Simulator.reactions(u)", u).reshape(-1, sim.nu)
    other, inputs = _pushed(sim, "reactions", wrenches, checks.array("Simulator.reactions(u)", us, (len(rows), sim.nu)))
    return transmitted(other, states, inputs if states.ndim == 2 else inputs[0], frame)


def _known(sim: Simulator, method: str, wrt: Sequence[str]) -> Sequence[str]:
    """The names, when they mean the same with six inputs more."""
    names = (wrt,) if isinstance(wrt, str) else tuple(wrt)
    sim.parameters([name for name in names if name not in ("state", "input")])
    for name in names:
        if isinstance(name, str) and name.startswith(("input_force:*", "input_torque:*")):
            raise ValueError(f"Simulator.{method}(wrt=...): no {name!r} under wrenches, which are inputs as well")
    return names


def _own(sim: Simulator, blocks: Mapping[str, Floats]) -> Blocks:
    """The blocks without the columns of the six inputs more."""
    counts = {name: len(sim.parameters((name,)).names) for name in blocks if name not in ("state", "input")}
    out = {}
    for name, block in blocks.items():
        count = counts.get(name, sim.nu if name == "input" else block.shape[-1])
        out[name] = np.ascontiguousarray(block[..., :count])
    return out
