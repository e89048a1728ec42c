"""Ready-made mechanisms, under the names that Dojo uses: one builder per file, keyword parameters with defaults."""

from dojo_opt.models.acrobot import acrobot
from dojo_opt.models.block import block
from dojo_opt.models.cartpole import cartpole
from dojo_opt.models.double_pendulum import double_pendulum
from dojo_opt.models.npendulum import npendulum
from dojo_opt.models.pendulum import pendulum
from dojo_opt.models.quadruped import quadruped
from dojo_opt.models.raiberthopper import raiberthopper
from dojo_opt.models.sphere import sphere

__all__ = [
    "acrobot",
    "block",
    "cartpole",
    "double_pendulum",
    "npendulum",
    "pendulum",
    "quadruped",
    "raiberthopper",
    "sphere",
]
