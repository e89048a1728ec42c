"""Layout of Model and Data: one table of shapes, from which Python allocates every field and kernels find it."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.model.data import Carry, Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import Field, Part, Table, record, table
from solvers.lanes import LANES, SIDE, whole
from solvers.types import Floats

__all__ = ["CARRY_FIELDS", "INTEGERS", "MODEL_FIELDS", "DATA_FIELDS", "Shape", "Sizes", "allocate_model",
           "allocate_data", "allocate_tables", "model_view", "sizes_of", "table", "data_view"]  # fmt: skip

Shape = tuple[int | str, ...]

_REACH = 48  # rows of contacts and limits that a prediction takes


def _shapes(text: str) -> dict[str, Shape]:
    """{name: shape} of fields written as "name rows columns"; columns left out for a vector."""
    rows = [field.split() for field in text.split(",")]
    return {name: tuple(int(n) if n.isdigit() else n for n in shape) for name, *shape in rows}


MODEL_INTS = _shapes(
    """
    body_parent nbody, body_leaf nbody, body_qadr nbody+1, body_vadr nbody+1, joint_ntrans nbody, joint_nrot nbody,
    body_root nbody, tree_end nbody, body_above nbody nblock, body_below nbody nblock,
    dofs_above nbody nv, dofs_below nbody nv, count_above nbody, count_below nbody,
    dof_body nv, dof_qadr nv, contact_body ncontact, contact_law ncontact, cluster_end nground, optional nslot,
    contact_terrain nground, contact_hold nground, terrain_size nterrain 3,
    pair_coupling npair, pair_kind npair, pair_feature npair, coupling_body ncoupling 2, coupling_row ncoupling+1,
    loop_ntrans nloop, loop_nrot nloop, gear_dof ngear 2,
    limit_dof nlimit, limit_cone nlimit, dry_dof ndry, dry_input ndry, input_kind nu, input_index nu,
    root_free nbody
    """
)

MODEL_FLOATS = _shapes(
    """
    body_mass nbody, body_weight nbody, body_inertia nbody 9, joint_parent_point nbody 3, joint_child_point nbody 3,
    joint_offset nbody 4, joint_trans_axes nbody 9, joint_axis nbody 3, joint_lead nbody, joint_swing_axes nbody 6,
    dof_spring nv, dof_damper nv, dof_seen nv, dof_armature nv, dof_rest nv,
    contact_point nground 3, contact_radius nground, contact_friction ncontact, moment_friction nmoment 2,
    contact_restitution ncontact,
    contact_frame nground 9, terrain_place nterrain 8, terrain_heights nheight, terrain_rates nheight,
    contact_height nground, cluster nground 13, pair_sizes npair 8, pair_least npair, pair_place 2npair 12,
    pair_bound npair 12, body_reach nbody, hull nhull 4,
    loop_point nloop 6, loop_offset nloop 9, loop_axes nloop 9, loop_axis nloop 9,
    gear_ratio ngear, gear_offset ngear, limit_sign nlimit, limit_bound nlimit, dry_force ndry, dry_middle ndry,
    dry_gain ndry 3,
    input_wrench nu 6, gravity 3, stage_a nstage nstage, stage_b nstage
    """
)

CARRY_INTS = _shapes("steps 1, travel_known 1")
CARRY_FLOATS = _shapes(
    """
    external nbody 6, inactive_kappa 1, cone_step ncontact 16, bound_step nlimit 2, dry_step ndry 4, couple_force nrow,
    next_velocity nv
    """
)

DATA_INTS = _shapes(
    """
    active_ground_count 1, active_count 1, inactive_count 1, active ncontact, inactive_first nground,
    contact_out nground,
    pair_sides npair, pair_code npair, pair_previous npair,
    feature_choice 1, strategy_solves 64, overlap_allowed 1, bifurcation_count 1, bifurcation_replaces 1,
    loop_used nrow, reach_of nreach,
    coupling_live ncoupling, near_collision_count 1, near_collisions npair,
    couple_live nrow 2, couple_seen ncouple, couple_order ncouple, couple_count 1, node_count 1, couple_degree ncouple,
    couple_dof nv, couple_linked ncouple ncouple, couple_start ncouple+1, node_row ncouple+1,
    node_span ncouple ncouple+2
    """
)

DATA_FLOATS = _shapes(
    """
    origin 3, theta1 nq, theta3 nq, nu nv, nu_trial nv, dnu nv, pos1 nbody 3, quat1 nbody 4, rot1 nbody 9,
    pos2 nbody 3, quat2 nbody 4, rot2 nbody 9, pos3 nbody 3, quat3 nbody 4, rot3 nbody 9, S1 nv 6, S2 nv 6, S3 nv 6,
    S3nu nv 6, inertia_world nbody 9, momentum_in nbody 6, momentum_out nbody 6, body_impulse nbody 6,
    arm nbody 6, turn_matrix nbody 9, move_in nbody 3, move nbody 3, turn_in nbody 4, turn nbody 4,
    balance nbody 6, node_inertia nbody 9, node_momentum nbody 6, node_p nv, node_share nv,
    wrench nbody 6, subtree nbody 6, residual nv, rhs nv, A nbody 36,
    articulated 6nbody 8, U nv 6, L nv 8, D nbody 37,
    joint_block nbody 36, rotor nv, z nv, twist nbody 6, cone ncontact 16, cone_trial ncontact 16,
    contact_kin ncontact 27, contact_frame nground 9,
    contact_turn nground 18, bounce ncontact 22, rebound_part 1,
    moment_kin 2nmoment 3, moment_W 2nmoment 9, moment_scale 2nmoment 4, moment_w 2nmoment 3, moment_Ca nmoment 18,
    moment_Cb nmoment 18,
    contact_W ncontact 9, contact_hard 1, contact_w ncontact 3, contact_scale ncontact 16, bound nlimit 2,
     bound_trial nlimit 2, dry ndry 4, dry_trial ndry 4, dry_move ndry 2, dry_w ndry 3, dry_drive ndry 3,
    bound_row nlimit 6, bound_gap nlimit, bound_w nlimit,
    shape_pos 2npair 3, shape_rot 2npair 9, pair_relative npair 12, pair_out npair 43,
    pair_frame npair 12, pair_trial 1 43,
    pair_before npair 14, pair_activation npair, pair_travel 1, pair_evaluated 1, pair_change 1,
    inactive_pose nbody 7, inactive_wrench nbody 6, pair_fade npair 2, pair_clear npair, pair_margin 1,
    body_travel nbody 9, pair_apart npair 2,
    pair_turn npair 18, pair_shift npair 18, pair_Ca npair 18, pair_Cb npair 18, pair_rows 2 6, pair_scratch 18,
    coupling_K 2ncoupling 36, coupling_K2 2ncoupling 36, couple_B nrow 6, couple_G nrow 6,
    couple_R nrow 12, couple_E nrow, couple_Y nv 8ncouple, couple_Z 6nbody 8, couple_T nrow 8ncouple,
    couple_pivots nrow 2, couple_rank 4,
    couple_scale nrow, couple_x nrow 8, couple_gap nrow, couple_step nrow, couple_trial nrow,
    couple_panel nrow ncolumn, couple_wrench 6, loop_frame nloop 12, loop_turn nloop 9,
    loop_velocity nv, loop_start nv, loop_kept nv, loop_pivot 1, bifurcation_direction nrow nv, bifurcation_row nrow nv,
    loop_scale nrow, loop_open nrow, gear_rate ngear 2,
    A1 nbody 36, A2 nbody 36, A3 nbody 36, F nv 24, G nv 24, S_across 18 nwide, F_across 12 nwide,
    triangles nv nwide, triangle_across 12 nwide,
    dR_dq nv nwide, dR_dv nv nwide, columns nv ncolumn, panel 6nbody npanel,
    step_A 2nv 2nv, step_B 2nv nu, chain 2nv ncolumn, chain_columns 2nv 24, step_x 2 nx, report 9, loop_clock 2,
    inactive nground 45, inactive_tolerance 1, far_wrench nbody 6,
    corners 10 nground+8, near_corners 6 nground+8, corner_sums 36 8, corner_law nground 36, corner_block 36,
    reach nv nreach, delassus nreach nreach, reach_rate nreach, reach_impulse nreach, reach_change nreach,
    reach_friction nreach,
    held_x 2 high_state, held_u high_nu, held_momenta high_nv, momenta high_nv, stage_shift high_nv,
    stage_momenta high_nv, stage_dr nstage high_nv, stage_dp nstage high_nv, slope_p_q high_nv high_nv,
    slope_p_v high_nv high_nv, slope_f_q high_nv high_nv, slope_f_v high_nv high_nv, slope_f_u high_nv high_nu,
    slope_column high_nv 42, tangent_q high_nv high_n, tangent_p high_nv high_n, tangent_shift high_nv high_n,
    tangent_stage_q high_nv high_n, tangent_stage_p high_nv high_n, tangent_dr nstage_nv high_n,
    tangent_dp nstage_nv high_n
    """
)

MODEL_FIELDS = {**MODEL_INTS, **MODEL_FLOATS}
CARRY_FIELDS = {**CARRY_INTS, **CARRY_FLOATS}
DATA_FIELDS = {**DATA_INTS, **DATA_FLOATS}
INTEGERS = {*MODEL_INTS, *CARRY_INTS, *DATA_INTS}


class Sizes(NamedTuple):
    """Counts of one mechanism."""

    nbody: int
    nq: int
    nv: int
    ncontact: int
    nlimit: int
    nu: int
    npair: int = 0  # contacts between two bodies, or of one with an obstacle
    ncoupling: int = 0  # two bodies with pairs, and closed loops
    nrow: int = 0  # unknown forces of the couplings
    nloop: int = 0
    nhull: int = 1  # rows of the tables of polytopes
    ngear: int = 0
    nterrain: int = 0  # height fields: one per terrain and radius of its contacts
    nheight: int = 0  # their coefficients
    ndry: int = 0  # dry friction of degrees of freedom, and servos with limits of their force
    nstage: int = 0  # stages of steps of higher order, 0 of those of order 2
    nmoment: int = 0  # contacts, where one has torsional or rolling friction


def _lengths(sizes: Sizes) -> dict[str, int]:
    """Numbers of rows and columns by the names that the shapes of fields use."""
    nv, nu = sizes.nv, sizes.nu
    high = 1 if sizes.nstage else 0
    columns = max(2 * nv + whole(nu), nv + whole(nv))  # with the numbers that lanes write behind dR_dv and the inputs
    columns = -(-columns // SIDE) * SIDE
    couple = sizes.ncoupling + sizes.ngear
    return {
        **sizes._asdict(),
        "nbody+1": sizes.nbody + 1,
        "6nbody": 6 * sizes.nbody,
        "2nv": 2 * sizes.nv,
        "nx": sizes.nq + sizes.nv,
        "nground": sizes.ncontact - sizes.npair,
        "nground+8": sizes.ncontact - sizes.npair + LANES,
        "2npair": 2 * sizes.npair,
        "2nmoment": 2 * sizes.nmoment,
        "ncoupling+1": sizes.ncoupling + 1,
        "2ncoupling": 2 * sizes.ncoupling,
        "ncouple": couple,
        "ncouple+1": couple + 1,
        "ncouple+2": couple + 2,
        "8ncouple": LANES * couple,
        "nslot": len(Slot),
        "nblock": whole(nv) // LANES,
        "nwide": whole(nv),
        "ncolumn": columns,
        "npanel": columns if sizes.nrow else LANES,
        "high_nv": high * nv,
        "high_state": high * (sizes.nq + nv),
        "high_nu": high * nu,
        "high_n": high * (2 * nv + nu),
        "nstage_nv": sizes.nstage * nv,
        "nreach": min(3 * (sizes.ncontact - sizes.npair) + sizes.nlimit, _REACH),
    }


def _extent(shape: Shape, named: dict[str, int]) -> tuple[int, int]:
    """Rows and columns of one field."""
    rows, cols = (named[n] if isinstance(n, str) else n for n in (*shape, 1)[:2])
    return rows, cols


_Fields = tuple[tuple[str, Shape], ...]
_MODEL_PARTS: tuple[_Fields, ...] = (tuple(MODEL_INTS.items()), tuple(MODEL_FLOATS.items()))
_DATA_PARTS: tuple[_Fields, ...] = tuple(
    (*carry.items(), *data.items()) for carry, data in ((CARRY_INTS, DATA_INTS), (CARRY_FLOATS, DATA_FLOATS))
)


@lru_cache(maxsize=64)
def _places(fields: _Fields, sizes: Sizes) -> tuple[int, list[tuple[str, slice, tuple[int, ...]]]]:
    """Length of a buffer for arrays of these shapes, end to end; the name, place and shape of each."""
    named = _lengths(sizes)
    length, start, places = 0, 0, []
    for name, shape in fields:
        rows, cols = _extent(shape, named)
        length += whole(rows * cols)
        if len(shape) == 2 and cols % LANES == 0:  # rows of whole lanes begin where cache lines do
            start = whole(start)
        places.append((name, slice(start, start + rows * cols), (rows, cols)[: len(shape)]))
        start += rows * cols
    return length, places


_LINE = 128 // 8  # words of a pair of cache lines: arrays that two threads write must not share one


def _carve(fields: _Fields, sizes: Sizes, buffer: NDArray[Any]) -> dict[str, Any]:
    """Arrays of these shapes, end to end in a buffer."""
    places = _places(fields, sizes)[1]
    return {name: buffer[at] if len(shape) == 1 else buffer[at].reshape(shape) for name, at, shape in places}


def _zeros(count: int, words: int) -> NDArray[np.int64]:
    """Buffers of zeros (count, words), each of which begins at a pair of cache lines."""
    width = words + -words % _LINE
    buffer: NDArray[np.int64] = np.zeros(count * width + _LINE, dtype=np.int64)
    start = -(buffer.ctypes.data // 8) % _LINE
    return buffer[start : start + count * width].reshape(count, width)


def _halves(parts: tuple[_Fields, ...], sizes: Sizes) -> tuple[int, int]:
    """Words of the integers and of the floats of a record; floats begin at a pair of cache lines."""
    integers, floats = (_places(fields, sizes)[0] for fields in parts)
    return integers + -integers % _LINE, floats


def _arrays(parts: tuple[_Fields, ...], sizes: Sizes, buffer: NDArray[np.int64]) -> dict[str, Any]:
    """The arrays of a record in its buffer."""
    start = _halves(parts, sizes)[0]
    integers, floats = parts
    return _carve(integers, sizes, buffer) | _carve(floats, sizes, buffer[start:].view(np.float64))


def allocate_model(sizes: Sizes) -> Model:
    """A Model of zeros."""
    return Model(**_arrays(_MODEL_PARTS, sizes, _zeros(1, sum(_halves(_MODEL_PARTS, sizes)))[0]))


def _data(sizes: Sizes, buffer: NDArray[np.int64]) -> Data:
    """The Data in a buffer."""
    arrays = _arrays(_DATA_PARTS, sizes, buffer)
    carry = Carry(**{name: arrays.pop(name) for name in CARRY_FIELDS})
    return Data(carry=carry, **arrays)


def allocate_data(sizes: Sizes) -> Data:
    """The scratch of one thread, and the state between its steps."""
    return _data(sizes, _zeros(1, sum(_halves(_DATA_PARTS, sizes)))[0])


@lru_cache(maxsize=64)
def _first_table(sizes: Sizes) -> tuple[int, Table, slice]:
    """Words of a Data, its table as if its buffer began at address 0, and the place of its contact frames."""
    buffer = _zeros(1, sum(_halves(_DATA_PARTS, sizes)))[0]
    data = _data(sizes, buffer)
    words = table(data)
    words[::3] -= buffer.ctypes.data
    start = (data.contact_frame.ctypes.data - buffer.ctypes.data) // 8
    return len(buffer), words, slice(start, start + data.contact_frame.size)


def allocate_tables(sizes: Sizes, count: int) -> tuple[Table, Floats]:
    """Many Data at once, as tables only, since the views of their arrays take longer to make than a step.

    Args:
        sizes: counts of the mechanism.
        count: number of Data.

    Returns:
        Their tables (count, words), and their contact frames (count, 9 nground), which keep all their arrays alive.
    """
    length, first, frames = _first_table(sizes)
    buffer = _zeros(count, length)
    tables = np.tile(first, (count, 1))
    tables[:, ::3] += buffer.ctypes.data + 8 * length * np.arange(count)[:, None]
    return tables, buffer.view(np.float64)[:, frames]


def sizes_of(model: Model) -> Sizes:
    """Counts of a packed mechanism."""
    return Sizes(
        nbody=len(model.body_parent),
        nq=int(model.body_qadr[-1]),
        nv=len(model.dof_body),
        ncontact=len(model.contact_body),
        nlimit=len(model.limit_dof),
        nu=len(model.input_kind),
        npair=len(model.pair_kind),
        ncoupling=len(model.coupling_body),
        nrow=int(model.coupling_row[-1]) + len(model.gear_dof),
        nloop=len(model.loop_ntrans),
        nhull=len(model.hull),
        ngear=len(model.gear_dof),
        nterrain=len(model.terrain_size),
        nheight=len(model.terrain_heights),
        ndry=len(model.dry_dof),
        nstage=len(model.stage_b),
        nmoment=len(model.moment_friction),
    )


def _fields(cls: Any, shapes: dict[str, Shape]) -> list[Field]:
    """Types of the fields in compiled code; widths that are numbers are constants there."""
    return [
        Field(
            name,
            name in INTEGERS,
            None if len(shapes[name]) == 1 else int(shapes[name][1]) if isinstance(shapes[name][1], int) else 0,
        )
        for name in cls._fields
        if name in shapes
    ]


model_view = record(Model, _fields(Model, MODEL_FIELDS))
carry_view = record(Carry, _fields(Carry, CARRY_FIELDS))
data_view = record(Data, [Part("carry", Carry), *_fields(Data, DATA_FIELDS)])
