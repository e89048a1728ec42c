"""Collision meshes of links as convex hulls or primitives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim.io.meshes.decompose import decompose
from sim.io.meshes.fitted_shapes import fit
from sim.io.meshes.paths import find_mesh
from sim.io.meshes.reduced_hull import reduced_hull
from sim.io.meshes.triangles import MeshError, TriangleMesh, read_mesh
from sim.io.urdf.report import Notes
from sim.io.urdf.robot import Geometry, Robot, UrdfLink
from sim.mechanism import checks
from sim.mechanism.pose import HERE

CHOICES = ("hull", "decompose", "sphere", "box", "capsule", "none")
Choice = tuple[dict[str, str], int]  # by link the shapes that replace its meshes; corners of hulls
Key = tuple[str, tuple[float, ...], str]
Shapes = tuple[list[Geometry], float]  # in the frame of the mesh, and how far they are from it [m]


def mesh_choices(given: str | Mapping[str, str], links: Mapping[str, object]) -> dict[str, str]:
    """By link, the shapes that replace its meshes; "*" of a table is all the links that it does not name."""
    call = "load_urdf(meshes=...)"
    table = {"*": given} if isinstance(given, str) else dict(given)
    for name, choice in table.items():
        checks.one_of(f"{call}: link", name, ["*", *links])
        checks.one_of(call, choice, CHOICES)
    return {name: table.get(name, table.get("*", "hull")) for name in links}


def with_shapes(robot: Robot, file: Path, choice: Choice, mesh_dirs: Sequence[Path], warn: bool, notes: Notes) -> Robot:
    """The robot with shapes in place of its collision meshes.

    Meshes that are not there or cannot be read stay meshes, which touch nothing; warn: whether that is a warning.
    """
    known: dict[Key, Shapes | None] = {}
    chosen, corners = choice
    links, errors = dict(robot.links), []
    for name, link in robot.links.items():
        found: list[Geometry] = []
        for shape in link.collisions:
            made = None
            if shape.kind == "mesh" and chosen[name] != "none":
                key = (shape.file, shape.scale, chosen[name])
                if key not in known:
                    known[key] = _made(shape, file, (chosen[name], corners), mesh_dirs, name, warn, notes)
                made = known[key]
            if made is None:
                found.append(shape)
                continue
            found += [replace(part, pose=shape.pose.then(part.pose)) for part in made[0]]
            errors.append((made[1], f"{name} ({_millimeters(made[1])})"))
        links[name] = replace(link, collisions=tuple(found), visuals=_located(link, file, mesh_dirs, notes))
    if errors:
        notes.add(
            f"collision meshes are convex hulls of at most {corners} corners or primitives, at these largest distances "
            "from the hulls of the meshes",
            [text for _, text in sorted(errors, reverse=True)],
        )
    return replace(robot, links=links)


def _millimeters(length: float) -> str:
    """A length [m] with two digits, or all before the point."""
    mm = 1e3 * length
    return f"{mm:.0f} mm" if mm >= 10.0 else f"{mm:.2g} mm"


def _located(link: UrdfLink, file: Path, mesh_dirs: Sequence[Path], notes: Notes) -> tuple[Geometry, ...]:
    """The visual shapes of a link with the paths of their meshes, empty where there is no such file."""
    out = []
    for shape in link.visuals:
        if shape.kind == "mesh":
            path = find_mesh(shape.file, file, mesh_dirs) if shape.file else None
            if path is None:
                notes.add("visual meshes not found, which pictures leave out", [f"{link.name} ({shape.file})"])
            shape = replace(shape, file="" if path is None else str(path))
        out.append(shape)
    return tuple(out)


def _made(
    shape: Geometry, file: Path, how: tuple[str, int], mesh_dirs: Sequence[Path], link: str, warn: bool, notes: Notes
) -> Shapes | None:
    """The shapes of one mesh; None, with a note, where it cannot be read."""
    path = find_mesh(shape.file, file, mesh_dirs) if shape.file else None
    if path is None:
        notes.add("collision meshes not found; mesh_dirs=[...] names folders", [f"{link} ({shape.file})"], warn=warn)
        return None
    try:
        mesh = read_mesh(path)
        return shapes_of(TriangleMesh(mesh.vertices * np.asarray(shape.scale), mesh.faces, None), how, shape)
    except ImportError as error:
        notes.add(f"collision meshes that are not read: {error}", [link], warn=warn)
    except MeshError as error:
        notes.add("collision meshes that cannot be read", [f"{link} ({error})"], warn=warn)
    return None


def shapes_of(mesh: TriangleMesh, how: tuple[str, int], like: Geometry) -> Shapes:
    """The shapes of a mesh in its own frame, and their largest distance from its convex hull [m]."""
    choice, corners = how
    if choice in ("hull", "decompose"):
        pieces = [mesh.vertices] if choice == "hull" else decompose(mesh)
        hulls = [reduced_hull(points, corners) for points in pieces]
        return [replace(like, kind="hull", points=h, pose=HERE) for h, _ in hulls], max(e for _, e in hulls)
    fitted = fit(choice, mesh.vertices)
    return [replace(like, kind=fitted.kind, sizes=fitted.sizes, pose=fitted.pose)], fitted.error
