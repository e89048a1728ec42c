"""Steps in which parameters matter, of mechanisms with gears and with closing joints that act."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sim.mechanism.body import Body
from sim.mechanism.gear import Gear
from sim.mechanism.joint import Joint
from sim.simulator.simulator import Simulator
from support.couplings import started
from support.linkage import fourbar
from support.parameter_case import Case
from support.situations import CASES

# other values of these and the four-bar is no planar linkage of rods, and cannot close
PLANAR = ("inertia", "orientation", "axis", "parent_point", "child_point")


def _acting() -> Case:
    """A floating ring, its closing joint with springs, dampers and limits: it divides its child in two."""
    plain = CASES["in a loop, fixed"]().sim.mechanism
    ends = plain.loops[0].parent_point, plain.loops[0].child_point
    action = {"spring": (50.0, 2.0), "damper": 0.1, "limits": ((-0.1, 0.1), None)}
    last = Joint("cylindrical", "b3", "b0", "last", *ends, axis=(0.6, 0.0, 0.8), close=True, **action)
    mech = replace(plain, joints=[*plain.joints, last], loops=(), inputs=None, neutral=None)
    sim = Simulator(mech, time_step=0.01, kappa=1e-4, tolerance=1e-12)
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(1).normal(size=sim.nv)
    return Case(sim, sim.close(x), 0.1 * np.random.default_rng(2).normal(size=sim.nu))


def _geared_crank() -> Case:
    """The crank of a four-bar turns a flywheel."""
    plain = fourbar("pin", inputs=("crank",), spring=3.0, damper=0.2)
    wheel = Joint("revolute", None, "wheel", axis=(0.0, 1.0, 0.0), armature=0.1)
    mech = replace(
        plain,
        bodies=[*plain.bodies, Body("wheel", 1.0, (0.1, 0.2, 0.15))],
        joints=[*plain.joints, wheel],
        gears=[Gear("wheel", "crank", 3.0)],
        neutral=(*plain.neutral, -3.0),
    )
    return started(mech)


COUPLED: dict[str, Callable[[], Case]] = {
    "in a loop, acting": _acting,
    "geared, in a loop": _geared_crank,
}


def kinds(name: str, case: Case) -> list[str]:
    """The kinds of parameters with derivatives that can be checked."""
    return [kind for kind in case.kinds() if name != "geared, in a loop" or kind not in PLANAR]
