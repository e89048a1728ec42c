"""Data: the arrays that kernels write, as a NamedTuple; model.py has the glossary, layout.py the shapes."""

from __future__ import annotations

from typing import NamedTuple

from solvers.types import IntegerMatrix, Integers, Matrix, Vector


class Carry(NamedTuple):
    """State between the steps of a motion; a new motion clears all of it."""

    steps: Integers  # (1,) steps of this motion, 0 where configurations have to be computed, see carry_over.py
    travel_known: Integers  # (1,) whether pair_clear and body_travel are those of this motion
    external: Matrix  # (nbody, 6) external force at the centre of mass and torque in this step, world axes [N, N m]
    inactive_kappa: Vector  # (1,) kappa of the impulses of inactive contacts, 0 where none are known
    cone_step: Matrix  # (ncontact, 16) last directions of the cone variables
    bound_step: Matrix  # (nlimit, 2) and of limits
    dry_step: Matrix  # (ndry, 4) and of dry friction
    couple_force: Vector  # (nrow,) impulses of loops
    next_velocity: Vector  # (nv,) v25 where the next step looks first: on a line through the last two


class Data(NamedTuple):
    """Scratch of one step, allocated once per thread by `Simulator`; also holds intermediate results for derivatives.

    The end of a step stays in configuration 3 and `nu`, its impulses in `cone` and `bound`: a step uses them again only
    if it continues a motion, as `carry.steps` and `Guess.impulses` say.
    """

    carry: Carry
    origin: Vector  # (3,) the reference point O
    # configurations 1, 2 and 3, and the motion between them
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
    node_inertia: Matrix  # (nbody, 9) inertia at the node, for its energy, world axes
    node_momentum: Matrix  # (nbody, 6) momentum there, summed over the subtree, about O
    node_p: Vector  # (nv,) the same in joint coordinates
    node_share: Vector  # (nv,) scratch
    wrench: Matrix  # (nbody, 6) momentum balance with contacts; summed over the subtree by `project`
    subtree: Matrix  # (nbody, 6) scratch of tree sums
    residual: Vector  # (nv,) generalized residual
    rhs: Vector  # (nv,)
    # elimination
    A: Matrix  # (nbody, 36) Newton matrix of each body, contacts condensed
    articulated: Matrix  # (6 nbody, 8) articulated matrix of each subtree, and scratch in the last two columns
    U: Matrix  # (nv, 6) columns A S3nu
    L: Matrix  # (nv, 8) rows D^-1 S2^T A, six numbers, and scratch
    D: Matrix  # (nbody, 37) LU factors of the joint blocks S2^T A S3nu + joint_block, and their row exchanges
    joint_block: Matrix  # (nbody, 36) joint-space terms: dampers, springs, limits
    rotor: Vector  # (nv,) armature, less the lag of the damper (joints/damper.py)
    z: Vector  # (nv,)
    twist: Matrix  # (nbody, 6) body twists of the last solve
    # active contacts, part of the equations, and inactive ones, whose impulses are evaluated
    active: Integers  # (ncontact,) the active contacts, those with the ground first
    active_count: Integers  # (1,)
    active_ground_count: Integers  # (1,) how many of them are with the ground
    inactive_count: Integers  # (1,) inactive clusters
    inactive_first: Integers  # (nground,) their first contacts
    contact_out: Integers  # (nground,) 1 for an inactive contact, 2 for a far one
    pair_sides: Integers  # (npair,) axes that separate the shapes at configuration 2, at the first pair of a collision
    pair_code: Integers  # (npair,) elements that make each contact point, chosen where an attempt starts
    pair_previous: Integers  # (npair,) of the choice before, those that pressed; 0 for the others
    bifurcation_count: Integers  # (1,) rows of bifurcation_direction in use
    bifurcation_replaces: Integers  # (1,) 1 where they stand in place of constraints, too
    loop_used: Integers  # (nrow,) scratch
    coupling_live: Integers  # (ncoupling,) 1 for two bodies with active pairs
    near_collision_count: Integers  # (1,)
    near_collisions: Integers  # (npair,) first pairs of the collisions within their reach, see pairs/limited_reach.py
    couple_live: IntegerMatrix  # (nrow, 2) rows of the system of couplings, with their couplings; see coupling_order.py
    couple_seen: Integers  # (ncouple,) 1 for the active couplings and gears for which order and links hold
    couple_order: Integers  # (ncouple,) the active ones in the order of their elimination
    couple_count: Integers  # (1,) their number
    couple_degree: Integers  # (ncouple,) scratch, by place in that order
    couple_dof: Integers  # (nv,) scratch: the coordinates that one of them moves
    couple_linked: IntegerMatrix  # (ncouple, ncouple) 1 where one appears in the equations of another, likewise
    couple_start: Integers  # (ncouple + 1,) first row, likewise
    node_count: Integers  # (1,)
    node_row: Integers  # (ncouple + 1,) Nodes of solvers/block_lu.py: the active couplings, or one of all rows
    node_span: IntegerMatrix  # (ncouple, ncouple + 2)
    feature_choice: Integers  # (1,) FeatureChoice: when active features of shapes are chosen
    strategy_solves: Integers  # (64,) solutions by start strategy (solve/globalization.py) since the Data was made
    overlap_allowed: Integers  # (1,) 1 where a small overlap in other features is accepted
    inactive: Matrix  # (nground, 45) Inactive, see contact/inactive.py
    corners: Matrix  # (10, nground + 8) Corner, see contact/corners.py
    near_corners: Matrix  # (6, nground + 8) scratch: columns of these, up to Corner.OUT
    corner_sums: Matrix  # (36, 8) scratch: the law of a cluster of corners, in the frame of its contacts
    corner_law: Matrix  # (nground, 36) -d(wrench)/d(twist) by such a law, at the first contact of a cluster: about the
    # centre of mass, world axes
    corner_block: Vector  # (36,) scratch
    far_wrench: Matrix  # (nbody, 6) less the wrenches of far contacts (contact/far_contacts.py), about O
    inactive_tolerance: Vector  # (1,) change of a cluster's impulses below which they stand [N s]
    # contacts
    cone: Matrix  # (ncontact, 16) cone variables: Cone or Pyramid, and Moment
    cone_trial: Matrix  # (ncontact, 16)
    contact_kin: Matrix  # (ncontact, 27) gap, tangential velocity, arms and their Jacobian: Kin
    contact_frame: Matrix  # (nground, 9) rows: normal and two tangents of the ground, world axes
    contact_turn: Matrix  # (nground, 18) on terrain, rotation of the frame by the twist
    bounce: Matrix  # (ncontact, 22) Bounce, see contact/restitution.py
    rebound_part: Vector  # (1,) of the rebounds that restitution asks for, 1 unless all of them would gain energy
    contact_W: Matrix  # (ncontact, 9) d(impulse)/d(gap, slip), contact frame
    contact_hard: Vector  # (1,) hardest contact of the last derivatives, see contact/softening.py
    contact_w: Matrix  # (ncontact, 3) constant part of the same
    contact_scale: Matrix  # (ncontact, 16) ConeScale or PyramidScale
    # friction against spinning and rolling, two rows for each contact: MomentRow
    moment_kin: Matrix  # (2 nmoment, 3) rates behind Kin.GAP: about the normal, or about both tangents [rad/s]
    moment_W: Matrix  # (2 nmoment, 9) d(moment)/d(gap, rates), as contact_W
    moment_scale: Matrix  # (2 nmoment, 4) ConeScale
    moment_w: Matrix  # (2 nmoment, 3) constant part, as contact_w
    moment_Ca: Matrix  # (nmoment, 18) d(rates about n, t1, t2)/d(twist of the first body), about O
    moment_Cb: Matrix  # (nmoment, 18) of the second one
    # pairs
    shape_pos: Matrix  # (2 npair, 3) centres of their shapes at configuration 3
    shape_rot: Matrix  # (2 npair, 9)
    pair_relative: Matrix  # (npair, 12) pose of shape a in the frame of shape b
    pair_out: Matrix  # (npair, 43) result of `collide`: Witness
    pair_before: Matrix  # (npair, 14) pair_relative at configuration 2, least gap of elements there, and LEFT
    pair_activation: Vector  # (npair,) at its first pair: 0 if active, half the gap ahead if inactive, or FAR
    pair_travel: Vector  # (1,) displacement of a body after which inactive collisions are evaluated again [m]
    pair_evaluated: Vector  # (1,) whether they have been in this step
    pair_change: Vector  # (1,) bound of the change of their wrenches per displacement, 0 where there are none
    inactive_pose: Matrix  # (nbody, 7) poses where the inactive collisions were evaluated
    inactive_wrench: Matrix  # (nbody, 6) their wrenches about O
    pair_fade: Matrix  # (npair, 2) PairFade: the part of the impulse that acts
    pair_clear: Vector  # (npair,) at its first pair: last measured distance of the shapes, plus Travel.BEFORE then [m]
    pair_margin: Vector  # (1,) sum of Travel of two bodies up to which no other collision comes within its reach [m]
    body_travel: Matrix  # (nbody, 9) Travel
    pair_apart: Matrix  # (npair, 2) Apart of the node, at its first pair, in steps of higher order (pairs/clearance.py)
    pair_trial: Matrix  # (1, 43) last result of `collide`, of a feature pair that is not kept
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
    couple_R: Matrix  # (nrow, 12) direction of a force, in the twists of a and b
    couple_E: Vector  # (nrow,) its compliance, 0 for loops
    couple_Y: Matrix  # (nv, 8 ncouple) answers of the trees to unit forces, LANES columns for each coupling or gear
    couple_Z: Matrix  # (6 nbody, 8) wrenches, then twists of those of one coupling
    couple_T: Matrix  # (nrow, 8 ncouple) the system
    couple_pivots: Matrix  # (nrow, 2)
    couple_rank: Vector  # (4,) CoupleRank; also read in the next step, and by the first step of the next motion
    couple_scale: Vector  # (nrow,)
    couple_x: Matrix  # (nrow, 8)
    couple_gap: Vector  # (nrow,) of loops
    couple_step: Vector  # (nrow,)
    couple_trial: Vector  # (nrow,)
    couple_panel: Matrix  # (nrow, ncolumn)
    couple_wrench: Vector  # (6,) scratch
    loop_frame: Matrix  # (nloop, 12)
    loop_turn: Matrix  # (nloop, 9)
    loop_velocity: Vector  # (nv,) where a step begins to look for its velocity
    loop_start: Vector  # (nv,) where it looks for another one
    loop_kept: Vector  # (nv,) the first of them
    loop_pivot: Vector  # (1,) least pivot of the couplings at configuration 2
    bifurcation_direction: Matrix  # (nrow, nv) directions of forces in joint space, or 0, see loops/bifurcation.py
    bifurcation_row: Matrix  # (nrow, nv) scratch of its search
    loop_scale: Vector  # (nrow,) scratch
    loop_open: Vector  # (nrow,) |gap| of loops at configuration 2
    gear_rate: Matrix  # (ngear, 2) d(gap)/d(v25) of both
    # limits
    bound: Matrix  # (nlimit, 2) Bound
    bound_trial: Matrix  # (nlimit, 2)
    dry: Matrix  # (ndry, 4) Dry
    dry_trial: Matrix  # (ndry, 4)
    dry_move: Matrix  # (ndry, 2) motion h v25, bound of the impulse
    dry_drive: Matrix  # (ndry, 3) Drive
    dry_w: Matrix  # (ndry, 3) constant parts of the steps of the impulse and of the motions
    bound_row: Matrix  # (nlimit, 6) of a cone: torque per unit of impulse, and d(gap)/d(v25); by rotation
    bound_gap: Vector  # (nlimit,)
    bound_w: Vector  # (nlimit,)
    # prediction
    reach_of: Integers  # (nreach,) contacts and limits that may touch; of a contact's three rows, the first
    reach: Matrix  # (nv, nreach) rates of their gaps and slips, eliminated on the way down the tree
    delassus: Matrix  # (nreach, nreach) transposed: rates by unit impulses
    reach_rate: Vector  # (nreach,) gaps and slips
    reach_impulse: Vector  # (nreach,)
    reach_change: Vector  # (nreach,) of the impulses
    reach_friction: Vector  # (nreach,) coefficients, in the first row of a contact
    # derivatives
    A1: Matrix  # (nbody, 36) d(balance)/d(pose 1), about O
    A2: Matrix  # (nbody, 36)
    A3: Matrix  # (nbody, 36)
    F: Matrix  # (nv, 24) scratch; from 12 on, six numbers: the residual wrench times rotations of test directions
    G: Matrix  # (nv, 24) rows of test directions times the composites, 18, and scratch
    S_across: Matrix  # (18, nwide) S1, S2, S3, a dof per column
    F_across: Matrix  # (12, nwide) composites times unit columns, likewise
    dR_dq: Matrix  # (nv, nwide) nwide: nv, and zeros up to a multiple of LANES (solvers/lanes.py)
    dR_dv: Matrix  # (nv, nwide)
    columns: Matrix  # (nv, ncolumn) right-hand sides and solutions, 2 nv + nu and zeros
    triangles: Matrix  # (nv, nwide) of the substitution with `columns`, see elimination_panel.py
    triangle_across: Matrix  # (12, nwide) U, S3nu, a dof per column
    panel: Matrix  # (6 nbody, npanel) twists of all columns where there are couplings, otherwise scratch of deep trees
    step_A: Matrix  # (2 nv, 2 nv) of one step of a knot
    step_B: Matrix  # (2 nv, nu)
    chain: Matrix  # (2 nv, ncolumn) the product of those of the steps before
    chain_columns: Matrix  # (2 nv, 24) SIDE columns of their product with it
    step_x: Matrix  # (2, nq + nv) states inside a knot
    report: Vector  # (9,) report of an internal step
    loop_clock: Vector  # (2,) LoopClock: sim/model/interruptible_loops.py
    # steps of higher order (integrators/runge_kutta.py, runge_kutta_gradient.py): high_nv is nv, high_state nq + nv,
    # high_nu nu and high_n 2 nv + nu, all of them 0 where steps have order 2
    held_x: Matrix  # (2, high_state) the state where the step began, and its copy that moves
    held_u: Vector  # (high_nu,) the input of the step
    held_momenta: Vector  # (high_nv,) momenta where the step began
    momenta: Vector  # (high_nv,) at the node
    stage_shift: Vector  # (high_nv,) of the coordinates, from the node to the stage
    stage_momenta: Vector  # (high_nv,)
    stage_dr: Matrix  # (nstage, high_nv) rates of the shift
    stage_dp: Matrix  # (nstage, high_nv) rates of the momenta
    slope_p_q: Matrix  # (high_nv, high_nv) derivatives of momenta p and their rates f, by coordinates, velocities, u
    slope_p_v: Matrix  # (high_nv, high_nv)
    slope_f_q: Matrix  # (high_nv, high_nv)
    slope_f_v: Matrix  # (high_nv, high_nv)
    slope_f_u: Matrix  # (high_nv, high_nu)
    slope_column: Matrix  # (high_nv, 42) vectors of every column, see hamilton_gradient.py
    tangent_q: Matrix  # (high_nv, high_n) directions of the coordinates of the node
    tangent_p: Matrix  # (high_nv, high_n) of its momenta
    tangent_shift: Matrix  # (high_nv, high_n) of the shift from the node to the stage
    tangent_stage_q: Matrix  # (high_nv, high_n)
    tangent_stage_p: Matrix  # (high_nv, high_n)
    tangent_dr: Matrix  # (nstage_nv, high_n) their rates at every stage
    tangent_dp: Matrix  # (nstage_nv, high_n)
