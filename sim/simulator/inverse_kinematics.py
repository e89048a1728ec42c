"""ik: coordinates at which frames reach their targets, within the joint limits, with loops closed and gears in mesh."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.shapes import rotation_matrix
from sim.mechanism.short_repr import short_repr
from sim.simulator.kinematics import Kinematics
from sim.simulator.loop_closure import Closure
from sim.simulator.simulator import Simulator
from solvers.types import Floats

COM = "center of mass"  # a target of this name
_ACCEPT, _LEAST, _MOST = 1e-12, 1e-12, 1e6  # damping where it begins, and its range
_SMALL = 1e-12  # [rad, m] a step that ends the iterations
_PROGRESS = 1e-4  # least relative decrease of the squared errors in an iteration that is not idle
_IDLE = 3  # idle iterations in a row that end the search: the targets are out of reach, where progress is slow
_NEAR, _FAR = 0.5, 2.0  # [rad, m] spread of the coordinates of further starts, the first ones near
_NEARBY = 5  # number of these, after which joints that the targets do not need may end far from where they were
_TURN = 1.0  # [rad] largest change of a coordinate in an iteration
_SMALLEST_ROOM = 1e-9  # [rad, m] of a coordinate that a step may change
_DIFFERENCE = 1e-6  # [m, rad] of central differences of gaps
_ORTHOGONAL = 1e-6  # error of R R^T of a rotation matrix


Target = tuple[Floats | None, Floats | None]  # place, rotation


@dataclass(frozen=True)
class IkResult:
    """Coordinates, and their distances from the targets.

    Attributes:
        q: (nq,) coordinates.
        success: whether all errors are within the tolerance.
        message: sentence about the outcome.
        error: largest distance or angle from a target, or gap of a loop joint or gear [m, rad].
        errors: the same by target, and by loop joint and "gear NAME".
        iterations: number of iterations from all starts.
    """

    q: Floats
    success: bool
    message: str
    error: float
    errors: dict[str, float]
    iterations: int

    __repr__ = short_repr


def ik(
    sim: Simulator | Kinematics,
    targets: Mapping[str, Any],
    start: ArrayLike | None = None,
    *,
    fixed: Sequence[str] = (),
    limits: bool = True,
    tolerance: float = 1e-8,
    max_iterations: int = 200,
    attempts: int = 16,
) -> IkResult:
    """Coordinates near `start` with frames at their targets, by Levenberg and Marquardt's method with steps within the
    limits.

    Each step is min |J dq + r|^2 + damping |dq|^2 under lo <= q + dq <= hi, solved as a bounded problem, so that joints
    slide along their limits. Gaps of loop joints and gears are errors as those of the targets are.

    Args:
        sim: the simulator, or its Kinematics with frames that were added.
        targets: by frame: its place (3,) [m], or, with its orientation, (place, orientation) or (None, orientation),
            a quaternion (w, x, y, z) or a rotation matrix, as from `Kinematics.pose`. "center of mass" is a place,
            too.
        start: coordinates (nq,), by default those of the neutral state.
        fixed: names of joints that keep their coordinates, also those beyond their limits; "floating_base" for one.
        limits: whether joint limits hold of joints that are not fixed; cone limits are ignored.
        tolerance: largest error of a success [m, rad].
        max_iterations: limit of the iterations from one start.
        attempts: number of starts; further ones are random, around the best coordinates so far, because arms have
            postures in which no small motion helps (default 16).

    Returns:
        IkResult; without a solution nearby, its message names the farthest target, or the loop joint or gear.

    Raises:
        ValueError: a frame or a joint is unknown, or a target has the wrong form.
    """
    kin = sim if isinstance(sim, Kinematics) else Kinematics(sim)
    if not isinstance(targets, Mapping):
        raise ValueError(f"ik(targets): expected a place for each frame, got {checks.shown(targets)}")
    tolerance = checks.number("ik(tolerance=...)", tolerance, above=0.0)
    checks.whole_number("ik(max_iterations=...)", max_iterations)
    checks.whole_number("ik(attempts=...)", attempts)
    wanted = {name: _target(kin, name, given) for name, given in targets.items()}
    if not wanted:
        raise ValueError("ik(targets): expected at least one target")
    neutral = kin.sim.neutral()[: kin.sim.nq]
    q = np.array(neutral if start is None else checks.array("ik(start=...)", start, (kin.sim.nq,)))
    low, high, free = _bounds(kin, fixed, limits)
    q = _inside(kin, q, low, high)
    search = _Search(kin, wanted, kin.sim.closure(), low, high, free, tolerance, max_iterations)
    q, r, count = search.nearest(q, attempts)
    errors = search.errors(q, r)
    worst = max(errors, key=lambda name: errors[name])
    success = errors[worst] <= tolerance
    message = f"All targets are met to {errors[worst]:.2g}."
    if not success:
        where = "from its target" if worst in wanted else "open"
        message = f"{worst!r} stays {errors[worst]:.3g} {where}: out of reach, or too far from start."
    return IkResult(q, success, message, errors[worst], errors, count)


class _Search(NamedTuple):
    """Data of the iterations."""

    kin: Kinematics
    wanted: Mapping[str, Target]
    closure: Closure | None
    low: Floats
    high: Floats
    free: NDArray[np.int64]
    tolerance: float
    max_iterations: int

    def nearest(self, q: Floats, attempts: int) -> tuple[Floats, Floats, int]:
        """(coordinates, residual, iterations) from a start within the limits, and from random ones around the best."""
        q, r, count = self.descend(q)
        rng = np.random.default_rng(0)
        for attempt in range(attempts - 1):
            if self.met(q, r):
                break
            dq = np.zeros(self.kin.sim.nv)
            dq[self.free] = (_NEAR if attempt < _NEARBY else _FAR) * rng.normal(size=len(self.free))
            other, r_other, more = self.descend(_inside(self.kin, self.kin.moved(q, dq), self.low, self.high))
            count += more
            if r_other @ r_other < r @ r:
                q, r = other, r_other
        if self.met(q, r):
            return q, r, count
        q, r, more = self.descend(q, idle_at_most=self.max_iterations)  # out of reach: as near as possible
        return q, r, count + more

    def met(self, q: Floats, r: Floats) -> bool:
        """Whether all errors r at q are within the tolerance."""
        return max(self.errors(q, r).values()) <= self.tolerance

    def descend(self, q: Floats, idle_at_most: int = _IDLE) -> tuple[Floats, Floats, int]:
        """(coordinates, residual, iterations) from a start within the limits, up to some idle iterations in a row."""
        kin, free, enough = self.kin, self.free, 0.1 * self.tolerance
        r, J = self.residual(q)
        damping, count, idle = _ACCEPT, 0, 0
        while count < self.max_iterations and np.abs(r).max() > enough and damping < _MOST and idle < idle_at_most:
            count += 1
            dq = np.zeros(kin.sim.nv)
            dq[free] = _step(J[:, free], r, damping, *(b[free] for b in _room(kin, q, self.low, self.high)))
            tried = _inside(kin, kin.moved(q, dq), self.low, self.high)  # rounding may be beyond a limit
            r_tried, J_tried = self.residual(tried)
            if r_tried @ r_tried < r @ r:
                idle = idle + 1 if r_tried @ r_tried > (1.0 - _PROGRESS) * (r @ r) else 0
                small = float(np.abs(dq).max()) < _SMALL
                q, r, J, damping = tried, r_tried, J_tried, max(_LEAST, 0.1 * damping)
                if small:
                    break
            else:
                damping = max(1e-6, 10.0 * damping)
        return q, r, count

    def residual(self, q: Floats) -> tuple[Floats, Floats]:
        """Errors of the targets, then gaps of loops and gears, (m,), and their Jacobian (m, nv)."""
        r, J = _residual(self.kin, q, self.wanted)
        if self.closure is None:
            return r, J
        steps = _DIFFERENCE * np.concatenate([np.zeros((1, J.shape[1])), np.eye(J.shape[1]), -np.eye(J.shape[1])])
        gaps = self.closure.errors(self.kin.moved(np.tile(q, (len(steps), 1)), steps))
        ahead, behind = np.split(gaps[1:], 2)
        return np.concatenate([r, gaps[0]]), np.concatenate([J, (ahead - behind).T / (2.0 * _DIFFERENCE)])

    def errors(self, q: Floats, r: Floats) -> dict[str, float]:
        """Sizes of the errors r at q, by target, loop joint and gear."""
        out = _errors(self.wanted, r)
        if self.closure is not None:
            x = np.concatenate([q, np.zeros(self.kin.sim.nv)])
            out |= {name: float(np.abs(gap).max(initial=0.0)) for name, gap in self.closure.gaps(x).items()}
        return out


def _target(kin: Kinematics, name: str, given: Any) -> Target:
    """Place and rotation of one target."""
    call = f"ik(targets): {name!r}"
    if name != COM:
        checks.one_of("ik(targets)", name, [*kin.frames, COM])
    pair = isinstance(given, tuple | list) and len(given) == 2
    place, orientation = given if pair else (given, None)
    if place is None and orientation is None:
        raise ValueError(f"{call}: expected a place (3,), or (place, orientation), got {given!r}")
    if name == COM and orientation is not None:
        raise ValueError(f"{call}: it has a place, but no orientation")
    at = None if place is None else checks.array(call, place, (3,))
    return at, None if orientation is None else _rotation(call, orientation)


def _rotation(call: str, given: Any) -> Floats:
    """The rotation matrix of a quaternion, or of such a matrix."""
    if np.shape(given) != (3, 3):
        return rotation_matrix(checks.quaternion(call, given))
    R = checks.array(call, given, (3, 3))
    if not np.abs(R @ R.T - np.eye(3)).max() < _ORTHOGONAL or np.linalg.det(R) < 0.0:
        raise ValueError(f"{call}: expected a quaternion (4,) or a rotation matrix (3, 3), got {given!r}")
    return R


def _residual(kin: Kinematics, q: Floats, wanted: Mapping[str, Target]) -> tuple[Floats, Floats]:
    """Distances and rotation vectors from the targets, (m,), and their Jacobian (m, nv)."""
    rows: list[Floats] = []
    blocks: list[Floats] = []
    for name, (place, turn) in wanted.items():
        if name == COM:
            assert place is not None
            rows.append(kin.center_of_mass(q) - place)
            blocks.append(kin.com_jacobian(q))
            continue
        at, R = kin.pose(name, q)
        J = kin.jacobian(name, q)
        if place is not None:
            rows.append(at - place)
            blocks.append(J[:3])
        if turn is not None:
            w = _rotation_vector(R @ turn.T)
            rows.append(w)
            blocks.append(_left_inverse(w) @ J[3:])
    return np.concatenate(rows), np.concatenate(blocks)


def _rotation_vector(R: Floats) -> Floats:
    """w with exp([w]) = R, |w| <= pi."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_rotvec())


