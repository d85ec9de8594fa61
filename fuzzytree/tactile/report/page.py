"""What is recognised, as a page for browsers of this computer and no other."""

from __future__ import annotations

import base64
import contextlib
import dataclasses
import hashlib
import re
import socket
import threading
import time
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import TYPE_CHECKING, Any

import msgspec

from fuzzytree.errors import PortError
from fuzzytree.files import reason
from fuzzytree.tactile.recognition.live import (
    SENTENCES,
    STATES,
    Live,
    LiveResult,
    LiveView,
)
from fuzzytree.tactile.recognition.recogniser import State
from fuzzytree.tactile.report.live import (
    PALETTE,
    headline,
    shades,
    status,
    whereabouts,
)

if TYPE_CHECKING:
    from socketserver import BaseServer

    from fuzzytree.tactile.sensor import Cells

ADDRESS = "127.0.0.1"
"""The page is for this computer only."""

MOST_BROWSERS = 8
"""How many connections are served at a time; others are turned away."""

_REFRESHES = 30  # a second, at most
_PATIENCE_S = 10.0  # for an idle browser
_ALIVE_S = 0.5  # between two events where no frames come
_RETRY_MS = 1000  # before a browser reconnects
_BACKLOG = 1 << 16  # bytes that wait for a slow browser: newer frames replace older
_MOST_POINTS = 1 << 16  # of a picture

_TARE = ("POST", "/tare")
_EVENTS = re.compile(r"/events(?:\?times=([1-9]))?")

_HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


class LivePage(contextlib.AbstractContextManager["LivePage"]):
    """Serves the page of what is recognised, in threads, until it is closed.

    It listens on 127.0.0.1, answers only what names that host (a page of another name
    that leads here is refused), only its own paths, and no page of another place.

    Args:
        live: What is shown.
        port: The number of the port; 0 for one that is free.
        times: Points for a cell on each side of the picture.

    Attributes:
        url: Where the page is.

    Raises:
        PortError: If the port cannot be had.
    """

    def __init__(self, live: Live, port: int = 0, *, times: int = 3) -> None:
        try:
            self._server = _Server(live, port, times)
        except (OSError, OverflowError) as error:
            why = reason(error) if isinstance(error, OSError) else str(error)
            raise PortError(f"{ADDRESS}:{port}: cannot be served: {why}") from error
        self.url = f"http://{ADDRESS}:{self._server.server_port}/"
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.05,), name="page", daemon=True
        )
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        """Close the page."""
        self.close()

    def close(self) -> None:
        """Let the browsers hear that it is over, and serve no more."""
        self._server.is_closing.set()
        self._server.wait_for_browsers(1.0)
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    request_queue_size = MOST_BROWSERS

    def __init__(self, live: Live, port: int, times: int) -> None:
        self.live, self.times = live, times
        self.is_closing = threading.Event()
        self._room = threading.BoundedSemaphore(MOST_BROWSERS)
        content = resources.files("fuzzytree.tactile.report").joinpath("live.html")
        self.content = content.read_bytes()
        self.policy = _policy(self.content.decode())
        super().__init__((ADDRESS, port), _Handler)
        names = (ADDRESS, "localhost")
        self.hosts = {f"{name}:{self.server_port}" for name in names}

    def process_request(
        self, request: socket.socket | tuple[bytes, socket.socket], client_address: Any
    ) -> None:
        """Serve a connection in a thread, if there are not too many."""
        if self._room.acquire(blocking=False):
            super().process_request(request, client_address)
            return
        assert isinstance(request, socket.socket)  # of a server of streams
        with contextlib.suppress(OSError):
            request.sendall(b"HTTP/1.0 503 too many browsers\r\n\r\n")
        self.shutdown_request(request)

    def process_request_thread(
        self, request: socket.socket | tuple[bytes, socket.socket], client_address: Any
    ) -> None:
        """Serve a connection, then make room for another."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def wait_for_browsers(self, seconds: float) -> None:
        """Wait until no connection is served any more."""
        end = time.monotonic() + seconds
        for _ in range(MOST_BROWSERS):
            self._room.acquire(timeout=max(end - time.monotonic(), 0.0))


class _Handler(BaseHTTPRequestHandler):
    timeout = _PATIENCE_S
    server_version = "fuzzytree"
    sys_version = ""

    def __init__(
        self, request: socket.socket, client_address: Any, server: BaseServer
    ) -> None:
        assert isinstance(server, _Server)
        self.own = server
        super().__init__(request, client_address, server)

    def handle(self) -> None:
        """Answer a browser, which may go away at any time."""
        with contextlib.suppress(OSError):
            super().handle()

    def finish(self) -> None:
        """Close the connection, which may be gone."""
        with contextlib.suppress(OSError):
            super().finish()

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: the terminal shows a picture."""

    def parse_request(self) -> bool:
        """Refuse what is no GET, or is meant for another host."""
        if not super().parse_request():
            return False
        origin = self.headers.get("Origin", "").lower().removeprefix("http://")
        if self.command != "GET" and (self.command, self.path) != _TARE:
            self._refuse(HTTPStatus.METHOD_NOT_ALLOWED, "only GET is answered")
        elif self.headers.get("Host", "").lower() not in self.own.hosts:
            self._refuse(HTTPStatus.MISDIRECTED_REQUEST, "this is another host")
        elif (origin or self.command == "POST") and origin not in self.own.hosts:
            # the page of another site
            self._refuse(HTTPStatus.FORBIDDEN, "only this page is answered")
        else:
            return True
        return False

    def do_GET(self) -> None:
        """Answer with the page, or with events."""
        if self.path == "/":
            self._begin(HTTPStatus.OK, "text/html; charset=utf-8")
            self.wfile.write(self.own.content)
        elif found := _EVENTS.fullmatch(self.path):
            self._begin(HTTPStatus.OK, "text/event-stream")
            self._send_events(int(found[1] or self.own.times))
        else:
            self._refuse(HTTPStatus.NOT_FOUND, "there is / and nothing else")

    def do_POST(self) -> None:
        """Tare the sensor."""
        self.own.live.tare()
        self._begin(HTTPStatus.NO_CONTENT, "text/plain; charset=utf-8")

    def _begin(self, code: HTTPStatus, kind: str) -> None:
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", self.own.policy)
        if code == HTTPStatus.METHOD_NOT_ALLOWED:
            self.send_header("Allow", "GET")
        for name, value in _HEADERS.items():
            self.send_header(name, value)
        self.end_headers()

    def _refuse(self, code: HTTPStatus, text: str) -> None:
        self._begin(code, "text/plain; charset=utf-8")
        self.wfile.write(f"{text}\n".encode())

    def _send_events(self, times: int) -> None:
        """Send what there is to see, the newest only, until it is over."""
        live, server = self.own.live, self.own
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BACKLOG)
        self.wfile.write(b"retry: %d\n\n" % _RETRY_MS)
        self._send("hello", hello_facts(live.view()))
        seen, is_over = 0, False
        while not is_over:
            view = live.view()
            is_over = view.is_over or server.is_closing.is_set()
            self._send("view", view_facts(view, times, is_over=is_over))
            if not is_over:
                time.sleep(1 / _REFRESHES)
                seen = live.wait(seen, _ALIVE_S)

    def _send(self, name: str, facts: dict[str, object]) -> None:
        data = msgspec.json.encode(facts)
        self.wfile.write(b"event: %s\ndata: %s\n\n" % (name.encode(), data))


