"""The page around an animation: MeshCat's viewer, its commands, and a bar with a clock."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from dojo_opt.viewer.motion import Motion
from solvers.types import Floats

__all__ = ["page"]

_SIDE = np.array([0.6, -1.0, 0.35])  # from where the camera looks
_FRONT = np.array([1.0, -0.5, 0.5])  # the same for motions side by side
_CLOSER = 0.6  # share of the width of a row of motions that counts for the distance: a picture is wider than high
_AWAY = 2.6  # its distance over the radius of the robot: with MeshCat's 75 degrees a third of the picture
_POINTS = 200  # of the path that the camera follows
_ROOM = 0.3  # [m] between motions side by side
_BOXES = {"forces": "forces", "paths": "paths", "ghost": "goal"}  # parts of MeshCat's scene, as the page calls them
_TINTS = ("#d9822b", "#2b6cd9", "#3a9d4f", "#a23ba8")  # of a robot that is drawn more than once, from the second on
_PLAIN = "#556"  # of the mark beside the name of a motion without a tint
_TINT, _THROUGH = 0.75, 0.5  # share of the tint in a colour, and opacity of robots that are drawn in one place
_SHADE, _SHADED = 0.35, 3.0  # darkness of shadows, and half-width of the ground that has some over the robot's radius
_SKY, _HORIZON = (1.0, 1.0, 1.0), (0.84, 0.88, 0.93)

_PAGE = """<!DOCTYPE html>
<html>
<head><meta charset="utf-8"><title>{title}</title>
<style>
body {{margin: 0; font: 14px system-ui, sans-serif; color: #223}}
#meshcat-pane {{width: 100vw; height: 100vh; overflow: hidden}}
.dg {{display: none !important}}
#bar {{position: absolute; left: 0; right: 0; bottom: 0; display: flex; gap: 12px; align-items: center;
      padding: 8px 16px; background: rgba(255, 255, 255, 0.8)}}
#time {{flex: 1; min-width: 60px}} #bar > * {{white-space: nowrap}}
#bar:has(.name) {{flex-wrap: wrap}} #bar button {{flex: none; min-width: 28px}} #bar #play {{width: 64px}}
#clock {{width: 110px; font-variant-numeric: tabular-nums}}
</style></head>
<body><div id="meshcat-pane" title="drag to turn, scroll to zoom"></div>
<div id="bar"><b>{title}</b>{legend}<button id="play">pause</button>
<button id="back" title="one knot back">&lsaquo;</button><button id="ahead" title="one knot ahead">&rsaquo;</button>
<input id="time" type="range" min="0" max="{duration}" step="any" value="0"><span id="clock"></span>
<select id="speed" title="speed"><option value="0.1">1/10</option>
<option value="0.25">1/4</option><option value="0.5">1/2</option><option value="1" selected>1 x</option>
<option value="2">2 x</option></select>{boxes}
<label><input id="follow" type="checkbox" checked> follow</label></div>
<script>{viewer}</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const part of [{commands}]) {{
    if (typeof part === "string") viewer.handle_command_bytearray(Uint8Array.from(atob(part), c => c.charCodeAt(0)));
    else viewer.set_object(part[1], viewer.scene_tree.find([...part[0], "<object>"]).object.clone());  // one mesh
}}
viewer.camera.position.set({eye});
viewer.controls.target.set({target});
viewer.controls.update();
viewer.set_property(["Background"], "top_color", [{sky}]);
viewer.set_property(["Background"], "bottom_color", [{horizon}]);
viewer.show_background();
for (const part of ["Axes", "Grid"]) viewer.set_property([part], "visible", false);
viewer.set_dirty();
const animator = viewer.animator, slider = document.getElementById("time"), button = document.getElementById("play");
const now = () => animator.actions.length ? animator.actions[0].time : 0;
const tell = () => {{document.getElementById("clock").textContent = now().toFixed(2) + " of {length} s"}};
button.onclick = () => {{
    animator.playing ? animator.pause() : animator.play();
    button.textContent = animator.playing ? "pause" : "play";
}};
const go = time => {{
    animator.pause();
    button.textContent = "play";
    animator.seek(time);
    slider.value = now();
    tell();
}};
slider.oninput = () => go(Number(slider.value));
document.getElementById("back").onclick = () => go((Math.round(now() / {knot}) - 1) * {knot});
document.getElementById("ahead").onclick = () => go((Math.round(now() / {knot}) + 1) * {knot});
document.getElementById("speed").onchange = event => {{animator.mixer.timeScale = Number(event.target.value);}};
for (const [path, pose] of {ghosts}) {{  // the goal: a copy of every body, which one sees through
    const body = viewer.scene_tree.find(path).object, copy = body.clone(true);
    copy.traverse(part => {{
        part.castShadow = false;
        if (!part.material) return;
        part.material = part.material.clone();
        Object.assign(part.material, {{transparent: true, opacity: 0.25, depthWrite: false}});
    }});
    copy.position.set(...pose.slice(0, 3));
    copy.quaternion.set(...pose.slice(3));
    viewer.scene_tree.find([...path.slice(0, -2), "ghost"]).object.add(copy);
}}
for (const [path, color, opacity] of {tints}) {{  // the same robot again
    viewer.scene_tree.find(path).object.traverse(part => {{
        if (!part.material) return;
        part.material = part.material.clone();
        part.material.color.lerp(new MeshCat.THREE.Color(color), {tint});
        if (opacity < 1) Object.assign(part.material, {{transparent: true, opacity}});
    }});
}}
for (const group of {groups}) for (const part of ["forces", "paths"])
    viewer.scene_tree.find([...group, part]).object.traverse(mark => {{mark.castShadow = false;}});
