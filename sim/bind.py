"""Which kernels a mechanism has use for (solvers/late.py): compiled, or loaded, before the first call that needs them.

Addresses are those of this process, so they are no part of a mechanism that is copied into another.
"""

from __future__ import annotations

import numpy as np

from sim.collision.kinds import SWAPPED, Pair
from sim.contacts import pyramid, restitution, restitution_gradient
from sim.contacts.report import report_contacts, report_pairs, worst_contact
from sim.coupling import gears, loop_motion, loop_velocity, loop_work, loops
from sim.coupling import gradient as coupling_gradient
from sim.coupling import system as coupling
from sim.gradients import gradient
from sim.joints import ball_spring, cone_limit, swing
from sim.joints.limits import add_limit_derivatives
from sim.model import Law, Model
from sim.pairs import choice as pair_choice
from sim.pairs import contact as pairs
from sim.pairs import cylinders as pair_cylinders
from sim.pairs import far as pair_far
from sim.pairs import jacobian as pair_jacobian
from sim.pairs import stiffness as pair_stiffness
from sim.pairs import work as pair_work
from sim.parameters import surface as parameter_surface
from sim.parameters import terrain as parameter_terrain
from sim.solve.inequalities import add_stiffness
from sim.solve.interior_point import interior_point
from sim.solve.newton import newton
from sim.step import step
from sim.terrain import contact as terrain_contact
from sim.terrain.far import evaluate_on_terrain
from solvers.late import LateKernel

_LOOPS = (
    coupling.factor_coupling,
    coupling.solve_coupling,
    loops.start_loops,
    loops.apply_loops,
    loops.keep_loops,
    loops.move_loops,
)
_MOTION_OF_LOOPS = (
    loop_motion.loops_regular,
    loop_motion.stay_regular,
    loop_motion.predict_loops,
    loop_motion.meet_ahead,
    loop_motion.is_farther,
    loop_motion.lead_again,
    loop_work.loops_gained,
)
_PAIRS = (
    pairs.pair_kinematics,
    pair_jacobian.pair_rate,
    pair_stiffness.condense_pairs,
    pair_stiffness.apply_pairs,
    pair_stiffness.pair_constants,
    report_pairs,
    pair_choice.choose_pairs,
    pair_choice.overlapping,
    pair_far.begin_pairs,
    pair_far.enlist_pairs,
    pair_far.far_pair_impulses,
    pair_far.pairs_came_near,
)
_CYLINDERS = (
    pair_cylinders.cylinder_distance,
    pair_cylinders.collide_cylinders,
    pair_cylinders.choose_cylinders,
    pair_cylinders.cylinder_before,
)
_PYRAMIDS = (
    pyramid.start_pyramid,
    pyramid.pyramid_error,
    pyramid.pyramid_products,
    pyramid.pyramid_products_ahead,
    pyramid.pyramid_boundary,
    pyramid.return_pyramid,
    pyramid.condense_pyramid,
    pyramid.pyramid_constant,
    pyramid.recover_pyramid,
)
_TERRAIN = (
    terrain_contact.place_on_terrain,
    terrain_contact.turn_on_terrain,
    terrain_contact.add_frame_matrix,
    terrain_contact.terrain_gap,
    evaluate_on_terrain,
)
_IMPACTS = (restitution.find_impacts, restitution.subtract_floors, restitution.gained_energy)
_COUPLING_GRADIENT = (
    coupling_gradient.add_coupling_composites,
    coupling_gradient.add_coupling_derivatives,
    coupling.solve_coupling_panel,
)


def _bind(model: Model, kernels: tuple[LateKernel, ...]) -> None:
    for kernel in kernels:
        model.late[kernel.index] = kernel.address()


def _has_ball_springs(model: Model) -> bool:
    first = model.body_vadr[:-1] + model.joint_ntrans
    return bool(np.any(model.dof_spring[first[model.joint_nrot == 3]] > 0.0))


def bind_poses(model: Model) -> None:
    """What every call of a mechanism may need."""
    if np.any(model.joint_nrot == 2):
        _bind(model, (swing.swing_pose, swing.swing_turn))
    if _has_ball_springs(model):
        _bind(model, (ball_spring.add_spring_block,))


def bind_nodes(model: Model) -> None:
    """What velocities and energies at the nodes of a motion need: those of loops follow from their constraints."""
    if len(model.loop_ntrans) + len(model.gear_dof):
        _bind(model, (coupling.factor_coupling, coupling.solve_coupling, loop_velocity.close_velocity))


def bind_smooth(model: Model) -> None:
    """What steps of higher order need."""
    if np.any(model.joint_nrot == 2):
        _bind(model, (swing.swing_curvature,))


def bind_step(model: Model) -> None:
    """What a time step needs: the interior point only where there are contacts or limits."""
    hard = len(model.contact_body) + len(model.limit_dof) > 0
    _bind(model, (step, interior_point, worst_contact, report_contacts) if hard else (step, newton))
    if np.any(model.limit_cone):
        _bind(model, (cone_limit.cone_gap, cone_limit.cone_block))
    if _has_ball_springs(model):
        _bind(model, (ball_spring.spring_impulse,))
    if np.any(model.contact_law == int(Law.LINEAR)):
        _bind(model, _PYRAMIDS)
    if len(model.coupling_body) + len(model.gear_dof):
        _bind(model, _LOOPS)
        bind_nodes(model)
    if len(model.loop_ntrans):
        _bind(model, _MOTION_OF_LOOPS)
    if len(model.loop_ntrans) + len(model.gear_dof):
        _bind(model, (gears.apply_gears,))
    if len(model.pair_kind):
        _bind(model, _PAIRS)
    if np.any(model.pair_kind % SWAPPED >= int(Pair.POLYTOPE_CYLINDER)):
        _bind(model, _CYLINDERS)
    if np.any(model.pair_kind % SWAPPED >= int(Pair.POLYTOPE_POLYTOPE)):
        _bind(model, (pair_work.pairs_gained,))
    if np.any(model.contact_terrain):
        _bind(model, _TERRAIN)
    if np.any(model.contact_restitution):
        _bind(model, _IMPACTS)


def bind_gradient(model: Model) -> None:
    """What the derivatives of a time step need beyond it."""
    _bind(model, (gradient,))
    if len(model.contact_body) + len(model.limit_dof):
        _bind(model, (add_stiffness,))
    if len(model.limit_dof):
        _bind(model, (add_limit_derivatives,))
    if np.any(model.limit_cone):
        _bind(model, (cone_limit.cone_derivative,))
    if np.any(model.joint_nrot == 2):
        _bind(model, (swing.swing_curvature,))
    if _has_ball_springs(model):
        _bind(model, (ball_spring.add_ball_spring_derivatives,))
    if len(model.coupling_body) + len(model.gear_dof):
        _bind(model, _COUPLING_GRADIENT)
    if len(model.pair_kind):
        _bind(model, (pair_far.all_near,))
    if np.any(model.contact_restitution):
        _bind(model, (restitution_gradient.add_bounce_composites,))
        if len(model.pair_kind):
            _bind(model, (restitution_gradient.add_bounce_derivatives,))


def bind_parameters(model: Model) -> None:
    """What derivatives by parameters need beyond that."""
    if np.any(model.contact_terrain):
        _bind(model, (parameter_surface.add_surface_radius,))


def bind_heights(model: Model) -> None:
    """What gradients by the heights of a terrain need beyond that."""
    _bind(model, (parameter_terrain.add_height_gradient,))
