"""States of mechanisms with closed loops: how far the loops are open, and the nearest state that closes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.build import contact_frame, fixed_axes
from sim.calls import Calls
from sim.coupling.closing import is_weld
from sim.mechanism import Mechanism
from sim.parts import WORLD, Joint
from sim.shapes import rotation_matrix

Floats = NDArray[np.float64]

_STEP = 1e-6  # of central differences [m, rad]
_CLOSED = 1e-11  # [m], and as much of an angle
_APART = 0.1  # [m], and as much of an angle: a share of a body further from the rest of it is brought there first
_ASIDE = 0.03  # [m, rad]
_NEAR = 0.1  # `weakest` of configurations close to a singular one, over that next to them
_STARTS = 30  # repetitions, each of which halves the error at least
_DEPENDENT = 1e-6  # singular values below this share of the largest belong to redundant constraints


class LoopRank(NamedTuple):
    """How many constraints the loops of a mechanism have, and how many of them say something new."""

    constraints: dict[str, int]  # by loop joint
    redundant: dict[str, int]  # by loop joint: what those before it, and its own, say already
    mobility: int  # degrees of freedom that the loops leave
    weakest: float  # least singular value of the independent constraints, over the largest
    leftover: float  # largest one of the redundant constraints, over the largest
    singular: int = 0  # redundant ones that count next to this configuration: branches of the motion may meet here
    nearby: float = 0.0  # `weakest` next to this configuration

    def __str__(self) -> str:
        total, idle = sum(self.constraints.values()), sum(self.redundant.values())
        which = ", ".join(f"{name} {n} of {self.constraints[name]}" for name, n in self.redundant.items() if n)
        return (
            f"{self.mobility} degrees of freedom left by {total} constraints, {idle} redundant"
            + (f" ({which}) to {self.leftover:.0e}" if idle else "")
            + f"; the weakest has {self.weakest:.1e} of the strongest"
            + self._place()
        )

    def _place(self) -> str:
        """How the configuration differs from those next to it."""
        if self.singular:
            return (
                f"; singular: {self.singular} of the redundant ones count nearby, branches of the motion may meet here"
            )
        if self.weakest < _NEAR * self.nearby:
            return f", nearby {self.nearby:.1e}: close to a singular configuration"
        return ""


def _angle(sine: Floats, cosine: float) -> Floats:
    """The rotation vector along sin(angle) direction."""
    size = float(np.linalg.norm(sine))
    return sine * (np.arctan2(size, cosine) / size) if size > 0.0 else sine


class Closure:
    """The loop constraints of a mechanism, as sim/coupling/loops.py has them, for Python."""

    def __init__(self, mechanism: Mechanism, calls: Calls) -> None:
        self._mechanism, self._calls = mechanism, calls
        self._nq = mechanism.nq
        self._h = calls.settings.time_step

    def gaps(self, x: Floats) -> dict[str, Floats]:
        """By loop joint and gear, what its constraints miss at x: distances [m], then angles [rad].

        Angles and not the sines of the step (sim/coupling/loops.py), which vanish after half a turn as well.
        """
        mech = self._mechanism
        z = self._calls.maximal(x[None], mech.nbody)[0]
        out = {joint.name: self._gap(joint, z) for joint in mech.loops}
        for gear in mech.gears:
            a, b = mech.q_slice(gear.joint).start + gear.dof, mech.q_slice(gear.other).start + gear.other_dof
            out[f"gear {gear.name}"] = np.array([x[a] - gear.ratio * x[b] - gear.offset])
        return out

    def _gap(self, joint: Joint, z: Floats) -> Floats:
        names = self._mechanism.body_names
        a = names.index(joint.child)
        Ra, xa = rotation_matrix(z[a, 6:10]), z[a, :3]
        Rb, xb = np.eye(3), np.zeros(3)
        if joint.parent != WORLD:
            b = names.index(joint.parent or "")
            Rb, xb = rotation_matrix(z[b, 6:10]), z[b, :3]
        Q = Rb @ rotation_matrix(joint.orientation)
        apart = Q.T @ (xa + Ra @ np.asarray(joint.child_point) - xb - Rb @ np.asarray(joint.parent_point))
        E = Q.T @ Ra
        if joint.nrot == 1:
            frame = contact_frame(joint.axis)
            turned = _angle(frame[1:] @ (E @ frame[0]), float(frame[0] @ E @ frame[0]))
        else:
            sine = 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
            turned = _angle(sine, 0.5 * (float(np.trace(E)) - 1.0))
        return np.concatenate([fixed_axes(joint) @ apart, turned if joint.nrot < 3 else turned[:0]])

    def close(self, x: Floats) -> Floats:
        """The state near x whose loops are closed at both ends of its interval.

        ValueError: there is none near, with the loop that stays open and by how much.
        """
        nv = self._mechanism.nv
        x = self._with_shares(x)

        def moved(dq: Floats) -> Floats:
            return self._calls.integrate(x[None], np.concatenate([dq, np.zeros(nv)])[None])[0]

        x = moved(self._solve(lambda dq: moved(dq), nv))

        def before(dv: Floats) -> Floats:
            back = np.concatenate([-self._h * (x[self._nq :] + dv), np.zeros(nv)])
            return self._calls.integrate(x[None], back[None])[0]

        x[self._nq :] += self._solve(before, nv)
        return x

    def start(self, q: Floats, v: Floats) -> Floats:
        """The closed state near q whose velocity at the node is the part of v along the loops.

        Closing the interval before the node changes the velocity by O(h), which is made up for by repetition.
        """
        wanted = self._calls.node_velocities(self._calls.started(q, v)[None])[0]
        given, best, x = wanted.copy(), np.inf, q
        for _ in range(_STARTS):
            state = self.close(self._calls.started(q, given))
            off = wanted - self._calls.node_velocities(state[None])[0]
            if not np.abs(off).max() < 0.5 * best:
                break
            x, best = state, np.abs(off).max()
            given = given + off
        return x

    def _with_shares(self, x: Floats) -> Floats:
        """A copy of x where shares of bodies (closing.py) that are far from the rest of it are brought there."""
        gaps = self.gaps(x)
        far = [j for j in self._mechanism.loops if is_weld(j) and np.abs(gaps[j.name]).max() > _APART]
        x = x.copy()
        names = self._mechanism.body_names
        for weld in far:
            z = self._calls.maximal(x[None], self._mechanism.nbody)
            z[0, names.index(weld.child)] = z[0, names.index(weld.parent or "")]
            joint = self._mechanism.joints[names.index(weld.child)]
            for at in (self._mechanism.q_slice(joint.name), self._v_slice(joint.name)):
                x[at] = self._calls.minimal(z)[0][at]
        return x

    def _v_slice(self, joint: str) -> slice:
        at = self._mechanism.v_slice(joint)
        return slice(self._nq + at.start, self._nq + at.stop)

    def rank(self, x: Floats) -> LoopRank:
        """Which constraints are redundant at the configuration of x, loops in their order.

        And which of them are so at this configuration only: next to it, along what the loops allow, they count.
        """
        here, free = self._rank_at(x)
        near = [self._rank_at(y)[0] for y in self._next_to(x, free)]
        count = sum(here.constraints.values()) - sum(here.redundant.values())
        more = [sum(r.constraints.values()) - sum(r.redundant.values()) - count for r in near]
        return here._replace(singular=max(0, *more, 0), nearby=max((r.weakest for r in near), default=here.weakest))

    def _next_to(self, x: Floats, free: Floats) -> list[Floats]:
        """Closed states at rest, _ASIDE away from x along some of its free directions (n, nv)."""
        rng = np.random.default_rng(0)
        states = []
        for _ in range(2 if len(free) else 0):
            d = rng.normal(size=len(free)) @ free
            d *= _ASIDE / np.abs(d).max()
            moved = self._calls.integrate(x[None], np.concatenate([d, np.zeros(len(d))])[None])[0]
            moved[self._nq :] = 0.0
            try:
                states.append(self.close(moved))
            except ValueError:  # an isolated configuration
                continue
        return states

    def _rank_at(self, x: Floats) -> tuple[LoopRank, Floats]:
        """The rank at one configuration, and the directions (n, nv) that its constraints leave."""
        nv = self._mechanism.nv

        def gaps(d: Floats) -> dict[str, Floats]:
            return self.gaps(self._calls.integrate(x[None], np.concatenate([d, np.zeros(nv)])[None])[0])

        columns = [(gaps(e), gaps(-e)) for e in _STEP * np.eye(nv)]
        rows, found, redundant = np.zeros((0, nv)), 0, {}
        size = {name: len(gap) for name, gap in gaps(np.zeros(nv)).items()}
        for name in size:
            own = np.array([ahead[name] - back[name] for ahead, back in columns]).T / (2.0 * _STEP)
            rows = np.concatenate([rows, own])
            values = np.linalg.svd(rows, compute_uv=False)
            independent = int(np.sum(values > _DEPENDENT * values[0]))
            redundant[name] = size[name] - (independent - found)
            found = independent
        rest = values[found:].max() if found < len(values) else 0.0
        rank = LoopRank(size, redundant, nv - found, float(values[found - 1] / values[0]), float(rest / values[0]))
        return rank, np.linalg.svd(rows)[2][found:]

    def _solve(self, place: Callable[[Floats], Floats], nv: int) -> Floats:
        """The small d with closed loops at the state place(d): Newton's method, least norm."""
        d = np.zeros(nv)

        def error(d: Floats) -> Floats:
            return np.concatenate(list(self.gaps(place(d)).values()))

        for _ in range(50):
            g = error(d)
            if np.abs(g).max() < _CLOSED:
                return d
            J = np.array([error(d + e) - error(d - e) for e in _STEP * np.eye(nv)]).T / (2.0 * _STEP)
            step = np.linalg.lstsq(J, -g, rcond=1e-9)[0]
            d += step * min(1.0, 0.5 / max(np.abs(step).max(), 1e-300))
        gaps = {name: float(np.abs(gap).max()) for name, gap in self.gaps(place(d)).items()}
        worst = max(gaps, key=lambda name: gaps[name])
        call = f"Mechanism({self._mechanism.name!r})"
        what = worst if worst.startswith("gear ") else f"loop joint {worst!r}"
        raise ValueError(
            f"{call}: {what} cannot be closed near this state, it is off by {gaps[worst]:.2g}; give "
            "neutral=... a configuration near one that closes, or see whether two loops contradict each other"
        )
