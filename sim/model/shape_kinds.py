"""Shape, Pair, Size: shapes as kernels know them, the supported pairs, and the number of their contact points."""

from __future__ import annotations

from itertools import product

from solvers.codes import Code

SIZES = 4  # room for the sizes of one shape in the vector that `collide` takes
SWAPPED = 64  # added to a Pair: the two have changed places
OUT = 43  # length of the result of `collide`
EDGES = 8  # points of two polytopes beside their corners: pairs of edges that cross
SPARE = 2  # points of a shape without edges beside its corner, for elements that are kept (feature_code.py)
CROSSINGS = 9  # points of a cylinder and another shape other than corners: places where edges, axes and rims cross
RIM_POINTS = 8  # points on a rim that a plane may touch


class Shape(Code):
    """Shape of a collision, with its sizes [m]. Centred on the origin of its frame, long along z."""

    SPHERE = 0  # radius
    CAPSULE = 1  # radius, half length of the segment
    BOX = 2  # half extents along x, y, z
    CYLINDER = 3  # radius, half length
    HALFSPACE = 4  # no sizes: z <= 0 of its frame is solid
    POLYTOPE = 6  # row of its table (polytope_table.py), radius; boxes and capsules are polytopes in some pairs
    ELLIPSOID = 7  # semi-axes along x, y, z
    FIELD = 8  # row of its table (level_set.py), radius around the level set, least extent
    STRING = 5  # as shape a: greatest length; against a STRING b without sizes: the other end


class Size(Code):
    """How the surface of a shape moves where it is touched, per unit of one of its sizes (sizes.py)."""

    BALL = 0  # radius around a point, a segment, or a polytope: along the normal
    ROD = 1  # half length of a capsule: its ends
    SIDE_X = 2  # half side of a box: corners, edges and faces, away from the middle
    SIDE_Y = 3
    SIDE_Z = 4
    RIM = 5  # radius of a cylinder: away from the axis
    LENGTH = 6  # half length of a cylinder: its ends
    SCALE = 7  # of a polytope: away from the centre
    STRING = 8  # length: the point stays, the gap grows
    SEMI_X = 9  # semi-axis of an ellipsoid: in proportion to the place along it; normals turn
    SEMI_Y = 10
    SEMI_Z = 11


class Pair(Code):
    """Kind of a collision: shape a against shape b, in this order."""

    SPHERE_SPHERE = 0
    SPHERE_CAPSULE = 1
    SPHERE_BOX = 2
    SPHERE_CYLINDER = 3
    SPHERE_HALFSPACE = 4
    CAPSULE_CAPSULE = 5
    CAPSULE_BOX = 6
    CAPSULE_HALFSPACE = 7
    BOX_BOX = 8
    BOX_HALFSPACE = 9
    CYLINDER_HALFSPACE = 10
    STRING = 11
    ELLIPSOID_HALFSPACE = 12
    ELLIPSOID_ELLIPSOID = 13
    CYLINDER_ELLIPSOID = 14
    POLYTOPE_ELLIPSOID = 15
    SPHERE_FIELD = 16
    CAPSULE_FIELD = 17
    POLYTOPE_POLYTOPE = 18  # from here on pairs have room for elements that are kept
    POLYTOPE_CYLINDER = 19
    CYLINDER_CYLINDER = 20


CHOSEN = (  # kinds whose points are made of chosen elements; the others have one contact at every pose, and no choice
    Pair.CAPSULE_CAPSULE,
    Pair.CAPSULE_BOX,
    Pair.BOX_BOX,
    Pair.CAPSULE_FIELD,
    Pair.POLYTOPE_POLYTOPE,
    Pair.POLYTOPE_CYLINDER,
    Pair.CYLINDER_CYLINDER,
)

