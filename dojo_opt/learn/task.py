"""Task: the aim of a policy, as compiled functions of states and actions, and its motion in batches."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.learn.rollout_rows import END, OBSERVATION, REWARD, SURVIVAL
from dojo_opt.learn.task_functions import check_number, check_observation, compiled_call
from dojo_opt.planning.manifold import displace, tangent_layout
from dojo_opt.planning.residual import jit
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.simulator.contact_groups import ContactGroups
from sim.simulator.simulator import Simulator
from solvers.compiler import fingerprint, reduced, users_loop

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

__all__ = ["Task", "compile_functions", "never"]

_STEP = float(np.cbrt(np.finfo(float).eps))
_KEPT = 64  # loops


def never(x: Floats) -> bool:
    """No state ends an episode.

    Args:
        x: (nx,) state.

    Returns:
        False.
    """
    return False


# Numbers are copied one by one: assignments of slices took most of the time in which these loops compile.


def _observation_loop(observation: Callable[..., Any]) -> Any:
    @users_loop
    def evaluate(part, layout, xs, work, values, slopes):  # type: ignore[no-untyped-def]
        """For rows part[0] up to part[1]: values[i] = o(x_i), and slopes[i] = do/dx by central differences on the
        manifold, if it has rows.
        """
        n, nx, d = layout.shape[0], xs.shape[1], values.shape[1]
        for row in range(part[0], part[1]):
            for k in range(nx):
                work[0, k] = xs[row, k]
            observation(work[0, :nx], values[row])
            for i in range(n if slopes.shape[0] > 0 else 0):
                step = _STEP * max(1.0, abs(xs[row, layout[i]])) if layout[i] >= 0 else _STEP
                displace(layout, xs[row], i, step, work[0, :nx])
                observation(work[0, :nx], work[1, :d])
                displace(layout, xs[row], i, -step, work[0, :nx])
                observation(work[0, :nx], work[2, :d])
                displace(layout, xs[row], i, 0.0, work[0, :nx])
                for j in range(d):
                    slopes[row, j, i] = (work[1, j] - work[2, j]) / (2.0 * step)

    return evaluate


def _reward_loop(reward: Callable[..., Any]) -> Any:
    @users_loop
    def evaluate(part, layout, xs, acts, nexts, work, values, slopes):  # type: ignore[no-untyped-def]
        """Of a part, values[i] = r(x, a, x'), and slopes[i] = dr/d(dx, a, dx') by central differences, if it has
        rows.
        """
        n, nx, m = layout.shape[0], xs.shape[1], acts.shape[1]
        for row in range(part[0], part[1]):
            for k in range(nx):
                work[0, k], work[2, k] = xs[row, k], nexts[row, k]
            for k in range(m):
                work[1, k] = acts[row, k]
            values[row] = reward(work[0, :nx], work[1, :m], work[2, :nx])
            for i in range(2 * n + m if slopes.shape[0] > 0 else 0):
                total = 0.0
                for sign in (1.0, -1.0, 0.0):
                    if i < n:
                        displace(layout, xs[row], i, sign * _STEP, work[0, :nx])
                    elif i < n + m:
                        work[1, i - n] = acts[row, i - n] + sign * _STEP
                    else:
                        displace(layout, nexts[row], i - n - m, sign * _STEP, work[2, :nx])
                    if sign != 0.0:
                        total += sign * reward(work[0, :nx], work[1, :m], work[2, :nx])
                slopes[row, i] = total / (2.0 * _STEP)

    return evaluate


def _judge_loop(observation: Any, reward: Any, terminated: Any) -> Any:
    @users_loop
    def evaluate(x, a, after, out):  # type: ignore[no-untyped-def]
        """(r(x, a, x'), whether the episode ends in x'), and out = o(x')."""
        value, over = reward(x, a, after), terminated(after)
        observation(after, out)
        return value, over

    return evaluate


def _itself(function: Any) -> Any:
    return function


def _survival_loop(probability: Callable[..., Any]) -> Any:
    @users_loop
    def evaluate(part, layout, xs, work, values, slopes):  # type: ignore[no-untyped-def]
        """Of a part, values[i] = s(x_i), and slopes[i] = ds/dx by central differences on the manifold, if it has
        rows.
        """
        n, nx = layout.shape[0], xs.shape[1]
        for row in range(part[0], part[1]):
            for k in range(nx):
                work[0, k] = xs[row, k]
            values[row] = probability(work[0, :nx])
            for i in range(n if slopes.shape[0] > 0 else 0):
                step = _STEP * max(1.0, abs(xs[row, layout[i]])) if layout[i] >= 0 else _STEP
                displace(layout, xs[row], i, step, work[0, :nx])
                ahead = probability(work[0, :nx])
                displace(layout, xs[row], i, -step, work[0, :nx])
                slopes[row, i] = (ahead - probability(work[0, :nx])) / (2.0 * step)
                displace(layout, xs[row], i, 0.0, work[0, :nx])

    return evaluate


def _end_loop(terminated: Callable[..., Any]) -> Any:
    @users_loop
    def evaluate(part, xs, out):  # type: ignore[no-untyped-def]
        """Of a part, out[i] = whether the episode ends in x_i."""
        for row in range(part[0], part[1]):
            out[row] = terminated(xs[row])

    return evaluate


_loops: OrderedDict[Any, Any] = OrderedDict()  # by fingerprints, the most recently used last


def _loop(make: Callable[..., Any], *functions: Callable[..., Any]) -> Any:
    """The loop around functions; those that compile to the same code share it."""
    key = make, tuple(fingerprint(function) for function in functions)
    if key not in _loops:
        _loops[key] = make(*(jit(function) for function in functions))
        if len(_loops) > _KEPT:
            _loops.popitem(last=False)
    _loops.move_to_end(key)
    return _loops[key]


def compile_functions(
    observation: Callable[..., Any],
    reward: Callable[..., Any],
    terminated: Callable[..., Any] = never,
    survival_probability: Callable[..., Any] | None = None,
    batches: bool = True,
) -> None:
    """Compile the functions of a task, or load them, without a simulator.

    Args:
        observation: as of a Task.
        reward: as of a Task.
        terminated: as of a Task.
        survival_probability: as of a Task.
        batches: whether to include the loops over many states that batches and algorithms need (default True).
    """
    row, rows, stack, layout = np.zeros(1), np.zeros((1, 1)), np.zeros((1, 1, 1)), np.zeros(1, dtype=np.int64)
    _loop(_judge_loop, observation, reward, terminated).compile_for(row, row, row, row)
    _loop(_itself, observation).compile_for(row, row)
    if batches:
        part = 0, 0
        _loop(_observation_loop, observation).compile_for(part, layout, rows, rows, rows, stack)
        _loop(_reward_loop, reward).compile_for(part, layout, rows, rows, rows, rows, row, rows)
        _loop(_end_loop, terminated).compile_for(part, rows, np.zeros(1, dtype=np.bool_))
        if survival_probability is not None:
            _loop(_survival_loop, survival_probability).compile_for(part, layout, rows, rows, row, rows)


@dataclass(frozen=True)
class Task:
    """The observations and the reward of a policy, and the ends of episodes. Actions are in [-1, 1].

    The functions are compiled, as by `dojo.jit`, and differentiated by central differences on the manifold of
    states; they must not write into their arguments other than `out`. Those of a user are called once in the neutral
    state, uncompiled, and refused by name if they do not fit. With a command, such as a velocity to keep, the
    state x of the task is that of the simulator, followed by the command: x[sim.nx:]. The forces of contacts come last:
    for each of the `touch` groups (6,), force [N] and torque about the centre of mass [N m], world axes, in the time
    step before; zero at first, and not differentiated.

    Attributes:
        sim: simulator.
        substeps: its time steps per action, which is held.
        observation: function (x (nx,), out) that writes an observation into out.
        observations: number of entries of an observation.
        reward: function (x, a (nu,), x') of the state before, the action, and the state after; a number.
        low: (nu,) inputs of the action -1 [N, N m].
        high: (nu,) inputs of the action 1.
        start: function of a generator that draws a first state (nx,).
        terminated: function of x that returns whether an episode ends there (default `never`).
        survival: reward of every step that does not end the episode, beside `reward` (default 0).
        steps: actions after which an episode is cut off (default 1000).
        name: its name (default "task").
        survival_probability: function of x with a smooth probability, from 0 to 1, that the episode goes on there: near
            1 in safe states, small where `terminated` is true. The end of an episode is not differentiable: `shac`
            multiplies the rewards after x by this probability instead, and begins another episode where it is below
            10 % (default None: 1 or 0).
        commands: number of entries of a command (default 0).
        command: function of a generator that draws a command (commands,) (default None).
        touch: groups of names of contacts, whose forces end the state (default (): none).
        hold: actions after which a command is drawn anew (default None: never; random search does not, either).
        settings: options of `shac` that suit the task; those of a call come first (default: none).
    """

    sim: Simulator
    substeps: int
    observation: Callable[..., Any]
    observations: int
    reward: Callable[..., Any]
    low: Floats
    high: Floats
    start: Callable[[np.random.Generator], Floats]
    terminated: Callable[..., Any] = never
    survival: float = 0.0
    steps: int = 1000
    name: str = "task"
    survival_probability: Callable[..., Any] | None = None
    commands: int = 0
    command: Callable[[np.random.Generator], Floats] | None = None
    touch: Sequence[Sequence[str]] = ()
    hold: int | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if not isinstance(self.sim, Simulator):
            raise TypeError(f"Task(sim): expected a Simulator, got {self.sim!r}")
        for name in ("substeps", "observations", "steps"):
            checks.whole_number(f"Task({name}=...)", getattr(self, name))
        for name in ("observation", "reward", "start", "terminated"):
            if not callable(getattr(self, name)):
                raise TypeError(f"Task({name}=...): expected a function, got {getattr(self, name)!r}")
        for name in ("survival_probability", "command"):
            if not (getattr(self, name) is None or callable(getattr(self, name))):
                raise TypeError(f"Task({name}=...): expected a function or None, got {getattr(self, name)!r}")
        checks.whole_number("Task(commands=...)", self.commands, 0)
        if (self.command is None) != (self.commands == 0):
            raise ValueError("Task(commands=..., command=...): expected both or none")
        if self.hold is not None:
            checks.whole_number("Task(hold=...)", self.hold)
        for name in ("low", "high"):
            object.__setattr__(self, name, checks.array(f"Task({name}=...)", getattr(self, name), (self.sim.nu,)))
        ContactGroups(self.sim, self.touch)  # checks the names
        if self.touch and not self.sim.has_stepper:
            raise ValueError(
                "Task(touch=...): expected a simulator of order 2 without an accuracy, whose steps have their contacts "
                f"in batches, got {self.sim!r}"
            )
        if not np.all(self.low < self.high):
            raise ValueError(f"Task(low=..., high=...): expected low < high, got {self.low} and {self.high}")
        self._check_functions()

    def _check_functions(self) -> None:
        """Refuse functions of the user that do not take or return what they have to."""
        x, a = np.concatenate([self.sim.neutral(), np.zeros(self.nx - self.sim.nx)]), np.zeros(self.sim.nu)
        check_observation(self.observation, x, self.observations)
        check_number("reward", self.reward, {"x": x, "a": a, "after": x}, "one number")
        check_number("terminated", self.terminated, {"x": x}, "True or False")
        if self.survival_probability is not None:
            check_number("survival_probability", self.survival_probability, {"x": x}, "one number")

    def __reduce__(self) -> Any:
        """By its fields; functions by their code, so that other processes need not import them."""
        return reduced(Task, {f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def _rebuild(cls, **given: Any) -> Task:
        """From the data of `__reduce__`."""
        return cls(**given)

    @property
    def nx(self) -> int:
        """Size of a state: that of the simulator, of a command, and of forces."""
        return self.sim.nx + self.commands + 6 * len(self.touch)

    @cached_property
    def touch_groups(self) -> ContactGroups | None:
        """The groups of contacts whose forces end the state."""
        return ContactGroups(self.sim, self.touch) if self.touch else None

    @property
    def knot_time(self) -> float:
        """Time of an action [s]."""
        return self.substeps * self.sim.time_step

    @cached_property
    def layout(self) -> Any:
        """Addresses of the tangent components; see manifold.py."""
        return tangent_layout(self.sim, self.sim.neutral())

    @cached_property
    def _observation_loop(self) -> Any:
        return _loop(_observation_loop, self.observation)

    @cached_property
    def _observation(self) -> Any:
        return _loop(_itself, self.observation)

    @cached_property
    def _reward_loop(self) -> Any:
        return _loop(_reward_loop, self.reward)

    @cached_property
    def _end_loop(self) -> Any:
        return _loop(_end_loop, self.terminated)

    @cached_property
    def _judge_loop(self) -> Any:
        return _loop(_judge_loop, self.observation, self.reward, self.terminated)

    @cached_property
    def _survival_loop(self) -> Any:
        assert self.survival_probability is not None
        return _loop(_survival_loop, self.survival_probability)

    @cached_property
    def addresses(self) -> tuple[int, int, int, int]:
        """Of the loops, for kernels: observation, reward, end of an episode, and survival, 0 without."""
        loops = [("observation", OBSERVATION, self._observation_loop), ("reward", REWARD, self._reward_loop)]
        loops.append(("terminated", END, self._end_loop))
        if self.survival_probability is not None:
            loops.append(("survival_probability", SURVIVAL, self._survival_loop))
        observation, reward, end, *survival = (compiled_call(name, call.address, loop) for name, call, loop in loops)
        return observation, reward, end, *(survival or [0])

    def room(self, parts: int) -> Floats:
        """Scratch of the loops, when they are called by their address.

        Args:
            parts: number of parts of the rows.

        Returns:
            (parts, 3, ...) zeros.
        """
        return np.zeros((parts, *self._work.shape))

    @cached_property
    def _work(self) -> Floats:
        return np.zeros((3, max(self.nx, self.sim.nu, self.observations)))

    def inputs(self, actions: Floats) -> Floats:
        """(..., nu) inputs of actions in [-1, 1] [N, N m].

        Args:
            actions: (..., nu) in [-1, 1].

        Returns:
            (..., nu) inputs [N, N m].
        """
        middle, half = self._range
        return middle + half * actions

    @cached_property
    def _range(self) -> tuple[Floats, Floats]:
        """Middle and half of the range of inputs."""
        return 0.5 * (self.high + self.low), 0.5 * (self.high - self.low)

    def observe(self, xs: Floats, slopes: bool = False) -> tuple[Floats, Floats]:
        """(observations (n, no), their derivatives (n, no, ndx), or none).

        Args:
            xs: (n, nx) states.
            slopes: whether to compute the derivatives (default False).

        Returns:
            (n, no) observations, and (n, no, ndx) derivatives, or (0, no, ndx).
        """
        n = len(xs)
        values = np.zeros((n, self.observations))
        out = np.zeros((n if slopes else 0, self.observations, self.sim.ndx))
        compiled_call("observation", self._observation_loop, (0, n), self.layout, xs, self._work.copy(), values, out)
        return values, out

    def observe_one(self, x: Floats) -> Floats:
        """The observation in one state.

        Args:
            x: (nx,) state.

        Returns:
            (no,) observation.
        """
        out = np.zeros(self.observations)
        compiled_call("observation", self._observation, np.array(x), out)
        return out

    def rewards(self, xs: Floats, actions: Floats, nexts: Floats, slopes: bool = False) -> tuple[Floats, Floats]:
        """(rewards (n,) without those of survival, their derivatives (n, ndx + nu + ndx), or none).

        Args:
            xs: (n, nx) states.
            actions: (n, nu) in [-1, 1].
            nexts: (n, nx) states after the actions.
            slopes: whether to compute the derivatives (default False).

        Returns:
            (n,) rewards, and (n, ndx + nu + ndx) derivatives, or none.
        """
        n, width = len(xs), 2 * self.sim.ndx + self.sim.nu
        values, out = np.zeros(n), np.zeros((n if slopes else 0, width))
        work = self._work.copy()
        compiled_call("reward", self._reward_loop, (0, n), self.layout, xs, actions, nexts, work, values, out)
        return values, out

    def ends(self, xs: Floats) -> Flags:
        """(n,) whether episodes end in these states.

        Args:
            xs: (n, nx) states.

        Returns:
            (n,) flags.
        """
        out = np.zeros(len(xs), dtype=np.bool_)
        compiled_call("terminated", self._end_loop, (0, len(xs)), xs, out)
        return out

    def judge(self, x: Floats, action: Floats, after: Floats) -> tuple[Floats, float, bool]:
        """The outcome of one action: (observation (no,), reward, whether the episode ends).

        Args:
            x: (nx,) state.
            action: (nu,) in [-1, 1].
            after: (nx,) state after the action.

        Returns:
            The observation after it, the reward with that of survival, and whether the episode ends.
        """
        observation, end = np.zeros(self.observations), np.array(after)  # copies: a function may write into them
        three = "observation=..., reward=..., terminated"
        reward, over = compiled_call(three, self._judge_loop, np.array(x), np.array(action), end, observation)
        return observation, float(reward) + (0.0 if over else self.survival), bool(over)

    def survives(self, xs: Floats, ends: Flags, slopes: bool = False) -> tuple[Floats, Floats]:
        """(probabilities (n,) that episodes go on, their derivatives (n, ndx), or none).

        Args:
            xs: (n, nx) states.
            ends: (n,) whether episodes end there.
            slopes: whether to compute the derivatives (default False).

        Returns:
            (n,) numbers from 0 to 1, and (n, ndx) derivatives: zero without `survival_probability`; or (0, ndx).
        """
        values: Floats = 1.0 - ends.astype(np.float64)
        out = np.zeros((len(xs) if slopes else 0, self.sim.ndx))
        if self.survival_probability is not None:
            loop, work = self._survival_loop, self._work.copy()
            compiled_call("survival_probability", loop, (0, len(xs)), self.layout, xs, work, values, out)
        return values, out

    def first(self, rng: np.random.Generator) -> Floats:
        """A first state, with a command where there is one.

        Args:
            rng: generator.

        Returns:
            (nx,) state.
        """
        x = checks.array("Task(start=...)", self.start(rng), (self.sim.nx,))
        command = np.zeros(0) if self.command is None else self._command(rng)
        return np.concatenate([x, command, np.zeros(6 * len(self.touch))]) if self.nx > self.sim.nx else x

    def starts(self, rngs: Any) -> Floats:
        """First states (n, nx), each from its own generator.

        Args:
            rngs: generators, one for each state.

        Returns:
            (n, nx) states.
        """
        return np.array([self.first(rng) for rng in rngs])

    def _command(self, rng: np.random.Generator) -> Floats:
        """A new command (commands,)."""
        assert self.command is not None
        return checks.array("Task(command=...)", self.command(rng), (self.commands,))

    def redraw(self, xs: Floats, ages: Any, rngs: Any) -> None:
        """Draw the commands of states anew where their episodes have lasted a multiple of `hold` actions.

        Args:
            xs: (n, nx) states, written in place.
            ages: (n,) actions since the episodes began.
            rngs: generators, one for each state.
        """
        if self.hold is not None and self.command is not None:
            for i in np.flatnonzero((ages > 0) & (ages % self.hold == 0)):
                xs[i, self.sim.nx : self.sim.nx + self.commands] = self._command(rngs[i])
