"""Limit connections and check host, origin and token of every request.

Whoever can reach the port could otherwise open connections until the process has no descriptors left, and the tap test
that runs in it could neither write a hit nor open the device again.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import ipaddress
import logging
import re
import secrets
import socket
import sys
from collections.abc import AsyncIterator
from dataclasses import dataclass

from aiohttp import web
from aiohttp.typedefs import Handler, Middleware
from yarl import URL

from acquisition.errors import format_error

MAX_CONNECTIONS = 64
"""Number of connections at a time."""
MAX_ANONYMOUS_PER_NETWORK = 8
"""Number of them from one address that have not shown a token; a browser opens six, and one for the feed."""
REQUEST_HEAD_TIMEOUT = 10.0
"""Time that a stranger may take for the head of a request, and to take the answer (s)."""
IDLE_TIMEOUT = 75.0
"""Time that whoever has shown a token may be silent between two requests (s)."""
RESERVED_DESCRIPTORS = 64
"""Number of descriptors that stay free for the disk and the device, whatever knocks."""
UNLIMITED_DESCRIPTORS = 1 << 20
"""Number of descriptors where the system names no limit."""
ACCEPT_INTERVAL = 0.002
"""Time between two connections that are let in, and between two answers to strangers (s): a flood of them costs
little, and a page needs seven."""
LISTEN_BACKLOG = 128
"""Number of connections that wait in the system to be let in."""


@dataclass(eq=False)
class ClientConnection:
    """One connection."""

    socket: socket.socket
    """Socket of the connection, closed by its transport; its number is negative then."""
    network: str
    """Address or network that it comes from; connections are counted by this."""
    transport: asyncio.Transport
    """Transport of the connection."""
    has_token: bool = False
    """Whether it has shown a token."""
    timer: asyncio.TimerHandle | None = None
    """Timer that hangs up; None while a request is answered."""

    @property
    def is_open(self) -> bool:
        """Whether it still holds a descriptor."""
        return self.socket.fileno() >= 0

    def start_timer(self) -> None:
        """Hang up where it is not heard, or has not taken its answer, in time."""
        self.stop_timer()
        patience = IDLE_TIMEOUT if self.has_token else REQUEST_HEAD_TIMEOUT
        self.timer = asyncio.get_running_loop().call_later(patience, self.transport.abort)

    def stop_timer(self) -> None:
        """Stop the timer: it is being answered, which may take as long as it takes."""
        if self.timer is not None:
            self.timer.cancel()
        self.timer = None


class ConnectionLimiter:
    """Lets connections in to a web application; to be used in one event loop."""

    def __init__(self) -> None:
        """Nobody is in."""
        self._connections: list[ClientConnection] = []
        self._anonymous_lock = asyncio.Lock()

    @property
    def connection_count(self) -> int:
        """Number of connections."""
        return sum(guest.is_open for guest in self._connections)

    async def serve(self, listener: socket.socket, server: web.Server) -> None:
        """Let in whoever comes, until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, address = await loop.sock_accept(listener)
            except OSError:  # it has gone already, or there is no descriptor for it
                await asyncio.sleep(10 * ACCEPT_INTERVAL)
                continue
            place = get_client_network(address[0])
            if self._can_accept(connection, place):
                transport, _ = await loop.connect_accepted_socket(server, connection)
                guest = ClientConnection(connection, place, transport)
                guest.start_timer()
                self._connections.append(guest)
            else:
                connection.close()
            await asyncio.sleep(ACCEPT_INTERVAL)

    @contextlib.asynccontextmanager
    async def hold_connection(self, request: web.Request) -> AsyncIterator[None]:
        """Keep the connection of a request while that is answered; strangers are answered one after the other."""
        guest = self._find_connection(request)
        if guest is None:
            yield
            return
        guest.stop_timer()
        try:
            if not guest.has_token:
                async with self._anonymous_lock:
                    await asyncio.sleep(ACCEPT_INTERVAL)
            yield
        finally:
            guest.start_timer()

    def trust(self, request: web.Request) -> None:
        """Note that whoever sent this has shown a token."""
        guest = self._find_connection(request)
        if guest is not None:
            guest.has_token = True

    def _find_connection(self, request: web.Request) -> ClientConnection | None:
        return next((guest for guest in self._connections if guest.transport is request.transport), None)

    def _can_accept(self, connection: socket.socket, place: str) -> bool:
        """Whether one more may come in; for it, the one that has been silent longest without a token may have to go."""
        self._connections = [guest for guest in self._connections if guest.is_open]
        if connection.fileno() >= _max_descriptors() - RESERVED_DESCRIPTORS:  # numbers are given lowest first
            return False
        strangers = [guest for guest in self._connections if not guest.has_token]
        strangers.sort(key=lambda guest: guest.timer is None)
        near = [guest for guest in strangers if guest.network == place]
        if len(near) >= MAX_ANONYMOUS_PER_NETWORK:
            self._drop_connection(near[0])
        elif len(self._connections) >= MAX_CONNECTIONS and strangers:
            self._drop_connection(strangers[0])
        return len(self._connections) < MAX_CONNECTIONS

    def _drop_connection(self, guest: ClientConnection) -> None:
        guest.stop_timer()
        guest.transport.abort()
        self._connections.remove(guest)


def get_client_network(host: str) -> str:
    """IPv4 address, or the network of 64 bits of an IPv6 address: one computer may have all of its addresses."""
    address = ipaddress.ip_address(host.partition("%")[0])
    return str(address) if address.version == 4 else str(ipaddress.ip_network((address, 64), strict=False))