_PAIRS: dict[tuple[Shape | None, Shape | None], Pair] = {
    (Shape.SPHERE, Shape.SPHERE): Pair.SPHERE_SPHERE,
    (Shape.SPHERE, Shape.CAPSULE): Pair.SPHERE_CAPSULE,
    (Shape.SPHERE, Shape.BOX): Pair.SPHERE_BOX,
    (Shape.SPHERE, Shape.CYLINDER): Pair.SPHERE_CYLINDER,
    (Shape.SPHERE, Shape.HALFSPACE): Pair.SPHERE_HALFSPACE,
    (Shape.CAPSULE, Shape.CAPSULE): Pair.CAPSULE_CAPSULE,
    (Shape.CAPSULE, Shape.BOX): Pair.CAPSULE_BOX,
    (Shape.CAPSULE, Shape.HALFSPACE): Pair.CAPSULE_HALFSPACE,
    (Shape.BOX, Shape.BOX): Pair.BOX_BOX,
    (Shape.BOX, Shape.HALFSPACE): Pair.BOX_HALFSPACE,
    (Shape.CYLINDER, Shape.HALFSPACE): Pair.CYLINDER_HALFSPACE,
    (Shape.STRING, Shape.STRING): Pair.STRING,
    (Shape.ELLIPSOID, Shape.HALFSPACE): Pair.ELLIPSOID_HALFSPACE,
    (Shape.ELLIPSOID, Shape.ELLIPSOID): Pair.ELLIPSOID_ELLIPSOID,
    (Shape.CYLINDER, Shape.ELLIPSOID): Pair.CYLINDER_ELLIPSOID,
    (Shape.POLYTOPE, Shape.ELLIPSOID): Pair.POLYTOPE_ELLIPSOID,
    (Shape.SPHERE, Shape.FIELD): Pair.SPHERE_FIELD,
    (Shape.CAPSULE, Shape.FIELD): Pair.CAPSULE_FIELD,
    (Shape.POLYTOPE, Shape.POLYTOPE): Pair.POLYTOPE_POLYTOPE,
    (Shape.POLYTOPE, Shape.CYLINDER): Pair.POLYTOPE_CYLINDER,
    (Shape.CYLINDER, Shape.CYLINDER): Pair.CYLINDER_CYLINDER,
}

_COUNT = {
    Pair.CAPSULE_CAPSULE: 3,  # ends of the overlap, crossing
    Pair.CAPSULE_BOX: 5,  # ends of the part above the face, crossing of an edge, corners of an edge
    Pair.CAPSULE_HALFSPACE: 2,  # ends
    Pair.BOX_BOX: 13,  # first and last points of four clipped edges, four corners of b, closest point elsewhere
    Pair.BOX_HALFSPACE: 8,  # corners
    Pair.CYLINDER_HALFSPACE: 8,  # lowest points of two rims, three fixed points on each
    Pair.CAPSULE_FIELD: 3,  # ends, a place between them
    Pair.CYLINDER_CYLINDER: 2 * RIM_POINTS + CROSSINGS,  # on the rims of each; where axes and rims cross
}


_STANDING = {Shape.SPHERE, Shape.CAPSULE, Shape.BOX}  # on corners, which may have a ball around them: polytopes
_TABLES = {
    Pair.POLYTOPE_ELLIPSOID: (True, False),
    Pair.SPHERE_FIELD: (False, True),
    Pair.CAPSULE_FIELD: (False, True),
    Pair.POLYTOPE_POLYTOPE: (True, True),
    Pair.POLYTOPE_CYLINDER: (True, False),
}


def pair(a: Shape | None, b: Shape | None) -> tuple[Pair, bool] | None:
    """Kind of the pair, and whether the two must be swapped to match its order; None if the pair is not supported.

    Spheres, capsules and boxes are polytopes where they have no routine of their own.
    """
    for first, second in product(_forms(a), _forms(b)):
        if (first, second) in _PAIRS:
            return _PAIRS[first, second], False
        if (second, first) in _PAIRS:
            return _PAIRS[second, first], True
    return None


def _forms(a: Shape | None) -> list[Shape | None]:
    """A shape as itself, then as a polytope."""
    return [a, Shape.POLYTOPE] if a in _STANDING else [a]


def tables(kind: int) -> tuple[bool, bool]:
    """Whether the shapes of a pair are given by tables: of corners (polytope_table.py), of a field (level_set.py)."""
    return _TABLES.get(Pair(kind % SWAPPED), (False, False))


def count(kind: Pair, corners: tuple[int, int] = (0, 0)) -> int:
    """How many contact points the pair may have: features of `collide`; corners: of the two in their tables."""
    if kind == Pair.POLYTOPE_POLYTOPE:
        return corners[0] + (corners[1] + EDGES if corners[0] > 1 else SPARE)
    if kind == Pair.POLYTOPE_CYLINDER:
        return corners[0] + CROSSINGS + (RIM_POINTS if corners[0] > 2 else 0)
    return _COUNT.get(kind, 1)
