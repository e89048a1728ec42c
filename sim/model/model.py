"""Model: the arrays that kernels read, as a NamedTuple; data.py has those that they write.

Compiled code takes each as one pointer (solvers/compiler); layout.py holds the shapes and allocates them.

Glossary, one meaning each, everywhere in `sim`:

    configurations   1 previous, 2 current, 3 next; the state is (q2, v15), the unknown of a step is v25
    h                time step [s]
    kappa            central-path parameter [N s m]
    twist            (linear velocity at O, angular velocity), world axes
    wrench           (force, moment about O), world axes; impulses [N s, N m s] wherever a step is meant
    O                the common reference point of a step, the position of body 0 at configuration 2
"""

from __future__ import annotations

from typing import NamedTuple

from solvers.codes import Code
from solvers.types import IntegerMatrix, Integers, Matrix, Vector


class Law(Code):
    """Contact law."""

    IMPACT = 0  # normal impulse only
    LINEAR = 1  # friction in a four-sided pyramid
    NONLINEAR = 2  # friction in the exact second-order cone


class InputKind(Code):
    """The target of an input."""

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
    body_root: Integers  # (nbody,) first body of its tree, the one that moves first; -1 of bodies that cannot move
    tree_end: Integers  # (nbody,) of a root: one past the last body of its tree; bodies of others may lie between
    body_above: IntegerMatrix  # (nbody, nblock) dofs above its joint, as bits of blocks of LANES (solvers/lanes.py)
    body_below: IntegerMatrix  # (nbody, nblock) dofs of its joint and below
    dofs_above: IntegerMatrix  # (nbody, nv) the dofs above the joint of a body, root first
    dofs_below: IntegerMatrix  # (nbody, nv) those of the bodies below, in the order in which solutions are found
    count_above: Integers  # (nbody,) how many
    count_below: Integers  # (nbody,)
    joint_ntrans: Integers  # (nbody,) free translations, 0 to 3
    joint_nrot: Integers  # (nbody,) free rotations: 0, 1 (about joint_axis), 2 (swing, across it) or 3 (quaternion)
    dof_body: Integers  # (nv,) body of each degree of freedom
    dof_qadr: Integers  # (nv,) coordinate of a scalar dof in q; for a quaternion dof, that of its quaternion
    contact_body: Integers  # (ncontact,) contacts with the ground come first, then the pairs
    contact_law: Integers  # (ncontact,) Law
    optional: Integers  # addresses of the optional kernels, by Slot; 0 where the scene has not linked one
    contact_terrain: Integers  # (nground,) 1 + its terrain, 0 for a half-space
    terrain_size: IntegerMatrix  # (nterrain, 3) first of its coefficients, and their number along x and y
    contact_hold: Integers  # (nground,) IDLE or SUNK of mechanism/immovable_contacts.py, 0 for the others
    cluster_end: Integers  # (nground,) one past the last contact of the cluster that begins here (contact/inactive.py)
    pair_coupling: Integers  # (npair,) the coupling of its two bodies
    pair_kind: Integers  # (npair,) of shapes
    pair_feature: Integers  # (npair,) which point of a pair of shapes with several
    coupling_body: IntegerMatrix  # (ncoupling, 2) bodies a and b, -1 for the world; loops after pairs
    coupling_row: Integers  # (ncoupling + 1,) first row in the system of the couplings
    loop_ntrans: Integers  # (nloop,) free translations
    loop_nrot: Integers  # (nloop,) free rotations
    gear_dof: IntegerMatrix  # (ngear, 2) the degree of freedom that follows, and the one that leads
    limit_dof: Integers  # (nlimit,) a scalar degree of freedom; of a cone, the first of its three rotations
    dry_dof: Integers  # (ndry,) degrees of freedom with dry friction, or with a servo that has limits of its force
    dry_input: Integers  # (ndry,) the input of the servo, -1 of dry friction
    limit_cone: Integers  # (nlimit,) 1 where the angle between the axes of parent and child is limited
    input_kind: Integers  # (nu,) InputKind
    input_index: Integers  # (nu,) degree of freedom, or body
    root_free: Integers  # (nbody,) 1 of a root whose momenta are those of its tree, in steps of higher order
    # numbers
    body_mass: Vector  # (nbody,) [kg]
    body_weight: Vector  # (nbody,) share of gravity that acts, 1 without compensation
    body_inertia: Matrix  # (nbody, 9) about the centre of mass, body axes [kg m^2]
    joint_parent_point: Matrix  # (nbody, 3) joint frame in the parent body, from its centre of mass [m]
    joint_child_point: Matrix  # (nbody, 3) joint point in the child body, from its centre of mass [m]
    joint_offset: Matrix  # (nbody, 4) orientation of the joint frame in the parent body, quaternion
    joint_trans_axes: Matrix  # (nbody, 9) free translation directions in the joint frame, one per row
    joint_axis: Matrix  # (nbody, 3) rotation axis of a one-axis joint, axis of a cone limit; joint frame
    joint_lead: Vector  # (nbody,) displacement along joint_axis per radian about it [m/rad]; 0 of a hinge
    joint_swing_axes: Matrix  # (nbody, 6) the two directions across the axis of a swing, joint frame
    dof_spring: Vector  # (nv,) [N/m, N m/rad]
    dof_damper: Vector  # (nv,) [N s/m, N m s/rad]
    dof_seen: Vector  # (nv,) inertia that a damper sees, weighs its velocities [kg, kg m^2] (joints/damper.py)
    dof_armature: Vector  # (nv,) inertia that moves with a scalar dof alone, a rotor's [kg, kg m^2]
    dof_rest: Vector  # (nv,) spring rest of a scalar dof; of a quaternion dof, component of its rotation vector
    contact_point: Matrix  # (nground, 3) sphere centre in the body, from its centre of mass [m]
    contact_radius: Vector  # (nground,) [m], 0 for a point
    contact_friction: Vector  # (ncontact,) coefficient
    moment_friction: Matrix  # (nmoment, 2) torsional and rolling friction [m]: MomentRow; no rows where all are zero
    contact_restitution: Vector  # (ncontact,) share of the normal velocity that an impact gives back
    contact_frame: Matrix  # (nground, 9) rows: normal and two tangents of the half-space, world axes
    contact_height: Vector  # (nground,) the half-space is normal . x >= height [m]; of terrain, to be added to it
    terrain_place: Matrix  # (nterrain, 8) Grid, see contact/height_field.py
    terrain_heights: Vector  # (nheight,) coefficients of all terrains [m]
    terrain_rates: Vector  # (nheight,) their derivatives by the radius of the contacts
    cluster: Matrix  # (nground, 13) in the row of the first contact of a cluster: Cluster
    pair_sizes: Matrix  # (npair, 8) of the shapes of a, then of b
    pair_least: Vector  # (npair,) the smallest of the sizes of both shapes [m]; 1e300 for corners on a half-space
    pair_bound: Matrix  # (npair, 12) at the first pair of a collision, whether it is active: PairBound
    hull: Matrix  # (nhull, 4) tables of the polytopes that collide (collision/polytope_table.py)
    body_reach: Vector  # (nbody,) largest distance of the shapes that collide from the centre of mass [m]
    pair_place: Matrix  # (2 npair, 12) centre and rotation of the shapes of a and of b in their bodies
    loop_point: Matrix  # (nloop, 6) joint frame on b, joint point on a, from their centres of mass [m]
    loop_offset: Matrix  # (nloop, 9) orientation of the joint frame on b, rotation matrix
    loop_axes: Matrix  # (nloop, 9) translations that are not free, one per row, joint frame
    loop_axis: Matrix  # (nloop, 9) two directions across the free axis, and the axis, joint frame
    gear_ratio: Vector  # (ngear,)
    gear_offset: Vector  # (ngear,) [m, rad]
    limit_sign: Vector  # (nlimit,) +1 for a lower, -1 for an upper bound
    dry_force: Vector  # (ndry,) its largest force, or half the range of a servo's [N, N m]
    dry_middle: Vector  # (ndry,) middle of that range [N, N m]
    dry_gain: Matrix  # (ndry, 3) Gain
    limit_bound: Vector  # (nlimit,) [m, rad]; of a cone, its half angle
    input_wrench: Matrix  # (nu, 6) force and torque per unit of a WORLD or BODY input; gain of a JOINT input, first
    gravity: Vector  # (3,) [m/s^2]
    stage_a: Matrix  # (nstage, nstage) coefficients of the stages of steps of higher order, strictly lower
    stage_b: Vector  # (nstage,) weights of their rates in the step
