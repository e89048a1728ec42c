"""Archive: mechanisms as plain data and arrays, in a format of its own with a version; nothing in it is code.

A part is {"part": name of its class, field: value, ...}, with the fields that its constructor takes: loading an archive
makes the parts anew and checks them as when a user does. Arrays are {"array": name}, in the npz file beside; a table is
{"table": [[key, value], ...]}. Classes are looked up in PARTS and nowhere else.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.shapes import Solid

Arrays = dict[str, NDArray[Any]]

__all__ = ["VERSION", "packed_part", "part_of"]

VERSION = 1
_SHARED = ("Polytope", "SignedDistance", "Terrain")
PARTS = {cls.__name__: cls.__module__ for cls in Solid.__subclasses__() if cls.__module__ == Solid.__module__} | {
    "Body": "sim.mechanism.body",
    "Collision": "sim.mechanism.collision",
    "Contact": "sim.mechanism.contact",
    "Gear": "sim.mechanism.gear",
    "Input": "sim.mechanism.input",
    "Joint": "sim.mechanism.joint",
    "LinkFrame": "sim.io.urdf.report",
    "Mechanism": "sim.mechanism.mechanism",
    "MjcfMechanism": "sim.io.mjcf.report",
    "MjcfReport": "sim.io.mjcf.report",
    "Note": "sim.io.urdf.report",
    "Polytope": "sim.mechanism.polytope",
    "SignedDistance": "sim.mechanism.signed_distance",
    "Simulator": "sim.simulator.simulator",
    "Terrain": "sim.mechanism.terrain",
    "UrdfMechanism": "sim.io.urdf.report",
    "UrdfReport": "sim.io.urdf.report",
    "Visual": "sim.mechanism.visual",
}


def packed_part(value: Any, arrays: Arrays) -> Any:
    """A part, or a field of one, as plain data; its arrays are added to `arrays`.

    Args:
        value: a part of a mechanism, a number, a text, an array, or a list or table of these.
        arrays: arrays by name, extended.

    Returns:
        Numbers, texts, lists and tables, as JSON has them.

    Raises:
        TypeError: the value is of another kind.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        for name, array in arrays.items():
            if array is value:  # of a part that others share
                return {"array": name}
        name = f"array_{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, list | tuple):
        return [packed_part(item, arrays) for item in value]
    if isinstance(value, Mapping):
        return {"table": [[packed_part(k, arrays), packed_part(v, arrays)] for k, v in value.items()]}
    kind = type(value).__name__
    if is_dataclass(value) and PARTS.get(kind) == type(value).__module__:
        return {"part": kind} | {f.name: packed_part(getattr(value, f.name), arrays) for f in fields(value) if f.init}
    raise TypeError(f"expected a part of a mechanism, a number, a text or an array, got {value!r}")


def part_of(data: Any, arrays: Mapping[str, NDArray[Any]], shared: dict[str, Any] | None = None) -> Any:
    """The inverse of `packed_part`; lists come back as tuples.

    A part that several others hold, such as the terrain of all contacts, is one object again.

    Args:
        data: numbers, texts, lists and tables.
        arrays: arrays by name.
        shared: parts made so far that others may hold as well (default None: none).

    Returns:
        The part, made anew.

    Raises:
        ValueError: the data name an unknown part, or one with values that it refuses.
    """
    shared = {} if shared is None else shared
    if isinstance(data, list):
        return tuple(part_of(item, arrays, shared) for item in data)
    if not isinstance(data, dict):
        return data
    if "array" in data:
        return arrays[data["array"]]
    if "table" in data:
        return {part_of(key, arrays, shared): part_of(value, arrays, shared) for key, value in data["table"]}
    kind = data.get("part")
    if kind not in PARTS:
        raise ValueError(f"expected one of {', '.join(sorted(PARTS))}, got {kind!r}")
    made = getattr(import_module(PARTS[kind]), kind)
    known = {f.name for f in fields(made) if f.init} if is_dataclass(made) else set(data)
    given = {name: part_of(value, arrays, shared) for name, value in data.items() if name != "part"}
    if unknown := set(given) - known:
        raise ValueError(f"{kind} has no field {', '.join(sorted(map(repr, unknown)))}")
    if kind not in _SHARED:
        return made(**given)
    key = json.dumps(data)  # equal only where their arrays are the same ones
    if key not in shared:
        shared[key] = made(**given)
    return shared[key]
