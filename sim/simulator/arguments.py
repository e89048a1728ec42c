"""Arguments: checks of the arguments of Simulator; messages name the method, the argument and the error."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.integrators.feedback import FeedbackLaw
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import check_room
from sim.model.state_columns import BodyState
from sim.simulator.engines.engine import REPORT, Engine
from solvers.status import MESSAGES, Status
from solvers.types import Floats

_FLOAT = np.dtype(np.float64)
_MANY = 10_000  # rows whose memory is looked at


def is_plain(value: Any, shape: tuple[int, ...]) -> bool:
    """Whether kernels take an array as it is; `accept` of rollout.py looks at its numbers."""
    return type(value) is np.ndarray and value.dtype is _FLOAT and value.shape == shape and value.flags.carray


class Arguments:
    """Checks of states, inputs and maximal states of one mechanism."""

    def __init__(self, mechanism: Mechanism, engine: Engine) -> None:
        self.mechanism, self._engine = mechanism, engine
        self.nbody, self.nx, self.nu = mechanism.nbody, engine.nx, engine.nu
        self.time_step = engine.settings.time_step

    def states(self, call: str, xs: ArrayLike) -> Floats:
        """A copy of the states (..., nx), with quaternions of length one."""
        out = np.array(xs, dtype=np.float64, order="C")
        bad = self._engine.states.normalize(out.reshape(-1, self.nx), checks.UNIT)
        if bad >= 0:
            row, body = divmod(bad, self.nbody)
            at = f" in row {row}" if out.ndim > 1 else ""
            joint = self.mechanism.joints[body]
            stop = self.mechanism.q_slice(joint.name).stop
            length = float(np.linalg.norm(out.reshape(-1, self.nx)[row, stop - 4 : stop]))
            raise ValueError(f"{call}: joint {joint.name!r}{at}: expected a unit quaternion, got length {length:g}")
        return out

    def state(self, method: str, x: ArrayLike, name: str = "x") -> Floats:
        """One state (nx,)."""
        call = f"Simulator.{method}({name})"
        return self.states(call, checks.array(call, x, (self.nx,)))

    def stacked(self, method: str, name: str, x: ArrayLike) -> tuple[Floats, tuple[int, ...]]:
        """States as rows, and their leading axes."""
        call = f"Simulator.{method}({name})"
        out = self.states(call, shaped(call, x, (self.nx,)))
        return out.reshape(-1, self.nx), out.shape[:-1]

    def paired(
        self, method: str, first: tuple[str, ArrayLike, int], second: tuple[str, ArrayLike, int]
    ) -> tuple[Floats, Floats, tuple[int, ...]]:
        """Two arguments as rows, broadcast to common leading axes: copies."""
        if is_plain(first[1], first[2:]) and is_plain(second[1], second[2:]):
            x, y = np.array(first[1], ndmin=2), np.array(second[1], ndmin=2)
            if checks.all_finite(x) and checks.all_finite(y):
                return x, y, ()
        a, b = (shaped(f"Simulator.{method}({n})", v, (size,)) for n, v, size in (first, second))
        try:
            lead = np.broadcast_shapes(a.shape[:-1], b.shape[:-1])
        except ValueError:
            raise ValueError(
                f"Simulator.{method}: leading axes {a.shape[:-1]} of {first[0]} and {b.shape[:-1]} of {second[0]} "
                "do not broadcast"
            ) from None
        # C order, writable: kernels would be compiled again for any other layout
        rows = [np.array(np.broadcast_to(m, (*lead, m.shape[-1])), order="C").reshape(-1, m.shape[-1]) for m in (a, b)]
        return rows[0], rows[1], lead

    def inputs(self, method: str, name: str, u: ArrayLike, shape: tuple[int | str | None, ...]) -> Floats:
        """Inputs of the given shape; refused if the results of all rows do not fit the memory."""
        call = f"Simulator.{method}({name})"
        rows = prod((u.shape if type(u) is np.ndarray else checks.shape(call, u))[:-1])
        if rows > _MANY:
            slopes = self._engine.ndx * (self._engine.ndx + self.nu) if method.startswith("linearize") else 0
            self.check_room(method, name, rows, slopes)
        return checks.array(call, u, shape)

    def steps(self, method: str, steps: int | None) -> int:
        """A number of steps whose results fit the memory."""
        if steps is None:
            ways = "give us=..., steps=... or, with an accuracy, duration=..."
            raise ValueError(f"Simulator.{method}(steps=...): expected a whole number >= 1, got None; {ways}")
        number = checks.whole_number(f"Simulator.{method}(steps=...)", steps)
        self.check_room(method, "steps=...", number, 0)
        return number

    def check_room(self, method: str, name: str, rows: int, slopes: int) -> None:
        """Refuse more steps than the memory holds: states, inputs, reports, contacts and derivatives."""
        _, contacts, columns = self._engine.no_outputs[0].shape
        each = self.nx + self.nu + REPORT + contacts * columns + slopes
        check_room(
            f"Simulator.{method}({name})",
            rows,
            8.0 * each,
            "go on from the last state of shorter parts",
            "rows or steps",
        )

    def kappa(self, method: str, kappa: float | None) -> float | None:
        """A positive kappa, or None for that of the simulator."""
        return None if kappa is None else checks.number(f"Simulator.{method}(kappa=...)", kappa, above=0.0)

    def wrenches(self, method: str, wrenches: Any, steps: int) -> Floats | None:
        """External wrenches (steps, nbody, 6), from (nbody, 6), (steps, nbody, 6) or {body: (6,) or (steps, 6)}."""
        if wrenches is None:
            return None
        call = f"Simulator.{method}(wrenches=...)"
        names, out = self.mechanism.body_names, np.zeros((steps, self.nbody, 6))
        if isinstance(wrenches, Mapping):
            for name, value in wrenches.items():
                checks.one_of(f"{call}: body", name, names)
                lead = (steps,) if checks.ndim(f"{call}: body {name!r}", value) == 2 else ()
                out[:, names.index(name)] = checks.array(f"{call}: body {name!r}", value, (*lead, 6))
        else:
            lead = (steps,) if checks.ndim(call, wrenches) == 3 else ()
            out[:] = checks.array(call, wrenches, (*lead, self.nbody, 6))
        return out

    def policy(
        self, call: str, start: Floats, us: Floats, wrenches: Floats | None, parts: tuple[ArrayLike | None, ...]
    ) -> FeedbackLaw:
        """FeedbackLaw around the inputs us with the parts (xs, ks, Ks, gaps); zero by default, and xs `start`."""
        ndx, knots = self._engine.ndx, len(us)
        shapes = ((knots + 1, self.nx), (knots, self.nu), (knots, self.nu, ndx), (knots + 1, ndx))
        xs, ks, Ks, gaps = (
            np.zeros(shape) if part is None else checks.array(f"{call}({name}=...)", part, shape)
            for name, part, shape in zip(("xs", "ks", "Ks", "gaps"), parts, shapes, strict=True)
        )
        if parts[0] is None:
            if parts[2] is not None:
                raise ValueError(f"{call}(Ks=...): gains need reference states, xs=...")
            xs[:] = start
        external = self._engine.external(wrenches)
        return FeedbackLaw(self.states(f"{call}(xs=...)", xs), us, external, ks, Ks, gaps, *self._engine.no_predictions)

    def limits(self, call: str, limits: tuple[ArrayLike, ArrayLike] | None) -> tuple[Floats, Floats]:
        """(lower, upper) of every input, infinite where free."""
        if limits is None:
            return np.full(self.nu, -np.inf), np.full(self.nu, np.inf)
        try:
            lo, hi = (np.array(np.broadcast_to(checks.floats(call, b), (self.nu,))) for b in limits)
        except (TypeError, ValueError):
            raise ValueError(f"{call}(limits=...): expected (lower, upper), each as wide as u ({self.nu})") from None
        if not np.all(lo <= hi):
            raise ValueError(f"{call}(limits=...): expected lower <= upper")
        return lo, hi

    def finite_result(self, method: str, out: Floats, *given: Floats) -> Floats:
        """The result of a call for the rows (n, ...) of its arguments; refused if it overflows."""
        if checks.all_finite(out):
            return out
        row = int(np.argwhere(~np.isfinite(out.reshape(len(given[0]), -1)).all(axis=1))[0, 0])
        size, name = max((self._largest(rows[row]) for rows in given), key=lambda found: abs(found[0]))
        at = f" in row {row}" if len(given[0]) > 1 else ""
        raise ValueError(
            f"Simulator.{method}{at}: the result is not finite, because numbers overflow or the mass matrix is "
            f"singular; the largest entry is {size:g}, of {name}"
        )

    def _largest(self, row: Floats) -> tuple[float, str]:
        """(largest entry of a state, a perturbation or a maximal state, the joint or body it belongs to)."""
        flat = row.ravel()
        k, nq = int(np.abs(flat).argmax()), self.mechanism.nq
        if len(flat) == 13 * self.nbody and row.ndim == 2:
            return float(flat[k]), f"body {self.mechanism.body_names[k // 13]!r}"
        place, at = (self.mechanism.q_slice, k) if len(flat) == self.nx and k < nq else (self.mechanism.v_slice, k - nq)
        if len(flat) != self.nx:
            at = k % self.mechanism.nv
        return float(flat[k]), next(f"joint {n!r}" for n in self.mechanism.joint_names if at < place(n).stop)

    def check_maximal(self, method: str, zs: Floats) -> None:
        """Quaternions of length one, and less than half a turn per step."""
        with np.errstate(over="ignore"):
            length = np.linalg.norm(zs[..., BodyState.QUATERNION], axis=-1)
            turn = np.linalg.norm(zs[..., BodyState.SPIN], axis=-1) * self.time_step
        for bad, why in (
            (np.abs(length - 1.0) > checks.UNIT, "expected a unit quaternion"),
            (turn >= np.pi, MESSAGES[Status.TURN_TOO_LARGE]),
        ):
            if bad.any():
                raise ValueError(
                    f"Simulator.{method}(z): body {self.mechanism.body_names[np.argwhere(bad)[0, 1]]!r}: {why}"
                )
        zs[..., BodyState.QUATERNION] /= length[..., None]

    def check_joints(self, zs: Floats, back: Floats, tolerance: float) -> None:
        """Refuse maximal states that their own minimal states do not reproduce."""
        turn, before = zs[..., BodyState.QUATERNION], back[..., BodyState.QUATERNION]
        dot = np.clip(np.abs(np.einsum("...i,...i->...", turn, before)), 0.0, 1.0)
        now = np.linalg.norm(zs[..., :3] - back[..., :3], axis=-1)
        change = self.time_step * (zs - back)
        moved = sum(np.linalg.norm(change[..., part], axis=-1) for part in (BodyState.VELOCITY, BodyState.SPIN))
        error = np.maximum(now + 2.0 * np.sqrt(2.0 * (1.0 - dot)), moved)
        if (error > tolerance).any():
            body = int(np.argwhere(error > tolerance)[0, 1])
            joint, worst = self.mechanism.joint_names[body], float(error[error > tolerance][0])
            raise ValueError(
                f"Simulator.minimal(z): joint {joint!r} is violated by {worst:.1e} (joint_tolerance={tolerance:g})"
            )


def shaped(call: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """`value` as a finite array that ends in `shape`, with any leading axes."""
    ndim = checks.ndim(call, value)
    lead = (None,) * max(0, ndim - len(shape))
    try:
        return checks.array(call, value, (*lead, *shape))
    except ValueError as error:
        text = str(error)
        if ndim > len(shape) and "expected shape" in text:
            tail = ", ".join(map(str, shape))
            text = f"{call}: expected shape (..., {tail}), got {np.shape(value)}"
        raise ValueError(text) from None