// a soft shadow on level ground, of a light from above that adds no light
const sun = new MeshCat.THREE.DirectionalLight(0xffffff, 0), reach = {reach};
const shade = new MeshCat.THREE.ShadowMaterial({{opacity: {shade}, depthWrite: false}});
const ground = new MeshCat.THREE.Mesh(new MeshCat.THREE.PlaneGeometry(2 * reach, 2 * reach), shade);
ground.receiveShadow = true;
Object.assign(sun.shadow.camera, {{left: -reach, right: reach, bottom: -reach, top: reach, far: 8 * reach}});
Object.assign(sun.shadow, {{radius: 2.5, blurSamples: 8, bias: -0.001}});  // else the ground has spots
sun.shadow.mapSize.set(256, 256);  // as soft as of 512 with twice the radius, at a quarter of its time
sun.castShadow = true;
viewer.scene.traverse(part => {{part.receiveShadow = false;}});  // on a body it would darken every light
viewer.scene_tree.find(["meshcat", "floor"]).object.traverse(line => {{line.castShadow = false;}});
if ({level}) {{
    viewer.renderer.shadowMap.type = MeshCat.THREE.VSMShadowMap;
    viewer.scene.add(sun, sun.target, ground);
}}
const shadow = at => {{
    const [x, y] = [at[0], -at[2]];  // the axes of the scene: z is up
    sun.position.set(x + 0.5 * reach, y + reach, 5 * reach);
    sun.target.position.set(x, y, 0);
    ground.position.set(x, y, 0.001);
}};
for (const box of document.querySelectorAll("input[data-part]")) {{
    const show = () => {{
        for (const group of {groups}) viewer.set_property([...group, box.dataset.part], "visible", box.checked);
        viewer.set_dirty();
    }};
    box.onchange = show;
    show();
}}
setInterval(() => {{ if (animator.playing) {{slider.value = now(); tell();}} }}, 50);
const path = [{path}], follow = document.getElementById("follow");  // of the robot, at even times
let seen = path[0];
const place = () => {{
    const k = {span} > 0 ? Math.min(now() / {span}, 1) * (path.length - 1) : 0;
    const i = Math.min(Math.floor(k), path.length - 1);
    const next = path[Math.min(i + 1, path.length - 1)];
    return path[i].map((x, axis) => x + (k - i) * (next[axis] - x));
}};
const track = () => {{
    const at = place();
    shadow(at);
    if (follow.checked) {{
        ["x", "y", "z"].forEach((axis, n) => {{
            viewer.camera.position[axis] += at[n] - seen[n];
            viewer.controls.target[axis] += at[n] - seen[n];
        }});
        if (at.some((x, n) => x !== seen[n])) {{viewer.controls.update(); viewer.set_dirty();}}
    }}
    seen = at;
    requestAnimationFrame(track);
}};
track();
</script></body></html>
"""


def spacing(motions: Sequence[Motion]) -> float:
    """Distance between motions side by side: room for the widest and its way to the side [m]."""
    return max(float((m.bounds[1] - m.bounds[0])[1] + np.ptp(m.position[..., 1])) for m in motions) + _ROOM


def _path(m: Motion) -> tuple[Floats, float]:
    """The middle of the moving parts at even times (n, 3), and their radius [m].

    The camera does not move in a direction in which the parts stay within a radius.
    """
    low, high = m.bounds
    radius = m.radius
    middle = m.position.mean(axis=1) - m.position[0].mean(axis=0) + 0.5 * (low + high)
    times = np.linspace(0.0, m.time[-1], min(_POINTS, len(m.time)))
    path = np.stack([np.interp(times, m.time, middle[:, k]) for k in range(3)], axis=1)
    span = np.ptp(path, axis=0)
    still = span < radius
    path[:, still] = 0.5 * (path[:, still].min(axis=0) + path[:, still].max(axis=0))
    return path, radius


def has_level_ground(m: Motion) -> bool:
    """Whether contacts touch level ground at height zero."""
    return any(
        c.terrain is None and c.height == 0.0 and np.allclose(np.asarray(c.normal), (0.0, 0.0, 1.0), atol=1e-9)
        for c in m.mechanism.contacts
    )


def _ghosts(m: Motion, group: tuple[str, ...]) -> list[Any]:
    """Of every body, its path in MeshCat's scene and its pose at the goal: place, and quaternion (x, y, z, w)."""
    if m.goal is None:
        return []
    nodes = [[*group, "bodies", label(str(k), name)] for k, name in enumerate(m.mechanism.body_names)]
    poses = np.round(np.concatenate([m.goal[:, :3], np.roll(m.goal[:, 3:], -1, axis=1)], axis=1), 5)
    return [[node, pose] for node, pose in zip(nodes, poses.tolist(), strict=True)]


