"""The page of live recognition: what it answers, to whom, and what it sends."""

from __future__ import annotations

import base64
import itertools
import json
import re
import socket
import threading
from collections.abc import Iterator
from http.client import HTTPConnection, HTTPResponse
from urllib.parse import urlsplit

import numpy as np
import pytest

from fuzzytree import table
from fuzzytree.api.verbs import learn
from fuzzytree.errors import PortError
from fuzzytree.tactile.link.recording import FrameRecord
from fuzzytree.tactile.recognition.live import Live
from fuzzytree.tactile.report.page import MOST_BROWSERS, LivePage
from fuzzytree.tactile.sensor import Counters, Frame, Sensor
from tests.tactile.replays import replayed

LARGE = np.full((4, 4), 255, np.uint8)
AREAS = np.array([[4.0], [5.0], [16.0], [15.0]])
EVIL = "<img src=x onerror=alert(1)>"


def shown(frames: int | None = None) -> Live:
    tree = learn(table(AREAS, columns=["area"]), target=["s", "s", EVIL, EVIL])
    records = (
        FrameRecord(Frame(LARGE, number / 100, number), Counters(frames=number + 1))
        for number in (itertools.count() if frames is None else range(frames))
    )
    return Live(tree, Sensor(4, 4), replayed(records), "frames")


@pytest.fixture
def live() -> Live:
    return shown()


@pytest.fixture
def page(live: Live) -> Iterator[LivePage]:
    with LivePage(live) as found:
        yield found


def wanted(
    page: LivePage,
    path: str = "/",
    method: str = "GET",
    host: str | None = None,
    origin: str | None = None,
) -> HTTPResponse:
    place = urlsplit(page.url)
    connection = HTTPConnection(place.netloc, timeout=120)
    connection.putrequest(method, path, skip_host=host is not None)
    if host is not None:
        connection.putheader("Host", host)
    if origin is not None:
        connection.putheader("Origin", origin)
    connection.endheaders()
    return connection.getresponse()


def events(response: HTTPResponse) -> Iterator[tuple[str, dict[str, object]]]:
    name = ""
    for raw in response:
        field, _, value = raw.decode().strip().partition(": ")
        if field == "event":
            name = value
        elif field == "data":
            yield name, json.loads(value)


def test_the_page_listens_on_this_computer_only(page: LivePage) -> None:
    assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", page.url)


def test_the_page_is_one_file_that_uses_nothing_from_outside(
    page: LivePage,
) -> None:
    found = wanted(page)
    content = found.read().decode()
    assert found.status == 200
    assert found.headers["Content-Type"] == "text/html; charset=utf-8"
    assert not re.search(
        r"https?:|//[a-z]|@import|url\(|<link[^>]+href=\"(?!data:)", content
    )
    assert "innerHTML" not in content


def test_the_policy_allows_the_own_script_and_style_and_nothing_else(
    page: LivePage,
) -> None:
    found = wanted(page)
    policy = found.headers["Content-Security-Policy"]
    sha = "'sha256-[A-Za-z0-9+/]{43}='"
    assert re.fullmatch(
        f"default-src 'none'; script-src {sha}; style-src {sha}; connect-src 'self'; "
        "img-src data:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
        policy,
    )
    assert found.headers["X-Content-Type-Options"] == "nosniff"
    assert found.headers["Cache-Control"] == "no-store"
    assert "Access-Control-Allow-Origin" not in found.headers


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:80", "127.0.0.1", "127.0.0.1:1", ""]
)
@pytest.mark.parametrize("path", ["/", "/events"])
def test_a_name_of_another_host_is_refused(
    page: LivePage, host: str, path: str
) -> None:
    found = wanted(page, path, host=host)
    assert (found.status, found.read()) == (421, b"this is another host\n")


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://localhost"])
def test_a_page_of_another_place_is_refused(page: LivePage, origin: str) -> None:
    found = wanted(page, "/events", origin=origin)
    assert (found.status, found.read()) == (403, b"only this page is answered\n")
    assert wanted(page, origin=page.url.rstrip("/")).status == 200


def test_the_name_localhost_is_this_host(page: LivePage) -> None:
    port = urlsplit(page.url).port
    assert wanted(page, host=f"localhost:{port}").status == 200


@pytest.mark.parametrize("method", ["POST", "HEAD", "PUT", "DELETE", "OPTIONS", "X"])
def test_only_get_is_answered(page: LivePage, method: str) -> None:
    found = wanted(page, method=method)
    assert found.status == 405
    assert found.headers["Allow"] == "GET"


