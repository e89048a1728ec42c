"""Every setting of the planner, of MPC and of plants, and every field of a part is in `help()`, with its default."""

from __future__ import annotations

import operator
import re
from dataclasses import MISSING

import pytest

import dojo_opt as dojo

REQUIRED = object()


def fields(cls):
    """Name -> default."""
    if hasattr(cls, "_fields"):
        return {name: cls._field_defaults.get(name, REQUIRED) for name in cls._fields}
    defaults = {name: field.default for name, field in cls.__dataclass_fields__.items()}
    return {name: REQUIRED if value is MISSING else value for name, value in defaults.items()}


@pytest.mark.parametrize(
    "cls",
    [dojo.Options, dojo.Stage, dojo.MPCSettings, dojo.IdentifyOptions, dojo.Perturbation, dojo.Disturbances, dojo.Push]
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


@pytest.mark.parametrize(
    ("call", "name"),
    [
        *((dojo.ilqr, "dojo.Options"), (dojo.MPC, "dojo.MPCSettings"), (dojo.identify, "dojo.IdentifyOptions")),
        *((dojo.learn.shac, "dojo.learn.ShacOptions"), (dojo.learn.imitate, "dojo.learn.ImitationOptions")),
        (dojo.learn.ars, "dojo.learn.RandomSearchOptions"),
        (dojo.learn.gradient_search, "dojo.learn.GradientSearchOptions"),
    ],
)
def test_help_of_a_call_leads_to_its_settings(call, name):
    """By a public name, whose own help has every field."""
    assert f"`{name}`" in call.__doc__
    cls = operator.attrgetter(name.removeprefix("dojo."))(dojo)
    described = re.findall(r"^        (\w+):", cls.__doc__, flags=re.MULTILINE)
    assert set(fields(cls)) <= set(described), set(fields(cls)) - set(described)


@pytest.mark.parametrize(("call", "cls"), [(dojo.MPC, dojo.MPCSettings), (dojo.identify, dojo.IdentifyOptions)])
def test_settings_are_named_where_they_are_given(call, cls):
    assert all(re.search(rf"\b{name}\b", call.__doc__) for name in fields(cls))
