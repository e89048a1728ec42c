"""MuJoCo as an engine: one per integrator, on the same mechanism converted by mujoco_scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.engines import mujoco_scene
from benchmarks.engines.failed_runs import ended
from benchmarks.engines.mujoco_warnings import quiet
from benchmarks.engines.separate_process import apart
from dojo_opt.report.engine import Run, clocked, held, nodes, observe
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.types import Floats

INTEGRATORS = ("Euler", "implicitfast", "implicit", "discrete", "RK4")
_LOST = 1e8  # [m/s, rad/s] faster than this, the simulation has blown up


@dataclass(frozen=True)
class MuJoCo:
    """One integrator, elliptic friction cones and MuJoCo's defaults otherwise.

    options: attributes of MJCF's <option>, such as {"tolerance": "1e-10"}; contacts: solref and solimp of all contacts.
    """

    integrator: str
    options: Mapping[str, Any] = field(default_factory=dict)
    rounds: int = 3  # times that a run shorter than a second is clocked
    contacts: Mapping[str, Sequence[float]] = field(default_factory=dict)
    label: str = ""  # names the settings that differ from the defaults

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"MuJoCo {self.integrator}" + (f", {self.label}" if self.label else "")

    @ended
    @apart
    def simulate(
        self,
        mechanism: Mechanism,
        *,
        time_step: float,
        q: ArrayLike,
        v: ArrayLike,
        duration: float,
        samples: int,
        inputs: ArrayLike | None = None,
    ) -> Run:
        """As Engine.simulate. Held inputs are stepped inside MuJoCo, from sample to sample."""
        import mujoco

        marks = nodes(time_step, duration, samples)
        u = held(mechanism, inputs, int(marks[-1]))
        sim = Simulator(mechanism, time_step=time_step)
        model = mujoco_scene.load(sim.model, time_step, integrator=self.integrator, **self.options)
        for name, values in self.contacts.items():
            getattr(model, f"pair_{name}")[:] = values
        start = np.concatenate([np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)])
        data = mujoco_scene.state(model, start)
        with quiet():
            (xs, steps), seconds = clocked(
                lambda: _steps(mujoco, model, data, start, u, marks),
                self.rounds,
                lambda: _steps(mujoco, model, data, start, u, 0 * marks),
            )
        times = time_step * marks[: len(xs)].astype(np.float64)
        message = "" if steps == marks[-1] else f"lost between {times[-1]:g} s and {time_step * steps:g} s"
        return observe(sim, times, xs[:, : sim.nq], xs[:, sim.nq :], seconds, steps, message)


def engines() -> list[MuJoCo]:
    """All integrators."""
    return [MuJoCo(integrator) for integrator in INTEGRATORS]


def stiff() -> MuJoCo:
    """The hardest contacts that hold at steps of 1 to 10 ms: a time constant of 1 ms, impedances next to 1."""
    contacts = {"solref": (0.001, 1.0), "solimp": (0.99, 0.999, 0.0001, 0.5, 2.0)}
    return MuJoCo("discrete", contacts=contacts, label="stiff contacts")


def _steps(
    mujoco: Any, model: Any, data: Any, start: Floats, u: Floats, marks: NDArray[np.int64]
) -> tuple[Floats, int]:
    """([q; v] at the marks, number of steps taken); stops before the first sample that is not finite."""
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:], data.ctrl[:] = start[: model.nq], start[model.nq :], u[0]
    xs = np.empty((len(marks), len(start)))
    xs[0] = start
    for k in range(1, len(marks)):
        first, last = int(marks[k - 1]), int(marks[k])
        if len(u) == 1:
            mujoco.mj_step(model, data, last - first)
        else:
            for step in range(first, last):
                data.ctrl[:] = u[step]
                mujoco.mj_step(model, data)
        xs[k, : model.nq], xs[k, model.nq :] = data.qpos, data.qvel
        if not np.abs(xs[k]).max() < _LOST:
            return xs[:k], last
    return xs, int(marks[-1])
