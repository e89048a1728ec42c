"""StateSpace: the states of one mechanism on their manifold, and other views of them, without motion."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sim import drawn
from sim.dynamics.loops.loop_rank import LoopRank
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import pack
from sim.mechanism.renamed import renamed
from sim.model.layout import sizes_of
from sim.model.record_columns import StepReport
from sim.simulator.arguments import Arguments, shaped
from sim.simulator.describe import describe
from sim.simulator.engines.engine_choice import engine_of
from sim.simulator.loop_closure import Closure
from sim.simulator.results import fastest_body, status_message
from sim.simulator.settings import Settings
from sim.simulator.task_space.task_space import TaskSpace
from solvers.status import Status
from solvers.types import Floats, Integers

if TYPE_CHECKING:
    from sim.derivatives.parameters.parameters import Parameters
    from sim.simulator.simulator_parameters import SimulatorParameters


def strategy_solves(space: StateSpace) -> Integers:
    """Solutions by start strategy (solve/globalization.py) of all steps of a simulator so far, of this thread.

    Args:
        space: the simulator.

    Returns:
        (64,) numbers, those of the parts of divided steps included.
    """
    return space._engine.strategy_solves()


def rehearse(space: StateSpace, x: ArrayLike, *, derivatives: bool = False) -> None:
    """Make the calls of motions through a state, so that later ones load no code: those of divided steps as well.

    Args:
        space: the simulator.
        x: (nx,) state.
        derivatives: whether to make those with derivatives as well (default False).
    """
    space._engine.rehearse(space._arguments.states("rehearse", x), derivatives=derivatives)


class StateSpace:
    """Sizes, settings and parameters, states on their manifold, and other views of them."""

    def __init__(self, mechanism: Mechanism, settings: Settings) -> None:
        self.mechanism = mechanism
        self.time_step, self.kappa, self.tolerance, self.max_iterations, self.order, self.divide = settings[:6]
        self.accuracy, self.cutoff = settings.accuracy or None, settings.cutoff
        self.model = pack(mechanism)
        sizes = sizes_of(self.model)
        self.nbody, self.nq, self.nv, self.ncontact, self.nu = sizes[:4] + (sizes.nu,)
        self.nx, self.ndx = self.nq + self.nv, 2 * self.nv
        self._engine = engine_of(self.model, mechanism, settings)
        self._states = self._engine.states
        self._no_input = np.zeros(self.nu)
        self._arguments = Arguments(mechanism, self._engine)

    def __setattr__(self, name: str, value: Any) -> None:
        if hasattr(self, "_arguments"):
            raise AttributeError(f"Simulator.{name}: a Simulator does not change; use replace({name}=...)")
        super().__setattr__(name, value)

    def _repr_html_(self) -> str:
        return drawn(self.mechanism) + f"<p>{escape(repr(self))}</p>"

    @property
    def mean_over(self) -> float:
        """Interval before a state over which its velocity is the mean [s]: the time step; 0 with an order of 4 to 8 or
        an accuracy, where it is the velocity at the node.
        """
        return self._states.mean_over

    @property
    def second_order_reason(self) -> str:
        """The reason why all steps of a simulator of higher order are of order 2, such as a stiff spring; empty if they
        are not.
        """
        return self._engine.second_order_reason

    second_order = renamed("second_order_reason")

    def describe(self) -> str:
        """A page of text about the simulator.

        Returns:
            The parts of the scene, the work of a step, and its omitted terms.
        """
        rank = str(self.loop_rank()) if self._closes else ""
        return describe(self.mechanism, self.model, self._engine.settings, rank, self._engine.second_order_reason)

    def parameters(self, wrt: Sequence[str] | None = None) -> Parameters:
        """Names and values of parameters; `dojo.Parameters` describes the names.

        Args:
            wrt: names, in the order of the values; all parameters by default.

        Returns:
            Parameters.

        Raises:
            ValueError: for an unknown name.
        """
        call = "Simulator.parameters(wrt)"
        return self._by_parameters.values(call, self._by_parameters.names if wrt is None else wrt)

    def _sentence(self, where: str, report: Floats, x: Floats | None = None) -> str:
        """Why the last step of this thread was not solved; x (nx,): the state it began from."""
        mech = self.mechanism
        names = [f"Loop joint {j.name!r}" for j in mech.loops] + [f"Gear {g.name!r}" for g in mech.gears]
        gaps = zip(self._engine.open_loops(), names, strict=True) if names else ()
        text = status_message(mech, where, report, self.tolerance, max(gaps, default=None))
        if report[StepReport.STATUS] == Status.TURN_TOO_LARGE and x is not None:  # short steps turn little
            short = StateSpace(mech, self._engine.settings._replace(time_step=1e-6, order=2, accuracy=0.0))
            text += fastest_body(mech, short._states.maximal(x[None]).reshape(self.nbody, 13))
        return text

    @cached_property
    def _by_parameters(self) -> SimulatorParameters:
        """Calls by parameters, and sweeps; their modules are imported on first use."""
        from sim.simulator.simulator_parameters import SimulatorParameters

        return SimulatorParameters(self._engine, self.mechanism, self.time_step)

    def neutral(self) -> Floats:
        """The standing or hanging state of the mechanism, at rest, its loops closed as by `close`.

        Returns:
            State (nx,).

        Raises:
            ValueError: a loop cannot be closed.
        """
        x = np.concatenate([np.asarray(self.mechanism.neutral, dtype=np.float64), np.zeros(self.nv)])
        return self.close(x) if self._closes else x

    def close(self, x: ArrayLike) -> Floats:
        """The state near x that closes the loops of the mechanism, at both ends of its interval.

        If Newton's method fails, for example for a linkage in one line, it starts again from a fixed set of states
        around x, and the nearest solution is returned (sim/dynamics/loops/closest_root.py).

        Args:
            x: state (nx,).

        Returns:
            The state (nx,); x itself for trees.

        Raises:
            ValueError: no such state is found; the message names the loop joint or gear that stays open, and its gap.
        """
        state, closure = self._placed("close", x), self.closure()
        return state if closure is None else closure.close(state)

    def _placed(self, method: str, x: ArrayLike) -> Floats:
        """A state whose bodies have poses and velocities that are finite."""
        state = self._arguments.state(method, x)
        if self._closes:
            self._arguments.finite_result(f"{method}(x)", self._states.maximal(state[None]), state[None])
        return state

    @property
    def _closes(self) -> bool:
        """Whether there are loops, or gears."""
        return bool(self.mechanism.loops or self.mechanism.gears)

    def loop_gaps(self, x: ArrayLike) -> dict[str, Floats]:
        """Gaps by loop joint and "gear NAME": distances [m], then angles [rad].

        Args:
            x: state (nx,).

        Returns:
            {name: (n,)}, one number per constraint.
        """
        return Closure(self.mechanism, self._states).gaps(self._placed("loop_gaps", x))

    def closure(self) -> Closure | None:
        """The constraints of loops and gears.

        Returns:
            The Closure; None for trees.
        """
        return Closure(self.mechanism, self._states) if self._closes else None

    def loop_rank(self, x: ArrayLike | None = None) -> LoopRank:
        """The redundant loop constraints at a state.

        Args:
            x: state (nx,); the neutral state by default.

        Returns:
            LoopRank; `print` shows it as text.

        Raises:
            ValueError: the mechanism has neither loops nor gears.
        """
        closure = self.closure()
        if closure is None:
            raise ValueError(
                f"Simulator.loop_rank: {self.mechanism.name!r} has no joint that closes a loop, and no gear"
            )
        return closure.rank(self.neutral() if x is None else self._placed("loop_rank", x))

    def state_from_velocity(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """State with coordinates q (nq,) whose velocity at the node is v (nv,).

        The velocity of a state is the mean over the interval before it. This state has the momentum M(q) v at the end
        of that interval, so a simulation from it is of second order from its first step. The motion is assumed to be
        free of contacts. On the ground, v = 0 gives a state with the velocity g h/2, which gravity alone would cancel,
        and the robot makes a small hop. A robot at rest on its contacts did not move before the node either: its state
        is [q; 0], as returned by `neutral` and `equilibrium`.

        Loops are closed, as by `close`, and the velocity is the part of v that they allow.

        Args:
            q: coordinates (nq,).
            v: velocities (nv,).

        Returns:
            State (nx,).

        Raises:
            ValueError: the shapes are wrong, a quaternion is not of unit length, or a loop cannot be closed.
            SimulationError: no state has this velocity.
        """
        q0 = checks.array("Simulator.state_from_velocity(q)", q, (self.nq,))
        v0 = checks.array("Simulator.state_from_velocity(v)", v, (self.nv,))
        q0 = self._arguments.states("Simulator.state_from_velocity(q)", np.concatenate([q0, v0]))[: self.nq]
        x0 = np.concatenate([q0, v0])
        if self._closes:
            return Closure(self.mechanism, self._states).start(self._placed("state_from_velocity", x0)[: self.nq], v0)
        return self._arguments.finite_result("state_from_velocity", self._states.started(q0, v0), x0[None])

    start = renamed("state_from_velocity")

    def velocity(self, x: ArrayLike) -> Floats:
        """Joint velocities at the node, the v of state_from_velocity(q, v).

        They are M(q)^-1 p with the momentum p of the node by the discrete Legendre transform; with closed loops, the
        part of it along them, as their forces act before and after the node.

        Args:
            x: state (..., nx).

        Returns:
            Velocities (..., nv).
        """
        xs, lead = self._arguments.stacked("velocity", "x", x)
        v = self._arguments.finite_result("velocity(x)", self._states.node_velocities(xs), xs)
        return v.reshape(*lead, self.nv)

    def body_states(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """Positions and velocities of the bodies for coordinates q and velocities v at one moment.

        `maximal` has mean velocities over the last interval instead.

        Args:
            q: coordinates (..., nq).
            v: velocities (..., nv); leading axes are broadcast.

        Returns:
            (..., nbody, 13) per body [position, velocity (world), quaternion, omega (body)].
        """
        qs, vs, lead = self._arguments.paired("body_states", ("q", q, self.nq), ("v", v, self.nv))
        xs = self._arguments.states("Simulator.body_states(q)", np.concatenate([qs, vs], axis=1))
        return self._arguments.finite_result("body_states", self._states.bodies(xs), xs).reshape(*lead, self.nbody, 13)

    bodies = renamed("body_states")

    def task_space(self) -> TaskSpace:
        """Frames, momenta, contacts and distances along trajectories, with their derivatives, for planners.

        Returns:
            TaskSpace, whose arrays are not checked.
        """
        return TaskSpace(self._engine.undivided())

    def integrate(self, x: ArrayLike, dx: ArrayLike) -> Floats:
        """x (+) dx: the state moved by a perturbation.

        Args:
            x: state (..., nx).
            dx: perturbation (..., ndx); leading axes are broadcast.

        Returns:
            State (..., nx).
        """
        xs, dxs, lead = self._arguments.paired("integrate", ("x", x, self.nx), ("dx", dx, self.ndx))
        xs = self._arguments.states("Simulator.integrate(x)", xs)
        moved = self._arguments.finite_result("integrate", self._states.integrate(xs, dxs), xs, dxs)
        return moved.reshape(*lead, self.nx)

    def difference(self, x1: ArrayLike, x0: ArrayLike) -> Floats:
        """x1 (-) x0: the dx with integrate(x0, dx) = x1.

        Args:
            x1: state (..., nx).
            x0: state (..., nx); leading axes are broadcast.

        Returns:
            Perturbation (..., ndx).
        """
        x1s, x0s, lead = self._arguments.paired("difference", ("x1", x1, self.nx), ("x0", x0, self.nx))
        x1s, x0s = (self._arguments.states(f"Simulator.difference({n})", x) for n, x in (("x1", x1s), ("x0", x0s)))
        dx = self._arguments.finite_result("difference", self._states.difference(x0s, x1s), x1s, x0s)
        return dx.reshape(*lead, self.ndx)

    def maximal(self, x: ArrayLike) -> Floats:
        """The maximal state z of a minimal state x.

        Args:
            x: state (..., nx).

        Returns:
            (..., nbody, 13) per body [position, velocity (world), quaternion, omega (body)].
        """
        xs, lead = self._arguments.stacked("maximal", "x", x)
        zs = self._arguments.finite_result("maximal(x)", self._states.maximal(xs), xs)
        return zs.reshape(*lead, self.nbody, 13)

    def minimal(self, z: ArrayLike, joint_tolerance: float = 1e-6) -> Floats:
        """The state x with maximal(x) = z.

        Args:
            z: maximal state (..., nbody, 13).
            joint_tolerance: largest violation of a joint at either end of the interval [m, rad]; with infinity, the
                nearest motion along the joints is returned.

        Returns:
            State (..., nx).

        Raises:
            ValueError: z violates a joint by more than `joint_tolerance`.
        """
        zs = np.array(shaped("Simulator.minimal(z)", z, (self.nbody, 13)))
        lead = zs.shape[:-2]
        zs = zs.reshape(-1, self.nbody, 13)
        self._arguments.check_maximal("minimal", zs)
        xs = self._arguments.finite_result("minimal(z)", self._states.minimal(zs), zs)
        tolerance = checks.number("Simulator.minimal(joint_tolerance)", joint_tolerance, 0.0, finite=False)
        if tolerance < np.inf:
            self._arguments.check_joints(zs, self._states.maximal(xs), joint_tolerance)
        return xs.reshape(*lead, self.nx)

    def maximal_jacobian(self, x: ArrayLike) -> Floats:
        """dz/dx in tangent coordinates.

        Those of z are, per body: position, velocity (world), rotation (right perturbation of the quaternion), angular
        velocity (body).

        Args:
            x: state (nx,).

        Returns:
            (12 nbody, ndx).
        """
        state = self._arguments.state("maximal_jacobian", x)
        slopes = self._states.maximal_jacobian(state)[None]
        return self._arguments.finite_result("maximal_jacobian(x)", slopes, state[None])[0]

    def minimal_jacobian(self, z: ArrayLike) -> Floats:
        """dx/dz, the inverse of `maximal_jacobian` along the joints.

        Args:
            z: maximal state (nbody, 13).

        Returns:
            (ndx, 12 nbody).
        """
        zs = checks.array("Simulator.minimal_jacobian(z)", z, (self.nbody, 13))
        self._arguments.check_maximal("minimal_jacobian", zs[None])
        slopes = self._states.minimal_jacobian(zs)[None]
        return self._arguments.finite_result("minimal_jacobian(z)", slopes, zs[None])[0]

    def energy(self, x: ArrayLike) -> Any:
        """Kinetic and potential energy at the node.

        Args:
            x: state (..., nx).

        Returns:
            Energy [J], a float or (...,).
        """
        xs, lead = self._arguments.stacked("energy", "x", x)
        total = self._energies("energy", xs, [0, 1]).reshape(lead)
        return total if lead else float(total)

    def kinetic_energy(self, x: ArrayLike) -> Any:
        """Kinetic energy at the node.

        Args:
            x: state (..., nx).

        Returns:
            Energy [J], a float or (...,).
        """
        xs, lead = self._arguments.stacked("kinetic_energy", "x", x)
        kinetic = self._energies("kinetic_energy", xs, [0]).reshape(lead)
        return kinetic if lead else float(kinetic)

    def _energies(self, method: str, xs: Floats, parts: list[int]) -> Floats:
        """Sum of these of the (kinetic, potential) energy of every row."""
        with np.errstate(all="ignore"):
            total = self._states.energies(xs)[:, parts].sum(axis=1)
        return self._arguments.finite_result(f"{method}(x)", total, xs)

    def momentum(self, x: ArrayLike) -> tuple[Floats, Floats]:
        """Momentum of all bodies at the node.

        Of order 2 it is that of the discrete Legendre transform, conserved to the last digits in flight. Joints on the
        world act between nodes and are not part of it, as contacts are not: a pendulum at rest has -h/2 m g.
        `Kinematics.centroidal_momentum(q, sim.velocity(x))` is that of the velocities at the node.

        Args:
            x: state (..., nx).

        Returns:
            (linear (..., 3) [N s], angular about the origin of the world (..., 3) [N m s]).
        """
        xs, lead = self._arguments.stacked("momentum", "x", x)
        with np.errstate(all="ignore"):
            momenta = self._states.momenta(xs)
        p = self._arguments.finite_result("momentum(x)", momenta, xs).reshape(*lead, 6)
        return p[..., :3].copy(), p[..., 3:].copy()

    def nodes_at(self, motion: tuple[Floats, Floats, Floats | None], times: Floats) -> Floats:
        """States at any times of a motion of a simulator with an accuracy; `Trajectory.at` checks its arguments.

        Args:
            motion: states (T + 1, nx), inputs (T, nu), external wrenches (T, nbody, 6) or None.
            times: (n,) since its beginning [s].

        Returns:
            States (n, nx).

        Raises:
            ValueError: the simulator has no accuracy.
        """
        return self._engine.nodes_at(motion, times)
