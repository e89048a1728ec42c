"""Derivatives of the steps of a simulator by state, input and parameters, forward and backward: part of Simulator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.simulator import wrenches as pushed
from sim.simulator.border import whole
from sim.simulator.results import Linearization, Trajectory, check_finite, error_of, path_of
from sim.simulator.states import States
from sim.simulator.wrenches import Wrenches
from solvers.status import Status

if TYPE_CHECKING:
    from sim.derivatives.parameters.parameters import Parameters
    from sim.simulator.parameter_calls import ParameterCalls

Floats = NDArray[np.float64]
Blocks = dict[str, Floats]


class Derivatives(States):
    """Derivatives by the implicit function theorem, in tangent coordinates."""

    @overload
    def linearize(
        self,
        x: ArrayLike,
        u: ArrayLike | None = None,
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
        wrt: None = None,
    ) -> tuple[Floats, Floats]: ...

    @overload
    def linearize(
        self,
        x: ArrayLike,
        u: ArrayLike | None = None,
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
        *,
        wrt: Sequence[str],
    ) -> Blocks: ...

    def linearize(
        self,
        x: ArrayLike,
        u: ArrayLike | None = None,
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
        wrt: Sequence[str] | None = None,
    ) -> Any:
        """(A, B) = d(next state)/d(x, u), (ndx, ndx) and (ndx, nu), of the step solved at `kappa`.

        wrt: "state", "input" and parameters, as in `parameters`; then a table by these names, of blocks (ndx, n). x and
        u are held fixed, so the poses and momenta that belong to x move with a parameter.
        wrenches: (nbody, 6) as in `rollout`, constants. An unsolved step raises SimulationError.
        """
        if wrenches is not None:
            if wrt is not None:
                return pushed.linearize_by(cast(Any, self), x, u, wrenches, kappa, wrt)
            return pushed.linearize(cast(Any, self), x, u, wrenches, kappa)
        state = self._border.state("linearize", x)
        us = self._border.inputs("linearize", "u", np.zeros(self.nu) if u is None else u, (self.nu,))
        level = self._border.kappa("linearize", kappa)
        A, B, _, report = self._calls.linearize_one(state, us, level)
        if report[0] != Status.SOLVED:
            raise error_of(self.mechanism, "Simulator.linearize", report, self.tolerance)
        if wrt is None:
            return A, B
        asked, found, plan = self._by_parameters.select("Simulator.linearize(wrt=...)", wrt)
        J = self._by_parameters.columns((state, us), A, plan)
        check_finite("Simulator.linearize(wrt=...)", J)
        blocks = {"state": A, "input": B}
        return {name: blocks[name] if name in blocks else J[:, found.rows[name]] for name in asked}

    def linearize_rollout(
        self,
        x: ArrayLike,
        us: ArrayLike,
        kappa: float | None = None,
        wrt: Sequence[str] = (),
        wrenches: Wrenches | None = None,
    ) -> tuple[Floats, Linearization]:
        """States (T + 1, nx) of a rollout from x under us (T, nu), and its derivatives, in one pass.

        As `rollout` and `linearize_trajectory`, but every step is solved once. wrt: parameters, whose derivatives
        (T, ndx, n) are then in `Linearization.parameters`, by name; wrenches: (T, nbody, 6) as in `rollout`. An
        unsolved step raises SimulationError.
        """
        if wrenches is not None:
            return pushed.linearize_rollout(cast(Any, self), x, us, wrenches, kappa, wrt)
        call = "linearize_rollout"
        state, inputs = self._border.state(call, x), self._border.inputs(call, "us", us, ("T", self.nu))
        level = self._border.kappa(call, kappa)
        blocks: Blocks = {}
        if wrt and (selected := self._by_parameters.select(f"Simulator.{call}(wrt=...)", wrt))[1].names:
            _, found, plan = selected
            knot, xs, A, B, J, reports = self._by_parameters.roll(state, inputs, plan, level)
            blocks = {name: J[:, :, rows] for name, rows in found.rows.items()}
        else:
            knot, xs, A, B, reports = self._calls.roll_linear(state, inputs, level)
        if knot < len(inputs):
            raise error_of(self.mechanism, f"Simulator.{call}: step {knot}", reports[knot], self.tolerance)
        check_finite(f"Simulator.{call}(wrt=...)", *blocks.values())
        return xs, Linearization(A, B, xs[1:], reports[:, 0].astype(np.int64), blocks, reports[:, 5])

    def linearize_trajectory(
        self,
        xs: ArrayLike,
        us: ArrayLike,
        substeps: int = 1,
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
    ) -> Linearization:
        """`linearize` at the knots (xs_t, us_t), in parallel; each knot spans `substeps` steps with u held.

        xs: (T, nx) or (T + 1, nx), of which the last is not used; us: (T, nu); wrenches: (T, nbody, 6) as in `rollout`.
        """
        if wrenches is not None:
            return pushed.linearize_trajectory(cast(Any, self), xs, us, wrenches, substeps, kappa)
        call = "Simulator.linearize_trajectory"
        inputs = self._border.inputs("linearize_trajectory", "us", us, ("T", self.nu))
        states = self._border.states(f"{call}(xs)", checks.array(f"{call}(xs)", xs, ("T", self.nx)))
        if len(states) - len(inputs) not in (0, 1):
            raise ValueError(
                f"{call}(xs): expected {len(inputs)} or {len(inputs) + 1} states, as us, got {len(states)}"
            )
        steps = whole(f"{call}(substeps=...)", substeps)
        level = self._border.kappa("linearize_trajectory", kappa)
        A, B, x_next, reports = self._calls.linearize(states, inputs, steps, level)
        return Linearization(A, B, x_next, reports[:, 0].astype(np.int64), accuracy=reports[:, 5])

    def linearize_maximal(
        self, z: ArrayLike, u: ArrayLike | None = None, kappa: float | None = None
    ) -> tuple[Floats, Floats]:
        """(A, B) = d(next maximal state)/d(z, u), (12 nbody, 12 nbody) and (12 nbody, nu).

        Tangent coordinates per body: position, velocity (world), rotation (right perturbation of the quaternion),
        angular velocity (body). The step sees z through minimal(z): what leaves the joints has no effect, so A is the
        derivative of maximal(step(minimal(z))).
        """
        bodies = checks.array("Simulator.linearize_maximal(z)", z, (self.nbody, 13))
        x = self.minimal(bodies)
        us = self._border.inputs("linearize_maximal", "u", np.zeros(self.nu) if u is None else u, (self.nu,))
        A, B, x_next, report = self._calls.linearize_one(x, us, self._border.kappa("linearize_maximal", kappa))
        if report[0] != Status.SOLVED:
            raise error_of(self.mechanism, "Simulator.linearize_maximal", report, self.tolerance)
        out = self.maximal_jacobian(x_next)
        return out @ A @ self.minimal_jacobian(bodies), out @ B

    def vjp(
        self,
        trajectory: Trajectory | tuple[ArrayLike, ArrayLike],
        dL_dx: ArrayLike,
        wrt: Sequence[str] = ("state", "input"),
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
    ) -> Blocks:
        """Gradient of a scalar L(x_0, ..., x_T) of a rollout, by one sweep from its end.

        trajectory: of `rollout`, or (states (T + 1, nx), inputs (T, nu)); dL_dx: (T + 1, ndx) in tangent coordinates.
        Returns a table by the names of `wrt`: "state" (ndx,), of the first state; "input" (T, nu); parameters (n,),
        as in `parameters`. The steps are solved anew at `kappa`; nothing but one step is kept, so the memory is that of
        the trajectory. wrenches: (T, nbody, 6) as in `rollout`, left out those of the trajectory. An unsolved step
        raises SimulationError.
        """
        call = "Simulator.vjp"
        xs, us = path_of(f"{call}(trajectory)", trajectory)
        if wrenches is None and isinstance(trajectory, Trajectory):
            wrenches = trajectory.wrenches
        if wrenches is not None:
            return pushed.vjp(cast(Any, self), (xs, us), dL_dx, wrenches, kappa, wrt)
        inputs = self._border.inputs("vjp", "trajectory", us, ("T", self.nu))
        rows = checks.array(f"{call}(trajectory)", xs, (len(inputs) + 1, self.nx))
        loss = checks.array(f"{call}(dL_dx)", dL_dx, (len(inputs) + 1, self.ndx))
        asked, found, plan = self._by_parameters.select(f"{call}(wrt=...)", wrt)
        path = (self._border.states(f"{call}(trajectory)", rows), inputs)
        knot, line = self._by_parameters.sweep(path, loss, plan, self._border.kappa("vjp", kappa))
        if knot >= 0:
            raise error_of(self.mechanism, f"{call}: step {knot}", line.report[0], self.tolerance)
        check_finite(call, line.costate[0], line.inputs, line.parameters)
        blocks = {"state": line.costate[0], "input": line.inputs}
        return {name: blocks[name] if name in blocks else line.parameters[found.rows[name]] for name in asked}

    def parameters(self, wrt: Sequence[str] | None = None) -> Parameters:
        """Names and values of parameters: of all, or of the given names, in their order.

            kind:part[component]    mass:trunk   com:trunk[0]   spring:knee   friction:foot   gravity[2]   time_step

        A name without a component stands for all of them, one without a part for all parts; `kind:*` is a single one
        that adds the same to all parts, at the mean of their values. Kinds (units: parameter.py):

            mass, inertia, com          of bodies; a mass changes alone; com is a displacement from where it is, and
                                        joints, contacts and shapes stay where they are on the body
            parent_point, child_point   of joints, also of those that close loops
            orientation, axis           rotation vector of the joint frame, from where it is; direction
            spring, damper, rest, armature, lower, upper, cone       of joints; gear_ratio, gear_offset
            input_force, input_torque   of a unit of an input on a body; gravity, time_step
            friction, restitution       of contacts and collisions
            contact_point, contact_radius, contact_height, contact_normal; terrain, heights of its grid
            shape_a, shape_b            centres of the shapes of collisions in their bodies
            size_a, size_b              their [radius], [length], [x], [y], [z]; of a polytope its [scale], 1 as it is;
                                        a body's inertia is that of its own shape, and stays
        """
        call = "Simulator.parameters(wrt)"
        return self._by_parameters.values(call, self._by_parameters.names if wrt is None else wrt)

    def with_parameters(self, values: Mapping[str, ArrayLike]) -> Any:
        """The same, also its kappa, with other values of parameters; a ValueError names what nothing can have."""
        mech, time_step = self._by_parameters.with_values("Simulator.with_parameters(...)", values)
        return self.replace(mechanism=mech, time_step=time_step, kappa=self.kappa)

    def replace(self, **settings: Any) -> Any:
        """See Simulator."""
        raise NotImplementedError

    @cached_property
    def _by_parameters(self) -> ParameterCalls:
        """Calls by parameters, and sweeps; their modules are imported by those who ask for them."""
        from sim.simulator.parameter_calls import ParameterCalls

        return ParameterCalls(self._calls, self.mechanism, self.time_step)
