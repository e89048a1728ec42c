"""Common options of all algorithms of learning, checked in one place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dojo_opt.learn.network import ACTIVATIONS
from dojo_opt.learn.randomization import Randomization
from sim.mechanism import checks

__all__ = ["check_common"]


def check_common(call: str, options: Any) -> None:
    """Refuse options that no algorithm takes.

    Args:
        call: name of the algorithm.
        options: its options, with the fields that all of them have, and some that most have.

    Raises:
        TypeError: for an option of the wrong kind.
        ValueError: for one out of range.
    """
    o = options
    for name in ("epochs", "episodes"):
        checks.whole_number(f"{call}({name}=...)", getattr(o, name))
    checks.whole_number(f"{call}(evaluations=...)", o.evaluations, 0)
    if getattr(o, "horizon", None) is not None:
        checks.whole_number(f"{call}(horizon=...)", o.horizon)
    if not isinstance(o.hidden, Sequence) or isinstance(o.hidden, str):
        raise TypeError(f"{call}(hidden=...): expected the sizes of the hidden layers, got {checks.shown(o.hidden)}")
    for size in o.hidden:
        checks.whole_number(f"{call}(hidden=...)", size)
    checks.one_of(f"{call}(activation=...)", o.activation, ACTIVATIONS)
    checks.number(f"{call}(rate=...)", o.rate, above=0.0)
    if o.time_limit != float("inf"):
        checks.number(f"{call}(time_limit=...)", o.time_limit, above=0.0)
    if not (o.callback is None or callable(o.callback)):
        raise TypeError(f"{call}(callback=...): expected a function or None, got {checks.shown(o.callback)}")
    if not (o.stream is None or hasattr(o.stream, "write")):
        raise TypeError(f"{call}(stream=...): expected a file or None, got {checks.shown(o.stream)}")
    if not isinstance(getattr(o, "randomization", Randomization()), Randomization):
        raise TypeError(f"{call}(randomization=...): expected a Randomization, got {checks.shown(o.randomization)}")
