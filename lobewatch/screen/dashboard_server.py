"""Serve the dashboard: machines, their reports and live tap tests."""

from __future__ import annotations

import asyncio
import ctypes
import gc
import gzip
import secrets
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Self
from urllib.parse import quote

import msgspec
from aiohttp import web

from acquisition import DataError, TapDirection
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.notify.prometheus import PROMETHEUS_CONTENT_TYPE, format_prometheus
from lobewatch.notify.publish_status import publish_status
from lobewatch.screen.access_control import HAS_FULL_ACCESS, PUBLIC_ROUTE_PREFIX, WATCH_ROUTE_PREFIX
from lobewatch.screen.machine_table import MachineTable
from lobewatch.screen.web_server import WebServerThread, add_pages, add_session
from lobewatch.show.report.page import script_sources
from lobewatch.show.report.report import render_report
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession, plan_session
from lobewatch.tap.state import TapState, TapStep
from lobewatch.tap.visit import TapVisit


def release_memory() -> None:
    """Give back what nobody refers to any more, and what lies free between what is in use.

    Pictures are circles of objects, which Python keeps until it has made as many others; the C library of Linux keeps
    what is free for each thread that has once needed it. Together that is 50 MB and more after a few dozen reports.
    """
    gc.collect()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc alone
        if trim is not None:
            trim(0)


class LiveTest:
    """A tap test, and those chosen after it, in a thread of its own from the beginning on."""

    def __init__(self, folder: MachineFolder, direction: TapDirection, *, resume: bool = True) -> None:
        """Begin, or go on with an interrupted test; DataError where machine.toml names no port."""
        if not folder.machine.daq.port:
            raise DataError(f"{folder.toml}: no port in [daq]; write port there, as lobewatch tap --port takes it")
        self._folder = folder
        self._resume = resume
        self._visit = TapVisit(self._plan, folder.machine.tap.tool, direction, after=self._publish)
        self._end: TapState | None = None
        self._thread = threading.Thread(target=self._run, name="tap test", daemon=True)
        self._thread.start()

    @property
    def state(self) -> TapState:
        """Newest state of the test, also after its end."""
        return self._end or self._visit.state

    @property
    def wakes(self) -> set[Callable[[], None]]:
        """Functions that are called after every change but that of the end by `stop`."""
        return self._visit.wakes

    @property
    def running(self) -> bool:
        """Whether it holds the device; where it has failed it gives it back."""
        return self._thread.is_alive() and not self._visit.is_waiting and self.state.word is not TapStep.FAILED

    def undo(self) -> None:
        """Take the last good hit back."""
        self._visit.undo()

    def stop(self) -> None:
        """End it; the hits so far stay in the spool."""
        self._visit.stop()

    def choose(self, key: str, tool: str = "") -> None:
        """Say what comes after a test."""
        self._visit.choose(key, tool)

    def join(self) -> None:
        """Wait until it has given the device back."""
        self._thread.join()

    def _plan(self, tool: str, direction: TapDirection) -> TapSession:
        return plan_session(MachineFolder(self._folder.path), tool=tool, direction=direction, resume=self._resume)

    def _publish(self, *_: object) -> None:
        publish_status(Logbook.open(self._folder.path))

    def _run(self) -> None:
        try:
            self._visit.run()
        except TapStopped:
            state = self._visit.state
            reason = f"Stopped with {state.good} good hits: START goes on with them."
            self._end = replace(state, word=TapStep.FAILED, reason=reason)
        except (OSError, RuntimeError, ValueError):
            pass  # the session shows its failure itself
        finally:
            release_memory()


REPORT_POLICY = (
    f"default-src 'none'; style-src 'unsafe-inline'; script-src {script_sources()}; img-src data:; "
    "frame-ancestors 'none'; sandbox allow-scripts allow-downloads"
)
"""A report has its style in it, and runs the scripts of reports alone."""
MIN_GZIP_BYTES = 1_000_000
"""Bytes from which on a list of machines is sent packed, which is worth its time; chosen."""


class StartRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Body of the request that starts a tap test."""

    direction: TapDirection
    resume: bool = True
    """Whether an interrupted test of the same tool and direction is gone on with."""


class DashboardServer(WebServerThread):
    """Serves a machine or a folder of machines from __enter__ to __exit__, in a thread of its own."""

    def __init__(
        self,
        path: Path | str,
        *,
        listen: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        watch_token: str | None = None,
    ) -> None:
        """Brings the histories up to date. Port 0: any free one; token None: a new one.

        DataError where there is no machine, ValueError for a token that does not fit into an address.
        """
        super().__init__(listen, port, token, watch_token)
        self._table = MachineTable(Path(path))
        self._tests: dict[str, LiveTest] = {}
        self._reports: dict[str, tuple[str, str]] = {}
        self._end = threading.Event()
        self._verifier = threading.Thread(target=self._table.fleet.verify_until, args=(self._end,), daemon=True)
        add_pages(self.application, {"/": "dashboard.html", "/tap/{machine}/": "screen.html"})
        add_session(self.application, "/tap/{machine}/", self._find_test)
        router = self.application.router
        router.add_get("/machines", self._list)
        router.add_get("/metrics", self._metrics)
        router.add_post("/machines/{machine}/start", self._start)
        router.add_post("/machines/{machine}/report", self._write_report, name=f"{WATCH_ROUTE_PREFIX}report")
        router.add_get("/report/{machine}/{key}", self._report, name=f"{PUBLIC_ROUTE_PREFIX}report")

    def __enter__(self) -> Self:
        """Serve, and look at every byte of the machines meanwhile."""
        self._verifier.start()
        return super().__enter__()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the tap tests that run, then close; their hits stay in the spool."""
        self._end.set()
        if self._verifier.is_alive():
            self._verifier.join(10)
        for test in self._tests.values():
            test.stop()
        for test in self._tests.values():
            test.join()
        super().__exit__(kind, error, trace)

    def _find_machine(self, request: web.Request) -> tuple[str, MachineFolder]:
        key = request.match_info["machine"]
        path = self._table.fleet.machines.get(key)
        if path is None:
            raise web.HTTPNotFound(text="there is no such machine")
        return key, MachineFolder(path)

    def _find_test(self, request: web.Request) -> LiveTest:
        """Newest test of a machine: a page that has watched one to its end sees the next."""
        test = self._tests.get(request.match_info["machine"])
        if test is None:
            raise web.HTTPNotFound(text="no tap test runs on this machine; go to All machines and press START")
        return test

    async def _list(self, request: web.Request) -> web.Response:
        running = {key for key, test in self._tests.items() if test.running}
        answer = await asyncio.to_thread(self._table.updates_since, request.query.get("known", ""), running)
        body = msgspec.json.encode(answer | {"may_alter": request[HAS_FULL_ACCESS]})
        if len(body) < MIN_GZIP_BYTES or "gzip" not in request.headers.get("Accept-Encoding", ""):
            return web.Response(body=body, content_type="application/json")
        zipped = await asyncio.to_thread(gzip.compress, body, 1)
        return web.Response(body=zipped, content_type="application/json", headers={"Content-Encoding": "gzip"})

    async def _metrics(self, _: web.Request) -> web.Response:
        text = format_prometheus(await asyncio.to_thread(self._table.assess_machines))
        return web.Response(body=text.encode(), headers={"Content-Type": PROMETHEUS_CONTENT_TYPE})

    async def _start(self, request: web.Request) -> web.Response:
        key, folder = self._find_machine(request)
        try:
            wish = msgspec.json.decode(await request.read(), type=StartRequest)
        except (msgspec.DecodeError, UnicodeDecodeError):
            raise web.HTTPBadRequest(text='the body must be {"direction": "x"}, "y" or "xy"') from None
        test = self._tests.get(key)
        begins = test is None or not test.running
        if test is not None and begins:  # it may wait for a choice that is made by this
            await asyncio.to_thread(_stop_test, test)
        if begins and self._tests.get(key) is test:  # else another START was as fast
            self._tests[key] = LiveTest(folder, wish.direction, resume=wish.resume)
        return web.json_response({"url": f"/tap/{quote(key)}/"})

    async def _write_report(self, request: web.Request) -> web.Response:
        key, folder = self._find_machine(request)
        html = await asyncio.to_thread(_render_report, folder)
        await asyncio.to_thread(release_memory)
        self._reports[key] = (secrets.token_urlsafe(24), html)
        return web.json_response({"url": f"/report/{quote(key)}/{self._reports[key][0]}"})

    async def _report(self, request: web.Request) -> web.Response:
        """Answer at a name that cannot be guessed, so that the browser can open it as a page."""
        key, html = self._reports.get(request.match_info["machine"], ("", ""))
        if not key or not secrets.compare_digest(key.encode(), request.match_info["key"].encode()):
            raise web.HTTPNotFound(text="this report is gone; open it from the list of machines")
        self.limiter.trust(request)
        return web.Response(text=html, content_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY})


def _stop_test(test: LiveTest) -> None:
    test.stop()
    test.join()


def _render_report(folder: MachineFolder) -> str:
    logbook = Logbook(folder)
    if not logbook.taps:
        raise DataError("no tap test yet: press START")
    newest = logbook.newest_tap()
    return render_report(logbook, newest.tool, newest.direction)
