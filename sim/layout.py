"""Layout of the flat buffers: one table of shapes, from which both Python and kernels find every field.

    ints   = [ sizes (8) | directory of Model | directory of Work | integer fields of Model ]
    floats = [ float fields of Model ]
    work   = [ fields of Work ]

A directory has three numbers per field: first entry in its buffer, rows, columns (1 for a vector). The derivative
fields of Work come last; a buffer too short to hold them gives them zero rows, so the types never change.
"""

from __future__ import annotations

from typing import Any, NamedTuple, cast

import numpy as np

from sim.model import Integers, Matrix, Model, Vector, Work
from solvers.jit import kernel

NBODY, NQ, NV, NCONTACT, NLIMIT, NU, WORK_STEP, WORK_FULL = range(8)
HEAD = 8

Shape = tuple[int | str, ...]


def _shapes(text: str) -> dict[str, Shape]:
    """{name: shape} of fields written as "name rows columns"; columns left out for a vector."""
    rows = [field.split() for field in text.split(",")]
    return {name: tuple(int(n) if n.isdigit() else n for n in shape) for name, *shape in rows}


MODEL_INTS = _shapes(
    """
    body_parent nbody, body_qadr nbody+1, body_vadr nbody+1, joint_ntrans nbody, joint_nrot nbody, dof_body nv,
    dof_qadr nv, contact_body ncontact, contact_law ncontact, limit_dof nlimit, input_kind nu, input_index nu
    """
)

MODEL_FLOATS = _shapes(
    """
    body_mass nbody, body_inertia nbody 9, joint_parent_point nbody 3, joint_child_point nbody 3,
    joint_offset nbody 4, joint_trans_axes nbody 9, joint_axis nbody 3, dof_spring nv, dof_damper nv, dof_rest nv,
    contact_point ncontact 3, contact_radius ncontact, contact_friction ncontact, contact_frame ncontact 9,
    contact_height ncontact, limit_sign nlimit, limit_bound nlimit, input_wrench nu 6, gravity 3
    """
)

WORK_STEP_FIELDS = _shapes(
    """
    origin 3, theta1 nq, theta3 nq, nu nv, nu_trial nv, dnu nv, pos1 nbody 3, quat1 nbody 4, rot1 nbody 9,
    pos2 nbody 3, quat2 nbody 4, rot2 nbody 9, pos3 nbody 3, quat3 nbody 4, rot3 nbody 9, S1 nv 6, S2 nv 6, S3 nv 6,
    S3nu nv 6, inertia_world nbody 9, momentum_in nbody 6, body_impulse nbody 6, turn_in nbody 4, turn nbody 4,
    balance nbody 6, wrench nbody 6, subtree nbody 6, residual nv, rhs nv, A nbody 36, U nv 6, L nv 6, D nbody 37,
    joint_block nbody 36, z nv, twist nbody 6, cone ncontact 12, cone_step ncontact 12, cone_trial ncontact 12,
    contact_kin ncontact 24, contact_W ncontact 9, contact_w ncontact 3, contact_scale ncontact 16, bound nlimit 2,
    bound_step nlimit 2, bound_trial nlimit 2, bound_gap nlimit, bound_w nlimit
    """
)

WORK_DERIVATIVE_FIELDS = _shapes(
    """
    A1 nbody 36, A2 nbody 36, A3 nbody 36, F nv 18, G nv 18, dR_dq nv nv, dR_dv nv nv, columns nv 2nv+nu,
    panel 6nbody 2nv+nu, step_A 2nv 2nv, step_B 2nv nu, chain 2nv 2nv+nu, step_x 2 nx, report 5
    """
)

MODEL_FIELDS = {**MODEL_INTS, **MODEL_FLOATS}
WORK_FIELDS = {**WORK_STEP_FIELDS, **WORK_DERIVATIVE_FIELDS}
WORK_START = HEAD + 3 * len(MODEL_FIELDS)
DATA_START = WORK_START + 3 * len(WORK_FIELDS)

# the position of each field's entry in the directory, by name; a tuple of constants inside kernels
_M = cast(Any, Model(*[HEAD + 3 * list(MODEL_FIELDS).index(name) for name in Model._fields]))  # type: ignore[arg-type]
_W = cast(Any, Work(*[WORK_START + 3 * list(WORK_FIELDS).index(name) for name in Work._fields]))  # type: ignore[arg-type]


class Sizes(NamedTuple):
    """Counts of one mechanism."""

    nbody: int
    nq: int
    nv: int
    ncontact: int
    nlimit: int
    nu: int


def _extent(shape: Shape, sizes: Sizes) -> tuple[int, int]:
    """Rows and columns of one field."""
    named = {
        **sizes._asdict(),
        "nbody+1": sizes.nbody + 1,
        "6nbody": 6 * sizes.nbody,
        "2nv+nu": 2 * sizes.nv + sizes.nu,
        "2nv": 2 * sizes.nv,
        "nx": sizes.nq + sizes.nv,
    }
    rows, cols = (named[n] if isinstance(n, str) else n for n in (*shape, 1)[:2])
    return rows, cols


