"""Effects: the elementary ways in which a parameter enters a step; parameters are sums of them."""

from __future__ import annotations

from typing import NamedTuple

from solvers.codes import Code
from solvers.types import Matrix, Vector


class Effect(Code):
    """The target of an elementary change; index and component of its term in brackets."""

    MASS = 0  # of a body, its inertia fixed [body]
    INERTIA = 1  # xx, yy, zz, xy, xz, yz of a body [body, which]
    PARENT_POINT = 2  # joint frame in the parent body [joint, axis of the parent]
    CHILD_POINT = 3  # joint point in the child body [joint, axis of the child]
    ORIENTATION = 4  # right rotation of the joint frame [joint, axis of the joint frame]
    LEAD = 5  # displacement along the axis per radian about it [joint]
    AXIS = 6  # rotation of the directions of motion in the joint frame [joint, axis of the joint frame]
    SPRING = 7  # [degree of freedom]
    DAMPER = 8  # [degree of freedom]
    ARMATURE = 9  # [degree of freedom]
    REST = 10  # [degree of freedom; of a quaternion joint its first rotation, component]
    BOUND = 11  # bound of a coordinate, or half angle of a cone [limit]
    FRICTION = 12  # [contact]
    POINT = 13  # of a contact in its body [contact, axis of the body]
    RADIUS = 14  # [contact]
    HEIGHT = 15  # of the half-space [contact]
    NORMAL = 16  # rotation of the half-space about the origin, world axes [contact, axis]
    GRAVITY = 17  # [-, axis]
    TIME_STEP = 18
    LOOP_PARENT = 19  # joint frame of a closing joint on its parent [loop, axis]
    LOOP_CHILD = 20  # its joint point on the child [loop, axis]
    LOOP_TURN = 21  # right rotation of its frame, as ORIENTATION [loop, axis]
    SHAPE_SHIFT = 22  # of the shapes of a collision [pair of the first point; 3 side + axis of the body]
    RESTITUTION = 23  # [contact]
    GEAR_RATIO = 24  # [gear]
    GEAR_OFFSET = 25  # [gear]
    INPUT = 26  # force and torque per unit of an input on a body [input, which of the six]
    SHAPE_SIZE = 27  # of the shapes of a collision [pair of the first point; SIDE side + shape_kinds.Size]
    TERRAIN = 28  # a height of the grid of a terrain, by number; it has no list of terms, see terrain_parameters.py
    SEEN = 29  # inertia that a damper sees [degree of freedom]
    TURNING_FRICTION = 30  # torsional or rolling [contact, MomentRow]


class ParameterTerm(Code):
    """terms of a ParameterPlan: how a parameter changes a target; its weight is in another array."""

    EFFECT = 0  # Effect
    INDEX = 1
    COMPONENT = 2
    COLUMN = 3  # of the parameter


SIDE = 16  # stride of the two shapes in the component of a SHAPE_SIZE


class At(NamedTuple):
    """The step that is differentiated, and scratch."""

    h: float
    q: Vector  # (nq,) coordinates at configuration 2
    v: Vector  # (nv,)
    u: Vector  # (nu,)
    twists: Matrix  # (12, 6)
    below: Vector  # (nbody,) 1 for the bodies that a change of geometry moves
