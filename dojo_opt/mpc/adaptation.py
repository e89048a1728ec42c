"""Adaptation: parameters of the model, estimated from measurements while the controller runs.

An extended Kalman filter of the parameters theta. Its measurement is the pair of states x and x+ at both ends of an
interval:

    theta+ = theta + w,    w ~ N(0, P0 dt/memory)
    r = x+ (-) f(x, u; theta) = J (theta+ - theta) + e,    e ~ N(0, R + A R A')

f: steps of the model with hard contact, each as long as a sample. J, A: derivatives of f by the parameters and by the
state. R: noise of the measured state. An innovation r beyond two standard deviations counts less, as with Huber's
loss. Where nothing fits, for a short time, that has fitted before, the robot was pushed, and theta stays.

Feet that stand tell nothing of their friction but a lower bound (used_friction.py). J has therefore a column for a
friction only where one of its feet slides. Where the foot sticks in the model, whose contact is hard, J is the
derivative of contact as smooth as that of the plans. Intervals in which a contact lands are not used: the time of an
impact depends on the height of the ground, which is not known as exactly as the states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.identification.parameter_space import ParameterSpace
from dojo_opt.identification.windows import slopes_along
from dojo_opt.mpc.ground_estimate import Ground
from dojo_opt.mpc.used_friction import UsedFriction
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.simulator.adjustable_simulator import AdjustableSimulator
from sim.simulator.simulator import Simulator
from sim.simulator.state_space import rehearse
from solvers.types import Flags, Matrix, Vector

_ROUNDING = 1e-9  # [s]
_OUTLIER = 2.0  # standard deviations beyond which an innovation counts less, and a change of the estimate is shortened
_CURVED = 0.25  # share of a change of the estimate that may be wrong, as the prediction is not linear in it
_BRIEF = 0.2  # [s] in which an outlier is no error of parameters, if all was well before: these change for longer
_SURE = 2.0  # standard deviations of the bounds
_SEEN = 0.25  # share of its first variance that a friction has at most once a foot has slid
_SLID = 2.0  # a foot that slides is off by so many heights of a contact that stands
_KNOWN = 0.25  # share of its first deviation that a friction has when it is known
_MOVED = 0.02  # share of the spread: models are built anew when the estimate has moved by it, and linearised until then
_TRIED = 1e-3  # deviations before the first measurement: a change that models are tried with
_NEAR = 3.0  # standard deviations of the height of a contact that stands
_CLOSE = 1e-4  # [m] the same without noise
_ROUND_OFF = 1e-6  # [m, rad, m/s, rad/s] least noise: contact is not exact to the last digit

__all__ = ["Adaptation", "ParameterEstimator"]


@dataclass(frozen=True)
class Adaptation:
    """The parameters that `MPC(adapt=...)` estimates while it runs, and the settings of the estimate.

    Attributes:
        parameters: names, as in `Simulator.parameters`, such as ("mass:trunk", "friction:*").
        spread: standard deviation of the parameters before the first measurement, as a share of their values, or {label
            of `ParameterSpace`: standard deviation} (default 0.5).
        noise: standard deviation of the measured state: (2,) of coordinates and velocities, or (ndx,) [m, rad, m/s,
            rad/s] (default (1e-4, 1e-2)).
        interval: time between the two measurements of an update [s] (default 0.02).
        memory: time in which the parameters may change by their spread [s] (default 20).
        bounds: as in `ParameterSpace` (default None).
        shear: growth of a force between the standing feet, as a share of their load, until one of them slides and the
            frictions are known; see `dojo_opt.mpc.foot_shear`. 1.3 takes less than a second [1/s] (default 0: none).
    """

    parameters: Sequence[str]
    spread: float | Mapping[str, float] = 0.5
    noise: ArrayLike = (1e-4, 1e-2)
    interval: float = 0.02
    memory: float = 20.0
    bounds: Mapping[str, tuple[float, float]] | None = None
    shear: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        call = "Adaptation"
        object.__setattr__(self, "parameters", checks.names(f"{call}(parameters)", self.parameters))
        if not isinstance(self.spread, Mapping):
            checks.number(f"{call}(spread=...)", self.spread, above=0.0)
        noise = checks.array(f"{call}(noise=...)", self.noise, (None,))
        if not np.all(noise >= 0.0):
            raise ValueError(f"{call}(noise=...): expected numbers >= 0, got {noise}")
        checks.mapping(f"{call}(bounds=...)", self.bounds)
        for name in ("interval", "memory"):
            checks.number(f"{call}({name}=...)", getattr(self, name), above=0.0)
        checks.number(f"{call}(shear=...)", self.shear, at_least=0.0)


class ParameterEstimator:
    """The filter of one controller; it writes its estimate into the simulator of the plans.

    Args:
        nominal: simulator of the robot; its kappa is not used.
        planner: simulator of the plans, of the same mechanism, which takes the estimate.
        settings: what to estimate.
        friction: largest friction that plans assume.

    Raises:
        ValueError: for an unknown parameter, one that does not change in place, such as a damper that is 0, or noise of
            the wrong shape; a model of a higher order, or with an accuracy.
    """

    def __init__(
        self, nominal: Simulator, planner: AdjustableSimulator, settings: Adaptation, friction: float = np.inf
    ) -> None:
        self._nominal, self._planner, self._settings, self._friction = nominal, planner, settings, friction
        self.space = ParameterSpace(nominal, settings.parameters, bounds=settings.bounds)
        noise = checks.array("Adaptation(noise=...)", settings.noise, (None,))
        if noise.shape == (2,):
            noise = np.repeat(noise, nominal.nv)
        if noise.shape != (nominal.ndx,):
            raise ValueError(f"Adaptation(noise=...): expected (2,) or ({nominal.ndx},), got {noise.shape}")
        self._noise = np.maximum(noise, _ROUND_OFF) ** 2
        self._near = max(_CLOSE, _NEAR * float(noise[: nominal.nv].max()))
        self._prior = self._spread() ** 2
        self._check_changes()
        self._used = UsedFriction(nominal.mechanism, self.space.labels)
        if settings.shear and not self._used.frictions.any():
            raise ValueError("Adaptation(shear=...): it shows frictions, and there are none among the parameters")
        self._fine: AdjustableSimulator | None = None  # with steps of the length of the samples
        self._written = self.space.values.copy()  # the values of the models
        self.forget()

    def _check_changes(self) -> None:
        """Refuse parameters that the models cannot change while the controller runs."""
        space = self.space
        other = np.clip(space.values + _TRIED * np.sqrt(self._prior), space.low, space.high)
        try:
            AdjustableSimulator.like(self._nominal).set_parameters(space.named(other))
        except ValueError as error:
            raise ValueError(f"MPC(adapt=...): {error}") from error

    def _spread(self) -> Vector:
        """(n,) standard deviations before the first measurement."""
        given, values = self._settings.spread, self.space.values
        if isinstance(given, Mapping):
            for label in given:
                checks.one_of("Adaptation(spread=...)", label, self.space.labels)
            missing = [label for label in self.space.labels if label not in given]
            if missing:
                raise ValueError(f"Adaptation(spread=...): {missing[0]!r} has none")
            return np.array([checks.number("Adaptation(spread=...)", given[x], above=0.0) for x in self.space.labels])
        if not np.all(values):
            label = self.space.labels[int(np.argmin(np.abs(values)))]
            raise ValueError(f"Adaptation(spread=...): {label!r} is 0; give {{label: standard deviation}}")
        return float(given) * np.abs(values)

    @property
    def values(self) -> dict[str, float]:
        """The estimate, by label of the parameter."""
        return dict(zip(self.space.labels, self.theta.tolist(), strict=True))

    @property
    def deviations(self) -> dict[str, float]:
        """The standard deviations of the estimate, by label."""
        return dict(zip(self.space.labels, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def knows_friction(self) -> bool:
        """Whether the deviations of all frictions are below a quarter of those before the first measurement."""
        frictions = self._used.frictions
        return bool(np.all(np.diag(self.covariance)[frictions] < _KNOWN**2 * self._prior[frictions]))

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds by label: two standard deviations about the estimate. Those of a friction begin at what standing feet
        have used, and have no end until a foot has slid: it takes that to tell more.
        """
        off = _SURE * np.sqrt(np.diag(self.covariance))
        low, high = self.theta - off, self.theta + off
        unseen = self._used.frictions & (off**2 > _SEEN * _SURE**2 * self._prior)
        low = np.where(self._used.frictions, np.maximum(np.where(unseen, 0.0, low), self._used.least), low)
        high = np.where(unseen, np.inf, high)
        return {k: (float(a), float(b)) for k, a, b in zip(self.space.labels, low, high, strict=True)}

    def forget(self) -> None:
        """Back to the values of the robot, without measurements."""
        self.theta, self.covariance = self.space.values.copy(), np.diag(self._prior)
        self._settled, self._disturbed = False, 0.0
        self._used.forget()
        if not np.array_equal(self.theta, self._written):
            self._write()
        self._samples: list[tuple[float, Vector, Vector]] = []  # (time, state, input after it)

    def rehearse(self, x: Vector) -> None:
        """Make the calls of an update from the state x (nx,), so that no later one loads code."""
        rehearse(self._nominal, x, derivatives=True)
        self._predict(self._nominal, x, np.zeros((1, self._nominal.nu)))

    def observe(self, time: float, x: Vector, u: Vector, ground: Ground) -> None:
        """Take a sample.

        Args:
            time: time of the measurement [s].
            x: (nx,) measured state.
            u: (nu,) input that acts from then on [N, N m].
            ground: the ground as the controller believes it to be.
        """
        samples = self._samples
        if samples and time <= samples[-1][0]:
            samples.clear()
        samples.append((time, x.copy(), u.copy()))
        if len(samples) > 1 and time - samples[0][0] >= self._settings.interval - _ROUNDING:
            self._update(ground)
            del samples[:-1]

    def _model(self) -> AdjustableSimulator | None:
        """The model with steps of the length of the samples; None where they come at uneven times."""
        times = np.diff([time for time, *_ in self._samples])
        h = float(times.mean())
        if np.abs(times - h).max() > _ROUNDING:
            return None
        if self._fine is None or abs(self._fine.time_step - h) > _ROUNDING:
            self._fine = AdjustableSimulator.like(self._nominal.replace(time_step=h, kappa=None))
            self._fine.set_parameters(self.space.named(self._written))
        return self._fine

    def _update(self, ground: Ground) -> None:
        """One measurement of the filter."""
        fine = self._model()
        if fine is None:
            return
        x, us = self._samples[0][1], np.array([u for *_, u in self._samples[:-1]])
        self.covariance = self.covariance + np.diag(self._prior * len(us) * fine.time_step / self._settings.memory)
        gaps = ground.gaps(ground.points(x))
        self._stand(fine, ground, gaps)
        found = self._predict(fine, x, us)
        if found is None or self._lands(ground, gaps, self._samples[-1][1], found[0]):
            return
        end, A, J = found
        stands, slides = self._feet(ground, gaps, self._samples[-1][1], end)
        contacts = fine.rollout(x, us).contacts
        J = J * self._used.tells(slides | self._used.sliding(contacts, stands))
        innovation, inflation = fine.difference(self._samples[-1][1], end), _CURVED
        size = self._normalized(innovation, A, J)
        if size > _OUTLIER and slides.any():  # in the model they stick, which has no derivative by friction
            smooth = self._planner.kappa * fine.time_step / self._planner.time_step
            found = self._predict(fine, x, us, smooth)
            if found is not None:
                J, inflation = found[2] * self._used.tells(slides), 1.0
                size = self._normalized(innovation, A, J)
        if self._is_disturbed(size, len(us) * fine.time_step):
            J = J * self._used.frictions
        elif size < _OUTLIER and not slides.any():
            self._used.observe(contacts, stands, float(np.sqrt(np.mean(innovation[fine.nv :] ** 2))))
        self._correct(innovation, A, J, size, inflation)
        self._used.bound(self.theta + _SURE * np.sqrt(np.diag(self.covariance)), slides)
        self.theta = np.clip(self.theta, self._used.least, self.space.high)
        if np.any(np.abs(self.theta - self._written) > _MOVED * np.sqrt(self._prior)):
            self._write()

    def _predict(
        self, fine: Simulator, x: Vector, us: Matrix, kappa: float | None = None
    ) -> tuple[Vector, Matrix, Matrix] | None:
        """State after the inputs us, A = d(state)/dx and J = d(state)/d(theta); None if a step fails."""
        xs, linear = fine.linearize_rollout(x, us, kappa=kappa, wrt=self.space.wrt)
        if not linear.success:
            return None
        by_theta = self.space.chain(self._written, linear.parameters)
        slopes = slopes_along(linear.A, by_theta, np.array([len(us)]))[0]
        return xs[-1], slopes[:, : fine.ndx], slopes[:, fine.ndx :]

    def _at_estimate(self, innovation: Vector, J: Matrix) -> Vector:
        """The innovation of the estimate, from that of the values that the models have."""
        return innovation - J @ (self.theta - self._written)

    def _innovation_covariance(self, A: Matrix, J: Matrix) -> tuple[Matrix, Matrix]:
        """Its two parts: R + A R A' of the measured states, and J P J' of the parameters."""
        return np.diag(self._noise) + (A * self._noise) @ A.T, J @ self.covariance @ J.T

    def _normalized(self, innovation: Vector, A: Matrix, J: Matrix) -> float:
        """Root mean square of an innovation in standard deviations."""
        r = self._at_estimate(innovation, J)
        return float(np.sqrt(r @ np.linalg.solve(sum(self._innovation_covariance(A, J)), r) / len(r)))

    def _correct(self, innovation: Vector, A: Matrix, J: Matrix, size: float, inflation: float) -> None:
        """Update estimate and covariance.

        innovation: measured (-) predicted state
        size: `_normalized` of it
        inflation: share of the change of the estimate that is added to its standard deviation, as J is the derivative
            at another point, or of smoothed contact
        """
        R, of_parameters = self._innovation_covariance(A, J)
        R *= max(1.0, size / _OUTLIER)
        P = self.covariance
        gain = np.linalg.solve(R + of_parameters, J @ P).T
        change = gain @ self._at_estimate(innovation, J)
        change /= max(1.0, float(np.sqrt(change @ np.linalg.solve(P, change) / len(change))) / _OUTLIER)
        low, high = (0.5 * (self.theta + bound) for bound in (self.space.low, self.space.high))
        self.theta = np.clip(self.theta + change, low, high)  # at most half-way to a bound at once
        P = P - gain @ J @ P
        P = 0.5 * (P + P.T) + np.diag((inflation * change) ** 2)
        scale = np.sqrt(np.minimum(1.0, self._prior / np.diag(P)))  # no estimate is worse than none
        self.covariance = scale[:, None] * P * scale

    def _feet(self, ground: Ground, gaps: Vector, measured: Vector, predicted: Vector) -> tuple[Flags, Flags]:
        """Feet that stand at both ends of an interval, and those of them that moved along the ground and not so in the
        model.
        """
        there, here = ground.points(np.stack([measured, predicted]))
        stands = (np.abs(gaps) < self._near) & (ground.gaps(there) < self._near)
        moved = np.linalg.norm(there - here, axis=1) > _SLID * self._near
        return stands, stands & moved

    def _is_disturbed(self, size: float, time: float) -> bool:
        """Whether an interval was disturbed from outside: for a short time, nothing fits that has fitted before. It
        tells nothing then but the friction of feet that slid.

        size: `_normalized` of the innovation, of an interval of this time
        """
        if size <= _OUTLIER:
            self._settled, self._disturbed = True, 0.0
        elif self._settled and self._disturbed < _BRIEF:
            self._disturbed += time
            return True
        return False

    def _lands(self, ground: Ground, gaps: Vector, *ends: Vector) -> bool:
        """Whether a contact that is in the air, by its gap at first, touches the ground at one of the ends."""
        after = ground.gaps(ground.points(np.stack(ends)))
        return bool(np.any((gaps > self._near) & (after < self._near)))

    def _stand(self, fine: AdjustableSimulator, ground: Ground, gaps: Vector) -> None:
        """Put the ground of the model under every contact that stands: its gap is that of a noisy state."""
        if ground.normal is not None:
            fine.turn_ground(ground.normal)
        fine.model.contact_height[:] = ground.height + np.where(np.abs(gaps) < self._near, gaps, np.minimum(gaps, 0.0))

    def _write(self) -> None:
        """Write the estimate into both models, which takes some milliseconds."""
        self._written = self.theta.copy()
        values = self.space.named(self.theta)
        if self._fine is not None:
            self._fine.set_parameters(values)
        planned = {k: np.minimum(self._friction, v) if k.startswith("friction") else v for k, v in values.items()}
        self._planner.set_parameters(planned)
