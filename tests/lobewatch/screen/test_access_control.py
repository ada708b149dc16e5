"""Flood of connections to the screen: bounded, while a test continues."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import resource
import socket
import subprocess
import sys
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest

from acquisition import Circumstances, TapsSource, TapTest
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import ScreenServer
from lobewatch.screen import access_control as door
from lobewatch.tap.emulated_spindle import build_structure
from lobewatch.tap.session import TapSession
from tests.lobewatch.tapped_emulator import make_emulator

HALF = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"
"""A head that is not ended."""
Session = Any
"""ScriptedSession of tests/conftest.py."""

KNOCK = """
import collections, itertools, socket, sys
port, held = int(sys.argv[1]), collections.deque(maxlen=int(sys.argv[2]))
for i in itertools.count(1):
    one = socket.create_connection(("127.0.0.1", port), timeout=60)
    one.sendall(b"GET / HTTP/1.1\\r\\nHost: 127.0.0.1\\r\\n")
    held.append(one)
    if i % 100 == 0:
        print(i, flush=True)
"""
"""Half-sent requests without end, of which the newest are held."""


def port_of(server: ScreenServer) -> int:
    return int(server.origin.rpartition(":")[2])


def is_answered(server: ScreenServer) -> bool:
    """Return whether a page with the token is served."""
    connection = http.client.HTTPConnection("127.0.0.1", port_of(server), timeout=60)
    with contextlib.closing(connection):
        connection.request("GET", "/access", headers={"Authorization": f"Bearer {server.token}"})
        return connection.getresponse().status == 200


def knock(server: ScreenServer, source: str = "127.0.0.1", send: bytes = HALF) -> socket.socket:
    """One connection from an address of this computer."""
    connection = socket.create_connection(("127.0.0.1", port_of(server)), timeout=60, source_address=(source, 0))
    connection.sendall(send)
    return connection


async def next_state(feed: aiohttp.ClientWebSocketResponse) -> dict[str, Any]:
    while True:
        message = await feed.receive(timeout=60)
        if message.type is aiohttp.WSMsgType.TEXT and message.data != "{}":
            return dict(json.loads(message.data))


@contextlib.asynccontextmanager
async def feed_of(server: ScreenServer) -> AsyncIterator[aiohttp.ClientWebSocketResponse]:
    """Open the live feed as the page does."""
    headers, protocols = {"Origin": server.origin}, ("lobewatch", f"token.{server.token}")
    async with (
        aiohttp.ClientSession() as client,
        client.ws_connect(f"{server.origin}/feed", protocols=protocols, headers=headers) as feed,
    ):
        yield feed


def is_hung_up(connection: socket.socket) -> bool:
    try:
        return connection.recv(1) == b""
    except ConnectionResetError:
        return True


def wait(what: Callable[[], object], patience: float = 60.0) -> None:
    deadline = time.monotonic() + patience
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_of_three_hundred_half_sent_requests_eight_are_held_and_a_page_is_answered(session: Session) -> None:
    with ScreenServer(session) as server, contextlib.ExitStack() as opened:
        for i in range(300):
            opened.enter_context(knock(server))
            assert server.limiter.connection_count <= door.MAX_ANONYMOUS_PER_NETWORK + 1  # the page
            if i % 100 == 50:
                assert is_answered(server)
        wait(lambda: server.limiter.connection_count == door.MAX_ANONYMOUS_PER_NETWORK)


def test_from_many_addresses_sixty_four_are_held_and_no_page_that_is_known_must_go(session: Session) -> None:
    async def talk(server: ScreenServer) -> None:
        async with feed_of(server) as feed:
            assert not (await next_state(feed))["checks"]
            for i in range(100):
                opened.enter_context(knock(server, f"127.0.1.{i // 5}"))
                assert server.limiter.connection_count <= door.MAX_CONNECTIONS
            await asyncio.to_thread(wait, lambda: server.limiter.connection_count == door.MAX_CONNECTIONS)
            session.check()
            assert (await next_state(feed))["checks"]

    with ScreenServer(session) as server, contextlib.ExitStack() as opened:
        asyncio.run(talk(server))


@pytest.mark.parametrize("sent", [b"", HALF, b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"])
def test_who_sends_no_request_in_time_is_hung_up(
    session: Session, monkeypatch: pytest.MonkeyPatch, sent: bytes
) -> None:
    monkeypatch.setattr(door, "REQUEST_HEAD_TIMEOUT", 0.2)
    with ScreenServer(session) as server, knock(server, send=sent) as connection:
        if sent.endswith(b"\r\n\r\n"):
            assert b"200" in connection.recv(15)
        while not is_hung_up(connection):  # else recv ends in TimeoutError
            pass
        assert server.limiter.connection_count == 0


def test_strangers_are_answered_slowly_and_those_with_the_token_at_once(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    with ScreenServer(session) as server:
        token = {"Authorization": f"Bearer {server.token}"}
        connection = http.client.HTTPConnection("127.0.0.1", port_of(server), timeout=60)
        with contextlib.closing(connection):
            limits: tuple[tuple[str, dict[str, str], float, float, float], ...] = (
                ("/", {}, 0.05, 0.25, 60.0),
                ("/access", token, 0.05, 0.0, 60.0),  # known from now on
                ("/access", token, 30.0, 0.0, 30.0),
            )
            for path, headers, pace, least, most in limits:
                monkeypatch.setattr(door, "ACCEPT_INTERVAL", pace)
                begun = time.monotonic()
                for _ in range(5):
                    connection.request("GET", path, headers=headers)
                    assert connection.getresponse().read()
                assert least <= time.monotonic() - begun < most


def test_a_feed_is_not_hung_up_for_its_silence(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door, "REQUEST_HEAD_TIMEOUT", 0.1)
    monkeypatch.setattr(door, "IDLE_TIMEOUT", 0.1)

    async def talk(server: ScreenServer) -> None:
        async with feed_of(server) as feed:
            await next_state(feed)
            await asyncio.sleep(0.4)
            session.check()
            assert (await next_state(feed))["checks"]

    with ScreenServer(session) as server:
        asyncio.run(talk(server))


def test_descriptors_are_held_back_for_the_disk(session: Session, tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with ScreenServer(session) as server:
        assert is_answered(server)
        with (tmp_path / "next").open("w") as file:
            lowest = file.fileno()
        resource.setrlimit(resource.RLIMIT_NOFILE, (lowest + 1 + door.RESERVED_DESCRIPTORS, hard))
        try:
            with knock(server) as connection:
                assert is_hung_up(connection)
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        assert is_answered(server)


@pytest.mark.parametrize(
    ("host", "place"),
    [("192.0.2.7", "192.0.2.7"), ("2001:db8::7", "2001:db8::/64"), ("fe80::1%eth0", "fe80::/64")],
)
def test_one_computer_is_one_place(host: str, place: str) -> None:
    assert door.get_client_network(host) == place


@contextlib.contextmanager
def knocking_at(server: ScreenServer, held: int) -> Iterator[list[int]]:
    """Another process has begun requests, ends none and goes on; yields what will say how many, by hundreds."""
    count = list[int]()
    if not held:
        yield count
        return
    arguments = [sys.executable, "-c", KNOCK, str(port_of(server)), str(held)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as attacker:
        assert attacker.stdout is not None
        count.extend(int(attacker.stdout.readline()) for _ in range(2))
        try:
            yield count
            assert attacker.poll() is None
        finally:
            attacker.kill()
        count.extend(map(int, attacker.stdout))


def tapped(path: Path, hits: int, held: int, realtime: bool = True) -> tuple[TapTest, float, int]:
    """Run a guided test with many half-sent requests; return seconds of the good hits and the number of requests."""
    toml = make_machine_folder(path, "surrogate_machine.toml")
    toml.write_text(toml.read_text("utf-8").replace("hits = 10", f"hits = {hits}"), "utf-8")
    folder = MachineFolder(path)
    spindle = folder.machine.spindle
    assert spindle is not None
    structure = build_structure(spindle.build(), spindle.damping_ratio)
    about = Circumstances("mill", datetime.now(UTC), "reference", "x")
    done: list[TapTest] = []
    with make_emulator(structure, np.random.default_rng(1), realtime=realtime) as device:
        session = TapSession(folder, lambda: TapsSource(device.port), about)
        running = threading.Thread(target=lambda: done.append(session.run()))
        with ScreenServer(session) as server, knocking_at(server, held) as count:
            running.start()
            wait(lambda: session.state.good)
            begun, first = time.monotonic(), session.state.good
            wait(lambda: session.state.good == hits or not running.is_alive(), patience=100)
            rate = (session.state.good - first) / (time.monotonic() - begun)
            assert server.limiter.connection_count <= door.MAX_ANONYMOUS_PER_NETWORK
            running.join()
    return done[0], rate, max(count, default=0)


def test_a_test_goes_on_behind_some_hundred_half_sent_requests(tmp_path: Path) -> None:
    tap, _, count = tapped(tmp_path / "mill", 5, 400, realtime=False)
    assert len(tap.hits) >= 5
    assert all(hit.lost_scans == 0 for hit in tap.hits)
    assert count >= 200


@pytest.mark.long
def test_five_thousand_half_sent_requests_cost_neither_test_nor_scan_nor_hit(tmp_path: Path) -> None:
    _, quiet, _ = tapped(tmp_path / "quiet", 70, 0)
    tap, attacked, count = tapped(tmp_path / "attacked", 70, 5000)
    assert count >= 5000
    assert all(hit.lost_scans == 0 for hit in tap.hits)
    assert attacked >= 0.95 * quiet