def test_a_button_of_the_page_tares_and_no_other_page_does(
    page: LivePage, live: Live
) -> None:
    own = page.url.rstrip("/")
    answers = live.answers()
    assert next(answers).objects
    for origin in (None, "http://evil.example"):
        assert wanted(page, "/tare", "POST", origin=origin).status == 403
    assert wanted(page, "/tare", "POST", origin=own).status == 204
    events = [event for _ in range(11) for event in next(answers).events]
    assert [event.kind for event in events] == ["tare"]
    assert next(answers).objects == ()  # what lies there is the baseline now


def test_a_browser_chooses_the_points_of_its_picture(
    page: LivePage, live: Live
) -> None:
    answers = live.answers()
    next(answers), next(answers)
    for name, facts in events(wanted(page, "/events?times=5")):
        if name == "view":
            assert facts["shape"] == [20, 20]
            break


@pytest.mark.parametrize("path", ["/etc/passwd", "/../x", "/events/", "/?x"])
def test_there_are_no_other_paths(page: LivePage, path: str) -> None:
    found = wanted(page, path)
    assert (found.status, found.read()) == (404, b"there is / and nothing else\n")


def test_what_is_no_http_is_refused_and_the_page_goes_on(page: LivePage) -> None:
    place = urlsplit(page.url)
    for content in (b"\x00\xff" * 40, b"GET\r\n\r\n", b"GET /" + b"a" * 70000):
        with socket.create_connection((place.hostname, place.port), 10) as line:
            line.sendall(content + b"\r\n\r\n")
            line.shutdown(socket.SHUT_WR)
    assert wanted(page).status == 200


def test_events_bring_the_names_then_the_picture_and_the_answer(
    page: LivePage, live: Live
) -> None:
    answers = live.answers()
    next(answers), next(answers)
    found = events(wanted(page, "/events"))
    name, hello = next(found)
    assert name == "hello"
    assert hello["classes"] == [EVIL, "s"]
    assert hello["source"] == "frames"
    name, view = next(found)
    assert name == "view"
    assert (view["headline"], view["state"], view["code"]) == (EVIL, "object", 0)
    assert view["shape"] == [12, 12]
    points = view["points"]
    assert isinstance(points, str)
    assert base64.b64decode(points) == b"\xff" * 144
    cells = base64.b64encode(b"\xff" * 16).decode()
    assert view["cells"] == {"shape": [4, 4], "points": cells}
    assert view["status"] == "16 cells take no more: the frame is saturated"
    assert view["over"] is False


def test_the_last_event_reports_that_the_source_is_gone() -> None:
    live = shown(3)
    with LivePage(live) as page:
        found = events(wanted(page, "/events"))
        next(found)
        list(live.answers())
        views = [view for _, view in found]
    assert views[-1]["over"] is True
    assert views[-1]["status"] == "the source is gone: no more frames"


@pytest.mark.heavy
def test_closing_the_page_reports_browsers_that_it_is_over(live: Live) -> None:
    page = LivePage(live)
    found = events(wanted(page, "/events"))
    next(found)
    page.close()
    assert [view["over"] for _, view in found][-1] is True


def test_too_many_browsers_are_turned_away_and_room_is_found_again(
    page: LivePage,
) -> None:
    place = urlsplit(page.url)
    held = [
        socket.create_connection((place.hostname, place.port), 10)
        for _ in range(MOST_BROWSERS)
    ]
    refused = wanted(page)
    assert (refused.status, refused.reason) == (503, "too many browsers")
    for line in held:
        line.close()
    statuses = {wanted(page).status for _ in range(50)}
    assert 200 in statuses


def test_a_browser_that_reads_nothing_holds_up_no_answer(
    page: LivePage, live: Live
) -> None:
    place = urlsplit(page.url)
    with socket.create_connection((place.hostname, place.port), 10) as line:
        line.sendall(f"GET /events HTTP/1.0\r\nHost: {place.netloc}\r\n\r\n".encode())
        answers = list(live.answers(30))
    assert len(answers) == 30
    assert threading.active_count() < 10


def test_a_port_that_is_taken_is_reported(page: LivePage, live: Live) -> None:
    port = urlsplit(page.url).port
    assert port is not None
    with pytest.raises(PortError) as caught:
        LivePage(live, port)
    assert str(caught.value) == (
        f"127.0.0.1:{port}: cannot be served: address already in use"
    )
