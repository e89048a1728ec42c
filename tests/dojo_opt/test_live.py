"""Motions in notebooks, and a robot in the browser while a loop runs."""

import asyncio
import html
import re
import socket
import time
import urllib.request

import numpy as np
import pytest
import umsgpack

import dojo_opt as dojo


@pytest.fixture(scope="module")
def sim():
    return dojo.Simulator(dojo.models.pendulum(), time_step=0.02)


def test_a_notebook_shows_motions(sim):
    motion = sim.rollout(np.array([1.0, 0.0]), steps=5)
    shown = motion._repr_html_()
    page = html.unescape(re.search(r'srcdoc="([^"]*)"', shown).group(1))
    assert page.startswith("<!DOCTYPE html>") and page.count("new MeshCat.Viewer") == 1 and "pendulum" in page
    assert "http://" not in shown.split("srcdoc")[0]
    loop = dojo.closed_loop(lambda time, x: np.zeros(sim.nu), dojo.Plant(sim), 0.1)
    assert "new MeshCat.Viewer" in html.unescape(loop._repr_html_())
    for thing, name in ((sim.mechanism, "Mechanism"), (sim, "Simulator")):
        standing = thing._repr_html_()
        assert "new MeshCat.Viewer" in html.unescape(standing) and f"<p>{name}(pendulum" in standing
    plan = dojo.ilqr(dojo.problems.swingup("pendulum"), max_iterations=2)
    assert "srcdoc" in plan._repr_html_() and "<table>" in plan._repr_html_()
    plan.problem = plan.simulator = None
    assert "srcdoc" not in plan._repr_html_() and "<table>" in plan._repr_html_()


def test_a_page_hears_the_states_of_a_loop(sim):
    from tornado.websocket import websocket_connect

    async def heard(url, count):
        line = await websocket_connect(url.replace("http", "ws") + "motion")
        found = [umsgpack.unpackb(await asyncio.wait_for(line.read_message(), 5.0)) for _ in range(count)]
        line.close()
        while await line.read_message() is not None:
            pass
        return found

    with dojo.viewer.live(sim, rate=1e6) as view:
        assert view.url.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(view.url) as page:
            assert b"viewer.connect(`ws://${location.host}/motion`)" in page.read()
        watched = view.watch(lambda time, x: np.zeros(sim.nu))
        np.testing.assert_array_equal(watched(0.0, np.array([1.2, 0.0])), np.zeros(sim.nu))
        (command,) = asyncio.run(heard(view.url, 1))
        assert command["type"] == "set_transform" and command["path"].startswith("/meshcat/bodies/0")
        expected = sim.maximal(np.array([1.2, 0.0]))[0, :3]
        np.testing.assert_allclose(command["matrix"][12:15], expected, atol=1e-6)
        slow = dojo.viewer.live(sim, rate=20.0)
        for angle in (0.5, 1.2):  # both within the time of the first picture
            slow.show(np.array([angle, 0.0]))
        time.sleep(0.1)
        (command,) = asyncio.run(heard(slow.url, 1))
        np.testing.assert_allclose(command["matrix"][12:15], expected, atol=1e-6)
        slow.close()
        port = int(view.url.rsplit(":", 1)[1].strip("/"))
        with pytest.raises(OSError, match="did not start"):
            dojo.viewer.live(sim, port=port)
        with pytest.raises(ValueError, match="shape"):
            view.show(np.zeros(5))
    with pytest.raises(ValueError, match="closed"):
        view.show(np.zeros(2))
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
