"""Web server of the screen: access, sent data, and no delay by slow pages."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import struct
import threading
from collections.abc import Callable, Coroutine
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest

from acquisition import Circumstances, HammeredStructure, HitFlags, TapsEmulator, TapsSource
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import ScreenServer
from lobewatch.screen.web_server import WebServerThread
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, EMULATED_SAMPLE_RATE
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import LiveCurves, TapState, TapStep

TOKEN = "a-token-of-the-test"
Session = Any
"""ScriptedSession of conftest.py."""


def ask(server: WebServerThread, method: str, path: str, body: str = "", **changed: str | None) -> tuple[int, Any, Any]:
    """Status, content and headers for a request as the page makes it; headers can be changed, or left out by None."""
    host = server.origin.removeprefix("http://")
    headers = {"Host": host, "Origin": server.origin, "Authorization": f"Bearer {server.token}"} | changed
    connection = http.client.HTTPConnection(host, timeout=60)
    connection.putrequest(method, path, skip_host=True)
    for name, value in headers.items():
        if value is not None:
            connection.putheader(name, value)
    connection.putheader("Content-Length", str(len(body)))
    connection.endheaders(body.encode())
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    is_json = answer.headers["Content-Type"].startswith("application/json")
    return answer.status, json.loads(content) if is_json and content else content, answer.headers


Received = Callable[[aiohttp.ClientWebSocketResponse], Coroutine[Any, Any, None]]


def follow(server: WebServerThread, talk: Received, path: str = "/feed", token: str = TOKEN, **headers: str) -> None:
    """Open the feed as the page does."""

    async def run() -> None:
        async with (
            aiohttp.ClientSession() as client,
            client.ws_connect(
                server.origin + path,
                protocols=("lobewatch", f"token.{token}"),
                headers={"Origin": server.origin} | headers,
                max_msg_size=0,
            ) as feed,
        ):
            await talk(feed)

    asyncio.run(run())


async def next_state(feed: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    while True:
        message = await feed.receive(timeout=60)
        if message.type is aiohttp.WSMsgType.TEXT and message.data != "{}":
            return dict(json.loads(message.data))
        assert message.type in (aiohttp.WSMsgType.TEXT, aiohttp.WSMsgType.BINARY)


@pytest.mark.quick
def test_the_page_needs_no_token_and_tells_nothing(session: Session) -> None:
    with ScreenServer(session, token=TOKEN) as server:
        assert server.url == f"{server.origin}/#token={TOKEN}"
        status, page, headers = ask(server, "GET", "/", Authorization=None, Origin=None)
        assert status == 200
        assert TOKEN not in page.decode()
        assert session.state.title not in page.decode()
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        assert "Access-Control-Allow-Origin" not in headers


@pytest.mark.parametrize("given", [None, "Bearer wrong-token-wrong", "Bearer ", "", f"Bearer {TOKEN}x", "Bearer \xe4"])
def test_without_the_token_nothing_is_altered_or_reported(session: Session, given: str | None) -> None:
    session.hit()
    with ScreenServer(session, token=TOKEN) as server:
        for method, path in (("POST", "/undo"), ("POST", "/stop"), ("GET", "/access"), ("GET", "/feed")):
            status, answer, _ = ask(server, method, path, Authorization=given)
            assert status == 401
            assert "token" in answer["error"]
    assert not session.undone.is_set()
    assert not session.stopped.is_set()


class Watched:
    """A session, and how often it is looked at."""

    def __init__(self, session: Session) -> None:
        self._session, self.wakes, self.looks = session, session.wakes, 0

    @property
    def state(self) -> TapState:
        self.looks += 1
        state: TapState = self._session.state
        return state

    def undo(self) -> None: ...

    def decide(self, number: int | None, *, accept: bool) -> None: ...

    def stop(self) -> None: ...

    def choose(self, key: str, tool: str = "") -> None: ...


def test_nothing_is_inspected_while_nothing_changes(session: Session) -> None:
    """Except once a second for the heartbeat; changes are sent at once, and closed pages are dropped."""
    watched, kinds = Watched(session), []

    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        kinds.append((await next_state(feed))["kind"])
        for _ in range(2):
            assert await feed.receive_str(timeout=60) == "{}"
        assert watched.looks <= 10
        await asyncio.to_thread(session.show, TapStep.WAIT)
        kinds.append((await next_state(feed))["kind"])
        assert len(session.wakes) == 1

    with ScreenServer(watched, token=TOKEN) as server:
        follow(server, talk)
    assert kinds == ["checking", "wait"]
    assert session.wakes == set()


def test_with_the_token_it_is(session: Session) -> None:
    session.hit()
    with ScreenServer(session, token=TOKEN) as server:
        assert ask(server, "POST", "/undo")[0] == 200
        assert session.undone.is_set()
        assert ask(server, "POST", "/stop")[0] == 200
        assert session.stopped.is_set()


@pytest.mark.quick
def test_the_token_to_watch_shows_and_alters_nothing(session: Session) -> None:
    session.hit()
    seen: list[dict[str, Any]] = []

    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        seen.append(await next_state(feed))

    with ScreenServer(session, token=TOKEN) as server:
        assert server.watch_url == f"{server.origin}/#token={server.watch_token}"
        follow(server, talk, token=server.watch_token)
        watching = f"Bearer {server.watch_token}"
        assert ask(server, "GET", "/access", Authorization=watching)[:2] == (200, {"may_alter": False})
        assert ask(server, "GET", "/access")[1] == {"may_alter": True}
        for path in ("/undo", "/stop"):
            status, answer, _ = ask(server, "POST", path, Authorization=watching)
            assert (status, "read-only" in answer["error"]) == (403, True)
    assert seen[0]["good"] == 1
    assert not session.undone.is_set()
    assert not session.stopped.is_set()


def test_one_token_cannot_be_both(session: Session) -> None:
    with pytest.raises(ValueError, match="both tokens"):
        ScreenServer(session, token=TOKEN, watch_token=TOKEN)


@pytest.mark.parametrize("origin", [None, "null", "http://evil.example", "https://127.0.0.1", "http://localhost:1"])
def test_another_page_may_not_alter_anything_even_with_the_token(session: Session, origin: str | None) -> None:
    session.hit()
    with ScreenServer(session, token=TOKEN) as server:
        assert ask(server, "POST", "/undo", Origin=origin)[0] == 403
        assert ask(server, "GET", "/feed", Origin=origin, Upgrade="websocket")[0] == 403
    assert not session.undone.is_set()


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "[", ""])
def test_a_foreign_name_that_points_here_is_rejected(session: Session, host: str) -> None:
    with ScreenServer(session, token=TOKEN) as server:
        for path in ("/", "/access", "/static/screen.js"):
            assert ask(server, "GET", path, Host=host, Origin=None)[0] in (400, 403)


def test_through_a_tunnel_the_name_is_localhost(session: Session) -> None:
    with ScreenServer(session, token=TOKEN) as server:
        assert ask(server, "GET", "/access", Host="localhost:9000", Origin="http://localhost:9000")[0] == 200


def test_reading_alters_nothing(session: Session) -> None:
    session.hit()
    with ScreenServer(session, token=TOKEN) as server:
        for path in ("/undo", "/stop"):
            for method in ("GET", "HEAD", "PUT", "DELETE", "OPTIONS"):
                assert ask(server, method, path)[0] in (404, 405)
    assert not session.undone.is_set()
    assert not session.stopped.is_set()


@pytest.mark.parametrize(
    "path", ["/nothing", "/static/", "/static/../guard.py", "/static/..%2fguard.py", "/static/uPlot.LICENSE", "/%00"]
)
def test_what_is_not_there(session: Session, path: str) -> None:
    with ScreenServer(session, token=TOKEN) as server:
        status, answer, _ = ask(server, "GET", path)
        assert status == 404
        assert "Traceback" not in str(answer)


def test_what_is_no_request_is_answered_with_400_and_nothing_in_the_terminal(
    session: Session, capfd: pytest.CaptureFixture[str]
) -> None:
    with ScreenServer(session, token=TOKEN) as server:
        host, port = server.origin.removeprefix("http://").split(":")
        for nonsense in (b"\x00\xff\x00\r\n\r\n", b"GET / HTTP/1.1\r\nBad Header\r\n\r\n"):
            with socket.create_connection((host, int(port)), timeout=60) as raw:
                raw.sendall(nonsense)
                assert raw.recv(4096).split(b" ")[1] == b"400"
    assert capfd.readouterr() == ("", "")


def test_what_the_session_rejects_is_reported_in_one_sentence(session: Session) -> None:
    session.refusal = "there is no hit to take back"
    with ScreenServer(session, token=TOKEN) as server:
        status, answer, _ = ask(server, "POST", "/undo")
    assert (status, answer) == (409, {"error": "there is no hit to take back"})


def test_the_state_comes_with_every_change_and_the_curves_only_when_they_are_new(session: Session) -> None:
    session.check()

    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        first = await next_state(feed)
        assert (first["kind"], first["word"], first["good"], first["wanted"]) == ("checking", "CHECKING", 0, 10)
        assert [one["passed"] for one in first["checks"]] == [True, True, True, False]
        session.hit(HitFlags.DOUBLE_HIT | HitFlags.TOO_SOFT, "Second peak.")
        curves = await feed.receive(timeout=60)
        assert curves.type is aiohttp.WSMsgType.BINARY
        shown = await next_state(feed)
        assert (shown["kind"], shown["word"], shown["reason"]) == ("refused", "DOUBLE HIT, TOO SOFT", "Second peak.")
        (hit,) = shown["hits"]
        assert (hit["number"], hit["good"], hit["verdict"]) == (1, False, "double hit, too soft")
        assert (hit["peak"], hit["undone"]) == ("312 N", False)
        session.show(TapStep.TAP, levels=(float("nan"), 2.0))
        again = await feed.receive(timeout=60)
        assert again.type is aiohttp.WSMsgType.TEXT
        assert json.loads(again.data)["levels"] == [None, 2.0]

    with ScreenServer(session, token=TOKEN) as server:
        follow(server, talk)


@pytest.mark.quick
def test_the_curves_arrive_as_they_were(session: Session) -> None:
    session.hit()
    plots: LiveCurves = session.state.plots
    found: dict[str, Any] = {}

    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        data = (await feed.receive(timeout=60)).data
        (size,) = struct.unpack_from("<I", data)
        header = json.loads(data[4 : 4 + size])
        assert (4 + size) % 4 == 0
        offset = 4 + size
        for name, count in header["curves"]:
            found[name] = np.frombuffer(data, "<f4", count, offset)
            offset += 4 * count
        assert offset == len(data)
        assert header["band"] == [4.0, 7600.0]

    with ScreenServer(session, token=TOKEN) as server:
        follow(server, talk)
    assert plots.mean is not None
    assert plots.force is not None
    assert "coherence" not in found
    np.testing.assert_allclose(found["force"], plots.force, rtol=1e-6, atol=1e-30)
    np.testing.assert_allclose(found["mean"], plots.mean, rtol=1e-6)


@pytest.mark.parametrize("token", ["", "wrong-token-wrong"])
def test_no_feed_without_the_token(session: Session, token: str) -> None:
    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        raise AssertionError("let in")

    with ScreenServer(session, token=TOKEN) as server, pytest.raises(aiohttp.WSServerHandshakeError) as refused:
        follow(server, talk, token=token)
    assert refused.value.status == 401


def test_a_page_that_talks_back_is_hung_up(session: Session) -> None:
    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        await next_state(feed)
        await feed.send_str("undo")
        assert (await feed.receive(timeout=60)).type is aiohttp.WSMsgType.CLOSE

    with ScreenServer(session, token=TOKEN) as server:
        follow(server, talk)
    assert not session.undone.is_set()


def test_a_page_too_slow_misses_old_states_and_holds_nobody_up(session: Session) -> None:
    """The slow page does not read at all while a thousand pictures of 400 kB pass; then it sees the newest soon."""
    big = np.zeros(50_000)
    session.hit()
    plots = replace(session.state.plots, time=big, force=big)
    read: list[dict[str, Any]] = []

    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        await next_state(feed)
        passed = threading.Thread(target=acquire)
        passed.start()
        await asyncio.to_thread(quick_page_sees_the_end)
        while not read or read[-1]["reason"] != "999":
            read.append(await next_state(feed))

    def acquire() -> None:
        """Nothing here waits for a page."""
        for i in range(1000):
            session.show(TapStep.WAIT, reason=str(i), plots=replace(plots))

    def quick_page_sees_the_end() -> None:
        async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
            while (await next_state(feed))["reason"] != "999":
                pass

        follow(server, talk)

    with ScreenServer(session, token=TOKEN) as server:
        follow(server, talk)
    assert len(read) < 500


def test_at_the_end_the_last_state_is_sent_and_the_feed_closed_as_such(session: Session) -> None:
    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        await next_state(feed)
        session.finish()
        leaving = asyncio.create_task(asyncio.to_thread(server.__exit__, None, None, None))
        shown = await next_state(feed)
        assert (shown["word"], shown["outcome"]["light"]) == ("DONE", "warn")
        assert (await feed.receive(timeout=60)).type is aiohttp.WSMsgType.CLOSE
        assert feed.close_code == aiohttp.WSCloseCode.GOING_AWAY
        await leaving

    server = ScreenServer(session, token=TOKEN).__enter__()
    follow(server, talk)


def test_a_real_test_through_an_emulated_device(tmp_path: Path, tapper: Callable[..., HammeredStructure]) -> None:
    make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
    about = Circumstances("mill", datetime.now(UTC), "reference", "x")
    shown: list[dict[str, Any]] = []

    async def talk(feed: aiohttp.ClientWebSocketResponse) -> None:
        running = threading.Thread(target=session.run)
        running.start()
        while not shown or shown[-1]["outcome"] is None:
            shown.append(await next_state(feed))
        running.join()

    with TapsEmulator(tapper(), EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=False) as device:
        folder = MachineFolder(tmp_path / "mill")
        session = TapSession(folder, lambda: TapsSource(device.port), about)
        with ScreenServer(session, token=TOKEN) as server:
            follow(server, talk)
    assert (shown[-1]["word"], shown[-1]["good"]) == ("DONE", 10)
    assert " Hz" in shown[-1]["outcome"]["texts"][0]


def test_what_comes_next_is_chosen_with_the_full_token_alone(session: Session) -> None:
    with ScreenServer(session, token=TOKEN) as server:
        assert ask(server, "POST", "/choose", '{"key": "tool", "tool": "drill 8"}')[0] == 200
        assert ask(server, "POST", "/choose", '{"tool": "drill 8"}')[0] == 400
        assert ask(server, "POST", "/choose", r'{"key": "tool", "tool": "\u001b[2J"}')[0] == 409
        watching = {"Authorization": f"Bearer {server.watch_token}"}
        assert ask(server, "POST", "/choose", '{"key": "done"}', **watching)[0] == 403
    assert session.chosen == [("tool", "drill 8")]
