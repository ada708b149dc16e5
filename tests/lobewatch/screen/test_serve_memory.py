"""Memory of a server over months: constant with tap tests, one test and one report per machine."""

from __future__ import annotations

import gc
import platform
import resource
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median

import pytest

from lobewatch.machine.folder import MachineFolder
from lobewatch.screen import DashboardServer
from lobewatch.screen.dashboard_server import LiveTest
from tests.lobewatch.screen.test_dashboard_server import ask, hammered, machine

WINDOW = 20
"""Tap tests over which the median of the memory is taken: garbage comes and goes."""
kept: list[bytes] = []


@pytest.fixture
def served(tmp_path: Path) -> Iterator[DashboardServer]:
    """Make a machine tapped as fast as its hits are read; three hits make a test."""
    folder = machine(tmp_path / "mill", hits=3)
    with hammered(folder) as device:
        text = folder.toml.read_text("utf-8")
        folder.toml.write_text(text.replace("[daq]\n", f'[daq]\nport = "{device.port}"\n', 1), "utf-8")
        with DashboardServer(folder.path) as server:
            yield server


def tap(server: DashboardServer, number: int) -> str:
    """Run a tap test from START to its report, and return the address of the report."""
    assert ask(server, "POST", "/machines/mill/start", {"direction": "xy"[number % 2], "resume": False})[0] == 200
    deadline = time.monotonic() + 100
    while ask(server, "GET", "/machines")[1]["machines"][0]["running"]:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    address = str(ask(server, "POST", "/machines/mill/report")[1]["url"])
    status, page = ask(server, "GET", address)
    assert (status, page[:15]) == (200, "<!DOCTYPE html>")
    return address


def memory() -> float:
    """Memory of this process (MB)."""
    return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * resource.getpagesize() / 1e6


def live_tests() -> int:
    gc.collect()
    return sum(isinstance(thing, LiveTest) for thing in gc.get_objects())


@pytest.mark.long
def test_one_test_and_one_report_a_machine_are_kept(served: DashboardServer, tmp_path: Path) -> None:
    before = live_tests()  # of servers that have ended: aiohttp remembers them
    addresses = [tap(served, number) for number in range(3)]
    assert live_tests() == before + 1
    assert [ask(served, "GET", address)[0] for address in addresses] == [404, 404, 200]
    assert len(MachineFolder(tmp_path / "mill").taps()) == 3


def fragments(*_: object) -> str:
    """Need 100 MB for a moment, and keep 2 % of it, in pieces among the others."""
    pieces = [bytes(1000) for _ in range(100_000)]
    kept.extend(pieces[::50])
    return "<!DOCTYPE html>"


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other systems give memory back by themselves")
def test_what_a_report_needs_for_a_moment_is_given_back(
    served: DashboardServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    tap(served, 0)
    monkeypatch.setattr("lobewatch.screen.dashboard_server.render_report", fragments)
    before = memory()
    assert ask(served, "POST", "/machines/mill/report")[0] == 200
    assert memory() - before < 50
    kept.clear()


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_three_hundred_tap_tests_need_no_more_memory(served: DashboardServer) -> None:
    sizes = []
    for number in range(300):
        tap(served, number)
        sizes.append(memory())
    levels = [median(sizes[first : first + WINDOW]) for first in range(30, len(sizes) - WINDOW + 1)]
    assert max(levels) - levels[0] < 10
