"""LoopRank: the number of constraints of closed loops, the redundant ones, and whether the pose is singular."""

from __future__ import annotations

from typing import NamedTuple

_NEARLY_SINGULAR = 0.1  # `weakest` of configurations close to a singular one, over that next to them


class LoopRank(NamedTuple):
    """The number of loop constraints of a mechanism, and of those that are independent.

    Attributes:
        constraints: number of constraints by loop joint.
        redundant: by loop joint, number of constraints that those before it and its own imply.
        mobility: degrees of freedom that the loops leave.
        weakest: least singular value of the independent constraints, over the largest.
        leftover: largest one of the redundant constraints, over the largest.
        singular: number of redundant constraints that count next to this configuration: branches of the motion may meet
            here.
        nearby: `weakest` next to this configuration.
    """

    constraints: dict[str, int]
    redundant: dict[str, int]
    mobility: int
    weakest: float
    leftover: float
    singular: int = 0
    nearby: float = 0.0

    def __str__(self) -> str:
        total, idle = sum(self.constraints.values()), sum(self.redundant.values())
        which = ", ".join(f"{name} {n} of {self.constraints[name]}" for name, n in self.redundant.items() if n)
        return (
            f"{self.mobility} degrees of freedom left by {total} constraints, {idle} redundant"
            + (f" ({which}) to {self.leftover:.0e}" if idle else "")
            + f"; the weakest has {self.weakest:.1e} of the strongest"
            + self._place()
        )

    def _place(self) -> str:
        """How the configuration differs from those next to it."""
        if self.singular:
            return (
                f"; singular: {self.singular} of the redundant ones count nearby, branches of the motion may meet here"
            )
        if self.weakest < _NEARLY_SINGULAR * self.nearby:
            return f", nearby {self.nearby:.1e}: close to a singular configuration"
        return ""
