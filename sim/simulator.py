"""Simulator: one mechanism with a time step; steps, derivatives, rollouts, and other views of a state."""

from __future__ import annotations

from dataclasses import replace as changed
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import checks
from sim.border import Border, shaped, whole
from sim.build import mechanism_sizes, pack
from sim.calls import Calls, Settings
from sim.describe import describe
from sim.mechanism import Mechanism, with_contacts
from sim.results import Batch, Linearization, Shot, SimulationError, StepResult, Trajectory, contacts_of, error_of
from solvers.status import MESSAGES, Status

Floats = NDArray[np.float64]

_SETTINGS = ("time_step", "kappa", "tolerance", "max_iterations")


class Simulator:
    """A mechanism, a time step [s], and how exactly a step is solved.

    kappa           central-path parameter [N s m]: every contact presses with kappa / gap, so a resting body floats by
                    kappa / impulse; smaller is harder
    tolerance       of the equations of a step [N s, N m s, m], relative to 1 + the largest momentum
    max_iterations  of the interior point

    A state is x = [q; v] (nx,), an input u (nu,) in N and N m, a perturbation dx (ndx,) = [dq; dv]; see `describe()`.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        time_step: float = 0.02,
        kappa: float = 1e-6,
        tolerance: float = 1e-8,
        max_iterations: int = 50,
    ) -> None:
        if not isinstance(mechanism, Mechanism):
            raise TypeError(f"Simulator(mechanism): expected a Mechanism, got {mechanism!r}")
        if not isinstance(max_iterations, int | np.integer) or max_iterations < 1:
            raise ValueError(f"Simulator(max_iterations=...): expected a whole number >= 1, got {max_iterations!r}")
        self.mechanism = mechanism
        self.time_step = checks.number("Simulator(time_step=...)", time_step, above=0.0)
        self.kappa = checks.number("Simulator(kappa=...)", kappa, above=0.0)
        self.tolerance = checks.number("Simulator(tolerance=...)", tolerance, above=0.0)
        self.max_iterations = int(max_iterations)
        self.model_floats, self.model_ints = pack(mechanism)
        self.nbody, self.nq, self.nv, self.ncontact, _, self.nu = mechanism_sizes(mechanism)
        self.nx, self.ndx = self.nq + self.nv, 2 * self.nv
        settings = Settings(self.time_step, self.kappa, self.tolerance, self.max_iterations)
        self._calls = Calls(self.model_floats, self.model_ints, settings)
        self._border = Border(mechanism, self._calls)

    def __setattr__(self, name: str, value: Any) -> None:
        if hasattr(self, "_border"):
            raise AttributeError(f"Simulator.{name}: a Simulator does not change; use replace({name}=...)")
        super().__setattr__(name, value)

    def __reduce__(self) -> Any:
        return Simulator, (self.mechanism, *self._calls.settings)

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name}={value:g}" for name, value in self._calls.settings._asdict().items())
        return f"Simulator({self.mechanism.name}, {numbers})"

    def replace(self, **settings: Any) -> Simulator:
        """The same with other settings: those of Simulator(...), and `friction`, `law`, `gravity`, `mechanism`.

        friction, law: for all contacts, or {contact name: value}. Compiled code is shared.
        """
        known = ("mechanism", *_SETTINGS, "friction", "law", "gravity")
        for key in settings:
            checks.one_of("Simulator.replace(...)", key, known)
        mech = settings.pop("mechanism", self.mechanism)
        for field in ("friction", "law"):
            if field in settings:
                mech = with_contacts(mech, field, settings.pop(field))
        if "gravity" in settings:
            mech = changed(mech, gravity=settings.pop("gravity"))
        return Simulator(mech, **{**self._calls.settings._asdict(), **settings})

    def describe(self) -> str:
        """What the scene consists of, what a step computes, and what is left out because nothing needs it."""
        return describe(self)

    # ---- states

    def neutral(self) -> Floats:
        """The standing or hanging state of the mechanism, at rest."""
        return np.concatenate([np.asarray(self.mechanism.neutral, dtype=np.float64), np.zeros(self.nv)])

    def start(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """State with coordinates q (nq,) whose velocity at the node is v (nv,).

        The velocity of a state is the mean one of the interval before it; this one has the momentum M(q) v at its end,
        so that a simulation started with it is right to second order from its first step.
        """
        q0 = checks.array("Simulator.start(q)", q, (self.nq,))
        v0 = checks.array("Simulator.start(v)", v, (self.nv,))
        q0 = self._border.states("Simulator.start(q)", np.concatenate([q0, v0]))[: self.nq]
        status, x = self._calls.start(q0, v0)
        if status != Status.SOLVED:
            reason = Status(status)
            raise SimulationError(f"Simulator.start: {MESSAGES[reason]}", reason)
        return x

    def integrate(self, x: ArrayLike, dx: ArrayLike) -> Floats:
        """x (+) dx: the state moved by a perturbation; leading axes are broadcast."""
        xs, dxs, lead = self._border.paired("integrate", ("x", x, self.nx), ("dx", dx, self.ndx))
        return self._calls.integrate(xs, dxs).reshape(*lead, self.nx)

    def difference(self, x0: ArrayLike, x1: ArrayLike) -> Floats:
        """x1 (-) x0: the dx with integrate(x0, dx) = x1; leading axes are broadcast."""
        x0s, x1s, lead = self._border.paired("difference", ("x0", x0, self.nx), ("x1", x1, self.nx))
        return self._calls.difference(x0s, x1s).reshape(*lead, self.ndx)

    def maximal(self, x: ArrayLike) -> Floats:
        """z (nbody, 13) per body [position, velocity (world), quaternion, omega (body)]; leading axes allowed."""
        xs, lead = self._border.stacked("maximal", "x", x)
        return self._calls.maximal(xs, self.nbody).reshape(*lead, self.nbody, 13)

    def minimal(self, z: ArrayLike, joint_tolerance: float = 1e-6) -> Floats:
        """The state x with maximal(x) = z; leading axes allowed.

        A z that is off its joints by more than `joint_tolerance` [m, rad] at either end of its interval is refused;
        with infinity, the nearest motion along the joints is returned.
        """
        zs = np.array(shaped("Simulator.minimal(z)", z, (self.nbody, 13)))
        lead = zs.shape[:-2]
        zs = zs.reshape(-1, self.nbody, 13)
        self._border.check_maximal(zs)
        xs = self._calls.minimal(zs)
        if joint_tolerance < np.inf:
            self._border.check_joints(zs, self._calls.maximal(xs, self.nbody), joint_tolerance)
        return xs.reshape(*lead, self.nx)

    def maximal_jacobian(self, x: ArrayLike) -> Floats:
        """dz/dx (12 nbody, ndx), per body [position, velocity, rotation, omega], in tangent coordinates."""
        return self._calls.maximal_jacobian(self._border.state("maximal_jacobian", x), self.nbody)

    def minimal_jacobian(self, z: ArrayLike) -> Floats:
        """dx/dz (ndx, 12 nbody), the inverse of `maximal_jacobian` along the joints."""
        zs = checks.array("Simulator.minimal_jacobian(z)", z, (self.nbody, 13))
        self._border.check_maximal(zs[None])
        return self._calls.minimal_jacobian(zs)

    def energy(self, x: ArrayLike) -> Any:
        """Kinetic and potential energy at the node [J]; leading axes allowed."""
        xs, lead = self._border.stacked("energy", "x", x)
        total = self._calls.energies(xs).sum(axis=1).reshape(lead)
        return total if lead else float(total)

    def kinetic_energy(self, x: ArrayLike) -> Any:
        """Kinetic energy at the node [J]; leading axes allowed."""
        xs, lead = self._border.stacked("kinetic_energy", "x", x)
        kinetic = self._calls.energies(xs)[:, 0].reshape(lead)
        return kinetic if lead else float(kinetic)

    def momentum(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """(linear [N s], angular about the world's origin [N m s]) momentum at the node; leading axes allowed."""
        xs, lead = self._border.stacked("momentum", "x", x)
        p = self._calls.momenta(xs).reshape(*lead, 6)
        return p[..., :3].copy(), p[..., 3:].copy()

    # ---- motion

    def step(self, x: ArrayLike, u: ArrayLike | None = None, *, throw: bool = False) -> StepResult:
        """One time step from x under the input u (zero when left out)."""
        state = self._border.state("step", x)
        us = self._border.inputs("step", "u", np.zeros(self.nu) if u is None else u, (self.nu,))
        knot, xs, reports, contacts = self._calls.roll(state, us[None])
        status, iterations, residual, violation = reports[0, :4]
        if knot == 0 and throw:
            raise error_of(self.mechanism, "Simulator.step", reports[0], self.tolerance)
        out = xs[knot] if knot else state
        return StepResult(
            out,
            Status(int(status)),
            int(iterations),
            float(residual),
            float(violation),
            contacts_of(self.mechanism, self.time_step, contacts[0]),
        )

    def rollout(self, x: ArrayLike, us: ArrayLike, *, throw: bool = False) -> Trajectory:
        """Steps from x under the inputs us (T, nu); stops at the first step that cannot be solved, and says so."""
        state = self._border.state("rollout", x)
        inputs = self._border.inputs("rollout", "us", us, (None, self.nu))
        knot, xs, reports, contacts = self._calls.roll(state, inputs)
        last = reports[min(knot, len(inputs) - 1)] if len(inputs) else np.zeros(5)
        status = Status(int(last[0]))
        error = (
            None
            if status == Status.SOLVED
            else error_of(self.mechanism, f"Simulator.rollout: step {knot}", last, self.tolerance)
        )
        if error and throw:
            raise error
        return Trajectory(
            simulator=self,
            x=xs[: knot + 1],
            u=inputs[:knot],
            time=self.time_step * np.arange(knot + 1.0),
            status=status,
            knot=knot,
            residual=float(last[2]),
            iterations=reports[:knot, 1].astype(np.int64),
            contacts=contacts_of(self.mechanism, self.time_step, contacts[:knot]),
            message=str(error) if error else MESSAGES[status],
        )

    def rollout_batch(self, x0s: ArrayLike, us: ArrayLike) -> Batch:
        """Rollouts from the states x0s (n, nx) under the inputs us (n, T, nu), over all cores."""
        call = "Simulator.rollout_batch"
        inputs = self._border.inputs("rollout_batch", "us", us, (None, None, self.nu))
        starts = self._border.states(f"{call}(x0s)", checks.array(f"{call}(x0s)", x0s, (len(inputs), self.nx)))
        xs, status, knots = self._calls.roll_batch(starts, inputs)
        for x, knot in zip(xs, knots, strict=True):
            x[knot + 1 :] = x[knot]
        return Batch(xs, status, knots)

    def closed_loop(
        self,
        x0: ArrayLike,
        us: ArrayLike,
        xs: ArrayLike | None = None,
        ks: ArrayLike | None = None,
        Ks: ArrayLike | None = None,
        gaps: ArrayLike | None = None,
        alpha: float = 1.0,
        limits: tuple[ArrayLike, ArrayLike] | None = None,
        substeps: int = 1,
        kappa: float | None = None,
    ) -> Shot:
        """Rollout under a policy, each knot `substeps` steps with u held:

            u_t     = clamp(us_t + alpha ks_t + Ks_t (x_t (-) xs_t))
            x_t+1   = f(x_t, u_t) (+) (alpha - 1) gaps_t+1

        us (T, nu), xs (T + 1, nx), ks (T, nu), Ks (T, nu, ndx), gaps (T + 1, ndx), limits (lower, upper)
        of u.
        It stops at the first knot that cannot be solved.
        """
        call = "closed_loop"
        state, inputs = self._border.state(call, x0, "x0"), self._border.inputs(call, "us", us, (None, self.nu))
        name = f"Simulator.{call}"
        factor = checks.number(f"{name}(alpha=...)", alpha)
        knot, x_out, u_out, report = self._calls.closed_loop(
            state,
            inputs,
            self._border.policy(name, state, len(inputs), (xs, ks, Ks, gaps)),
            factor,
            self._border.limits(name, limits),
            whole(f"{name}(substeps=...)", substeps),
            self._border.kappa(call, kappa),
        )
        return Shot(x_out[: knot + 1], u_out[:knot], Status(int(report[0])), knot, float(report[2]))

    # ---- derivatives

    def linearize(self, x: ArrayLike, u: ArrayLike | None = None, kappa: float | None = None) -> tuple[Floats, Floats]:
        """(A, B) = d(next state)/d(x, u), (ndx, ndx) and (ndx, nu), of the step solved at `kappa`.

        By the implicit function theorem, in tangent coordinates. An unsolved step raises SimulationError.
        """
        state = self._border.state("linearize", x)
        us = self._border.inputs("linearize", "u", np.zeros(self.nu) if u is None else u, (self.nu,))
        A, B, _, report = self._calls.linearize_one(state, us, self._border.kappa("linearize", kappa))
        if report[0] != Status.SOLVED:
            raise error_of(self.mechanism, "Simulator.linearize", report, self.tolerance)
        return A, B

    def linearize_trajectory(
        self, xs: ArrayLike, us: ArrayLike, substeps: int = 1, kappa: float | None = None
    ) -> Linearization:
        """`linearize` at the knots (xs_t, us_t), in parallel; each knot spans `substeps` steps with u held.

        xs: (T, nx) or (T + 1, nx), of which the last is not used; us: (T, nu).
        """
        call = "Simulator.linearize_trajectory"
        inputs = self._border.inputs("linearize_trajectory", "us", us, (None, self.nu))
        states = self._border.states(f"{call}(xs)", checks.array(f"{call}(xs)", xs, (None, self.nx)))
        if len(states) - len(inputs) not in (0, 1):
            raise ValueError(
                f"{call}(xs): expected {len(inputs)} or {len(inputs) + 1} states, as us, got {len(states)}"
            )
        steps = whole(f"{call}(substeps=...)", substeps)
        level = self._border.kappa("linearize_trajectory", kappa)
        A, B, x_next, reports = self._calls.linearize(states[: len(inputs)], inputs, steps, level)
        return Linearization(A, B, x_next, reports[:, 0].astype(np.int64))