def _left_inverse(w: Floats) -> Floats:
    """d w / d(angular velocity, world axes): I - [w]/2 + (1/a^2 - (1 + cos a)/(2 a sin a)) [w]^2, a = |w|."""
    a = float(np.linalg.norm(w))
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    if a < 1e-4:
        factor = 1.0 / 12.0
    else:  # at half a turn, where the vector jumps, any finite one
        factor = 1.0 / a**2 - (1.0 + np.cos(a)) / (2.0 * a * max(np.sin(a), 1e-9))
    return np.asarray(np.eye(3) - 0.5 * W + factor * W @ W)


def _step(J: Floats, r: Floats, damping: float, low: Floats, high: Floats) -> Floats:
    """The bounded, damped step."""
    from scipy.optimize import lsq_linear

    n = J.shape[1]
    A = np.concatenate([J, np.sqrt(damping) * np.eye(n)])
    b = np.concatenate([-r, np.zeros(n)])
    plain = np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])
    if np.all((plain >= low) & (plain <= high)):
        return plain
    out, free = np.zeros(n), np.flatnonzero(high - low > _SMALLEST_ROOM)
    if len(free):
        # bounded-variable least squares: a fifth of the time of the trust region that is the default, for few columns
        bounds = low[free] - 1e-12, high[free] + 1e-12
        out[free] = lsq_linear(A[:, free], b, bounds, method="bvls", tol=1e-12, max_iter=10 * n).x
    return np.clip(out, low, high)


