"""catalogue: every ready-made mechanism with its sizes."""

from __future__ import annotations

from dataclasses import dataclass

import dojo_opt.models as models
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import mechanism_sizes


@dataclass(frozen=True)
class Entry:
    """One model: its sizes as built with default parameters, and what it is."""

    name: str
    bodies: int
    nq: int  # coordinates
    nv: int  # degrees of freedom
    nu: int  # inputs
    contacts: int
    limits: int  # bounds of joints
    mass: float  # [kg]
    what: str

    def build(self) -> Mechanism:
        """The mechanism with default parameters."""
        mech: Mechanism = getattr(models, self.name)()
        return mech


def catalogue() -> list[Entry]:
    """All models, by name."""
    out = []
    for name in sorted(models.__all__):
        builder = getattr(models, name)
        mech = builder()
        size = mechanism_sizes(mech)
        sizes = (size.nbody, size.nq, size.nv, size.nu, size.ncontact, size.nlimit)
        what = (builder.__doc__ or "").split("\n")[0]
        out.append(Entry(name, *sizes, sum(body.mass for body in mech.bodies), what))
    return out
