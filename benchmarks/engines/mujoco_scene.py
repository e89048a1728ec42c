"""The same mechanism for MuJoCo: MJCF text from the flat arrays of a Model.

MuJoCo's body frames are put at our centres of mass with the axes of the joint frame at zero coordinates; then q and v
have the same layout and, but for the convention of v (mean over the last interval, not at the node), the same meaning.
Contacts become spheres paired with the plane of their half-space, and with nothing else.

Features that MuJoCo cannot express are refused: quaternion joints with springs whose rest is not zero, orbital joints,
cones. With `hinges=True` an orbital joint becomes two hinges in series. They have as many coordinates and move alike
near zero: good for comparing run times, not motions.
Contacts and limits are soft in MuJoCo; a point contact becomes a sphere of a tenth of a millimetre.
"""

from __future__ import annotations

from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from sim.model.model import InputKind, Law, Model
from solvers.types import Vector

POINT_RADIUS = 1e-4  # [m] MuJoCo has no spheres of radius zero


def load(model: Model, time_step: float, *, hinges: bool = False, **options: str) -> Any:
    """`mujoco.MjModel` of the mechanism; options are attributes of MJCF's <option>, such as integrator="Euler"."""
    import mujoco

    return without_reset(mujoco.MjModel.from_xml_string(mjcf(model, time_step, hinges=hinges, **options)))


def without_reset(model: Any) -> Any:
    """The `mujoco.MjModel`, whose motions stay lost where they diverge: MuJoCo would begin them again."""
    import mujoco

    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    return model


def state(mj_model: Any, x: Vector) -> Any:
    """`mujoco.MjData` at our state x = [q; v], derived quantities computed."""
    import mujoco

    data = mujoco.MjData(mj_model)
    data.qpos[:] = x[: mj_model.nq]
    data.qvel[:] = x[mj_model.nq :]
    mujoco.mj_forward(mj_model, data)
    return data


def mjcf(model: Model, time_step: float, *, hinges: bool = False, **options: str) -> str:
    """MJCF text of the mechanism."""
    if len(model.coupling_body) + len(model.gear_dof):
        raise ValueError("mjcf: collisions between bodies and closed loops and gears are not written")
    if model.contact_terrain.any() or model.contact_restitution.any():
        raise ValueError("mjcf: terrain and restitution are not written")
    settings = {"timestep": repr(float(time_step)), "gravity": _numbers(model.gravity), "cone": "elliptic", **options}
    planes = _planes(model)
    lines = ["<mujoco>", '<compiler angle="radian" balanceinertia="false" boundmass="0" boundinertia="0"/>']
    lines += [_tag("option", settings), "<worldbody>", '<site name="world"/>']
    for name, (rotation, height) in planes.items():
        place = {"pos": _numbers(height * rotation[0]), "quat": _numbers(_frame_quat(rotation))}
        lines.append(_tag("geom", {"name": name, "type": "plane", "size": "0 0 1", **place, **_NO_COLLISION}))
    for body in range(len(model.body_mass)):
        if model.body_parent[body] < 0:
            lines += _body(model, body, hinges)
    lines += ["</worldbody>", "<contact>", *_pairs(model, planes), "</contact>"]
    lines += ["<actuator>", *(_actuator(model, k) for k in range(len(model.input_kind))), "</actuator>", "</mujoco>"]
    return "\n".join(lines)


_NO_COLLISION = {"contype": "0", "conaffinity": "0"}


def _numbers(values: Any) -> str:
    return " ".join(repr(float(value)) for value in np.ravel(values))


def _tag(name: str, attributes: dict[str, str], close: bool = True) -> str:
    return f"<{name} " + " ".join(f"{k}={quoteattr(v)}" for k, v in attributes.items()) + ("/>" if close else ">")


def _rotate(quat: Vector, vector: Vector) -> Vector:
    """R(quat) vector."""
    w, u = quat[0], quat[1:]
    return vector + 2.0 * np.cross(u, np.cross(u, vector) + w * vector)


def _frame_quat(rows: Vector) -> Vector:
    """Quaternion that turns the z axis into rows[0]: the pose of a MuJoCo plane for its half-space."""
    normal = rows[0]
    quat = np.array([1.0 + normal[2], -normal[1], normal[0], 0.0])
    return np.array([0.0, 1.0, 0.0, 0.0]) if quat[0] < 1e-9 else quat / np.linalg.norm(quat)


def _planes(model: Model) -> dict[str, tuple[Vector, float]]:
    """One plane per half-space that differs, by name."""
    planes: dict[str, tuple[Vector, float]] = {}
    for contact in range(len(model.contact_body)):
        planes.setdefault(_plane_name(model, contact), _half_space(model, contact))
    return planes


def _half_space(model: Model, contact: int) -> tuple[Vector, float]:
    return model.contact_frame[contact].reshape(3, 3), float(model.contact_height[contact])


def _plane_name(model: Model, contact: int) -> str:
    rows, height = _half_space(model, contact)
    return f"plane {_numbers(rows[0])} {height!r}"


def _body(model: Model, body: int, hinges: bool) -> list[str]:
    """<body> with its joints, inertia, contact spheres and children."""
    offset = model.joint_offset[body]
    pos = model.joint_parent_point[body] - _rotate(offset, model.joint_child_point[body])
    place = {"name": f"body{body}", "pos": _numbers(pos), "quat": _numbers(offset)}
    lines = [_tag("body", place | {"gravcomp": _numbers(1.0 - model.body_weight[body])}, close=False)]
    J = model.body_inertia[body].reshape(3, 3)
    inertia = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
    mass = {"pos": "0 0 0", "mass": _numbers(model.body_mass[body]), "fullinertia": _numbers(inertia)}
    lines += [*_joints(model, body, hinges), _tag("inertial", mass), _tag("site", {"name": f"site{body}"})]
    for contact in np.flatnonzero(model.contact_body == body):
        radius = max(float(model.contact_radius[contact]), POINT_RADIUS)
        sphere = {"type": "sphere", "size": repr(radius), "pos": _numbers(model.contact_point[contact])}
        lines.append(_tag("geom", {"name": f"contact{contact}", **sphere, **_NO_COLLISION, "mass": "0"}))
    for child in np.flatnonzero(model.body_parent == body):
        lines += _body(model, int(child), hinges)
    return [*lines, "</body>"]


