"""Forces of contacts in the observations and rewards of Gymnasium's tasks, as `cfrc_ext` of MuJoCo."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from dojo_opt.planning.residual import jit
from sim.io.mjcf.report import MjcfMechanism
from sim.mechanism import checks

__all__ = ["contact_fields", "model_path"]


def model_path(file: str) -> Path:
    """A model file of Gymnasium's package."""
    found = find_spec("gymnasium")
    if found is None or found.origin is None:
        raise ImportError('tasks of Gymnasium read its models: pip install "dojo-opt[gym,mjcf]"')
    return Path(found.origin).parent / "envs" / "mujoco" / "assets" / file


def _parts(mech: MjcfMechanism, file: str) -> tuple[tuple[str, ...], ...]:
    """The contacts of each body of a model of Gymnasium, in its order: bodies without a joint are welded to others."""
    parts = []
    for body in ElementTree.parse(model_path(file)).iter("body"):
        geoms = {geom.get("name") for geom in body.findall("geom")}
        parts.append(tuple(n for n in mech.contact_names if geoms & {n, n.rpartition("_")[0]}))
    return tuple(parts)


def _touching(seen: Callable[..., Any], size: int, begin: int, groups: int, most: float) -> Callable[..., Any]:
    """An observation of so many numbers, then of the wrenches of so many groups, which are x[begin:]: torques first, as
    MuJoCo's `cfrc_ext`, clipped.
    """
    seen = jit(seen)

    def observation(x, out):  # type: ignore[no-untyped-def]
        seen(x[:begin], out[:size])
        for g in range(groups):
            a = begin + 6 * g
            for k in range(6):
                out[size + 6 * g + k] = min(max(x[a + (k + 3) % 6], -most), most)

    return observation


def _presses(reward: Callable[..., Any], begin: int, weight: float, most: float, limit: float) -> Callable[..., Any]:
    """A reward, minus that of the squares of the clipped wrenches at the end of x', up to a limit."""
    reward = jit(reward)

    def with_contacts(x, a, after):  # type: ignore[no-untyped-def]
        total = 0.0
        for i in range(begin, after.shape[0]):
            total += min(max(after[i], -most), most) ** 2
        return reward(x, a, after) - min(weight * total, limit)

    return with_contacts


def contact_fields(
    mech: MjcfMechanism,
    file: str,
    plain: tuple[Callable[..., Any], int, Callable[..., Any]],
    included: bool,
    weight: float,
    most: float,
    limit: float,
) -> dict[str, Any]:
    """Fields of a task with forces of contacts, from the observation, its size, and the reward without them."""
    observation, size, reward = plain
    checks.number("contact_cost_weight", weight, at_least=0.0)
    touch = _parts(mech, file) if included or weight > 0.0 else ()
    nx = mech.nq + mech.nv
    if touch:
        reward = _presses(reward, nx, weight, most, limit)
        observation = _touching(observation, size, nx, len(touch) * included, most)
    total = size + 6 * len(touch) * included
    return {"observation": observation, "observations": total, "reward": reward, "touch": touch}