def _directory(fields: dict[str, Shape], sizes: Sizes, start: int) -> tuple[list[int], int]:
    """Entries (start, rows, columns) of `fields` laid end to end from `start`, and the end."""
    entries: list[int] = []
    for shape in fields.values():
        rows, cols = _extent(shape, sizes)
        entries += [start, rows, cols]
        start += rows * cols
    return entries, start


def allocate_model(sizes: Sizes) -> tuple[Vector, Integers]:
    """Zeroed buffers (floats, ints) of a mechanism, with the directories filled in."""
    in_ints, ints_end = _directory(MODEL_INTS, sizes, DATA_START)
    in_floats, floats_end = _directory(MODEL_FLOATS, sizes, 0)
    in_work, work_step = _directory(WORK_STEP_FIELDS, sizes, 0)
    in_derivatives, work_full = _directory(WORK_DERIVATIVE_FIELDS, sizes, work_step)
    ints = np.zeros(ints_end, dtype=np.int64)
    head = [*sizes, work_step, work_full, *in_ints, *in_floats, *in_work, *in_derivatives]
    ints[: len(head)] = head
    return np.zeros(floats_end), ints


def work_size(model_ints: Integers, derivatives: bool = True) -> int:
    """Length of the work buffer; without derivatives their fields have zero rows."""
    return int(model_ints[WORK_FULL if derivatives else WORK_STEP])


def _read(buffer: Vector | Integers, ints: Integers, entry: int, ndim: int) -> Vector | Integers:
    start, rows, cols = (int(n) for n in ints[entry : entry + 3])
    if start + rows * cols > buffer.size:
        start, rows = 0, 0
    flat = buffer[start : start + rows * cols]
    return flat if ndim == 1 else flat.reshape(rows, cols)


def read_model(floats: Vector, ints: Integers) -> Model:
    """`model_view` for Python: views of the buffers, by name."""
    fields = [
        _read(ints if name in MODEL_INTS else floats, ints, getattr(_M, name), len(MODEL_FIELDS[name]))
        for name in Model._fields
    ]
    return Model(*fields)  # type: ignore[arg-type]


def read_work(buffer: Vector, ints: Integers) -> Work:
    """`work_view` for Python: views of the buffer, by name."""
    fields = [_read(buffer, ints, getattr(_W, name), len(WORK_FIELDS[name])) for name in Work._fields]
    return Work(*fields)  # type: ignore[arg-type]


@kernel
def _integers(ints: Integers, entry: int) -> tuple[Integers]:
    """One integer field, in a tuple: a kernel may return a new view only inside a tuple."""
    return (ints[ints[entry] : ints[entry] + ints[entry + 1]],)


@kernel
def _vector(buffer: Vector, ints: Integers, entry: int) -> tuple[Vector]:
    return (buffer[ints[entry] : ints[entry] + ints[entry + 1]],)


@kernel
def _matrix(buffer: Vector, ints: Integers, entry: int) -> tuple[Matrix]:
    start, rows, cols = ints[entry], ints[entry + 1], ints[entry + 2]
    if start + rows * cols > buffer.size:
        start, rows = 0, 0
    return (buffer[start : start + rows * cols].reshape((rows, cols)),)


@kernel
def model_view(floats: Vector, ints: Integers) -> Model:
    """The fields of `Model` as views of its two buffers."""
    return Model(
        body_parent=_integers(ints, _M.body_parent)[0],
        body_qadr=_integers(ints, _M.body_qadr)[0],
        body_vadr=_integers(ints, _M.body_vadr)[0],
        joint_ntrans=_integers(ints, _M.joint_ntrans)[0],
        joint_nrot=_integers(ints, _M.joint_nrot)[0],
        dof_body=_integers(ints, _M.dof_body)[0],
        dof_qadr=_integers(ints, _M.dof_qadr)[0],
        contact_body=_integers(ints, _M.contact_body)[0],
        contact_law=_integers(ints, _M.contact_law)[0],
        limit_dof=_integers(ints, _M.limit_dof)[0],
        input_kind=_integers(ints, _M.input_kind)[0],
        input_index=_integers(ints, _M.input_index)[0],
        body_mass=_vector(floats, ints, _M.body_mass)[0],
        body_inertia=_matrix(floats, ints, _M.body_inertia)[0],
        joint_parent_point=_matrix(floats, ints, _M.joint_parent_point)[0],
        joint_child_point=_matrix(floats, ints, _M.joint_child_point)[0],
        joint_offset=_matrix(floats, ints, _M.joint_offset)[0],
        joint_trans_axes=_matrix(floats, ints, _M.joint_trans_axes)[0],
        joint_axis=_matrix(floats, ints, _M.joint_axis)[0],
        dof_spring=_vector(floats, ints, _M.dof_spring)[0],
        dof_damper=_vector(floats, ints, _M.dof_damper)[0],
        dof_rest=_vector(floats, ints, _M.dof_rest)[0],
        contact_point=_matrix(floats, ints, _M.contact_point)[0],
        contact_radius=_vector(floats, ints, _M.contact_radius)[0],
        contact_friction=_vector(floats, ints, _M.contact_friction)[0],
        contact_frame=_matrix(floats, ints, _M.contact_frame)[0],
        contact_height=_vector(floats, ints, _M.contact_height)[0],
        limit_sign=_vector(floats, ints, _M.limit_sign)[0],
        limit_bound=_vector(floats, ints, _M.limit_bound)[0],
        input_wrench=_matrix(floats, ints, _M.input_wrench)[0],
        gravity=_vector(floats, ints, _M.gravity)[0],
    )


