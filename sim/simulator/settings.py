"""Settings of a time step."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from sim.mechanism import checks
from sim.mechanism.joint import WORLD
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.mobility import largest_mobility
from sim.model.record_columns import StepSetting
from sim.solve.energy_balance import LARGEST_GAIN
from solvers.types import Vector

__all__ = ["LEAST_ACCURACY", "SETTING_NAMES", "Settings", "checked_settings", "default_kappa", "free_parts", "of_call",
           "with_accuracy"]  # fmt: skip

# of Simulator(...), in order; files of motions have them by these names
SETTING_NAMES = ("time_step", "kappa", "tolerance", "max_iterations", "order", "divide", "accuracy", "cutoff")

LEAST_ACCURACY = 1e-12  # [m/s, rad/s]
_ORDERS = (2, 4, 6, 8)
_CREEP = 1e-9  # [m/s]
_PUSH = 1e-2  # (speed at which an opening contact is pushed away, over the accuracy)^2
_PUSH_APART = 3e-4  # likewise, of the lightest part, where bodies collide
_FAST = 1e100  # [m/s, rad/s] beyond any speed; its square is a float
_EARTH = 9.81  # [m/s^2] in scenes without gravity
_SMALLEST, _LARGEST = 1e-13, 1e-6  # [N s m]; products of slack and impulse are rounded to 2e-14
_FINEST = 1e-18  # [m^2/s] least kappa over the mass; the tolerance of products is larger, solutions have less


class Settings(NamedTuple):
    """Settings of a time step."""

    time_step: float  # [s]
    kappa: float  # central-path parameter [N s m]
    tolerance: float
    max_iterations: int
    order: int = 2  # of a step
    divide: bool = True  # whether steps that cannot be solved are divided
    gain: float = LARGEST_GAIN  # largest gain of energy of a solved step, of the energies that change in it
    loss: float = inf  # largest loss where nothing dissipates, likewise
    accuracy: float = 0.0  # error of coordinates that steps may make [m/s, rad/s]; 0: steps are not divided for it
    cutoff: float = 0.0  # stiffness over mass of far contacts (contact/far_contacts.py); 0: none is far
    left: float = 0.0  # part of the overlaps of shapes where a step begins that it may leave

    def shown(self) -> str:
        """Settings by name, as text; those that are 0 by default only where they are not."""
        given = [name for name in SETTING_NAMES if name not in ("accuracy", "cutoff") or getattr(self, name)]
        given = [name for name in given if name != "order" or not self.accuracy]  # which chooses the orders itself
        texts = [f"{value:g}" if isinstance(value := getattr(self, name), float) else repr(value) for name in given]
        return ", ".join(f"{name}={text}" for name, text in zip(given, texts, strict=True))

    @property
    def kind(self) -> str:
        """The kind of steps, for messages about what only those of order 2 can do."""
        return f"accuracy {self.accuracy:g}" if self.accuracy else f"order {self.order}"

    @property
    def way_to_order_two(self) -> str:
        """The call that gives a simulator of order 2, for the same messages."""
        return "replace(accuracy=None)" if self.accuracy else "replace(order=2)"

    def array(self, kappa: float | None = None) -> Vector:
        """The settings as an array for kernels, without those that only choose the engine.

        kappa: replaces that of the settings. The deadline (interruptible_loops.py) is infinite; motions begin without
        impulses.
        """
        level = self.kappa if kappa is None else kappa
        limits = self.max_iterations, inf, self.gain, self.loss, 0.0, self.cutoff, self.left
        return np.array((self.time_step, level, self.tolerance, *limits), dtype=np.float64)


def checked_settings(
    mechanism: Mechanism,
    time_step: float,
    kappa: float | None,
    tolerance: float,
    max_iterations: int,
    order: int,
    divide: bool,
    cutoff: float,
) -> Settings:
    """Settings from arguments of `Simulator`, which describes them; kappa: checked, None for the default."""
    limit = checks.whole_number("Simulator(max_iterations=...)", max_iterations)
    if not isinstance(divide, bool | np.bool_):
        raise TypeError(f"Simulator(divide=...): expected True or False, got {divide!r}")
    if not isinstance(order, int | np.integer) or order not in _ORDERS:
        raise ValueError(f"Simulator(order=...): expected one of {_ORDERS}, got {order!r}")
    h = checks.number("Simulator(time_step=...)", time_step, above=0.0)
    level = default_kappa(mechanism, h) if kappa is None else kappa
    residual = checks.number("Simulator(tolerance=...)", tolerance, above=0.0)
    far = checks.number("Simulator(cutoff=...)", cutoff, at_least=0.0)
    if far > 0.0 and order != 2:
        raise ValueError(f"Simulator(cutoff=...): expected steps of order 2, got order={order}")
    return Settings(h, level, residual, int(limit), int(order), bool(divide), cutoff=far)


def of_call(settings: Vector, kappa: float | None, max_iterations: int | None) -> Vector:
    """A copy of `Settings.array` for one call, at another kappa or limit of iterations where it has its own."""
    out = settings.copy()
    if kappa is not None:
        out[StepSetting.KAPPA] = kappa
    if max_iterations is not None:
        out[StepSetting.MAX_ITERATIONS] = max_iterations
    return out


def with_accuracy(settings: Settings, accuracy: float | None, mechanism: Mechanism | None) -> Settings:
    """Settings of steps of an accuracy [m/s, rad/s], at least LEAST_ACCURACY, which choose their orders themselves.

    mechanism: whose kappa is the default one; that is lowered to

        kappa <= .01 accuracy^2 h / w,    at least `least_kappa`

    w is the velocity of the most mobile coordinate per impulse in it [1/kg, 1/(kg m^2)] (mobility.py), or of the
    lightest free part where that is larger: a contact or limit that opens pushes it away with sqrt(w kappa/h), and
    repeatedly in short steps. Where bodies collide kappa is at most 3e-4 m accuracy^2 h with the mass m of the lightest
    part.
    """
    if accuracy is None:
        return settings
    number = checks.number("Simulator(accuracy=...)", accuracy, above=0.0)
    if number < LEAST_ACCURACY:
        raise ValueError(f"Simulator(accuracy=...): expected at least {LEAST_ACCURACY:g}, got {accuracy!r}")
    if settings.cutoff > 0.0:
        raise ValueError(f"Simulator(cutoff=...): expected no accuracy, got {accuracy!r}")
    if settings.order != 2:
        raise ValueError(f"Simulator(accuracy=...): it chooses the order itself, got order={settings.order}")
    kappa = settings.kappa
    if mechanism is not None and (mechanism.contacts or mechanism.joints):
        parts, collides = free_parts(mechanism), bool(mechanism.collisions)
        lightest = 1.0 / min(parts, default=1.0)
        push = _PUSH_APART / lightest if collides else _PUSH / max(largest_mobility(mechanism), lightest)
        most = push * min(number, _FAST) ** 2 * settings.time_step
        kappa = min(kappa, max(most, least_kappa(sum(parts), collides)))
    return settings._replace(accuracy=number, order=8, kappa=kappa)


def least_kappa(mass: float, collides: bool) -> float:
    """The least kappa of steps with an accuracy [N s m]: 1e-18 m^2/s times the mass of all parts, or of 1 kg if that is
    more, and at most 1e-13 N s m.

    A light limit that opens after an impact is still pushed little in the short steps there. Where bodies collide it is
    1e-13: gaps below a load have to stay above the rounding of positions.
    """
    return _SMALLEST if collides else min(_FINEST * max(mass, 1.0), _SMALLEST)


def free_parts(mechanism: Mechanism) -> list[float]:
    """Masses of the groups of bodies that joints hold together and that can move [kg]."""
    group = {body.name: body.name for body in mechanism.bodies}

    def leader(name: str) -> str:
        while group[name] != name:
            name = group[name]
        return name

    for joint in (*mechanism.joints, *mechanism.loops):
        if WORLD not in (joint.parent, joint.child):
            group[leader(joint.child)] = leader(str(joint.parent))
    free = {leader(joint.child) for joint in mechanism.joints if joint.nv > 0}
    return [sum(body.mass for body in mechanism.bodies if leader(body.name) == head) for head in free]


def default_kappa(mechanism: Mechanism, time_step: float) -> float:
    """Central-path parameter of a simulator that was given none [N s m]:

        kappa = 1e-9 m/s * m |g| h,    between 1e-13 and 1e-6

    m is the mass of the lightest part that no joint holds to another [kg], h the time step [s], |g| the size of
    gravity, 9.81 m/s^2 where there is none. Such a part, at rest on n contacts that share its weight, floats n * 1e-9 m
    above the ground whatever it weighs and at every time step, and creeps down a slope a with
    n * 1e-9 m/s * tan a / (cos a (mu^2 - tan^2 a)): less than 1e-6 m in 10 s, but for slopes close to the cone.
    Where bodies collide, m is the mass of all parts: each may carry the others, and the gap below its load has to stay
    above the rounding of positions.
    """
    masses = free_parts(mechanism)
    mass = sum(masses) if mechanism.collisions else min(masses)
    gravity = float(np.linalg.norm(np.asarray(mechanism.gravity))) or _EARTH
    return float(np.clip(_CREEP * mass * gravity * time_step, _SMALLEST, _LARGEST))
