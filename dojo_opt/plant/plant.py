"""Plant: a simulator that differs from the controller's model."""

from __future__ import annotations

from collections import deque
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.gaits.feet import Feet
from dojo_opt.plant.fall import FallCheck
from dojo_opt.plant.perturbation import Perturbation
from sim.mechanism import checks
from sim.simulator.arguments import is_plain
from sim.simulator.results import StepResult
from sim.simulator.simulator import Simulator
from solvers.status import Status
from solvers.types import Vector

__all__ = ["Plant"]

_SOLVED = Status.SOLVED
_SOFTER = (10.0, 100.0, 1000.0)  # times the smoothing of a step that is not solved at its own


class Plant:
    """A simulated robot that is measured, commanded and pushed.

    `simulator` is the perturbed one. It has three more inputs for every body that is pushed. An unsolved step is
    repeated with softer contact, up to a thousand times its kappa; `softened` counts these steps. `fall_check` is the
    function of a state that `fallen` asks, without checks of its argument.

    Args:
        sim: mechanism, time step and smoothing of the plant before the perturbation: usually those of the model with a
            time step five to fifty times shorter and kappa=1e-8.
        start: (nx,) state at time zero on the ground of `sim` (default None: the neutral one). On other ground it is as
            high above it; on terrain a robot that begins in the ground is put on it.
        perturbation: differences from `sim` (default None: none).
        **fields: fields of `dojo.Perturbation` by name, instead of one:  Plant(sim, payload=3.0, delay=0.02)

    Raises:
        TypeError: for an argument of the wrong kind, or an unknown field.
        ValueError: a value is out of range, or a delay is not a multiple of the time step.
    """

    def __init__(
        self,
        sim: Simulator,
        start: ArrayLike | None = None,
        perturbation: Perturbation | None = None,
        **fields: Any,
    ) -> None:
        if not isinstance(sim, Simulator):
            raise TypeError(f"Plant(sim): expected a Simulator, got {sim!r}")
        checks.keywords("Plant(...)", fields, Perturbation.__dataclass_fields__)
        if perturbation is not None and not isinstance(perturbation, Perturbation):
            raise TypeError(f"Plant(perturbation=...): expected a Perturbation, got {perturbation!r}")
        if perturbation is not None and fields:
            raise ValueError(f"Plant(perturbation=...): give either it or its fields, got both: {', '.join(fields)}")
        self.nominal = sim
        self.start = sim.neutral() if start is None else checks.array("Plant(start=...)", start, (sim.nx,))
        self.perturbation = p = Perturbation(**fields) if perturbation is None else perturbation
        self.simulator = sim.replace(mechanism=p.mechanism(sim.mechanism))
        self.normal = p.normal
        self._noise = _spread("Plant(noise=...)", p.noise, sim.ndx)
        self._noisy = bool(self._noise.any())
        lo, hi = sim.mechanism.input_limits if p.control_limits is None else p.control_limits
        self._limits = tuple(_spread("Plant(control_limits=...)", b, sim.nu) for b in (lo, hi))
        self._limited = bool(np.isfinite(self._limits).any())
        self._late = round(p.delay / sim.time_step)
        if abs(self._late * sim.time_step - p.delay) > 1e-9:
            raise ValueError(
                f"Plant(delay=...): expected a multiple of the time step {sim.time_step:g} s, got {p.delay:g} s"
            )
        self._direct = self.simulator.has_stepper and not self._late and not p.pushes  # commands act as they are given
        x = self.start
        if np.size(p.offset):
            x = _moved(sim, x, checks.array("Plant(offset=...)", p.offset, (sim.ndx,)))
        self._x0 = p.on_ground(sim.mechanism, x)
        if p.terrain is not None:
            self._x0 = self._above_terrain(x)
        self.fall_check = FallCheck(self.simulator.mechanism, self._x0, self.normal)
        self.reset()

    def _above_terrain(self, x: Vector) -> Vector:
        """The state x (nx,), as high above the terrain as above the ground of the model."""
        names = self.simulator.mechanism.ground_contact_names
        if not names:  # nothing feels it
            return x
        try:
            model, out = Feet(self.nominal, names), Feet(self.simulator, names).put_down(x)
        except ValueError as error:
            raise ValueError(f"Plant(terrain=...): {error}") from error
        out[2] += max(float((model.gaps(x) / model.normals(x)[:, 2]).min()), 0.0)
        return out

    def perturbed(self, perturbation: Perturbation) -> Plant:
        """The same robot under another perturbation.

        Args:
            perturbation: the perturbation, instead of that of this plant.

        Returns:
            A new plant at its start.

        Raises:
            ValueError: a value is out of range, or a delay is not a multiple of the time step.
        """
        return Plant(self.nominal, self.start, perturbation)

    def reset(self) -> None:
        """Put the plant back to its start."""
        self.x = self._x0.copy()
        self.steps = 0
        self.softened = 0
        self._random = np.random.default_rng(self.perturbation.seed)
        self._waiting: deque[Vector] = deque()

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self.steps * self.nominal.time_step

    def measure(self) -> Vector:
        """The state with noise.

        Returns:
            (nx,) measured state; without noise, the array of the plant itself.
        """
        if not self._noisy:
            return self.x
        return self.nominal.integrate(self.x, self._noise * self._random.standard_normal(self.nominal.ndx))

    def step(self, command: Vector) -> tuple[Vector, StepResult]:
        """One time step; an unsolved step leaves the state unchanged.

        Args:
            command: (nu,) input that the controller commands [N, N m]. It acts after the delay, within the limits of
                the actuators.

        Returns:
            (inputs that acted, those of the pushes included [N, N m], result of the step).

        Raises:
            ValueError: the shape of the command is wrong, or a number is not finite.
        """
        if not (is_plain(command, (self.nominal.nu,)) and isfinite(command.dot(command))):
            command = checks.array("Plant.step(command)", command, (self.nominal.nu,))
        u = self._within_limits(command)
        if self._late:
            self._waiting.append(u)
            late = len(self._waiting) > self._late
            u = self._waiting.popleft() if late else self._waiting[0].copy()  # the first command also acted before
        if self.perturbation.pushes:
            end = self.time + self.nominal.time_step
            u = np.concatenate([u, self.perturbation.push_forces(self.nominal.mechanism, self.time, end)])
        result = self.simulator.step(self.x, u)
        if result.status != _SOLVED:
            result = self._soften(u, result)
            if result.status != _SOLVED:
                return u, result
        self.x = result.x
        self.steps += 1
        return u, result

    def hold(self, command: Vector, steps: int) -> str:
        """Time steps with the same command; an unsolved one ends them.

        Args:
            command: (nu,) input that the controller commands [N, N m], as of `step`.
            steps: number of time steps.

        Returns:
            Why a step was not solved; empty if all were.

        Raises:
            ValueError: the shape of the command is wrong, or a number is not finite.
        """
        done = 0
        if self._direct and is_plain(command, (self.nominal.nu,)):
            row = self.simulator.stepper(steps)
            row.advance(self.x, self._within_limits(command))
            done = row.solved_steps
            self.x = row.states[done].copy()
            self.steps += done
        for _ in range(steps - done):
            _, result = self.step(command)
            if not result.success:
                return result.message
        return ""

    def _within_limits(self, command: Vector) -> Vector:
        """A copy of the command within the limits of the actuators: its owner may write into it meanwhile."""
        if not self._limited:
            return command.copy()
        u = np.maximum(command, self._limits[0])
        return np.minimum(u, self._limits[1], out=u)

    def _soften(self, u: Vector, result: StepResult) -> StepResult:
        """The step with the hardest contact at which it can be solved."""
        for factor in _SOFTER:
            softer = self.simulator.replace(kappa=factor * self.simulator.kappa).step(self.x, u)
            if softer.success:
                self.softened += 1
                return softer
        return result

    def fallen(self, x: Vector) -> bool:
        """Whether a robot has fallen: its base is below half its initial height, or tilted by more than 60 degrees.

        Args:
            x: (nx,) state.

        Returns:
            True if it has fallen. Always False for a robot whose base neither floats nor moves in a vertical plane.
        """
        plain = is_plain(x, (self.nominal.nx,))
        return self.fall_check(x if plain else checks.array("Plant.fallen(x)", x, (self.nominal.nx,)))


def _moved(sim: Simulator, x: Vector, offset: Vector) -> Vector:
    """The state after a displacement; its loops and gears are closed, where it has any."""
    if not offset.any():
        return x
    try:
        return np.asarray(sim.close(sim.integrate(x, offset)))
    except ValueError as error:
        raise ValueError(f"Plant(offset=...): {error}") from None


def _spread(call: str, value: ArrayLike, size: int) -> Vector:
    """A number for all, or one for each of `size`."""
    given = checks.floats(call, value)
    if given.shape not in ((), (size,)):
        raise ValueError(f"{call}: expected a number or shape ({size},), got {given.shape}")
    return np.array(np.broadcast_to(given, (size,)))
