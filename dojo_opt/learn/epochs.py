"""learn: the checks and the loop that all algorithms of learning share."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import fields
from typing import Any

import numpy as np

from dojo_opt.learn.task import Task
from dojo_opt.learn.training_result import Learned, LearningProgress
from dojo_opt.planning.executors import check_executor
from dojo_opt.planning.same_robot import check_same_names
from sim.mechanism import checks
from sim.mechanism.renamed import renamed_keywords
from solvers.status import Status

__all__ = ["learn"]

_UNTRAINED = "All epochs are done, but the policy before the first is the best. "


def learn(
    search: Any,
    settings: Any,
    task: Task,
    seed: int,
    resume: Learned | None,
    given: dict[str, Any],
    executor: Executor | None = None,
) -> Learned:
    """Run an algorithm, a class made of a task, its settings and a seed, with the given fields of these settings."""
    name = search.algorithm
    if not isinstance(task, Task):
        raise TypeError(f"{name}(task): expected a Task, got {task!r}")
    renamed_keywords(name, given, {"randomisation": "randomization"})
    checks.keywords(f"{name}(...)", given, [f.name for f in fields(settings)])
    check_executor(name, executor)
    if not (resume is None or isinstance(resume, Learned)):
        raise TypeError(f"{name}(resume=...): expected a Learned, got {resume!r}")
    run = search(task, settings(**given), checks.whole_number(f"{name}(seed=...)", seed, 0))
    run.executor = executor
    return _run_epochs(run, resume)


def _check_task(call: str, own: dict[str, Any], given: dict[str, Any]) -> None:
    """Refuse a run of another robot, or with other control steps, by what the state of a run tells of its task."""
    check_same_names(call, own["dofs"], given["dofs"])
    if bool(own["mean_over"]) != bool(given["mean_over"]):
        kinds = "at the nodes", "over time steps"
        wanted, got = (kinds[bool(task["mean_over"])] for task in (own, given))
        raise ValueError(f"{call}: expected velocities {wanted}, got those {got}; use a simulator of the same order")
    steps = own["control_step"], given["control_step"]
    if not np.isclose(*steps, rtol=1e-9):
        raise ValueError(f"{call}: expected control steps of {steps[0]:g} s, got {steps[1]:g} s")


def _check_state(call: str, own: dict[str, Any], given: dict[str, Any]) -> None:
    """Refuse a state to resume from that is not like one's own, as of a damaged file or of other options."""
    for name, value in own.items():
        there: Any = given.get(name)
        like = isinstance(there, int | float if isinstance(value, int | float) else type(value))
        if not like or (isinstance(value, np.ndarray) and value.shape != there.shape):
            raise ValueError(f"{call}: its {name!r} is missing, or does not fit the options")


def _run_epochs(search: Any, resume: Learned | None) -> Learned:
    """All epochs of an algorithm, evaluated before the first and at its marks, from the start or from where `resume`
    ended.
    """
    o, name = search.options, search.algorithm
    if resume is not None:
        if resume.algorithm != name or resume.seed != search.seed or (
            resume.policy.weights.shape != search.policy.weights.shape
        ):  # fmt: skip
            raise ValueError(
                f"{name}(resume=...): expected a run of {name} with seed {search.seed} and this policy, got {resume!r}"
            )
        own = search.state()
        _check_state(f"{name}(resume=...)", own, {"task": own["task"], **resume.state})  # older files have no task
        _check_task(f"{name}(resume=...)", own["task"], {**own["task"], **resume.state.get("task", {})})
        search.resume(resume)
    progress = LearningProgress(o, resume.history if resume else [], resume.seconds if resume else 0.0)
    count = min(o.evaluations, o.epochs)
    marks = {round((k + 1) * o.epochs / count) for k in range(count)} | {o.epochs}
    status, state = Status.SOLVED, search.state()
    try:
        if resume is None:
            search.assess()
        while search.epoch < o.epochs and status == Status.SOLVED:
            record = search.train()
            if search.epoch in marks:
                record["evaluated"] = search.assess()
            state = search.state()
            status = progress.add(**record)
    except KeyboardInterrupt:  # in the middle of an epoch: resume from its start
        status = Status.INTERRUPTED
    success = search.epoch >= o.epochs  # a run that is resumed may have done more
    if not np.isfinite(search.best):
        search.assess()
    status = Status.SOLVED if success else status
    if not np.isfinite(search.best):  # a reward that is no number is none to learn from
        success, status = False, Status.NOT_FINITE
    untrained = success and search.chosen_at == 0
    message = _UNTRAINED + search.advice if untrained else progress.message(status)
    return Learned(
        search.chosen, success, status, message, name, search.seed, search.best, search.steps,
        search.unsolved, search.infinite, progress.seconds, progress.records, state,
    )  # fmt: skip
