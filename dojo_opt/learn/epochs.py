"""learn: the checks and the loop that all algorithms of learning share."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import fields
from typing import Any

import numpy as np

from dojo_opt.learn.task import Task
from dojo_opt.learn.training_result import Learned, LearningProgress
from dojo_opt.planning.executors import check_executor
from dojo_opt.planning.same_robot import check_same_names, check_same_velocities
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


def _check_task(call: str, task: Task, before: Task | None) -> None:
    """Refuse a run of another robot, or with other control steps; one without its task, as of a file, is not judged."""
    if before is None or before is task:
        return
    check_same_names(call, task.sim.mechanism.dof_names, before.sim.mechanism.dof_names)
    check_same_velocities(call, task.sim, before.sim)
    if not np.isclose(task.knot_time, before.knot_time, rtol=1e-9):
        raise ValueError(f"{call}: expected control steps of {task.knot_time:g} s, got {before.knot_time:g} s")


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
        _check_task(f"{name}(resume=...)", search.task, resume.policy.task)
        _check_state(f"{name}(resume=...)", search.state(), resume.state)
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
