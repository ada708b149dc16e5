"""Serve pages, live feeds and session routes from a thread."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
from collections.abc import Callable
from importlib import resources
from types import TracebackType
from typing import Protocol, Self, cast

import msgspec
from aiohttp import web

from acquisition import DeviceError, check_name
from lobewatch.screen.access_control import (
    HAS_FULL_ACCESS,
    PUBLIC_ROUTE_PREFIX,
    ConnectionLimiter,
    check_tokens,
    make_guarded_application,
    open_listener,
)
from lobewatch.screen.live_feed import (
    SHUTDOWN_EVENT,
    State,
    StateEncoder,
    StateSource,
    encode_curves,
    encode_cut_state,
    encode_plots,
    encode_tap_state,
    stream_states,
)
from lobewatch.show.terminal.tap_printer import RunningTest
from lobewatch.tap.cut_recording import CutState
from lobewatch.tap.state import StatePublisher, TapState

STATIC_CONTENT_TYPES = {"css": "text/css", "html": "text/html", "js": "text/javascript", "svg": "image/svg+xml"}
"""Content types of the files of pages, by the ending of their names."""


class WatchedTest(RunningTest, StateSource[TapState], Protocol):
    """A live tap test that pages follow."""


class ChoiceRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Body of the request that says what comes after a test."""

    key: str
    """Key of the choice."""
    tool: str = ""
    """Name of the next tool, where that is chosen."""


def add_pages(application: web.Application, pages: dict[str, str]) -> None:
    """Serve pages (path: file in static/) and, at /static/, all that they load.

    The files are held in memory: nothing of the disk can be asked for by name.
    """
    folder = resources.files("lobewatch.screen").joinpath("static")
    files = {
        file.name: file.read_bytes()
        for file in folder.iterdir()
        if file.name.rpartition(".")[2] in STATIC_CONTENT_TYPES
    }

    async def static(request: web.Request) -> web.Response:
        name = request.match_info["name"]
        if name not in files:
            raise web.HTTPNotFound(text="there is no such file")
        return _respond_with_file(files, name)

    application.router.add_get("/static/{name}", static, name=f"{PUBLIC_ROUTE_PREFIX}static")
    for i, (path, name) in enumerate(pages.items()):

        async def page(_: web.Request, name: str = name) -> web.Response:
            return _respond_with_file(files, name)

        application.router.add_get(path, page, name=f"{PUBLIC_ROUTE_PREFIX}page{i}")


def add_feed(
    application: web.Application,
    prefix: str,
    find: Callable[[web.Request], StateSource[State]],
    messages: StateEncoder[State],
) -> None:
    """Serve what is only watched. `find` raises HTTPNotFound where there is nothing."""

    async def follow(request: web.Request) -> web.StreamResponse:
        find(request)
        return await stream_states(request, lambda: find(request), messages)

    async def access(request: web.Request) -> web.Response:
        find(request)
        return web.json_response({"may_alter": request[HAS_FULL_ACCESS]})

    application.router.add_get(f"{prefix}feed", follow)
    application.router.add_get(f"{prefix}access", access)


def add_session(application: web.Application, prefix: str, find: Callable[[web.Request], WatchedTest]) -> None:
    """Serve the screen of a session: its feed, undo, stop and what comes next.

    `find` raises HTTPNotFound where there is none.
    """

    async def undo(request: web.Request) -> web.Response:
        await asyncio.to_thread(find(request).undo)
        return web.json_response({})

    async def stop(request: web.Request) -> web.Response:
        await asyncio.to_thread(find(request).stop)
        return web.json_response({})

    async def choose(request: web.Request) -> web.Response:
        try:
            choice = msgspec.json.decode(await request.read(), type=ChoiceRequest)
        except (msgspec.DecodeError, UnicodeDecodeError):
            raise web.HTTPBadRequest(text='the body must be like {"key": "y"}') from None
        check_name(choice.tool, "tool")
        find(request).choose(choice.key, choice.tool)
        return web.json_response({})

    add_feed(application, prefix, find, StateEncoder(encode_tap_state, encode_plots))
    application.router.add_post(f"{prefix}undo", undo)
    application.router.add_post(f"{prefix}stop", stop)
    application.router.add_post(f"{prefix}choose", choose)


def _respond_with_file(files: dict[str, bytes], name: str) -> web.Response:
    return web.Response(body=files[name], content_type=STATIC_CONTENT_TYPES[name.rpartition(".")[2]], charset="utf-8")


HTTP_LOG = logging.getLogger("lobewatch.screen.http")
"""Log of requests that are no HTTP, which goes nowhere: anybody could fill the operator's terminal."""
HTTP_LOG.addHandler(logging.NullHandler())
HTTP_LOG.propagate = False
WILDCARD_ADDRESSES = {
    "0.0.0.0": (socket.AF_INET, "192.0.2.1", "127.0.0.1"),
    "::": (socket.AF_INET6, "2001:db8::1", "::1"),
}
"""Names of all addresses of this computer: family, an address elsewhere, and its own where it has no network."""


