"""Every builder of a model, and every argument of it, against numbers that are none, odd ones and extreme ones."""

from __future__ import annotations

import inspect
import warnings
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo

NONE: tuple[Any, ...] = (np.nan, np.inf, "a", 1j, [], {}, object(), np.zeros(2), 10**400, b"a", [[1], [1, 2]])
ODD: tuple[Any, ...] = (-1.0, 0, 1e300, -1e300, 1e-300, 1e9, 0.5, True, None)


def arguments(kinds: tuple[str, ...]) -> list[tuple[str, str]]:
    """Models and their arguments that are annotated so."""
    found = []
    for name in dojo.models.__all__:
        for argument in inspect.signature(getattr(dojo.models, name)).parameters.values():
            if str(argument.annotation).split(" | ")[0] in kinds:
                found.append((name, argument.name))
    return found


def build(model: str, argument: str, value: Any) -> dojo.Mechanism | str:
    """The mechanism, or why there is none; no other exception, and no warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return getattr(dojo.models, model)(**{argument: value})
        except (ValueError, TypeError) as error:
            return str(error)


@pytest.mark.parametrize(("model", "argument"), arguments(("float", "int", "bool")))
def test_what_is_no_number_is_refused_by_name(model: str, argument: str) -> None:
    for value in NONE:
        found = build(model, argument, value)
        assert isinstance(found, str) and f"{model}({argument}" in found, (value, found)


@pytest.mark.parametrize(("model", "argument"), arguments(("int",)))
def test_counts_are_refused_below_one_and_beyond_the_memory(model: str, argument: str) -> None:
    for value, reason in ((0, ">="), (-3, ">="), (10**15, "GiB")):
        found = build(model, argument, value)
        assert isinstance(found, str) and f"{model}({argument}" in found and reason in found, (value, found)


@pytest.mark.sweep(4)
@pytest.mark.parametrize(("model", "argument"), arguments(("float",)))
def test_odd_and_extreme_numbers_give_a_mechanism_of_finite_numbers_or_a_reason(model: str, argument: str) -> None:
    for value in ODD:
        found = build(model, argument, value)
        if isinstance(found, str):
            assert len(found) > 20 and "(" in found, (value, found)
        else:
            assert np.isfinite(np.asarray(found.neutral, dtype=float)).all(), value
            assert all(np.isfinite([body.mass, *np.ravel(body.inertia)]).all() for body in found.bodies), value
