"""Serve pages, live feeds and session routes from a thread."""

import asyncio
import contextlib
import logging
import socket
import threading
from collections.abc import Callable
from concurrent.futures import Future
from importlib import resources
from typing import Protocol, Self, TypedDict, TypeVar, Unpack, cast

import msgspec
from aiohttp import web

from acquisition import DeviceError, check_name
from lobewatch.screen import access_control, live_feed
from lobewatch.show.terminal.terminal_screen import RunningTest
from lobewatch.tap.cut_recording import CutState
from lobewatch.tap.state import StatePublisher, TapState

STATIC_CONTENT_TYPES = {"css": "text/css", "html": "text/html", "js": "text/javascript", "svg": "image/svg+xml"}
"""Content types of static files, by extension."""
HTTP_LOG = logging.getLogger("lobewatch.screen.http")
"""Log of requests that are not HTTP. It is discarded, so that a client cannot fill the terminal."""
HTTP_LOG.addHandler(logging.NullHandler())
HTTP_LOG.propagate = False
WILDCARD_ADDRESSES = {
    "0.0.0.0": (socket.AF_INET, "192.0.2.1", "127.0.0.1"),
    "::": (socket.AF_INET6, "2001:db8::1", "::1"),
}
"""Wildcard addresses: family, an address elsewhere, and the own address without a network."""
Body = TypeVar("Body")


class WatchedTest(RunningTest, live_feed.StateSource[TapState], Protocol):
    """Live tap test that pages follow."""


class ChoiceRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Body of the request that chooses the next step after a test."""

    key: str
    """Key of the choice."""
    tool: str = ""
    """Name of the next tool, if that is chosen."""


class HitRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Body of the request that accepts or rejects a hit."""

    hit: int
    """Number of the hit, from 1."""
    accept: bool
    """True to accept the hit, False to reject it."""


def add_pages(application: web.Application, pages: dict[str, str]) -> None:
    """Serve pages (path: file in static/) and all static files at /static/, from memory."""
    folder = resources.files("lobewatch.screen").joinpath("static")
    static_files = [file for file in folder.iterdir() if file.name.rpartition(".")[2] in STATIC_CONTENT_TYPES]
    files = {file.name: file.read_bytes() for file in static_files}

    def respond(name: str) -> web.Response:
        content_type = STATIC_CONTENT_TYPES[name.rpartition(".")[2]]
        return web.Response(body=files[name], content_type=content_type, charset="utf-8")

    async def static(request: web.Request) -> web.Response:
        name = request.match_info["name"]
        if name not in files:
            raise web.HTTPNotFound(text="this file does not exist")
        return respond(name)

    application.router.add_get("/static/{name}", static, name=f"{access_control.PUBLIC_ROUTE_PREFIX}static")
    for i, (path, name) in enumerate(pages.items()):

        async def page(_: web.Request, name: str = name) -> web.Response:
            return respond(name)

        application.router.add_get(path, page, name=f"{access_control.PUBLIC_ROUTE_PREFIX}page{i}")


def add_feed(
    application: web.Application,
    prefix: str,
    find: Callable[[web.Request], live_feed.StateSource[live_feed.State]],
    encoder: live_feed.StateEncoder[live_feed.State],
) -> None:
    """Serve the feed of a source. `find` raises HTTPNotFound if there is none."""

    async def follow(request: web.Request) -> web.StreamResponse:
        find(request)
        return await live_feed.stream_states(request, lambda: find(request), encoder)

    async def access(request: web.Request) -> web.Response:
        find(request)
        return web.json_response({"may_alter": request[access_control.HAS_FULL_ACCESS]})

    application.router.add_get(f"{prefix}feed", follow)
    application.router.add_get(f"{prefix}access", access)


def add_session(application: web.Application, prefix: str, find: Callable[[web.Request], WatchedTest]) -> None:
    """Serve the screen of a tap test: feed and all requests. `find` raises HTTPNotFound if there is none."""

    async def undo_or_stop(request: web.Request) -> web.Response:
        await asyncio.to_thread(getattr(find(request), request.path.rpartition("/")[2]))
        return web.json_response({})

    async def choose(request: web.Request) -> web.Response:
        choice = await read_body(request, ChoiceRequest, 'the request body must be like {"key": "y"}')
        check_name(choice.tool, "tool")
        find(request).choose(choice.key, choice.tool)
        return web.json_response({})

    async def decide(request: web.Request) -> web.Response:
        wish = await read_body(request, HitRequest, 'the request body must be like {"hit": 3, "accept": true}')
        find(request).decide(wish.hit, accept=wish.accept)
        return web.json_response({})

    add_feed(application, prefix, find, live_feed.StateEncoder(live_feed.encode_tap_state, live_feed.encode_plots))
    actions = {"undo": undo_or_stop, "stop": undo_or_stop, "choose": choose, "decide": decide}
    for name, action in actions.items():
        application.router.add_post(f"{prefix}{name}", action)


async def read_body(request: web.Request, kind: type[Body], hint: str) -> Body:
    """Decode the JSON body of a request. HTTPBadRequest with a hint if it is of another type."""
    try:
        return msgspec.json.decode(await request.read(), type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError):
        raise web.HTTPBadRequest(text=hint) from None


