"""Engine of a higher order: states with the velocity of the node, steps of explicit Runge-Kutta methods."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from sim.dynamics import bodies, coordinates
from sim.integrators import runge_kutta
from sim.integrators.feedback import FeedbackLaw, Path
from sim.integrators.hamilton_gradient import Slopes
from sim.integrators.rollout import Linearized, MotionBuffers
from sim.integrators.tableau import stable, tableau
from sim.integrators.tangents import Tangents
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.servos import limited_servos
from sim.model.model import InputKind, Model
from sim.model.pace import pieces
from sim.simulator.engine import CONTACT, REPORT, Division, Engine, Floats, Rolled, follow, interrupted
from sim.simulator.link import link_smooth
from sim.simulator.results import Interrupted
from sim.simulator.settings import Settings
from solvers.status import Status
from solvers.types import Cube, Integers, Vector


def free_roots(model: Model) -> Integers:
    """(nbody,) 1 for roots that float without springs, dampers, armature and inputs on their coordinates."""
    free = (model.body_parent < 0) & (model.joint_ntrans == 3) & (model.joint_nrot == 3)
    for field in (model.dof_spring, model.dof_damper, model.dof_armature):
        free[model.dof_body[field != 0.0]] = False
    free[model.dof_body[model.input_index[model.input_kind == InputKind.JOINT]]] = False
    return free.astype(np.int64)


class HighOrderEngine(Engine):
    """The kernels of one packed mechanism without contacts and limits, with steps of the order of its settings."""

    def _scheme(self) -> runge_kutta.Scheme:
        """The method with scratch of its own."""
        a, b = tableau(self.settings.order)
        s, nv = len(b), self.sizes.nv
        scratch = (*(np.zeros(nv) for _ in range(3)), *(np.zeros((s, nv)) for _ in range(2)))
        return runge_kutta.Scheme(a, b, free_roots(self.model), *scratch)

    def prepare(self) -> None:
        """Link what rollouts and their derivatives need."""
        self.linked(link_smooth)

    def _tables(self) -> tuple[Integers, Integers, Vector]:
        """Tables of the Model and of this thread's first Data, and settings."""
        return self.linked(link_smooth), self._scratch.table(), self.settings.array()

    def roll(
        self,
        x: Vector,
        us: Floats,
        wrenches: Cube | None = None,
        *,
        kappa: float | None = None,
        derivatives: bool = False,
    ) -> Rolled:
        """As Engine.roll; without contacts and without a kappa; derivatives take a second pass."""
        steps = len(us)
        xs, reports = np.zeros((steps + 1, self.nx)), np.zeros((steps, REPORT))
        xs[0], whole = x, Division.none(steps)
        external = self.external(wrenches)
        A, B = self.unknown[:2]
        contacts = np.zeros((steps, 0, CONTACT))
        motion = MotionBuffers(xs, us, external, reports, contacts, A, B)
        model, data, settings, scheme = *self._tables(), self._scheme()
        knot = 0
        try:
            for _ in pieces(settings, steps):
                knot = int(runge_kutta.roll(model, data, settings, scheme, motion, knot))
                if knot == steps or reports[knot, 0] != Status.SOLVED:
                    break
        except KeyboardInterrupt:
            raise Interrupted(Rolled(knot, xs, interrupted(reports, knot), contacts, A, B, whole)) from None
        if derivatives:
            A, B, *_ = self.linearize(xs[:-1], us, 1, kappa, None, wrenches)
        return Rolled(knot, xs, reports, contacts, A, B, whole)

    def roll_batch(self, x0s: Floats, us: Floats) -> tuple[Floats, Integers, Integers]:
        """As Engine.roll_batch, on one core."""
        n, steps = us.shape[:2]
        xs = np.zeros((n, steps + 1, self.nx))
        status, knots = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        xs[:, 0] = x0s
        for i in range(n):
            try:
                rolled = self.roll(x0s[i], us[i])
                knots[i], xs[i] = rolled.knot, rolled.xs
            except KeyboardInterrupt as stop:
                status[i:] = Status.INTERRUPTED
                if isinstance(stop, Interrupted):
                    knots[i], xs[i] = stop.result.knot, stop.result.xs
                raise Interrupted((xs, status, knots)) from None
            status[i] = rolled.reports[min(rolled.knot, steps - 1), 0] if steps else Status.SOLVED
        return xs, status, knots

    def start(self, q: Vector, v: Vector, h: float | None = None) -> tuple[int, Vector]:
        """The state is that of the node."""
        return int(Status.SOLVED), np.concatenate([q, v])

    def node_velocities(self, xs: Floats, h: float | None = None) -> Floats:
        """The velocities of the states."""
        return np.array(xs[:, self.sizes.nq :])

    def energies(self, xs: Floats, h: float | None = None) -> Floats:
        """(kinetic, potential) energy of every row."""
        potential = super().energies(xs)[:, 1]
        rotors = 0.5 * xs[:, self.sizes.nq :] ** 2 @ self.model.dof_armature
        return np.stack([bodies.kinetic_energy(self.model, self.bodies(xs)) + rotors, potential], axis=1)

    def momenta(self, xs: Floats, h: float | None = None) -> Floats:
        """(linear, angular) momentum of every row."""
        return bodies.momentum(self.model, self.bodies(xs))

    def maximal(self, xs: Floats, nbody: int, h: float | None = None) -> Floats:
        """z of every row, with velocities at the node."""
        return self.bodies(xs)

    def minimal(self, zs: Floats, h: float | None = None) -> Floats:
        """x of every z; of velocities that violate a joint, the part of least kinetic energy off them is dropped."""
        still = zs.copy()
        still[..., 3:6] = still[..., 10:] = 0.0
        xs = np.zeros((len(zs), self.nx))
        coordinates.minimal_states(self._model, self._scratch.table(), 1.0, still.reshape(-1, 13), xs)
        for x, z in zip(xs, zs, strict=True):
            columns, weighted = self._columns(x)
            rates = np.concatenate([z[:, 3:6], z[:, 10:]], axis=1).ravel()
            x[self.sizes.nq :] = np.linalg.solve(weighted @ columns.T, weighted @ rates)
        return xs

    def mass_matrix(self, x: Vector) -> Floats:
        """M(q), (nv, nv)."""
        columns, weighted = self._columns(x)
        return np.asarray(weighted @ columns.T + np.diag(self.model.dof_armature))

    def _columns(self, x: Vector) -> tuple[Floats, Floats]:
        """d(velocities of the bodies)/d(joint velocities), (nv, 6 nbody), and the same times their inertias."""
        xs = np.tile(x, (self.sizes.nv, 1))
        xs[:, self.sizes.nq :] = np.eye(self.sizes.nv)
        z = self.bodies(xs)
        inertia = self.model.body_inertia.reshape(-1, 3, 3)
        linear = self.model.body_mass[:, None] * z[..., 3:6]
        angular = np.einsum("bij,nbj->nbi", inertia, z[..., 10:])
        columns = np.concatenate([z[..., 3:6], z[..., 10:]], axis=2)
        return columns.reshape(len(z), -1), np.concatenate([linear, angular], axis=2).reshape(len(z), -1)

    def _tangents(self) -> Tangents:
        """Scratch of derivatives."""
        nv, s = self.sizes.nv, len(tableau(self.settings.order)[1])
        n = 2 * nv + self.nu
        slopes = Slopes(*(np.zeros((nv, m)) for m in (nv, nv, nv, nv, self.nu, 42)))
        one, all_stages = (np.zeros((nv, n)) for _ in range(5)), (np.zeros((s, nv, n)) for _ in range(2))
        return Tangents(slopes, *one, *all_stages)

    def linearize(
        self,
        xs: Floats,
        us: Floats,
        substeps: int,
        kappa: float | None,
        guess: Floats | None = None,
        wrenches: Cube | None = None,
    ) -> tuple[Floats, ...]:
        """As Engine.linearize, on one core; without kappa or guess."""
        self._check_swings()
        n = len(us)
        A, B = np.zeros((n, self.ndx, self.ndx)), np.zeros((n, self.ndx, self.nu))
        x_next, reports = np.zeros((n, self.nx)), np.zeros((n, REPORT))
        line = Linearized(xs, us, self.external(wrenches), A, B, x_next, reports)
        model, data, settings, scheme, tangents = *self._tables(), self._scheme(), self._tangents()
        step = 0
        for _ in pieces(settings, n * substeps):
            step = int(runge_kutta.linearize(model, data, settings, scheme, substeps, line, tangents, step))
            if step == n * substeps:
                break
        unsolved = reports[:, 0] != Status.SOLVED
        for array in (A, B, x_next):
            array[unsolved] = 0.0
        return A, B, x_next, reports

    def _check_swings(self) -> None:
        """Refuse derivatives through joints with two rotations."""
        swings = np.flatnonzero(self.model.joint_nrot == 2)
        if len(swings):
            raise ValueError(
                f"Simulator of order {self.settings.order}: derivatives through joint {swings[0]}, with two rotations "
                "(orbital), are those of order 2; use replace(order=2)"
            )

    def closed_loop(
        self,
        x: Vector,
        policy: FeedbackLaw,
        alpha: float,
        limits: tuple[Floats, Floats],
        substeps: int,
        kappa: float | None,
        *,
        keep: bool = False,
    ) -> tuple[int, Path]:
        """As Engine.closed_loop."""
        path = self._path(len(policy.us), keep=keep)
        path.xs[0] = x
        model, data, settings, scheme = *self._tables(), self._scheme()

        def go_on(first: int) -> int:
            law = (policy, alpha, limits)
            return int(runge_kutta.closed_loop(model, data, settings, scheme, law, substeps, path, first))

        return follow(go_on, settings, path, substeps), path

    def maximal_jacobian(self, x: Vector, nbody: int, h: float | None = None) -> Floats:
        """Refused."""
        self._refuse("Jacobians are")

    def minimal_jacobian(self, z: Floats, h: float | None = None) -> Floats:
        """Refused."""
        self._refuse("Jacobians are")

    def _refuse(self, what: str) -> NoReturn:
        raise ValueError(f"Simulator of order {self.settings.order}: {what} those of order 2; use replace(order=2)")

    def check_stiffness(self, mechanism: Mechanism) -> None:
        """Refuse springs and dampers that are too fast for an explicit method.

        Rates are the eigenvalues of M^-1 D, and the roots of those of M^-1 K, at the neutral configuration.
        """
        stiff = np.maximum(self.model.dof_spring, 0.0), self.model.dof_damper
        if not np.any(stiff):
            return
        q = np.asarray(mechanism.neutral, dtype=np.float64)
        M = self.mass_matrix(np.concatenate([q, np.zeros(self.sizes.nv)]))
        for what, values, power in (("spring", stiff[0], 0.5), ("damper", stiff[1], 1.0)):
            rates, modes = np.linalg.eig(np.linalg.solve(M, np.diag(values)))
            worst = int(np.argmax(rates.real))
            rate = max(rates[worst].real, 0.0) ** power
            if rate * self.settings.time_step > stable(self.settings.order):
                joint = mechanism.joint_names[self.model.dof_body[int(np.argmax(np.abs(modes[:, worst])))]]
                raise ValueError(
                    f"Simulator(order={self.settings.order}): joint {joint!r}: its {what} acts at {rate:.3g} 1/s, too "
                    f"fast for an explicit step of {self.settings.time_step:g} s; use a time step below "
                    f"{stable(self.settings.order) / rate:.2g} s, or order=2"
                )


def check(mechanism: Mechanism, settings: Settings) -> None:
    """Refuse mechanisms that only steps of order 2 can move."""
    collisions = [c.name for c in mechanism.collisions]
    loops, gears = [j.name for j in mechanism.loops], [g.name for g in mechanism.gears]
    parts = [("collision", collisions), ("loop joint", loops), ("gear", gears)]
    parts.append(("dry friction of", [j.name for j in mechanism.joints if np.any(j.friction)]))
    parts.append(("limited servo", [part.name for _, part in limited_servos(mechanism.inputs or ())]))
    for what, names in parts:
        if names:
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            raise ValueError(
                f"Simulator(order={settings.order}): {mechanism.name!r} has the {what} {names[0]!r}{more}; steps of "
                "higher order are for trees without collisions of their bodies, dry friction and limits of servos: use "
                "order=2, or leave them out"
            )
