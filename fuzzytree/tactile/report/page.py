"""What is recognised, as a page for browsers of this computer and no other."""

from __future__ import annotations

import base64
import contextlib
import dataclasses
import re
import socket
import sys
import threading
import time
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import TYPE_CHECKING, Any

import msgspec

from fuzzytree.errors import PortError
from fuzzytree.files import reason
from fuzzytree.report import policy_of
from fuzzytree.tactile.recognition.live import STATES, Live, LiveView
from fuzzytree.tactile.report.live import (
    PALETTE,
    counts,
    headline,
    places,
    shades,
    status,
    timing,
)

if TYPE_CHECKING:
    from fuzzytree.tactile.sensor import Cells

ADDRESS = "127.0.0.1"
"""The page is for this computer only."""

MOST_BROWSERS = 8
"""How many connections are served at a time; others are turned away."""

_REFRESHES = 30  # a second, at most
_PATIENCE_S = 10.0  # for an idle browser
_ALIVE_S = 0.5  # between two events where no frames come
_RETRY = b"retry: 1000\n\n"  # milliseconds before a browser reconnects
_BACKLOG = 1 << 16  # bytes that wait for a slow browser: newer frames replace older
_MOST_POINTS = 1 << 16  # of a picture

_TARE = ("POST", "/tare")
_OTHERS = "connect-src 'self'; img-src data:; frame-ancestors 'none'; "
_EVENTS = re.compile(r"/events(?:\?times=([1-9]))?")

