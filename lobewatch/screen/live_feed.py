"""Stream the states of a live test to a page over a WebSocket."""

import asyncio
import contextlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
from aiohttp import WSCloseCode, web
from numpy.typing import NDArray

from acquisition.errors import join_sentences
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.show.cuts.recorded_cuts import NEXT_STEP_TEXTS, reason_text, recorded_cut_texts
from lobewatch.show.terminal.option_names import with_option_names_inside
from lobewatch.tap.cut_recording import CutState
from lobewatch.tap.state import ListedHit, LiveCurves, TapState

PLOT_CURVES = ("time", "force", "acceleration", "frequency", "mean", "last", "coherence", "force_spectrum")
"""Names of the curves of `LiveCurves`, as the page expects them."""
MIN_STATE_INTERVAL = 0.05
"""Shortest time between two states of the same step (s)."""
HEARTBEAT_INTERVAL = 1.0
"""Time without a change until an empty message (s). The page takes 3 s of silence for a lost connection."""
SHUTDOWN_EVENT = web.AppKey("SHUTDOWN_EVENT", asyncio.Event)
"""Event that is set when the server is about to close."""
State = TypeVar("State", TapState, CutState)
NewestState = TypeVar("NewestState", TapState, CutState, covariant=True)


def encode_tap_state(state: TapState) -> str:
    """Encode the state of a tap test without its curves as JSON, null for numbers that are not finite."""
    outcome = state.outcome
    content = {
        "kind": state.word.name.lower().replace("_", "-"),
        "word": state.shown_word,
        "title": state.title,
        "direction": state.direction,
        "has_plots": state.plots is not None,
        "device": join_sentences(state.device, state.resumed),
        "reason": state.reason,
        "good": state.good,
        "wanted": state.wanted,
        "hits": [_hit_json(hit) for hit in state.hits],
        "mean_change": _round_finite(state.mean_change),
        "settled": state.settled,
        "hit_change": state.hit_change and {"code": state.hit_change.code, "text": str(state.hit_change)},
        "levels": [_round_finite(level) for level in state.levels] if state.levels else None,
        "checks": [{"name": check.name, "passed": check.passed, "text": check.text} for check in state.checks],
        "outcome": outcome
        and {
            "light": outcome.status,
            "is_early": outcome.is_early,
            "texts": list(outcome.texts),
            "next_step": outcome.next_step,
            "programs": [program._asdict() for program in outcome.programs],
        },
        "choices": [choice._asdict() for choice in state.choices],
    }
    return _encode_json(content)


def encode_cut_state(state: CutState) -> str:
    """Encode the state of a cut recording without its curves as JSON, null for numbers that are not finite."""
    comparison = state.comparison
    content = {
        "kind": state.word.name.lower().replace("_", "-"),
        "word": state.word.value,
        "title": state.title,
        "device": state.device,
        "saved": state.saved,
        "reason": state.reason if comparison is None else reason_text(comparison),
        "level": _round_finite(state.level),
        "left": _round_finite(state.left),
        "cut_seconds": _round_finite(state.cut_seconds),
        "heard": None if comparison is None else _comparison_json(comparison),
    }
    return _encode_json(content)


def encode_plots(plots: LiveCurves) -> bytes:
    """Encode the available curves and the usable band. See `encode_curves`."""
    curves = {name: values for name in PLOT_CURVES if (values := getattr(plots, name)) is not None}
    return encode_curves(curves, plots.usable_band)


def encode_curves(curves: Mapping[str, NDArray[np.float64]], band: tuple[float, float] | None = None) -> bytes:
    """Encode curves: length of the header (u32), JSON header padded to 4 bytes, float32 values, little-endian.

    The header lists the name and number of values of each curve, and the usable band.
    """
    named = [[name, int(values.size)] for name, values in curves.items()]
    header = json.dumps({"curves": named, "band": band}).encode()
    header += b" " * (-len(header) % 4)
    values = [np.asarray(curve, dtype="<f4").tobytes() for curve in curves.values()]
    return b"".join([len(header).to_bytes(4, "little"), header, *values])


def _hit_json(hit: ListedHit) -> dict[str, Any]:
    flags = {"good": not hit.flags, "verdict": hit.verdict, "undone": hit.undone, "accepted": bool(hit.accepted)}
    return {"number": hit.number, "peak": hit.peak, **flags}


