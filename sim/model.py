"""Model, Work: what kernels read and write, as NamedTuples of arrays.

Compiled code takes each as one pointer (solvers/record.py); layout.py holds the shapes and allocates them.

Glossary, one meaning each, everywhere in `sim`:

    configurations   1 previous, 2 current, 3 next; the state is (q2, v15), the unknown of a step is v25
    h                time step [s]
    kappa            central-path parameter [N s m]
    twist            (linear velocity at O, angular velocity), world axes
    wrench           (force, moment about O), world axes; impulses [N s, N m s] wherever a step is meant
    O                the common reference point of a step, the position of body 0 at configuration 2
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solvers.status import Status

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Integers = NDArray[np.int64]
IntegerMatrix = NDArray[np.int64]


class Law(IntEnum):
    """Contact law."""

    IMPACT = 0  # normal impulse only
    LINEAR = 1  # friction in a four-sided pyramid
    NONLINEAR = 2  # friction in the exact second-order cone


class InputKind(IntEnum):
    """What an input acts on."""

    JOINT = 0  # one joint coordinate
    WORLD = 1  # wrench on a body at its centre of mass, world axes
    BODY = 2  # wrench on a body at its centre of mass, body axes


class Late(IntEnum):
    """Kernels called by their address (solvers/late.py), bound by sim/bind.py: where each is in `Model.late`."""

    # what all scenes do, compiled once
    STEP = 0
    SOLVE = 1  # the unknown of a step: interior point or Newton
    GRADIENT = 2
    # contacts and limits
    REPORT_CONTACTS = 3
    WORST_CONTACT = 4
    STIFFNESS = 5
    LIMIT_DERIVATIVES = 6
    # joints with two rotations, and cones
    SWING_POSE = 7
    SWING_CURVATURE = 8
    CONE_GAP = 9
    CONE_BLOCK = 10
    CONE_DERIVATIVE = 11
    # loops, and pairs of bodies in contact
    FACTOR_COUPLING = 12
    SOLVE_COUPLING = 13
    SOLVE_COUPLING_PANEL = 14
    COUPLING_COMPOSITES = 15
    COUPLING_DERIVATIVES = 16
    START_LOOPS = 17
    APPLY_LOOPS = 18
    KEEP_LOOPS = 19
    MOVE_LOOPS = 20
    PAIR_KINEMATICS = 21
    PAIR_RATE = 22
    CONDENSE_PAIRS = 23
    APPLY_PAIRS = 24
    PAIR_CONSTANTS = 25
    REPORT_PAIRS = 26
    # friction pyramids
    START_PYRAMID = 27
    PYRAMID_ERROR = 28
    PYRAMID_PRODUCTS = 29
    PYRAMID_PRODUCTS_AHEAD = 30
    PYRAMID_BOUNDARY = 31
    RETURN_PYRAMID = 32
    CONDENSE_PYRAMID = 33
    PYRAMID_CONSTANT = 34
    RECOVER_PYRAMID = 35
    # springs of quaternion joints
    SPRING_IMPULSE = 36
    SPRING_BLOCK = 37
    SPRING_DERIVATIVE = 38
    # terrain
    TERRAIN_PLACE = 39
    TERRAIN_TURN = 40
    TERRAIN_MATRIX = 41
    TERRAIN_GAP = 42
    TERRAIN_FAR = 43
    # restitution
    FIND_IMPACTS = 44
    SUBTRACT_FLOORS = 45
    GAINED_ENERGY = 46
    BOUNCE_COMPOSITES = 47
    BOUNCE_DERIVATIVES = 48
    # which pairs, and which of their elements
    BEGIN_PAIRS = 49
    ENLIST_PAIRS = 50
    CHOOSE_PAIRS = 51
    OVERLAPPING = 52
    FAR_PAIR_IMPULSES = 53
    PAIRS_CAME_NEAR = 54
    ALL_NEAR = 55
    # gears
    APPLY_GEARS = 56
    # derivatives by the heights of a terrain, and by radii on it
    HEIGHT_GRADIENT = 57
    RADIUS_ON_TERRAIN = 58
    # loops that pass singular configurations
    CLOSE_VELOCITY = 59
    PREDICT_LOOPS = 60
    LOOPS_GAINED = 61
    LEAD_AGAIN = 62
    MEET_AHEAD = 63
    FARTHER = 64
    # cylinders against polytopes and cylinders
    CYLINDER_DISTANCE = 65
    COLLIDE_CYLINDERS = 66
    CHOOSE_CYLINDERS = 67
    CYLINDER_BEFORE = 68
    # joints with two rotations, over an interval
    SWING_TURN = 69
    # energy from collisions of polytopes and cylinders
    PAIRS_GAINED = 70


class Model(NamedTuple):
    """One mechanism: constant during a run. Body i hangs on joint i; parents come before children."""

    # topology
    body_parent: Integers  # (nbody,) index of the parent body, -1 for the world
    body_leaf: Integers  # (nbody,) 1 where no body hangs on this one
    body_qadr: Integers  # (nbody + 1,) first coordinate of joint i in q
    body_vadr: Integers  # (nbody + 1,) first velocity of joint i in v: translations first, then rotations
    joint_ntrans: Integers  # (nbody,) free translations, 0 to 3
    joint_nrot: Integers  # (nbody,) free rotations: 0, 1 (about joint_axis), 2 (swing, across it) or 3 (quaternion)
    dof_body: Integers  # (nv,) body of each degree of freedom
    dof_qadr: Integers  # (nv,) coordinate of a scalar dof in q; for a quaternion dof, that of its quaternion
    contact_body: Integers  # (ncontact,) contacts with the ground come first, then the pairs
    contact_law: Integers  # (ncontact,) Law
    late: Integers  # addresses of kernels, by `Late`; 0 where the scene has no use for one, or had none so far
    contact_terrain: Integers  # (nground,) 1 + its terrain, 0 for a half-space
    terrain_size: IntegerMatrix  # (nterrain, 3) first of its coefficients, and their number along x and y
    cluster_end: (
        Integers  # (nground,) of the cluster whose first contact this is, one past its last; see contacts/far.py
    )
    pair_coupling: Integers  # (npair,) the coupling of its two bodies
    pair_kind: Integers  # (npair,) of shapes
    pair_feature: Integers  # (npair,) which point of a pair of shapes with several
    coupling_body: IntegerMatrix  # (ncoupling, 2) bodies a and b, -1 for the world; loops after pairs
    coupling_row: Integers  # (ncoupling + 1,) first row in the dense system
    loop_ntrans: Integers  # (nloop,) free translations
    loop_nrot: Integers  # (nloop,) free rotations
    gear_dof: IntegerMatrix  # (ngear, 2) the degree of freedom that follows, and the one that leads
    limit_dof: Integers  # (nlimit,) a scalar degree of freedom; of a cone, the first of its three rotations
    limit_cone: Integers  # (nlimit,) 1 where the angle between the axes of parent and child is limited
    input_kind: Integers  # (nu,) InputKind
    input_index: Integers  # (nu,) degree of freedom, or body
    # numbers
    body_mass: Vector  # (nbody,) [kg]
    body_inertia: Matrix  # (nbody, 9) about the centre of mass, body axes [kg m^2]
    joint_parent_point: Matrix  # (nbody, 3) joint frame in the parent body, from its centre of mass [m]
    joint_child_point: Matrix  # (nbody, 3) joint point in the child body, from its centre of mass [m]
    joint_offset: Matrix  # (nbody, 4) orientation of the joint frame in the parent body, quaternion
    joint_trans_axes: Matrix  # (nbody, 9) free translation directions in the joint frame, one per row
    joint_axis: Matrix  # (nbody, 3) rotation axis of a one-axis joint, axis of a cone limit; joint frame
    joint_swing_axes: Matrix  # (nbody, 6) the two directions across the axis of a swing, joint frame
    dof_spring: Vector  # (nv,) [N/m, N m/rad]
    dof_damper: Vector  # (nv,) [N s/m, N m s/rad]
    dof_armature: Vector  # (nv,) inertia that moves with a scalar dof alone, a rotor's [kg, kg m^2]
    dof_rest: Vector  # (nv,) spring rest of a scalar dof; of a quaternion dof, component of its rotation vector
    contact_point: Matrix  # (nground, 3) sphere centre in the body, from its centre of mass [m]
    contact_radius: Vector  # (nground,) [m], 0 for a point
    contact_friction: Vector  # (ncontact,) coefficient
    contact_restitution: Vector  # (ncontact,) share of the normal velocity that an impact gives back
    contact_frame: Matrix  # (nground, 9) rows: normal and two tangents of the half-space, world axes
    contact_height: Vector  # (nground,) the half-space is normal . x >= height [m]; of terrain, to be added to it
    terrain_place: Matrix  # (nterrain, 8) see terrain/height_field.py
    terrain_heights: Vector  # (nheight,) coefficients of all terrains [m]
    terrain_rates: Vector  # (nheight,) their derivatives by the radius of the contacts
    cluster: Matrix  # (nground, 8) bounding balls and mobilities, in the row of the first contact; see contacts/far.py
    pair_sizes: Matrix  # (npair, 8) of the shapes of a, then of b
    pair_far: Matrix  # (npair, 7) what says that a collision is far (pairs/far.py), at its first pair
    hull: Matrix  # (nhull, 4) tables of the polytopes that collide (collision/hull.py)
    body_reach: Vector  # (nbody,) largest distance of the shapes that collide from the centre of mass [m]
    pair_place: Matrix  # (2 npair, 12) centre and rotation of the shapes of a and of b in their bodies
    loop_point: Matrix  # (nloop, 6) joint frame on b, joint point on a, from their centres of mass [m]
    loop_offset: Matrix  # (nloop, 9) orientation of the joint frame on b, rotation matrix
    loop_axes: Matrix  # (nloop, 9) translations that are not free, one per row, joint frame
    loop_axis: Matrix  # (nloop, 9) two directions across the free axis, and the axis, joint frame
    gear_ratio: Vector  # (ngear,)
    gear_offset: Vector  # (ngear,) [m, rad]
    limit_sign: Vector  # (nlimit,) +1 for a lower, -1 for an upper bound
    limit_bound: Vector  # (nlimit,) [m, rad]; of a cone, its half angle
    input_wrench: Matrix  # (nu, 6) force and torque per unit of a WORLD or BODY input
    gravity: Vector  # (3,) [m/s^2]


class Work(NamedTuple):
    """Scratch of one step, allocated once per thread by `Simulator`; also holds what derivatives need afterwards."""

    origin: Vector  # (3,) the reference point O
    # configuration 2
    theta1: Vector  # (nq,) coordinates at 1
    theta3: Vector  # (nq,) coordinates at 3
    nu: Vector  # (nv,) the unknown v25
    nu_trial: Vector  # (nv,) v25 before the step of the line search
    dnu: Vector  # (nv,) Newton step
    pos1: Matrix  # (nbody, 3)
    quat1: Matrix  # (nbody, 4)
    rot1: Matrix  # (nbody, 9)
    pos2: Matrix
    quat2: Matrix
    rot2: Matrix
    pos3: Matrix
    quat3: Matrix
    rot3: Matrix
    S1: Matrix  # (nv, 6) joint columns d(pose 1)/d(q2) at constant v15
    S2: Matrix  # (nv, 6) test directions
    S3: Matrix  # (nv, 6) d(pose 3)/d(q2) at constant v25
    S3nu: Matrix  # (nv, 6) d(pose 3)/d(v25)
    inertia_world: Matrix  # (nbody, 9) at configuration 2
    momentum_in: Matrix  # (nbody, 6) momentum of interval 1-2 at node 2 plus applied impulses, at the centre of mass
    momentum_out: Matrix  # (nbody, 6) momentum of interval 2-3, likewise without impulses
    body_impulse: Matrix  # (nbody, 6) force and torque impulses of BODY inputs, world axes, at the centre of mass
    arm: Matrix  # (nbody, 6) at configuration 2, world axes: joint frame from the parent, joint point from the body
    turn_matrix: Matrix  # (nbody, 9) rotation matrix of the turn from configuration 2 to 1 or 3, less the identity
    move_in: Matrix  # (nbody, 3) displacement of the centre of mass over interval 1-2
    move: Matrix  # (nbody, 3) displacement over interval 2-3
    turn_in: Matrix  # (nbody, 4) rotation of interval 1-2: (cos, sin * axis), world axes
    turn: Matrix  # (nbody, 4) rotation of interval 2-3, likewise
    balance: Matrix  # (nbody, 6) momentum balance of each body without contacts, about O
    wrench: Matrix  # (nbody, 6) momentum balance with contacts; summed over the subtree by `project`
    subtree: Matrix  # (nbody, 6) scratch of tree sums
    residual: Vector  # (nv,) generalized residual
    rhs: Vector  # (nv,)
    # elimination
    A: Matrix  # (nbody, 36) articulated matrix of each subtree
    U: Matrix  # (nv, 6) columns A S3nu
    L: Matrix  # (nv, 6) rows D^-1 S2^T A
    D: Matrix  # (nbody, 37) LU factors of the joint blocks S2^T A S3nu + joint_block, and their row exchanges
    joint_block: Matrix  # (nbody, 36) joint-space terms: dampers, springs, limits
    z: Vector  # (nv,)
    twist: Matrix  # (nbody, 6) body twists of the last solve
    # near and far contacts
    counts: Integers  # (4,) runs of near contacts (with that of pairs: 2), far clusters; steps handed on by advance.py
    near: IntegerMatrix  # (ncontact, 2) first contact, and one past the last, of each run of near contacts
    far_first: Integers  # (nground,) first contacts of the far clusters
    pair_sides: Integers  # (npair,) axes that separate the shapes at configuration 2, at the first pair of a collision
    pair_code: Integers  # (npair,) elements that make each contact point, chosen where an attempt starts
    pair_kept: Integers  # (npair,) of the choice before, those that pressed; 0 for the others
    loop_led: Integers  # (2,) rows of loop_lead in use; 1: in place of constraints too
    loop_used: Integers  # (nrow,) scratch
    coupling_live: Integers  # (ncoupling,) 1 for two bodies with near pairs
    couple_live: IntegerMatrix  # (nrow, 2) rows of the dense system, with their couplings
    pair_free: Integers  # (1,) 1: elements are chosen anew at every pose; 2: those that press are kept beside new ones
    far: Matrix  # (nground, 24) see contacts/far.py
    far_law: Vector  # (2,) kappa, and the change of a far cluster's impulses that nobody sees
    # contacts
    cone: Matrix  # (ncontact, 12) cone variables, see contacts/contact.py
    cone_step: Matrix  # (ncontact, 12)
    cone_trial: Matrix  # (ncontact, 12)
    contact_kin: Matrix  # (ncontact, 27) gap, tangential velocity, arms and their Jacobian
    contact_frame: Matrix  # (nground, 9) rows: normal and two tangents of the ground, world axes
    contact_turn: Matrix  # (nground, 18) on terrain, rotation of the frame by the twist
    bounce: Matrix  # (ncontact, 22) see contacts/restitution.py
    bounce_share: Vector  # (1,)
    contact_W: Matrix  # (ncontact, 9) d(impulse)/d(gap, slip), contact frame
    contact_w: Matrix  # (ncontact, 3) constant part of the same
    contact_scale: Matrix  # (ncontact, 16) scaling of the cone
    # pairs
    shape_pos: Matrix  # (2 npair, 3) centres of their shapes at configuration 3
    shape_rot: Matrix  # (2 npair, 9)
    pair_relative: Matrix  # (npair, 12) pose of shape a in the frame of shape b
    pair_out: Matrix  # (npair, 43) what `collide` says
    pair_before: Matrix  # (npair, 13) pair_relative at configuration 2, and the gap that elements had at least there
    pair_apart: Vector  # (npair,) half the gap ahead of a far collision, 0 of a near one, at its first pair
    pair_far_state: Vector  # (3,) see pairs/far.py
    far_pose: Matrix  # (nbody, 7) poses where the far collisions were evaluated
    far_wrench: Matrix  # (nbody, 6) their wrenches about O
    pair_trial: Matrix  # (1, 43) what `collide` wrote last, of a choice that is not kept
    pair_frame: Matrix  # (npair, 12) rows n, t1, t2 and the contact point, world axes
    pair_turn: Matrix  # (npair, 18) rotation of the frame by the relative twist
    pair_shift: Matrix  # (npair, 18) displacement of the contact point by the relative twist
    pair_Ca: Matrix  # (npair, 18) d(gap, slip)/d(twist of a)
    pair_Cb: Matrix  # (npair, 18)
    pair_rows: Matrix  # (2, 6) scratch
    pair_scratch: Vector  # (18,)
    # couplings
    coupling_K: Matrix  # (2 ncoupling, 36) d(wrench on a)/d(twist of a), then of b
    coupling_K2: Matrix  # (2 ncoupling, 36) the same by twists of configuration 2
    couple_B: Matrix  # (nrow, 6) wrench on a of a unit force
    couple_G: Matrix  # (nrow, 6) constraint directions of loops at configuration 3
    couple_R: Matrix  # (nrow, 12) what a force resists, of the twists of a and b
    couple_E: Vector  # (nrow,) how much it gives, 0 for loops
    couple_Y: Matrix  # (nrow, nv) answer of the tree to a unit force
    couple_T: Matrix  # (nrow, nrow) the dense system
    couple_pivots: Matrix  # (nrow, 2)
    couple_rank: Vector  # (3,) rank and size of the dense system, and its least pivot that counts
    couple_scale: Vector  # (nrow,)
    couple_x: Matrix  # (nrow, 1)
    couple_gap: Vector  # (nrow,) of loops
    couple_force: Vector  # (nrow,) impulses of loops
    couple_step: Vector  # (nrow,)
    couple_trial: Vector  # (nrow,)
    couple_panel: Matrix  # (nrow, 2 nv + nu)
    couple_wrench: Vector  # (6,) scratch
    loop_frame: Matrix  # (nloop, 12)
    loop_turn: Matrix  # (nloop, 9)
    loop_velocity: Vector  # (nv,) where a step begins to look for its velocity
    loop_start: Vector  # (nv,) where it looks for another one
    loop_kept: Vector  # (nv,) the first of them
    loop_pivot: Vector  # (1,) least pivot of the dense system at configuration 2
    loop_lead: Matrix  # (nrow, nv) directions of forces in joint space, or 0, see coupling/loop_lead.py
    loop_scale: Vector  # (nrow,) scratch
    loop_open: Vector  # (nrow,) |gap| of loops at configuration 2
    gear_rate: Matrix  # (ngear, 2) d(gap)/d(v25) of both
    # limits
    bound: Matrix  # (nlimit, 2) slack, impulse
    bound_step: Matrix  # (nlimit, 2)
    bound_trial: Matrix  # (nlimit, 2)
    bound_row: Matrix  # (nlimit, 6) of a cone: torque per unit of impulse, and d(gap)/d(v25); by rotation
    bound_gap: Vector  # (nlimit,)
    bound_w: Vector  # (nlimit,)
    # derivatives
    A1: Matrix  # (nbody, 36) d(balance)/d(pose 1), about O
    A2: Matrix  # (nbody, 36)
    A3: Matrix  # (nbody, 36)
    F: Matrix  # (nv, 18) columns of the composites times unit columns
    G: Matrix  # (nv, 18) rows of test directions times the composites
    dR_dq: Matrix  # (nv, nv)
    dR_dv: Matrix  # (nv, nv)
    columns: Matrix  # (nv, 2 nv + nu) right-hand sides and solutions
    panel: Matrix  # (6 nbody, 2 nv + nu) wrenches, then twists, of all columns
    step_A: Matrix  # (2 nv, 2 nv) of one step of a knot
    step_B: Matrix  # (2 nv, nu)
    chain: Matrix  # (2 nv, 2 nv + nu) their product with those of the steps before
    step_x: Matrix  # (2, nq + nv) states inside a knot
    report: Vector  # (5,) of a step nobody asks about


class Options(NamedTuple):
    """Settings of a step."""

    h: float  # time step [s]
    kappa: float  # central-path parameter [N s m]
    tolerance: float  # largest residual [N s, m, m/s], times the scale of the momenta
    max_iterations: int


class Guess(NamedTuple):
    """Where a step may start to look for its solution; how good a guess it is, is found out."""

    velocity: Vector  # (nv,) of v25
    impulses: bool  # work holds the impulses of the step before


class Goal(NamedTuple):
    """What a Newton step of the interior point aims at."""

    kappa: float  # target of the complementarity products
    share: float  # part of the equality residuals to remove
    corrected: bool  # subtract the second-order term of the affine step in `cone_step`


class Outcome(NamedTuple):
    """How a step ended."""

    status: int
    iterations: int
    residual: float  # largest equality residual
    violation: float  # largest |product - kappa| of complementary pairs


FAILED = Outcome(int(Status.NO_PROGRESS), 0, 1e300, 1e300)
