"""Planar tasks of CRISP (Li, Han, Kang, Ma, Yang: arXiv 2502.01055) as true dynamics with hard contact.

Every builder returns a `PlanTask`, planned once and without a guess of its contacts:

    task = dojo.tasks.crisp.push_t()
    plan = task.run()
    print(task.outcome(plan))

Starts, goals, horizons and weights are those of the publication. Its models are walls of springs, objects that slide
quasi-statically under an ellipsoidal limit surface, a leg without mass; `help(TASK)` states what differs here. Inputs
are zero in every guess.
"""

from typing import TYPE_CHECKING, Any

from dojo_opt.tasks.crisp.cart_pole import cart_pole
from dojo_opt.tasks.crisp.point_hopper import hopper
from dojo_opt.tasks.crisp.push_box import push_box
from dojo_opt.tasks.crisp.push_t import push_t
from dojo_opt.tasks.crisp.transport import transport
from dojo_opt.tasks.crisp.waiter import waiter
from sim.mechanism.checks import no_attribute

__all__ = ["cart_pole", "hopper", "push_box", "push_t", "transport", "waiter"]


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """A task that is not there, with the ones that are."""
        raise no_attribute(__name__, name, __all__)
