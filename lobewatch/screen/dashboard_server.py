"""The dashboard: machines, their reports, and a button that starts a tap test."""

from __future__ import annotations

import asyncio
import gzip
import secrets
import threading
from pathlib import Path
from types import TracebackType
from typing import Self
from urllib.parse import quote

import msgspec
from aiohttp import web

from acquisition import DataError, TapDirection
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.notify.prometheus import CONTENT_TYPE, prometheus_text
from lobewatch.screen.board import Board
from lobewatch.screen.guard import MAY_ALTER, OPEN, WATCH
from lobewatch.screen.live_test import LiveTest
from lobewatch.screen.return_memory import return_memory
from lobewatch.screen.routes import add_pages, add_session
from lobewatch.screen.web_thread import WebThread
from lobewatch.show.report.page import script_sources
from lobewatch.show.report.report import render_report

REPORT_POLICY = (
    f"default-src 'none'; style-src 'unsafe-inline'; script-src {script_sources()}; img-src data:; "
    "frame-ancestors 'none'; sandbox allow-scripts allow-downloads"
)
"""A report has its style in it, and runs the scripts of reports alone."""
ZIPPED = 1_000_000
"""Bytes from which on a list of machines is sent packed, which is worth its time; chosen."""


class StartRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Body of the request that starts a tap test."""

    direction: TapDirection
    resume: bool = True
    """Whether an interrupted test of the same tool and direction is gone on with."""


class DashboardServer(WebThread):
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
        self._board = Board(Path(path))
        self._tests: dict[str, LiveTest] = {}
        self._reports: dict[str, tuple[str, str]] = {}
        self._end = threading.Event()
        self._verifier = threading.Thread(target=self._board.plant.verify_until, args=(self._end,), daemon=True)
        add_pages(self.application, {"/": "dashboard.html", "/tap/{machine}/": "screen.html"})
        add_session(self.application, "/tap/{machine}/", self._find_test)
        router = self.application.router
        router.add_get("/machines", self._list)
        router.add_get("/metrics", self._metrics)
        router.add_post("/machines/{machine}/start", self._start)
        router.add_post("/machines/{machine}/report", self._write_report, name=f"{WATCH}report")
        router.add_get("/report/{machine}/{key}", self._report, name=f"{OPEN}report")

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
        path = self._board.plant.machines.get(key)
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
        answer = await asyncio.to_thread(self._board.answer, request.query.get("known", ""), running)
        body = msgspec.json.encode(answer | {"may_alter": request[MAY_ALTER]})
        if len(body) < ZIPPED or "gzip" not in request.headers.get("Accept-Encoding", ""):
            return web.Response(body=body, content_type="application/json")
        zipped = await asyncio.to_thread(gzip.compress, body, 1)
        return web.Response(body=zipped, content_type="application/json", headers={"Content-Encoding": "gzip"})

    async def _metrics(self, _: web.Request) -> web.Response:
        text = prometheus_text(await asyncio.to_thread(self._board.standings))
        return web.Response(body=text.encode(), headers={"Content-Type": CONTENT_TYPE})

    async def _start(self, request: web.Request) -> web.Response:
        key, folder = self._find_machine(request)
        try:
            wish = msgspec.json.decode(await request.read(), type=StartRequest)
        except (msgspec.DecodeError, UnicodeDecodeError):
            raise web.HTTPBadRequest(text='the body must be {"direction": "x"}, "y" or "xy"') from None
        test = self._tests.get(key)
        begins = test is None or not test.running
        if test is not None and begins:  # it may wait for a choice that is made by this
            await asyncio.to_thread(_end, test)
        if begins and self._tests.get(key) is test:  # else another START was as fast
            self._tests[key] = LiveTest(folder, wish.direction, resume=wish.resume)
        return web.json_response({"url": f"/tap/{quote(key)}/"})

    async def _write_report(self, request: web.Request) -> web.Response:
        key, folder = self._find_machine(request)
        html = await asyncio.to_thread(_render, folder)
        await asyncio.to_thread(return_memory)
        self._reports[key] = (secrets.token_urlsafe(24), html)
        return web.json_response({"url": f"/report/{quote(key)}/{self._reports[key][0]}"})

    async def _report(self, request: web.Request) -> web.Response:
        """Answer at a name that cannot be guessed, so that the browser can open it as a page."""
        key, html = self._reports.get(request.match_info["machine"], ("", ""))
        if not key or not secrets.compare_digest(key.encode(), request.match_info["key"].encode()):
            raise web.HTTPNotFound(text="this report is gone; open it from the list of machines")
        self.door.trust(request)
        return web.Response(text=html, content_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY})


def _end(test: LiveTest) -> None:
    test.stop()
    test.join()


def _render(folder: MachineFolder) -> str:
    logbook = Logbook(folder)
    if not logbook.taps:
        raise DataError("no tap test yet: press START")
    newest = logbook.newest()
    return render_report(logbook, newest.tool, newest.direction)
