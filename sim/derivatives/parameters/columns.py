"""Columns of -dR/d(parameter) of the step that `gradient` left in `work`, for a list of terms.

terms     (n, 4) Effect, index, component, column; in the order of their columns
weights   (n,) how much of the elementary change a unit of the parameter makes
"""

from __future__ import annotations

from sim.derivatives.parameters.body_columns import (
    add_bound,
    add_gravity,
    add_inertia,
    add_input,
    add_mass,
    add_rest,
    add_spring,
    add_time_step,
)
from sim.derivatives.parameters.contact_columns import (
    add_friction,
    add_height,
    add_normal,
    add_point,
    add_radius,
    add_restitution,
    add_slips_time_step,
)
from sim.derivatives.parameters.directions import At, Effect
from sim.derivatives.parameters.geometry import add_geometry
from sim.derivatives.parameters.loop_columns import add_gear_offset, add_gear_ratio, add_loop_geometry, add_loop_turn
from sim.derivatives.parameters.pair_columns import add_pairs_mass, add_shapes_shift
from sim.derivatives.parameters.sizes import add_shapes_size
from sim.derivatives.parameters.surface import add_surface_radius
from sim.dynamics.displacements import other_quaternions
from sim.dynamics.elimination_panel import column_count
from sim.model.data import Work
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.types import IntegerMatrix, Vector


@kernel
def add_term(model: Model, work: Work, at: At, effect: int, i: int, k: int, w: float, col: int) -> None:
    """columns[:, col] -= w dR/d(effect i, k)"""
    if Effect.PARENT_POINT <= effect <= Effect.AXIS:
        add_geometry(model, work, at, effect, i, k, w, col)
    elif effect == Effect.MASS:
        add_mass(model, work, at.h, i, w, col)
        add_pairs_mass(model, work, i, w, col)
    elif effect == Effect.INERTIA:
        add_inertia(model, work, at.h, i, k, w, col)
    elif effect == Effect.SPRING:
        add_spring(model, work, at, i, w, col)
    elif effect == Effect.DAMPER:
        work.columns[i, col] -= w * at.h * work.nu[i]
    elif effect == Effect.ARMATURE:
        work.columns[i, col] -= w * (work.nu[i] - at.v[i])
    elif effect == Effect.REST:
        add_rest(model, work, at, i, k, w, col)
    elif effect == Effect.BOUND:
        add_bound(model, work, i, w, col)
    elif effect == Effect.GRAVITY:
        add_gravity(model, work, at.h, k, w, col)
    elif effect == Effect.INPUT:
        add_input(model, work, at, i, k, w, col)
    elif effect == Effect.TIME_STEP:
        add_time_step(model, work, at, w, col)
        add_slips_time_step(model, work, at.h, w, col)
    else:
        add_contact_term(model, work, at.h, effect, i, k, w, col)
        add_coupled_term(model, work, at.h, effect, i, k, w, col)


@kernel
def add_contact_term(model: Model, work: Work, h: float, effect: int, i: int, k: int, w: float, col: int) -> None:
    """`add_term` of effects on contacts, those of pairs among them."""
    if effect == Effect.FRICTION:
        add_friction(model, work, i, w, col)
    elif effect == Effect.RESTITUTION:
        add_restitution(model, work, i, w, col)
    elif effect == Effect.POINT:
        add_point(model, work, h, i, k, w, col)
    elif effect == Effect.RADIUS:
        add_radius(model, work, h, i, w, col)
        add_surface_radius(model, work, h, i, w, col)
    elif effect == Effect.HEIGHT:
        add_height(model, work, i, w, col)
    elif effect == Effect.NORMAL:
        add_normal(model, work, h, i, k, w, col)


@kernel
def add_coupled_term(model: Model, work: Work, h: float, effect: int, i: int, k: int, w: float, col: int) -> None:
    """`add_term` of effects on what couples branches: shapes of collisions, loops, gears."""
    if effect == Effect.SHAPE_SHIFT:
        add_shapes_shift(model, work, h, i, k, w, col)
    elif effect == Effect.SHAPE_SIZE:
        add_shapes_size(model, work, h, i, k, w, col)
    elif effect == Effect.LOOP_PARENT or effect == Effect.LOOP_CHILD:
        add_loop_geometry(model, work, effect, i, k, w, col)
    elif effect == Effect.LOOP_TURN:
        add_loop_turn(model, work, i, k, w, col)
    elif effect == Effect.GEAR_RATIO:
        add_gear_ratio(model, work, i, w, col)
    elif effect == Effect.GEAR_OFFSET:
        add_gear_offset(model, work, i, w, col)


@kernel
def clear_columns(work: Work) -> None:
    """columns = 0, couple_panel = 0."""
    for m in range(work.columns.shape[1]):
        for d in range(work.columns.shape[0]):
            work.columns[d, m] = 0.0
    for row in range(work.couple_panel.shape[0]):
        for m in range(work.couple_panel.shape[1]):
            work.couple_panel[row, m] = 0.0


@kernel
def fill_columns(
    model: Model, work: Work, at: At, terms: IntegerMatrix, weights: Vector, first: int, start: int
) -> int:
    """columns = -dR/d(parameters from `first` on), as many as fit; returns the term after, `start` the term before."""
    clear_columns(work)
    other_quaternions(work)
    end = first + column_count(model, work)
    t = start
    while t < weights.shape[0] and terms[t, 3] < end:
        add_term(model, work, at, terms[t, 0], terms[t, 1], terms[t, 2], weights[t], terms[t, 3] - first)
        t += 1
    return t
