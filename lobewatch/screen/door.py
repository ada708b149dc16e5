"""How many connections there may be at a time, and how long each may keep the server waiting.

Whoever can reach the port could otherwise open connections until the process has no descriptors left, and the tap test
that runs in it could neither write a hit nor open the device again.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import socket
import sys
from collections.abc import AsyncIterator
from dataclasses import dataclass

from aiohttp import web

MOST = 64
"""Number of connections at a time."""
STRANGERS = 8
"""Number of them from one address that have not shown a token; a browser opens six, and one for the feed."""
HEAD_TIME = 10.0
"""Time that a stranger may take for the head of a request, and to take the answer (s)."""
IDLE_TIME = 75.0
"""Time that whoever has shown a token may be silent between two requests (s)."""
HELD_BACK = 64
"""Number of descriptors that stay free for the disk and the device, whatever knocks."""
NO_LIMIT = 1 << 20
"""Number of descriptors where the system names no limit."""
PACE = 0.002
"""Time between two connections that are let in, and between two answers to strangers (s): a flood of them costs
little, and a page needs seven."""
BACKLOG = 128
"""Number of connections that wait in the system to be let in."""


@dataclass(eq=False)
class Guest:
    """One connection."""

    socket: socket.socket
    """Socket of the connection, closed by its transport; its number is negative then."""
    place: str
    """Address or network that it comes from; connections are counted by this."""
    transport: asyncio.Transport
    """Transport of the connection."""
    has_token: bool = False
    """Whether it has shown a token."""
    timer: asyncio.TimerHandle | None = None
    """Timer that hangs up; None while a request is answered."""

    @property
    def is_here(self) -> bool:
        """Whether it still holds a descriptor."""
        return self.socket.fileno() >= 0

    def wait(self) -> None:
        """Hang up where it is not heard, or has not taken its answer, in time."""
        self.hold()
        patience = IDLE_TIME if self.has_token else HEAD_TIME
        self.timer = asyncio.get_running_loop().call_later(patience, self.transport.abort)

    def hold(self) -> None:
        """Stop the timer: it is being answered, which may take as long as it takes."""
        if self.timer is not None:
            self.timer.cancel()
        self.timer = None


class Door:
    """Lets connections in to a web application; to be used in one event loop."""

    def __init__(self) -> None:
        """Nobody is in."""
        self._guests: list[Guest] = []
        self._turn = asyncio.Lock()

    @property
    def connections(self) -> int:
        """Number of connections."""
        return sum(guest.is_here for guest in self._guests)

    async def serve(self, listener: socket.socket, server: web.Server) -> None:
        """Let in whoever comes, until cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, address = await loop.sock_accept(listener)
            except OSError:  # it has gone already, or there is no descriptor for it
                await asyncio.sleep(10 * PACE)
                continue
            place = place_of(address[0])
            if self._has_room(connection, place):
                transport, _ = await loop.connect_accepted_socket(server, connection)
                guest = Guest(connection, place, transport)
                guest.wait()
                self._guests.append(guest)
            else:
                connection.close()
            await asyncio.sleep(PACE)

    @contextlib.asynccontextmanager
    async def attending(self, request: web.Request) -> AsyncIterator[None]:
        """Keep the connection of a request while that is answered; strangers are answered one after the other."""
        guest = self._guest(request)
        if guest is None:
            yield
            return
        guest.hold()
        try:
            if not guest.has_token:
                async with self._turn:
                    await asyncio.sleep(PACE)
            yield
        finally:
            guest.wait()

    def trust(self, request: web.Request) -> None:
        """Note that whoever sent this has shown a token."""
        guest = self._guest(request)
        if guest is not None:
            guest.has_token = True

    def _guest(self, request: web.Request) -> Guest | None:
        return next((guest for guest in self._guests if guest.transport is request.transport), None)

    def _has_room(self, connection: socket.socket, place: str) -> bool:
        """Whether one more may come in; for it, the one that has been silent longest without a token may have to go."""
        self._guests = [guest for guest in self._guests if guest.is_here]
        if connection.fileno() >= _most_descriptors() - HELD_BACK:  # numbers are given lowest first
            return False
        strangers = [guest for guest in self._guests if not guest.has_token]
        strangers.sort(key=lambda guest: guest.timer is None)
        near = [guest for guest in strangers if guest.place == place]
        if len(near) >= STRANGERS:
            self._turn_out(near[0])
        elif len(self._guests) >= MOST and strangers:
            self._turn_out(strangers[0])
        return len(self._guests) < MOST

    def _turn_out(self, guest: Guest) -> None:
        guest.hold()
        guest.transport.abort()
        self._guests.remove(guest)


def place_of(host: str) -> str:
    """IPv4 address, or the network of 64 bits of an IPv6 address: one computer may have all of its addresses."""
    address = ipaddress.ip_address(host.partition("%")[0])
    return str(address) if address.version == 4 else str(ipaddress.ip_network((address, 64), strict=False))


def open_port(host: str, port: int) -> socket.socket:
    """A socket that listens at an address of this computer; OSError or ValueError where it cannot be had."""
    family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    listener = socket.create_server((str(address[0]), int(address[1])), family=family, backlog=BACKLOG)
    listener.setblocking(False)
    return listener


def _most_descriptors() -> int:
    """Number of descriptors that this process may have."""
    if sys.platform == "win32":
        return NO_LIMIT
    import resource

    limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    return limit if limit != resource.RLIM_INFINITY else NO_LIMIT
