"""Horizon: repeated rollouts and derivatives of trajectories of one length, for planners.

Its arrays are those that it returned before, so they are not checked again; the steps of a rollout warm-start
those of the next one nearby.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sim.integrators.feedback import FeedbackLaw
from sim.model.record_columns import StepReport
from sim.simulator.arguments import Arguments
from sim.simulator.derivative_results import Linearization
from sim.simulator.engines.engine import Engine
from sim.simulator.results import STATUSES
from solvers.status import Status
from solvers.types import Floats

__all__ = ["Horizon", "Known", "Rollout", "Steps"]


class Steps(NamedTuple):
    """Cone variables of a rollout, which warm-start rollouts nearby."""

    cones: Floats  # (T, ncontact, 16)
    bounds: Floats  # (T, nlimit, 2)


class Known(NamedTuple):
    """Derivatives and cone variables at a trajectory, which predict and warm-start rollouts nearby."""

    linear: Linearization | None = None
    steps: Steps | None = None


_NOTHING = Known()


class Rollout(NamedTuple):
    """A rollout; rows after the last solved knot are undefined."""

    x: Floats  # (T + 1, nx)
    u: Floats  # (T, nu) [N, N m]
    status: Status
    solved_knots: int
    steps: Steps | None  # None where a knot has several


class Horizon:
    """Trajectories of `knots` knots, each of `substeps` time steps, with inputs within `limits`.

    Arrays are float64, C-contiguous and finite, states have unit quaternions: `states` makes them so.
    `iterations` counts those of all steps of rollouts so far, as a measure of work that is the same on every machine.
    """

    def __init__(
        self, engine: Engine, arguments: Arguments, knots: int, substeps: int, limits: tuple[Floats, Floats]
    ) -> None:
        self._engine, self._arguments, self._substeps, self._limits = engine, arguments, substeps, limits
        engine.prepare()
        self.iterations = 0
        self._k = np.zeros((knots, engine.nu))
        self._K = np.zeros((knots, engine.nu, engine.ndx))
        self._gaps = np.zeros((knots + 1, engine.ndx))

    def states(self, call: str, xs: ArrayLike) -> Floats:
        """States that the other methods take.

        Args:
            call: the call that an error names.
            xs: (..., nx) states.

        Returns:
            A copy with unit quaternions.

        Raises:
            ValueError: a quaternion is not of unit length, or a number is not finite.
        """
        return self._arguments.states(call, xs)

    def roll(
        self,
        x0: Floats,
        xs: Floats,
        us: Floats,
        kappa: float,
        *,
        k: Floats | None = None,
        K: Floats | None = None,
        gaps: Floats | None = None,
        alpha: float = 1.0,
        known: Known = _NOTHING,
        max_iterations: int | None = None,
    ) -> Rollout:
        """Rollout from x0 (nx,) under the gains around (xs, us), as `Simulator.rollout_feedback`.

        known: of (xs, us).
        max_iterations: of a step, where it may fail sooner than the simulator's.
        """
        derivatives = self._engine.no_predictions[:2] if known.linear is None else (known.linear.A, known.linear.B)
        cones = self._engine.no_predictions[2:] if known.steps is None else known.steps
        policy = FeedbackLaw(
            xs,
            us,
            self._engine.no_wrenches,
            self._k if k is None else k,
            self._K if K is None else K,
            self._gaps if gaps is None else gaps,
            *derivatives,
            *cones,
        )
        keep = self._substeps == 1
        knot, path = self._engine.roll_feedback(
            x0, policy, alpha, self._limits, self._substeps, kappa, keep=keep, max_iterations=max_iterations
        )
        self.iterations += int(path.report[StepReport.ITERATIONS])  # of the whole, or of its unsolved step
        self.iterations += int(path.report[StepReport.EARLIER]) if knot < len(us) else 0
        kept = Steps(path.cones, path.bounds) if keep else None
        return Rollout(path.xs, path.us, STATUSES[int(path.report[StepReport.STATUS])], knot, kept)

    def coast(self, x: Floats, us: Floats) -> Floats:
        """The motion from x (nx,) under the inputs us (T, nu) of knots, of any number, at the simulator's smoothing.

        Returns:
            (T + 1, nx) states; those after the last solved knot are where it ended.
        """
        rolled = self._engine.roll(x, np.repeat(us, self._substeps, axis=0))
        solved = rolled.solved_steps // self._substeps
        xs = rolled.xs[:: self._substeps]
        xs[solved + 1 :] = xs[solved]
        return xs

    def linearize(self, xs: Floats, us: Floats, kappa: float, guess: Floats | None = None) -> Linearization:
        """Derivatives of all knots, as `Simulator.linearize_trajectory`.

        guess: (T, nx) where the velocities after each knot are looked for first; by default in the later rows of xs.
        """
        A, B, x_next, reports = self._engine.linearize_plan(xs, us, self._substeps, kappa, guess)
        statuses = reports[:, StepReport.STATUS].astype(np.int64)
        return Linearization(A, B, x_next, statuses, accuracy=reports[:, StepReport.ACCURACY])

    def gaps(self, linear: Linearization, xs: Floats) -> Floats:
        """(T + 1, ndx) f(x_t, u_t) (-) x_t+1, in the rows of the later knots; zero in the first."""
        gaps = np.zeros_like(self._gaps)
        gaps[1:] = self._engine.states.difference(xs[1:], linear.x_next)
        return gaps
