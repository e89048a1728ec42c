"""The optional kernels that a mechanism uses (solvers/compiler): linked before the first call that needs them.

Addresses are those of this process, so a mechanism that is copied into another process does not carry them.
"""

from __future__ import annotations

import numpy as np

from sim.contact.active_contacts import (
    add_slip_jacobians,
    apply_contacts,
    condense_contacts,
    contact_constants,
    contacts_boundary,
    contacts_kinematics,
    contacts_overlap,
    contacts_products,
    contacts_products_ahead,
    has_pyramids,
    keep_contacts,
    lands,
    move_contacts,
    normal_impulses,
    recover_contacts,
    resume_contacts,
    return_contacts,
    slip_error,
    start_contacts,
)
from sim.contact.collision.pair_kernels import KERNELS
from sim.contact.collision.swapped_shapes import exchange_shapes
from sim.contact.contact_law import slip_noise
from sim.contact.contact_report import report_ground, worst_contact
from sim.contact.corner_laws import add_corner_laws, add_corner_slips
from sim.contact.corners import evaluate_corners, report_corners
from sim.contact.far_contacts import add_far_wrenches, choose_far, has_far_activated
from sim.contact.inactive import choose_active, has_activated, has_corners, sunk_contact
from sim.contact.inactive_terrain import evaluate_on_terrain
from sim.contact.moments.contact_moments import (
    add_impact_moment,
    add_moment_couplings,
    add_moment_law,
    add_moment_rates,
    apply_moments,
    condense_moments,
    keep_moments,
    moment_by_gap,
    moment_constants,
    moment_error,
    moment_rates,
    moment_work,
    move_moments,
    recover_moments,
    report_moments,
    resume_moments,
    start_moments,
)
from sim.contact.moments.inactive_moments import add_inactive_moment, evaluate_moments, moment_slope, place_moment
from sim.contact.moments.moment_law import moment_violation
from sim.contact.pairs.active_features import (
    choose_pairs,
    choose_shapes,
    keep_elements,
    open_pairs,
    overlapping,
    substitute_elements,
)
from sim.contact.pairs.clearance import measure_pairs, omitted_pairs, pairs_reached
from sim.contact.pairs.cylinder_pairs import (
    choose_cylinders,
    collide_cylinders,
    cylinder_apart,
    cylinder_before,
    cylinder_distance,
)
from sim.contact.pairs.inactive_pairs import (
    all_near,
    begin_pairs,
    enlist_pairs,
    inactive_pair_impulses,
    pairs_activated,
)
from sim.contact.pairs.pair_contact import pair_kinematics
from sim.contact.pairs.pair_energy import pair_slack, pairs_gained
from sim.contact.pairs.pair_jacobian import pair_rate
from sim.contact.pairs.pair_report import pairs_finite, report_pairs
from sim.contact.pairs.pair_stiffness import apply_pairs, condense_pairs, pair_constants
from sim.contact.pairs.previous_features import remember
from sim.contact.pairs.taut_string import is_taut, pull_from_before, string_arm
from sim.contact.pairs.taut_string_stiffness import add_string_stiffness, add_string_turn
from sim.contact.pyramid import (
    condense_pyramid,
    pyramid_boundary,
    pyramid_constant,
    pyramid_error,
    pyramid_products,
    pyramid_products_ahead,
    recover_pyramid,
    return_pyramid,
    start_pyramid,
)
from sim.contact.restitution import find_impacts, impacts_gained, subtract_floors
from sim.contact.stiff_contacts import all_stiff, take_corners
from sim.contact.terrain_contact import add_frame_matrix, place_on_terrain, terrain_gap, turn_on_terrain
from sim.derivatives.coupling_gradient import add_coupling_composites, add_coupling_derivatives
from sim.derivatives.loop_stiffness import loop_stiffness
from sim.derivatives.parameters.height_columns import add_height_gradient
from sim.derivatives.parameters.moment_columns import (
    add_moment_change,
    add_moment_friction,
    add_moment_time_step,
)
from sim.derivatives.parameters.residual_columns import fill_columns
from sim.derivatives.parameters.surface import add_surface_radius
from sim.derivatives.parameters.taut_string_columns import add_moved_end
from sim.derivatives.restitution_gradient import add_bounce_composites, add_bounce_derivatives
from sim.derivatives.step_gradient import gradient
from sim.dynamics.elimination_deep import solve_deep_panel
from sim.dynamics.joints.ball_spring import add_ball_spring_derivatives, add_spring_block, spring_impulse
from sim.dynamics.joints.cone_limit import cone_block, cone_derivative, cone_gap
from sim.dynamics.joints.dry_friction import (
    add_dry_blocks,
    add_dry_time_step,
    apply_dry,
    apply_friction,
    dry_boundary,
    dry_constants,
    dry_error,
    dry_kinematics,
    dry_load,
    dry_products,
    dry_products_ahead,
    fit_dry,
    keep_dry,
    move_dry,
    recover_dry,
    resume_dry,
    return_dry,
    start_dry,
)
from sim.dynamics.joints.limits import add_limit_derivatives
from sim.dynamics.joints.servo_gradient import add_drive_derivatives, add_drive_inputs
from sim.dynamics.joints.swing import swing_curvature, swing_pose, swing_turn
from sim.dynamics.loops.branch_motion import (
    crosses_bifurcation,
    is_other_branch,
    loops_regular,
    predict_loops,
    recompute_bifurcation,
    stay_regular,
)
from sim.dynamics.loops.closure import apply_loops, keep_loops, move_loops, start_loops
from sim.dynamics.loops.coupling_system import add_loop_sizes, factor_coupling, solve_coupling, solve_coupling_panel
from sim.dynamics.loops.gears import (
    apply_gears,
    gear_derivatives,
    gear_response,
    gear_responses,
    unit_gear_impulse,
)
from sim.dynamics.loops.loop_velocity import close_velocity
from sim.dynamics.loops.loop_work import loop_slack, loops_gained
from sim.integrators.mean_velocity import close_interval, close_node
from sim.model.model import Law, Model
from sim.model.record_columns import Cluster
from sim.model.shape_kinds import CHOSEN, SWAPPED, Pair
from sim.solve.delassus import contact_answers, contact_rates, delassus
from sim.solve.energy_balance import energies_gained
from sim.solve.inequalities import add_stiffness
from sim.solve.interior_point import interior_point
from sim.solve.loop_branch import solve_loops
from sim.solve.newton import newton
from sim.solve.prediction import (
    choose_contacts,
    choose_reached,
    reached_impulses,
    reached_rates,
    take_contacts,
)
from sim.solve.start_velocity import meet_momentum
from sim.step import step
from solvers.compiler import link
from solvers.riccati import backward_knots

