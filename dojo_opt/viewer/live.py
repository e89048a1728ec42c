"""Live: a robot in the browser while a loop runs. Its server listens on this computer only."""

from __future__ import annotations

import socket
import threading
import time as clock
import warnings
from collections.abc import Callable
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.viewer import drawing
from dojo_opt.viewer.animation import html_of, node_of
from dojo_opt.viewer.motion import motion
from sim.mechanism import checks
from sim.model.state_columns import BodyState
from sim.simulator.simulator import Simulator

if TYPE_CHECKING:
    import asyncio

__all__ = ["Live", "live"]

_HOST = "127.0.0.1"
_WAIT = 10.0  # [s] until a server has started, or stopped
_CONNECT = """viewer.connect(`ws://${location.host}/motion`);
document.getElementById("bar").style.display = "none";"""


class Live:
    """A page that shows a robot in given states; made by `dojo.viewer.live`.

    Args:
        sim: the simulator of the robot.
        port: port of the server, 0 for a free one.
        rate: largest number of pictures per second.

    Attributes:
        url: address of the page, on this computer.

    Raises:
        OSError: the port is taken.
    """

    def __init__(self, sim: Simulator, port: int, rate: float) -> None:
        self._sim, self._least = sim, 1.0 / rate
        still = html_of(motion(sim.mechanism), moving=False)
        self._page = still.replace("track();\n</script>", f"track();\n{_CONNECT}\n</script>")
        self._listeners: set[Any] = set()
        self._shown = -np.inf
        self._next: Any = None  # state that is to be shown
        self._lock = threading.Lock()  # of it
        self._last: list[bytes] = []
        self._started = threading.Event()
        self._failed: Exception | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self.url = ""
        self._thread = threading.Thread(target=self._serve, args=(port,), name="dojo-opt live", daemon=True)
        self._thread.start()
        if not self._started.wait(_WAIT) or self._failed is not None:
            raise OSError(f"viewer.live(port={port}): the server did not start: {self._failed}")
        self.show(sim.neutral())

    def __enter__(self) -> Live:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Live({self._sim.mechanism.name}, {self.url or 'closed'})"

    def _repr_html_(self) -> str:
        if not self.url:
            return f"<p>{escape(repr(self))}</p>"
        return f'<iframe src="{self.url}" style="width: 100%; height: 420px; border: 0"></iframe>'

    def show(self, x: ArrayLike) -> None:
        """Move the robot to a state. Of states that arrive faster than the screen shows them, the last one is shown.

        Args:
            x: (nx,) state.

        Raises:
            ValueError: the shape is wrong, or the page is closed.
        """
        if self._loop is None:
            raise ValueError("Live.show: the page is closed")
        state = checks.array("Live.show(x)", x, (self._sim.nx,))
        rest = self._shown + self._least - clock.perf_counter()
        with self._lock:
            waits, self._next = self._next is not None, state.copy()
        if rest > 0.0 and not waits:
            self._loop.call_soon_threadsafe(self._loop.call_later, rest, self._send_next)
        elif rest <= 0.0:
            self._loop.call_soon_threadsafe(self._send_next)

    def watch(self, controller: Callable[[float, Any], Any]) -> Callable[[float, Any], Any]:
        """A controller that shows every state that it is called with.

        Args:
            controller: function (time, x) of a closed loop, such as an MPC.

        Returns:
            The function, with the same results.

        Raises:
            TypeError: the controller is no function.
        """
        if not callable(controller):
            raise TypeError(f"Live.watch(controller): expected a function of time and state, got {controller!r}")

        def watched(time: float, x: Any) -> Any:
            self.show(x)
            return controller(time, x)

        return watched

    def close(self) -> None:
        """Stop the server."""
        loop, self._loop = self._loop, None
        if loop is not None:
            loop.call_soon_threadsafe(loop.stop)
            self._thread.join(_WAIT)
        self.url = ""

    def _moves(self, state: Any) -> list[bytes]:
        """Commands that put every body where it is."""
        from meshcat.commands import SetTransform
        from umsgpack import packb

        z = self._sim.maximal(state)
        names = self._sim.mechanism.body_names
        places = (
            (node_of("bodies", k, name), drawing.matrix(z[k, BodyState.POSITION], z[k, BodyState.QUATERNION]))
            for k, name in enumerate(names)
        )
        return [packb(SetTransform(place, node).lower()) for node, place in places]

    def _send_next(self) -> None:
        """Send the state that was given last to all open pages; runs in the thread of the server."""
        with self._lock:
            state, self._next = self._next, None
        if state is None:  # sent already
            return
        self._shown, self._last = clock.perf_counter(), self._moves(state)
        for listener in list(self._listeners):
            for command in self._last:
                listener.write_message(command, binary=True)

    def _serve(self, port: int) -> None:
        """The thread of the server."""
        import asyncio  # in this thread Ctrl-C does not end it half-way, after which it could not be imported again

        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of parts that MeshCat loads
            from tornado.httpserver import HTTPServer
            from tornado.web import Application, RequestHandler
            from tornado.websocket import WebSocketHandler
        live = self

        class Page(RequestHandler):
            def get(self) -> None:
                self.write(live._page)

        class Motions(WebSocketHandler):  # tornado refuses pages of other sites (`check_origin`)
            def open(self, *args: Any, **kwargs: Any) -> None:
                live._listeners.add(self)
                for command in live._last:
                    self.write_message(command, binary=True)

            def on_close(self) -> None:
                live._listeners.discard(self)

        loop = asyncio.new_event_loop()
        asyncio.set_event_loop(loop)
        try:
            listener = socket.create_server((_HOST, port))
            listener.setblocking(False)
            server = HTTPServer(Application([("/", Page), ("/motion", Motions)], log_function=lambda handler: None))
            server.add_sockets([listener])
            self.url = f"http://{_HOST}:{listener.getsockname()[1]}/"
            self._loop = loop
        except OSError as error:
            self._failed = error
            loop.close()
            return
        finally:
            self._started.set()
        loop.run_forever()
        server.stop()
        for page in list(self._listeners):
            page.close()
        loop.run_until_complete(server.close_all_connections())
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.close()


def live(sim: Simulator, *, port: int = 0, rate: float = 60.0, open_browser: bool = False) -> Live:
    """Show a robot in the browser while a loop runs.

        with dojo.viewer.live(sim) as view:
            print(view.url)
            dojo.closed_loop(view.watch(mpc), plant, 10.0)

    The server listens on 127.0.0.1: other computers cannot reach it.

    Args:
        sim: the simulator of the robot.
        port: port of the server (default 0: a free one).
        rate: largest number of pictures per second.
        open_browser: whether to open the page in the browser of this computer.

    Returns:
        Live; `show(x)` moves the robot, `watch(controller)` shows the states of a loop.

    Raises:
        TypeError: `sim` is not a Simulator.
        ValueError: for an argument out of range.
        OSError: the port is taken.
    """
    if not isinstance(sim, Simulator):
        raise TypeError(f"viewer.live(sim): expected a Simulator, got {sim!r}")
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port < 65536:
        raise ValueError(f"viewer.live(port=...): expected a whole number from 0 to 65535, got {port!r}")
    view = Live(sim, port, checks.number("viewer.live(rate=...)", rate, above=0.0))
    if open_browser:
        import webbrowser

        webbrowser.open(view.url)
    return view
