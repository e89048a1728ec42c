"""Calls of a simulator of higher order: its states have the velocity of the node, and its steps are compositions."""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from sim import bodies, composition, coordinates
from sim.calls import REPORT, Calls, Floats, Settings
from sim.mechanism import Mechanism
from sim.model import Integers, Vector
from solvers.status import Status

_DEPTH = 3  # steps that a guess is extrapolated from
_DEGREE = 2  # of the polynomial in time through what the guesses of a step lacked so far
_FAST = 0.5  # how much a damper may undo within one interval that runs backwards


def _symmetric(*half: float) -> tuple[float, ...]:
    """The first intervals, the middle one that makes the sum 1, and the first ones again backwards."""
    return (*half, 1.0 - 2.0 * sum(half), *reversed(half))


_FOURTH = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))

# Order -> the intervals of one step, in steps; of those tried the best for their time, with those of McLachlan (4),
# Yoshida (4, 6), and Kahan and Li (8) behind them.
# Suzuki, Phys. Lett. A 146 (1990); Kahan, Li, Math. Comp. 66 (1997); Suzuki, Umeno, in: Computer Simulation Studies in
# Condensed-Matter Physics VI (1993), as tabled by Hairer, Lubich, Wanner, Geometric Numerical Integration, V.3.2.
COMPOSITIONS: dict[int, tuple[float, ...]] = {
    4: _symmetric(_FOURTH, _FOURTH),
    6: _symmetric(
        0.39216144400731413928,
        0.33259913678935943860,
        -0.70624617255763935981,
        0.08221359629355080023,
    ),
    8: _symmetric(
        0.74167036435061295345,
        -0.40910082580003159400,
        0.19075471029623837995,
        -0.57386247111608226666,
        0.29906418130365592384,
        0.33462491824529818378,
        0.31529309239676659663,
    ),
}


def _blend(parts: Floats) -> Floats:
    """Weights (s, s) of the earlier parts of a step in the extrapolation, in time, of what guesses lacked.

    The polynomials vanish at the node; the weights are the smallest that reproduce them, for times may lie close
    together.
    """
    times = np.cumsum(parts) - 0.5 * parts
    weights = np.zeros((len(parts), len(parts)))
    for k in range(1, len(parts)):
        powers = np.arange(1, min(k, _DEGREE) + 1)[:, None]
        weights[k, :k] = np.linalg.pinv(times[:k] ** powers, rcond=1e-3) @ (times[k] ** powers[:, 0])
    return weights


