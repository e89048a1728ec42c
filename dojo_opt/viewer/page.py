"""The page around an animation: MeshCat's viewer, its commands, and a bar with a clock."""

from __future__ import annotations

import base64
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from dojo_opt.viewer import drawing
from dojo_opt.viewer.motion import Array, Motion
from sim.mechanism.shapes import rotation_matrix

__all__ = ["page"]

_SIDE = np.array([0.6, -1.0, 0.35])  # from where the camera looks
_AWAY = 2.6  # its distance over the radius of the robot: with MeshCat's 75 degrees a third of the picture
_POINTS = 200  # of the path that the camera follows
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
#time {{flex: 1}} #bar > * {{white-space: nowrap}}
#bar button {{width: 64px}} #clock {{width: 110px; font-variant-numeric: tabular-nums}}
</style></head>
<body><div id="meshcat-pane"></div>
<div id="bar"><b>{title}</b><button id="play">pause</button><input id="time" type="range" min="0" max="{duration}"
step="0.001" value="0"><span id="clock"></span><label><input id="follow" type="checkbox" checked> follow</label>
<span>drag to turn, scroll to zoom</span></div>
<script>{viewer}</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const text of [{commands}])
    viewer.handle_command_bytearray(Uint8Array.from(atob(text), c => c.charCodeAt(0)));
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
const tell = () => {{document.getElementById("clock").textContent = now().toFixed(2) + " of {duration} s"}};
button.onclick = () => {{
    animator.playing ? animator.pause() : animator.play();
    button.textContent = animator.playing ? "pause" : "play";
}};
slider.oninput = () => {{
    animator.pause();
    button.textContent = "play";
    animator.seek(Number(slider.value));
    tell();
}};
setInterval(() => {{ if (animator.playing) {{slider.value = now(); tell();}} }}, 50);
const path = [{path}], follow = document.getElementById("follow");  // of the robot, at even times
let seen = path[0];
const place = () => {{
    const k = {duration} > 0 ? now() / {duration} * (path.length - 1) : 0, i = Math.min(Math.floor(k), path.length - 1);
    const next = path[Math.min(i + 1, path.length - 1)];
    return path[i].map((x, axis) => x + (k - i) * (next[axis] - x));
}};
const track = () => {{
    const at = place();
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


def _path(m: Motion) -> tuple[Array, float]:
    """The middle of the moving parts at even times (n, 3), and their radius [m].

    The camera does not move in a direction in which the parts stay within a radius.
    """
    turn = [rotation_matrix(q) for q in m.quaternion[0]]
    points = np.concatenate(
        [drawing.extent(m.pieces[name]) @ turn[k].T + m.position[0, k] for k, name in enumerate(m.mechanism.body_names)]
    )
    low, high = points.min(axis=0), points.max(axis=0)
    radius = max(0.1, 0.5 * float((high - low).max()))
    middle = m.position.mean(axis=1) - m.position[0].mean(axis=0) + 0.5 * (low + high)
    times = np.linspace(0.0, m.time[-1], min(_POINTS, len(m.time)))
    path = np.stack([np.interp(times, m.time, middle[:, k]) for k in range(3)], axis=1)
    span = np.ptp(path, axis=0)
    still = span < radius
    path[:, still] = 0.5 * (path[:, still].min(axis=0) + path[:, still].max(axis=0))
    return path, radius


def page(m: Motion, commands: list[Any]) -> str:
    """The page that shows the commands, with the camera beside the motion."""
    from umsgpack import packb

    encoded = ",".join(f'"{base64.b64encode(packb(c.lower())).decode()}"' for c in commands)
    viewer = files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8")
    path, radius = _path(m)
    eye = path[0] + _AWAY * radius * _SIDE / np.linalg.norm(_SIDE)
    # the axes of MeshCat's camera: y is up
    places = {name: f"{x:.3f}, {z:.3f}, {-y:.3f}" for name, (x, y, z) in (("eye", eye), ("target", path[0]))}
    places["path"] = ",".join(f"[{x:.3f},{z:.3f},{-y:.3f}]" for x, y, z in path)
    places |= {name: ", ".join(map(str, rgb)) for name, rgb in (("sky", _SKY), ("horizon", _HORIZON))}
    duration = f"{m.time[-1]:.3g}"
    return _PAGE.format(title=escape(m.mechanism.name), viewer=viewer, commands=encoded, duration=duration, **places)
