"""Learning: tasks, policies, and algorithms that find policies, with and without derivatives of the simulator.

If Gymnasium is installed, registration.py registers the tasks with it: `gymnasium.make("dojo/HalfCheetah-v0")`.
"""

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from dojo_opt.learn.dojo_tasks import ant_ars, quadruped_sampling, sampled_gait
from dojo_opt.learn.evaluation import Evaluation, evaluate
from dojo_opt.learn.gymnasium_tasks import ant, cartpole, half_cheetah, hopper, humanoid, pendulum, walker2d
from dojo_opt.learn.imitate import ImitationOptions, imitate
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.policy_rollout import PolicyGradient, PolicyRollout, roll_policy_batch
from dojo_opt.learn.policy_search import GradientSearchOptions, RandomSearchOptions, ars, gradient_search
from dojo_opt.learn.randomization import Randomization
from dojo_opt.learn.seed_runs import best_of, seeds
from dojo_opt.learn.shac import ShacOptions, shac
from dojo_opt.learn.swimmer_task import swimmer
from dojo_opt.learn.task import Task
from dojo_opt.learn.training_result import Learned
from dojo_opt.learn.velocity_task import go2, quadruped, velocity_error
from dojo_opt.learn.waypoint_tasks import quadrotor, uuv, youbot
from sim.mechanism.checks import no_attribute
from sim.mechanism.renamed import warn_renamed

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """The old name of a member, until version 0.2."""
        if name == "Randomisation":
            warn_renamed("dojo.learn.Randomisation", "dojo.learn.Randomization")
            return Randomization
        raise no_attribute(__name__, name, __all__)


if find_spec("gymnasium") is not None:
    from dojo_opt.learn.registration import register

    register()

__all__ = [
    "Evaluation",
    "GradientSearchOptions",
    "ImitationOptions",
    "Learned",
    "LearnedPolicy",
    "PolicyGradient",
    "PolicyRollout",
    "RandomSearchOptions",
    "Randomization",
    "ShacOptions",
    "Task",
    "ant",
    "ant_ars",
    "ars",
    "best_of",
    "cartpole",
    "evaluate",
    "go2",
    "gradient_search",
    "half_cheetah",
    "hopper",
    "humanoid",
    "imitate",
    "pendulum",
    "quadrotor",
    "quadruped",
    "quadruped_sampling",
    "roll_policy_batch",
    "sampled_gait",
    "seeds",
    "shac",
    "swimmer",
    "uuv",
    "velocity_error",
    "walker2d",
    "youbot",
]
