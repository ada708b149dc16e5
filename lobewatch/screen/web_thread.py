"""A web application in a thread of its own."""

from __future__ import annotations

import asyncio
import logging
import socket
import threading
from types import TracebackType
from typing import Self, cast

from aiohttp import web

from acquisition import DeviceError
from lobewatch.screen.door import Door, open_port
from lobewatch.screen.feed import ENDING
from lobewatch.screen.guard import checked_tokens, guarded_application

QUIET = logging.getLogger("lobewatch.screen.http")
"""Log of requests that are no HTTP, which goes nowhere: anybody could fill the operator's terminal."""
QUIET.addHandler(logging.NullHandler())
QUIET.propagate = False
FAR_AWAY = {
    "0.0.0.0": (socket.AF_INET, "192.0.2.1", "127.0.0.1"),
    "::": (socket.AF_INET6, "2001:db8::1", "::1"),
}
"""Names of all addresses of this computer: family, an address elsewhere, and its own where it has no network."""


class WebThread:
    """Base of the servers: `application` is served from __enter__ to __exit__; add its routes before."""

    def __init__(self, listen: str, port: int, token: str | None, watch_token: str | None = None) -> None:
        """ValueError for a token that does not fit into an address, and for no address to listen at."""
        if not listen:
            raise ValueError("no address to listen at; use 127.0.0.1 for this computer alone, 0.0.0.0 for the network")
        tokens = checked_tokens(token, watch_token)
        self.token, self.watch_token = tokens.full, tokens.watch
        self._listen = listen.lower()
        self.door = Door()
        """Door that lets connections in, and counts them."""
        self.application = guarded_application(tokens, self._listen, self.door)
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
        host = _own_address(self._listen) if self._listen in FAR_AWAY else self._listen
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
        self.application[ENDING] = asyncio.Event()
        self.application.on_shutdown.append(_end)
        runner = web.AppRunner(self.application, access_log=None, logger=QUIET, shutdown_timeout=2.0)
        try:
            await runner.setup()
            listener = open_port(self._listen, self._port)
        except (OSError, ValueError) as error:  # ValueError: a name that no network can have
            self._error = error
            self._ready.set()
        else:
            with listener:
                await self._let_in(listener, cast(web.Server, runner.server))
        await runner.cleanup()

    async def _let_in(self, listener: socket.socket, server: web.Server) -> None:
        self._port = listener.getsockname()[1]
        self._loop = asyncio.get_running_loop()
        serving = self._loop.create_task(self.door.serve(listener, server))
        self._ready.set()
        await self._stop.wait()
        serving.cancel()
        await asyncio.wait([serving])


async def _end(application: web.Application) -> None:
    application[ENDING].set()


def _own_address(listen: str) -> str:
    """Address of this computer in its network; nothing is sent for it."""
    family, far_away, alone = FAR_AWAY[listen]
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((far_away, 9))
            return str(probe.getsockname()[0])
    except OSError:
        return alone
