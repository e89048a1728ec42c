"""Shrinkage: the gap between bodies across which the smooth contact of plans presses, taken out of their shapes."""

from __future__ import annotations

from dataclasses import replace

from sim.mechanism.collision import Collision
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Capsule, Solid, Sphere

__all__ = ["shrunk"]

_CALL = "MPC(shrinkage=...)"


def shrunk(mechanism: Mechanism, shrinkage: float) -> Mechanism:
    """A mechanism whose collisions have gaps that are larger by a shrinkage; contacts with the ground stay.

    A contact on the central path has an impulse of kappa over its gap. A plan therefore holds an object without
    touching it, and a robot that follows the plan does not hold it. With a shrinkage of about this gap, fingers that
    follow a plan touch.

    Args:
        mechanism: the mechanism.
        shrinkage: how much thinner one sphere or capsule of every collision is, the larger one [m].

    Returns:
        The mechanism.

    Raises:
        ValueError: a collision of neither spheres nor capsules, or of ones that are not thicker than the shrinkage.
    """
    return replace(mechanism, collisions=[_thinner(mechanism, c, shrinkage) for c in mechanism.collisions])


def _thinner(mechanism: Mechanism, collision: Collision, shrinkage: float) -> Collision:
    """The collision, one of whose shapes is thinner."""
    a, b = _shape(mechanism, collision.a, collision.shape_a), _shape(mechanism, collision.b, collision.shape_b)
    if max(_radius(a), _radius(b)) <= shrinkage:
        raise ValueError(
            f"{_CALL}: expected collisions of a sphere or a capsule thicker than {shrinkage:g} m, got {collision!r}"
        )
    if _radius(a) >= _radius(b):
        return replace(collision, shape_a=_thin(a, shrinkage))
    return replace(collision, shape_b=_thin(b, shrinkage))


def _shape(mechanism: Mechanism, body: str | None, given: Solid | None) -> Solid:
    """The shape of one side of a collision."""
    return given if given is not None else next(b.shapes[0] for b in mechanism.bodies if b.name == body)


def _radius(shape: Solid) -> float:
    """The radius of a sphere or a capsule, 0 of the others [m]."""
    return shape.radius if isinstance(shape, Sphere | Capsule) else 0.0


def _thin(shape: Solid, shrinkage: float) -> Solid:
    """The sphere or capsule, thinner by `shrinkage` [m]."""
    assert isinstance(shape, Sphere | Capsule)
    return replace(shape, radius=shape.radius - shrinkage)
