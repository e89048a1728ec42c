"""Effects: the elementary ways in which a parameter enters a step; parameters are sums of them."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

from solvers.types import Matrix, Vector


class Effect(IntEnum):
    """The target of an elementary change; index and component of its term in brackets."""

    MASS = 0  # of a body, its inertia fixed [body]
    INERTIA = 1  # xx, yy, zz, xy, xz, yz of a body [body, which]
    PARENT_POINT = 2  # joint frame in the parent body [joint, axis of the parent]
    CHILD_POINT = 3  # joint point in the child body [joint, axis of the child]
    ORIENTATION = 4  # right rotation of the joint frame [joint, axis of the joint frame]
    AXIS = 5  # rotation of the directions of motion in the joint frame [joint, axis of the joint frame]
    SPRING = 6  # [degree of freedom]
    DAMPER = 7  # [degree of freedom]
    ARMATURE = 8  # [degree of freedom]
    REST = 9  # [degree of freedom; of a quaternion joint its first rotation, component]
    BOUND = 10  # bound of a coordinate, or half angle of a cone [limit]
    FRICTION = 11  # [contact]
    POINT = 12  # of a contact in its body [contact, axis of the body]
    RADIUS = 13  # [contact]
    HEIGHT = 14  # of the half-space [contact]
    NORMAL = 15  # rotation of the half-space about the origin, world axes [contact, axis]
    GRAVITY = 16  # [-, axis]
    TIME_STEP = 17
    LOOP_PARENT = 18  # joint frame of a closing joint on its parent [loop, axis]
    LOOP_CHILD = 19  # its joint point on the child [loop, axis]
    LOOP_TURN = 20  # right rotation of its frame, as ORIENTATION [loop, axis]
    SHAPE_SHIFT = 21  # of the shapes of a collision [pair of the first point; 3 side + axis of the body]
    RESTITUTION = 22  # [contact]
    GEAR_RATIO = 23  # [gear]
    GEAR_OFFSET = 24  # [gear]
    INPUT = 25  # force and torque per unit of an input on a body [input, which of the six]
    SHAPE_SIZE = 26  # of the shapes of a collision [pair of the first point; SIDE side + Size]
    TERRAIN = 27  # a height of the ground, of all in a row [height]: not in a list of terms, see terrain_parameters.py


class Size(IntEnum):
    """How the surface of a shape moves where it is touched, per unit of one of its sizes; see sizes.py."""

    BALL = 0  # radius around a point, a segment, or a polytope: along the normal
    ROD = 1  # half length of a capsule: its ends
    SIDE_X = 2  # half side of a box: corners, edges and faces, away from the middle
    SIDE_Y = 3
    SIDE_Z = 4
    RIM = 5  # radius of a cylinder: away from the axis
    LENGTH = 6  # half length of a cylinder: its ends
    SCALE = 7  # of a polytope: away from the centre
    STRING = 8  # length: the point stays, the gap grows


SIDE = 16  # stride of the two shapes in the component of a SHAPE_SIZE


class At(NamedTuple):
    """The step that is differentiated, and scratch."""

    h: float
    q: Vector  # (nq,) coordinates at configuration 2
    v: Vector  # (nv,)
    u: Vector  # (nu,)
    twists: Matrix  # (12, 6)
    below: Vector  # (nbody,) 1 for the bodies that a change of geometry moves
