"""Files of motions: archives that contain their simulator, and tables and joint trajectories for other tools."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from os import PathLike
from typing import Any

import numpy as np

from sim.mechanism import checks
from sim.mechanism.archive import VERSION, Arrays, packed_part, part_of
from sim.mechanism.input import Input
from sim.simulator.npz_file import check_head, check_shapes, read_npz, reading
from sim.simulator.settings import SETTING_NAMES
from solvers.types import Floats

__all__ = ["archived", "contact_rows", "export", "joint_trajectory", "opened", "restored", "with_new_names"]


def archived(sim: Any, kind: str) -> tuple[dict[str, Any], Arrays]:
    """Head of an archive, and the arrays of its simulator.

    Args:
        sim: the simulator (None: none).
        kind: kind of the archive.

    Returns:
        (head as plain data, arrays by name).
    """
    arrays: Arrays = {}
    head: dict[str, Any] = {"format": f"dojo-opt {kind}", "version": VERSION}
    if sim is not None:
        mechanism, *settings = sim.__reduce__()[1]  # as given: kappa None for the default
        head["simulator"] = {"part": "Simulator", "mechanism": packed_part(mechanism, arrays)}
        head["simulator"] |= dict(zip(SETTING_NAMES, settings, strict=True))
    return head, arrays


def opened(call: str, path: str | PathLike[str], kind: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Head and arrays of an archive.

    Args:
        call: the call that an error names.
        path: path of the file, or the name it was saved under, to which NumPy adds .npz.
        kind: kind of the archive.

    Returns:
        (head, arrays by name).

    Raises:
        OSError: the file cannot be read.
        ValueError: it is another file, or of a later version.
    """
    with reading(call, path, kind):
        head, arrays = read_npz(call, path)
        version = int(head.pop("version", 0))
    form = head.pop("format", f"dojo-opt {kind}")
    if form != f"dojo-opt {kind}":
        raise ValueError(f"{call}: {path} is a {form!r}, expected a {kind}")
    if version > VERSION:
        raise ValueError(f"{call}: {path} was written by a later version of dojo-opt")
    return head, arrays


def restored(head: dict[str, Any], arrays: dict[str, Any]) -> Any:
    """The simulator of an archive.

    Args:
        head: head of the archive; the simulator is taken out of it.
        arrays: arrays by name; those of the simulator are taken out.

    Returns:
        The simulator, None where there is none.

    Raises:
        ValueError: a part of its mechanism is refused.
    """
    given = head.pop("simulator", None)
    if given is None:
        return None
    sim = part_of(given, arrays)
    for name in [name for name in arrays if name.startswith("array_")]:
        del arrays[name]
    return sim


_RENAMED = {"knot": "solved_steps", "substeps": "parts", "shares": "momentum_fractions"}  # until version 0.2


def with_new_names(entries: dict[str, Any]) -> dict[str, Any]:
    """Entries of a head, or arrays, of a trajectory, those with an old name under the new one.

    Args:
        entries: the entries by name.

    Returns:
        The same entries by their present names.
    """
    return {_RENAMED.get(name, name): entry for name, entry in entries.items()}


def contact_rows(sim: Any, head: Mapping[str, Any], arrays: Arrays) -> Arrays:
    """Check the archive of a trajectory.

    Args:
        sim: its simulator.
        head: the rest of its head.
        arrays: its arrays by name; those of contacts are taken out.

    Returns:
        The arrays of contacts by name.

    Raises:
        ValueError: an entry or an array is missing, or does not fit.
    """
    check_head(head, {"status": int, "solved_steps": int, "residual": float, "detail": str})
    steps, row = head["solved_steps"], (head["solved_steps"], sim.ncontact)
    shapes: dict[str, tuple[int | None, ...]] = {"x": (steps + 1, sim.nx), "u": (steps, sim.nu), "time": (steps + 1,)}
    shapes |= dict.fromkeys(("iterations", "parts", "momentum_fractions", "errors"), (steps,))
    shapes |= {"contact_gap": row, "contact_slip": row}
    shapes |= dict.fromkeys(("contact_impulse", "contact_point", "contact_normals"), (*row, 3))
    shapes |= {"contact_moment_impulse": (*row, 3)} if "contact_moment_impulse" in arrays else {}
    shapes |= {"wrenches": (steps, sim.nbody, 6)} if "wrenches" in arrays else {}
    check_shapes(arrays, shapes)
    return {name.removeprefix("contact_"): arrays.pop(name) for name in list(arrays) if name.startswith("contact_")}


