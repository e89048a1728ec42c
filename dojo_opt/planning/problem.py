"""Problem: a simulator, a start, a horizon, costs, constraints and limits, checked once and bound to arrays."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.component_names import chosen_components
from dojo_opt.planning.manifold import tangent_layout
from dojo_opt.planning.term import Spec, check_order, largest_violation, numbers, state_table, table
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.joint import WORLD
from sim.mechanism.memory_limit import check_room
from sim.simulator.simulator import Simulator
from solvers.types import Matrix, Vector

__all__ = ["REPLAY_ACCURACY", "Problem"]

REPLAY_ACCURACY = 1e-5  # [m/s, rad/s] of `Plan.replay`, with which `refined_accuracy` compares a plan

_IN_USE: set[int] = set()  # problems whose terms are written into at the moment, by id
_IN_USE_LOCK = Lock()


def _check_simulator(call: str, sim: Any) -> None:
    """Refuse what has no states, inputs and horizons."""
    if not all(hasattr(sim, name) for name in ("nx", "ndx", "nu", "integrate", "horizon")):
        raise TypeError(f"{call}: expected a Simulator, got {checks.shown(sim)}")


def control_limits_of(limits: tuple[ArrayLike, ArrayLike] | None, sim: Simulator) -> tuple[Vector, Vector] | None:
    """Control limits as two (nu,) arrays, infinite where free; those of the inputs where none are given."""
    nu = sim.nu
    if limits is None:
        limits = getattr(sim.mechanism, "input_limits", None)
        if limits is None or not np.isfinite(limits).any():
            return None
    if not hasattr(limits, "__len__") or len(limits) != 2:
        raise ValueError(f"Problem(control_limits=...): expected (lower, upper), got {limits!r}")
    lo, hi = (numbers("Problem(control_limits=...)", b) for b in limits)
    for side, bound in (("lower", lo), ("upper", hi)):
        if bound.shape not in ((), (nu,)) or np.any(np.isnan(bound)):
            raise ValueError(
                f"Problem(control_limits=...): expected a number or shape ({nu},) without NaN as {side} limit, got "
                f"shape {bound.shape}: {bound}"
            )
    lo, hi = (np.broadcast_to(b, (nu,)).copy() for b in (lo, hi))
    if np.any(lo > hi):
        i = int(np.argmax(lo > hi))
        raise ValueError(f"Problem(control_limits=...): expected lower <= upper, got [{lo[i]}, {hi[i]}] of control {i}")
    check_order("Problem(control_limits=...)", lo, hi, [lo, hi])
    return lo, hi


def _components(call: str, chosen: Any, sim: Simulator) -> Any:
    """Component numbers as an array; None for none, True for all."""
    if chosen is None or chosen is False:
        return None
    return np.unique(chosen_components(call, None if chosen is True else chosen, sim))


def _accuracy(asked: float | None, sim: Simulator) -> float | None:
    """A checked accuracy of plans, of a mechanism whose steps can have one."""
    if asked is None:
        return None
    least = 10.0 * REPLAY_ACCURACY  # the replay is the reference
    number = checks.number("Problem(refined_accuracy=...)", asked, at_least=least)
    sim.replace(order=2, accuracy=REPLAY_ACCURACY)
    return number


def _advice(sim: Simulator) -> str:
    """A sentence about the ground of a robot that the world holds, which may not need it."""
    joints, contacts = (getattr(sim.mechanism, name, ()) for name in ("joints", "contacts"))
    if not contacts or any(joint.parent == WORLD and joint.ntrans for joint in joints):
        return ""
    return (
        "Plans begin with smooth contacts, which push from afar: where the robot stays away from the ground, omit its "
        "contacts, as load_urdf(ground=False) does."
    )


def _terms(given: Any) -> tuple[Spec, ...]:
    """One term, or several, as a tuple."""
    return tuple(given) if isinstance(given, Iterable) else (given,)


class Problem:
    """Minimise the sum of costs over x (T + 1, nx) and u (T, nu), from x_0 = start, along the motion of the simulator.

    Args:
        sim: the simulator.
        start: (nx,) first state.
        horizon: number T of knots.
        cost: one cost or several, see `dojo.cost`.
        constraints: one constraint or several, see `dojo.constraint`.
        control_limits: (lower, upper), numbers or (nu,) [N, N m], which hold at every iteration (default None:
            those of the inputs of the mechanism, as a file gives them; (-np.inf, np.inf) is none).
        substeps: steps of `sim.time_step` per knot, with the input held (default 1).
        controls0: (T, nu) guess of the inputs [N, N m], clipped to `control_limits` (default zero).
        states0: (T + 1, nx) guess of the states, which need not be consistent: the planner closes its gaps (default
            None: the rollout of the inputs).
        free_start: tangent components of the start that the planner may change, by number or name, or True for all;
            `start` is then a guess (default None: a fixed start). With the constraint `Periodic`, such a plan is a
            periodic gait.
        refinement: with more than 1, `ilqr` ends by planning `refined(refinement)` from its first plan (default 1).
        refined_accuracy: largest difference of a coordinate between the plan and `Plan.replay(accuracy=1e-5)`, at any
            knot, at least 1e-4 [m, rad]: `ilqr` ends by planning with 2, 4, ..., 32 times as many time steps, or as
            many times `refinement`, until the plan is as accurate as this (default None: without replay).
        refined_constraints: one constraint or several of that problem only, which do not help from a distant guess.
        gain_regularization: weight of the controls in the gains of the plan, beyond that in the plan itself, in units
            of the mean of their weights (default 0). Where the cost hardly weighs the controls, gains are so high that
            the plan may not survive shorter time steps.
        advice: what to change where no plan is found: a sentence for the message of such a plan (default: one about the
            ground, of robots that the world holds above it).

    Attributes:
        wanted: (T, nu) `controls0` before it was clipped [N, N m].

    Raises:
        TypeError: `sim` is not a Simulator, or an entry of `cost` or `constraints` is not a term.
        ValueError: for a wrong shape, a number that is not finite, or a horizon that exceeds the memory.
    """

    def __init__(  # noqa: PLR0913
        self,
        sim: Simulator,
        start: ArrayLike,
        horizon: int,
        *,
        cost: Spec | Sequence[Spec] = (),
        constraints: Spec | Sequence[Spec] = (),
        control_limits: tuple[ArrayLike, ArrayLike] | None = None,
        substeps: int = 1,
        controls0: ArrayLike | None = None,
        states0: ArrayLike | None = None,
        free_start: Any = None,
        refinement: int = 1,
        refined_accuracy: float | None = None,
        refined_constraints: Spec | Sequence[Spec] = (),
        gain_regularization: float = 0.0,
        advice: str = "",
    ) -> None:
        _check_simulator("Problem(sim)", sim)
        self.sim = sim
        self.advice = checks.name_or("Problem(advice=...)", advice, _advice(sim))
        call = "Problem(gain_regularization=...)"
        self.gain_regularization = checks.number(call, gain_regularization, at_least=0.0)
        self.horizon = whole_number("Problem(horizon=...)", horizon)
        self.substeps = whole_number("Problem(substeps=...)", substeps)
        self.refinement = whole_number("Problem(refinement=...)", refinement)
        self.refined_accuracy = _accuracy(refined_accuracy, sim)
        self._check_memory()
        start = numbers("Problem(start=...)", start)
        if start.shape != (sim.nx,):
            raise ValueError(f"Problem(start=...): expected shape ({sim.nx},), got {start.shape}")
        self.layout = tangent_layout(sim, sim.neutral())
        self.start: Vector = state_table("Problem(start=...)", start, 1, sim.nx, self.layout)[0]
        self.free_start = _components("Problem(free_start=...)", free_start, sim)
        self.specs, self.refined_constraints = (_terms(cost), _terms(constraints)), _terms(refined_constraints)
        arguments = {
            "cost": self.specs[0],
            "constraints": self.specs[1],
            "refined_constraints": self.refined_constraints,
        }
        for argument, specs in arguments.items():
            for i, spec in enumerate(specs):
                kind = argument.removeprefix("refined_").removesuffix("s")
                if not hasattr(spec, "bind") or getattr(spec, "kind", kind) != kind:
                    found = f"a {type(spec).__name__}, not a term of dojo.{kind}"
                    raise TypeError(f"Problem({argument}=...): entry {i} is {found}")
        self.bind()
        self.control_limits = control_limits_of(control_limits, sim)
        self.controls0 = self.check_controls("Problem(controls0=...)", 0.0 if controls0 is None else controls0)
        self.wanted = self.controls0
        if self.control_limits is not None:
            self.controls0 = np.clip(self.wanted, *self.control_limits)
        self.states0 = None if states0 is None else self.check_states("Problem(states0=...)", states0)

    def __repr__(self) -> str:
        knots = f"{self.horizon} knots of {self.knot_time:g} s"
        terms = [type(spec).__name__ for spec in (*self.specs[0], *self.specs[1])]
        name = getattr(self.sim.mechanism, "name", type(self.sim).__name__)
        return f"Problem({name}, {knots}, {', '.join(terms) or 'no terms'})"

    def _check_memory(self) -> None:
        """Refuse a horizon whose derivatives alone are larger than the memory of the machine."""
        size = self.sim.ndx + self.sim.nu
        each = 8.0 * (2 * self.sim.ndx * size + 2 * size**2)  # A, B, twice; H, and its copy
        check_room("Problem(horizon=...)", self.horizon + 1, each, "plan fewer knots, and go on from the last", "knots")

    def refined(self, count: int = 5) -> Problem:
        """The same problem with shorter time steps: same knots, inputs and terms, and `refined_constraints`.

        A plan with long steps may exploit the few times at which a foot touches the ground, and stumble with shorter
        steps. `ilqr(problem.refined(5), warm_start=plan)` adapts it to them.

        Args:
            count: number by which every time step is divided.

        Returns:
            The new problem.

        Raises:
            ValueError: `count` is not a whole number >= 1.
        """
        count = whole_number("Problem.refined(count)", count)
        finer = copy.copy(self)
        finer.sim = self.sim.replace(time_step=self.sim.time_step / count)
        finer.substeps = self.substeps * count
        finer.refinement, finer.refined_accuracy = 1, None
        finer.specs, finer.refined_constraints = (self.specs[0], (*self.specs[1], *self.refined_constraints)), ()
        finer.bind()
        return finer

    def only_refined_constraints(self) -> Problem:
        """The same problem, with the `refined_constraints` in place of its own constraints.

        Returns:
            The new problem, with its own time steps.
        """
        other = copy.copy(self)
        other.specs, other.refined_constraints = (self.specs[0], self.refined_constraints), ()
        other.bind()
        return other

    def _motion(self, call: str, xs: ArrayLike, us: ArrayLike) -> tuple[Matrix, Matrix]:
        """Checked states (T + 1, nx) and inputs (T, nu)."""
        states = checks.array(f"{call}(xs)", xs, (self.horizon + 1, self.sim.nx))
        return states, checks.array(f"{call}(us)", us, (self.horizon, self.sim.nu))

    def with_own_terms(self, sim: Simulator | None = None, *, fixed_start: bool = True) -> Problem:
        """The same problem with a simulator and terms of its own, for loops that write into them.

        Args:
            sim: the simulator; by default a copy of the one that the problem has.
            fixed_start: whether a free start becomes a fixed one.

        Returns:
            The new problem.

        Raises:
            TypeError: `sim` is no simulator.
        """
        _check_simulator("Problem.with_own_terms(sim)", self.sim if sim is None else sim)
        fixed = checks.flag("Problem.with_own_terms(fixed_start=...)", fixed_start)
        own = copy.copy(self)
        own.sim = self.sim.replace() if sim is None else sim
        own.free_start = None if fixed else self.free_start
        own.bind()
        return own

    @contextmanager
    def exclusive(self) -> Iterator[Problem]:
        """This problem; for a second user at the same time, such as another thread, one with terms of its own.

        Returns:
            A context with the problem whose terms may be written into.
        """
        with _IN_USE_LOCK:
            free = id(self) not in _IN_USE
            _IN_USE.add(id(self))
        if not free:
            yield self.with_own_terms(self.sim, fixed_start=False)
            return
        try:
            yield self
        finally:
            _IN_USE.discard(id(self))

    def bind(self) -> None:
        """Make the terms of `specs` anew, with arrays and compiled functions of their own.

        Raises:
            ValueError: a field of a term is refused, or a cost ties the end to the start.
        """
        self.costs = [spec.bind(self.sim, self.horizon, self.layout) for spec in self.specs[0]]
        for i, term in enumerate(self.costs):
            if hasattr(term, "coupling"):
                raise ValueError(
                    f"Problem(cost=...): entry {i} ties the end to the start, so it has to be a constraint"
                )
        self.constraints = [spec.bind(self.sim, self.horizon, self.layout) for spec in self.specs[1]]

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("costs", "constraints")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.bind()  # loops around a user's function cannot be pickled

    @property
    def knot_time(self) -> float:
        """Length of a knot [s]."""
        return float(self.sim.time_step * self.substeps)

    def check_controls(self, call: str, controls: ArrayLike) -> Matrix:
        """Check inputs of this problem.

        Args:
            call: the call that an error names.
            controls: (T, nu) inputs [N, N m], or an array that broadcasts to that shape.

        Returns:
            A copy (T, nu).

        Raises:
            ValueError: for a wrong shape, or a number that is not finite.
        """
        shape = checks.shape(call, controls)
        if len(shape) == 2 and shape != (self.horizon, self.sim.nu):
            raise ValueError(f"{call}: expected shape ({self.horizon}, {self.sim.nu}), got {shape}")
        return table(call, controls, self.horizon, self.sim.nu)

    def check_states(self, call: str, states: ArrayLike) -> Matrix:
        """Check states of this problem.

        Args:
            call: the call that an error names.
            states: (T + 1, nx) states.

        Returns:
            A copy (T + 1, nx), with the start in its first row unless that is free.

        Raises:
            ValueError: for a wrong shape, or a number that is not finite.
        """
        shape = checks.shape(call, states)
        if shape != (self.horizon + 1, self.sim.nx):
            raise ValueError(f"{call}: expected shape ({self.horizon + 1}, {self.sim.nx}), got {shape}")
        checked = table(call, states, self.horizon + 1, self.sim.nx)
        if self.free_start is None:
            checked[0] = self.start
        return checked

    def cost(self, xs: Matrix, us: Matrix) -> float:
        """Sum of the costs of a trajectory, without constraints.

        Args:
            xs: (T + 1, nx) states.
            us: (T, nu) inputs [N, N m].

        Returns:
            The cost.

        Raises:
            ValueError: for a wrong shape, or a number that is not finite.
        """
        xs, us = self._motion("Problem.cost", xs, us)
        with self.exclusive() as own:
            return sum(term.value(xs, us) for term in own.costs)

    def violation(self, xs: Matrix, us: Matrix) -> float:
        """Largest violation of a constraint along a trajectory.

        Args:
            xs: (T + 1, nx) states.
            us: (T, nu) inputs [N, N m].

        Returns:
            The violation [unit of the residual]; 0 without constraints.

        Raises:
            ValueError: for a wrong shape, or a number that is not finite.
        """
        xs, us = self._motion("Problem.violation", xs, us)
        with self.exclusive() as own:
            return largest_violation(own.constraints, xs, us)
