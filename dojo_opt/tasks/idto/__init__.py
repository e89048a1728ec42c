"""Tasks of IDTO (Kurtz, Castro, Onol, Lin: arXiv 2309.01813) with hard contact: costs, horizons and rates are theirs.

Every builder returns a `SuiteTask`:

    task = dojo.tasks.idto.spinner()
    loop = task.run()
    print(task.outcome(loop))

The publication uses spring contacts that act at a distance; ours are hard. In both, plans take effect one tick after
the measurement, and PD controllers follow them in between. The publication gives rates and no rates of success:
the criteria are ours, and each task states its own. Models are typed from their files, in axes of our own.
"""

from typing import TYPE_CHECKING, Any

from dojo_opt.tasks.idto.acrobot import acrobot
from dojo_opt.tasks.idto.air_hockey import air_hockey
from dojo_opt.tasks.idto.allegro import allegro
from dojo_opt.tasks.idto.allegro_upside_down import allegro_upside_down
from dojo_opt.tasks.idto.dual_jaco import dual_jaco
from dojo_opt.tasks.idto.jaco import jaco
from dojo_opt.tasks.idto.jaco_ball import jaco_ball
from dojo_opt.tasks.idto.mini_cheetah import mini_cheetah, mini_cheetah_hills
from dojo_opt.tasks.idto.planar_hopper import hopper
from dojo_opt.tasks.idto.punyo import punyo
from dojo_opt.tasks.idto.spinner import spinner
from sim.mechanism.checks import no_attribute

__all__ = [
    "acrobot",
    "air_hockey",
    "allegro",
    "allegro_upside_down",
    "dual_jaco",
    "hopper",
    "jaco",
    "jaco_ball",
    "mini_cheetah",
    "mini_cheetah_hills",
    "punyo",
    "spinner",
]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """A task that is not there, with the ones that are."""
        raise no_attribute(__name__, name, __all__)
