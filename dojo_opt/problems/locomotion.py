"""Problems of a quadruped: follow a reference gait to its final pose."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt import gaits, models
from dojo_opt.constraint import Goal, Periodic
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.equilibrium import equilibrium
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.gait import Gait
from dojo_opt.gaits.references import settings_of
from dojo_opt.gaits.take_off import highest_rise
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.options import CONTINUATION, PLANNED
from dojo_opt.planning.overload import demand
from dojo_opt.planning.problem import Problem
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["bound", "follow", "jump", "pace", "trot", "turn", "walk"]

TORQUE_LIMIT = 33.5  # of every hinge of the A1 [N m]
# weights of squares per second: base place (x, y, z), its rotation vector, angles, base velocities, joint rates
PLACE, ATTITUDE, ANGLE, VELOCITY, RATE = (0.3, 0.05, 0.05), 0.01, 0.2, 0.01, 0.001
GAIT_ADVICE = "Try a lower speed, a longer period, or a lower step_height."
RISE_ADVICE = "Try a longer duration, or a base that is less low."
JUMP_ADVICE = "Try a smaller height or distance, a deeper crouch, or more time before and after."
_WITHIN = 1.5  # times the limits: largest inputs of a reference that is not too high
_LIGHT = 1.05  # a base whose legs have weight rises so much more, as this does not rise as far
EFFORT = 2.5e-5  # per second and (N m)^2
# feet FR, FL, RR, RL of the trot of Dojo's examples, from the centre of mass of the trunk [m]
TROT_FOOTHOLDS = ((0.19, -0.13205), (0.19, 0.13205), (-0.27, -0.13205), (-0.27, 0.13205))


@checked_numbers("problems")
def follow(
    gait: Gait,
    *,
    guess: str = "reference",
    substeps: int = 1,
    control_limits: Any = None,
    place: ArrayLike = PLACE,
    attitude: float = ATTITUDE,
    effort: float = EFFORT,
    periodic: bool = False,
) -> Problem:
    """Follow a gait to its final pose.

    The cost tracks the states of the gait: squares of joint angles weigh .2, velocities of the base .01, joint rates
    .001, all per second. Place and attitude of the base at the end are constraints.

    Args:
        gait: the gait, with its simulator.
        guess: "reference" begins with the states of the gait and its torques by inverse dynamics, whose gaps the solve
            closes; "standing" with a robot that stands still, in equilibrium at the smoothing of the planner's first
            stage, or of the first at which it stands.
        substeps: time steps of the gait per knot; their number is a multiple of it.
        control_limits: (lower, upper), numbers or (nu,) [N m] (default None: the limits of the inputs).
        place: weight of squares of the base's place, a number or (3,) along x, y, z [1/(m^2 s)].
        attitude: weight of squares of the base's attitude [1/(rad^2 s)].
        effort: weight of squares of the inputs [1/((N m)^2 s)].
        periodic: whether the end must equal the start plus the displacement of the gait over one period, instead of a
            fixed start and a goal. The start is then free except its place along x and y and its heading. The gains of
            the plan are periodic, and `plan.repeated(5)` continues the walk.

    Returns:
        The problem.

    Raises:
        ValueError: for an argument out of range, a gait that cannot be followed or, with `periodic`, one that does not
            end as it began.
    """
    if not isinstance(gait, Gait):
        raise TypeError(f"problems.follow(gait): expected a Gait, got {checks.shown(gait)}")
    sim = gait.simulator
    checks.one_of("problems.follow(guess=...)", guess, ("reference", "standing"))
    substeps = whole_number("problems.follow(substeps=...)", substeps)
    place = checks.spread("problems.follow(place=...)", place, 3)
    checks.number("problems.follow(attitude=...)", attitude, at_least=0.0)
    checks.number("problems.follow(effort=...)", effort, at_least=0.0)
    if (len(gait.x) - 1) % substeps:
        raise ValueError(
            f"problems.follow(substeps=...): {len(gait.x) - 1} time steps are not a multiple of {substeps}"
        )
    reference = gait.x[::substeps]
    knot = sim.time_step * substeps
    states, controls = _along(gait, substeps) if guess == "reference" else _still(gait, len(reference) - 1)
    constraint: Any = Goal(reference[-1], components=np.arange(6))
    if periodic:
        constraint = Periodic(_stride(sim, reference))
    return Problem(
        sim,
        reference[0],
        len(reference) - 1,
        cost=[Tracking(reference, knot * weights(sim, place, attitude, ANGLE)), Effort(knot * effort)],
        constraints=[constraint],
        free_start=np.setdiff1d(np.arange(sim.ndx), [0, 1, 5]) if periodic else None,
        control_limits=control_limits,
        substeps=substeps,
        controls0=controls,
        states0=states,
        advice={"jump": JUMP_ADVICE, "stand": "", "stand up": RISE_ADVICE}.get(gait.name, GAIT_ADVICE),
    )


def _along(gait: Gait, substeps: int) -> tuple[Floats, Floats]:
    """States (T + 1, nx) of a gait at the knots, and its mean torques (T, nu) between them."""
    torques = gait.torques()
    return gait.x[::substeps], torques.reshape(-1, substeps, torques.shape[1]).mean(axis=1)


def _still(gait: Gait, horizon: int) -> tuple[Floats, Floats]:
    """States (T + 1, nx) and torques (T, nu) of the robot of a gait that stands still."""
    state, torques = standing(gait.simulator, gait.foot_names)
    return np.tile(state, (horizon + 1, 1)), np.tile(torques, (horizon, 1))


def weights(sim: Simulator, place: ArrayLike, attitude: float, angle: float) -> Floats:
    """(ndx,) weights of squares: base place and attitude, joint angles, then their velocities."""
    legs = sim.nv - 6
    pose = [np.broadcast_to(place, 3), np.full(3, attitude), np.full(legs, angle)]
    return np.concatenate([*pose, np.full(6, VELOCITY), np.full(legs, RATE)])


def standing(sim: Simulator, feet: tuple[str, ...] | None = None) -> tuple[Floats, Floats]:
    """State and torques of a standing robot at the first smoothing of the planner at which it stands.

    Contacts push with kappa over time step and gap: in short steps, or with little weight, the first smoothing may hold
    the robot so high that its other contacts, or its joints, cannot balance it.
    """
    on_feet = replace(sim.mechanism, contacts=Feet(sim, feet).contacts)
    *smooth, last = (stage.kappa_eval for stage in CONTINUATION)
    for kappa in smooth:
        with suppress(ValueError), np.errstate(all="ignore"):
            return equilibrium(sim.replace(mechanism=on_feet, kappa=kappa))
    return equilibrium(sim.replace(mechanism=on_feet, kappa=last))


def _stride(sim: Simulator, reference: Floats) -> Floats:
    """(ndx,) displacement of the reference over its period: a translation of the base."""
    stride = sim.difference(reference[-1], reference[0])
    if np.abs(stride[2:]).max() > 1e-6:
        raise ValueError(
            "problems.follow(periodic=True): expected a gait of whole periods that ends as it began, apart from its "
            f"place along x and y; its end differs by up to {np.abs(stride[2:]).max():.3g}"
        )
    stride[2:] = 0.0
    return np.asarray(stride)


@checked_numbers("problems")
def trot(
    *,
    speed: float | None = None,
    damping: float = 0.5,
    step_height: float = 0.025,
    height: float | None = 0.29,
    footholds: ArrayLike | None = TROT_FOOTHOLDS,
    time_step: float = 0.05,
    **settings: Any,
) -> Problem:
    """A quadruped of the A1's size trots for two periods of one second, 40 knots of 50 ms.

    The defaults are the reference of Dojo's quadruped example, its weights (impulses .01 per (N m s)^2), friction of
    .8, and less damping in the joints (5 N m s/rad there; with .5 here the robot falls over by itself). The pose of the
    base at the end is a constraint. Torques are limited to 33.5 N m.

    Args:
        speed: forward speed [m/s]; 0 trots on the spot (default None: 0.2, or that of `distance`).
        damping: damper of the joints [N m s/rad].
        step_height: lift of a swinging foot [m].
        height: height of the base, on average [m]; None for that of the neutral state.
        footholds: (4, 2) places of the feet FR, FL, RR, RL from the base, forward and to the left [m]; None for those
            of the neutral state.
        time_step: length of a knot [s].
        **settings: further arguments of `gaits.trot` (distance, period, duty, cycles, heading_rate, ...) and of
            `follow` (guess, periodic, ...), and `friction` and `contacts` of `models.quadruped`. With periodic=True a
            plan is one period long, unless `cycles` is given.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, or a foot that cannot reach its place.
    """
    return _quadruped(
        gaits.trot,
        time_step,
        damping,
        settings,
        speed=speed,
        step_height=step_height,
        height=height,
        footholds=footholds,
    )


@checked_numbers("problems")
def turn(*, heading_rate: float = 0.5, damping: float = 0.5, time_step: float = 0.02, **settings: Any) -> Problem:
    """The quadruped turns on the spot, trotting.

    Args:
        heading_rate: rate of the turn [rad/s]; positive turns left.
        damping: damper of the joints [N m s/rad].
        time_step: length of a knot [s].
        **settings: further arguments of `gaits.turn` and of `follow`, and of the model, as for `trot`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, or a foot that cannot reach its place.
    """
    return _quadruped(gaits.turn, time_step, damping, settings, heading_rate=heading_rate)


@checked_numbers("problems")
def pace(*, speed: float | None = None, damping: float = 0.5, time_step: float = 0.02, **settings: Any) -> Problem:
    """The quadruped paces, both feet of a side together.

    Args:
        speed: forward speed [m/s] (default None: 0.2, or that of `distance`).
        damping: damper of the joints [N m s/rad].
        time_step: length of a knot [s].
        **settings: further arguments of `gaits.pace` and of `follow`, and of the model, as for `trot`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, or a foot that cannot reach its place.
    """
    return _quadruped(gaits.pace, time_step, damping, settings, speed=speed)


@checked_numbers("problems")
def walk(*, speed: float | None = None, damping: float = 0.5, time_step: float = 0.05, **settings: Any) -> Problem:
    """The quadruped walks, one foot after the other.

    Args:
        speed: forward speed [m/s] (default None: 0.1, or that of `distance`).
        damping: damper of the joints [N m s/rad].
        time_step: length of a knot [s].
        **settings: further arguments of `gaits.walk` and of `follow`, and of the model, as for `trot`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, or a foot that cannot reach its place.
    """
    return _quadruped(gaits.walk, time_step, damping, settings, speed=speed)


@checked_numbers("problems")
def bound(
    *,
    speed: float | None = None,
    damping: float = 0.5,
    step_height: float = 0.08,
    time_step: float = 0.02,
    **settings: Any,
) -> Problem:
    """The quadruped bounds: hind feet, flight, front feet, flight.

    Args:
        speed: forward speed [m/s] (default None: 0.5, or that of `distance`).
        damping: damper of the joints [N m s/rad].
        step_height: lift of a swinging foot [m]. With less than the default, a foot is so low at the beginning and the
            end of its swing that plans drag it along the ground.
        time_step: length of a knot [s].
        **settings: further arguments of `gaits.bound` and of `follow`, and of the model, as for `trot`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, or a foot that cannot reach its place.
    """
    return _quadruped(gaits.bound, time_step, damping, settings, speed=speed, step_height=step_height)


@checked_numbers("problems")
def jump(
    *,
    distance: float = 0.3,
    height: float = 0.2,
    damping: float = 0.5,
    time_step: float = 0.02,
    refinement: int = 5,
    **settings: Any,
) -> Problem:
    """The quadruped jumps forward: standing, flight, standing.

    Replayed with steps of 1 ms, jumps planned with steps of 20 ms land up to 72 mm off; upward and backward jumps are
    the worst. As for `leap`, `ilqr` therefore ends with the refined problem, and jumps land within 4 mm. In the refined
    problem the height at the top is a constraint.

    Args:
        distance: displacement along x [m].
        height: rise of the base [m].
        damping: damper of the joints [N m s/rad].
        time_step: length of a knot [s].
        refinement: number of parts of every time step in the second half of `ilqr`; 1 for none.
        **settings: further arguments of `gaits.jump` (crouch, clearance, before, after) and of `follow`, and of the
            model, as for `trot`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, or a foot that cannot reach its place.
    """
    return with_apex(_quadruped(gaits.jump, time_step, damping, settings, distance=distance, height=height), refinement)


def with_apex(problem: Problem, refinement: int) -> Problem:
    """The problem of a jump with divided steps in its second half, where the height at the top is a constraint.

    Args:
        problem: the problem, which tracks a jump; it is changed.
        refinement: number of parts of every time step; 1 for none.

    Returns:
        The problem.

    Raises:
        ValueError: `refinement` is not a whole number >= 1, or the jump is higher than the inputs can throw the robot.
    """
    tracking = problem.specs[0][0]
    assert isinstance(tracking, Tracking)
    path = np.asarray(tracking.reference)
    top = int(path[:, 2].argmax())
    problem.refinement = whole_number("problems.jump(refinement=...)", refinement)
    _check_height(problem, float(path[top, 2] - path[0, 2]))
    problem.refined_constraints = (Goal(path[top], components=[2], knots=top),)
    return problem


def _check_height(problem: Problem, height: float) -> None:
    """Refuse jumps that inputs within their limits cannot reach; low ones that ask for little need no check."""
    sim = problem.sim
    if problem.control_limits is None or (demand(problem).max() <= _WITHIN and height <= sim.neutral()[2]):
        return
    most = _LIGHT * highest_rise(sim, problem.control_limits)
    if height > most:
        raise ValueError(
            f"problems.jump(height=...): at the limits of its inputs {sim.mechanism.name!r} rises by {most:.2f} m at "
            f"most, over the whole stroke of its legs; got {height:.2f} m"
        )


FOLLOW = ("guess", "periodic", "substeps", "control_limits", "place", "attitude", "effort")
_MODEL = ("friction", "contacts")


def check_settings(name: str, gait: Any, settings: dict[str, Any], own: tuple[str, ...]) -> None:
    """Refuse settings that neither the problem itself, nor its gait, nor `follow` has, with all that they have.

    Args:
        name: the problem.
        gait: function of `gaits`.
        settings: the given settings.
        own: names of the problem's own settings.

    Raises:
        TypeError: for an unknown setting.
    """
    known = list(dict.fromkeys([*settings_of(gait), *FOLLOW, *own]))
    for word in settings:
        if word not in known:
            hint = checks.nearest(word, known) or "."
            raise TypeError(f"problems.{name}(...): no setting {word!r}{hint} There are {', '.join(known)}")


def _quadruped(gait: Any, time_step: float, damping: float, settings: dict[str, Any], **keywords: Any) -> Problem:
    """The problem to follow a gait of the quadruped; `settings` are shared out between the model, gait and problem."""
    check_settings(gait.__name__, gait, settings, ("damping", "time_step", *_MODEL))
    follows: dict[str, Any] = {"control_limits": (-TORQUE_LIMIT, TORQUE_LIMIT)}
    follows |= {key: settings[key] for key in FOLLOW if key in settings}
    rest = {key: value for key, value in settings.items() if key not in (*FOLLOW, *_MODEL)}
    model = {key: settings[key] for key in _MODEL if key in settings}
    if follows.get("periodic") and gait is not gaits.jump:
        rest.setdefault("cycles", 1)
    h = time_step / whole_number("problems.follow(substeps=...)", follows.get("substeps", 1))
    sim = Simulator(models.quadruped(damper=damping, **model), time_step=h, kappa=PLANNED)
    return follow(gait(sim, **keywords, **rest), **follows)
