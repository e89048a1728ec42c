"""Equilibrium: a state in which a robot stands still, and the joint torques that hold it there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.gaits.feet import Feet
from sim.mechanism import checks
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["equilibrium", "input_map", "potential_gradient"]

_STEP = 1e-5
_EVEN = 1e-6  # weight of the sharing of the load against its balance
_RANK = 1e-7  # singular values below are the noise of differences: balls under one rigid foot do not move one by one
_ROUNDS = 20
_LEFT = 1e-3  # largest imbalance, as a share of the weight
_FEW = 8  # contacts that a message names
_NEAR = 0.01  # [m] contacts may carry that are not further from the ground than the nearest by more than this
_LOWEST = (_NEAR, 1e-3, 1e-4)  # [m] likewise, than the nearest of their body: of a round hull few corners touch at once


def potential_gradient(sim: Simulator, x: ArrayLike) -> Floats:
    """dV/dq (..., nv) of gravity and springs at the coordinates of x (..., nx), by central differences [N, N m]."""
    rest = np.array(x, dtype=float)
    rest[..., sim.nq :] = 0.0
    steps = np.zeros((2 * sim.nv, sim.ndx))
    steps[: sim.nv, : sim.nv] = _STEP * np.eye(sim.nv)
    steps[sim.nv :] = -steps[: sim.nv]
    moved = sim.integrate(rest[..., None, :], steps)
    V = np.asarray(sim.energy(moved)) - np.asarray(sim.kinetic_energy(moved))
    return np.asarray((V[..., : sim.nv] - V[..., sim.nv :]) / (2.0 * _STEP))


def input_map(sim: Simulator) -> Floats:
    """(nv, nu) generalised forces per unit of every input on a joint; those on bodies, such as pushes, have none."""
    out = np.zeros((sim.nv, sim.nu))
    for k, part in enumerate(sim.mechanism.inputs or ()):
        if part.joint is None:
            continue
        out[sim.mechanism.v_slice(part.joint).start + part.dof, k] = part.gain
    return out


def least_pushes(pushes: Floats, load: Floats, even: float) -> Floats:
    """(k,) factors f >= 0 of the rows of `pushes` (k, n) with least |pushes^T f - load|^2 + even^2 |f|^2."""
    from scipy.optimize import nnls  # .3 s, which only legged robots at rest or on a gait need

    rows = np.concatenate([pushes.T, even * np.eye(len(pushes))])
    return np.asarray(nnls(rows, np.concatenate([load, np.zeros(len(pushes))]))[0])


def _between_stops(sim: Simulator, x: Floats) -> Iterator[tuple[str, Floats, Floats, Floats]]:
    """(joint, q, lo, hi) of all joints with scalar coordinates."""
    for joint in sim.mechanism.joints:
        if joint.nrot != 3:
            lo, hi = np.array(list(joint.limits or ()), dtype=np.float64).reshape(-1, 2).T
            yield joint.name, x[sim.mechanism.q_slice(joint.name)], lo, hi


def stop_torques(sim: Simulator, x: Floats) -> Floats:
    """(nv,) mean torque of the joint stops at rest, kappa / (h distance) away from each [N, N m]."""
    out = np.zeros(sim.nv)
    for name, q, lo, hi in _between_stops(sim, x):
        out[sim.mechanism.v_slice(name)] = sim.kappa / sim.time_step * (1.0 / (q - lo) - 1.0 / (hi - q))
    return out


def _check_stops(sim: Simulator, x: Floats) -> None:
    """Refuse a joint at its stop, which pushes it away with an infinite torque on the central path."""
    for name, q, lo, hi in _between_stops(sim, x):
        if lo.size and not np.all((lo < q) & (q < hi)):
            raise ValueError(
                f"equilibrium({sim.mechanism.name}): joint {name!r} is not inside its stops: {q} in [{lo}, {hi}]"
            )


def _under(feet: Feet, state: Floats) -> tuple[Floats, Floats, Floats]:
    """d(gaps)/dq (k, nv), generalised forces (k, nv) of unit vertical forces, and the cosines of the slopes (k,)."""
    normal = feet.normals(state)
    gaps = np.einsum("kc,kcv->kv", normal, feet.jacobian(state))
    return gaps, feet.touching(state).jacobian(state)[:, 2], normal[:, 2]


def _check_friction(name: str, feet: Feet, cosines: Floats, force: Floats) -> None:
    """Refuse vertical forces outside the friction cones."""
    for contact, cosine, loaded in zip(feet.contacts, cosines, force > 0.0, strict=True):
        limit = 0.0 if contact.law == "impact" else contact.friction
        slope = float(np.sqrt(max(0.0, 1.0 - cosine**2)) / max(cosine, 1e-12))
        if loaded and slope > limit + 1e-12:
            raise ValueError(
                f"equilibrium({name}): {contact.name!r} stands on ground of slope {slope:.3g} with friction {limit:g}, "
                "and would slide"
            )


def _standing(
    sim: Simulator, feet: Feet, state: Floats, among: tuple[NDArray[np.bool_], float], iterations: int
) -> tuple[Floats, Floats]:
    """The state near `state` in which contacts carry the load as evenly as they can, and their forces.

    among: the degrees of freedom without an input, and how far above the lowest contact of its body another one may
    carry [m].
    """
    free, near = among
    weight = float(np.abs(potential_gradient(sim, state)).max())
    bodies = np.array([contact.body for contact in sim.mechanism.contacts])
    same = bodies[:, None] == bodies
    for _ in range(iterations):
        down, up, cosine = _under(feet, state)
        gap = feet.gaps(state)
        lowest = np.where(same, gap, np.inf).min(axis=1)
        touching = (gap < gap.min() + _NEAR) & (gap < lowest + near)
        afar = np.where(touching, 0.0, sim.kappa / (sim.time_step * cosine * np.maximum(gap, near)))
        load = potential_gradient(sim, state) - stop_torques(sim, state) - up.T @ afar
        force = least_pushes(up[:, free] * touching[:, None], load[free], _EVEN)
        loaded = force > 1e-3 * weight
        wanted = sim.kappa / (sim.time_step * (cosine * force)[loaded])
        error = wanted - gap[loaded]
        if np.abs(error).max(initial=0.0) < 1e-6 * wanted.min(initial=1.0):
            break
        move = np.zeros(sim.ndx)
        move[: sim.nv] = np.linalg.lstsq(down[loaded], error, rcond=_RANK)[0]
        state = sim.integrate(state, move)
    return _pressed(sim, feet, state, free)


def _pressed(sim: Simulator, feet: Feet, state: Floats, free: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """The state moved until the forces kappa / (h gap) of all contacts balance the free degrees of freedom; the forces.

    Newton's method with the smallest motion. Four balls under a rigid foot cannot float at four given heights, so the
    forces that share a load most evenly are nearly, and not quite, those of a state.
    """
    for _ in range(_ROUNDS):
        gap, (down, up, cosine) = feet.gaps(state), _under(feet, state)
        force = sim.kappa / (sim.time_step * cosine * np.maximum(gap, 1e-12))
        left = potential_gradient(sim, state) - stop_torques(sim, state) - up.T @ force
        if np.abs(left[free]).max(initial=0.0) < 1e-9 * np.abs(left).max() or gap.min() <= 0.0:
            break
        slope = (up[:, free].T * (force / gap)) @ down
        move = np.zeros(sim.ndx)
        move[: sim.nv] = np.linalg.lstsq(slope, -left[free], rcond=_RANK)[0]
        change = np.abs(down @ move[: sim.nv] / gap).max()
        state = sim.integrate(state, move * min(1.0, 0.5 / max(change, 1e-300)))
    return state, sim.kappa / (sim.time_step * _under(feet, state)[2] * np.maximum(feet.gaps(state), 1e-12))


def _held(sim: Simulator, state: Floats, left: Floats, by: str) -> Floats:
    """(nu,) inputs that balance the generalised forces `left` (nv,).  ValueError: those that have no input remain."""
    B = input_map(sim)
    free = ~B.any(axis=1)
    if np.abs(left[free]).max(initial=0.0) > _LEFT * np.abs(potential_gradient(sim, state)).max(initial=0.0):
        k = int(np.flatnonzero(free)[np.abs(left[free]).argmax()])
        raise ValueError(
            f"equilibrium({sim.mechanism.name}): the {by} cannot balance the weight: {left[k]:.3g} N (or N m) is left "
            f"at {sim.mechanism.dof_names[k]!r}"
        )
    return np.asarray(np.linalg.lstsq(B, left, rcond=None)[0], dtype=np.float64)


def _named(names: tuple[str, ...]) -> str:
    """The contacts in words: a few of them by name."""
    few = ", ".join(map(repr, names[:_FEW]))
    return few if len(names) <= _FEW else f"{few} and {len(names) - _FEW} more contacts"


def equilibrium(sim: Simulator, x: ArrayLike | None = None, *, iterations: int = 20) -> tuple[Floats, Floats]:
    """A state of rest near x, and the input that holds it: for robots on feet, arms, and hands that hold an object.

    The contacts press straight down, so nothing creeps on level ground, and share the load as evenly as balance allows.
    The joints balance gravity and springs. Inputs that act on bodies are zero. On the central path a contact with the
    normal impulse g floats kappa / g above the ground: the state is moved to those heights. On slopes friction carries
    a share of the weight, and creeps by an amount proportional to kappa. Contacts that carry load have to be within
    1 cm of the same distance from the ground: `dojo_opt.gaits.feet.Feet.place` puts a robot with legs there on
    terrain.

    The state need not be stable: under constant torques a robot on legs falls within some tenths of a second.

    Args:
        sim: the simulator.
        x: (nx,) state (default None: the neutral state).
        iterations: limit of the Newton iterations.

    Returns:
        (state (nx,), input (nu,) [N, N m]).

    Raises:
        ValueError: a joint of x is not inside its stops, or there is no equilibrium: the centre of mass is not above
            the feet, a joint without input would have to carry load, the ground is steeper than friction holds, a
            contact is in the ground, or the smoothing is so large that inactive contacts carry the weight.
    """
    if not isinstance(sim, Simulator):
        raise TypeError(f"equilibrium(sim): expected a Simulator, got {sim!r}")
    mech = sim.mechanism
    names = mech.contact_names[: len(mech.contacts)]
    state = np.array(sim.neutral() if x is None else checks.array("equilibrium(x)", x, (sim.nx,)))
    state[sim.nq :] = 0.0
    _check_stops(sim, state)
    free = np.asarray(~input_map(sim).any(axis=1))
    if not names:
        return state, _held(sim, state, potential_gradient(sim, state) - stop_torques(sim, state), "inputs")
    feet, weight = Feet(sim, names), float(np.abs(potential_gradient(sim, state)).max())
    for near in _LOWEST:
        found, force = _standing(sim, feet, state, (free, near), iterations)
        gap = feet.gaps(found)
        _, up, cosine = _under(feet, found)
        left = potential_gradient(sim, found) - stop_torques(sim, found) - up.T @ force
        if gap.min() > 0.0 and np.abs(left[free]).max(initial=0.0) <= _LEFT * weight:
            break
    if gap.min() <= 0.0:
        name = feet.names[int(gap.argmin())]
        raise ValueError(f"equilibrium({mech.name}): {name!r} is {-gap.min():.3g} m deep in the ground near x")
    u = _held(sim, found, left, f"vertical forces at {_named(feet.names)}")
    _check_friction(mech.name, feet, cosine, np.where(force > 1e-3 * weight, force, 0.0))
    return found, u