_CONTACTS = (
    contacts_overlap,
    start_contacts,
    resume_contacts,
    return_contacts,
    normal_impulses,
    contact_constants,
    recover_contacts,
    lands,
    keep_contacts,
    move_contacts,
    contacts_products,
    contacts_products_ahead,
    contacts_boundary,
    slip_error,
    slip_noise,
    worst_contact,
)
_GROUND = (
    sunk_contact,
    choose_active,
    has_activated,
    contacts_kinematics,
    apply_contacts,
    condense_contacts,
    report_ground,
)
_DRY = (
    add_dry_blocks,
    apply_dry,
    apply_friction,
    dry_boundary,
    dry_constants,
    dry_error,
    dry_kinematics,
    dry_load,
    dry_products,
    dry_products_ahead,
    fit_dry,
    keep_dry,
    move_dry,
    recover_dry,
    resume_dry,
    return_dry,
    start_dry,
)
_PREDICTION = (choose_reached, delassus, reached_rates, reached_impulses)
_PREDICTION_OF_CONTACTS = (has_pyramids, contact_rates, contact_answers, choose_contacts, take_contacts)
_COUPLING = (factor_coupling, solve_coupling)
_LOOPS = (
    start_loops,
    apply_loops,
    keep_loops,
    move_loops,
)
_MOTION_OF_LOOPS = (
    solve_loops,
    loops_regular,
    stay_regular,
    predict_loops,
    crosses_bifurcation,
    is_other_branch,
    recompute_bifurcation,
    loops_gained,
    loop_slack,
)
_PAIRS = (
    pair_kinematics,
    pair_rate,
    condense_pairs,
    apply_pairs,
    pair_constants,
    report_pairs,
    choose_pairs,
    choose_shapes,
    open_pairs,
    begin_pairs,
    enlist_pairs,
    inactive_pair_impulses,
    pairs_activated,
    pairs_finite,
    pairs_gained,
    pair_slack,
)
_CHOICES = (overlapping, substitute_elements, remember, keep_elements)
_CYLINDERS = (
    cylinder_distance,
    cylinder_apart,
    collide_cylinders,
    choose_cylinders,
    cylinder_before,
)
_STRINGS = (is_taut, pull_from_before, string_arm, add_string_stiffness)
_PYRAMIDS = (
    start_pyramid,
    pyramid_error,
    pyramid_products,
    pyramid_products_ahead,
    pyramid_boundary,
    return_pyramid,
    condense_pyramid,
    pyramid_constant,
    recover_pyramid,
)
_MOMENTS = (
    moment_rates,
    start_moments,
    resume_moments,
    keep_moments,
    move_moments,
    moment_error,
    apply_moments,
    condense_moments,
    moment_constants,
    recover_moments,
    report_moments,
    place_moment,
    add_inactive_moment,
    evaluate_moments,
    moment_slope,
    moment_violation,
)
_TERRAIN = (
    place_on_terrain,
    turn_on_terrain,
    add_frame_matrix,
    terrain_gap,
    evaluate_on_terrain,
)
_IMPACTS = (find_impacts, subtract_floors, impacts_gained)
_COUPLING_GRADIENT = (
    add_coupling_composites,
    add_coupling_derivatives,
    solve_coupling_panel,
)


