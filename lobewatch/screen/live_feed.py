"""Stream the states of a live test to a page over a WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from aiohttp import WSCloseCode, web
from numpy.typing import NDArray

from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.show.cuts.recorded_cuts import next_step_text, reason_text, recorded_cut_texts
from lobewatch.tap.cut_recording import CutState
from lobewatch.tap.state import ListedHit, LiveCurves, TapState

PLOT_CURVES = ("time", "force", "acceleration", "frequency", "mean", "last", "coherence", "force_spectrum")
"""Names of the curves of `LiveCurves`, as the page knows them."""


def encode_tap_state(state: TapState) -> str:
    """State of a tap test but for its curves, as JSON; numbers that are not finite become null."""
    return json.dumps(
        {
            "kind": state.word.name.lower().replace("_", "-"),
            "word": state.shown_word,
            "title": state.title,
            "direction": state.direction,
            "has_plots": state.plots is not None,
            "device": ", ".join(filter(None, (state.device, state.resumed))),
            "reason": state.reason,
            "good": state.good,
            "wanted": state.wanted,
            "hits": [_encode_hit(hit) for hit in state.hits],
            "mean_change": _round_finite(state.mean_change),
            "settled": state.settled,
            "levels": [_round_finite(level) for level in state.levels] if state.levels else None,
            "checks": [{"name": check.name, "passed": check.passed, "text": check.text} for check in state.checks],
            "outcome": state.outcome
            and {
                "light": state.outcome.status,
                "is_early": state.outcome.is_early,
                "texts": list(state.outcome.texts),
                "next_step": state.outcome.next_step,
                "programs": [program._asdict() for program in state.outcome.programs],
            },
            "choices": [choice._asdict() for choice in state.choices],
        },
        allow_nan=False,
    )


def encode_cut_state(state: CutState) -> str:
    """State of a cut that is listened to but for its curves, as JSON; numbers that are not finite become null."""
    return json.dumps(
        {
            "kind": state.word.name.lower().replace("_", "-"),
            "word": state.word.value,
            "title": state.title,
            "device": state.device,
            "saved": state.saved,
            "reason": state.reason if state.comparison is None else reason_text(state.comparison),
            "level": _round_finite(state.level),
            "left": _round_finite(state.left),
            "cut_seconds": _round_finite(state.cut_seconds),
            "heard": None if state.comparison is None else _encode_detected(state.comparison),
        },
        allow_nan=False,
    )


def encode_plots(plots: LiveCurves) -> bytes:
    """Message of the curves that there are, with the usable band; see curves_message."""
    curves = {name: values for name in PLOT_CURVES if (values := getattr(plots, name)) is not None}
    return encode_curves(curves, plots.usable_band)


def encode_curves(curves: Mapping[str, NDArray[np.float64]], band: tuple[float, float] | None = None) -> bytes:
    """Message of curves: length of the header (u32), JSON header padded to 4 bytes, float32 values, little-endian.

    The header names each curve with its number of values and gives the usable band.
    """
    named = [[name, int(values.size)] for name, values in curves.items()]
    header = json.dumps({"curves": named, "band": band}).encode()
    header += b" " * (-len(header) % 4)
    values = [np.asarray(curve, dtype="<f4").tobytes() for curve in curves.values()]
    return b"".join([len(header).to_bytes(4, "little"), header, *values])


def _encode_hit(hit: ListedHit) -> dict[str, Any]:
    return {
        "number": hit.number,
        "good": not hit.flags,
        "verdict": hit.flags.words,
        "peak": hit.peak,
        "undone": hit.undone,
    }


def _encode_detected(comparison: CutComparison) -> dict[str, Any]:
    chatter = comparison.detected.chatter
    return {
        "chatter_frequency_hz": None if chatter is None else chatter.frequency,
        "speed_rpm": None if comparison.detected.spindle_speed is None else comparison.speed_rpm,
        "texts": [text for text in recorded_cut_texts(comparison)[1:] if text != reason_text(comparison)],
        "next_step": next_step_text(comparison),
    }


def _round_finite(value: float | None) -> float | None:
    """Four figures of a number; None where it is none."""
    return float(f"{value:.4g}") if value is not None and math.isfinite(value) else None


MIN_STATE_INTERVAL = 0.05
"""Time between two states, but for a new word (s)."""
HEARTBEAT_INTERVAL = 1.0
"""Time without a change until an empty message (s): the page takes 3 s of silence for a lost connection."""

SHUTDOWN_EVENT = web.AppKey("SHUTDOWN_EVENT", asyncio.Event)
"""Event that is set when the server is about to close."""


State = TypeVar("State", TapState, CutState)
NewestState = TypeVar("NewestState", TapState, CutState, covariant=True)


class StateSource(Protocol[NewestState]):
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
class StateEncoder(Generic[State]):
    """Messages that tell the states of a kind to a page."""

    state: Callable[[State], str]
    """Message of a state, without the curves."""
    plots: Callable[[Any], bytes]
    """Message of the `plots` of a state."""


class _FeedSubscription(Generic[State]):
    """What one page follows, and the event of its changes."""

    def __init__(self, find: Callable[[], StateSource[State]]) -> None:
        self._find: Callable[[], StateSource[State]] = find
        self._loop = asyncio.get_running_loop()
        self._followed: StateSource[State] | None = None
        self.changed = asyncio.Event()

    def newest_state(self) -> State:
        """The newest state, also of the test that has taken the place of the one before."""
        followed = self._find()
        if followed is not self._followed:
            self.unsubscribe()
            followed.wakes.add(self._wake)
            self._followed = followed
        self.changed.clear()
        return followed.state

    def unsubscribe(self) -> None:
        """Be told of nothing more."""
        if self._followed is not None:
            self._followed.wakes.discard(self._wake)

    def _wake(self) -> None:
        with contextlib.suppress(RuntimeError):  # the server has closed
            self._loop.call_soon_threadsafe(self.changed.set)


async def stream_states(
    request: web.Request, find: Callable[[], StateSource[State]], messages: StateEncoder[State]
) -> web.WebSocketResponse:
    """Send the states of what find() gives until the page or the server closes; only here is waited for a slow page."""
    socket = web.WebSocketResponse(protocols=("lobewatch",), heartbeat=10, max_msg_size=1024, compress=False)
    await socket.prepare(request)
    following = _FeedSubscription(find)
    # A page sends nothing: whatever comes ends the feed.
    ends = [
        asyncio.create_task(_set_when_done(end, following.changed))
        for end in (socket.receive(), request.app[SHUTDOWN_EVENT].wait())
    ]
    try:
        await _send_changes(socket, following, messages, lambda: any(end.done() for end in ends))
        await socket.close(code=WSCloseCode.GOING_AWAY)
    except ConnectionError:
        pass  # the page is gone
    finally:
        following.unsubscribe()
        for end in ends:
            end.cancel()
    return socket


async def _send_changes(
    socket: web.WebSocketResponse,
    following: _FeedSubscription[State],
    messages: StateEncoder[State],
    over: Callable[[], bool],
) -> None:
    clock = asyncio.get_running_loop().time
    sent: State | None = None
    plots: Any = None
    last = clock()
    while True:
        ended = over()
        state = following.newest_state()
        due = sent is None or state.word is not sent.word or clock() - last >= MIN_STATE_INTERVAL or ended
        if state is not sent and due:
            if state.plots is not None and state.plots is not plots:
                await socket.send_bytes(messages.plots(state.plots))
            await socket.send_str(messages.state(state))
            sent, plots, last = state, state.plots, clock()
        elif clock() - last >= HEARTBEAT_INTERVAL:
            await socket.send_str("{}")
            last = clock()
        if ended:
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout_at(last + (HEARTBEAT_INTERVAL if state is sent else MIN_STATE_INTERVAL)):
                await following.changed.wait()


async def _set_when_done(end: Awaitable[object], event: asyncio.Event) -> None:
    try:
        await end
    finally:
        event.set()
