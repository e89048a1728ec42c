"""Windows of measured motions: predicted from a free start, with derivatives by the start and by parameters.

r_0 = s (-) m_0,    r_t = x_t(s, theta) (-) m_t,    both over the noise of the measurement
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from dojo_opt.planning.manifold import tangent_layout
from dojo_opt.planning.same_robot import check_same_robot, check_same_velocities
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.simulator.derivative_results import Linearization
from sim.simulator.results import Trajectory, states_and_inputs
from sim.simulator.simulator import Simulator
from solvers.status import Status
from solvers.types import Floats, Integers

__all__ = ["Window", "WindowErrors", "cut_windows", "difference_slopes", "slopes_along"]


class Space(Protocol):
    """What a prediction needs of the parameters."""

    values: Floats

    @property
    def wrt(self) -> tuple[str, ...]:
        """Names of the parameters of the simulator."""


@dataclass(frozen=True)
class Window:
    """A piece of a measured motion: it is predicted as a whole from its start."""

    trajectory: int  # its number among those given
    first: int  # step of the trajectory it begins at
    x: Floats  # (T + 1, nx) measured states
    u: Floats  # (T, nu)
    past: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # (m, nu) inputs of the steps before, if kept
    rate: Floats | None = None  # (T, nu) derivative of u by the delay [1/s], if it is fitted

    __repr__ = short_repr

    def pieces(self, length: int) -> list[Window]:
        """Windows that follow one another in this one.

        Args:
            length: steps of each; the last one is shorter.

        Returns:
            The windows.
        """
        m, size = len(self.past), len(self.u)
        before = np.concatenate([self.past, self.u]) if m else self.u  # u[t] is before[m + t]
        return [
            Window(
                self.trajectory, self.first + k, self.x[k : k + length + 1], self.u[k : k + length], before[k : k + m]
            )
            for k in range(0, size, length)
        ]

    def delayed(self, steps: float, time_step: float | None) -> Window:
        """The window with the inputs that act if they come later by so many steps: means over each step.

            u_t = (1 - f) u[t - k] + f u[t - k - 1],   k + f = steps,   du_t/ddelay = (u[t - k - 1] - u[t - k])/h

        Args:
            steps: of the delay.
            time_step: h, for the derivative [s]; None: without it.

        Returns:
            The window.
        """
        k = int(steps)
        every, m, T = np.concatenate([self.past, self.u]), len(self.past), len(self.u)
        now, before = every[m - k : m - k + T], every[m - k - 1 : m - k - 1 + T]
        rate = None if time_step is None else (before - now) / time_step
        return replace(self, u=now + (steps - k) * (before - now), rate=rate)


def cut_windows(sim: Simulator, trajectories: Sequence[Any], length: int | None, past: int = 0) -> list[Window]:
    """Windows of `length` steps that follow one another, the last one shorter; whole motions for None.

    past: steps before a window whose inputs it keeps; before a motion, inputs are those of its first step.
    """
    call, out = "identify(trajectories)", []
    if isinstance(trajectories, Trajectory) or not isinstance(trajectories, Iterable):
        raise TypeError(f"{call}: expected a list of motions, got {checks.shown(trajectories)}")
    if isinstance(trajectories, tuple) and [getattr(part, "ndim", 0) for part in trajectories] == [2, 2]:
        raise TypeError(f"{call}: expected a list of motions, got one pair; give a list: [(states, inputs)]")
    for number, given in enumerate(trajectories):
        if isinstance(given, Trajectory):
            check_same_robot(f"{call}: expected motions", sim, given.simulator, given.x)
            _check_made(f"{call}: motion {number}", sim, given)
        raw = (given.x, given.u) if isinstance(given, Trajectory) else states_and_inputs(call, given)
        us = checks.array(call, raw[1], ("T", sim.nu))
        xs = checks.array(call, raw[0], (len(us) + 1, sim.nx))
        whole = Window(number, 0, xs, us, np.repeat(us[:1], past, axis=0))
        out += whole.pieces(max(len(us), 1) if length is None else length)
    if not out:
        raise ValueError(f"{call}: expected motions of at least one step, got none")
    return out


def _check_made(name: str, sim: Simulator, given: Trajectory) -> None:
    """Refuse motions under pushes that the fit does not know, and those whose states mean something else."""
    if given.wrenches is not None and np.any(given.wrenches):
        raise ValueError(f"{name}: expected no external wrenches, which the fit would take for other parameters")
    if not np.isclose(given.simulator.time_step, sim.time_step, rtol=1e-9):
        raise ValueError(f"{name}: expected the time step {sim.time_step:g} s, got {given.simulator.time_step:g} s")
    check_same_velocities(name, sim, given.simulator)


def difference_slopes(layout: Integers, differences: Floats) -> Floats:
    """(n, ndx, ndx) derivative of rows x (-) m (n, ndx) by x: 1, and J_r^-1(r) for rotations r of quaternions.

    J_r^-1(r) = 1 + [r]/2 + (1/a^2 - (1 + cos a)/(2 a sin a)) [r]^2,   a = |r|
    """
    n, ndx = differences.shape
    out = np.tile(np.eye(ndx), (n, 1, 1))
    i = 0
    while i < ndx:
        if layout[i] >= 0:
            i += 1
            continue
        r = differences[:, i : i + 3]
        a = np.linalg.norm(r, axis=1)
        small = a < 1e-3
        b = np.where(small, 1.0, a)
        factor = np.where(small, 1.0 / 12.0, 1.0 / b**2 - (1.0 + np.cos(b)) / (2.0 * b * np.sin(b)))
        K = np.zeros((n, 3, 3))
        K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -r[:, 2], r[:, 1], -r[:, 0]
        K -= K.transpose(0, 2, 1)
        out[:, i : i + 3, i : i + 3] = np.eye(3) + 0.5 * K + factor[:, None, None] * (K @ K)
        i += 3
    return out


def slopes_along(A: Floats, by_theta: Floats, rows: Integers) -> Floats:
    """Derivatives of the states of a motion by its start and by theta, from those of its steps.

    Args:
        A: (T, ndx, ndx) derivatives of each step by its state.
        by_theta: (T, ndx, n) those by theta.
        rows: numbers of the states, in ascending order; the last one is T.

    Returns:
        (len(rows), ndx, ndx + n) derivatives.
    """
    ndx = A.shape[1]
    width = ndx + by_theta.shape[2]
    slope, moved = np.eye(ndx, width), np.empty((len(rows), ndx, width))
    k = 0
    for t in range(len(A) + 1):
        if t == rows[k]:
            moved[k], k = slope, k + 1
        if t < len(A):
            slope = A[t] @ slope
            slope[:, ndx:] += by_theta[t]
    return moved


@dataclass(frozen=True)
class WindowErrors:
    """Errors of a prediction over their noise, (m, d) for m compared states and d measured components."""

    errors: Floats
    by_start: Floats  # (m, d, ndx), or (0, ...)
    by_theta: Floats  # (m, d, n)
    solved: bool

    __repr__ = short_repr


class Predictor:
    """Predictions of windows by one simulator of a space."""

    def __init__(self, space: Space, noise: Floats, every: int) -> None:
        self._space, self._every, self.noise = space, every, noise
        self.measured = np.flatnonzero(np.isfinite(noise))
        self._scale = 1.0 / noise[self.measured]
        self._found: Integers | None = None

    def _layout(self, sim: Simulator) -> Integers:
        """Layout of the tangent space, the same for all simulators of the space."""
        if self._found is None:
            self._found = tangent_layout(sim, sim.neutral())
        return self._found

    def steps(self, window: Window) -> Integers:
        """The compared steps: the start, steps at regular intervals, and the last one."""
        last = len(window.u)
        return np.unique(np.r_[0 : last + 1 : self._every, last])

    def errors(self, sim: Simulator, windows: Sequence[Window], starts: Sequence[Floats]) -> list[WindowErrors]:
        """Errors of windows from their starts (nx,), without derivatives; windows of one length are one batch."""
        ndx, n = sim.ndx, len(self._space.values)
        lengths = [len(window.u) for window in windows]
        out: dict[int, WindowErrors] = {}
        for length in sorted(set(lengths)):
            some = [i for i, one in enumerate(lengths) if one == length]
            found = sim.rollout_batch(np.array([starts[i] for i in some]), np.array([windows[i].u for i in some]))
            rows = self.steps(windows[some[0]])
            gaps = sim.difference(found.x[:, rows], np.array([windows[i].x[rows] for i in some]))
            for i, gap, status in zip(some, gaps, found.status, strict=True):
                scaled, solved = gap[:, self.measured] * self._scale, bool(status == Status.SOLVED)
                out[i] = WindowErrors(scaled, np.zeros((0, 0, ndx)), np.zeros((0, 0, n)), solved)
        return [out[i] for i in range(len(windows))]

    def predict(self, sim: Simulator, chain: Floats, window: Window, start: Floats, kappa: float) -> WindowErrors:
        """Errors of a window from a start (nx,), with their derivatives; chain: slopes of the space at theta."""
        rows, ndx = self.steps(window), sim.ndx
        xs, line = sim.linearize_rollout(start, window.u, kappa=kappa, wrt=self._space.wrt)
        solved = not np.any(line.status)
        errors = sim.difference(xs[rows], window.x[rows])
        slope = difference_slopes(self._layout(sim), errors) @ self._moved(line, rows, chain, window.rate)
        slope = slope[:, self.measured] * self._scale[:, None]
        return WindowErrors(errors[:, self.measured] * self._scale, slope[..., :ndx], slope[..., ndx:], solved)

    def _moved(self, line: Linearization, rows: Integers, chain: Floats, rate: Floats | None) -> Floats:
        """(len(rows), ndx, ndx + n) derivatives of the states at some steps by the start and by theta, whose last
        component is the delay if the inputs have a derivative by it.
        """
        blocks = [np.asarray(line.parameters[name]) for name in self._space.wrt]
        by_theta = np.concatenate(blocks, axis=2) @ chain
        if rate is not None:
            by_theta[:, :, -1] += np.matmul(line.B, rate[:, :, None])[:, :, 0]
        return slopes_along(line.A, by_theta, rows)
