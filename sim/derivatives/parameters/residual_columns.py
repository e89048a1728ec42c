"""Columns of -dR/d(parameter) of the step that `gradient` left in `data`, for a list of terms.

terms     (n, 4) Effect, index, component, column; in the order of their columns
weights   (n,) how much of the elementary change a unit of the parameter makes
"""

from __future__ import annotations

from sim.contact.stiff_contacts import take_corners
from sim.derivatives.parameters.body_columns import (
    add_bound,
    add_damper,
    add_gravity,
    add_inertia,
    add_input,
    add_mass,
    add_rest,
    add_seen,
    add_spring,
    add_time_step,
)
from sim.derivatives.parameters.contact_columns import (
    add_friction,
    add_friction_against_turning,
    add_height,
    add_normal,
    add_point,
    add_radius,
    add_restitution,
    add_slips_time_step,
)
from sim.derivatives.parameters.directions import At, Effect, ParameterTerm
from sim.derivatives.parameters.geometry import add_geometry
from sim.derivatives.parameters.loop_columns import add_gear_offset, add_gear_ratio, add_loop_geometry, add_loop_turn
from sim.derivatives.parameters.pair_columns import add_pairs_mass, add_shapes_shift
from sim.derivatives.parameters.sizes import add_shapes_size
from sim.derivatives.parameters.surface import add_surface_radius
from sim.dynamics.displacements import other_quaternions
from sim.dynamics.elimination_panel import clear_columns, column_count
from sim.dynamics.kinematics import displace
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.types import IntegerMatrix, Vector


@kernel
def add_term(model: Model, data: Data, at: At, effect: int, i: int, k: int, w: float, col: int) -> None:
    """columns[:, col] -= w dR/d(effect i, k)"""
    if Effect.PARENT_POINT <= effect <= Effect.AXIS:
        add_geometry(model, data, at, effect, i, k, w, col)
    elif effect == Effect.MASS:
        add_mass(model, data, at.h, i, w, col)
        add_pairs_mass(model, data, i, w, col)
    elif effect == Effect.INERTIA:
        add_inertia(model, data, at.h, i, k, w, col)
    elif effect == Effect.SPRING:
        add_spring(model, data, at, i, w, col)
    elif effect == Effect.DAMPER:
        add_damper(model, data, at, i, w, col)
    elif effect == Effect.SEEN:
        add_seen(model, data, at, i, w, col)
    elif effect == Effect.ARMATURE:
        data.columns[i, col] -= w * (data.nu[i] - at.v[i])
    elif effect == Effect.REST:
        add_rest(model, data, at, i, k, w, col)
    elif effect == Effect.BOUND:
        add_bound(model, data, i, w, col)
    elif effect == Effect.GRAVITY:
        add_gravity(model, data, at.h, k, w, col)
    elif effect == Effect.INPUT:
        add_input(model, data, at, i, k, w, col)
    elif effect == Effect.TIME_STEP:
        add_time_step(model, data, at, w, col)
        add_slips_time_step(model, data, at.h, w, col)
    else:
        add_contact_term(model, data, at.h, effect, i, k, w, col)
        add_coupled_term(model, data, at.h, effect, i, k, w, col)


@kernel
def add_contact_term(model: Model, data: Data, h: float, effect: int, i: int, k: int, w: float, col: int) -> None:
    """`add_term` of effects on contacts, those of pairs among them."""
    if effect == Effect.FRICTION:
        add_friction(model, data, i, w, col)
    elif effect == Effect.RESTITUTION:
        add_restitution(model, data, h, i, w, col)
    elif effect == Effect.POINT:
        add_point(model, data, h, i, k, w, col)
    elif effect == Effect.RADIUS:
        add_radius(model, data, h, i, w, col)
        add_surface_radius(model, data, h, i, w, col)
    elif effect == Effect.HEIGHT:
        add_height(model, data, h, i, w, col)
    elif effect == Effect.NORMAL:
        add_normal(model, data, h, i, k, w, col)
    elif effect == Effect.TURNING_FRICTION:
        add_friction_against_turning(model, data, i, k, w, col)


@kernel
def add_coupled_term(model: Model, data: Data, h: float, effect: int, i: int, k: int, w: float, col: int) -> None:
    """`add_term` of effects on couplings of branches: shapes of collisions, loops, gears."""
    if effect == Effect.SHAPE_SHIFT:
        add_shapes_shift(model, data, h, i, k, w, col)
    elif effect == Effect.SHAPE_SIZE:
        add_shapes_size(model, data, h, i, k, w, col)
    elif effect == Effect.LOOP_PARENT or effect == Effect.LOOP_CHILD:
        add_loop_geometry(model, data, effect, i, k, w, col)
    elif effect == Effect.LOOP_TURN:
        add_loop_turn(model, data, i, k, w, col)
    elif effect == Effect.GEAR_RATIO:
        add_gear_ratio(model, data, i, w, col)
    elif effect == Effect.GEAR_OFFSET:
        add_gear_offset(model, data, i, w, col)


@optional(Slot.FILL_COLUMNS)
def fill_columns(
    model: Model, data: Data, at: At, terms: IntegerMatrix, weights: Vector, first: int, start: int
) -> int:
    """columns = -dR/d(parameters from `first` on), as many as fit; returns the term after, `start` the term before."""
    clear_columns(data)
    take_corners(model, data, at.h)
    other_quaternions(data)
    displace(model, at.q, at.v, -at.h, data.theta1)  # steps that continue a motion do not need it
    end = first + column_count(model, data)
    t = start
    while t < weights.shape[0] and terms[t, ParameterTerm.COLUMN] < end:
        effect, i, k = (
            terms[t, ParameterTerm.EFFECT],
            terms[t, ParameterTerm.INDEX],
            terms[t, ParameterTerm.COMPONENT],
        )
        add_term(model, data, at, effect, i, k, weights[t], terms[t, ParameterTerm.COLUMN] - first)
        t += 1
    return t
