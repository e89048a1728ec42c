"""Entry: a ready-made mechanism with its sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import mechanism_sizes


@dataclass(frozen=True)
class Entry:
    """One model: its sizes as built with default parameters, and a description.

    Attributes:
        name: name of the builder in `dojo.models`.
        bodies: number of bodies.
        nq: number of coordinates.
        nv: number of degrees of freedom.
        nu: number of inputs.
        contacts: number of contacts.
        limits: number of bounds of joints.
        mass: total mass [kg].
        what: the first line of the builder's description.
        builder: the builder.
    """

    name: str
    bodies: int
    nq: int
    nv: int
    nu: int
    contacts: int
    limits: int
    mass: float
    what: str
    builder: Callable[..., Mechanism] = field(repr=False)

    def build(self) -> Mechanism:
        """The mechanism of the model.

        Returns:
            The mechanism with default parameters.
        """
        return self.builder()


def entry(builder: Callable[..., Mechanism]) -> Entry:
    """The entry of a builder: its model with default parameters."""
    mech, what = builder(), (builder.__doc__ or "").split("\n")[0]
    size, mass = mechanism_sizes(mech), sum(body.mass for body in mech.bodies)
    sizes = (size.nbody, size.nq, size.nv, size.nu, size.ncontact, size.nlimit)
    return Entry(builder.__name__, *sizes, mass, what, builder)