def label(before: str, name: str) -> str:
    """The MeshCat name of a part named by the user: in its paths a slash separates, and in its table of parts
    JavaScript has words of its own, such as "constructor", which the number before keeps apart.
    """
    return escape(f"{before} {name.replace('/', '|')}")


def group_of(number: int) -> tuple[str, ...]:
    """Where in MeshCat's scene a motion is."""
    return ("meshcat",) if number == 0 else ("meshcat", f"motion{number}")


def _encoded(commands: list[Any]) -> list[Any]:
    """Commands as MeshCat reads them, in base64. An object that was drawn before is the pair of the places in the scene
    of that one and of its copy: feet of the same mesh, and the robots of motions side by side, are in the file once.
    """
    from umsgpack import packb

    out: list[Any] = []
    drawn: dict[bytes, list[str]] = {}
    for command in commands:
        data = command.lower()
        packed = packb(data)
        if data["type"] == "set_object":
            place = [part for part in data["path"].split("/") if part]
            before = drawn.setdefault(_content(data["object"]), place)
            if before is not place:
                out.append([before, place])
                continue
        out.append(base64.b64encode(packed).decode())
    return out


def _content(drawn: dict[str, Any]) -> bytes:
    """An object without the identifiers that MeshCat draws at random."""
    from umsgpack import packb

    packed = packb(drawn)
    parts = [*drawn.get("geometries", ()), *drawn.get("materials", ()), drawn["object"]]
    for k, uuid in enumerate(dict.fromkeys(part["uuid"] for part in parts)):
        packed = packed.replace(uuid.encode(), b"%0*d" % (len(uuid), k))
    return bytes(packed)


