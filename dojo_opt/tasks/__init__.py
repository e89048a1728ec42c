"""Closed-loop tasks: MPC with a reference, ready to run on a plant; `idto` has the tasks of a published suite.

Tasks of reinforcement learning are in dojo_opt/learn.
"""

from typing import TYPE_CHECKING, Any

from dojo_opt.tasks import crisp, idto, jin
from dojo_opt.tasks.free_gait import free_gait_mpc
from dojo_opt.tasks.hopping import Hopping, hopper_mpc
from dojo_opt.tasks.legged import legged_mpc
from dojo_opt.tasks.plants import plant
from dojo_opt.tasks.trotting import quadruped_mpc
from dojo_opt.tasks.walking import humanoid_mpc
from sim.mechanism.checks import no_attribute

__all__ = [
    "Hopping",
    "crisp",
    "free_gait_mpc",
    "hopper_mpc",
    "humanoid_mpc",
    "idto",
    "jin",
    "legged_mpc",
    "plant",
    "quadruped_mpc",
]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """A name that is not there, with the ones that are."""
        raise no_attribute(__name__, name, __all__)
