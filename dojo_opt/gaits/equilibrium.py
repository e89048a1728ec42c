"""Equilibrium: a state in which a robot stands still, and the joint torques that hold it there."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.static_motions import StaticMotions, pushes
from dojo_opt.planning.manifold import cross
from sim.mechanism import checks
from sim.simulator.kinematics import Kinematics
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["at_rest_on_ground", "equilibrium", "potential_gradient"]

_STEP = 1e-5
_NOISE = 1e-7  # singular values below this part of the largest are those of differences in Jacobians
_EVEN = 1e-6  # weight of the sharing of the load against its balance
_RANK = 1e-7  # singular values below are the noise of differences: balls under one rigid foot do not move one by one
_ROUNDS = 20
_LEFT = 1e-3  # largest imbalance, as a share of the weight
_NOTHING = 1e-5  # [m/s^2] times the mass: an imbalance of a body without weight, such as one that floats in water
_FEW = 8  # contacts that a message names
_TOUCHING = 1e-12  # [m] least distance from the ground in forces
_NEAR = 0.01  # [m] contacts may carry that are not further from the ground than the nearest by more than this
_LOWEST = (_NEAR, 1e-3, 1e-4)  # [m] likewise, than the nearest of their body: of a round hull few corners touch at once

_MOVED = 0.05  # of the size of a robot: how far its parts may go where it has to lean or to settle, 1 cm at least
_SETTLED = 20  # Newton iterations per kappa
_FALL = 0.1  # of one kappa to the next
_LEANS = 6
_BALANCED = 1e-7  # share of the weight that is as good as none
_TIPS = 1e-4  # singular values below this share are the noise of differences of the tipping
_STRIDE, _HALVINGS = 0.1, 20  # [m, rad] largest step of a settling robot, and halvings of it
_ALOFT = 1e-4  # [m] above the ground, where settling begins
_EXACT = 1e-2  # of the largest imbalance: below it no other search is tried
_SUM = 1e3  # [m] weight of the sum of factors, much more than the size of a robot
_ROUNDED, _HARDEST = 1e-10, 4e-15  # of the size: gaps with forces right to a thousandth, and with any at all
_UNLOADED = 1e-6  # share of the weight
_BESIDE = 1e-4  # [m] a distance that a weight beside its contacts has at least
_ABOUND = (
    1e-3  # of the largest load, and of the range of a joint: torque of a stop, and distance from it, that are small
)


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


def least_pushes(pushes: Floats, load: Floats, even: float) -> Floats:
    """(k,) factors f >= 0 of the rows of `pushes` (k, n) with least |pushes^T f - load|^2 + even^2 |f|^2."""
    from scipy.optimize import nnls  # .3 s, which only legged robots at rest or on a gait need

    rows = np.concatenate([pushes.T, even * np.eye(len(pushes))])
    factors = np.asarray(nnls(rows, np.concatenate([load, np.zeros(len(pushes))]))[0])
    # two feet cannot turn a robot about the line between them: once more for the factors that are not zero, without the
    # singular value of that turn, which is zero but for the noise of the Jacobian
    free = factors > 0.0
    U, sizes, Vt = np.linalg.svd(pushes[free].T, full_matrices=False)
    large = sizes > _NOISE * sizes.max(initial=0.0)
    found = Vt[large].T @ (sizes[large] / (sizes[large] ** 2 + even * even) * (U.T[large] @ load))
    if np.all(found >= 0.0):
        factors[free] = found
    return factors


def _stop_distances(sim: Simulator, x: Floats) -> tuple[Floats, Floats]:
    """(nv,) distances of the joints from their lower and upper stops, infinite without one; cones are no stops here."""
    below, above = np.full(sim.nv, np.inf), np.full(sim.nv, np.inf)
    low, high = sim.mechanism.coordinate_limits
    for joint in sim.mechanism.joints:
        q, v = sim.mechanism.q_slice(joint.name).start, sim.mechanism.v_slice(joint.name).start
        for k in range(joint.scalar_count):
            below[v + k], above[v + k] = x[q + k] - low[q + k], high[q + k] - x[q + k]
    return below, above


def stop_torques(sim: Simulator, x: Floats, kappa: float | None = None) -> Floats:
    """(nv,) mean torque of the joint stops at rest, kappa / (h distance) away from each [N, N m]."""
    below, above = _stop_distances(sim, x)
    return np.asarray((sim.kappa if kappa is None else kappa) / sim.time_step * (1.0 / below - 1.0 / above))


def _off_stops(sim: Simulator, x: Floats) -> Floats:
    """The state with joints that are at a stop a little off it: so far that its torque is a small load.

    On the central path the torque of a stop grows without bound towards it.

    Raises:
        ValueError: a joint is beyond its stop.
    """
    out, h = x.copy(), sim.time_step
    load = _weight(sim, x)
    q, (lo, hi) = x[: sim.nq], sim.mechanism.coordinate_limits
    span = np.where(np.isfinite(lo) & np.isfinite(hi), hi - lo, 1.0)
    beyond = (q < lo - 1e-9 * span) | (q > hi + 1e-9 * span)
    for joint in sim.mechanism.joints:
        at = sim.mechanism.q_slice(joint.name)
        if beyond[at].any():
            raise ValueError(
                f"equilibrium({sim.mechanism.name}): joint {joint.name!r} is beyond its stops: {q[at]} in [{lo[at]}, "
                f"{hi[at]}]"
            )
    least = sim.kappa / (h * max(load, 1e-9))
    off = np.minimum(np.maximum(least, np.minimum(least / _ABOUND, _ABOUND * span)), 0.5 * span)
    out[: sim.nq] = np.where(q <= lo, lo + off, np.where(q >= hi, hi - off, q))
    return out


def _under(feet: Feet, state: Floats) -> tuple[Floats, Floats, Floats]:
    """d(gaps)/dq (k, nv), generalised forces (k, nv) of unit vertical forces, and the cosines of the slopes (k,)."""
    kin, normal, bodies = Kinematics(feet.sim), feet.normals(state), [contact.body for contact in feet.contacts]
    places, q = feet.positions(state), state[: feet.sim.nq]
    rows = {name: (kin.jacobian(name, q), kin.pose(name, q)[0]) for name in dict.fromkeys(bodies)}
    J = np.stack([rows[name][0] for name in bodies])
    arm = places - np.stack([rows[name][1] for name in bodies])
    turn = J[:, 3:]  # (k, 3, nv); a point of the body moves by v + w x arm
    down = np.einsum("kc,kcv->kv", normal, J[:, :3]) + np.einsum("kc,kcv->kv", cross(arm, normal), turn)
    arm = arm - feet.radius[:, None] * normal
    up = J[:, 2] + arm[:, 1, None] * turn[:, 0] - arm[:, 0, None] * turn[:, 1]
    return down, up, normal[:, 2]


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


class _Balance(NamedTuple):
    """The forces at a state, and how they change by motions along (nv, n)."""

    left: Floats  # (m,) imbalance
    slope: Floats  # (m, n) its derivative
    change: Callable[[Floats], float]  # largest relative change of a gap, or distance from a stop, by a motion (nv,)
    weight: float  # largest generalised force of gravity and springs


class _Rest(NamedTuple):
    """The search for a state of rest of a robot on contacts."""

    sim: Simulator
    feet: Feet  # all contacts
    motions: StaticMotions

    def load(self, state: Floats, kappa: float) -> Floats:
        """(nv,) generalised forces of gravity, springs and stops, without the contacts."""
        return potential_gradient(self.sim, state) - stop_torques(self.sim, state, kappa)

    def forces(self, state: Floats, kappa: float) -> Floats:
        """(k,) vertical forces of the contacts, kappa / (h gap) along their normals."""
        gap, cosine = self.feet.gaps(state), self.feet.normals(state)[:, 2]
        return np.asarray(kappa / (self.sim.time_step * cosine * np.maximum(gap, _TOUCHING)))

    def touching(self, gap: Floats, near: float) -> NDArray[np.bool_]:
        """(k,) whether contacts may carry: those that are nearly as low as any, and within `near` [m] of their body's.

        gap: (k,) their distances from the ground [m].
        """
        bodies = np.array([contact.body for contact in self.feet.contacts])
        lowest = np.where(bodies[:, None] == bodies, gap, np.inf).min(axis=1)
        return (gap < gap.min() + _NEAR) & (gap < lowest + near)

    def standing(self, state: Floats, near: float, iterations: int) -> Floats:
        """The state near `state` in which contacts carry the load as evenly as they can.

        near: how far above the lowest contact of its body another one may carry [m].
        """
        sim, feet, (_, allowed, loose) = self.sim, self.feet, self.motions
        weight = _weight(sim, state)
        for _ in range(iterations):
            down, up, cosine = _under(feet, state)
            gap = feet.gaps(state)
            touching = self.touching(gap, near)
            afar = np.where(touching, 0.0, sim.kappa / (sim.time_step * cosine * np.maximum(gap, near)))
            load = self.load(state, sim.kappa) - up.T @ afar
            force = least_pushes((up @ loose) * touching[:, None], loose.T @ load, _EVEN)
            loaded = force > 1e-3 * weight
            wanted = sim.kappa / (sim.time_step * (cosine * force)[loaded])
            error = wanted - gap[loaded]
            if np.abs(error).max(initial=0.0) < 1e-6 * wanted.min(initial=1.0):
                break
            by = np.linalg.lstsq(down[loaded] @ allowed, error, rcond=_RANK)[0]
            state = self.motions.move(sim, state, allowed @ by)
        return self.pressed(state, allowed, sim.kappa, _ROUNDS)

    def pressed(self, state: Floats, along: Floats, kappa: float, rounds: int) -> Floats:
        """The state moved until the forces kappa / (h gap) of all contacts balance the load.

        Newton's method with the smallest motion. Four balls under a rigid foot cannot float at four given heights, so
        the forces that share a load most evenly are nearly, and not quite, those of a state.

        along: (nv, n) motions that it may take.
        """
        for _ in range(rounds):
            at = self.balance(state, along, kappa)
            if np.abs(at.left).max(initial=0.0) < 1e-9 * at.weight or self.feet.gaps(state).min() <= 0.0:
                break
            by = along @ np.linalg.lstsq(at.slope, -at.left, rcond=_RANK)[0]
            state = self.motions.move(self.sim, state, by * min(1.0, 0.5 / at.change(by)))
        return state

    def balance(self, state: Floats, along: Floats, kappa: float) -> _Balance:
        """The forces at a state, with their derivatives by motions `along` (nv, n)."""
        loose, (down, up, _) = self.motions.loose, _under(self.feet, state)
        gap = np.maximum(self.feet.gaps(state), _TOUCHING)
        force, (below, above) = self.forces(state, kappa), _stop_distances(self.sim, state)
        gravity = potential_gradient(self.sim, state)
        left = self.motions.left(gravity - stop_torques(self.sim, state, kappa) - up.T @ force)
        stiff = kappa / self.sim.time_step * (1.0 / below**2 + 1.0 / above**2)
        slope = (up @ loose).T @ ((force / gap)[:, None] * (down @ along)) + loose.T @ (stiff[:, None] * along)

        def change(by: Floats) -> float:
            parts = (down @ by / gap, by / below, by / above)
            return max(1e-300, *(float(np.abs(part).max(initial=0.0)) for part in parts))

        return _Balance(left, slope, change, float(np.abs(gravity).max()))

    def leaned(self, state: Floats, iterations: int) -> Floats:
        """The state that shifts its weight over its contacts, where these are too few to carry it as it is."""
        sim, allowed = self.sim, self.motions.allowed
        weight = _weight(sim, state)
        for _ in range(_LEANS):
            state = self.standing(state, _LOWEST[-1], iterations)
            left = self.balance(state, allowed, sim.kappa).left
            if self.feet.gaps(state).min() <= 0.0 or np.abs(left).max(initial=0.0) < _BALANCED * weight:
                break
            # those without a load, too: a motion that tips the robot may not push them into the ground
            gap = self.feet.gaps(state)
            touching = self.touching(gap, _LOWEST[-1])
            _, sizes, rows = np.linalg.svd(_under(self.feet, state)[0][touching] @ allowed)
            fixed = rows[int((sizes > _RANK * sizes.max(initial=0.0)).sum()) :].T  # motions that leave the gaps
            by = allowed @ fixed @ np.linalg.lstsq(self.tipping(state) @ fixed, -left, rcond=_TIPS)[0]
            state = self.motions.move(sim, state, by * min(1.0, _STRIDE / np.abs(by).max(initial=1e-300)))
            state = self.lifted(state, touching, gap[touching])
        return state

    def lifted(self, state: Floats, touching: NDArray[np.bool_], gap: Floats) -> Floats:
        """The state with contacts at given gaps (k,) again, which a finite motion along them leaves to second order."""
        for _ in range(_ROUNDS):
            error = gap - self.feet.gaps(state)[touching]
            if (np.abs(error) < 0.5 * gap).all():
                break
            down = _under(self.feet, state)[0][touching] @ self.motions.allowed
            by = self.motions.allowed @ np.linalg.lstsq(down, error, rcond=_RANK)[0]
            state = self.motions.move(self.sim, state, by)
        return state

    def tipping(self, state: Floats) -> Floats:
        """(m, n) derivative of the imbalance by the motions allowed, at given forces of the contacts."""
        sim, (_, allowed, loose) = self.sim, self.motions
        force = self.forces(state, sim.kappa)
        out = np.empty((loose.shape[1], allowed.shape[1]))
        for k, along in enumerate(_STEP * allowed.T):
            loads = [
                potential_gradient(sim, y) - _under(self.feet, y)[1].T @ force
                for y in (self.motions.move(sim, state, along), self.motions.move(sim, state, -along))
            ]
            out[:, k] = self.motions.left(loads[0] - loads[1]) / (2.0 * _STEP)
        return out

    def settled(self, state: Floats) -> Floats:
        """The state that the robot sinks into with its driven joints held, on contacts that become hard as it sinks.

        Along `loose`, from where nothing touches: which contacts carry is found by the smoothing, from afar. Inputs
        that hold all joints of an arm lift it off the ground.
        """
        sim, feet, (_, allowed, loose) = self.sim, self.feet, self.motions
        along = loose if loose.size else allowed
        for _ in range(_ROUNDS):
            short = np.maximum(_ALOFT - feet.gaps(state), 0.0)
            if not short.any():
                break
            down = _under(feet, state)[0] @ along
            by = along @ np.linalg.lstsq(down[short > 0.0], 1.1 * short[short > 0.0], rcond=_RANK)[0]
            state = self.motions.move(sim, state, by)
        weight = _weight(sim, state)
        kappa = max(sim.kappa, _NEAR * sim.time_step * weight / len(feet.names))
        while True:
            state = self.sunk(state, kappa)
            if kappa <= sim.kappa:
                return self.pressed(state, loose, kappa, _ROUNDS)
            kappa = max(sim.kappa, _FALL * kappa)

    def sunk(self, state: Floats, kappa: float) -> Floats:
        """The state of least potential along `loose`, near `state`: that of gravity, springs, and contacts at kappa.

        Newton's method without the curvature of gravity, which leaves its directions those of a descent.
        """
        sim, loose, level = self.sim, self.motions.loose, self.potential(state, kappa)
        for _ in range(_SETTLED):
            at = self.balance(state, loose, kappa)
            if np.abs(at.left).max(initial=0.0) < _LEFT * at.weight:
                break
            by = loose @ np.linalg.lstsq(at.slope, -at.left, rcond=_RANK)[0]
            by *= min(1.0, 0.5 / at.change(by), _STRIDE / np.abs(by).max(initial=1e-300))
            for _ in range(_HALVINGS):
                moved = self.motions.move(sim, state, by)
                now = self.potential(moved, kappa)
                if now < level:
                    break
                by = 0.5 * by
            else:
                break
            state, level = moved, now
        return state

    def potential(self, state: Floats, kappa: float) -> float:
        """V - kappa/h sum(log gaps) [J]; infinite in the ground, or beyond a stop.  Slopes as if they were level."""
        distances = np.concatenate([self.feet.gaps(state), *_stop_distances(self.sim, state)])
        if distances.min() <= 0.0:
            return np.inf
        rest = np.array([*state[: self.sim.nq], *np.zeros(self.sim.nv)])
        barrier = kappa / self.sim.time_step * np.log(distances[np.isfinite(distances)]).sum()
        return float(self.sim.energy(rest) - self.sim.kinetic_energy(rest) - barrier)


def _held(
    sim: Simulator, motions: StaticMotions, load: Floats, most: float, by: str, why: Callable[[], str] = str
) -> Floats:
    """(nu,) inputs that balance a load (nv,).  ValueError: more than `most` of it remains, and why."""
    left = motions.left(load)
    if np.abs(left).max(initial=0.0) > most:
        k = int(np.abs(left).argmax())
        raise ValueError(
            f"equilibrium({sim.mechanism.name}): the {by} cannot balance the weight: {left[k]:.3g} N (or N m) is left "
            f"at {sim.mechanism.dof_names[int(np.abs(motions.loose[:, k]).argmax())]!r}{why()}"
        )
    return motions.holding(load)


def _beside(rest: _Rest, state: Floats) -> str:
    """How far the centre of mass is beside the contacts at the ground, in words; "" where it is above them.

    The nearest point of their convex hull has factors >= 0 of their places, whose sum is 1.
    """
    sim, feet = rest.sim, rest.feet
    base, *others = sim.mechanism.joints
    if base.kind != "floating" or any(joint.kind == "floating" for joint in others):
        return ""
    com = Kinematics(sim).center_of_mass(state[: sim.nq])[:2]
    places = feet.positions(state)[rest.touching(feet.gaps(state), _NEAR), :2]
    factors = least_pushes(np.column_stack([places - com, np.full(len(places), _SUM)]), np.array([0.0, 0.0, _SUM]), 0.0)
    away = com - factors @ places
    far = float(np.linalg.norm(away))
    if far < _BESIDE:
        return ""
    return (
        f"; the centre of mass is {far:.2g} m beside the contacts at the ground, towards ({away[0]:.2g}, {away[1]:.2g})"
        "; move the feet below it, by x=... or by neutral=... of the file"
    )


def _named(names: tuple[str, ...]) -> str:
    """The contacts in words: a few of them by name."""
    few = ", ".join(map(repr, names[:_FEW]))
    return few if len(names) <= _FEW else f"{few} and {len(names) - _FEW} more contacts"


def equilibrium(sim: Simulator, x: ArrayLike | None = None, *, iterations: int = 20) -> tuple[Floats, Floats]:
    """A state of rest near x, and the input that holds it: for arms, hands and robots on feet or lying on the ground.

    The contacts press straight down, so nothing creeps on level ground, and share the load as evenly as balance allows.
    The joints balance gravity and springs, loops and gears included. Inputs that act on bodies are zero, and so are
    forces on a free base that is on the ground. Contacts of a robot that its inputs hold entirely carry nothing. On the
    central path a contact with the normal impulse g floats kappa / g above the ground: the state is moved to those
    heights. On slopes friction carries a share of the weight, and creeps by an amount proportional to kappa. Contacts
    that carry load have to be within 1 cm of the same distance from the ground: `dojo_opt.gaits.feet.Feet.place` puts a
    robot with legs there on terrain. A robot whose weight is beside its feet bends its joints to lean over them, or
    sinks onto the ground with its joints as they are, by a twentieth of its size, or 1 cm if that is more. A joint at
    its stop is moved off it, so little that the torque of the stop is a small part of the load. Contacts of bodies with
    one another carry nothing.

    With steps of order 4 to 8 the velocity is that of the node before the ground acts: standing still, g h/2. Where
    kappa is so small that rounding changes the distances that belong to it, as with an accuracy, a larger one finds the
    forces; the distances are then those of the small one, as far as rounding allows.

    The state need not be stable: under constant torques a robot on legs falls within some tenths of a second.

    Args:
        sim: the simulator.
        x: (nx,) state (default None: the neutral state).
        iterations: limit of the Newton iterations of a search on contacts that stay; a robot that leans or sinks has
            limits of its own.

    Returns:
        (state (nx,), input (nu,) [N, N m]).

    Raises:
        ValueError: a joint of x is beyond its stops, or there is no equilibrium: the centre of mass is not above
            the feet, a joint without input would have to carry load, the ground is steeper than friction holds, a
            contact is in the ground, or the smoothing is so large that inactive contacts carry the weight.
    """
    if not isinstance(sim, Simulator):
        raise TypeError(f"equilibrium(sim): expected a Simulator, got {sim!r}")
    state = np.array(sim.neutral() if x is None else checks.array("equilibrium(x)", x, (sim.nx,)))
    state[sim.nq :] = 0.0
    kappa = max(sim.kappa, _level(sim, state))
    hard = kappa > sim.kappa
    soft = sim.replace(order=2, accuracy=None, kappa=kappa) if hard else sim
    found, u = _at_rest(soft, state, iterations)
    if hard:
        found = _pressed_harder(soft, found, sim.kappa)
    return _with_velocity(sim, found, u), u


def _weight(sim: Simulator, state: Floats) -> float:
    """Largest generalised force of gravity and springs, beside which others are small [N, N m]."""
    return float(np.abs(potential_gradient(sim, state)).max(initial=0.0))


def _level(sim: Simulator, state: Floats) -> float:
    """The kappa with gaps that rounding leaves right, at least [N s m]."""
    weight = _weight(sim, state)
    return _ROUNDED * _size(sim, state) * sim.time_step * weight


def _size(sim: Simulator, state: Floats) -> float:
    """Largest coordinate of a body, by which distances are rounded [m]."""
    return max(float(np.abs(sim.maximal(state)[:, :3]).max(initial=0.0)), _NEAR)


def _pressed_harder(sim: Simulator, state: Floats, kappa: float) -> Floats:
    """The state of rest at a smaller kappa than that of `sim`, with the same forces.

    Distances of loaded contacts and stops fall with kappa, no further than rounding allows: by less than a thousandth
    of the millionth part of the robot's size.
    """
    motions, names = StaticMotions.at(sim, state), sim.mechanism.ground_contact_names
    rows, distances = [np.eye(sim.nv), -np.eye(sim.nv)], list(_stop_distances(sim, state))
    slopes = [np.ones(sim.nv), np.ones(sim.nv)]
    if names:
        feet = Feet(sim, names)
        down, _, cosine = _under(feet, state)
        rows, distances, slopes = [*rows, down], [*distances, feet.gaps(state)], [*slopes, cosine]
    weight = _weight(sim, state)
    force = sim.kappa / (sim.time_step * np.concatenate(slopes) * np.concatenate(distances))
    loaded = force > _UNLOADED * weight
    distance, along = np.concatenate(distances)[loaded], np.concatenate(rows)[loaded] @ motions.allowed
    wanted = np.minimum(np.maximum(distance * kappa / sim.kappa, _HARDEST * _size(sim, state)), distance)
    by = np.linalg.lstsq(along, wanted - distance, rcond=_RANK)[0]
    return motions.move(sim, state, motions.allowed @ by)


def at_rest_on_ground(sim: Simulator, x: Floats) -> Floats:
    """States (..., nx) that rest on the ground at the coordinates of x (..., nx).

    With orders 4 to 8 they have the velocity of the node before the ground acts, otherwise none.
    """
    rest = x.copy()
    rest[..., sim.nq :] = 0.0
    if sim.order > 2 and sim.accuracy is None:
        rest[..., sim.nq :] = sim.replace(order=2).velocity(rest)
    return rest


def _with_velocity(sim: Simulator, state: Floats, u: Floats) -> Floats:
    """The state of rest with its velocity: which order a step has, and so what rests, a step tells."""
    if sim.order == 2 or sim.accuracy is not None or np.array_equal(sim.step(state, u).x, state):
        return state
    starts = np.stack([state, at_rest_on_ground(sim, state)])
    ends = [sim.step(x, u) for x in starts]
    moved = [
        float(np.abs(sim.difference(end.x, x)).max()) if end.success else np.inf
        for x, end in zip(starts, ends, strict=True)
    ]
    return starts[int(np.argmin(moved))]


def _at_rest(sim: Simulator, x: Floats, iterations: int) -> tuple[Floats, Floats]:
    """`equilibrium` near a state (nx,) without velocity, at a kappa that rounding allows."""
    mech, state = sim.mechanism, sim.close(_off_stops(sim, x))
    weight = _weight(sim, state)
    most = max(_LEFT * weight, _NOTHING * sum(body.mass for body in mech.bodies))
    if not mech.ground_contact_names:
        load = potential_gradient(sim, state) - stop_torques(sim, state)
        return state, _held(sim, StaticMotions.at(sim, state), load, most, "inputs")
    idle = pushes(sim)
    if idle.any() and Feet(sim, mech.ground_contact_names).gaps(state).min() < _NEAR:  # it is on the ground
        with suppress(ValueError):
            return _on_ground(sim, state, most, StaticMotions.at(sim, state, idle), iterations)
    return _on_ground(sim, state, most, StaticMotions.at(sim, state), iterations)


def _on_ground(
    sim: Simulator, state: Floats, most: float, motions: StaticMotions, iterations: int
) -> tuple[Floats, Floats]:
    """The state of rest near `state` of a robot with contacts, and the inputs; most: imbalance that may remain."""
    mech, names = sim.mechanism, sim.mechanism.ground_contact_names
    weight = _weight(sim, state)
    rest = _Rest(sim, Feet(sim, names), motions)
    found, load, force = _on_contacts(rest, state, most, iterations)
    gaps, left = rest.feet.gaps(found), motions.left(load)
    held = gaps.min() > 0.0 and np.abs(left).max(initial=0.0) <= most and _near(rest, found, state)
    if most > _LEFT * weight and not held:
        raise ValueError(
            f"equilibrium({mech.name}): nothing presses it onto its contacts, which push it off; begin higher"
        )
    if gaps.min() <= 0.0:
        gap = min((rest.feet.gaps(y) for y in (state, found)), key=np.min)
        name = names[int(gap.argmin())]
        raise ValueError(f"equilibrium({mech.name}): {name!r} is {-gap.min():.3g} m deep in the ground near x")
    u = _held(sim, motions, load, most, f"vertical forces at {_named(names)}", partial(_beside, rest, state))
    _check_friction(mech.name, rest.feet, rest.feet.normals(found)[:, 2], np.where(force > 1e-3 * weight, force, 0.0))
    return found, u


def _on_contacts(rest: _Rest, state: Floats, most: float, iterations: int) -> tuple[Floats, Floats, Floats]:
    """The state of rest near `state`, or the last one tried; the load (nv,) there, and the forces of the contacts."""
    searches: list[Callable[[], Floats]] = [lambda: state]  # it may float, or rest already
    searches += [partial(rest.standing, state, near, iterations) for near in _LOWEST]
    searches += [partial(rest.leaned, state, iterations), partial(rest.settled, state)]
    heavy = most <= _LEFT * _weight(rest.sim, state)
    first = best = None
    least = np.inf
    for k, search in enumerate(searches):
        if best is not None and k == len(searches) - 1:  # only a robot that stands nowhere else sinks
            return best
        found = search()
        force = rest.forces(found, rest.sim.kappa)
        load = rest.load(found, rest.sim.kappa) - _under(rest.feet, found)[1].T @ force
        ended = found, load, force
        left = float(np.abs(rest.motions.left(load)).max(initial=0.0))
        balanced = rest.feet.gaps(found).min() > 0.0 and left <= most
        may_go = 0 < k <= len(_LOWEST) and heavy  # contacts push what has no weight as far as rounding lets them
        enough = least if k else _EXACT * most if heavy else most
        if balanced and left < enough and (may_go or _near(rest, found, state)):
            best, least = ended, left
            if left <= _EXACT * most:
                return best
        first = ended if k == 1 else first
    assert first is not None
    return best or first


def _near(rest: _Rest, found: Floats, state: Floats) -> bool:
    """Whether the robot went no further than it may to lean, or to settle."""
    before, after = (np.concatenate([rest.feet.positions(x), rest.sim.maximal(x)[:, :3]]) for x in (state, found))
    size = float(np.ptp(before, axis=0).max())
    return float(np.abs(after - before).max()) <= max(_NEAR, _MOVED * size)
