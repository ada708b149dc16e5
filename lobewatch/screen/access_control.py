"""Limit connections and check host, origin and token of every request.

Without a limit, anyone who reaches the port could use up the descriptors of the process. Then a running tap test could
neither store a hit nor reopen the device.
"""

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
from aiohttp.typedefs import Handler
from yarl import URL

from acquisition.errors import format_error
from lobewatch.show.terminal.option_names import with_option_names

MAX_CONNECTIONS = 64
"""Number of open connections at most."""
MAX_ANONYMOUS_PER_NETWORK = 8
"""Number of connections without a token from one network at most. A browser opens six and one for the feed."""
REQUEST_HEAD_TIMEOUT = 10.0
"""Time for a request head or a response without a token (s)."""
IDLE_TIMEOUT = 75.0
"""Time between two requests of a connection with a token (s)."""
RESERVED_DESCRIPTORS = 64
"""Number of descriptors reserved for the disk and the device."""
UNLIMITED_DESCRIPTORS = 1 << 20
"""Number of descriptors if the system has no limit."""
ACCEPT_INTERVAL = 0.002
"""Time between two accepted connections, and between two responses without a token (s). It slows a flood down."""
LISTEN_BACKLOG = 128
"""Number of connections that wait in the system."""
PUBLIC_ROUTE_PREFIX = "open-"
"""Prefix of the names of routes without a token. They must not reveal or change anything."""
WATCH_ROUTE_PREFIX = "watch-"
"""Prefix of the names of routes that change nothing, although their method is not GET."""
HAS_FULL_ACCESS = web.RequestKey("HAS_FULL_ACCESS", bool)
"""Key of a request: True if it has the full token."""
RESPONSE_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_log = logging.getLogger(__name__)


@dataclass(eq=False)
class ClientConnection:
    """Connection of a client."""

    socket: socket.socket
    """Socket of the connection. Its number is negative after the transport has closed it."""
    network: str
    """Address or network of the client; connections are counted by it."""
    transport: asyncio.Transport
    """Transport of the connection."""
    has_token: bool = False
    """True if the client has shown a valid token."""
    timer: asyncio.TimerHandle | None = None
    """Timer that closes the connection. None while a request is answered."""

    @property
    def is_open(self) -> bool:
        """True if the connection still has a descriptor."""
        return self.socket.fileno() >= 0

    def start_timer(self) -> None:
        """Close the connection unless the next request or the end of the response comes in time."""
        self.stop_timer()
        patience = IDLE_TIMEOUT if self.has_token else REQUEST_HEAD_TIMEOUT
        self.timer = asyncio.get_running_loop().call_later(patience, self.transport.abort)

    def stop_timer(self) -> None:
        """Stop the timer while a request is answered."""
        if self.timer is not None:
            self.timer.cancel()
        self.timer = None


