"""pack: a Mechanism as the Model that kernels read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.axes import contact_frame, fixed_axes, translation_axes
from sim.mechanism.contact import Contact
from sim.mechanism.contact_candidates import couples
from sim.mechanism.damper_inertia import damper_inertias
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack_clusters import pack_clusters
from sim.mechanism.pack_collisions import pack_collisions, tables_of
from sim.mechanism.servos import is_limited, limited_servos, with_servos
from sim.mechanism.shapes import rotation_matrix
from sim.mechanism.terrain import Terrain
from sim.model.layout import Sizes, allocate_model
from sim.model.model import InputKind, Law, Model
from solvers.lanes import LANES

_CONE = 0.0  # instead of the sign of a bound


def mechanism_sizes(mech: Mechanism) -> Sizes:
    """Counts of a mechanism; a limit is one bound of one degree of freedom."""
    nlimit = sum(len(_bounds(j)) for j in mech.joints)
    npair, npairs = len(mech.contact_candidates), len(couples(mech.contact_candidates))
    fields = list(height_fields(mech).values())
    return Sizes(
        nbody=mech.nbody,
        nq=mech.nq,
        nv=mech.nv,
        ncontact=len(mech.contacts) + npair,
        nlimit=nlimit,
        nu=len(mech.inputs or ()),
        npair=npair,
        ncoupling=npairs + len(mech.loops),
        nrow=6 * npairs + sum(6 - j.nv for j in mech.loops) + len(mech.gears),
        nloop=len(mech.loops),
        nhull=max(1, sum(len(table) for table in tables_of(mech.contact_candidates))),
        ngear=len(mech.gears),
        nterrain=len(fields),
        nheight=sum(f.coefficients.size for f in fields),
        nmoment=len(mech.contacts) + npair if has_moments(mech) else 0,
        ndry=sum(int(np.count_nonzero(j.friction)) for j in mech.joints) + len(limited_servos(mech.inputs or ())),
    )


def has_moments(mech: Mechanism) -> bool:
    """Whether a contact has torsional or rolling friction."""
    found = any(contact.torsional_friction or contact.rolling_friction for contact in mech.contacts)
    return found or any(any(candidate.moment_friction) for candidate in mech.contact_candidates)


def pack(mech: Mechanism) -> Model:
    """The numbers of a mechanism."""
    model = allocate_model(mechanism_sizes(mech))
    _pack_tree(mech, model)
    _pack_joints(with_servos(mech.joints, mech.inputs or ()), model)
    model.dof_seen[:] = damper_inertias(model)
    _pack_dry(mech, model)
    _pack_branches(model)
    _pack_trees(model)
    _pack_terrain(mech, model)
    _pack_contacts(mech, model)
    pack_collisions(mech, model)
    _pack_loops(mech, model)
    _pack_gears(mech, model)
    _pack_inputs(mech, model)
    model.gravity[:] = np.asarray(mech.gravity)
    return model


def _numbers(names: Sequence[str]) -> dict[str, int]:
    return {name: i for i, name in enumerate(names)}


def _pack_tree(mech: Mechanism, model: Model) -> None:
    index = _numbers(mech.body_names)
    carrying = {j.parent for j in mech.joints}
    for i, (body, joint) in enumerate(zip(mech.bodies, mech.joints, strict=True)):
        model.body_parent[i] = index.get(joint.parent or "", -1)
        model.body_qadr[i + 1] = model.body_qadr[i] + joint.nq
        model.body_vadr[i + 1] = model.body_vadr[i] + joint.nv
        model.body_mass[i] = body.mass
        model.body_weight[i] = 1.0 - body.gravity_compensation
        model.body_leaf[i] = body.name not in carrying
        model.body_inertia[i] = np.ravel(np.asarray(body.inertia, dtype=np.float64))


def _pack_branches(model: Model) -> None:
    """Which degrees of freedom are above a body, and which in its joint and below, as bits of blocks of LANES."""
    bodies = [
        (i, p, np.arange(model.body_vadr[i], model.body_vadr[i + 1])) for i, p in enumerate(model.body_parent.tolist())
    ]
    for i, p, own in bodies:
        if p >= 0:
            inherited = np.concatenate([model.dofs_above[p, : model.count_above[p]], bodies[p][2]])
            model.count_above[i] = len(inherited)
            model.dofs_above[i, : len(inherited)] = inherited
            model.body_above[i] = model.body_above[p]
            _set_bits(model.body_above[i], bodies[p][2])
        _set_bits(model.body_below[i], own)
    for i, p, own in reversed(bodies):
        if p >= 0:
            model.body_below[p] |= model.body_below[i]
        dofs = np.flatnonzero(np.unpackbits(model.body_below[i].astype(np.uint8), bitorder="little"))
        dofs = dofs[dofs >= own[0] + len(own)] if len(own) else dofs  # those of the bodies below come after its own
        model.count_below[i] = len(dofs)
        model.dofs_below[i, : len(dofs)] = dofs[::-1]


def _pack_trees(model: Model) -> None:
    """The trees that move apart from one another: body_root and tree_end."""
    for i, p in enumerate(model.body_parent.tolist()):
        held = p < 0 or model.body_root[p] < 0
        first = i if model.body_vadr[i + 1] > model.body_vadr[i] else -1
        model.body_root[i] = first if held else model.body_root[p]
        if model.body_root[i] >= 0:
            model.tree_end[model.body_root[i]] = i + 1


def _set_bits(row: NDArray[np.int64], dofs: NDArray[np.int64]) -> None:
    """Set bits of a row of blocks of LANES."""
    for d in dofs.tolist():
        row[d // LANES] |= 1 << d % LANES


def _pack_joints(joints: Sequence[Joint], model: Model) -> None:
    limit = 0
    for i, joint in enumerate(joints):
        d = int(model.body_vadr[i])
        dofs = slice(d, d + joint.nv)
        model.joint_ntrans[i], model.joint_nrot[i] = joint.ntrans, joint.nrot
        model.joint_parent_point[i] = np.asarray(joint.parent_point)
        model.joint_child_point[i] = np.asarray(joint.child_point)
        model.joint_offset[i] = np.asarray(joint.orientation)
        model.joint_axis[i] = np.asarray(joint.axis)
        model.joint_lead[i] = joint.lead
        model.joint_trans_axes[i] = translation_axes(joint.ntrans, joint.axis).ravel()
        model.joint_swing_axes[i] = translation_axes(2, joint.axis)[:2].ravel()
        model.dof_body[dofs] = i
        # the three degrees of freedom of a quaternion all point at its start
        model.dof_qadr[dofs] = model.body_qadr[i] + np.minimum(np.arange(joint.nv), joint.scalar_count)
        model.dof_spring[dofs], model.dof_damper[dofs] = np.asarray(joint.spring), np.asarray(joint.damper)
        model.dof_armature[dofs], model.dof_rest[dofs] = np.asarray(joint.armature), np.asarray(joint.rest)
        for dof, sign, bound in _bounds(joint):
            model.limit_dof[limit], model.limit_sign[limit], model.limit_bound[limit] = d + dof, sign, bound
            model.limit_cone[limit] = sign == _CONE
            limit += 1


def _pack_dry(mech: Mechanism, model: Model) -> None:
    """Degrees of freedom with dry friction, then servos whose force has limits."""
    forces = np.concatenate([np.asarray(joint.friction, dtype=np.float64) for joint in mech.joints])
    count = int(np.count_nonzero(forces))
    model.dry_dof[:count], model.dry_input[:count] = np.flatnonzero(forces), -1
    model.dry_force[:count] = forces[forces > 0.0]
    joints = _numbers(mech.joint_names)
    for k, (j, part) in enumerate(limited_servos(mech.inputs or ()), start=count):
        low, high = part.force_limits
        model.dry_dof[k], model.dry_input[k] = model.body_vadr[joints[part.joint or ""]] + part.dof, j
        model.dry_force[k], model.dry_middle[k] = 0.5 * (high - low), 0.5 * (high + low)
        model.dry_gain[k] = part.gain, part.stiffness, part.damping


def _bounds(joint: Joint) -> list[tuple[int, float, float]]:
    """(degree of freedom, +1 lower or -1 upper or 0 cone, bound) of every finite limit."""
    rows = [(dof, s, b) for dof, pair in enumerate(joint.limits or ()) for s, b in zip((1.0, -1.0), pair, strict=True)]
    cone = [(joint.ntrans, _CONE, joint.cone)] if joint.cone is not None else []
    return [row for row in rows if np.isfinite(row[2])] + cone


def _law(contact: Contact) -> Law:
    """Without friction every law is the impact law: one row instead of a cone that has shrunk to a line."""
    return Law[contact.law.upper()] if contact.friction > 0.0 else Law.IMPACT


def height_fields(mech: Mechanism) -> dict[tuple[int, float], Terrain]:
    """Lower bounds of the centres of balls: one surface per terrain and radius."""
    keys = {(id(c.terrain), float(c.radius)): c for c in mech.contacts if c.terrain is not None}
    return {key: c.terrain.surface(c.radius) for key, c in keys.items() if c.terrain is not None}


def _pack_terrain(mech: Mechanism, model: Model) -> None:
    fields = height_fields(mech)
    known = {id(contact.terrain): contact.terrain for contact in mech.contacts if contact.terrain is not None}
    first = 0
    for k, ((terrain, radius), surface) in enumerate(fields.items()):
        P = surface.coefficients
        model.terrain_rates[first : first + P.size] = known[terrain].radius_rate(radius).ravel()
        model.terrain_size[k] = first, *P.shape
        model.terrain_heights[first : first + P.size] = P.ravel()
        model.terrain_place[k] = (
            *np.asarray(surface.direction),
            *np.asarray(surface.origin),
            *(1.0 / np.asarray(surface.spacing)),
            *surface.bounds,
        )
        first += P.size
    for c, contact in enumerate(mech.contacts):
        if contact.terrain is not None:
            model.contact_terrain[c] = 1 + list(fields).index((id(contact.terrain), float(contact.radius)))


def _pack_contacts(mech: Mechanism, model: Model) -> None:
    bodies = _numbers(mech.body_names)
    for c, contact in enumerate(mech.contacts):
        model.contact_body[c] = bodies[contact.body]
        model.contact_law[c] = _law(contact)
        model.contact_point[c] = np.asarray(contact.point)
        model.contact_radius[c] = contact.radius
        model.contact_friction[c] = contact.friction
        model.contact_restitution[c] = contact.restitution
        if len(model.moment_friction):
            model.moment_friction[c] = contact.torsional_friction, contact.rolling_friction
        model.contact_frame[c] = contact_frame(contact.normal).ravel()
        model.contact_height[c] = contact.height
    if mech.contacts:
        from sim.mechanism.immovable_contacts import immovable_contacts  # scenes without contacts do not import it

        model.contact_hold[:] = immovable_contacts(model, mech.contacts)
    pack_clusters(model)


def _pack_loops(mech: Mechanism, model: Model) -> None:
    first = len(model.coupling_body) - len(mech.loops)
    bodies = {WORLD: -1, **_numbers(mech.body_names)}
    for m, joint in enumerate(mech.loops):
        k = first + m
        model.coupling_body[k] = bodies[joint.child], bodies[joint.parent or WORLD]
        model.coupling_row[k + 1] = model.coupling_row[k] + 6 - joint.nv
        model.loop_ntrans[m], model.loop_nrot[m] = joint.ntrans, joint.nrot
        model.loop_point[m] = np.concatenate([np.asarray(joint.parent_point), np.asarray(joint.child_point)])
        model.loop_offset[m] = rotation_matrix(joint.orientation).ravel()
        fixed = fixed_axes(joint)
        model.loop_axes[m, : fixed.size] = fixed.ravel()
        axis, first_across, second_across = contact_frame(joint.axis)
        model.loop_axis[m] = np.concatenate([first_across, second_across, axis])


def _pack_gears(mech: Mechanism, model: Model) -> None:
    joints = _numbers(mech.joint_names)
    for k, gear in enumerate(mech.gears):
        ends = ((gear.joint, gear.dof), (gear.other, gear.other_dof))
        model.gear_dof[k] = [model.body_vadr[joints[name]] + dof for name, dof in ends]
        model.gear_ratio[k], model.gear_offset[k] = gear.ratio, gear.offset


def _pack_inputs(mech: Mechanism, model: Model) -> None:
    joints, bodies = _numbers(mech.joint_names), _numbers(mech.body_names)
    for k, part in enumerate(mech.inputs or ()):
        if part.joint is not None:
            model.input_kind[k] = InputKind.JOINT
            model.input_index[k] = model.body_vadr[joints[part.joint]] + part.dof
            model.input_wrench[k, 0] = 0.0 if is_limited(part) else part.gain  # else _pack_dry has it
        else:
            model.input_kind[k] = InputKind.WORLD if part.frame == "world" else InputKind.BODY
            model.input_index[k] = bodies[part.body or ""]
            model.input_wrench[k] = np.concatenate([np.asarray(part.force), np.asarray(part.torque)])
