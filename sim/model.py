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

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Integers = NDArray[np.int64]
Ranges = NDArray[np.int64]  # (n, 2) first, and one past the last


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


class Model(NamedTuple):
    """One mechanism: constant during a run. Body i hangs on joint i; parents come before children."""

    # topology
    body_parent: Integers  # (nbody,) index of the parent body, -1 for the world
    body_leaf: Integers  # (nbody,) 1 where no body hangs on this one
    body_qadr: Integers  # (nbody + 1,) first coordinate of joint i in q
    body_vadr: Integers  # (nbody + 1,) first velocity of joint i in v: translations first, then rotations
    joint_ntrans: Integers  # (nbody,) free translations, 0 to 3
    joint_nrot: Integers  # (nbody,) free rotations: 0, 1 (about joint_axis) or 3 (quaternion)
    dof_body: Integers  # (nv,) body of each degree of freedom
    dof_qadr: Integers  # (nv,) coordinate of a scalar dof in q; for a quaternion dof, that of its quaternion
    contact_body: Integers  # (ncontact,)
    contact_law: Integers  # (ncontact,) Law
    cluster_end: Integers  # (ncontact,) of the cluster whose first contact this is, one past its last; see far.py
    limit_dof: Integers  # (nlimit,) a scalar degree of freedom
    input_kind: Integers  # (nu,) InputKind
    input_index: Integers  # (nu,) degree of freedom, or body
    # numbers
    body_mass: Vector  # (nbody,) [kg]
    body_inertia: Matrix  # (nbody, 9) about the centre of mass, body axes [kg m^2]
    joint_parent_point: Matrix  # (nbody, 3) joint frame in the parent body, from its centre of mass [m]
    joint_child_point: Matrix  # (nbody, 3) joint point in the child body, from its centre of mass [m]
    joint_offset: Matrix  # (nbody, 4) orientation of the joint frame in the parent body, quaternion
    joint_trans_axes: Matrix  # (nbody, 9) free translation directions in the joint frame, one per row
    joint_axis: Matrix  # (nbody, 3) rotation axis of a one-axis joint, joint frame
    dof_spring: Vector  # (nv,) [N/m, N m/rad]
    dof_damper: Vector  # (nv,) [N s/m, N m s/rad]
    dof_rest: Vector  # (nv,) spring rest of a scalar dof; of a quaternion dof, component of its rotation vector
    contact_point: Matrix  # (ncontact, 3) sphere centre in the body, from its centre of mass [m]
    contact_radius: Vector  # (ncontact,) [m], 0 for a point
    contact_friction: Vector  # (ncontact,) coefficient
    contact_frame: Matrix  # (ncontact, 9) rows: normal and two tangents of the half-space, world axes
    contact_height: Vector  # (ncontact,) the half-space is normal . x >= height [m]
    cluster: Matrix  # (ncontact, 8) bounding balls and mobilities, in the row of the first contact; see far.py
    limit_sign: Vector  # (nlimit,) +1 for a lower, -1 for an upper bound
    limit_bound: Vector  # (nlimit,) [m, rad]
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
    body_impulse: Matrix  # (nbody, 6) force and torque impulses of BODY inputs, world axes, at the centre of mass
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
    counts: Integers  # (2,) runs of near contacts, far clusters
    near: Ranges  # (ncontact, 2) first contact, and one past the last, of each run of near contacts
    far_first: Integers  # (ncontact,) first contacts of the far clusters
    far: Matrix  # (ncontact, 24) see far.py
    far_law: Vector  # (2,) kappa, and the change of a far cluster's impulses that nobody sees
    # contacts
    cone: Matrix  # (ncontact, 12) cone variables, see contact.py
    cone_step: Matrix  # (ncontact, 12)
    cone_trial: Matrix  # (ncontact, 12)
    contact_kin: Matrix  # (ncontact, 24) gap, tangential velocity, arms and their Jacobian
    contact_W: Matrix  # (ncontact, 9) d(impulse)/d(gap, slip), contact frame
    contact_w: Matrix  # (ncontact, 3) constant part of the same
    contact_scale: Matrix  # (ncontact, 16) scaling of the cone
    # limits
    bound: Matrix  # (nlimit, 2) slack, impulse
    bound_step: Matrix  # (nlimit, 2)
    bound_trial: Matrix  # (nlimit, 2)
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
