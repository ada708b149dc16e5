"""The newest state to one page, over a WebSocket; what the page is too slow for is left out."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from aiohttp import WSCloseCode, web

from lobewatch.tap.listening.cut_state import CutState
from lobewatch.tap.state import TapState

PERIOD = 0.05
"""Time between two states, but for a new word (s)."""
LOOK = 0.01
"""Time between two looks for one (s)."""
SIGN_OF_LIFE = 1.0
"""Time without a change until an empty message (s): the page takes 3 s of silence for a lost connection."""

ENDING = web.AppKey("ENDING", asyncio.Event)
"""Event that is set when the server is about to close."""


State = TypeVar("State", TapState, CutState)


@dataclass(frozen=True)
class Messages(Generic[State]):
    """Messages that tell the states of a kind to a page."""

    state: Callable[[State], str]
    """Message of a state, without the curves."""
    plots: Callable[[Any], bytes]
    """Message of the `plots` of a state."""


async def feed(request: web.Request, newest: Callable[[], State], messages: Messages[State]) -> web.WebSocketResponse:
    """Send what newest() gives until the page or the server closes; only here is waited for a slow page."""
    socket = web.WebSocketResponse(protocols=("lobewatch",), heartbeat=10, max_msg_size=1024, compress=False)
    await socket.prepare(request)
    ending = request.app[ENDING]
    closed = asyncio.create_task(_until_closed(socket))
    try:
        await _send_changes(socket, newest, messages, lambda: ending.is_set() or closed.done())
        await socket.close(code=WSCloseCode.GOING_AWAY)
    except ConnectionError:
        pass  # the page is gone
    finally:
        closed.cancel()
    return socket


async def _send_changes(
    socket: web.WebSocketResponse, newest: Callable[[], State], messages: Messages[State], over: Callable[[], bool]
) -> None:
    clock = asyncio.get_running_loop().time
    sent: State | None = None
    plots: Any = None
    last = clock()
    while True:
        ended = over()
        state = newest()
        due = sent is None or state.word is not sent.word or clock() - last >= PERIOD or ended
        if state is not sent and due:
            if state.plots is not None and state.plots is not plots:
                await socket.send_bytes(messages.plots(state.plots))
            await socket.send_str(messages.state(state))
            sent, plots, last = state, state.plots, clock()
        elif clock() - last > SIGN_OF_LIFE:
            await socket.send_str("{}")
            last = clock()
        if ended:
            return
        await asyncio.sleep(LOOK)


async def _until_closed(socket: web.WebSocketResponse) -> None:
    """Wait for the page to close: it sends nothing; whatever comes ends the feed."""
    await socket.receive()
