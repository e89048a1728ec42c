"""Which kernels a mechanism has use for (solvers/late.py): compiled, or loaded, before the first call that needs them.

Addresses are those of this process, so they are no part of a mechanism that is copied into another.
"""

from __future__ import annotations

import numpy as np

from sim import late
from sim.collision.kinds import SWAPPED, Pair
from sim.model import Law, Model
from solvers.compiler.late import LateKernel

_LOOPS = (
    late.factor_coupling,
    late.solve_coupling,
    late.start_loops,
    late.apply_loops,
    late.keep_loops,
    late.move_loops,
)
_MOTION_OF_LOOPS = (
    late.loops_regular,
    late.stay_regular,
    late.predict_loops,
    late.meet_ahead,
    late.is_farther,
    late.lead_again,
    late.loops_gained,
    late.loop_slack,
)
_PAIRS = (
    late.pair_kinematics,
    late.pair_rate,
    late.condense_pairs,
    late.apply_pairs,
    late.pair_constants,
    late.report_pairs,
    late.choose_pairs,
    late.overlapping,
    late.begin_pairs,
    late.enlist_pairs,
    late.far_pair_impulses,
    late.pairs_came_near,
    late.pairs_gained,
    late.pair_slack,
)
_CYLINDERS = (
    late.cylinder_distance,
    late.collide_cylinders,
    late.choose_cylinders,
    late.cylinder_before,
)
_STRINGS = (late.is_taut, late.pull_from_before, late.string_arm, late.add_string_stiffness)
_PYRAMIDS = (
    late.start_pyramid,
    late.pyramid_error,
    late.pyramid_products,
    late.pyramid_products_ahead,
    late.pyramid_boundary,
    late.return_pyramid,
    late.condense_pyramid,
    late.pyramid_constant,
    late.recover_pyramid,
)
_TERRAIN = (
    late.place_on_terrain,
    late.turn_on_terrain,
    late.add_frame_matrix,
    late.terrain_gap,
    late.evaluate_on_terrain,
)
_IMPACTS = (late.find_impacts, late.subtract_floors, late.impacts_gained)
_COUPLING_GRADIENT = (
    late.add_coupling_composites,
    late.add_coupling_derivatives,
    late.solve_coupling_panel,
)


_DEEP = 24.0  # dofs above one, on average, from where wrenches and twists take less (sim/elimination_deep.py)


def _bind(model: Model, kernels: tuple[LateKernel, ...]) -> None:
    for kernel in kernels:
        model.late[kernel.index] = kernel.address()


def _has_ball_springs(model: Model) -> bool:
    first = model.body_vadr[:-1] + model.joint_ntrans
    return bool(np.any(model.dof_spring[first[model.joint_nrot == 3]] > 0.0))


def _has_strings(model: Model) -> bool:
    return bool(np.any(model.pair_kind % SWAPPED == int(Pair.STRING)))


def bind_poses(model: Model) -> None:
    """What every call of a mechanism may need."""
    if np.any(model.joint_nrot == 2):
        _bind(model, (late.swing_pose, late.swing_turn))
    if _has_ball_springs(model):
        _bind(model, (late.add_spring_block,))


def bind_nodes(model: Model) -> None:
    """What velocities and energies at the nodes of a motion need: those of loops follow from their constraints."""
    if len(model.loop_ntrans) + len(model.gear_dof):
        _bind(model, (late.factor_coupling, late.solve_coupling, late.close_velocity))


def bind_smooth(model: Model) -> None:
    """What steps of higher order need."""
    if np.any(model.joint_nrot == 2):
        _bind(model, (late.swing_curvature,))


def bind_step(model: Model) -> None:
    """What a time step needs: the interior point only where there are contacts or limits."""
    hard = len(model.contact_body) + len(model.limit_dof) > 0
    _bind(
        model,
        (late.step, late.interior_point, late.worst_contact, late.report_contacts)
        if hard
        else (late.step, late.newton),
    )
    if np.any(model.limit_cone):
        _bind(model, (late.cone_gap, late.cone_block))
    if _has_ball_springs(model):
        _bind(model, (late.spring_impulse,))
    if np.any(model.contact_law == int(Law.LINEAR)):
        _bind(model, _PYRAMIDS)
    if len(model.coupling_body) + len(model.gear_dof):
        _bind(model, _LOOPS)
        bind_nodes(model)
    if len(model.loop_ntrans):
        _bind(model, _MOTION_OF_LOOPS)
    if len(model.loop_ntrans) + len(model.gear_dof):
        _bind(model, (late.apply_gears,))
    if len(model.pair_kind):
        _bind(model, _PAIRS)
    if np.any(model.pair_kind % SWAPPED >= int(Pair.POLYTOPE_CYLINDER)):
        _bind(model, _CYLINDERS)
    if _has_strings(model):
        _bind(model, _STRINGS)
    if np.any(model.contact_terrain):
        _bind(model, _TERRAIN)
    if np.any(model.contact_restitution):
        _bind(model, _IMPACTS)


def bind_gradient(model: Model) -> None:
    """What the derivatives of a time step need beyond it."""
    _bind(model, (late.gradient,))
    if np.sum(model.count_above[model.dof_body]) > _DEEP * len(model.dof_body):
        _bind(model, (late.solve_deep_panel,))
    if len(model.contact_body) + len(model.limit_dof):
        _bind(model, (late.add_stiffness,))
    if len(model.limit_dof):
        _bind(model, (late.add_limit_derivatives,))
    if np.any(model.limit_cone):
        _bind(model, (late.cone_derivative,))
    if np.any(model.joint_nrot == 2):
        _bind(model, (late.swing_curvature,))
    if _has_ball_springs(model):
        _bind(model, (late.add_ball_spring_derivatives,))
    if len(model.coupling_body) + len(model.gear_dof):
        _bind(model, _COUPLING_GRADIENT)
    if len(model.pair_kind):
        _bind(model, (late.all_near,))
    if _has_strings(model):
        _bind(model, (late.add_string_turn,))
    if np.any(model.contact_restitution):
        _bind(model, (late.add_bounce_composites, late.add_bounce_derivatives))


def bind_parameters(model: Model) -> None:
    """What derivatives by parameters need beyond that."""
    if np.any(model.contact_terrain):
        _bind(model, (late.add_surface_radius,))
    if _has_strings(model):
        _bind(model, (late.add_moved_end,))


def bind_heights(model: Model) -> None:
    """What gradients by the heights of a terrain need beyond that."""
    _bind(model, (late.add_height_gradient,))
