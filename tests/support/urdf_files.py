"""URDF files for tests, put together from parts; and MuJoCo's reading of a file, as the reference."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

import dojo_opt as dojo
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.shapes import rotation_matrix

BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
AXIS = '<axis xyz="0 1 0"/>'
SKEWED = (0.02, 0.03, 0.04, 0.002, -0.003, 0.004)  # xx yy zz xy xz yz [kg m^2]


def inertial(mass: float = 1.0, xyz: str = "0 0 0", rpy: str = "0 0 0", inertia: tuple[float, ...] = SKEWED) -> str:
    xx, yy, zz, xy, xz, yz = inertia
    return (
        f'<inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="{mass}"/>'
        f'<inertia ixx="{xx}" ixy="{xy}" ixz="{xz}" iyy="{yy}" iyz="{yz}" izz="{zz}"/></inertial>'
    )


def collision(shape: str, xyz: str = "0 0 0", rpy: str = "0 0 0") -> str:
    return f'<collision><origin xyz="{xyz}" rpy="{rpy}"/><geometry>{shape}</geometry></collision>'


def link(name: str, *parts: str) -> str:
    """A link, by default of 1 kg."""
    return f'<link name="{name}">{"".join(parts or [inertial()])}</link>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", *parts: str, at: str = "") -> str:
    origin = at or 'xyz="0.1 -0.2 0.3" rpy="0.3 -0.4 0.5"'
    inside = "".join(parts or ['<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5" velocity="2"/>'])
    return (
        f'<joint name="{name}" type="{kind}"><origin {origin}/><parent link="{parent}"/><child link="{child}"/>'
        f"{inside}</joint>"
    )


def write(folder: Path, *parts: str, name: str = "robot") -> Path:
    """The file of a robot, one part per line: the first part is on line 2."""
    path = folder / f"{name}.urdf"
    path.write_text("\n".join([f'<robot name="{name}">', *parts, "</robot>"]))
    return path


def arm(folder: Path, *extra: str, kind: str = "revolute", inside: tuple[str, ...] = ()) -> Path:
    """A base, and a forearm on a joint called elbow."""
    return write(
        folder,
        link("base", inertial(2.0), BALL),
        link("forearm"),
        joint("elbow", "base", "forearm", kind, *inside),
        *extra,
    )


def branched(folder: Path) -> Path:
    """A tree with offset and turned inertias, three kinds of joints, and fixed links in the middle and at the ends."""
    turned = inertial(1.3, "0.05 -0.1 0.02", "0.7 -0.2 1.1")
    limits = '<limit lower="-1.5" upper="1.5"/>'
    return write(
        folder,
        link("base", turned),
        *(link(name, turned, BALL) for name in ("upper", "bracket", "lower", "slider", "tool")),
        link("marker", ""),
        joint("shoulder", "base", "upper", "revolute", '<axis xyz="1 1 0"/>', limits, '<dynamics damping="0.1"/>'),
        joint("plate", "upper", "bracket", "fixed", ""),
        joint("elbow", "bracket", "lower", "continuous", '<axis xyz="0 -1 2"/>'),
        joint("rail", "bracket", "slider", "prismatic", '<axis xyz="0 0 1"/>', limits),
        joint("flange", "lower", "tool", "fixed", ""),
        joint("spot", "tool", "marker", "fixed", ""),
    )


# -- MuJoCo's reading of the same file ---------------------------------------------------------------------------------


def mujoco_model(path: Path) -> Any:
    """The links and joints of a file as MuJoCo reads them, on a floating base, without shapes; nothing is merged."""
    import mujoco

    root = ET.fromstring(path.read_bytes().strip(b"\0 \t\r\n"))
    for link_ in root.iter("link"):
        for tag in ("visual", "collision"):
            for part in link_.findall(tag):
                link_.remove(part)
    for joint_ in root.iter("joint"):
        for mimic in joint_.findall("mimic"):
            joint_.remove(mimic)
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    spec.compiler.fusestatic = False
    if (first := spec.worldbody.first_body()) and not first.joints:
        first.add_freejoint(name="floating_base")
    return spec.compile()


def compare_with_mujoco(path: Path, rng: np.random.Generator, states: int = 3) -> tuple[float, float, float]:
    """Largest differences from MuJoCo at random states: link poses [m, -], mass [relative], kinetic energy [relative].

    The coordinates of a state mean the same to both. The kinetic energies of random velocities are v^T M v / 2, so they see every entry of the mass matrix.
    """
    import mujoco

    mech = dojo.load_urdf(path, ground=False)
    sim = dojo.Simulator(mech, time_step=1e-3)
    model = mujoco_model(path)
    data = mujoco.MjData(model)
    worst = np.zeros(3)
    bodies = {mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, k): k for k in range(model.nbody)}
    for _ in range(states):
        q, v = np.zeros(mech.nq), rng.normal(size=mech.nv)
        for j in mech.joints:
            at = mech.q_slice(j.name)
            q[at] = rng.normal(size=j.nq)
            if j.nrot == 3:
                q[at.stop - 4 : at.stop] /= np.linalg.norm(q[at.stop - 4 : at.stop])
        for gear in mech.gears:  # MuJoCo's states need not obey them, ours do
            at, other = mech.v_slice(gear.joint).start + gear.dof, mech.v_slice(gear.other).start + gear.other_dof
            v[at] = gear.ratio * v[other]
            at, other = mech.q_slice(gear.joint).start + gear.dof, mech.q_slice(gear.other).start + gear.other_dof
            q[at] = gear.ratio * q[other] + gear.offset
        for j in mech.joints:
            at, dof = mech.q_slice(j.name), mech.v_slice(j.name)
            k = model.jnt(j.name).id
            a, d = model.jnt_qposadr[k], model.jnt_dofadr[k]
            data.qpos[a : a + j.nq], data.qvel[d : d + j.nv] = q[at], v[dof]
        mujoco.mj_forward(model, data)
        ours = body_poses(mech.joints, q)
        for name, frame in mech.report.links.items():
            if name not in bodies or frame.body is None:
                continue
            body = ours[frame.body]
            worst[0] = max(worst[0], np.abs(body.at(frame.point) - data.xpos[bodies[name]]).max())
            R = body.rotation @ rotation_matrix(frame.orientation)
            worst[0] = max(worst[0], np.abs(R - data.xmat[bodies[name]].reshape(3, 3)).max())
        x = np.concatenate([q, np.zeros(mech.nv)])
        z = sim.maximal(x)
        for k, body in enumerate(mech.body_names):  # the compiled kinematics stand on the same poses
            worst[0] = max(worst[0], np.abs(z[k, :3] - ours[body].point).max())
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        theirs = 0.5 * data.qvel @ M @ data.qvel
        energy = sim.kinetic_energy(sim.state_from_velocity(q, v * 0.1)) * 100.0
        worst[2] = max(worst[2], abs(energy - theirs) / theirs)
    moving = sum(b.mass for b in mech.bodies)
    theirs = sum(model.body_mass[bodies[n]] for n, f in mech.report.links.items() if n in bodies and f.body)
    worst[1] = abs(moving - theirs) / moving
    return float(worst[0]), float(worst[1]), float(worst[2])
