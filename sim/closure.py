"""States of mechanisms with closed loops: how far the loops are open, and the nearest state that closes them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim.build import contact_frame, fixed_axes
from sim.calls import Calls
from sim.mechanism import Mechanism
from sim.parts import WORLD, Joint
from sim.shapes import rotation_matrix

Floats = NDArray[np.float64]

_STEP = 1e-6  # of central differences [m, rad]
_CLOSED = 1e-11  # [m], and as much of an angle


class Closure:
    """The loop constraints of a mechanism, as sim/loops.py has them, for Python."""

    def __init__(self, mechanism: Mechanism, calls: Calls) -> None:
        self._mechanism, self._calls = mechanism, calls
        self._nq = mechanism.nq
        self._h = calls.settings.time_step

    def gaps(self, x: Floats) -> dict[str, Floats]:
        """By loop joint, what its constraints miss: distances [m], then sines of angles; at the configuration of x."""
        z = self._calls.maximal(x[None], self._mechanism.nbody)[0]
        return {joint.name: self._gap(joint, z) for joint in self._mechanism.loops}

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
            turned = frame[1:] @ (E @ frame[0])
        else:
            turned = 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
        return np.concatenate([fixed_axes(joint) @ apart, turned if joint.nrot < 3 else turned[:0]])

    def close(self, x: Floats) -> Floats:
        """The state near x whose loops are closed at both ends of its interval.

        ValueError: there is none near, with the loop that stays open and by how much.
        """
        nv = self._mechanism.nv
        x = x.copy()

        def moved(dq: Floats) -> Floats:
            return self._calls.integrate(x[None], np.concatenate([dq, np.zeros(nv)])[None])[0]

        x = moved(self._solve(lambda dq: moved(dq), nv))

        def before(dv: Floats) -> Floats:
            back = np.concatenate([-self._h * (x[self._nq :] + dv), np.zeros(nv)])
            return self._calls.integrate(x[None], back[None])[0]

        x[self._nq :] += self._solve(before, nv)
        return x

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
        raise ValueError(
            f"{call}: loop joint {worst!r} cannot be closed near this state, it is off by {gaps[worst]:.2g}"
        )