class Composed(Calls):
    """The kernels of one packed mechanism without contacts and limits, with steps of the order of its settings."""

    def _composition(self) -> composition.Composition:
        parts, nv = np.array(COMPOSITIONS[self.settings.order]), self.sizes.nv
        past, missed = np.zeros((_DEPTH, len(parts), nv)), np.zeros((len(parts), nv))
        return composition.Composition(parts, np.zeros(nv), past, missed, _blend(parts))

    def roll(self, x: Vector, us: Floats) -> tuple[int, Floats, Floats, Floats]:
        """As Calls.roll; without contacts."""
        steps = len(us)
        xs, reports = np.zeros((steps + 1, self.nx)), np.zeros((steps, REPORT))
        xs[0] = x
        settings = self.settings.array()
        knot = composition.roll(self._model, self._work(), settings, self._composition(), us, xs, reports)
        if knot < steps:
            np.nan_to_num(reports[knot], copy=False, nan=np.inf, posinf=np.inf)
        return int(knot), xs, reports, np.zeros((steps, 0, 8))

    def roll_batch(self, x0s: Floats, us: Floats) -> tuple[Floats, Integers, Integers]:
        """As Calls.roll_batch, on one core."""
        n, steps = us.shape[:2]
        xs = np.zeros((n, steps + 1, self.nx))
        status, knots = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        for i in range(n):
            knots[i], xs[i], reports, _ = self.roll(x0s[i], us[i])
            status[i] = reports[min(knots[i], steps - 1), 0] if steps else Status.SOLVED
        return xs, status, knots

    def start(self, q: Vector, v: Vector) -> tuple[int, Vector]:
        """The state is that of the node."""
        return int(Status.SOLVED), np.concatenate([q, v])

    def node_velocities(self, xs: Floats) -> Floats:
        """The velocities of the states."""
        return np.array(xs[:, self.sizes.nq :])

    def energies(self, xs: Floats) -> Floats:
        """(kinetic, potential) energy of every row."""
        potential = super().energies(xs)[:, 1]
        return np.stack([bodies.kinetic_energy(self.model, self.bodies(xs)), potential], axis=1)

    def momenta(self, xs: Floats) -> Floats:
        """(linear, angular) momentum of every row."""
        return bodies.momentum(self.model, self.bodies(xs))

    def maximal(self, xs: Floats, nbody: int) -> Floats:
        """z of every row, with velocities at the node."""
        return self.bodies(xs)

    def minimal(self, zs: Floats) -> Floats:
        """x of every z; of velocities that violate a joint, the part of least kinetic energy off them is dropped."""
        still = zs.copy()
        still[..., 3:6] = still[..., 10:] = 0.0
        xs = np.zeros((len(zs), self.nx))
        coordinates.minimal_states(self._model, self._work(), 1.0, still.reshape(-1, 13), xs)
        for x, z in zip(xs, zs, strict=True):
            columns, weighted = self._columns(x)
            rates = np.concatenate([z[:, 3:6], z[:, 10:]], axis=1).ravel()
            x[self.sizes.nq :] = np.linalg.solve(weighted @ columns.T, weighted @ rates)
        return xs

    def mass_matrix(self, x: Vector) -> Floats:
        """M(q), (nv, nv)."""
        columns, weighted = self._columns(x)
        return np.asarray(weighted @ columns.T)

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

    def linearize(self, *_: Any, **__: Any) -> NoReturn:
        """Refused."""
        self._refuse("derivatives are")

    def closed_loop(self, *_: Any, **__: Any) -> NoReturn:
        """Refused."""
        self._refuse("feedback is")

    def maximal_jacobian(self, x: Vector, nbody: int) -> Floats:
        """Refused."""
        self._refuse("Jacobians are")

    def minimal_jacobian(self, z: Floats) -> Floats:
        """Refused."""
        self._refuse("Jacobians are")

    def _refuse(self, what: str) -> NoReturn:
        raise ValueError(f"Simulator of order {self.settings.order}: {what} those of order 2; use replace(order=2)")

    def check_dampers(self, mechanism: Mechanism) -> None:
        """Refuse dampers that are too fast for the intervals that run backwards, where they feed energy in.

        Rates are the eigenvalues of M^-1 D at the neutral configuration.
        """
        if not self.model.dof_damper.any():
            return
        M = self.mass_matrix(np.concatenate([np.asarray(mechanism.neutral, dtype=np.float64), np.zeros(self.sizes.nv)]))
        rates, modes = np.linalg.eig(np.linalg.solve(M, np.diag(self.model.dof_damper)))
        worst = int(np.argmax(rates.real))
        back = -min(COMPOSITIONS[self.settings.order]) * self.settings.time_step
        if rates[worst].real * back > _FAST:
            dof = int(np.argmax(np.abs(modes[:, worst])))
            joint = mechanism.joint_names[self.model.dof_body[dof]]
            raise ValueError(
                f"Simulator(order={self.settings.order}): joint {joint!r}: its damper slows motion down at "
                f"{rates[worst].real:.3g} 1/s, too fast for intervals of {back:.3g} s that run backwards; use a time "
                f"step below {_FAST / back / rates[worst].real * self.settings.time_step:.2g} s, or order=2"
            )


def check(mechanism: Mechanism, settings: Settings) -> None:
    """Refuse mechanisms whose steps cannot be composed."""
    limited = [
        j.name
        for j in mechanism.joints
        if j.cone is not None or any(np.isfinite(b) for pair in j.limits or () for b in pair)
    ]
    loops, gears = [j.name for j in mechanism.loops], [g.name for g in mechanism.gears]
    parts = (("contact", mechanism.contact_names), ("limits of joint", limited), ("loop joint", loops), ("gear", gears))
    for what, names in parts:
        if names:
            more = f" and {len(names) - 1} more" if len(names) > 1 else ""
            raise ValueError(
                f"Simulator(order={settings.order}): {mechanism.name!r} has the {what} {names[0]!r}{more}; a step of "
                f"higher order runs partly backwards in time, which they cannot: use order=2, or leave them out"
            )