class ServerOptions(TypedDict, total=False):
    """Options of a server."""

    listen: str
    """Address of this computer to listen at. Default: 127.0.0.1."""
    port: int
    """Port of the pages. Default: 0, any free one."""
    token: str | None
    """Token for full access, 12 to 200 characters of A-Z, a-z, 0-9, _ and -. Default: random."""
    watch_token: str | None
    """Token for read-only access. Default: random."""


class WebServerThread:
    """Thread that serves `application` while its context lasts. Add the routes before."""

    def __init__(
        self, listen: str = "127.0.0.1", port: int = 0, token: str | None = None, watch_token: str | None = None
    ) -> None:
        """Prepare the server. ValueError for an invalid token or an empty address."""
        if not listen:
            raise ValueError("no address to listen at. Give 127.0.0.1 for this computer only, 0.0.0.0 for the network.")
        tokens = access_control.check_tokens(token, watch_token)
        self.token, self.watch_token = tokens
        self._listen = listen.lower()
        self.limiter = access_control.ConnectionLimiter()
        """Limiter that accepts and counts connections."""
        self.application = access_control.make_guarded_application(tokens, self._listen, self.limiter)
        self._port = port
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="lobewatch screen", daemon=True)
        self._loop = Future[asyncio.AbstractEventLoop]()
        self._stop = asyncio.Event()

    def __enter__(self) -> Self:
        """Start to serve. DeviceError if the address is not available."""
        self._thread.start()
        try:
            self._loop.result()
        except (OSError, ValueError) as error:
            text = f"cannot listen on {self._listen} port {self._port} ({getattr(error, 'strerror', None) or error})"
            raise DeviceError(text, "Choose another port or address") from error
        return self

    def __exit__(self, *error: object) -> None:
        """Send the last state to every page, then close."""
        self._loop.result().call_soon_threadsafe(self._stop.set)
        self._thread.join()

    @property
    def origin(self) -> str:
        """Address without the token, such as http://127.0.0.1:40123."""
        host = _find_own_address(self._listen) if self._listen in WILDCARD_ADDRESSES else self._listen
        return f"http://{f'[{host}]' if ':' in host else host}:{self._port}"

    @property
    def url(self) -> str:
        """Address with the full token after #, which browsers do not send."""
        return f"{self.origin}/#token={self.token}"

    @property
    def watch_url(self) -> str:
        """Address with the read-only token."""
        return f"{self.origin}/#token={self.watch_token}"

    async def _serve(self) -> None:
        self.application[live_feed.SHUTDOWN_EVENT] = asyncio.Event()

        async def signal_shutdown(application: web.Application) -> None:
            application[live_feed.SHUTDOWN_EVENT].set()

        self.application.on_shutdown.append(signal_shutdown)
        runner = web.AppRunner(self.application, access_log=None, logger=HTTP_LOG, shutdown_timeout=2.0)
        try:
            await runner.setup()
            listener = access_control.open_listener(self._listen, self._port)
        except (OSError, ValueError) as error:  # ValueError: a name that no network can have
            self._loop.set_exception(error)
        else:
            with listener:
                await self._accept(listener, cast(web.Server, runner.server))
        await runner.cleanup()

    async def _accept(self, listener: socket.socket, server: web.Server) -> None:
        self._port = listener.getsockname()[1]
        serving = asyncio.create_task(self.limiter.serve(listener, server))
        self._loop.set_result(asyncio.get_running_loop())
        await self._stop.wait()
        with contextlib.suppress(NotImplementedError):  # Windows closes what it accepts when cancelled
            asyncio.get_running_loop().remove_reader(listener)
        await asyncio.sleep(0)  # serve takes a connection that was accepted in this turn, or nobody would close it
        serving.cancel()
        await asyncio.wait([serving])


def _find_own_address(listen: str) -> str:
    """Find the address of this computer in its network, without sending anything."""
    family, remote, fallback = WILDCARD_ADDRESSES[listen]
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((remote, 9))
            return str(probe.getsockname()[0])
    except OSError:
        return fallback


class ScreenServer(WebServerThread):
    """Server of the screen of a tap test, in a thread of its own while its context lasts.

    The server reads the newest state at most 20 times a second for each page, so the test never waits for a screen.
    `url` gives full access: watch, undo and stop. `watch_url` is read-only. Without a token nothing is visible.
    """

    def __init__(self, session: WatchedTest, **options: Unpack[ServerOptions]) -> None:
        """Prepare the server.

        Parameters
        ----------
        session
            Live tap test.
        options
            Address, port and tokens as in `ServerOptions`. ValueError for an invalid token.
        """
        super().__init__(**options)
        add_pages(self.application, {"/": "screen.html"})
        add_session(self.application, "/", lambda _: session)


class CutScreenServer(WebServerThread):
    """Read-only server of the screen of a cut recording, in a thread of its own while its context lasts."""

    def __init__(self, pictures: StatePublisher[CutState], **options: Unpack[ServerOptions]) -> None:
        """Prepare the server.

        Parameters
        ----------
        pictures
            Publisher of the states of the recording.
        options
            Address, port and tokens as in `ServerOptions`. ValueError for an invalid token.
        """
        super().__init__(**options)
        add_pages(self.application, {"/": "listen.html"})
        encoder = live_feed.StateEncoder(live_feed.encode_cut_state, live_feed.encode_curves)
        add_feed(self.application, "/", lambda _: pictures, encoder)