def _bounds(kin: Kinematics, fixed: Sequence[str], limits: bool) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Limits by degree of freedom, infinite where there are none, and the degrees of freedom that may move."""
    mech = kin.mechanism
    low, high = np.full(mech.nv, -np.inf), np.full(mech.nv, np.inf)
    free = np.ones(mech.nv, dtype=bool)
    if not isinstance(fixed, Sequence | Set) or isinstance(fixed, str):
        raise ValueError(f"ik(fixed=...): expected names of joints, got {checks.shown(fixed)}")
    if not isinstance(limits, bool | np.bool_):
        raise ValueError(f"ik(limits=...): expected True or False, got {checks.shown(limits)}")
    for name in fixed:
        checks.one_of("ik(fixed=...)", name, mech.joint_names)
    for joint in mech.joints:
        at = mech.v_slice(joint.name)
        free[at] = joint.name not in fixed
        if limits and joint.limits and joint.name not in fixed:  # a fixed one stays where it is, beyond them too
            low[at], high[at] = np.array(joint.limits, dtype=np.float64).T
    return low, high, np.flatnonzero(free)


def _limitable(kin: Kinematics) -> Iterator[tuple[slice, slice]]:
    """By joint, its coordinates without those of a quaternion, and their degrees of freedom."""
    for joint in kin.mechanism.joints:
        count = joint.scalar_count
        first, v = kin.mechanism.q_slice(joint.name).start, kin.mechanism.v_slice(joint.name).start
        yield slice(first, first + count), slice(v, v + count)


def _coordinates(kin: Kinematics, q: Floats) -> Floats:
    """The coordinate of every degree of freedom, zero of those of quaternions, which have no limits."""
    out = np.zeros(kin.sim.nv)
    for at, dof in _limitable(kin):
        out[dof] = q[at]
    return out


def _room(kin: Kinematics, q: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """Bounds of a step."""
    at = _coordinates(kin, q)
    return np.clip(low - at, -_TURN, 0.0), np.clip(high - at, 0.0, _TURN)


def _inside(kin: Kinematics, q: Floats, low: Floats, high: Floats) -> Floats:
    """q with coordinates beyond their limits at them."""
    q = np.array(q)
    for at, dof in _limitable(kin):
        q[at] = np.clip(q[at], low[dof], high[dof])
    return q


def _errors(wanted: Mapping[str, Target], r: Floats) -> dict[str, float]:
    """By target, the larger one of its distance and angle."""
    out, k = {}, 0
    for name, parts in wanted.items():
        sizes = []
        for part in parts:
            if part is not None:
                sizes.append(float(np.linalg.norm(r[k : k + 3])))
                k += 3
        out[name] = max(sizes)
    return out
