"""d(next state)/d(state) of one step in Drake, by its automatic differentiation (AutoDiffXd)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from benchmarks.engines.drake import write
from benchmarks.engines.drake_scene import load, scalar_joints
from dojo_opt.report.gradients.differences import Reference, extrapolated
from sim.model.model import InputKind, Model
from solvers.types import Matrix, Vector

APPROXIMATIONS = ("Lagged", "Sap", "Tamsi")  # its default, its convex one, and its oldest


@contextmanager
def _raising() -> Iterator[None]:
    """Failed assertions of Drake as RuntimeErrors; they would end the process."""
    try:
        yield
    except SystemExit as error:
        raise RuntimeError(str(error)) from error


class DrakeStep:
    """The discrete update at the state to which `steps` steps from `start` lead, in Drake's own coordinates [q; v].

    ValueError: a mechanism, or inputs, that cannot be represented.
    """

    x: Vector  # Drake's state, once settled

    def __init__(self, model: Model, time_step: float, approximation: str) -> None:
        self._model, self._scene = model, load(model, time_step, approximation)
        self._plant, self._diagram = self._scene.plant, self._scene.diagram
        self._root = self._diagram.CreateDefaultContext()
        self._context = self._plant.GetMyMutableContextFromRoot(self._root)

    def settle(self, start: Vector, u: Vector, steps: int) -> None:
        """Take the steps, and stay where they end."""
        self._force = self._generalized(u)
        self._plant.get_applied_generalized_force_input_port().FixValue(self._context, self._force)
        self.x = self.state(start)
        for _ in range(steps):
            self.x = self._step(self.x)

    def state(self, x: Vector) -> Vector:
        """Drake's discrete state [q; v] of our state x (nx,)."""
        write(self._model, self._scene, self._context, x)
        return np.array(self._context.get_discrete_state_vector().value())

    def reference(self) -> Reference:
        """By extrapolated differences."""
        return extrapolated(self._central)

    def autodiff(self) -> Callable[[], Matrix]:
        """A call that gives the Jacobian."""
        from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff

        update = self.differentiable(np.array([AutoDiffXd(value) for value in self._force]))
        x = InitializeAutoDiff(self.x).ravel()
        return lambda: np.asarray(ExtractGradient(update(x)))

    def differentiable(self, force: Any) -> Callable[[Any], Any]:
        """The update of a state, held under a generalized force; numbers are AutoDiffXd."""
        diagram = self._diagram.ToAutoDiffXd()
        root = diagram.CreateDefaultContext()
        plant = diagram.GetSubsystemByName(self._plant.get_name())
        context = plant.GetMyMutableContextFromRoot(root)
        plant.get_applied_generalized_force_input_port().FixValue(context, force)

        def update(x: Any) -> Any:
            context.SetDiscreteState(x)
            with _raising():
                return diagram.EvalUniquePeriodicDiscreteUpdate(root).value()

        return update

    def place(self, body: int) -> tuple[slice, slice]:
        """Where the position of a floating body and its velocity stand in the state."""
        drakes = self._scene.bodies[body]
        q = drakes.floating_positions_start() + 4
        v = self._plant.num_positions() + drakes.floating_velocities_start_in_v() + 3
        return slice(q, q + 3), slice(v, v + 3)

    def _step(self, x: Vector) -> Vector:
        self._context.SetDiscreteState(x)
        with _raising():
            return np.array(self._diagram.EvalUniquePeriodicDiscreteUpdate(self._root).value())

    def _central(self, eps: float) -> Matrix:
        try:
            columns = [(self._step(self.x + dx) - self._step(self.x - dx)) for dx in eps * np.eye(len(self.x))]
        except RuntimeError:  # its solver did not converge
            return np.full((len(self.x), len(self.x)), np.nan)
        return np.array(columns).T / (2.0 * eps)

    def _generalized(self, u: Vector) -> Vector:
        """Inputs as forces on joints with one degree of freedom."""
        joints = scalar_joints(self._model, self._scene)
        force = np.zeros(self._plant.num_velocities())
        for k in np.flatnonzero(u):
            dof = int(self._model.input_index[k])
            if self._model.input_kind[k] != InputKind.JOINT or dof not in joints:
                raise ValueError(f"DrakeStep: no input that does not act on a joint with one degree of freedom ({k})")
            force[joints[dof].velocity_start()] += u[k]
        return force
