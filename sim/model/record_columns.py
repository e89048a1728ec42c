"""Names of the columns of Model and Data: of a field, the first column of each of its parts.

    k = data.contact_kin[c]
    k[Kin.GAP], k[Kin.ARM + 1]

Rows that are matrices, row by row, such as rotations, have none: `W[3]` is entry (1, 0).
"""

from __future__ import annotations

from solvers.codes import Code


class Kin(Code):
    """contact_kin: geometry of a contact at configuration 3."""

    GAP = 0
    SLIP1 = 1  # tangential velocity along t1 and t2
    SLIP2 = 2
    ARM = 3  # (3,) from the centre of mass to where the impulse acts
    POINT = 6  # (3,) from the centre of mass to the contact point of the body, R3 p
    BY_ROTATION = 9  # (3, 3) d(gap, slip)/d(rotation about O)
    BY_TRANSLATION = 18  # (3, 3) d(gap, slip)/d(translation)


class Dry(Code):
    """dry, dry_step and dry_trial: variables of the dry friction of a joint, or of a servo with limits of its force."""

    FORWARD = 0  # motion forward
    LEFT_FORWARD = 1  # F + lambda
    BACKWARD = 2
    LEFT_BACKWARD = 3  # F - lambda


class Drive(Code):
    """dry_drive: the servo of an element in this step (joints/limited_servo.py), zero of dry friction."""

    REST = 0  # r
    COMPLIANCE = 1  # e
    MEAN = 2  # M


class DryMove(Code):
    """dry_move: the motion of an element in this step, and the bound of its impulse."""

    MOTION = 0
    BOUND = 1


class DryConstant(Code):
    """dry_w: constant parts of the step of an element."""

    IMPULSE = 0
    FORWARD = 1
    BACKWARD = 2


class Gain(Code):
    """dry_gain: those of a servo with limits of its force."""

    INPUT = 0  # force per unit of its input
    STIFFNESS = 1
    DAMPING = 2


class PairFrame(Code):
    """pair_frame: the rows n, t1, t2 of a frame, and behind them"""

    POINT = 9  # (3,) the contact point, world axes


class Cone(Code):
    """cone, cone_step and cone_trial: variables of a contact with the exact cone."""

    SLACK = 0  # of the gap
    IMPULSE = 1  # along the normal
    FRICTION1 = 2  # beta, along t1 and t2
    FRICTION2 = 3


class Pyramid(Code):
    """Columns of `cone` for a contact with a friction pyramid."""

    SLACK = 0
    IMPULSE = 1
    SPEED = 2  # psi
    CAP = 3  # s_psi, the remainder of the friction bound
    FRICTION = 4  # (4,) beta, along t1, -t1, t2, -t2
    SLIP = 8  # (4,) s, slip in these directions, plus psi


class Moment(Code):
    """Columns of `cone` for friction against spinning and rolling (contact/moments/), behind those of either law."""

    SPIN = 12  # about the normal; the next column is zero
    ROLL = 14  # (2,) about t1 and t2


class MomentRow(Code):
    """moment_friction: likewise the two rows of each contact in moment_kin, moment_W, moment_scale and moment_w."""

    SPIN = 0
    ROLL = 1


class ConeScale(Code):
    """contact_scale of a contact with the exact cone."""

    GROWTH = 0  # (2,) d(beta)/d(mu gamma), of beta1 and beta2
    RESIDUAL = 2  # (2,) of the law, as a change of -beta


class PyramidScale(Code):
    """contact_scale of a contact with a pyramid."""

    RATIO = 0  # (4,) beta_i / s_i
    SUM = 4  # (2,) sum of the ratios times their directions
    INVERSE = 6  # 1/(s_psi + psi sum of ratios)
    SPEED = 7  # constant part of dpsi
    FRICTION = 8  # (4,) constant parts of dbeta


class Inactive(Code):
    """inactive: a cluster whose impulses are evaluated, at its first contact (contact/inactive.py)."""

    ACTIVATION = 0  # gap below which the cluster is active; 0 where it is
    BY_GAP = 1  # bounds of d(wrench about O): per gap, per slip, per turn
    BY_SLIP = 2
    BY_TURN = 3
    POSITION = 4  # (3,) of the body when the impulses were evaluated, with
    QUATERNION = 7  # (4,)
    VELOCITY = 11  # (3,)
    ANGULAR = 14  # (3,) its angular velocity
    FORCE = 17  # (3,)
    MOMENT = 20  # (3,) about the centre of mass
    LEAST_GAP = 23  # smallest gap; 0 where the impulses were not evaluated
    HEIGHT = 24  # largest height of a plane
    ARMS = 25  # (3, 3) sums of p times the impulses along n, t1 and t2
    RADIUS_ARMS = 34  # (2,) sums of radius times impulse along t1 and t2
    TURNED = 36  # 1 where only the arms have been turned since the impulses were evaluated
    STIFF = 37  # 1 where derivatives do not omit it
    CORNERS = 38  # 1 where its law is in the matrix (contact/corners.py)
    SHARE = 39  # `indefinite` of the law in corner_law; -1 where that has not been evaluated
    DRIFT = 40  # bound of the relative change of that law since it was evaluated
    TURNING = 41  # (3,) sum of the moments of torsional and rolling friction
    BY_RATE = 44  # bound of d(wrench about O) per angular velocity