class WebServerThread:
    """Base of the servers: `application` is served from __enter__ to __exit__; add its routes before."""

    def __init__(self, listen: str, port: int, token: str | None, watch_token: str | None = None) -> None:
        """ValueError for a token that does not fit into an address, and for no address to listen at."""
        if not listen:
            raise ValueError("no address to listen at; use 127.0.0.1 for this computer alone, 0.0.0.0 for the network")
        tokens = check_tokens(token, watch_token)
        self.token, self.watch_token = tokens.full, tokens.watch
        self._listen = listen.lower()
        self.limiter = ConnectionLimiter()
        """Door that lets connections in, and counts them."""
        self.application = make_guarded_application(tokens, self._listen, self.limiter)
        self._port = port
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="lobewatch screen", daemon=True)
        self._ready = threading.Event()
        self._error: Exception | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop = asyncio.Event()

    def __enter__(self) -> Self:
        """Listen; DeviceError where the address cannot be had."""
        self._thread.start()
        self._ready.wait()
        if self._error is not None:
            why = getattr(self._error, "strerror", None) or self._error
            raise DeviceError(
                f"cannot listen on {self._listen} port {self._port} ({why})", "choose another port or address"
            ) from self._error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Send the last state to every page that still listens, then close."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()

    @property
    def origin(self) -> str:
        """Address without the token, e.g. http://127.0.0.1:40123."""
        host = _find_own_address(self._listen) if self._listen in WILDCARD_ADDRESSES else self._listen
        return f"http://{f'[{host}]' if ':' in host else host}:{self._port}"

    @property
    def url(self) -> str:
        """Address with the token behind #, which browsers keep to themselves."""
        return f"{self.origin}/#token={self.token}"

    @property
    def watch_url(self) -> str:
        """Address for who may only watch."""
        return f"{self.origin}/#token={self.watch_token}"

    async def _serve(self) -> None:
        self.application[SHUTDOWN_EVENT] = asyncio.Event()
        self.application.on_shutdown.append(_signal_shutdown)
        runner = web.AppRunner(self.application, access_log=None, logger=HTTP_LOG, shutdown_timeout=2.0)
        try:
            await runner.setup()
            listener = open_listener(self._listen, self._port)
        except (OSError, ValueError) as error:  # ValueError: a name that no network can have
            self._error = error
            self._ready.set()
        else:
            with listener:
                await self._accept(listener, cast(web.Server, runner.server))
        await runner.cleanup()

    async def _accept(self, listener: socket.socket, server: web.Server) -> None:
        self._port = listener.getsockname()[1]
        self._loop = asyncio.get_running_loop()
        serving = self._loop.create_task(self.limiter.serve(listener, server))
        self._ready.set()
        await self._stop.wait()
        serving.cancel()
        await asyncio.wait([serving])


async def _signal_shutdown(application: web.Application) -> None:
    application[SHUTDOWN_EVENT].set()


def _find_own_address(listen: str) -> str:
    """Address of this computer in its network; nothing is sent for it."""
    family, far_away, alone = WILDCARD_ADDRESSES[listen]
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((far_away, 9))
            return str(probe.getsockname()[0])
    except OSError:
        return alone


class ScreenServer(WebServerThread):
    """Serves the screen of a tap test from __enter__ to __exit__, in a thread of its own.

    The session is only asked for its newest state, at most 20 times a second and page: it never waits for a screen.
    Whoever has `url` may watch, undo and stop, whoever has `watch_url` only watch; without a token nothing can be seen.
    """

    def __init__(
        self,
        session: WatchedTest,
        *,
        listen: str = "127.0.0.1",
        port: int = 0,
        token: str | None = None,
        watch_token: str | None = None,
    ) -> None:
        """Port 0: any free one. Token None: a new one. ValueError for a token that does not fit into an address."""
        super().__init__(listen, port, token, watch_token)
        add_pages(self.application, {"/": "screen.html"})
        add_session(self.application, "/", lambda _: session)


class CutScreenServer(WebServerThread):
    """Serves the screen of a cut that is listened to, likewise: nothing of it can be altered from a page."""

    def __init__(
        self,
        pictures: StatePublisher[CutState],
        *,
        listen: str = "127.0.0.1",
        token: str | None = None,
        watch_token: str | None = None,
    ) -> None:
        """At any free port. Token None: a new one. ValueError for a token that does not fit into an address."""
        super().__init__(listen, 0, token, watch_token)
        add_pages(self.application, {"/": "listen.html"})
        add_feed(self.application, "/", lambda _: pictures, StateEncoder(encode_cut_state, encode_curves))
