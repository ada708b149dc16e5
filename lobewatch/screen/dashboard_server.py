"""Serve the dashboard: machines, their reports and live tap tests."""

import asyncio
import ctypes
import gc
import gzip
import secrets
import sys
import threading
from dataclasses import replace
from pathlib import Path
from typing import Self, Unpack
from urllib.parse import quote

import msgspec
from aiohttp import web

from acquisition import DataError, TapDirection
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.notify.prometheus import PROMETHEUS_CONTENT_TYPE, format_prometheus
from lobewatch.notify.publish_status import publish_status
from lobewatch.screen.access_control import HAS_FULL_ACCESS, PUBLIC_ROUTE_PREFIX, WATCH_ROUTE_PREFIX
from lobewatch.screen.dashboard_table import DashboardTable
from lobewatch.screen.lobes_page import add_stated_lobes
from lobewatch.screen.phone_page import add_recording_upload
from lobewatch.screen.web_server import ServerOptions, WebServerThread, add_pages, add_session, read_body
from lobewatch.show.report.page import script_source
from lobewatch.show.report.report import render_report
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession, plan_session
from lobewatch.tap.state import TapState, TapStep
from lobewatch.tap.visit import TapVisit

REPORT_POLICY = (
    f"default-src 'none'; style-src 'unsafe-inline'; script-src {script_source()}; img-src data:; "
    "frame-ancestors 'none'; sandbox allow-scripts allow-downloads"
)
"""Content security policy of reports: inline styles, and no scripts but those of reports."""
MIN_GZIP_BYTES = 1_000_000
"""Smallest size of a response that is compressed (bytes); chosen."""


def _release_memory() -> None:
    """Return unused memory to the system.

    Figures are reference cycles, which Python collects late, and the C library of Linux keeps free memory for each
    thread. Together that exceeds 50 MB after a few dozen reports.
    """
    gc.collect()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # glibc only
        if trim is not None:
            trim(0)


class LiveTest(TapVisit):
    """Tap test started from the dashboard, and the tests chosen after it, in a thread of their own."""

    def __init__(self, folder: MachineFolder, direction: TapDirection, *, resume: bool = True) -> None:
        """Start a test, or resume an interrupted one. DataError if machine.toml names no port."""
        if not folder.machine.daq.port:
            raise DataError(f"{folder.toml}: no port in [daq]. Set port to the value of lobewatch tap --port.")

        def plan(tool: str, direction: TapDirection) -> TapSession:
            return plan_session(MachineFolder(folder.path), tool=tool, direction=direction, resume=resume, asks=True)

        tool = folder.machine.tap.tool
        super().__init__(plan, tool, direction, after=lambda _: publish_status(Logbook.open(folder.path)))
        self._final_state: TapState | None = None
        self._thread = threading.Thread(target=self._run, name="tap test", daemon=True)
        self._thread.start()

    @property
    def state(self) -> TapState:
        """Newest state, also after the end."""
        return self._final_state or super().state

    @property
    def is_running(self) -> bool:
        """True if the test uses the device. A failed test does not."""
        return self._thread.is_alive() and not self.is_waiting and self.state.word is not TapStep.FAILED

    def end(self) -> None:
        """Stop the test and wait until the device is free. Its hits stay in the spool."""
        self.stop()
        self._thread.join()

    def _run(self) -> None:
        try:
            self.run()
        except TapStopped:
            state = self.state
            reason = f"Stopped with {state.good} good hits. Press START to continue with these hits."
            self._final_state = replace(state, word=TapStep.FAILED, reason=reason)
        except (OSError, RuntimeError, ValueError):
            pass  # the state shows the failure
        finally:
            _release_memory()


class StartRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Body of the request that starts a tap test."""

    direction: TapDirection
    resume: bool = True
    """True to resume an interrupted test of the same tool and direction."""


class DashboardServer(WebServerThread):
    """Server of the dashboard of a machine or a folder of machines, in a thread while its context lasts."""

    def __init__(self, path: Path | str, **options: Unpack[ServerOptions]) -> None:
        """Prepare the server, and assess the machines.

        Parameters
        ----------
        path
            Machine folder, or a folder of machine folders.
        options
            Address, port and tokens as in `ServerOptions`. ValueError for an invalid token.

        Raises
        ------
        DataError
            If there is no machine.
        """
        super().__init__(**options)
        self._table = DashboardTable(Path(path))
        self._tests: dict[str, LiveTest] = {}
        self._reports: dict[str, tuple[str, str]] = {}
        self._end = threading.Event()
        self._verifier = threading.Thread(target=self._table.fleet.verify_until, args=(self._end,), daemon=True)
        pages = {
            "/": "dashboard.html",
            "/tap/{machine}/": "screen.html",
            "/phone/": "phone.html",
            "/lobes/": "lobes.html",
        }
        add_pages(self.application, pages)
        add_recording_upload(self.application, "/phone/", lambda: self._table.fleet.machines)
        add_stated_lobes(self.application, "/lobes/")
        add_session(self.application, "/tap/{machine}/", self._find_test)
        router = self.application.router
        router.add_get("/machines", self._list)
        router.add_get("/metrics", self._metrics)
        router.add_post("/machines/{machine}/start", self._start)
        router.add_post("/machines/{machine}/report", self._write_report, name=f"{WATCH_ROUTE_PREFIX}report")
        router.add_get("/report/{machine}/{key}", self._report, name=f"{PUBLIC_ROUTE_PREFIX}report")

    def __enter__(self) -> Self:
        """Start to serve, and verify every byte of the machines meanwhile."""
        self._verifier.start()
        return super().__enter__()

    def __exit__(self, *error: object) -> None:
        """Stop running tap tests, then close. Their hits stay in the spool."""
        self._end.set()
        if self._verifier.is_alive():
            self._verifier.join(10)
        for test in self._tests.values():
            test.stop()
        for test in self._tests.values():
            test.end()
        super().__exit__(*error)

    def _find_machine(self, request: web.Request) -> tuple[str, MachineFolder]:
        key = request.match_info["machine"]
        path = self._table.fleet.machines.get(key)
        if path is None:
            raise web.HTTPNotFound(text="this machine does not exist")
        return key, MachineFolder(path)

    def _find_test(self, request: web.Request) -> LiveTest:
        """Find the newest test of a machine."""
        test = self._tests.get(request.match_info["machine"])
        if test is None:
            raise web.HTTPNotFound(text="no tap test is running on this machine. Open All machines and press START.")
        return test

    async def _list(self, request: web.Request) -> web.Response:
        running = {key for key, test in self._tests.items() if test.is_running}
        answer = await asyncio.to_thread(self._table.updates_since, request.query.get("known", ""), running)
        body = msgspec.json.encode(answer | {"may_alter": request[HAS_FULL_ACCESS]})
        if len(body) < MIN_GZIP_BYTES or "gzip" not in request.headers.get("Accept-Encoding", ""):
            return web.Response(body=body, content_type="application/json")
        compressed = await asyncio.to_thread(gzip.compress, body, 1)
        return web.Response(body=compressed, content_type="application/json", headers={"Content-Encoding": "gzip"})

    async def _metrics(self, _: web.Request) -> web.Response:
        text = format_prometheus(await asyncio.to_thread(self._table.assess_machines))
        return web.Response(body=text.encode(), headers={"Content-Type": PROMETHEUS_CONTENT_TYPE})

    async def _start(self, request: web.Request) -> web.Response:
        key, folder = self._find_machine(request)
        start = await read_body(request, StartRequest, 'the request body must be {"direction": "x"} (or "y", "xy")')
        test = self._tests.get(key)
        is_free = test is None or not test.is_running
        if test is not None and is_free:  # it may wait for the choice of the next step
            await asyncio.to_thread(test.end)
        if is_free and self._tests.get(key) is test:  # else another START was faster
            self._tests[key] = LiveTest(folder, start.direction, resume=start.resume)
        return web.json_response({"url": f"/tap/{quote(key)}/"})

    async def _write_report(self, request: web.Request) -> web.Response:
        key, folder = self._find_machine(request)
        html = await asyncio.to_thread(_render_report, folder)
        await asyncio.to_thread(_release_memory)
        self._reports[key] = (secrets.token_urlsafe(24), html)
        return web.json_response({"url": f"/report/{quote(key)}/{self._reports[key][0]}"})

    async def _report(self, request: web.Request) -> web.Response:
        """Serve a report at a secret address, so that the browser can open it as a page."""
        key, html = self._reports.get(request.match_info["machine"], ("", ""))
        if not key or not secrets.compare_digest(key.encode(), request.match_info["key"].encode()):
            raise web.HTTPNotFound(
                text="this report is no longer available. Open the report again from the list of machines."
            )
        self.limiter.trust(request)
        return web.Response(text=html, content_type="text/html", headers={"Content-Security-Policy": REPORT_POLICY})


def _render_report(folder: MachineFolder) -> str:
    logbook = Logbook(folder)
    if not logbook.taps:
        raise DataError("there is no tap test yet. Press START.")
    newest = logbook.newest_tap()
    return render_report(logbook, newest.tool, newest.direction)