_DEEP = 24.0  # dofs above one, on average, from where wrenches and twists take less (sim/dynamics/elimination_deep.py)


def _has_ball_springs(model: Model) -> bool:
    first = model.body_vadr[:-1] + model.joint_ntrans
    return bool(np.any(model.dof_spring[first[model.joint_nrot == 3]] > 0.0))


def _is_predicted(model: Model) -> bool:
    """Whether `predictable` may be true of a state in which contacts or limits act."""
    uncovered = len(model.loop_ntrans) + len(model.gear_dof) + len(model.dry_dof)
    return uncovered == 0 and len(model.contact_height) + len(model.limit_dof) > 0


def _has_strings(model: Model) -> bool:
    return bool(np.any(model.pair_kind % SWAPPED == int(Pair.STRING)))


def link_poses(model: Model) -> None:
    """Link the kernels that every call of a mechanism may need."""
    if np.any(model.joint_nrot == 2):
        link(model.optional, swing_pose, swing_turn)
    if _has_ball_springs(model):
        link(model.optional, add_spring_block)


def link_nodes(model: Model) -> None:
    """Link the kernels of velocities and energies at nodes: those of loops follow from their constraints."""
    if len(model.loop_ntrans) + len(model.gear_dof):
        link(model.optional, *_COUPLING, add_loop_sizes, close_velocity, close_node)
        if np.any(model.dof_damper):
            link(model.optional, close_interval, meet_momentum)
    if len(model.gear_dof):
        link(model.optional, unit_gear_impulse, gear_response, gear_responses)


def link_momentum(model: Model) -> None:
    """Link the search for the state with the momentum of a node."""
    link(model.optional, meet_momentum)


def link_pairs(model: Model) -> None:
    """Link the kernels of each kind of pair of shapes."""
    if np.any(model.pair_kind >= SWAPPED):
        link(model.optional, exchange_shapes)
    for kind in np.unique(model.pair_kind % SWAPPED):
        link(model.optional, *KERNELS.get(Pair(kind), ()))  # those of cylinders have kernels for all points at once


def link_curvature(model: Model) -> None:
    """Link how the columns of joints with two rotations bend, which Hamilton's equations need."""
    if np.any(model.joint_nrot == 2):
        link(model.optional, swing_curvature)


def link_step(model: Model) -> None:
    """Link the kernels of a time step of order 2."""
    link(model.optional, step)
    link_terms(model)


def link_flight(model: Model) -> None:
    """Link the kernels of steps of higher order beside contacts, collisions and limits."""
    link_curvature(model)
    link_terms(model)
    if len(model.pair_kind):
        link(model.optional, omitted_pairs, pairs_reached, measure_pairs)


