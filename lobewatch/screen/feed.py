"""The newest state to one page, over a WebSocket; what the page is too slow for is left out."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from aiohttp import WSCloseCode, web

from lobewatch.tap.listening.cut_state import CutState
from lobewatch.tap.state import TapState

PERIOD = 0.05
"""Time between two states, but for a new word (s)."""
SIGN_OF_LIFE = 1.0
"""Time without a change until an empty message (s): the page takes 3 s of silence for a lost connection."""

ENDING = web.AppKey("ENDING", asyncio.Event)
"""Event that is set when the server is about to close."""


State = TypeVar("State", TapState, CutState)
NewestState = TypeVar("NewestState", TapState, CutState, covariant=True)


class PictureSource(Protocol[NewestState]):
    """A live test, or a cut that is listened to."""

    @property
    def state(self) -> NewestState:
        """The newest picture of it."""
        ...

    @property
    def wakes(self) -> set[Callable[[], None]]:
        """Functions that are called after every change, by the thread that has made it."""
        ...


@dataclass(frozen=True)
class Messages(Generic[State]):
    """Messages that tell the states of a kind to a page."""

    state: Callable[[State], str]
    """Message of a state, without the curves."""
    plots: Callable[[Any], bytes]
    """Message of the `plots` of a state."""


class _Following(Generic[State]):
    """What one page follows, and the event of its changes."""

    def __init__(self, find: Callable[[], PictureSource[State]]) -> None:
        self._find: Callable[[], PictureSource[State]] = find
        self._loop = asyncio.get_running_loop()
        self._followed: PictureSource[State] | None = None
        self.changed = asyncio.Event()

    def look(self) -> State:
        """The newest state, also of the test that has taken the place of the one before."""
        followed = self._find()
        if followed is not self._followed:
            self.end()
            followed.wakes.add(self._wake)
            self._followed = followed
        self.changed.clear()
        return followed.state

    def end(self) -> None:
        """Be told of nothing more."""
        if self._followed is not None:
            self._followed.wakes.discard(self._wake)

    def _wake(self) -> None:
        with contextlib.suppress(RuntimeError):  # the server has closed
            self._loop.call_soon_threadsafe(self.changed.set)


async def feed(
    request: web.Request, find: Callable[[], PictureSource[State]], messages: Messages[State]
) -> web.WebSocketResponse:
    """Send the states of what find() gives until the page or the server closes; only here is waited for a slow page."""
    socket = web.WebSocketResponse(protocols=("lobewatch",), heartbeat=10, max_msg_size=1024, compress=False)
    await socket.prepare(request)
    following = _Following(find)
    # A page sends nothing: whatever comes ends the feed.
    ends = [
        asyncio.create_task(_set_after(end, following.changed))
        for end in (socket.receive(), request.app[ENDING].wait())
    ]
    try:
        await _send_changes(socket, following, messages, lambda: any(end.done() for end in ends))
        await socket.close(code=WSCloseCode.GOING_AWAY)
    except ConnectionError:
        pass  # the page is gone
    finally:
        following.end()
        for end in ends:
            end.cancel()
    return socket


async def _send_changes(
    socket: web.WebSocketResponse, following: _Following[State], messages: Messages[State], over: Callable[[], bool]
) -> None:
    clock = asyncio.get_running_loop().time
    sent: State | None = None
    plots: Any = None
    last = clock()
    while True:
        ended = over()
        state = following.look()
        due = sent is None or state.word is not sent.word or clock() - last >= PERIOD or ended
        if state is not sent and due:
            if state.plots is not None and state.plots is not plots:
                await socket.send_bytes(messages.plots(state.plots))
            await socket.send_str(messages.state(state))
            sent, plots, last = state, state.plots, clock()
        elif clock() - last >= SIGN_OF_LIFE:
            await socket.send_str("{}")
            last = clock()
        if ended:
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout_at(last + (SIGN_OF_LIFE if state is sent else PERIOD)):
                await following.changed.wait()


async def _set_after(end: Awaitable[object], event: asyncio.Event) -> None:
    try:
        await end
    finally:
        event.set()
