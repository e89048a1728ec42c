"""The page around an animation: MeshCat's viewer, its commands, and a bar with a clock."""

from __future__ import annotations

import base64
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from dojo_opt.viewer.motion import Motion

__all__ = ["page"]

_SKY, _HORIZON = (1.0, 1.0, 1.0), (0.84, 0.88, 0.93)

_PAGE = """<!DOCTYPE html>
<html>
<head><meta charset="utf-8"><title>{title}</title>
<style>
body {{margin: 0; font: 14px system-ui, sans-serif; color: #223}}
#meshcat-pane {{width: 100vw; height: 100vh; overflow: hidden}}
#bar {{position: absolute; left: 0; right: 0; bottom: 0; display: flex; gap: 12px; align-items: center;
      padding: 8px 16px; background: rgba(255, 255, 255, 0.8)}}
#bar input {{flex: 1}} #bar button {{width: 64px}} #clock {{width: 110px; font-variant-numeric: tabular-nums}}
</style></head>
<body><div id="meshcat-pane"></div>
<div id="bar"><b>{title}</b><button id="play">pause</button><input id="time" type="range" min="0" max="{duration}"
step="0.001" value="0"><span id="clock"></span><span>drag to turn, scroll to zoom</span></div>
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
</script></body></html>
"""


def page(m: Motion, commands: list[Any]) -> str:
    """The page that shows the commands, with the camera beside the motion."""
    from umsgpack import packb

    encoded = ",".join(f'"{base64.b64encode(packb(c.lower())).decode()}"' for c in commands)
    viewer = files("meshcat").joinpath("viewer/dist/main.min.js").read_text(encoding="utf-8")
    low, high = m.position.min(axis=(0, 1)), m.position.max(axis=(0, 1))
    target = 0.5 * (low + high)
    eye = target + max(1.0, float(np.linalg.norm(high - low))) * np.array([0.5, -1.0, 0.4])
    # the axes of MeshCat's camera: y is up
    places = {name: f"{x:.3f}, {z:.3f}, {-y:.3f}" for name, (x, y, z) in (("eye", eye), ("target", target))}
    places |= {name: ", ".join(map(str, rgb)) for name, rgb in (("sky", _SKY), ("horizon", _HORIZON))}
    duration = f"{m.time[-1]:.3g}"
    return _PAGE.format(title=escape(m.mechanism.name), viewer=viewer, commands=encoded, duration=duration, **places)