class Corner(Code):
    """corners: rows of numbers by contact with the ground, for clusters of corners (contact/corners.py)."""

    POINT = 0  # (3,) in the body
    FRICTION = 3
    OFFSET = 4  # height of the plane
    OUT = 5  # 1 for an inactive contact, 0 for an active one
    GAP = 6  # of the last evaluation, with
    IMPULSE = 7
    FRICTION1 = 8  # beta
    FRICTION2 = 9


class Apart(Code):
    """inactive and pair_apart, in motions of higher order: the node in `data` (integrators/phases.py)."""

    GAP = 0
    SPEED = 1


class Cluster(Code):
    """cluster: contacts of one body against one direction, as one ball (mechanism/pack_clusters.py)."""

    CENTER = 0  # (3,) in the body
    RADIUS = 3
    ARM = 4  # largest distance from the centre of mass
    MOBILITY = 5  # M of contact/inactive.py
    FRICTION = 6  # largest
    TURNING = 7  # T
    CONTACTS = 8  # those of its body
    CORNERS = 9  # 1 for many points on a plane, as of a mesh (contact/corners.py)
    LENGTH = 10  # largest torsional and largest rolling friction, the sum [m]; 0 where there is none, and so are
    SPIN = 11  # their largest^2 N of moments/inactive_moments.py, and
    SPIN_GROWTH = 12  # LENGTH sqrt(M N)


class Bounce(Code):
    """bounce: impact of a contact (contact/restitution.py)."""

    FLOOR = 0
    RESTITUTION = 1  # in this step; 0 without an impact
    ROW1 = 2  # (6,) d(gap at configuration 1)/d(twist of configuration 1)
    ROW2 = 8  # (6,) the same of 2
    GAP1 = 14
    GAP2 = 15
    POINT1 = 16  # (3,) of pairs, the contact point at configuration 1
    POINT2 = 19  # (3,)


class Hull(Code):
    """hull: first row of a convex polytope (collision/polytope_table.py); its corners, edges and faces follow."""

    CORNERS = 0  # how many
    EDGES = 1
    FACES = 2


class HullEdge(Code):
    """Row of an edge."""

    START = 0  # corner, counted from the first one
    END = 1
    LEFT = 2  # face, counted from the first one
    RIGHT = 3


class HullFace(Code):
    """Row of a face: its outward unit normal (3,), and then"""

    OFFSET = 3  # n.x of its points


class DistanceGrid(Code):
    """First row of a grid of signed distances (collision/level_set.py); its first corner (3,) and values follow."""

    NX = 0  # number of values
    NY = 1
    NZ = 2
    DENSITY = 3  # cells per length [1/m]


class ColumnVector(Code):
    """Vectors (6,) of a column S of a joint, in Slopes (integrators/hamilton_gradient.py)."""

    CONVECTION = 0  # of S by the twist of the parent
    RATE = 1  # S'
    MOMENTUM = 2  # I S
    MOMENTUM_RATE = 3  # S* P + I S'
    FORCE = 4  # S* F + N^T S
    GYROSCOPIC = 5  # S* P - I CONVECTION
    WRENCH = 6  # N S


class Witness(Code):
    """pair_out and pair_trial: the results of `collide`, in the frame of shape b."""

    GAP = 0
    NORMAL = 1  # (3,)
    POINT = 4  # (3,)
    NORMAL_RATE = 7  # (3, 6) by the twist of a about the origin of b
    POINT_RATE = 25  # (3, 6)


class RelativePose(Code):
    """pair_before, pair_relative: rotation (9,) and centre of shape a in the frame of shape b, before also with"""

    CENTER = 9  # (3,)
    GAP = 12  # least gap of the features there
    LEFT = 13  # overlap that the step may leave [m]