@kernel
def work_view(work: Vector, ints: Integers) -> Work:
    """The fields of `Work` as views of its buffer; derivative fields have no rows when the buffer is too short."""
    return Work(
        origin=_vector(work, ints, _W.origin)[0],
        theta1=_vector(work, ints, _W.theta1)[0],
        theta3=_vector(work, ints, _W.theta3)[0],
        nu=_vector(work, ints, _W.nu)[0],
        nu_trial=_vector(work, ints, _W.nu_trial)[0],
        dnu=_vector(work, ints, _W.dnu)[0],
        pos1=_matrix(work, ints, _W.pos1)[0],
        quat1=_matrix(work, ints, _W.quat1)[0],
        rot1=_matrix(work, ints, _W.rot1)[0],
        pos2=_matrix(work, ints, _W.pos2)[0],
        quat2=_matrix(work, ints, _W.quat2)[0],
        rot2=_matrix(work, ints, _W.rot2)[0],
        pos3=_matrix(work, ints, _W.pos3)[0],
        quat3=_matrix(work, ints, _W.quat3)[0],
        rot3=_matrix(work, ints, _W.rot3)[0],
        S1=_matrix(work, ints, _W.S1)[0],
        S2=_matrix(work, ints, _W.S2)[0],
        S3=_matrix(work, ints, _W.S3)[0],
        S3nu=_matrix(work, ints, _W.S3nu)[0],
        inertia_world=_matrix(work, ints, _W.inertia_world)[0],
        momentum_in=_matrix(work, ints, _W.momentum_in)[0],
        body_impulse=_matrix(work, ints, _W.body_impulse)[0],
        turn_in=_matrix(work, ints, _W.turn_in)[0],
        turn=_matrix(work, ints, _W.turn)[0],
        balance=_matrix(work, ints, _W.balance)[0],
        wrench=_matrix(work, ints, _W.wrench)[0],
        subtree=_matrix(work, ints, _W.subtree)[0],
        residual=_vector(work, ints, _W.residual)[0],
        rhs=_vector(work, ints, _W.rhs)[0],
        A=_matrix(work, ints, _W.A)[0],
        U=_matrix(work, ints, _W.U)[0],
        L=_matrix(work, ints, _W.L)[0],
        D=_matrix(work, ints, _W.D)[0],
        joint_block=_matrix(work, ints, _W.joint_block)[0],
        z=_vector(work, ints, _W.z)[0],
        twist=_matrix(work, ints, _W.twist)[0],
        cone=_matrix(work, ints, _W.cone)[0],
        cone_step=_matrix(work, ints, _W.cone_step)[0],
        cone_trial=_matrix(work, ints, _W.cone_trial)[0],
        contact_kin=_matrix(work, ints, _W.contact_kin)[0],
        contact_W=_matrix(work, ints, _W.contact_W)[0],
        contact_w=_matrix(work, ints, _W.contact_w)[0],
        contact_scale=_matrix(work, ints, _W.contact_scale)[0],
        bound=_matrix(work, ints, _W.bound)[0],
        bound_step=_matrix(work, ints, _W.bound_step)[0],
        bound_trial=_matrix(work, ints, _W.bound_trial)[0],
        bound_gap=_vector(work, ints, _W.bound_gap)[0],
        bound_w=_vector(work, ints, _W.bound_w)[0],
        A1=_matrix(work, ints, _W.A1)[0],
        A2=_matrix(work, ints, _W.A2)[0],
        A3=_matrix(work, ints, _W.A3)[0],
        F=_matrix(work, ints, _W.F)[0],
        G=_matrix(work, ints, _W.G)[0],
        dR_dq=_matrix(work, ints, _W.dR_dq)[0],
        dR_dv=_matrix(work, ints, _W.dR_dv)[0],
        columns=_matrix(work, ints, _W.columns)[0],
        panel=_matrix(work, ints, _W.panel)[0],
        step_A=_matrix(work, ints, _W.step_A)[0],
        step_B=_matrix(work, ints, _W.step_B)[0],
        chain=_matrix(work, ints, _W.chain)[0],
        step_x=_matrix(work, ints, _W.step_x)[0],
        report=_vector(work, ints, _W.report)[0],
    )