def is_free(model: Model, body: int) -> bool:
    """Whether joint `body` is a free joint in MuJoCo's terms: q is the pose of the body itself in the world."""
    at_origin = not np.any(model.joint_parent_point[body]) and not np.any(model.joint_child_point[body])
    straight = np.array_equal(model.joint_trans_axes[body], np.eye(3).ravel()) and model.joint_offset[body, 0] == 1.0
    floating = model.joint_ntrans[body] == 3 and model.joint_nrot[body] == 3
    return bool(model.body_parent[body] < 0 and floating and at_origin and straight)


def _joints(model: Model, body: int, hinges: bool) -> list[str]:
    """<joint> per degree of freedom; a quaternion is one ball, a floating base one free joint."""
    if is_free(model, body):
        return [_tag("freejoint", {"name": f"free{body}"})]
    first = int(model.body_vadr[body])
    ntrans, nrot = int(model.joint_ntrans[body]), int(model.joint_nrot[body])
    point = {"pos": _numbers(model.joint_child_point[body])}
    axes = model.joint_trans_axes[body].reshape(3, 3)
    if nrot == 2 and not hinges:
        raise ValueError(f"mjcf: MuJoCo has no joint that turns across an axis and not about it (body {body})")
    if model.joint_lead[body] != 0.0:
        raise ValueError(f"mjcf: MuJoCo has no joint that turns and slides in one (body {body})")
    if np.any(model.limit_cone[(model.limit_dof >= first) & (model.limit_dof < first + ntrans + nrot)]):
        raise ValueError(f"mjcf: MuJoCo has no cone limit (body {body})")
    lines = [_scalar(model, first + k, "slide", axes[k], {}) for k in range(ntrans)]
    if nrot == 1:
        lines.append(_scalar(model, first + ntrans, "hinge", model.joint_axis[body], point))
    elif nrot == 2:
        swing = model.joint_swing_axes[body].reshape(2, 3)
        lines += [_scalar(model, first + ntrans + k, "hinge", swing[k], point) for k in range(2)]
    elif nrot == 3:
        dofs = slice(first + ntrans, first + ntrans + 3)
        if np.any(model.dof_spring[dofs] * model.dof_rest[dofs]):
            raise ValueError(f"mjcf: MuJoCo has no spring of a ball joint with a rest other than zero (body {body})")
        forces = {"stiffness": _numbers(model.dof_spring[dofs][0]), "damping": _numbers(model.dof_damper[dofs][0])}
        lines.append(_tag("joint", {"name": f"joint{first + ntrans}", "type": "ball", **point, **forces}))
    return lines


def _scalar(model: Model, dof: int, kind: str, axis: Vector, place: dict[str, str]) -> str:
    """<joint> of one coordinate with its spring, damper and limits."""
    attributes = {"name": f"joint{dof}", "type": kind, "axis": _numbers(axis), **place}
    attributes["stiffness"] = _numbers(model.dof_spring[dof])
    attributes["springref"] = _numbers(model.dof_rest[dof])
    attributes["damping"] = _numbers(model.dof_damper[dof])
    attributes["armature"] = _numbers(model.dof_armature[dof])
    low, high = -1e6, 1e6  # MuJoCo has two-sided ranges only
    for limit in np.flatnonzero(model.limit_dof == dof):
        bound = float(model.limit_bound[limit])
        low, high = (bound, high) if model.limit_sign[limit] > 0 else (low, bound)
    if (low, high) != (-1e6, 1e6):
        attributes |= {"limited": "true", "range": _numbers([low, high])}
    return _tag("joint", attributes)


def _pairs(model: Model, planes: dict[str, Any]) -> list[str]:
    """<pair> per contact: its sphere and its plane; a frictionless contact has one row, as ours."""
    lines = []
    for contact in range(len(model.contact_body)):
        mu = max(float(model.contact_friction[contact]), 1e-5)
        dimensions = "1" if model.contact_law[contact] == Law.IMPACT else "3"
        geoms = {"geom1": _plane_name(model, contact), "geom2": f"contact{contact}"}
        lines.append(_tag("pair", {**geoms, "condim": dimensions, "friction": _numbers([mu, mu, 0.005, 1e-4, 1e-4])}))
    return lines


def _actuator(model: Model, k: int) -> str:
    """<motor> per input."""
    kind, index = int(model.input_kind[k]), int(model.input_index[k])
    if kind == InputKind.JOINT:
        body = int(model.dof_body[index])
        within = index - int(model.body_vadr[body])
        ntrans = int(model.joint_ntrans[body])
        if is_free(model, body):
            return _tag("motor", {"joint": f"free{body}", "gear": _numbers(np.eye(6)[within])})
        if within < ntrans or model.joint_nrot[body] < 3:
            return _tag("motor", {"joint": f"joint{index}", "gear": "1"})
        first = int(model.body_vadr[body]) + ntrans
        return _tag("motor", {"joint": f"joint{first}", "gear": _numbers([*np.eye(3)[within - ntrans], 0, 0, 0])})
    world = {"refsite": "world"} if kind == InputKind.WORLD else {}
    return _tag("motor", {"site": f"site{index}", **world, "gear": _numbers(model.input_wrench[k])})