def _tints(motions: Sequence[Motion], together: bool) -> list[Any]:
    """Of every motion of a robot that is drawn before, its bodies in MeshCat's scene, its colour, and its opacity."""
    robots = [(m.mechanism.name, m.mechanism.body_names) for m in motions]
    return [
        [[*group_of(k), "bodies"], color_of(k), _THROUGH if together else 1.0]
        for k, robot in enumerate(robots)
        if robot in robots[:k]
    ]


def color_of(number: int) -> str:
    """The tint of a motion, from the second on."""
    return _TINTS[(number - 1) % len(_TINTS)]


def _legend(names: Sequence[str], tinted: list[Any]) -> str:
    """The names of motions in the bar, with their tints."""
    colors = {tuple(path): color for path, color, _ in tinted}
    paint = [colors.get((*group_of(k), "bodies"), _PLAIN) for k in range(len(names))]
    return "".join(
        f'\n<span class="name"><b style="color: {color}">&#9632;</b> {escape(name)}</span>'
        for color, name in zip(paint, names, strict=True)
    )


def page(
    motions: Sequence[Motion],
    commands: list[Any],
    shown: Mapping[str, bool],
    names: Sequence[str] = (),
    away: float = 0.0,
) -> str:
    """The page that shows the commands, with the camera beside the motions.

    Args:
        motions: the motions, side by side.
        commands: MeshCat's commands that draw and move them.
        shown: whether "forces", "paths" and the "ghost" of the goal are shown at the beginning.
        names: names of the motions (default none).
        away: distance between the motions [m].

    Returns:
        The text of an HTML file.
    """
    encoded = ",".join(json.dumps(c).replace("<", "\\u003c") for c in _encoded(commands))
    viewer = files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8")
    m, wide = motions[0], 0.5 * (len(motions) - 1) * away
    path, radius = _path(m)
    path[:, 1] -= wide
    side = _FRONT if wide else _SIDE
    eye = path[0] + _AWAY * (radius + _CLOSER * wide) * side / np.linalg.norm(side)
    # the axes of MeshCat's camera: y is up
    places = {name: f"{x:.3f}, {z:.3f}, {-y:.3f}" for name, (x, y, z) in (("eye", eye), ("target", path[0]))}
    places["path"] = ",".join(f"[{x:.3f},{z:.3f},{-y:.3f}]" for x, y, z in path)
    places |= {name: ", ".join(map(str, rgb)) for name, rgb in (("sky", _SKY), ("horizon", _HORIZON))}
    duration = max(float(each.time[-1]) for each in motions)
    groups = [group_of(k) for k in range(len(motions))]
    ghosts = [ghost for each, group in zip(motions, groups, strict=True) for ghost in _ghosts(each, group)]
    there = {"forces": any(len(each.contact_time) and each.force.size for each in motions), "ghost": bool(ghosts)}
    there["paths"] = len(m.time) > 1
    tints = _tints(motions, away == 0.0)
    boxes = "".join(
        f'\n<label><input data-part="{part}" type="checkbox"{" checked" * bool(shown.get(part))}> {word}</label>'
        for part, word in _BOXES.items()
        if there[part]
    )
    return _PAGE.format(
        title=escape(m.mechanism.name),
        viewer=viewer,
        commands=encoded,
        duration=duration,
        length=f"{duration:.2f}" if duration >= 1.0 else f"{duration:.3g}",
        span=float(m.time[-1]),  # of the path
        knot=f"{m.time[1] - m.time[0] if len(m.time) > 1 else 1.0:.6g}",
        boxes=boxes,
        ghosts=json.dumps(ghosts),
        tints=json.dumps(tints),
        tint=_TINT,
        shade=_SHADE,
        reach=f"{_SHADED * radius + wide:.3f}",
        level=json.dumps(has_level_ground(m)),
        legend=_legend(names, tints),
        groups=json.dumps(groups),
        **places,
    )