def open_listener(host: str, port: int) -> socket.socket:
    """A socket that listens at an address of this computer; OSError or ValueError where it cannot be had."""
    family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    listener = socket.create_server((str(address[0]), int(address[1])), family=family, backlog=LISTEN_BACKLOG)
    listener.setblocking(False)
    return listener


def _max_descriptors() -> int:
    """Number of descriptors that this process may have."""
    if sys.platform == "win32":
        return UNLIMITED_DESCRIPTORS
    import resource

    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return limit if limit != resource.RLIM_INFINITY else UNLIMITED_DESCRIPTORS


PUBLIC_ROUTE_PREFIX = "open-"
"""Beginning of the name of a route that answers without a token; it must neither tell nor alter anything."""
WATCH_ROUTE_PREFIX = "watch-"
"""Beginning of the name of a route that alters nothing although it is not asked by GET."""
HAS_FULL_ACCESS = web.RequestKey("HAS_FULL_ACCESS", bool)
"""Whether the token of a request is the full one."""
RESPONSE_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_log = logging.getLogger(__name__)


def check_token(token: str | None) -> str:
    """Token that fits into an address and a header; a new one for None. ValueError for one that does not fit."""
    if token is None:
        return secrets.token_urlsafe(24)
    if not re.fullmatch(r"[A-Za-z0-9_-]{12,200}", token):
        raise ValueError("the token must be 12 to 200 characters of A-Z, a-z, 0-9, _ and -; leave it out for a new one")
    return token


@dataclass(frozen=True)
class AccessTokens:
    """Tokens, one of which a browser must know."""

    full: str
    """Token to see and alter."""
    watch: str
    """Token only to see."""


def check_tokens(full: str | None, watch: str | None) -> AccessTokens:
    """Both tokens, each a new one for None. ValueError for one that does not fit into an address, and for one twice."""
    tokens = AccessTokens(check_token(full), check_token(watch))
    if tokens.full == tokens.watch:
        raise ValueError("the token to watch is the full one too; give two different ones, or leave one out")
    return tokens


def make_guarded_application(tokens: AccessTokens, listen: str, door: ConnectionLimiter) -> web.Application:
    """Application that answers only to its own page, tells nothing without a token, alters nothing without the
    full one."""
    application = web.Application(
        middlewares=[_make_timer_middleware(door), _make_access_middleware(tokens, listen, door)], client_max_size=4096
    )
    application.on_response_prepare.append(_add_headers)
    return application


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    for name, value in RESPONSE_HEADERS.items():
        response.headers.setdefault(name, value)


def _make_timer_middleware(door: ConnectionLimiter) -> Middleware:
    @web.middleware
    async def attend(request: web.Request, handler: Handler) -> web.StreamResponse:
        """Answer a request whose head has come; its connection is not hung up before."""
        async with door.hold_connection(request):
            return await handler(request)

    return attend


def _make_access_middleware(tokens: AccessTokens, listen: str, door: ConnectionLimiter) -> Middleware:
    @web.middleware
    async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            _check_host(request, listen)
            _check_origin(request)
            name = request.match_info.route.name or ""
            if not name.startswith(PUBLIC_ROUTE_PREFIX):
                _check_request_token(
                    request, tokens, alters=request.method != "GET" and not name.startswith(WATCH_ROUTE_PREFIX)
                )
                door.trust(request)
            return await handler(request)
        except web.HTTPException as refusal:
            return web.json_response({"error": refusal.text or refusal.reason}, status=refusal.status)
        except (ValueError, OSError) as error:
            return web.json_response({"error": format_error(error)}, status=409)
        except Exception:  # noqa: BLE001 - the page must not see a traceback, the log must
            _log.exception("%s %s failed", request.method, request.path)
            return web.json_response({"error": "lobewatch failed here; see its terminal"}, status=500)

    return guard


def _check_host(request: web.Request, listen: str) -> None:
    """Refuse a host that is no address in figures and not our own name: it may be another page's trick."""
    try:
        host = URL(f"http://{request.host}").host or ""
    except ValueError:
        host = ""
    if host not in ("localhost", listen):
        try:
            ipaddress.ip_address(host)
        except ValueError:
            raise web.HTTPForbidden(text="this host name is not ours; use the address that lobewatch printed") from None


def _check_origin(request: web.Request) -> None:
    """Refuse what comes from another page; what alters something or opens a feed must come from our own."""
    origin = request.headers.get("Origin")
    must = request.method != "GET" or "Upgrade" in request.headers
    if origin != f"http://{request.host}" and (must or origin is not None):
        raise web.HTTPForbidden(text="this request does not come from lobewatch's own page")


def _check_request_token(request: web.Request, tokens: AccessTokens, alters: bool) -> None:
    """Refuse without a token in the header Authorization, or for a WebSocket, which has none, among its protocols."""
    given = [request.headers.get("Authorization", "").removeprefix("Bearer ")]
    protocols = request.headers.get("Sec-WebSocket-Protocol", "").split(",")
    given += [name.strip().removeprefix("token.") for name in protocols]
    request[HAS_FULL_ACCESS] = _matches_any(given, tokens.full)
    if not request[HAS_FULL_ACCESS] and not _matches_any(given, tokens.watch):
        raise web.HTTPUnauthorized(text="open the whole address that lobewatch printed, with its token")
    if alters and not request[HAS_FULL_ACCESS]:
        raise web.HTTPForbidden(text="this address is only to watch; open the other one that lobewatch printed")


def _matches_any(given: list[str], token: str) -> bool:
    return any(hmac.compare_digest(word.encode("utf-8", "surrogateescape"), token.encode()) for word in given)
