"""The server of the live page: one address with a secret, frames to every browser, keys back.

Needs the extra `web`. It runs in a thread of its own. The stream hands frames over and never waits:
a browser that does not keep up is dropped, and its page connects again by itself.
"""

import asyncio
import json
import secrets
import socket
import threading
from collections import deque
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.web import Application, HTTPError, RequestHandler, StaticFileHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from rig.errors import UsageError
from rig.live.keys import MARK, RECORD, STOP, TARE

ACTIONS = {"tare": TARE, "mark": MARK, "record": RECORD, "stop": STOP}
"""What a page may ask for, and the key that does the same."""

HERE = Path(__file__).parent
ASSETS = HERE.parent / "output" / "assets"

HISTORY = 300
"""Frames whose traces a page gets when it connects: 30 s."""

MOST_UNSENT = 50
"""Messages on the way to one browser, at most: 5 s of a display that stalls."""


class PageServer:
    """Serves the page and what it shows on an address of this computer; port 0 is any free one.

    Raises:
        UsageError: The address cannot be listened on.
    """

    def __init__(self, host: str, port: int) -> None:
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            self._socket = socket.create_server((host, port), family=family)
        except OSError as error:
            raise UsageError(
                f"{host}:{port} cannot be listened on.",
                str(error),
                "Close the other program, or name an address of this computer with --host "
                "and another port with --web-port.",
            ) from error
        self._token = secrets.token_urlsafe(16)
        shown = socket.gethostname() if host in ("0.0.0.0", "::", "") else host  # noqa: S104
        shown = f"[{shown}]" if ":" in shown else shown
        self.url = f"http://{shown}:{self._socket.getsockname()[1]}/?token={self._token}"
        self._keys: deque[str] = deque()
        self._waiting: deque[dict[str, Any]] = deque(maxlen=HISTORY)
        self._history: deque[Any] = deque(maxlen=HISTORY)
        self._viewers: set[Viewer] = set()
        self._is_scheduled = False
        self._started: Future[asyncio.AbstractEventLoop] = Future()
        self._ended = asyncio.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True)

    @property
    def viewers(self) -> int:
        """Number of pages that are open and keep up."""
        return len(self._viewers)

    def start(self) -> None:
        """Answer browsers from now on; those that came earlier have waited."""
        if not self._started.done():
            self._thread.start()
            self._started.result()

    def pressed(self) -> str:
        """Return the keys that pages have pressed since the last call."""
        return "".join(self._keys.popleft() for _ in range(len(self._keys)))

    def send(self, frame: dict[str, Any]) -> None:
        """Hand a frame over without waiting; `traces` in it are kept for pages that come later."""
        self._waiting.append(frame)
        if not self._is_scheduled:
            self._is_scheduled = True
            self._started.result().call_soon_threadsafe(self._deliver)

    def close(self) -> None:
        """Tell the pages that the session has ended, and stop listening."""
        if self._thread.is_alive():
            self._started.result().call_soon_threadsafe(self._ended.set)
            self._thread.join(timeout=2.0)
        self._socket.close()

    async def _serve(self) -> None:
        routes: list[Any] = [
            (r"/", Page, {"token": self._token, "server": self}),
            (r"/stream", Viewer, {"token": self._token, "server": self}),
            # nothing in these is secret
            (r"/(live\.js)", StaticFileHandler, {"path": HERE}),
            (r"/(plotly-basic\.min\.js)", StaticFileHandler, {"path": ASSETS}),
        ]
        server = HTTPServer(Application(routes))
        self._socket.setblocking(False)
        server.add_socket(self._socket)
        self._started.set_result(asyncio.get_running_loop())
        await self._ended.wait()
        server.stop()
        self._deliver()
        for viewer in list(self._viewers):
            viewer.offer({"ended": True})
            viewer.close(1001, "the session has ended")
        await asyncio.sleep(0)
        await server.close_all_connections()

    def _deliver(self) -> None:
        self._is_scheduled = False
        frames = [self._waiting.popleft() for _ in range(len(self._waiting))]
        if not frames:
            return
        traces = [frame.pop("traces") for frame in frames]
        self._history.extend(traces)
        for viewer in list(self._viewers):
            viewer.offer({"frame": frames[-1], "traces": traces})

    def joined(self, viewer: "Viewer") -> None:
        """Send frames to one more page, those of the last 30 s first."""
        self._viewers.add(viewer)
        viewer.offer({"traces": list(self._history)})

    def left(self, viewer: "Viewer") -> None:
        """Send no more frames to a page."""
        self._viewers.discard(viewer)

    def press(self, action: str) -> None:
        """Take an action that a page asks for; an unknown one does nothing."""
        if action in ACTIONS:
            self._keys.append(ACTIONS[action])


class Secret(RequestHandler):
    """An answer to whoever has the secret of the address only."""

    def initialize(self, token: str, server: PageServer) -> None:
        """Take the secret and the server."""
        self.token, self.server, self.unsent = token, server, 0

    def prepare(self) -> None:
        """Refuse an address without the secret."""
        given = self.get_query_argument("token", "").encode()
        if not secrets.compare_digest(given, self.token.encode()):
            raise HTTPError(403)


class Page(Secret):
    """The page itself."""

    def get(self) -> None:
        """Send the page."""
        self.set_header("Cache-Control", "no-store")
        self.set_header("Referrer-Policy", "no-referrer")
        self.write((HERE / "live.html").read_text())


class Viewer(Secret, WebSocketHandler):
    """One open page."""

    def open(self, *_args: str, **_named: str) -> None:
        """Begin to send."""
        self.server.joined(self)

    def on_message(self, message: str | bytes) -> None:
        """Take what was pressed."""
        self.server.press(str(message))

    def on_close(self) -> None:
        """Send no more."""
        self.server.left(self)

    def offer(self, message: dict[str, Any]) -> None:
        """Send a message, or drop a page that does not keep up."""
        if self.unsent >= MOST_UNSENT:
            self.server.left(self)
            self.close(1013, "too slow")
            return
        try:
            sending = self.write_message(json.dumps(message))
        except WebSocketClosedError:
            self.server.left(self)
            return
        self.unsent += 1
        sending.add_done_callback(self._sent)

    def _sent(self, sending: "asyncio.Future[None]") -> None:
        self.unsent -= 1
        if not sending.cancelled() and sending.exception() is not None:
            self.server.left(self)
