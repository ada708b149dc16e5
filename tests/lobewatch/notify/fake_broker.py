"""A broker of a few lines, that does what a real one never should."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Self

CONNECT, PUBLISH, PING, DISCONNECT = 0x10, 0x30, 0xC0, 0xE0
"""Kinds of packets that a sender sends."""
TAKEN = b"\x20\x03\x00\x00\x00"
"""Answer to CONNECT: welcome."""
REFUSED = b"\x20\x03\x00\x87\x00"
"""Answer to CONNECT: not authorized."""
ALIVE = b"\xd0\x00"
"""Answer to a ping."""


class FakeBroker:
    """Lets `talk` do with each connection as it wants, in a thread of its own, until the end of `with`."""

    def __init__(self, talk: Callable[[FakeBroker, socket.socket], None]) -> None:
        self.ended = threading.Event()
        self.received: list[tuple[int, bytes]] = []
        """Packets of all senders: kind and content."""
        self._talk = talk
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.settimeout(0.05)
        self._connections: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept)]

    @property
    def place(self) -> str:
        """Host and port."""
        return f"127.0.0.1:{self._server.getsockname()[1]}"

    @property
    def address(self) -> str:
        return f"mqtt://{self.place}"

    def packets(self, connection: socket.socket) -> Iterator[tuple[int, bytes]]:
        """Kind and content of each packet, kept in `received` too."""
        with connection.makefile("rb") as stream:
            while head := stream.read(1):
                length = shift = 0
                for byte in iter(lambda: stream.read(1)[0], None):
                    length, shift = length | (byte & 127) << shift, shift + 7
                    if byte < 128:
                        break
                self.received.append((head[0] & 0xF0, stream.read(length)))
                yield self.received[-1]

    def _accept(self) -> None:
        while not self.ended.is_set():
            with suppress(TimeoutError):
                connection, _ = self._server.accept()
                connection.settimeout(None)
                self._connections.append(connection)
                self._threads.append(threading.Thread(target=self._answer, args=(connection,)))
                self._threads[-1].start()

    def _answer(self, connection: socket.socket) -> None:
        with connection, suppress(OSError, IndexError):
            self._talk(self, connection)
            connection.shutdown(socket.SHUT_RDWR)

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(self, *_: object) -> None:
        self.ended.set()
        self._threads[0].join()
        for connection in self._connections:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()
        self._server.close()


def acknowledgement(publish: bytes) -> bytes:
    """Answer to a PUBLISH of this content."""
    topic = int.from_bytes(publish[:2])
    return b"\x40\x02" + publish[2 + topic : 4 + topic]


def obey(broker: FakeBroker, connection: socket.socket) -> None:
    for kind, content in broker.packets(connection):
        if kind == CONNECT:
            connection.sendall(TAKEN)
        elif kind == PUBLISH:
            connection.sendall(acknowledgement(content))


def never_acknowledge(broker: FakeBroker, connection: socket.socket) -> None:
    """Alive: it takes the sender and answers pings."""
    for kind, _ in broker.packets(connection):
        if kind in (CONNECT, PING):
            connection.sendall(TAKEN if kind == CONNECT else ALIVE)


def acknowledge_the_first(broker: FakeBroker, connection: socket.socket) -> None:
    is_first = True
    for kind, content in broker.packets(connection):
        if kind in (CONNECT, PING):
            connection.sendall(TAKEN if kind == CONNECT else ALIVE)
        elif kind == PUBLISH and is_first:
            connection.sendall(acknowledgement(content))
            is_first = False


def say_nothing(broker: FakeBroker, _: socket.socket) -> None:
    broker.ended.wait()


def say_nothing_more(broker: FakeBroker, connection: socket.socket) -> None:
    connection.sendall(TAKEN)
    broker.ended.wait()


def answer_byte_by_byte(broker: FakeBroker, connection: socket.socket) -> None:
    """Send a byte every five seconds."""
    for byte in TAKEN:
        connection.sendall(bytes([byte]))
        if broker.ended.wait(5):
            return


def refuse(broker: FakeBroker, connection: socket.socket) -> None:
    for _ in broker.packets(connection):
        connection.sendall(REFUSED)


def hang_up(_: FakeBroker, __: socket.socket) -> None:
    pass


def hang_up_later(broker: FakeBroker, connection: socket.socket) -> None:
    for kind, _ in broker.packets(connection):
        if kind == PUBLISH:
            return
        connection.sendall(TAKEN)


def talk_rubbish(broker: FakeBroker, connection: socket.socket) -> None:
    next(broker.packets(connection))
    connection.sendall(bytes(range(256)))
    broker.ended.wait()


def babble(broker: FakeBroker, connection: socket.socket) -> None:
    """Without an end, and without an answer."""
    connection.sendall(TAKEN)
    while not broker.ended.is_set():
        connection.sendall(1000 * ALIVE)
