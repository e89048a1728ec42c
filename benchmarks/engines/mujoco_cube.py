"""The real cube in MuJoCo: predictions of tosses, and a fit by MuJoCo's own least squares with finite differences."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from mujoco import minimize, rollout

import dojo_opt as dojo
from benchmarks.engines.cube_motion import CubeMotion
from benchmarks.engines.mujoco_scene import without_reset
from solvers.types import Floats

__all__ = ["MujocoCube", "default_cube", "fit"]

_SUBSTEPS = 7  # of a frame: about 1 ms
# friction, half width [m], time constant [s] and damping ratio of contacts, moment of inertia [kg m^2]
_START = np.array([0.3, 0.047, 0.02, 0.8, 8.1e-4])
_NEAR = np.array([0.18, 0.0524, 0.01, 0.8, 8.1e-4])  # the published friction and half width
_DEFAULT = (0.02, 1.0, 8.1e-4)  # MuJoCo's own time constant and damping ratio, and the moment of inertia
_LOW, _HIGH = np.array([0.02, 0.04, 0.002, 0.05, 4e-4]), np.array([1.0, 0.065, 0.1, 2.0, 1.6e-3])
_MODEL = """<mujoco>
  <option timestep="{step}" cone="elliptic" impratio="10"/>
  <worldbody>
    <geom type="plane" size="9 9 1"/>
    <body>
      <freejoint/>
      <inertial mass="0.37" pos="0 0 0" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom type="box" size="{half} {half} {half}" friction="{friction} 0 0" priority="1" solref="{time} {ratio}"/>
    </body>
  </worldbody>
</mujoco>"""
_WIDTH = 1e-2  # of the finite differences, in units of the start: with 1e-4, fits end where they begin
_MOST = 1e3  # deviations: errors of predictions that are not finite


class MujocoCube:
    """The cube on the ground, with the values of `_START` in this order; `sim` subtracts states."""

    def __init__(self, values: Floats, frame: float, sim: dojo.Simulator) -> None:
        names = ("friction", "half", "time", "ratio", "inertia")
        numbers = {name: float(value) for name, value in zip(names, values, strict=True)}
        self._model = without_reset(mujoco.MjModel.from_xml_string(_MODEL.format(step=frame / _SUBSTEPS, **numbers)))
        self._data, self.values, self._sim = mujoco.MjData(self._model), values, sim

    def paths(self, starts: Floats, steps: int) -> Floats:
        """(n, steps + 1, 13) states from starts (n, 13), frame by frame."""
        first = np.hstack([np.zeros((len(starts), 1)), starts])
        states, _ = rollout.rollout(self._model, self._data, first, nstep=steps * _SUBSTEPS)
        return np.concatenate([starts[:, None], states[:, _SUBSTEPS - 1 :: _SUBSTEPS, 1:14]], axis=1)

    def rollout(self, x: Floats, us: Floats) -> CubeMotion:
        """As Simulator.rollout."""
        found = self.paths(x[None], len(us))[0]
        return CubeMotion(found, bool(np.isfinite(found).all()))

    def difference(self, a: Floats, b: Floats) -> Floats:
        """As Simulator.difference."""
        return self._sim.difference(a, b)


def default_cube(friction: float, half: float, frame: float, sim: dojo.Simulator) -> MujocoCube:
    """A cube of some friction and half width [m] with MuJoCo's default contacts."""
    return MujocoCube(np.array([friction, half, *_DEFAULT]), frame, sim)


def fit(
    motions: list[Floats], frame: float, noise: Floats, window: int, every: int, sim: dojo.Simulator
) -> tuple[MujocoCube, float]:
    """(the fitted cube, root mean square of the errors over their noise) of windows from their filmed first states:
    the better one of two fits, one of which begins at the published parameters.
    """
    cut = [xs[k : k + window + 1] for xs in motions for k in range(0, len(xs) - window, window)]
    films = np.array(cut)
    rows = np.arange(every, window + 1, every)

    def residual(points: Floats) -> Floats:
        columns = []
        for point in points.T:
            paths = MujocoCube(point * _START, frame, sim).paths(films[:, 0], window)
            gaps = sim.difference(paths[:, rows].reshape(-1, 13), films[:, rows].reshape(-1, 13)) / noise
            columns.append(np.clip(np.nan_to_num(gaps, nan=_MOST), -_MOST, _MOST).ravel())
        return np.array(columns).T

    bounds: Any = (_LOW / _START, _HIGH / _START)
    found = []
    for start in (_START, _NEAR):
        values, _ = minimize.least_squares(
            start / _START, residual, bounds=bounds, eps=_WIDTH, max_iter=60, verbose=minimize.Verbosity.SILENT
        )
        found.append((float(np.sqrt(np.mean(residual(values[:, None]) ** 2))), values))
    rms, best = min(found, key=lambda each: each[0])
    return MujocoCube(best * _START, frame, sim), rms