def export(call: str, path: str | PathLike[str], sim: Any, time: Floats, x: Floats, u: Floats) -> None:
    """Write a motion for other tools: .csv, .npz, or .json, a joint trajectory.

    Args:
        call: the call that an error names.
        path: path of the file; its suffix decides.
        sim: the simulator.
        time: (T + 1,) times [s].
        x: (T + 1, nx) states.
        u: (T, nu) inputs [N, N m].

    Raises:
        OSError: the file cannot be written.
        ValueError: for another suffix.
    """
    target = checks.path(call, path)
    kind = checks.one_of(f"{call}: suffix of the path", target.suffix, (".csv", ".npz", ".json"))
    if kind == ".json":
        target.write_text(json.dumps(joint_trajectory(sim, time, x, u)) + "\n", encoding="utf-8")
        return
    q, v = coordinate_names(sim)
    inputs = list(sim.mechanism.input_names)
    if kind == ".npz":
        np.savez(
            target, time=time, q=x[:, : sim.nq], v=x[:, sim.nq :], u=u, q_names=q, v_names=v, u_names=np.array(inputs)
        )
        return
    held = np.full((len(x), sim.nu), np.nan)
    held[: len(u)] = u
    with target.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file)
        rows.writerow(["time", *q, *(f"v {name}" for name in v), *(f"u {name}" for name in inputs)])
        for row in np.concatenate([time[:, None], x, held], axis=1):
            rows.writerow(["" if np.isnan(value) else repr(float(value)) for value in row])


def coordinate_names(sim: Any) -> tuple[list[str], list[str]]:
    """Names of the entries of q, and of v.

    Args:
        sim: the simulator.

    Returns:
        (nq names, nv names); the entries of a quaternion are "joint qw" to "joint qz".
    """
    v, q = list(sim.mechanism.dof_names), []
    for joint in sim.mechanism.joints:
        own = v[sim.mechanism.v_slice(joint.name)]
        if joint.nrot == 3:
            own = [*own[:-3], *(f"{joint.name} q{part}" for part in "wxyz")]
        q += own
    return q, v


def joint_trajectory(sim: Any, time: Floats, x: Floats, u: Floats) -> dict[str, Any]:
    """A motion as ROS has it in trajectory_msgs/JointTrajectory, of the hinges and slides by their names in the file.

    Args:
        sim: the simulator.
        time: (T + 1,) times [s].
        x: (T + 1, nx) states.
        u: (T, nu) inputs [N, N m].

    Returns:
        {"joint_names": [...], "points": [{"positions", "velocities", "effort", "time_from_start"}, ...]}; the effort of
        the last point is that of the input before, that of a servo follows from its gains, the state of the point and
        its limits, and a joint without an input has none, 0.
    """
    mech = sim.mechanism
    joints = [joint for joint in mech.joints if joint.nv == 1 and joint.nq == 1]
    q = [mech.q_slice(joint.name).start for joint in joints]
    v = [mech.v_slice(joint.name).start for joint in joints]
    held = np.concatenate([u, u[-1:]]) if len(u) else np.zeros((len(x), sim.nu))
    efforts = np.zeros((len(x), len(joints)))
    places = {joint.name: k for k, joint in enumerate(joints)}
    for drive, targets in zip(mech.inputs or (), held.T, strict=True):
        if drive.joint in places:
            k = places[drive.joint]
            efforts[:, k] += _drive_force(drive, targets, x[:, q[k]], x[:, sim.nq + v[k]])
    points = [
        {
            "positions": x[t, q].tolist(),
            "velocities": x[t, [sim.nq + i for i in v]].tolist(),
            "effort": efforts[t].tolist(),
            "time_from_start": float(time[t]),
        }
        for t in range(len(x))
    ]
    return {"joint_names": [joint.name for joint in joints], "points": points}


def _drive_force(drive: Input, u: Floats, q: Floats, v: Floats) -> Floats:
    """Force of an input on its joint, (T,) each [N, N m]: u, or that of its servo."""
    if drive.servo is None:
        return u
    target = drive.stiffness * (u - q) - drive.damping * v if drive.servo == "position" else drive.damping * (u - v)
    return np.clip(target, *drive.force_limits)