_HEADERS = {
    "Allow": "GET",
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class LivePage(ThreadingHTTPServer):
    """Serves the page of what is recognised, in threads, until it is closed.

    It listens on 127.0.0.1, answers only what names that host (a page of another name
    that leads here is refused), only its own paths, and no page of another place.

    Args:
        live: What is shown.
        port: The number of the port; 0 for one that is free.
        times: Points for a cell on each side of the picture.

    Attributes:
        url: Where the page is.
        hosts: The names of this host, with the port.
        content: The page.
        policy: What the page may do in a browser.
        is_closing: Set when the browsers hear that it is over.

    Raises:
        PortError: If the port cannot be had.
    """

    daemon_threads = True
    block_on_close = False
    request_queue_size = MOST_BROWSERS

    def __init__(self, live: Live, port: int = 0, *, times: int = 3) -> None:
        self.live, self.times = live, times
        self.is_closing = threading.Event()
        self._room = threading.BoundedSemaphore(MOST_BROWSERS)
        content = resources.files("fuzzytree.tactile.report").joinpath("live.html")
        self.content = content.read_bytes()
        self.policy = policy_of(self.content.decode(), _OTHERS)
        try:
            super().__init__((ADDRESS, port), _Handler)
        except (OSError, OverflowError) as error:
            why = reason(error) if isinstance(error, OSError) else str(error)
            raise PortError(f"{ADDRESS}:{port}: cannot be served: {why}") from error
        self.hosts = {f"{name}:{self.server_port}" for name in (ADDRESS, "localhost")}
        self.url = f"http://{ADDRESS}:{self.server_port}/"
        self._thread = threading.Thread(
            target=self.serve_forever, args=(0.05,), name="page", daemon=True
        )
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        """Close the page."""
        self.close()

    def close(self) -> None:
        """Let the browsers hear that it is over, for a second, and serve no more."""
        self.is_closing.set()
        end = time.monotonic() + 1.0
        for _ in range(MOST_BROWSERS):
            self._room.acquire(timeout=max(end - time.monotonic(), 0.0))
        self.shutdown()
        self.server_close()
        self._thread.join()

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Turn a browser away if there are too many."""
        is_free = self._room.acquire(blocking=False)
        if not is_free:
            with contextlib.suppress(OSError):
                request.sendall(b"HTTP/1.0 503 too many browsers\r\n\r\n")
        return is_free

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection, then make room for another."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Let a browser go away at any time."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    timeout = _PATIENCE_S
    server_version = "fuzzytree"
    sys_version = ""

    @property
    def page(self) -> LivePage:
        """The server of this connection."""
        assert isinstance(self.server, LivePage)
        return self.server

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the terminal shows a picture."""

    def parse_request(self) -> bool:
        """Refuse what is no GET, or is meant for another host."""
        if not super().parse_request():
            return False
        hosts = self.page.hosts
        origin = self.headers.get("Origin", "").lower().removeprefix("http://")
        if self.command != "GET" and (self.command, self.path) != _TARE:
            self._answer(HTTPStatus.METHOD_NOT_ALLOWED, b"only GET is answered\n")
        elif self.headers.get("Host", "").lower() not in hosts:
            self._answer(HTTPStatus.MISDIRECTED_REQUEST, b"this is another host\n")
        elif (origin or self.command == "POST") and origin not in hosts:
            # the page of another site
            self._answer(HTTPStatus.FORBIDDEN, b"only this page is answered\n")
        else:
            return True
        return False

    def do_GET(self) -> None:
        """Answer with the page, or with events."""
        if self.path == "/":
            self._answer(HTTPStatus.OK, self.page.content, "text/html")
        elif found := _EVENTS.fullmatch(self.path):
            self._answer(HTTPStatus.OK, _RETRY, "text/event-stream")
            self._send_events(int(found[1] or self.page.times))
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"there is / and nothing else\n")

    def do_POST(self) -> None:
        """Tare the sensor."""
        self.page.live.tare()
        self._answer(HTTPStatus.NO_CONTENT)

    def _answer(
        self, code: HTTPStatus, content: bytes = b"", kind: str = "text/plain"
    ) -> None:
        self.send_response(code)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Security-Policy", self.page.policy)
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def _send_events(self, times: int) -> None:
        """Send what there is to see, the newest only, until it is over."""
        live = self.page.live
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BACKLOG)
        view, seen = live.view(), 0
        names = {"source": view.source, "model": view.model}
        scale = {"full": view.sensor.range_text, "palette": PALETTE}
        self._send("hello", {**names, **scale, "classes": view.classes})
        while True:
            is_over = view.is_over or self.page.is_closing.is_set()
            view = dataclasses.replace(view, is_over=is_over)
            self._send("view", view_facts(view, times))
            if is_over:
                return
            time.sleep(1 / _REFRESHES)
            seen = live.wait(seen, _ALIVE_S)
            view = live.view()

    def _send(self, name: str, facts: object) -> None:
        data = msgspec.json.encode(facts)
        self.wfile.write(b"event: %s\ndata: %s\n\n" % (name.encode(), data))


def view_facts(view: LiveView, times: int) -> dict[str, object]:
    """Return what a page shows at one moment.

    The picture has at most `times` points for a cell on each side; `cells` has one.
    """
    answer = view.answer
    state = answer.state if answer else None
    first = answer.objects[0] if answer and answer.objects else None
    rows = (("took", timing(view)), ("counted", counts(view)))
    facts: dict[str, object] = {
        "state": "waiting" if state is None else STATES[state],
        "headline": headline(view),
        "places": "\n".join(places(answer)) if answer else "",
        "code": first.code if first else -1,
        "strengths": first.strengths if first else (),
        "facts": [row for row in rows if row[1]],
        "status": status(view),
        "over": view.is_over,
    }
    if answer is not None and answer.cells is not None:
        while times > 1 and answer.cells.size * times**2 > _MOST_POINTS:
            times -= 1
        facts |= _points(view, answer.cells, times)
        facts["times"] = times
        facts["cells"] = _points(view, answer.cells, 1)
        facts["objects"] = [
            {"name": one.label or "unknown", "x": one.x, "y": one.y, "box": one.box}
            for one in answer.objects
        ]
    return facts


def _points(view: LiveView, cells: Cells, times: int) -> dict[str, object]:
    points = shades(cells, view.sensor.full, times)
    packed = base64.b64encode(points.tobytes()).decode()
    return {"shape": points.shape, "points": packed}
