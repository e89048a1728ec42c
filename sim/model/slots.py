"""Slots of the optional kernels (optional.py) in the table `Model.optional`; link_kernels.py fills the table."""

from __future__ import annotations

from solvers.codes import Code


class Slot(Code):
    """The number of each optional kernel: machine code on disk holds it, never the order of imports."""

    # kernels of all scenes, compiled once
    STEP = 0
    INTERIOR_POINT = 1
    NEWTON = 2
    GRADIENT = 3
    # derivatives of deep trees
    SOLVE_DEEP_PANEL = 4
    # contacts and limits
    REPORT_CONTACTS = 5
    WORST_CONTACT = 6
    ADD_STIFFNESS = 7
    ADD_LIMIT_DERIVATIVES = 8
    # joints with two rotations, and cones
    SWING_POSE = 9
    SWING_CURVATURE = 10
    CONE_GAP = 11
    CONE_BLOCK = 12
    CONE_DERIVATIVE = 13
    # loops, and pairs of bodies in contact
    FACTOR_COUPLING = 14
    SOLVE_COUPLING = 15
    SOLVE_COUPLING_PANEL = 16
    ADD_COUPLING_COMPOSITES = 17
    ADD_COUPLING_DERIVATIVES = 18
    START_LOOPS = 19
    APPLY_LOOPS = 20
    KEEP_LOOPS = 21
    MOVE_LOOPS = 22
    PAIR_KINEMATICS = 23
    PAIR_RATE = 24
    CONDENSE_PAIRS = 25
    APPLY_PAIRS = 26
    PAIR_CONSTANTS = 27
    REPORT_PAIRS = 28
    # friction pyramids
    START_PYRAMID = 29
    PYRAMID_ERROR = 30
    PYRAMID_PRODUCTS = 31
    PYRAMID_PRODUCTS_AHEAD = 32
    PYRAMID_BOUNDARY = 33
    RETURN_PYRAMID = 34
    CONDENSE_PYRAMID = 35
    PYRAMID_CONSTANT = 36
    RECOVER_PYRAMID = 37
    # springs of quaternion joints
    SPRING_IMPULSE = 38
    ADD_SPRING_BLOCK = 39
    ADD_BALL_SPRING_DERIVATIVES = 40
    # terrain
    PLACE_ON_TERRAIN = 41
    TURN_ON_TERRAIN = 42
    ADD_FRAME_MATRIX = 43
    TERRAIN_GAP = 44
    EVALUATE_ON_TERRAIN = 45
    # restitution
    FIND_IMPACTS = 46
    SUBTRACT_FLOORS = 47
    IMPACTS_GAINED = 48
    ADD_BOUNCE_COMPOSITES = 49
    ADD_BOUNCE_DERIVATIVES = 50
    # which pairs, and which of their elements
    BEGIN_PAIRS = 51
    ENLIST_PAIRS = 52
    CHOOSE_PAIRS = 53
    OVERLAPPING = 54
    INACTIVE_PAIR_IMPULSES = 55
    PAIRS_ACTIVATED = 56
    ALL_NEAR = 57
    # gears
    APPLY_GEARS = 58
    # derivatives by the heights of a terrain, and by radii on it
    ADD_HEIGHT_GRADIENT = 59
    ADD_SURFACE_RADIUS = 60
    # loops that pass singular configurations
    CLOSE_VELOCITY = 61
    LOOPS_REGULAR = 62
    STAY_REGULAR = 63
    PREDICT_LOOPS = 64
    LOOPS_GAINED = 65
    LOOP_SLACK = 66
    RECOMPUTE_BIFURCATION = 67
    CROSSES_BIFURCATION = 68
    IS_OTHER_BRANCH = 69
    # taut strings
    IS_TAUT = 70
    PULL_FROM_BEFORE = 71
    STRING_ARM = 72
    ADD_STRING_STIFFNESS = 73
    ADD_STRING_TURN = 74
    ADD_MOVED_END = 75
    # cylinders against polytopes and cylinders
    CYLINDER_DISTANCE = 76
    COLLIDE_CYLINDERS = 77
    CHOOSE_CYLINDERS = 78
    CYLINDER_BEFORE = 79
    # joints with two rotations, over an interval
    SWING_TURN = 80
    # energy from collisions
    PAIRS_GAINED = 81
    PAIR_SLACK = 82
    # steps of scenes with loops
    SOLVE_LOOPS = 83
    # contacts, beside joint limits
    CONTACTS_KINEMATICS = 84
    CONTACTS_OVERLAP = 85
    START_CONTACTS = 86
    RESUME_CONTACTS = 87
    RETURN_CONTACTS = 88
    NORMAL_IMPULSES = 89
    APPLY_CONTACTS = 90
    CONDENSE_CONTACTS = 91
    ADD_SLIP_JACOBIANS = 92
    CONTACT_CONSTANTS = 93
    RECOVER_CONTACTS = 94
    KEEP_CONTACTS = 95
    MOVE_CONTACTS = 96
    CONTACTS_PRODUCTS = 97
    CONTACTS_PRODUCTS_AHEAD = 98
    CONTACTS_BOUNDARY = 99
    SLIP_ERROR = 100
    HAS_PYRAMIDS = 101
    SLIP_NOISE = 102
    SUNK_CONTACT = 103
    CHOOSE_ACTIVE = 104
    HAS_ACTIVATED = 105
    CONTACT_RATES = 106
    CONTACT_ANSWERS = 107
    CHOOSE_CONTACTS = 108
    TAKE_CONTACTS = 109
    # pairs of shapes
    PUT_SPHERE_SPHERE = 110
    PUT_SPHERE_CAPSULE = 111
    PUT_SPHERE_BOX = 112
    PUT_SPHERE_CYLINDER = 113
    PUT_SPHERE_HALFSPACE = 114
    PUT_CAPSULE_CAPSULE = 115
    PUT_CAPSULE_BOX = 116
    PUT_CAPSULE_HALFSPACE = 117
    PUT_BOX_BOX = 118
    PUT_BOX_HALFSPACE = 119
    PUT_CYLINDER_HALFSPACE = 120
    PUT_STRING = 121
    PUT_ELLIPSOID_HALFSPACE = 122
    PUT_ELLIPSOID_ELLIPSOID = 123
    PUT_CYLINDER_ELLIPSOID = 124
    PUT_POLYTOPE_ELLIPSOID = 125
    PUT_POLYTOPE_POLYTOPE = 126
    ARRANGE_CAPSULE_BOX = 127
    ARRANGE_BOX_BOX = 128
    ARRANGE_POLYTOPE_POLYTOPE = 129
    SIDES_CAPSULE_BOX = 130
    SIDES_BOX_BOX = 131
    CHOOSE_CAPSULE_CAPSULE = 132
    CHOOSE_CAPSULE_BOX = 133
    CHOOSE_BOX_BOX = 134
    CHOOSE_POLYTOPE_POLYTOPE = 135
    FACE_POLYTOPE_POLYTOPE = 136
    # gears and loops beside pairs
    UNIT_GEAR_IMPULSE = 137
    GEAR_RESPONSE = 138
    GEAR_DERIVATIVES = 139
    LOOP_STIFFNESS = 140
    # dry friction of joints
    DRY_KINEMATICS = 141
    FIT_DRY = 142
    START_DRY = 143
    RESUME_DRY = 144
    RETURN_DRY = 145
    DRY_ERROR = 146
    DRY_LOAD = 147
    APPLY_DRY = 148
    ADD_DRY_BLOCKS = 149
    DRY_CONSTANTS = 150
    RECOVER_DRY = 151
    KEEP_DRY = 152
    MOVE_DRY = 153
    DRY_PRODUCTS = 154
    DRY_PRODUCTS_AHEAD = 155
    DRY_BOUNDARY = 156
    ADD_DRY_TIME_STEP = 157
    # servos whose force has limits
    APPLY_FRICTION = 158
    ADD_DRIVE_DERIVATIVES = 159
    ADD_DRIVE_INPUTS = 160
    # contacts that only derivatives take as active; rows of pairs
    ALL_STIFF = 161
    PAIRS_FINITE = 162
    # spheres and capsules against level sets
    PUT_SPHERE_FIELD = 163
    PUT_CAPSULE_FIELD = 164
    CHOOSE_CAPSULE_FIELD = 165
    # dampers between closed loops and gears, with an accuracy
    CLOSE_INTERVAL = 166
    # energies of a step that few steps ask for
    ENERGIES_GAINED = 167
    # gears: the responses of a row to several velocities at once
    GEAR_RESPONSES = 168
    # steps of higher order beside collisions
    OMITTED_PAIRS = 169
    PAIRS_REACHED = 170
    MEASURE_PAIRS = 171
    # elements of pairs of shapes: chosen, and where a step begins
    CHOOSE_SHAPES = 172
    OPEN_PAIRS = 173
    # the prediction of a step: contacts and limits that it reaches
    CHOOSE_REACHED = 174
    DELASSUS = 175
    REACHED_RATES = 176
    REACHED_IMPULSES = 177
    # sizes of the rows of loops
    ADD_LOOP_SIZES = 178
    # kinematics that functions of the user call
    KINEMATIC_QUANTITY = 179
    # corners of meshes whose law is evaluated, and in the matrix
    EVALUATE_CORNERS = 180
    ADD_CORNER_LAWS = 181
    ADD_CORNER_SLIPS = 182
    TAKE_CORNERS = 183
    REPORT_CORNERS = 184
    HAS_CORNERS = 188
    # bounds of the distance of two polytopes, and of cylinders
    APART_POLYTOPES = 185
    CYLINDER_APART = 186
    # nodes of extrapolated steps with closed loops and gears
    CLOSE_NODE = 187
    # the start of a step: whether contacts begin within it
    LANDS = 189
    # contacts beyond a cutoff
    CHOOSE_FAR = 190
    ADD_FAR_WRENCHES = 191
    HAS_FAR_ACTIVATED = 192
    # friction against spinning and rolling
    MOMENT_RATES = 193
    START_MOMENTS = 194
    RESUME_MOMENTS = 195
    KEEP_MOMENTS = 196
    MOVE_MOMENTS = 197
    MOMENT_ERROR = 198
    APPLY_MOMENTS = 199
    CONDENSE_MOMENTS = 200
    MOMENT_CONSTANTS = 201
    RECOVER_MOMENTS = 202
    ADD_MOMENT_RATES = 203
    ADD_MOMENT_COUPLINGS = 204
    ADD_MOMENT_CHANGE = 205
    ADD_MOMENT_FRICTION = 206
    ADD_MOMENT_TIME_STEP = 207
    REPORT_MOMENTS = 208
    ADD_MOMENT_LAW = 209
    MOMENT_BY_GAP = 210
    ADD_IMPACT_MOMENT = 211
    MOMENT_WORK = 212
    PLACE_MOMENT = 216
    ADD_INACTIVE_MOMENT = 217
    EVALUATE_MOMENTS = 218
    MOMENT_SLOPE = 219
    MOMENT_VIOLATION = 224
    # derivatives by parameters
    FILL_COLUMNS = 213
    # sub-steps of steps with an accuracy
    ATTEMPT = 214
    # states from momenta
    MEET_MOMENTUM = 215
    # pairs of shapes: in the other order, and their elements beside those of the beginning of a step
    EXCHANGE_SHAPES = 220
    SUBSTITUTE_ELEMENTS = 221
    REMEMBER_ELEMENTS = 222
    KEEP_ELEMENTS = 223