class PairBound(Code):
    """pair_bound: the data that decide whether a collision is active (pairs/inactive_pairs.py), at its first pair."""

    RADII = 0  # sum of those of the balls around the shapes
    DISTANCE = 1  # (2,) largest distances of the shapes from the centres of mass
    MOBILITY = 3
    TURNING = 4
    COLLISIONS = 5  # that one of its bodies has
    POINTS = 6
    REACH = 7  # gap from which there is no force, infinite for most
    LENGTH = 8  # torsional and rolling friction, the sum [m]
    SPIN = 9  # as in Cluster
    SPIN_GROWTH = 10
    SPIN_TURNING = 11  # LENGTH N


class PairFade(Code):
    """pair_fade: the part w of the impulse of a pair that acts within a reach (pairs/limited_reach.py)."""

    PART = 0
    RATE = 1  # d(log w)/d(gap)


class Travel(Code):
    """body_travel: how far points of a body with collisions have moved, at most (pairs/limited_reach.py)."""

    BEFORE = 0  # since the motion began, along the configurations where steps began
    AHEAD = 1  # in this step, if it is like the one before
    POSE = 2  # (7,) pose where BEFORE ends


class TerrainSize(Code):
    """terrain_size: the coefficients of a terrain."""

    FIRST = 0
    ALONG_X = 1  # number
    ALONG_Y = 2


class PairSize(Code):
    """pair_sizes: first of the sizes of each shape."""

    A = 0
    B = 4


class JointFactor(Code):
    """D: LU factors of the block of a joint, (n, n)."""

    INVERSE = 0  # of a block of one row, instead of factors
    SWAPS = 36  # exchanges of rows


class DirectionRow(Code):
    """F: scratch of a test direction, and behind it"""

    TURNED = 12  # (6,) the residual wrench times the rotation by the direction


class LoopClock(Code):
    """loop_clock: when to go back to Python."""

    DEADLINE = 0  # [s]
    EFFORT = 1  # since the last look at the clock


class Grid(Code):
    """terrain_place: a height field in the plane (contact/height_field.py)."""

    DIRECTION = 0  # (2,) of the first axis
    ORIGIN = 2  # (2,) [m]
    DENSITY = 4  # (2,) lines per metre
    SLOPE = 6  # bound of sqrt(1 + |grad F|^2)
    CURVATURE = 7  # bound of the second derivatives of F [1/m]


class CoupleRank(Code):
    """couple_rank: the system of loops, gears and pairs."""

    RANK = 0
    SIZE = 1
    PIVOT = 2  # least that counts
    DEFICIENCY = 3  # least of this motion


class Bound(Code):
    """bound, bound_step and bound_trial: variables of a limit."""

    SLACK = 0
    IMPULSE = 1


class BoundRow(Code):
    """bound_row: a cone limit, by rotation."""

    TORQUE = 0  # (3,) per unit of impulse
    RATE = 3  # (3,) d(gap)/d(v25)


class StepSetting(Code):
    """The settings of a step in an array, as loops over time read them (integrators/rollout.py)."""

    TIME_STEP = 0  # [s]
    KAPPA = 1  # central-path parameter [N s m]
    TOLERANCE = 2
    MAX_ITERATIONS = 3
    DEADLINE = 4  # when to go back to Python [s] (model/interruptible_loops.py)
    GAIN = 5  # largest gain of energy (solve/energy_balance.py)
    LOSS = 6
    IMPULSES = 7  # 1 where the first step may start from the impulses in its Data, those of a step before it
    CUTOFF = 8  # stiffness over mass of far contacts (contact/far_contacts.py), 0: none is far
    LEFT = 9  # part of the overlaps of shapes where a step begins that it may leave


class StepReport(Code):
    """The report of a step."""

    STATUS = 0  # Status
    ITERATIONS = 1
    RESIDUAL = 2
    VIOLATION = 3  # largest |product - kappa| of complementary pairs
    WORST = 4  # contact with the largest error, -1 for none
    ACCURACY = 5  # estimated error of the derivatives
    PARTS = 6  # of a divided step; with an accuracy, of sub-steps; 0 for a whole one
    LOST = 7  # fraction of the relative momentum of bodies that a divided step lost; of several steps, the largest
    ERROR = 8  # estimated, over the one that an accuracy allows; 0 without one; of several steps, the largest
    EARLIER = 9  # iterations of the steps before, in closed loops; the other reports end before it


class ContactRow(Code):
    """The report of a contact after a step, in world axes (contact/contact_report.py)."""

    IMPULSE = 0  # (3,) [N s]
    POINT = 3  # (3,) [m]
    GAP = 6  # [m]
    SLIP = 7  # speed [m/s]
    NORMAL = 8  # (3,)
    MOMENT = 11  # (3,) of torsional and rolling friction [N m s]; only where a contact of the scene has it
