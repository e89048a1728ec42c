"""Kernels called by their address (solvers/late.py), and where they are written: sim/bind.py fills in the addresses.

Callers import the names below instead of the modules, which are imported when a scene binds one of their kernels, or
when a call of one is compiled.
"""

from __future__ import annotations

from solvers.compiler.late import LateTable

_late = LateTable()

# what all scenes do, compiled once
step = _late("sim.step:step")
solve = interior_point = _late("sim.solve.interior_point:interior_point")  # the unknown of a step
newton = _late("sim.solve.newton:newton", instead_of=solve)  # in scenes without contacts and limits
gradient = _late("sim.gradients:gradient")

# derivatives of deep trees
solve_deep_panel = _late("sim.elimination_deep:solve_deep_panel")

# contacts and limits
report_contacts = _late("sim.contacts.report:report_contacts")
worst_contact = _late("sim.contacts.report:worst_contact")
add_stiffness = _late("sim.solve.inequalities:add_stiffness")
add_limit_derivatives = _late("sim.joints.limits:add_limit_derivatives")

# joints with two rotations, and cones
swing_pose = _late("sim.joints.swing:swing_pose")
swing_curvature = _late("sim.joints.swing:swing_curvature")
cone_gap = _late("sim.joints.cone_limit:cone_gap")
cone_block = _late("sim.joints.cone_limit:cone_block")
cone_derivative = _late("sim.joints.cone_limit:cone_derivative")

# loops, and pairs of bodies in contact
factor_coupling = _late("sim.coupling.system:factor_coupling")
solve_coupling = _late("sim.coupling.system:solve_coupling")
solve_coupling_panel = _late("sim.coupling.system:solve_coupling_panel")
add_coupling_composites = _late("sim.coupling.gradient:add_coupling_composites")
add_coupling_derivatives = _late("sim.coupling.gradient:add_coupling_derivatives")
start_loops = _late("sim.coupling.loops:start_loops")
apply_loops = _late("sim.coupling.loops:apply_loops")
keep_loops = _late("sim.coupling.loops:keep_loops")
move_loops = _late("sim.coupling.loops:move_loops")
pair_kinematics = _late("sim.pairs.contact:pair_kinematics")
pair_rate = _late("sim.pairs.jacobian:pair_rate")
condense_pairs = _late("sim.pairs.stiffness:condense_pairs")
apply_pairs = _late("sim.pairs.stiffness:apply_pairs")
pair_constants = _late("sim.pairs.stiffness:pair_constants")
report_pairs = _late("sim.pairs.report:report_pairs")

# friction pyramids
start_pyramid = _late("sim.contacts.pyramid:start_pyramid")
pyramid_error = _late("sim.contacts.pyramid:pyramid_error")
pyramid_products = _late("sim.contacts.pyramid:pyramid_products")
pyramid_products_ahead = _late("sim.contacts.pyramid:pyramid_products_ahead")
pyramid_boundary = _late("sim.contacts.pyramid:pyramid_boundary")
return_pyramid = _late("sim.contacts.pyramid:return_pyramid")
condense_pyramid = _late("sim.contacts.pyramid:condense_pyramid")
pyramid_constant = _late("sim.contacts.pyramid:pyramid_constant")
recover_pyramid = _late("sim.contacts.pyramid:recover_pyramid")

# springs of quaternion joints
spring_impulse = _late("sim.joints.ball_spring:spring_impulse")
add_spring_block = _late("sim.joints.ball_spring:add_spring_block")
add_ball_spring_derivatives = _late("sim.joints.ball_spring:add_ball_spring_derivatives")

# terrain
place_on_terrain = _late("sim.terrain.contact:place_on_terrain")
turn_on_terrain = _late("sim.terrain.contact:turn_on_terrain")
add_frame_matrix = _late("sim.terrain.contact:add_frame_matrix")
terrain_gap = _late("sim.terrain.contact:terrain_gap")
evaluate_on_terrain = _late("sim.terrain.far:evaluate_on_terrain")

# restitution
find_impacts = _late("sim.contacts.restitution:find_impacts")
subtract_floors = _late("sim.contacts.restitution:subtract_floors")
impacts_gained = _late("sim.contacts.restitution:impacts_gained")
add_bounce_composites = _late("sim.contacts.restitution_gradient:add_bounce_composites")
add_bounce_derivatives = _late("sim.contacts.restitution_gradient:add_bounce_derivatives")

# which pairs, and which of their elements
begin_pairs = _late("sim.pairs.far:begin_pairs")
enlist_pairs = _late("sim.pairs.far:enlist_pairs")
choose_pairs = _late("sim.pairs.choice:choose_pairs")
overlapping = _late("sim.pairs.choice:overlapping")
far_pair_impulses = _late("sim.pairs.far:far_pair_impulses")
pairs_came_near = _late("sim.pairs.far:pairs_came_near")
all_near = _late("sim.pairs.far:all_near")

# gears
apply_gears = _late("sim.coupling.gears:apply_gears")

# derivatives by the heights of a terrain, and by radii on it
add_height_gradient = _late("sim.parameters.terrain:add_height_gradient")
add_surface_radius = _late("sim.parameters.surface:add_surface_radius")

# loops that pass singular configurations
close_velocity = _late("sim.coupling.loop_velocity:close_velocity")
loops_regular = _late("sim.coupling.loop_motion:loops_regular")
stay_regular = _late("sim.coupling.loop_motion:stay_regular")
predict_loops = _late("sim.coupling.loop_motion:predict_loops")
loops_gained = _late("sim.coupling.loop_work:loops_gained")
loop_slack = _late("sim.coupling.loop_work:loop_slack")
lead_again = _late("sim.coupling.loop_motion:lead_again")
meet_ahead = _late("sim.coupling.loop_motion:meet_ahead")
is_farther = _late("sim.coupling.loop_motion:is_farther")

# taut strings
is_taut = _late("sim.pairs.string:is_taut")
pull_from_before = _late("sim.pairs.string:pull_from_before")
string_arm = _late("sim.pairs.string:string_arm")
add_string_stiffness = _late("sim.pairs.string:add_string_stiffness")
add_string_turn = _late("sim.pairs.string:add_string_turn")
add_moved_end = _late("sim.parameters.strings:add_moved_end")

# cylinders against polytopes and cylinders
cylinder_distance = _late("sim.pairs.cylinders:cylinder_distance")
collide_cylinders = _late("sim.pairs.cylinders:collide_cylinders")
choose_cylinders = _late("sim.pairs.cylinders:choose_cylinders")
cylinder_before = _late("sim.pairs.cylinders:cylinder_before")

# joints with two rotations, over an interval
swing_turn = _late("sim.joints.swing:swing_turn")

# energy from collisions
pairs_gained = _late("sim.pairs.work:pairs_gained")
pair_slack = _late("sim.pairs.work:pair_slack")

COUNT = _late.count  # of addresses