class ConnectionLimiter:
    """Accepts a limited number of connections for a web application, in one event loop."""

    def __init__(self) -> None:
        """Start without connections."""
        self._connections: list[ClientConnection] = []
        self._anonymous_lock = asyncio.Lock()

    @property
    def connection_count(self) -> int:
        """Number of open connections."""
        return sum(client.is_open for client in self._connections)

    async def serve(self, listener: socket.socket, server: web.Server) -> None:
        """Accept connections until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, address = await loop.sock_accept(listener)
            except OSError:  # the client is gone, or no descriptor is left
                await asyncio.sleep(10 * ACCEPT_INTERVAL)
                continue
            network = get_client_network(address[0])
            if self._can_accept(connection, network):
                transport, _ = await loop.connect_accepted_socket(server, connection)
                client = ClientConnection(connection, network, transport)
                client.start_timer()
                self._connections.append(client)
            else:
                connection.close()
            await asyncio.sleep(ACCEPT_INTERVAL)

    @contextlib.asynccontextmanager
    async def hold_connection(self, request: web.Request) -> AsyncIterator[None]:
        """Keep a connection open while its request is answered. Requests without a token wait in turn."""
        client = self._find_connection(request)
        if client is None:
            yield
            return
        client.stop_timer()
        try:
            if not client.has_token:
                async with self._anonymous_lock:
                    await asyncio.sleep(ACCEPT_INTERVAL)
            yield
        finally:
            client.start_timer()

    def trust(self, request: web.Request) -> None:
        """Mark the connection of a request as one with a valid token."""
        client = self._find_connection(request)
        if client is not None:
            client.has_token = True

    def _find_connection(self, request: web.Request) -> ClientConnection | None:
        return next((client for client in self._connections if client.transport is request.transport), None)

    def _can_accept(self, connection: socket.socket, network: str) -> bool:
        """Return whether to accept a connection. The oldest idle connection without a token may be dropped for it."""
        self._connections = [client for client in self._connections if client.is_open]
        if connection.fileno() >= _max_descriptors() - RESERVED_DESCRIPTORS:  # the system gives the lowest number
            return False
        anonymous = [client for client in self._connections if not client.has_token]
        anonymous.sort(key=lambda client: client.timer is None)
        same_network = [client for client in anonymous if client.network == network]
        if len(same_network) >= MAX_ANONYMOUS_PER_NETWORK:
            self._drop_connection(same_network[0])
        elif len(self._connections) >= MAX_CONNECTIONS and anonymous:
            self._drop_connection(anonymous[0])
        return len(self._connections) < MAX_CONNECTIONS

    def _drop_connection(self, client: ClientConnection) -> None:
        client.stop_timer()
        client.transport.abort()
        self._connections.remove(client)


def get_client_network(host: str) -> str:
    """Return an IPv4 address, or the 64-bit network of an IPv6 address, which one computer may own."""
    address = ipaddress.ip_address(host.partition("%")[0])
    return str(address) if address.version == 4 else str(ipaddress.ip_network((address, 64), strict=False))


def open_listener(host: str, port: int) -> socket.socket:
    """Open a socket that listens at an address of this computer. OSError or ValueError if that fails."""
    family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    listener = socket.create_server((str(address[0]), int(address[1])), family=family, backlog=LISTEN_BACKLOG)
    listener.setblocking(False)
    return listener


def _max_descriptors() -> int:
    """Return the number of descriptors that this process may open."""
    if sys.platform == "win32":
        return UNLIMITED_DESCRIPTORS
    import resource

    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return limit if limit != resource.RLIM_INFINITY else UNLIMITED_DESCRIPTORS


AccessTokens = tuple[str, str]
"""Token for full access and token for read-only access. A browser must send one of them."""


def check_tokens(full: str | None, watch: str | None) -> AccessTokens:
    """Check both tokens, or make them for None. ValueError for equal or invalid tokens."""
    tokens = [secrets.token_urlsafe(24) if token is None else token for token in (full, watch)]
    if not all(re.fullmatch(r"[A-Za-z0-9_-]{12,200}", token) for token in tokens):
        raise ValueError(
            "a token has 12 to 200 characters of A-Z, a-z, 0-9, _ and -. Leave out the token for a random token."
        )
    if tokens[0] == tokens[1]:
        raise ValueError("both tokens are equal. Give two different tokens, or leave out one token.")
    return tokens[0], tokens[1]


def make_guarded_application(tokens: AccessTokens, listen: str, limiter: ConnectionLimiter) -> web.Application:
    """Make an application that serves only its own pages, needs a token, and needs the full token for changes."""

    @web.middleware
    async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
        async with limiter.hold_connection(request):
            try:
                _check_host(request, listen)
                _check_origin(request)
                name = request.match_info.route.name or ""
                if not name.startswith(PUBLIC_ROUTE_PREFIX):
                    changes = request.method != "GET" and not name.startswith(WATCH_ROUTE_PREFIX)
                    _check_request_token(request, tokens, changes)
                    limiter.trust(request)
                return await handler(request)
            except web.HTTPException as error:
                return _respond_with_error(error.text or error.reason, error.status)
            except (ValueError, OSError) as error:
                return _respond_with_error(format_error(error), 409)
            except Exception:  # noqa: BLE001 - the traceback goes to the log, not to the page
                _log.exception("%s %s failed", request.method, request.path)
                return _respond_with_error("lobewatch has failed. See the terminal of lobewatch for the error.", 500)

    application = web.Application(middlewares=[guard], client_max_size=4096)
    application.on_response_prepare.append(_add_headers)
    return application


def _respond_with_error(text: str, status: int) -> web.Response:
    return web.json_response({"error": with_option_names(text)}, status=status)


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    for name, value in RESPONSE_HEADERS.items():
        response.headers.setdefault(name, value)


def _check_host(request: web.Request, listen: str) -> None:
    """Reject a host name that is neither numeric nor our own, against DNS rebinding."""
    try:
        host = URL(f"http://{request.host}").host or ""
        if host not in ("localhost", listen):
            ipaddress.ip_address(host)
    except ValueError:
        raise web.HTTPForbidden(text="unknown host name. Use the address that lobewatch printed.") from None


def _check_origin(request: web.Request) -> None:
    """Reject requests of other pages. Changes and feeds must come from our own page."""
    origin = request.headers.get("Origin")
    needs_origin = request.method != "GET" or "Upgrade" in request.headers
    if origin != f"http://{request.host}" and (needs_origin or origin is not None):
        raise web.HTTPForbidden(text="this request does not come from a lobewatch page")


def _check_request_token(request: web.Request, tokens: AccessTokens, changes: bool) -> None:
    """Reject a request without a token in its Authorization header or, for a WebSocket, in its protocols."""
    given = [request.headers.get("Authorization", "").removeprefix("Bearer ")]
    protocols = request.headers.get("Sec-WebSocket-Protocol", "").split(",")
    given += [name.strip().removeprefix("token.") for name in protocols]
    request[HAS_FULL_ACCESS], can_watch = (_matches_any(given, token) for token in tokens)
    if not (request[HAS_FULL_ACCESS] or can_watch):
        raise web.HTTPUnauthorized(text="no valid token. Open the complete address that lobewatch printed.")
    if changes and not request[HAS_FULL_ACCESS]:
        raise web.HTTPForbidden(text="this address is read-only. Open the full-access address that lobewatch printed.")


def _matches_any(given: list[str], token: str) -> bool:
    return any(hmac.compare_digest(word.encode("utf-8", "surrogateescape"), token.encode()) for word in given)
