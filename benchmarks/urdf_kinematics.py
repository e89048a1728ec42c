"""Kinematics and dynamics of every URDF file of two packages, beside those of Pinocchio from the same file.

    pip install example-robot-data pybullet pin
    python benchmarks/urdf_kinematics.py               one line per robot, and the largest difference
    python benchmarks/urdf_kinematics.py --match talos

Each file is loaded unchanged on a fixed base by both, and compared at three random states: poses and Jacobians of all
links, centre of mass and its Jacobian, mass matrix, bias forces, gravity torques, and inverse dynamics. Differences are
relative to the largest entry, or absolute where that is below one. Files with the same bodies and masses are one robot;
those with links that Pinocchio does not have, or joints of more than one degree of freedom, say so.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from command import deliver, number, parser, progress
from urdf_zoo import package_files

import dojo_opt as dojo
from dojo_opt.report.result import Cell, Report, Table
from solvers.types import Floats

STATES, SEED = 3, 0
BAR = 1e-9
QUANTITIES = (
    "poses",
    "Jacobians",
    "center of mass",
    "mass matrix",
    "bias forces",
    "gravity torques",
    "inverse dynamics",
)


class Both:
    """A robot in both libraries, with the places of our degrees of freedom among those of Pinocchio."""

    def __init__(self, mech: Any, path: Path) -> None:
        import pinocchio as pin

        self.pin, self.kin = pin, dojo.Kinematics(dojo.Simulator(mech, time_step=0.01))
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        ids = [self.model.getJointId(joint.name) for joint in mech.joints]
        lost = [j.name for j, k in zip(mech.joints, ids, strict=True) if k >= self.model.njoints or j.nv != 1]
        if lost or self.model.nv != len(ids):
            raise ValueError(f"other joints: {', '.join(lost[:3]) or self.model.nv}")
        self.joints = [self.model.joints[k] for k in ids]
        self.order = np.array([joint.idx_v for joint in self.joints])
        frames = {name: self.model.getFrameId(name, pin.FrameType.BODY) for name in self.kin.frames}
        self.frames = {name: k for name, k in frames.items() if k < self.model.nframes}
        if len(self.frames) < len(frames):
            raise ValueError(f"other links: {', '.join(sorted(frames.keys() - self.frames.keys())[:3])}")

    def differences(self, q: Floats, v: Floats, a: Floats) -> list[float]:
        """Of every quantity at a state and an acceleration (nv,)."""
        pin, kin, model, data, order = self.pin, self.kin, self.model, self.data, self.order
        there, w, b = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        w[order], b[order] = v, a
        for joint, angle in zip(self.joints, q, strict=True):
            part = slice(joint.idx_q, joint.idx_q + joint.nq)
            there[part] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        pin.forwardKinematics(model, data, there)
        pin.updateFramePlacements(model, data)
        pin.computeJointJacobians(model, data, there)
        poses, slopes = [], []
        for name, k in self.frames.items():
            place, turn = kin.pose(name, q)
            poses += [difference(place, data.oMf[k].translation), difference(turn, data.oMf[k].rotation)]
            J = self._matrix(pin.getFrameJacobian(model, data, k, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED))
            slopes.append(difference(kin.jacobian(name, q), J))
        com = difference(kin.center_of_mass(q), pin.centerOfMass(model, data, there))
        com = max(com, difference(kin.com_jacobian(q), self._matrix(pin.jacobianCenterOfMass(model, data, there))))
        M = np.reshape(pin.crba(model, data, there), (model.nv, model.nv))
        M = np.triu(M) + np.triu(M, 1).T
        gravity = pin.computeGeneralizedGravity(model, data, there).copy()
        pairs = (
            (kin.mass_matrix(q), M[np.ix_(order, order)]),
            (kin.bias_forces(q, v), (pin.nonLinearEffects(model, data, there, w) - gravity)[order]),
            (kin.gravity_torques(q), gravity[order]),
            (kin.inverse_dynamics(q, v, a), pin.rnea(model, data, there, w, b)[order]),
        )
        return [max(poses), max(slopes), com, *(difference(*pair) for pair in pairs)]

    def _matrix(self, theirs: Any) -> Floats:
        """Our columns of a Jacobian; one with a single column comes as a vector."""
        return np.asarray(np.reshape(theirs, (-1, self.model.nv))[:, self.order])


def difference(ours: Any, theirs: Any) -> float:
    """Largest difference of entries, over the largest entry where that exceeds one."""
    theirs = np.asarray(theirs)
    return float(np.abs(np.asarray(ours) - theirs).max() / max(1.0, np.abs(theirs).max()))


def compared(path: Path, known: set[Any]) -> list[Cell] | None:
    """A line of a file: joints, links, differences, and the reason where there are none; None for a known robot."""
    name = "/".join(path.parts[-2:])
    nothing: list[Cell] = [None] * len(QUANTITIES)
    try:
        mech = dojo.load_urdf(path, floating=False)
    except dojo.UrdfError as error:
        return [name, None, None, *nothing, " ".join(str(error).split())[:100]]
    key = tuple((b.name, round(b.mass, 6)) for b in mech.bodies)
    if key in known:
        return None
    known.add(key)
    try:
        both = Both(mech, path)
    except (ValueError, IndexError) as error:
        return [name, mech.nv, None, *nothing, " ".join(str(error).split())[:100]]
    rng = np.random.default_rng(SEED)
    worst = np.max([both.differences(*rng.uniform(-1.0, 1.0, (3, mech.nv))) for _ in range(STATES)], axis=0)
    return [name, mech.nv, len(both.frames), *worst.tolist(), ""]


def measure(args: argparse.Namespace) -> Report:
    """All robots."""
    paths = [p for p in args.files or package_files() if args.match in str(p) and "random_urdfs" not in p.parts]
    known: set[Any] = set()
    lines: list[list[Cell]] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in progress()([(p.stem, p) for p in paths[: 3 if args.quick else None]], "robots"):
            line = compared(path, known)
            lines += [] if line is None else [line]
    done = [line for line in lines if line[3] is not None]
    worst = max((float(value) for line in done for value in line[3:-1]), default=0.0)  # type: ignore[arg-type]
    report = Report("Kinematics and dynamics beside Pinocchio", "")
    report.rows = [
        number("robots", len(done)),
        number("links", sum(int(line[2]) for line in done)),  # type: ignore[arg-type]
        number("not compared", len(lines) - len(done)),
        number("largest difference", worst, BAR),
    ]
    header = ("file", "dofs", "links", *QUANTITIES, "not compared")
    report.tables = [Table("Files", header, lines, "largest differences over three random states")]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report; exit status 1 if a difference is above the bar."""
    arguments = parser(__doc__)
    arguments.add_argument("files", nargs="*", type=Path, help="URDF files; default: all files of the two packages")
    arguments.add_argument("--match", default="", help="only files with this in their path")
    return deliver("urdf_kinematics", measure, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
