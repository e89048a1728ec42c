"""Cotangents: gradients by the numbers of a state x (nx,) from those by its tangent dx (ndx,), and back.

A rotation has four numbers in x and three in dx. A function of states is continued to quaternions q of any length by
q / |q|, so its gradient by q is tangent to the sphere:

    q (+) r = q exp(r):   dq = 1/2 q (0, r),    g_r = 1/2 Im(q^* g_q),    g_q = 2 q (0, g_r)   at |q| = 1

Going there and back removes from g_q the part along q; all other numbers are the same in both.
"""

from __future__ import annotations

import numpy as np

from dojo_opt.planning.manifold import cross, tangent_layout
from sim.simulator.simulator import Simulator
from solvers.types import Floats


class Cotangents:
    """The two maps for the states of one simulator."""

    def __init__(self, sim: Simulator) -> None:
        layout = tangent_layout(sim, sim.neutral())
        self._scalars = np.flatnonzero(layout >= 0)  # in dx
        self._addresses = layout[self._scalars]  # of those in x
        self._rotations = np.flatnonzero(layout < 0)[::3]  # in dx, their first
        self._quaternions = -layout[self._rotations] - 1  # in x, their first
        self._nx, self._ndx = sim.nx, sim.ndx

    def tangent(self, xs: Floats, by_x: Floats) -> Floats:
        """Gradients (n, ndx) by dx from those by x, at the states xs; xs, by_x: (n, nx)."""
        out = np.empty((len(xs), self._ndx))
        out[:, self._scalars] = by_x[:, self._addresses]
        for r, a in zip(self._rotations, self._quaternions, strict=True):
            q, g = xs[:, a : a + 4], by_x[:, a : a + 4]
            w, v, g_w, g_v = q[:, :1], q[:, 1:], g[:, :1], g[:, 1:]
            out[:, r : r + 3] = 0.5 * (w * g_v - g_w * v - cross(v, g_v))
        return out

    def ambient(self, xs: Floats, by_dx: Floats) -> Floats:
        """Gradients (n, nx) by x from those by dx (n, ndx), at the states xs (n, nx)."""
        out = np.empty((len(xs), self._nx))
        out[:, self._addresses] = by_dx[:, self._scalars]
        for r, a in zip(self._rotations, self._quaternions, strict=True):
            q, g_r = xs[:, a : a + 4], by_dx[:, r : r + 3]
            w, v = q[:, :1], q[:, 1:]
            out[:, a] = -2.0 * np.einsum("ni,ni->n", v, g_r)
            out[:, a + 1 : a + 4] = 2.0 * (w * g_r + cross(v, g_r))
        return out
