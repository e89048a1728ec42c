"""Engine of a higher order: states with the velocity of the node, steps of explicit Runge-Kutta methods."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sim.integrators.runge_kutta import gradient_by_stages, step_by_stages
from sim.integrators.tableau import stable, tableau
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.servos import limited_servos
from sim.model.model import InputKind, Model
from sim.simulator.engines.engine import Engine
from sim.simulator.engines.node_states import NodeStates
from sim.simulator.link_kernels import link_curvature, link_planner
from sim.simulator.settings import Settings
from solvers.compiler import Table, link
from solvers.types import Integers


def free_roots(model: Model) -> Integers:
    """(nbody,) 1 for roots that float without springs, dampers, armature and inputs on their coordinates."""
    free = (model.body_parent < 0) & (model.joint_ntrans == 3) & (model.joint_nrot == 3)
    for field in (model.dof_spring, model.dof_damper, model.dof_armature):
        free[model.dof_body[field != 0.0]] = False
    free[model.dof_body[model.input_index[model.input_kind == InputKind.JOINT]]] = False
    return free.astype(np.int64)


def link_stages(model: Model) -> None:
    """Link the kernels of steps of higher order."""
    link(model.optional, step_by_stages)
    link_curvature(model)


def link_tangents(model: Model) -> None:
    """Link the derivatives of these steps."""
    link(model.optional, gradient_by_stages)


class HighOrderEngine(Engine):
    """The kernels of one packed mechanism without contacts and limits, with steps of the order of its settings."""

    def __init__(self, model: Model, settings: Settings) -> None:
        a, b = tableau(settings.order)
        slots = np.zeros_like(model.optional)  # its own, for the steps of order 2 beside it have others
        own = model._replace(stage_a=a, stage_b=b, root_free=free_roots(model), optional=slots)
        super().__init__(own, settings)
        self.states: NodeStates = NodeStates(self)

    def step_table(self, *needs: Callable[[Model], None]) -> Table:
        """As Engine.step_table."""
        return self.linked(link_stages, *needs)

    def prepare(self) -> None:
        """As Engine.prepare."""
        self.linked(link_stages, link_tangents, link_planner)

    def gradient_table(self, *needs: Callable[[Model], None]) -> Table:
        """As Engine.gradient_table; refuses joints with two rotations."""
        swings = np.flatnonzero(self.model.joint_nrot == 2)
        if len(swings):
            raise ValueError(
                f"Simulator of {self.settings.kind}: derivatives through joint {swings[0]}, with two rotations "
                f"(orbital), are those of order 2; use {self.settings.way_to_order_two}"
            )
        return self.linked(link_stages, link_tangents, *needs)

    def too_stiff(self, mechanism: Mechanism) -> str:
        """Which spring or damper is too fast for an explicit method; "" if none is.

        Rates are the eigenvalues of M^-1 D, and the roots of those of M^-1 K, at the neutral configuration.
        """
        stiff = np.maximum(self.model.dof_spring, 0.0), self.model.dof_damper
        if not np.any(stiff):
            return ""
        q = np.asarray(mechanism.neutral, dtype=np.float64)
        M = self.states.mass_matrix(np.concatenate([q, np.zeros(self.sizes.nv)]))
        for feature, values, power in (("spring", stiff[0], 0.5), ("damper", stiff[1], 1.0)):
            rates, modes = np.linalg.eig(np.linalg.solve(M, np.diag(values)))
            worst = int(np.argmax(rates.real))
            rate = max(rates[worst].real, 0.0) ** power
            if rate * self.settings.time_step > stable(self.settings.order):
                joint = mechanism.joint_names[self.model.dof_body[int(np.argmax(np.abs(modes[:, worst])))]]
                return (
                    f"joint {joint!r}: its {feature} acts at {rate:.3g} 1/s, too fast for an explicit step of "
                    f"{self.settings.time_step:g} s; use a time step below {stable(self.settings.order) / rate:.2g} s"
                )
        return ""


def check(mechanism: Mechanism, settings: Settings) -> None:
    """Refuse mechanisms that only steps of order 2 can move."""
    loops, gears = [j.name for j in mechanism.loops], [g.name for g in mechanism.gears]
    parts = [("loop joint", loops), ("gear", gears)]
    parts.append(("dry friction of", [j.name for j in mechanism.joints if np.any(j.friction)]))
    parts.append(("limited servo", [part.name for _, part in limited_servos(mechanism.inputs or ())]))
    for feature, names in parts:
        if names:
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            raise ValueError(
                f"Simulator(order={settings.order}): {mechanism.name!r} has the {feature} {names[0]!r}{more}; steps of "
                "higher order are for trees without dry friction and limits of servos: use order=2, or omit them"
            )
