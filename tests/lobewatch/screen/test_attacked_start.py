"""Attack START and the screen of a cut with wrong requests; each gets one error, and right requests still work."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import CutScreenServer, DashboardServer
from lobewatch.screen.dashboard_server import LiveTest
from lobewatch.screen.web_server import WebServerThread
from lobewatch.tap.cut_recording import CutState, CutStep
from lobewatch.tap.emulated_spindle import build_structure
from lobewatch.tap.state import StatePublisher
from tests.lobewatch.tapped_emulator import make_emulator

TOKEN, WATCH = "a-token-of-the-test", "another-token-to-watch"
START = "/machines/mill/start"
X = b'{"direction": "x"}'
HUGE = b'{"direction": "' + b"x" * 10_000_000 + b'"}'
BODIES = {
    "empty": b"",
    "blanks": b" \r\n\t",
    "null": b"null",
    "number": b"1e999",
    "list": b'["x"]',
    "text": b'"x"',
    "not JSON": b"direction=x",
    "half": b'{"direction": "x"',
    "two": X + X,
    "no UTF-8": b'{"direction": "\xff"}',
    "half a surrogate": b'{"direction": "\\ud800"}',
    "another direction": b'{"direction": "z"}',
    "no direction": b'{"resume": true}',
    "direction of another kind": b'{"direction": {"x": "x"}}',
    "unknown field": b'{"direction": "x", "port": "/dev/null"}',
    "unknown field of nested brackets": b'{"a": ' + b"[" * 2000 + b"]" * 2000 + b', "direction": "x"}',
    "nested braces": b'{"direction": ' * 250,
    "resume a text": b'{"direction": "x", "resume": "no"}',
    "resume a number": b'{"direction": "x", "resume": 1}',
    "resume null": b'{"direction": "x", "resume": null}',
    "brackets": b"[" * 100_000 + b"]" * 100_000,
    "10 MB": HUGE,
}


def ask(server: WebServerThread, method: str, path: str, body: bytes = b"", **changed: str | None) -> tuple[int, Any]:
    """Status and answer for a request as the page makes it; headers can be changed, or left out by None."""
    host = server.origin.removeprefix("http://")
    headers = {"Host": host, "Origin": server.origin, "Authorization": f"Bearer {TOKEN}"} | changed
    connection = http.client.HTTPConnection(host, timeout=60)
    with contextlib.closing(connection):
        connection.putrequest(method, path, skip_host=True)
        for name, value in ({"Content-Length": str(len(body))} | headers).items():
            if value is not None:
                connection.putheader(name, value)
        connection.endheaders()
        with contextlib.suppress(ConnectionError):  # it need not read a body that it refuses
            connection.send(body)
        answer = connection.getresponse()
        content = answer.read()
        return answer.status, json.loads(content) if content[:1] == b"{" else content


def connected(server: WebServerThread) -> socket.socket:
    """Open a connection without sending anything."""
    return socket.create_connection(("127.0.0.1", int(server.origin.rpartition(":")[2])), timeout=60)


def head(server: WebServerThread) -> bytes:
    """Head of the request that starts a test, but for its length."""
    origin = server.origin
    lines = (f"POST {START} HTTP/1.1", f"Host: {origin[7:]}", f"Origin: {origin}", f"Authorization: Bearer {TOKEN}", "")
    return "\r\n".join(lines).encode()


def is_refused(answer: tuple[int, Any], *statuses: int) -> bool:
    """Return whether the answer is one sentence with one of these statuses."""
    status, content = answer
    return status in statuses and set(content) == {"error"} and 0 < len(content["error"]) < 300


def begins(server: DashboardServer) -> bool:
    """Return whether a test has ever started on the machine."""
    return ask(server, "GET", "/tap/mill/access")[0] != 404


def tappable(path: Path, port: str) -> MachineFolder:
    """Make the example machine with this port."""
    toml = make_machine_folder(path / "mill", "surrogate_machine.toml")
    toml.write_text(toml.read_text("utf-8").replace("[daq]\n", f'[daq]\nport = "{port}"\n'), "utf-8")
    return MachineFolder(path / "mill")


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DashboardServer]:
    """Serve a machine that could be tapped."""
    path = tmp_path_factory.mktemp("shop")
    tappable(path, "/dev/nothing-here")
    with DashboardServer(path, token=TOKEN, watch_token=WATCH) as server:
        yield server


@pytest.fixture
def cut() -> Iterator[CutScreenServer]:
    """Serve the screen of a cut that has not begun."""
    pictures = StatePublisher(CutState(1, CutStep.LISTENING, "mill-3, A at 12 000 rpm"), lambda: 0.0)
    with CutScreenServer(pictures, token=TOKEN, watch_token=WATCH) as server:
        yield server


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES.keys())
def test_a_wrong_body_begins_nothing(shop: DashboardServer, body: bytes) -> None:
    answer = ask(shop, "POST", START, body)
    assert is_refused(answer, 400, 413), answer
    assert not begins(shop)
    assert ask(shop, "GET", "/machines")[0] == 200


@pytest.mark.parametrize(
    ("changed", "status"),
    [
        ({"Authorization": None}, 401),
        ({"Authorization": "Bearer "}, 401),
        ({"Authorization": f"Bearer {TOKEN[:-1]}"}, 401),
        ({"Authorization": None, "Cookie": f"token={TOKEN}"}, 401),
        ({"Authorization": f"Bearer {WATCH}"}, 403),
        ({"Origin": None}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Host": "evil.example", "Origin": "http://evil.example"}, 403),
        ({"Host": "localhost:1"}, 403),
    ],
)
def test_start_is_only_for_who_may_alter_from_the_own_page(
    shop: DashboardServer, changed: dict[str, str | None], status: int
) -> None:
    assert is_refused(ask(shop, "POST", START, X, **changed), status)
    assert not begins(shop)


@pytest.mark.parametrize("method", ["GET", "HEAD", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE", "start"])
def test_start_is_only_asked_by_post(shop: DashboardServer, method: str) -> None:
    assert ask(shop, method, START, X)[0] in (400, 404, 405)
    assert not begins(shop)


@pytest.mark.parametrize(
    "key",
    ["nobody", "..", "%2e%2e", "..%2fmill", "mill%00", "mill%0a", "MILL", "%ff", "%ed%a0%80", "mill%20", "a" * 4000],
)
def test_an_unknown_machine_cannot_be_started(shop: DashboardServer, key: str) -> None:
    assert is_refused(ask(shop, "POST", f"/machines/{key}/start", X), 404)
    assert not begins(shop)


@pytest.mark.parametrize("length", ["-1", "x", "1_0", "18446744073709551616"])
def test_a_wrong_length_begins_nothing(shop: DashboardServer, length: str) -> None:
    assert ask(shop, "POST", START, X, **{"Content-Length": length})[0] in (400, 413)
    assert not begins(shop)


def test_a_request_of_two_lengths_begins_nothing(shop: DashboardServer) -> None:
    """A proxy in front might read it as two requests."""
    for lengths in ("Content-Length: 18\r\nContent-Length: 0", "Content-Length: 18\r\nTransfer-Encoding: chunked"):
        with connected(shop) as raw:
            raw.sendall(head(shop) + f"{lengths}\r\n\r\n".encode() + X)
            assert raw.recv(4096).split(b" ")[1] == b"400"
    assert not begins(shop)


def test_a_body_that_never_ends_begins_nothing(shop: DashboardServer) -> None:
    with connected(shop) as raw:
        raw.sendall(head(shop) + b"Content-Length: 18\r\n\r\n" + X[:10])
        assert ask(shop, "GET", "/machines")[0] == 200
    assert not begins(shop)


def test_twenty_starts_at_once_begin_one_test(tmp_path: Path) -> None:
    folder = tappable(tmp_path, "/dev/nothing-here")
    spindle = folder.machine.spindle
    assert spindle is not None
    structure = build_structure(spindle.build(), spindle.damping_ratio)
    with make_emulator(structure, np.random.default_rng(1), realtime=True) as device:
        toml = folder.toml.read_text("utf-8")
        folder.toml.write_text(toml.replace("/dev/nothing-here", device.port), "utf-8")
        with DashboardServer(tmp_path, token=TOKEN) as server, ThreadPoolExecutor(20) as pool:
            bodies = [b'{"direction": "%s"}' % b"xy"[i % 2 : i % 2 + 1] for i in range(20)]
            answers = [*pool.map(lambda body: ask(server, "POST", START, body), bodies)]
            assert answers == [(200, {"url": "/tap/mill/"})] * 20
            assert [thread.name for thread in threading.enumerate()].count("tap test") == 1
            assert ask(server, "POST", "/tap/mill/stop")[0] == 200


def test_twenty_starts_at_once_after_a_failure_begin_one_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread of the failed test, which all of them wait for, takes a while to end."""
    tappable(tmp_path, "/dev/nothing-here")
    begun: list[LiveTest] = []

    class Counted(LiveTest):
        def __init__(self, *args: Any, **options: Any) -> None:
            begun.append(self)
            super().__init__(*args, **options)

    monkeypatch.setattr("lobewatch.screen.dashboard_server.LiveTest", Counted)
    monkeypatch.setattr("lobewatch.screen.dashboard_server._release_memory", lambda: time.sleep(1.0))
    with DashboardServer(tmp_path, token=TOKEN) as server, ThreadPoolExecutor(20) as pool:
        assert ask(server, "POST", START, X)[0] == 200
        while begun[0].is_running:
            time.sleep(0.02)
        answers = [*pool.map(lambda _: ask(server, "POST", START, X), range(20))]
        assert answers == [(200, {"url": "/tap/mill/"})] * 20
    assert len(begun) == 2


