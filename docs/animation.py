"""The animation of README: a quadruped trots, drawn by the viewer in a browser.

python docs/animation.py              writes docs/trot.gif; needs `.[browser]` and a Chromium
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

import dojo_opt as dojo

OUT = Path(__file__).resolve().parent / "trot.gif"
SIZE = (540, 300)  # [pixels], of the middle of the window
WINDOW = (960, 540)
FRAMES = 40
COLORS = 48


def pictures(page: Path, duration: float) -> list[Image.Image]:
    """The motion of a page at even times."""
    found = []
    left, top = (WINDOW[0] - SIZE[0]) // 2, (WINDOW[1] - SIZE[1]) // 2
    clip = {"x": left, "y": top, "width": SIZE[0], "height": SIZE[1]}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--use-gl=swiftshader"]
        )
        sheet = browser.new_page(viewport={"width": WINDOW[0], "height": WINDOW[1]})
        sheet.goto(page.as_uri())
        sheet.add_style_tag(content="#bar {display: none !important}")
        sheet.evaluate("animator.pause()")
        for k in range(FRAMES):
            sheet.evaluate(f"animator.seek({duration * k / FRAMES})")
            sheet.wait_for_timeout(60)  # the camera follows, and the scene is drawn
            found.append(Image.open(io.BytesIO(sheet.screenshot(clip=clip))).convert("RGB"))
        browser.close()
    return found


def main() -> int:
    """Plan, draw, write."""
    sim = dojo.Simulator(dojo.models.quadruped(damper=0.5), time_step=0.025)
    plan = dojo.ilqr(dojo.problems.follow(dojo.gaits.trot(sim, speed=0.3), substeps=2))
    if not plan.success:
        print(plan.message)
        return 1
    duration = len(plan.u) * 2 * sim.time_step
    with tempfile.TemporaryDirectory() as folder:
        frames = pictures(dojo.viewer.save_html(plan, Path(folder) / "trot.html"), duration)
    frames = [frame.quantize(COLORS, dither=Image.Dither.NONE) for frame in frames]
    frames[0].save(OUT, save_all=True, append_images=frames[1:], duration=round(1e3 * duration / FRAMES), loop=0)
    print(f"wrote {OUT}, {OUT.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
