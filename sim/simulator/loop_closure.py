"""States of mechanisms with closed loops: the gaps of the loops, and the nearest state that closes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim.dynamics.loops.closest_root import jacobian, nearest, newton
from sim.dynamics.loops.loop_rank import LoopRank
from sim.mechanism.axes import contact_frame, fixed_axes
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.loop_joints import is_weld
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import rotation_matrices, rotation_matrix
from sim.model.state_columns import BodyState
from sim.simulator.engines.mean_states import MeanStates
from solvers.types import Floats

_APART = 0.1  # [m, rad] parts of a cut body that are farther apart are first brought together
_DISPLACEMENT = 0.03  # [m, rad]
_STARTS_OF_ONE_LOOP = (
    2  # starts of each distance of one loop alone, which are only to explain why all of them stay open
)
_STARTS = 30  # repetitions, each of which halves the error at least
_DEPENDENT = 1e-6  # singular values below this share of the largest belong to redundant constraints


def _angle(sine: Floats, cosine: Floats) -> Floats:
    """The rotation vectors along sin(angle) direction, of rows."""
    size = np.linalg.norm(sine, axis=1)
    return sine * (np.arctan2(size, cosine) / np.where(size > 0.0, size, np.inf))[:, None]


class _Frame(NamedTuple):
    """The constrained directions of a loop joint."""

    turn: Floats  # (3, 3) joint to parent
    held: Floats  # (n, 3) directions along which it does not slide
    axes: Floats  # (3, 3) its axis, and two across


class Closure:
    """The loop constraints of a mechanism, as sim/dynamics/loops/closure.py has them, for Python."""

    def __init__(self, mechanism: Mechanism, states: MeanStates) -> None:
        self._mechanism, self._states = mechanism, states
        self._nq = mechanism.nq
        self._h = states.h
        self._frames = {
            j.name: _Frame(rotation_matrix(j.orientation), fixed_axes(j), contact_frame(j.axis))
            for j in mechanism.loops
        }

    def gaps(self, x: Floats) -> dict[str, Floats]:
        """By loop joint and gear, the violation of its constraints at x: distances [m], then angles [rad].

        Angles and not the sines of the step (sim/dynamics/loops/closure.py), which vanish after half a turn as well.
        """
        return {name: gap[0] for name, gap in self._gaps(x[None]).items()}

    def errors(self, qs: Floats) -> Floats:
        """All gaps of coordinates (n, nq) in rows (n, k), in the order of `gaps`."""
        still = np.zeros((len(qs), self._mechanism.nv))
        return np.concatenate([*self._gaps(np.concatenate([qs, still], axis=1)).values()], axis=1)

    def _gaps(self, xs: Floats, only: str = "") -> dict[str, Floats]:
        """All gaps of `gaps`, or the one of a row."""
        mech = self._mechanism
        z = self._states.maximal(xs)
        out = {joint.name: self._gap(joint, z) for joint in mech.loops if only in ("", joint.name)}
        for gear in mech.gears:
            if only in ("", name := f"gear {gear.name}"):
                a, b = mech.q_slice(gear.joint).start + gear.dof, mech.q_slice(gear.other).start + gear.other_dof
                out[name] = xs[:, [a]] - gear.ratio * xs[:, [b]] - gear.offset
        return out

    def _gap(self, joint: Joint, z: Floats) -> Floats:
        names, fixed = self._mechanism.body_names, self._frames[joint.name]
        a = z[:, names.index(joint.child)]
        Ra = rotation_matrices(a[:, BodyState.QUATERNION])
        apart, Q = a[:, :3] + Ra @ np.asarray(joint.child_point) - np.asarray(joint.parent_point), fixed.turn
        if joint.parent != WORLD:
            b = z[:, names.index(joint.parent or "")]
            Rb = rotation_matrices(b[:, BodyState.QUATERNION])
            apart = a[:, :3] + Ra @ np.asarray(joint.child_point) - b[:, :3] - Rb @ np.asarray(joint.parent_point)
            Q = Rb @ fixed.turn
        back = np.swapaxes(Q, -1, -2)
        E = back @ Ra
        if joint.nrot == 1:
            axis = E @ fixed.axes[0]
            turned = _angle(axis @ fixed.axes[1:].T, axis @ fixed.axes[0])
        else:
            sine = np.stack([E[:, 2, 1] - E[:, 1, 2], E[:, 0, 2] - E[:, 2, 0], E[:, 1, 0] - E[:, 0, 1]], axis=1)
            turned = _angle(0.5 * sine, 0.5 * (np.trace(E, axis1=1, axis2=2) - 1.0))
        held = (back @ apart[:, :, None])[:, :, 0] @ fixed.held.T
        return np.concatenate([held, turned if joint.nrot < 3 else turned[:, :0]], axis=1)

    def close(self, x: Floats, *, search: bool = True) -> Floats:
        """The state near x whose loops are closed at both ends of its interval, or along which its velocity is.

        search: whether to look further away where Newton's method finds none, as from a linkage in one line.
        ValueError: there is none near, with the loop that stays open and by how much.
        """
        nv = self._mechanism.nv
        x = self._placed(x, search)
        along = self._states.along_loops(x)
        if along is not None:
            x[self._nq :] = along
            return x

        def before(dv: Floats) -> Floats:
            back = np.concatenate([-self._h * (x[self._nq :] + dv), np.zeros((len(dv), nv))], axis=1)
            return self._states.integrate(np.tile(x, (len(dv), 1)), back)

        x[self._nq :] += self._solve(before)
        return x

    def _placed(self, x: Floats, search: bool) -> Floats:
        """The state near x whose loops are closed at its end."""
        place = self._around(self._with_shares(x))
        return place(self._solve(place, search)[None])[0]

    def start(self, q: Floats, v: Floats) -> Floats:
        """The closed state near q whose velocity at the node is the part of v along the loops.

        Closing the interval before the node changes the velocity by O(h), which is made up for by repetition.
        """
        q = self._reachable(q)
        wanted = self._states.node_velocities(self._states.started(q, v)[None])[0]
        given, best, x = wanted.copy(), np.inf, q
        for _ in range(_STARTS):
            state = self.close(self._states.started(q, given))
            off = wanted - self._states.node_velocities(state[None])[0]
            if not np.abs(off).max() < 0.5 * best:
                break
            x, best = state, np.abs(off).max()
            given = given + off
        return x

    def _reachable(self, q: Floats) -> Floats:
        """q, or the closed configuration near it where Newton's method finds none from there."""
        x = np.concatenate([q, np.zeros(self._mechanism.nv)])
        try:
            self._placed(x, search=False)
        except ValueError:
            return self._placed(x, search=True)[: self._nq]
        return q

    def _with_shares(self, x: Floats) -> Floats:
        """A copy of x with distant shares of bodies (loop_joints.py) moved to the rest of their body."""
        gaps = self.gaps(x)
        far = [j for j in self._mechanism.loops if is_weld(j) and np.abs(gaps[j.name]).max() > _APART]
        x = x.copy()
        names = self._mechanism.body_names
        for weld in far:
            z = self._states.maximal(x[None])
            z[0, names.index(weld.child)] = z[0, names.index(weld.parent or "")]
            joint = self._mechanism.joints[names.index(weld.child)]
            for at in (self._mechanism.q_slice(joint.name), self._v_slice(joint.name)):
                x[at] = self._states.minimal(z)[0][at]
        return x

    def _v_slice(self, joint: str) -> slice:
        at = self._mechanism.v_slice(joint)
        return slice(self._nq + at.start, self._nq + at.stop)

    def rank(self, x: Floats) -> LoopRank:
        """Which constraints are redundant at the configuration of x, loops in their order.

        And those that are redundant at this configuration only: nearby, along the motions of the loops, they count.
        """
        here, free = self._rank_at(x)
        near = [self._rank_at(y)[0] for y in self._next_to(x, free)]
        count = sum(here.constraints.values()) - sum(here.redundant.values())
        more = [sum(r.constraints.values()) - sum(r.redundant.values()) - count for r in near]
        return here._replace(singular=max(0, *more, 0), nearby=max((r.weakest for r in near), default=here.weakest))

    def _next_to(self, x: Floats, free: Floats) -> list[Floats]:
        """Closed states at rest, _DISPLACEMENT away from x along some of its free directions (n, nv)."""
        rng = np.random.default_rng(0)
        states = []
        for _ in range(2 if len(free) else 0):
            d = rng.normal(size=len(free)) @ free
            moved = self._around(x)(d[None] * (_DISPLACEMENT / np.abs(d).max()))[0]
            moved[self._nq :] = 0.0
            try:
                states.append(self.close(moved, search=False))
            except ValueError:  # an isolated configuration
                continue
        return states

    def _rank_at(self, x: Floats) -> tuple[LoopRank, Floats]:
        """The rank at one configuration, and the directions (n, nv) that its constraints leave."""
        nv = self._mechanism.nv
        rows = jacobian(self._error(self._around(x)), np.zeros(nv))
        size = {name: len(gap) for name, gap in self.gaps(x).items()}
        end, found, redundant = 0, 0, {}
        for name, own in size.items():
            end += own
            values = np.linalg.svd(rows[:end], compute_uv=False)
            independent = int(np.sum(values > _DEPENDENT * values[0]))
            redundant[name] = own - (independent - found)
            found = independent
        rest = values[found:].max() if found < len(values) else 0.0
        rank = LoopRank(size, redundant, nv - found, float(values[found - 1] / values[0]), float(rest / values[0]))
        return rank, np.linalg.svd(rows)[2][found:]

    def _solve(self, place: Callable[[Floats], Floats], search: bool = False) -> Floats:
        """The small d (nv,) with closed loops at the state of place(d[None]).

        search: whether to look further away where Newton's method finds none.
        """
        nv = self._mechanism.nv
        error = self._error(place)
        zero = nearest(error, nv) if search else newton(error, np.zeros(nv))
        if not zero.found:
            raise ValueError(self._refusal(place, zero.d, search))
        return zero.d

    def _around(self, x: Floats) -> Callable[[Floats], Floats]:
        """The states (m, nx) whose configurations are d (m, nv) away from that of x."""
        return lambda d: self._states.integrate(np.tile(x, (len(d), 1)), np.concatenate([d, np.zeros_like(d)], axis=1))

    def _error(self, place: Callable[[Floats], Floats], name: str = "") -> Callable[[Floats], Floats]:
        """The gaps (m, n) at the states place(d), of all loops and gears or of one."""
        return lambda d: np.concatenate(list(self._gaps(place(d), name).values()), axis=1)

    def _refusal(self, place: Callable[[Floats], Floats], d: Floats, search: bool) -> str:
        """The error message when the state place(d) is the best that was found."""
        gaps = {name: float(np.abs(gap).max()) for name, gap in self.gaps(place(d[None])[0]).items()}
        names = [*gaps] if search and len(gaps) > 1 else []
        alone = [name for name in names if not nearest(self._error(place, name), len(d), _STARTS_OF_ONE_LOOP).found]
        worst = max(alone or gaps, key=lambda name: gaps[name])
        welds = {j.name: j.name.removeprefix(f"{j.parent}.") for j in self._mechanism.loops if is_weld(j)}
        constraint = worst if worst.startswith("gear ") else f"loop joint {welds.get(worst, worst)!r}"
        why = "two loops contradict each other"
        if alone or len(gaps) == 1:
            why = "links are too short, or its frames contradict the joints of the tree"
        return (
            f"Mechanism({self._mechanism.name!r}): {constraint} cannot be closed near this state, it is off by "
            f"{gaps[worst]:.2g} at best; give neutral=... a configuration near one that closes, or see whether {why}"
        )
