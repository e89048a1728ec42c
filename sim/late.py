"""Kernels called by their address (solvers/late.py), which bind.py fills in."""

from __future__ import annotations

from enum import IntEnum, unique


@unique
class Late(IntEnum):
    """Where the address of each late kernel is in `Model.late`."""

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
    # steps that need no care for singular configurations
    LOOPS_REGULAR = 71
    STAY_REGULAR = 72