def link_terms(model: Model) -> None:
    """Link the kernels that a step calls: the interior point only if there are contacts or limits."""
    link(model.optional, energies_gained)
    hard = len(model.contact_body) + len(model.limit_dof) + len(model.dry_dof) > 0
    if hard:
        link(model.optional, interior_point)
    else:
        link(model.optional, newton)
    if len(model.contact_body):
        link(model.optional, *_CONTACTS)
    if len(model.contact_height):
        link(model.optional, *_GROUND, *_PREDICTION_OF_CONTACTS)
    if np.any(model.cluster[:, Cluster.CORNERS]):
        link(model.optional, evaluate_corners, add_corner_laws, report_corners, has_corners)
    if _is_predicted(model):
        link(model.optional, *_PREDICTION)
    if np.any(model.limit_cone):
        link(model.optional, cone_gap, cone_block)
    if len(model.dry_dof):
        link(model.optional, *_DRY)
    if _has_ball_springs(model):
        link(model.optional, spring_impulse)
    if np.any(model.contact_law == int(Law.LINEAR)):
        link(model.optional, *_PYRAMIDS)
    if len(model.coupling_body) + len(model.gear_dof):
        link(model.optional, *_COUPLING)
        link_nodes(model)
    if len(model.loop_ntrans):
        link(model.optional, *_MOTION_OF_LOOPS)
    if len(model.loop_ntrans) + len(model.gear_dof):
        link(model.optional, *_LOOPS, apply_gears)
    if len(model.pair_kind):
        link(model.optional, *_PAIRS)
        link_pairs(model)
    if np.any(np.isin(model.pair_kind % SWAPPED, CHOSEN)):
        link(model.optional, *_CHOICES)
    if np.any(model.pair_kind % SWAPPED >= int(Pair.POLYTOPE_CYLINDER)):
        link(model.optional, *_CYLINDERS)
    if _has_strings(model):
        link(model.optional, *_STRINGS)
    if len(model.moment_friction):
        _link_moments(model)
    if np.any(model.contact_terrain):
        link(model.optional, *_TERRAIN)
    if np.any(model.contact_restitution):
        link(model.optional, *_IMPACTS)


def _link_moments(model: Model) -> None:
    """Link the kernels of torsional and rolling friction."""
    link(model.optional, *_MOMENTS)
    if np.any(model.contact_restitution):
        link(model.optional, moment_work)


def link_far(model: Model) -> None:
    """Link the kernels of far contacts, which steps with a cutoff need."""
    if len(model.contact_height):
        link(model.optional, choose_far, add_far_wrenches, has_far_activated)


def link_gradient(model: Model) -> None:
    """Link the further kernels of the derivatives of a time step."""
    link(model.optional, gradient)
    if np.sum(model.count_above[model.dof_body]) > _DEEP * len(model.dof_body):
        link(model.optional, solve_deep_panel)
    if len(model.contact_body) + len(model.limit_dof) + len(model.dry_dof):
        link(model.optional, add_stiffness)
    if len(model.contact_height):
        link(model.optional, add_slip_jacobians, all_stiff)
    if len(model.moment_friction):
        link(model.optional, add_moment_rates, add_moment_couplings)
    if np.any(model.cluster[:, Cluster.CORNERS]):
        link(model.optional, add_corner_slips, take_corners)
    if len(model.limit_dof):
        link(model.optional, add_limit_derivatives)
    if np.any(model.dry_input >= 0):
        link(model.optional, add_drive_derivatives, add_drive_inputs)
    if np.any(model.limit_cone):
        link(model.optional, cone_derivative)
    link_curvature(model)
    if _has_ball_springs(model):
        link(model.optional, add_ball_spring_derivatives)
    if len(model.coupling_body) + len(model.gear_dof):
        link(model.optional, *_COUPLING_GRADIENT)
    if len(model.loop_ntrans):
        link(model.optional, loop_stiffness)
    if len(model.gear_dof):
        link(model.optional, gear_derivatives)
    if len(model.pair_kind):
        link(model.optional, all_near)
    if _has_strings(model):
        link(model.optional, add_string_turn)
    if np.any(model.contact_restitution):
        link(model.optional, add_bounce_composites, add_bounce_derivatives)
        if len(model.moment_friction):
            link(model.optional, add_moment_law, moment_by_gap, add_impact_moment)


def link_parameters(model: Model) -> None:
    """Link the further kernels of derivatives by parameters."""
    link(model.optional, fill_columns)
    if np.any(model.contact_terrain):
        link(model.optional, add_surface_radius)
    if len(model.moment_friction):
        link(model.optional, add_moment_change, add_moment_friction, add_moment_time_step)
    if len(model.dry_dof):
        link(model.optional, add_dry_time_step)
    if _has_strings(model):
        link(model.optional, add_moved_end)


def link_heights(model: Model) -> None:
    """Link the further kernels of gradients by heights of terrain."""
    link(model.optional, add_height_gradient)


def link_planner(model: Model) -> None:
    """Compile the backward pass of a planner beside the kernels of its horizon."""
    link(model.optional, backward_knots)