def _policy(page: str) -> str:
    """Return what the page may do: run its own script and style, and ask this host."""
    sources: list[str] = []
    for kind in ("script", "style"):
        found = re.search(f"<{kind}>(.*?)</{kind}>", page, re.DOTALL)
        content = found[1] if found else ""
        digest = base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()
        sources.append(f"{kind}-src 'sha256-{digest}'")
    rest = (
        "connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; "
        "frame-ancestors 'none'"
    )
    return "; ".join(("default-src 'none'", *sources, rest))


def hello_facts(view: LiveView) -> dict[str, object]:
    """Return the constant facts of the page: names, classes and colours."""
    return {
        "source": view.source,
        "model": view.model,
        "classes": view.classes,
        "full": view.sensor.range_text,
        "palette": PALETTE,
    }


def view_facts(view: LiveView, times: int, *, is_over: bool) -> dict[str, object]:
    """Return what a page shows at one moment, the last one if it is over.

    The picture has at most `times` points for a cell on each side; `cells` has one.
    """
    answer = view.answer
    state = answer.state if answer else None
    first = answer.objects[0] if answer and answer.objects else None
    facts: dict[str, object] = {
        "state": "waiting" if state is None else STATES[state],
        "headline": headline(view),
        "sentence": _sentence(answer),
        "code": first.code if first else -1,
        "strengths": first.strengths if first else (),
        "facts": [*_numbers(view)],
        "status": status(dataclasses.replace(view, is_over=is_over)),
        "over": is_over,
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


def _sentence(answer: LiveResult | None) -> str:
    if answer is None or answer.state is None:
        return ""
    if len(answer.objects) > 1:
        return f"{len(answer.objects)} objects; the strengths are the first one's"
    if answer.objects and answer.state is State.OBJECT:
        (one,) = answer.objects
        where = whereabouts(one)
        return f"{SENTENCES[one.state]}, strength {one.strength:.2f}; {where}"
    return "the sensor is free" if answer.state is State.NOTHING else "rejected"


def _numbers(view: LiveView) -> list[tuple[str, str]]:
    """Return the rate, the latency and the counters, as names and texts."""
    rows = [("frames a second", f"{view.rate:.1f}")]
    if view.latency is not None:
        names = ("median", "99 %", "largest")
        for name, seconds in zip(names, dataclasses.astuple(view.latency), strict=True):
            rows.append((f"answer after, {name}", f"{1e3 * seconds:.2f} ms"))
    shown = ("frames", "damaged", "dropped", "stalls", "reconnects")
    rows += [(name, str(view.counters[name])) for name in shown]
    others = {**view.counters, "refused": view.refused}
    return rows + [(k, str(n)) for k, n in others.items() if n and k not in shown]
