"""Results of derivatives. Derivatives of an unsolved step are zero.

A Jacobian or Gradient of an unsolved step raises SimulationError when they are taken out, by unpacking or by name; a
Linearization, of many knots, has their status.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from sim.mechanism.short_repr import short_repr
from sim.simulator.results import Result
from solvers.status import Status
from solvers.types import Floats, Integers

__all__ = ["Gradient", "Jacobian", "Linearization"]


@dataclass(frozen=True)
class Jacobian(Result):
    """Derivatives of one step: unpacks into its blocks, `A, B = jacobian`, and is a table of them by name.

    Access to A, B or a block of an unsolved step raises SimulationError.

    Attributes:
        blocks: in the order of wrt=...: "state" (ndx, ndx), "input" (ndx, nu), parameters (ndx, n).
        x_next: (nx,) state after the step.
        status: Status of the step.
        accuracy: estimate of the error, relative to the largest entry.
        detail: sentence about an unsolved step, with its numbers.
    """

    blocks: Mapping[str, Floats]
    x_next: Floats
    status: Status
    accuracy: float = 0.0
    detail: str = ""

    __repr__ = short_repr

    @property
    def A(self) -> Floats:
        """(ndx, ndx) d(next state)/d(state)."""
        return self["state"]

    @property
    def B(self) -> Floats:
        """(ndx, nu) d(next state)/d(input)."""
        return self["input"]

    def __iter__(self) -> Iterator[Floats]:
        return iter(self.values())

    def __len__(self) -> int:
        return len(self.blocks)

    def __contains__(self, name: object) -> bool:
        return name in self.blocks

    def __getitem__(self, name: str | int) -> Floats:
        self.check()
        return tuple(self.blocks.values())[name] if isinstance(name, int) else self.blocks[name]

    def keys(self) -> Iterable[str]:
        """Names of the blocks, in the order of wrt=...; `dict(jacobian)` is a table of them.

        Returns:
            The names.

        Raises:
            SimulationError: the step was not solved.
        """
        self.check()
        return self.blocks.keys()

    def values(self) -> Iterable[Floats]:
        """The blocks.

        Returns:
            Blocks (ndx, n), in the order of the names.

        Raises:
            SimulationError: the step was not solved.
        """
        self.check()
        return self.blocks.values()

    def items(self) -> Iterable[tuple[str, Floats]]:
        """Names and blocks.

        Returns:
            Pairs (name, block (ndx, n)).

        Raises:
            SimulationError: the step was not solved.
        """
        self.check()
        return self.blocks.items()


@dataclass(frozen=True)
class Linearization(Result):
    """Derivatives of every knot at its state and input, in tangent coordinates.

    Attributes:
        A: (T, ndx, ndx) derivatives by the state.
        B: (T, ndx, nu) derivatives by the input.
        x_next: (T, nx) states after the knots.
        status: (T,) Status of each knot; the derivatives of an unsolved knot are zero.
        parameters: derivatives (T, ndx, n) by the names of the requested parameters.
        accuracy: (T,) estimate of the error of A and B, relative to their largest entry: hard contacts on light parts
            cost digits. It takes the step as solved: where contacts graze, a step that is solved to the default
            `tolerance` may have derivatives that are off by 1e-3; with 1e-12 they are not.
        detail: sentence about an unsolved step, with its numbers.
    """

    A: Floats
    B: Floats
    x_next: Floats
    status: Integers
    parameters: Mapping[str, Floats] = field(default_factory=dict)
    accuracy: Floats = field(default_factory=lambda: np.zeros(0))
    detail: str = ""

    __repr__ = short_repr


@dataclass(frozen=True)
class Gradient(Result, Mapping[str, Floats]):
    """Gradient of a scalar of a rollout, by the names of wrt=...

    Access to a block of an unsolved rollout raises SimulationError.

    Attributes:
        blocks: "state" (ndx,), "input" (T, nu), parameters (n,).
        status: Status of the rollout.
        detail: sentence about an unsolved step, with its numbers.
    """

    blocks: Mapping[str, Floats]
    status: Status
    detail: str = ""

    __repr__ = short_repr

    def __iter__(self) -> Iterator[str]:
        return iter(self.blocks)

    def __len__(self) -> int:
        return len(self.blocks)

    def __getitem__(self, name: str) -> Floats:
        self.check()
        return self.blocks[name]
