"""Plant: a simulator that differs from the controller's model."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.gaits.feet import Feet
from dojo_opt.plant.perturbation import Perturbation
from sim.mechanism import checks
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import rotation_matrix
from sim.model.state_columns import BodyState
from sim.simulator.results import StepResult
from sim.simulator.simulator import Simulator
from solvers.types import Vector

__all__ = ["Plant"]

_SOFTER = (10.0, 100.0, 1000.0)  # times the smoothing of a step that is not solved at its own
_LOW = 0.5  # a base below this share of its first height has fallen
_TILTED = 0.5  # and so has one whose axis has a smaller cosine with the normal of the ground
_FLOOR = 0.1  # a plane with a normal that points up by more than this can be the floor
_LEVEL = 1e-6  # vertical part of a level axis


class Plant:
    """A simulated robot that is measured, commanded and pushed.

    `simulator` is the perturbed one. It has three more inputs for every body that is pushed. An unsolved step is
    repeated with softer contact, up to a thousand times its kappa; `softened` counts these steps.

    Args:
        sim: mechanism, time step and smoothing of the plant before the perturbation: usually those of the model with a
            time step five to fifty times shorter and kappa=1e-8.
        start: (nx,) state at time zero on level ground (default None: the neutral one).
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
        contacts = self.simulator.mechanism.contacts
        self._floor = next((c for c in contacts if c.terrain is not None or np.asarray(c.normal)[2] > _FLOOR), None)
        self._noise = _spread("Plant(noise=...)", p.noise, sim.ndx)
        lo, hi = sim.mechanism.input_limits if p.control_limits is None else p.control_limits
        self._limits = tuple(_spread("Plant(control_limits=...)", b, sim.nu) for b in (lo, hi))
        self._late = round(p.delay / sim.time_step)
        if abs(self._late * sim.time_step - p.delay) > 1e-9:
            raise ValueError(
                f"Plant(delay=...): expected a multiple of the time step {sim.time_step:g} s, got {p.delay:g} s"
            )
        x = self.start
        if np.size(p.offset):
            x = sim.integrate(x, checks.array("Plant(offset=...)", p.offset, (sim.ndx,)))
        self._x0 = p.on_ground(sim.mechanism, x)
        if p.terrain is not None:
            self._x0 = Feet(self.simulator, self.simulator.mechanism.contact_names).put_down(x)
        self.reset()

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
        if not self._noise.any():
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
        given = checks.array("Plant.step(command)", command, (self.nominal.nu,))
        lowest, highest = self._limits
        u = np.maximum(given, lowest)  # a copy: its owner may write into the command meanwhile
        np.minimum(u, highest, out=u)
        if self._late:
            self._waiting.append(u)
            late = len(self._waiting) > self._late
            u = self._waiting.popleft() if late else self._waiting[0].copy()  # the first command also acted before
        if self.perturbation.pushes:
            end = self.time + self.nominal.time_step
            u = np.concatenate([u, self.perturbation.push_forces(self.nominal.mechanism, self.time, end)])
        result = self.simulator.step(self.x, u)
        if not result.success:
            result = self._soften(u, result)
            if not result.success:
                return u, result
        self.x = result.x
        self.steps += 1
        return u, result

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
        if not stands_free(self.nominal.mechanism):
            return False
        now, first = self._base(x), self._base(self._x0)
        low = self._above(now[:3]) < _LOW * self._above(first[:3])
        up = rotation_matrix(now[BodyState.QUATERNION]) @ rotation_matrix(first[BodyState.QUATERNION]).T @ self.normal
        return bool(low or up @ self.normal < _TILTED)

    def _above(self, place: Vector) -> float:
        """Height of a place (3,) above the ground below it [m]."""
        contact, z = self._floor, float(place[2])
        if contact is None:
            return z
        if contact.terrain is not None:
            return z - contact.height - float(contact.terrain.height(place[0], place[1]))
        normal = np.asarray(contact.normal)
        return float((normal @ place - contact.height) / normal[2])

    def _base(self, x: Vector) -> Vector:
        """Maximal state (13,) of the first body."""
        return np.asarray(self.nominal.maximal(x)[0])


def _spread(call: str, value: ArrayLike, size: int) -> Vector:
    """A number for all, or one for each of `size`."""
    given = checks.floats(call, value)
    if given.shape not in ((), (size,)):
        raise ValueError(f"{call}: expected a number or shape ({size},), got {given.shape}")
    return np.array(np.broadcast_to(given, (size,)))


def stands_free(mechanism: Mechanism) -> bool:
    """Whether the first joint lets its body move up and down and tip over: no pendulum and no arm."""
    base = mechanism.joints[0]
    return base.kind == "floating" or (base.kind == "planar_axis" and abs(_world_axis(base)[2]) < _LEVEL)


def _world_axis(joint: Joint) -> Vector:
    """Axis of a joint on the world, world axes."""
    return np.asarray(rotation_matrix(joint.orientation) @ np.asarray(joint.axis))
