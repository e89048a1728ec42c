"""Videos and pictures of a motion: the page of `save_html`, drawn by a browser without a window."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dojo_opt.viewer.animation import html_of
from dojo_opt.viewer.motion import Motion, motion
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.memory_limit import check_room
from sim.simulator.simulator import Simulator

Pixels = NDArray[np.uint8]

__all__ = ["save_picture", "save_video"]

# Chromium draws WebGL on the processor where there is no graphics card
_ARGUMENTS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_DRAWN = "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))"
_LARGEST = 16384  # pixels along an edge
_COLORS = 128  # of a GIF
_SHORTEST = 2  # delay of a picture of a GIF [s/100]


def save_video(
    result: Any,
    path: str | Path,
    *,
    simulator: Simulator | None = None,
    size: tuple[int, int] = (640, 360),
    rate: float = 25.0,
    speed: float = 1.0,
) -> Path:
    """Write a motion as a video, .mp4 or .gif.

    The page of `save_html` is drawn frame by frame by a Chromium without a window. Needs `pip install
    "dojo-opt[video]"`, and a Chromium (`playwright install chromium`, or the system's). Without a graphics
    card that takes much longer than the motion; a smaller size and rate take less.

    Args:
        result: Trajectory, Plan or ClosedLoop.
        path: path of the file, which ends in .mp4 or .gif.
        simulator: simulator of the result, for one that was read from a file (default None: that of the result).
        size: (width, height) in pixels, even numbers for .mp4.
        rate: frames per second of the video.
        speed: time of the motion over that of the video; 0.5 is slow motion.

    Returns:
        The path.

    Raises:
        ImportError: playwright or imageio is not installed.
        RuntimeError: there is no browser.
        TypeError: the result is none of these.
        ValueError: another kind of file, a motion without a duration, or an argument out of range.
        OSError: the file cannot be written.
    """
    target = checks.path("save_video(path)", path)
    checks.one_of("save_video(path): ending", target.suffix, (".mp4", ".gif"))
    checks.number("save_video(rate=...)", rate, above=0.0)
    checks.number("save_video(speed=...)", speed, above=0.0)
    width, height = _sizes("save_video(size=...)", size)
    if target.suffix == ".mp4" and (width % 2 or height % 2):
        raise ValueError(f"save_video(size=...): expected even numbers for .mp4, got {size!r}")
    m = motion(result, simulator)
    if not m.time[-1] > 0.0:
        raise ValueError("save_video(result): the motion has no duration; use save_picture")
    count = float(m.time[-1]) * rate / speed
    check_room("save_video(rate=..., speed=...)", int(min(count, 1e300)), 3.0 * width * height, noun="pictures")
    times = np.arange(0.0, m.time[-1] + 0.5 * speed / rate, speed / rate)
    write = _write_gif if target.suffix == ".gif" else _write_mp4

    def record() -> None:
        write(_frames(m, times.clip(max=m.time[-1]), (width, height)), target, rate)

    _apart(record)
    return target


def save_picture(
    result: Any,
    path: str | Path,
    *,
    simulator: Simulator | None = None,
    size: tuple[int, int] = (640, 360),
    time: float = 0.0,
) -> Path:
    """Write a picture of a motion, or of a mechanism at rest, as a .png.

    It is drawn as in `save_video`, with the goal of a plan, but of one that was loaded, which has no problem.

    Args:
        result: Trajectory, Plan or ClosedLoop; or a Mechanism, which stands in its neutral state.
        path: path of the file, which ends in .png.
        simulator: simulator of the result, for one that was read from a file (default None: that of the result).
        size: (width, height) in pixels.
        time: time of the motion [s].

    Returns:
        The path.

    Raises:
        ImportError: playwright is not installed.
        RuntimeError: there is no browser.
        TypeError: the result is none of these.
        ValueError: another kind of file, or an argument out of range.
        OSError: the file cannot be written.
    """
    from matplotlib.image import imsave

    target = checks.path("save_picture(path)", path)
    checks.one_of("save_picture(path): ending", target.suffix, (".png",))
    m = motion(result, simulator)
    if checks.number("save_picture(time=...)", time, at_least=0.0) > float(m.time[-1]) * (1.0 + 1e-9):
        raise ValueError(
            f"save_picture(time=...): expected up to {m.time[-1]:g} s, the end of the motion, got {time:g}"
        )
    pixels = _sizes("save_picture(size=...)", size)

    def record() -> None:
        for frame in _frames(m, np.array([min(time, float(m.time[-1]))]), pixels):
            imsave(target, frame)

    _apart(record)
    return target


def _apart(record: Callable[[], None]) -> None:
    """Call in a separate thread: playwright refuses a thread with an event loop, such as that of a notebook."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(record).result()


def _sizes(call: str, given: Any) -> tuple[int, int]:
    """Width and height in pixels."""
    if not hasattr(given, "__len__") or len(given) != 2:
        raise ValueError(f"{call}: expected (width, height), got {given!r}")
    width, height = whole_number(call, given[0]), whole_number(call, given[1])
    if max(width, height) > _LARGEST:
        raise ValueError(f"{call}: expected at most {_LARGEST} pixels, as browsers draw, got {given!r}")
    return width, height


def _frames(m: Motion, times: Any, size: tuple[int, int]) -> Iterator[Pixels]:
    """Pictures (height, width, 3) of a motion at times [s]."""
    from matplotlib.image import imread

    moving = m.time[-1] > 0.0
    with tempfile.TemporaryDirectory() as folder, _browser() as browser:
        file = Path(folder) / "motion.html"
        file.write_text(html_of(m, moving=moving, shown={"ghost": True}), encoding="utf-8")
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.goto(file.as_uri())  # the whole scene is on the page then: it is in the file, and read in one go
        if moving:
            page.evaluate("animator.pause()")
        page.add_style_tag(content="#bar {display: none !important}")
        for time in times:
            if moving:
                page.evaluate(f"animator.seek({time})")
            page.evaluate(_DRAWN)
            picture = imread(BytesIO(page.screenshot()))
            yield np.asarray(np.round(255.0 * picture[..., :3]), dtype=np.uint8)


@contextmanager
def _browser() -> Iterator[Any]:
    """A Chromium without a window: the system's, or playwright's own."""
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        raise ImportError('a video needs a browser: pip install "dojo-opt[video]"') from None
    path = next((found for found in map(shutil.which, _BROWSERS) if found), None)
    with sync_playwright() as session:
        try:
            browser = session.chromium.launch(executable_path=path, args=_ARGUMENTS)
        except Error as error:
            if path is not None:
                raise
            raise RuntimeError(
                f"found no browser: none of {', '.join(_BROWSERS)} is on the PATH, and Playwright has none of its own; "
                "run: playwright install chromium"
            ) from error
        try:
            yield browser
        finally:
            browser.close()


def _write_gif(frames: Iterator[Pixels], path: Path, rate: float) -> None:
    """A GIF that goes round, every picture in the colours of the first one."""
    from PIL import Image

    pictures = [Image.fromarray(frame) for frame in frames]
    first = pictures[0].quantize(_COLORS, dither=Image.Dither.NONE)
    shown, delays = _in_hundredths(len(pictures), rate)
    rest = [pictures[k].quantize(palette=first, dither=Image.Dither.NONE) for k in shown[1:]]
    first.save(path, save_all=True, append_images=rest, duration=[10 * delay for delay in delays], loop=0)


def _in_hundredths(count: int, rate: float) -> tuple[list[int], list[int]]:
    """The pictures of a GIF, and the time that each is shown, which is a whole number of hundredths of a second.

    Pictures that would be shown for less than two, for which browsers show them for ten, are omitted.
    """
    shown, begins, end = [0], [0], max(round(100.0 * count / rate), _SHORTEST)
    for k in range(1, count):
        begin = round(100.0 * k / rate)
        if begin - begins[-1] >= _SHORTEST and end - begin >= _SHORTEST:
            shown.append(k)
            begins.append(begin)
    return shown, np.diff([*begins, end]).tolist()


def _write_mp4(frames: Iterator[Pixels], path: Path, rate: float) -> None:
    """An H.264 video that every browser plays."""
    try:
        import imageio
    except ImportError:
        raise ImportError('an .mp4 needs imageio: pip install "dojo-opt[video]"') from None
    with imageio.get_writer(path, fps=rate, macro_block_size=2) as writer:
        for frame in frames:
            writer.append_data(frame)
