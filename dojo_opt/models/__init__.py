"""Ready-made mechanisms, under the names that Dojo uses: one builder per file, keyword parameters with defaults.

`catalog()` lists them with their sizes. `box` and `box2d` are older names of `block` and `block2d`.
"""

from typing import TYPE_CHECKING, Any

from dojo_opt.models.acrobot import acrobot
from dojo_opt.models.ant import ant
from dojo_opt.models.atlas import atlas
from dojo_opt.models.block import block
from dojo_opt.models.block2d import block2d
from dojo_opt.models.cartpole import cartpole
from dojo_opt.models.catalog import Entry, entry
from dojo_opt.models.delta import delta
from dojo_opt.models.double_pendulum import double_pendulum
from dojo_opt.models.dzhanibekov import dzhanibekov
from dojo_opt.models.exoskeleton import exoskeleton
from dojo_opt.models.fivebar import fivebar
from dojo_opt.models.fourbar import fourbar
from dojo_opt.models.halfcheetah import halfcheetah
from dojo_opt.models.hopper import hopper
from dojo_opt.models.humanoid import humanoid
from dojo_opt.models.minitaur_leg import minitaur_leg
from dojo_opt.models.npendulum import npendulum
from dojo_opt.models.nslider import nslider
from dojo_opt.models.orbital import orbital
from dojo_opt.models.panda import panda
from dojo_opt.models.pendulum import pendulum
from dojo_opt.models.quadrotor import quadrotor
from dojo_opt.models.quadruped import quadruped
from dojo_opt.models.raiberthopper import raiberthopper
from dojo_opt.models.rexhopper import rexhopper
from dojo_opt.models.slider import slider
from dojo_opt.models.snake import snake
from dojo_opt.models.sphere import sphere
from dojo_opt.models.stewart import stewart
from dojo_opt.models.tennisracket import tennisracket
from dojo_opt.models.tippetop import tippetop
from dojo_opt.models.twister import twister
from dojo_opt.models.uuv import uuv
from dojo_opt.models.walker import walker
from dojo_opt.models.youbot import youbot
from sim.mechanism.checks import no_attribute
from sim.mechanism.renamed import warn_renamed

__all__ = [
    "acrobot",
    "ant",
    "atlas",
    "block",
    "block2d",
    "cartpole",
    "delta",
    "double_pendulum",
    "dzhanibekov",
    "exoskeleton",
    "fivebar",
    "fourbar",
    "halfcheetah",
    "hopper",
    "humanoid",
    "minitaur_leg",
    "npendulum",
    "nslider",
    "orbital",
    "panda",
    "pendulum",
    "quadrotor",
    "quadruped",
    "raiberthopper",
    "rexhopper",
    "slider",
    "snake",
    "sphere",
    "stewart",
    "tennisracket",
    "tippetop",
    "twister",
    "uuv",
    "walker",
    "youbot",
]

box, box2d = block, block2d


def catalog() -> list[Entry]:
    """All models with their sizes, sorted by name.

    Returns:
        One `Entry` per model, built with its default parameters.
    """
    return [entry(globals()[name]) for name in sorted(__all__)]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """A model that is not there, with the ones that are, or an old name, until version 0.2."""
        if name == "catalogue":
            warn_renamed("dojo.models.catalogue", "dojo.models.catalog")
            return catalog
        raise no_attribute(__name__, name, __all__)