def test_nothing_of_a_cut_is_shown_to_strangers(cut: CutScreenServer) -> None:
    for changed, status in (
        ({"Authorization": None}, 401),
        ({"Authorization": "Bearer wrong-token-wrong"}, 401),
        ({"Origin": "http://evil.example"}, 403),
        ({"Host": "evil.example", "Origin": None}, 403),
        ({"Host": "[", "Origin": None}, 403),
    ):
        for path in ("/access", "/feed"):
            answer = ask(cut, "GET", path, **changed)
            assert is_refused(answer, status), (path, changed, answer)
    assert ask(cut, "GET", "/access") == (200, {"may_alter": True})


def test_nothing_of_a_cut_can_be_altered(cut: CutScreenServer) -> None:
    for path in ("/undo", "/stop", "/access", "/feed", "/", "/machines/mill/start"):
        for body in (b"", X, HUGE[:5000]):
            assert is_refused(ask(cut, "POST", path, body), 404, 405)
    assert ask(cut, "GET", "/access", Authorization=f"Bearer {WATCH}") == (200, {"may_alter": False})


def test_half_sent_requests_do_not_keep_the_page_of_a_cut_waiting(cut: CutScreenServer) -> None:
    with contextlib.ExitStack() as opened:
        for _ in range(100):
            one = opened.enter_context(connected(cut))
            one.sendall(b"GET /access HTTP/1.1\r\nHost: 127.0.0.1\r\n")
        assert ask(cut, "GET", "/access") == (200, {"may_alter": True})


def test_what_is_no_request_is_rejected_by_the_screen_of_a_cut(
    cut: CutScreenServer, capfd: pytest.CaptureFixture[str]
) -> None:
    for nonsense in (
        b"\x00\xff\x00\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n",
    ):
        with connected(cut) as raw:
            with contextlib.suppress(ConnectionError):
                raw.sendall(nonsense)
            assert raw.recv(4096).split(b" ")[1] == b"400"
    assert ask(cut, "GET", "/access")[0] == 200
    assert capfd.readouterr() == ("", "")
