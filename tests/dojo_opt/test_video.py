"""Videos and pictures: files that other programs read, on which the robot moves."""

import shutil

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.viewer.video import _in_hundredths

pytestmark = [  # a browser process that is closed leaves sockets to the garbage collector
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(scope="module")
def fall():
    """A cube falls by half a metre in .3 s."""
    sim = dojo.Simulator(dojo.models.block(), time_step=0.02)
    x = sim.neutral()
    x[2] += 1.0
    return sim.rollout(x, np.zeros((15, sim.nu)))


@pytest.mark.slow
def test_a_robot_moves_in_a_video(fall, tmp_path):
    image = pytest.importorskip("PIL.Image")
    pytest.importorskip("playwright.sync_api")
    if not any(map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))):
        pytest.skip("no Chromium")
    pictures = []
    with image.open(dojo.viewer.save_video(fall, tmp_path / "fall.gif", size=(160, 120), rate=10.0)) as video:
        assert video.n_frames == 4 and video.size == (160, 120)
        for k in range(video.n_frames):
            video.seek(k)
            pictures.append(np.asarray(video.convert("RGB"), dtype=float))
    moved = np.abs(pictures[-1] - pictures[0]).max(axis=2) > 30.0
    assert moved.sum() > 50  # the cube covers hundreds of pixels
    with image.open(
        dojo.viewer.save_picture(fall.simulator.mechanism, tmp_path / "cube.png", size=(160, 120))
    ) as still:
        assert still.size == (160, 120) and np.ptp(np.asarray(still.convert("L")).astype(float)) > 60.0
    pytest.importorskip("imageio_ffmpeg")
    film = dojo.viewer.save_video(fall, tmp_path / "fall.mp4", size=(160, 120), rate=10.0)
    assert b"ftyp" in film.read_bytes()[:12]


def test_a_gif_lasts_as_long_as_its_motion():
    for rate in (7.0, 10.0, 15.0, 30.0, 60.0, 200.0):
        shown, delays = _in_hundredths(round(2 * rate), rate)
        assert sum(delays) == 200 and min(delays) >= 2 and len(shown) == len(delays), rate


def test_other_formats_and_odd_sizes_are_refused(fall, tmp_path):
    with pytest.raises(ValueError, match="avi"):
        dojo.viewer.save_video(fall, tmp_path / "fall.avi")
    with pytest.raises(ValueError, match="even numbers"):
        dojo.viewer.save_video(fall, tmp_path / "fall.mp4", size=(161, 120))
    with pytest.raises(ValueError, match="no duration"):
        dojo.viewer.save_video(fall.simulator.mechanism, tmp_path / "fall.gif")
    with pytest.raises(ValueError, match="width"):
        dojo.viewer.save_picture(fall, tmp_path / "fall.png", size=(1, 2, 3))


def test_a_missing_browser_is_named(fall, tmp_path, monkeypatch):
    pytest.importorskip("playwright")
    monkeypatch.setattr("dojo_opt.viewer.video._BROWSERS", ("no-such-browser",))
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path))
    with pytest.raises(RuntimeError, match="found no browser: .*no-such-browser.*playwright install chromium"):
        dojo.viewer.save_picture(fall, tmp_path / "fall.png")
