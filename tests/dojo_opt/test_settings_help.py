"""Every setting of the planner, of MPC and of plants, and every field of a part is in `help()`, with its default."""

from __future__ import annotations

import re
from dataclasses import MISSING

import pytest

import dojo_opt as dojo
from dojo_opt.mpc.settings import MPCSettings

REQUIRED = object()


def fields(cls):
    """Name -> default."""
    if hasattr(cls, "_fields"):
        return {name: cls._field_defaults.get(name, REQUIRED) for name in cls._fields}
    defaults = {name: field.default for name, field in cls.__dataclass_fields__.items()}
    return {name: REQUIRED if value is MISSING else value for name, value in defaults.items()}


@pytest.mark.parametrize(
    "cls",
    [dojo.Options, dojo.Stage, MPCSettings, dojo.Perturbation, dojo.Disturbances, dojo.Push]
    + [dojo.Body, dojo.Joint, dojo.Contact, dojo.Collision, dojo.Input, dojo.Gear],
)
def test_every_field_is_in_help(cls):
    attributes = cls.__doc__.partition("    Raises:")[0]
    entries = dict(re.findall(r"^        (\w+): ((?:.|\n            )+)", attributes, flags=re.MULTILINE))
    assert list(entries) == list(fields(cls))
    for name, default in fields(cls).items():
        said = re.search(r"\(default ([^\s:;)]+)", " ".join(entries[name].split()))
        if default is REQUIRED:
            assert said is None, name
        elif isinstance(default, int | float) and not isinstance(default, bool):
            assert said and float(said[1].replace(",", "")) == default, name
        elif default is None or isinstance(default, bool):
            assert said and said[1] == str(default), name
        else:
            assert said, name


def test_settings_of_mpc_are_named_where_they_are_given():
    assert all(re.search(rf"\b{name}\b", dojo.MPC.__doc__) for name in MPCSettings.__dataclass_fields__)