def _comparison_json(comparison: CutComparison) -> dict[str, Any]:
    chatter, reason = comparison.detected.chatter, reason_text(comparison)
    return {
        "chatter_frequency_hz": None if chatter is None else chatter.frequency,
        "speed_rpm": None if comparison.detected.spindle_speed is None else comparison.speed_rpm,
        "texts": [text for text in recorded_cut_texts(comparison)[1:] if text != reason],
        "next_step": NEXT_STEP_TEXTS[comparison.detected.verdict],
    }


def _encode_json(content: dict[str, Any]) -> str:
    return json.dumps(with_option_names_inside(content), allow_nan=False)


def _round_finite(value: float | None) -> float | None:
    """Round a number to four significant digits. None if it is not finite."""
    return float(f"{value:.4g}") if value is not None and math.isfinite(value) else None


class StateSource(Protocol[NewestState]):
    """Live tap test or cut recording."""

    @property
    def state(self) -> NewestState:
        """Newest state."""
        ...

    @property
    def wakes(self) -> set[Callable[[], None]]:
        """Functions to call after every change, in the thread of the change."""
        ...


@dataclass(frozen=True)
class StateEncoder(Generic[State]):
    """Functions that encode states of one type for a page."""

    state: Callable[[State], str]
    """Function that encodes a state without its curves."""
    plots: Callable[[Any], bytes]
    """Function that encodes the `plots` of a state."""


class _FeedSubscription(Generic[State]):
    """Source that one page follows, with an event for its changes."""

    def __init__(self, find: Callable[[], StateSource[State]]) -> None:
        self._find: Callable[[], StateSource[State]] = find
        self._loop = asyncio.get_running_loop()
        self._source: StateSource[State] | None = None
        self.changed = asyncio.Event()

    def newest_state(self) -> State:
        """Return the newest state, of the next test too after one has ended."""
        source = self._find()
        if source is not self._source:
            self.unsubscribe()
            source.wakes.add(self._wake)
            self._source = source
        self.changed.clear()
        return source.state

    def unsubscribe(self) -> None:
        """Stop following the source."""
        if self._source is not None:
            self._source.wakes.discard(self._wake)

    def _wake(self) -> None:
        with contextlib.suppress(RuntimeError):  # the server has closed
            self._loop.call_soon_threadsafe(self.changed.set)


async def stream_states(
    request: web.Request, find: Callable[[], StateSource[State]], encoder: StateEncoder[State]
) -> web.WebSocketResponse:
    """Stream states over a WebSocket until the page or the server closes. A slow page misses states."""
    socket = web.WebSocketResponse(protocols=("lobewatch",), heartbeat=10, max_msg_size=1024, compress=False)
    await socket.prepare(request)
    subscription = _FeedSubscription(find)
    # A page sends nothing, so any message from it ends the feed.
    ends = [asyncio.ensure_future(end) for end in (socket.receive(), request.app[SHUTDOWN_EVENT].wait())]
    for end in ends:
        end.add_done_callback(lambda _: subscription.changed.set())
    try:
        await _send_changes(socket, subscription, encoder, lambda: any(end.done() for end in ends))
        await socket.close(code=WSCloseCode.GOING_AWAY)
    except ConnectionError:
        pass  # the page is gone
    finally:
        subscription.unsubscribe()
        for end in ends:
            end.cancel()
    return socket


async def _send_changes(
    socket: web.WebSocketResponse,
    subscription: _FeedSubscription[State],
    encoder: StateEncoder[State],
    has_ended: Callable[[], bool],
) -> None:
    clock = asyncio.get_running_loop().time
    sent: State | None = None
    plots: Any = None
    last = clock()
    while True:
        ended = has_ended()
        state = subscription.newest_state()
        due = sent is None or state.word is not sent.word or clock() - last >= MIN_STATE_INTERVAL or ended
        if state is not sent and due:
            if state.plots is not None and state.plots is not plots:
                await socket.send_bytes(encoder.plots(state.plots))
            await socket.send_str(encoder.state(state))
            sent, plots, last = state, state.plots, clock()
        elif clock() - last >= HEARTBEAT_INTERVAL:
            await socket.send_str("{}")
            last = clock()
        if ended:
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout_at(last + (HEARTBEAT_INTERVAL if state is sent else MIN_STATE_INTERVAL)):
                await subscription.changed.wait()
