"""The C core: its frames against the Python codec, its commands, its ring buffer, its size."""

from __future__ import annotations

import ctypes
import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from acquisition.taps.protocol import (
    LOST_BEFORE_FLAG,
    DeviceStatus,
    Frame,
    FrameDecoder,
    MessageType,
    decode_data,
    encode_data,
    encode_frame,
)

FRAME, RING = 256, 1024
CODE_BYTES, RAM_BYTES = 2048, 10_240
"""Memory limits of the core at two channels of 24 bits."""
OUTSIDE = {"memcpy", "board_send", "board_receive", "board_start", "board_stop", "board_button"}
CONFIG = {"fs": 25600.0, "channels": [0, 1], "format": 0, "samples_per_frame": 512}
BITS = (12, 16, 24, 32)


class Core:
    """The core on a board that is called: bytes in, bytes out."""

    def __init__(self, path: Path, bits: int) -> None:
        self._library, self.bits, self.format = ctypes.CDLL(str(path)), bits, [16, 24, 32].index(max(bits, 16))
        self._out = ctypes.create_string_buffer(1 << 20)
        self.begin()

    def begin(self) -> None:
        """Switch it on."""
        self._decoder = FrameDecoder()
        self._library.library_begin()

    def exchange(self, data: bytes = b"", room: int = 1 << 20) -> list[Frame]:
        """Frames that come for these bytes, all of them whole; room: bytes sent at most."""
        size = self._library.library_exchange(data, len(data), self._out, room)
        frames = self._decoder.feed(self._out.raw[:size])
        assert self._decoder.dropped == 0
        return frames

    def ask(self, kind: int, body: bytes = b"", seq: int = 7) -> Frame:
        """Return the answer to a command."""
        return self.exchange(encode_frame(Frame(kind, seq, body)))[0]

    def start(self, n_scans: int = 0) -> None:
        """Configure and begin a stream."""
        for kind, body in [
            (MessageType.CONFIG, json.dumps(CONFIG | {"format": self.format}).encode()),
            (MessageType.START, n_scans.to_bytes(8, "little")),
        ]:
            assert self.ask(kind, body).type == MessageType.ACK

    def scan(self, codes: tuple[int, ...] | None, overload: int = 0) -> None:
        """One scan; None: missed."""
        self._library.taps_scan(None if codes is None else (ctypes.c_int32 * len(codes))(*codes), overload)

    def press(self, is_down: bool) -> None:
        self._library.library_press(is_down)

    @property
    def rate(self) -> int:
        """Sample rate of the running stream; 0 if stopped."""
        return int(self._library.library_rate())


def data_of(frames: list[Frame]) -> list[Frame]:
    return [frame for frame in frames if frame.type == MessageType.DATA]


@pytest.fixture(scope="module", params=BITS)
def core(request: pytest.FixtureRequest, built: Callable[..., Path], need: Callable[..., None]) -> Core:
    need("make", "cc")
    bits = request.param
    return Core(built("library", f"DEFINES=-DTAPS_BITS={bits}") / "taps.so", bits)


@pytest.fixture(scope="module")
def plain(built: Callable[..., Path], need: Callable[..., None]) -> Core:
    """Return a core with 16 bits."""
    need("make", "cc")
    return Core(built("library") / "taps.so", 16)


def test_it_says_who_it_is(core: Core) -> None:
    core.begin()
    info = json.loads(core.ask(MessageType.HELLO).body)
    assert (info["proto"], info["serial"], info["adc_bits"]) == (1, "LIB-1", core.bits)
    assert info["fs_choices"] == [25600, 51200]
    assert [entry["quantity"] for entry in info["channels"]] == ["force", "acceleration"]
    assert [entry["skew_s"] for entry in info["channels"]] == [0, 1e-6]


@given(st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_data_frames_are_byte_by_byte_those_of_the_codec_in_python(core: Core, data: st.DataObject) -> None:
    low, high = -(2 ** (core.bits - 1)), 2 ** (core.bits - 1) - 1
    code = st.one_of(st.sampled_from([0, -1, 1, low, high, 0x01010101 % high]), st.integers(low, high))
    scans = data.draw(st.lists(st.tuples(code, code), min_size=FRAME, max_size=FRAME))
    masks = data.draw(st.lists(st.integers(0, 3), min_size=1, max_size=4))
    core.begin()
    core.start()
    for scan, mask in zip(scans, masks + [0] * FRAME, strict=False):
        core.scan(scan, mask)
    (frame,) = data_of(core.exchange())
    body = encode_data(0, np.array(scans, np.int32).T, max(core.bits, 16), int(np.bitwise_or.reduce(masks)))
    assert frame == Frame(MessageType.DATA, frame.seq, body, session=1)


@given(st.lists(st.integers(1, 700), min_size=1, max_size=30), st.binary(min_size=FRAME * 8, max_size=FRAME * 8))
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_host_that_takes_little_at_a_time_gets_the_same(core: Core, rooms: list[int], noise: bytes) -> None:
    scans = (np.frombuffer(noise, "<i4").reshape(-1, 2) >> (32 - core.bits)).tolist()
    core.begin()
    core.start()
    for scan in scans:
        core.scan(tuple(scan))
    sent = [frame for room in [*rooms, 1 << 20] for frame in core.exchange(room=room)]
    (frame,) = data_of(sent)
    assert decode_data(frame.body).codes.T.tolist() == scans


@given(
    st.integers(0, 255).filter(lambda kind: kind not in (MessageType.CONFIG, MessageType.HELLO, MessageType.START)),
    st.integers(0, 2**32 - 1),
    st.binary(max_size=200),
    st.integers(1, 40),
)
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_command_is_decoded_however_it_is_cut(plain: Core, kind: int, seq: int, body: bytes, step: int) -> None:
    plain.begin()
    encoded = encode_frame(Frame(kind, seq, body, session=seq % 999, flags=seq % 256))
    answers = [frame for i in range(0, len(encoded), step) for frame in plain.exchange(encoded[i : i + step])]
    text = b"" if kind == MessageType.STOP else b"command"
    about = seq.to_bytes(4, "little") + bytes([bool(text), 0])
    assert answers == [Frame(MessageType.NACK if text else MessageType.ACK, 0, about + text)]


@given(st.binary(max_size=60), st.data())
def test_damaged_commands_are_not_answered(plain: Core, body: bytes, data: st.DataObject) -> None:
    encoded = bytearray(encode_frame(Frame(MessageType.STOP, 5, body)))
    place = data.draw(st.integers(0, len(encoded) - 2))
    encoded[place] ^= data.draw(st.integers(1, 255))
    plain.begin()
    assert plain.exchange(bytes(encoded)) == []
    assert plain.ask(MessageType.STOP).type == MessageType.ACK


@pytest.mark.parametrize("length", [0, 245, 246, 247, 5000])
def test_commands_longer_than_there_is_room_are_dropped(plain: Core, length: int) -> None:
    plain.begin()
    answers = plain.exchange(encode_frame(Frame(0x55, 5, b"x" * length)))
    assert len(answers) == (length + 12 <= 256)
    assert plain.ask(MessageType.STOP).type == MessageType.ACK


@pytest.mark.parametrize(
    ("change", "refused"),
    [
        ({}, None),
        ({"fs": 51200}, None),
        ({"fs": 25600.5}, '"fs"'),
        ({"fs": "25600"}, '"fs"'),
        ({"fs": 99999999999}, '"fs"'),
        ({"fs": 25600 + 2**32}, '"fs"'),
        ({"channels": [1, 0]}, '"channels"'),
        ({"channels": [0]}, '"channels"'),
        ({"channels": [0, 1, 2]}, '"channels"'),
        ({"format": 1}, '"format"'),
        ({"samples_per_frame": 0}, '"samples_per_frame"'),
        ({"samples_per_frame": None}, '"samples_per_frame"'),
    ],
)
@pytest.mark.parametrize("separators", [(", ", ": "), (",", ":")])
def test_a_config_is_taken_or_rejected_by_the_name_of_its_key(
    plain: Core, change: dict[str, Any], refused: str | None, separators: tuple[str, str]
) -> None:
    plain.begin()
    answer = plain.ask(MessageType.CONFIG, json.dumps(CONFIG | change, separators=separators).encode())
    assert answer.body[6:].decode() == (refused or "")
    assert (answer.type == MessageType.NACK) == bool(refused)
    plain.ask(MessageType.START, bytes(8))
    assert plain.rate == (change["fs"] if change == {"fs": 51200} else 25600)
    assert plain.ask(MessageType.CONFIG, json.dumps(CONFIG).encode()).body[6:] == b"CONFIG before STOP"


def test_what_was_lost_is_the_jump_of_the_index(core: Core) -> None:
    core.begin()
    core.start()
    for index in range(3000):
        core.scan((index, -index))
    kept = data_of(core.exchange())
    assert [decode_data(frame.body).first_scan for frame in kept] == [0, FRAME, 2 * FRAME, 3 * FRAME]
    assert decode_data(kept[-1].body).codes.shape[1] == FRAME - 1  # what is before a gap is not kept back
    for index in range(3000, 3000 + FRAME):
        core.scan((index % 2000, -1))
    (after,) = data_of(core.exchange())
    assert (after.flags, decode_data(after.body).first_scan) == (LOST_BEFORE_FLAG, 3000)
    core.scan(None)
    for index in range(FRAME):
        core.scan((index, 0))
    (after,) = data_of(core.exchange())
    assert (after.flags, decode_data(after.body).first_scan) == (LOST_BEFORE_FLAG, 3001 + FRAME)


def test_as_many_scans_as_were_asked_for(plain: Core) -> None:
    plain.begin()
    plain.start(n_scans=600)
    frames = []
    for index in range(1000):
        plain.scan((index, 0))
        frames += data_of(plain.exchange())
    assert [decode_data(frame.body).codes.shape[1] for frame in frames] == [256, 256, 88]
    assert plain.rate == 0
    assert plain.ask(MessageType.START, b"").body[6:] == b"START without u64"


def test_status_twice_a_second_and_the_button_at_any_time(plain: Core) -> None:
    plain.begin()
    plain.press(True)
    (down,) = plain.exchange()
    assert (down.type, down.body) == (MessageType.EVENT, bytes([1, 255, 1]) + bytes(8))
    plain.press(False)
    assert plain.exchange()[0].body[2] == 0
    plain.start()
    states = []
    for _ in range(400):
        for _ in range(128):
            plain.scan((0, 0))
        states += [DeviceStatus.decode(frame.body) for frame in plain.exchange() if frame.type == MessageType.STATUS]
    assert [state.samples_taken for state in states] == [12_800 * i for i in range(1, 5)]
    assert states[-1] == DeviceStatus(51_200, 51_200 - FRAME, 25, 0, -327.68)


def test_a_stop_ends_the_stream_and_a_start_begins_another(plain: Core) -> None:
    plain.begin()
    plain.start()
    plain.scan((1, 1))
    assert plain.ask(MessageType.STOP).session == 1
    assert plain.rate == 0
    plain.start()
    for _ in range(FRAME):
        plain.scan((2, 2))
    (frame,) = data_of(plain.exchange())
    assert (frame.session, decode_data(frame.body).first_scan) == (2, 0)


@pytest.mark.parametrize("cpu", ["cortex-m0plus", "cortex-m3"])
def test_the_core_is_small_and_needs_nothing_else(
    cpu: str, built: Callable[..., Path], need: Callable[..., None]
) -> None:
    need("make", "arm-none-eabi-gcc")
    core = str(built("core", f"CPU={cpu}") / "taps.o")
    sizes = subprocess.check_output(["arm-none-eabi-size", core], text=True).splitlines()[1].split()
    text, data, bss = map(int, sizes[:3])
    assert text + data <= CODE_BYTES
    assert data + bss <= RAM_BYTES
    names = subprocess.check_output(["arm-none-eabi-nm", "--undefined-only", core], text=True)
    outside = {name for name in re.findall(r"U (\w+)", names) if not name.startswith("__aeabi_")}
    assert outside | {"memcpy"} == OUTSIDE  # a compiler may copy by itself


@pytest.mark.parametrize("count", [20_000, pytest.param(1_000_000, marks=pytest.mark.long)])
def test_mutated_commands_crash_nothing(count: int, built: Callable[..., Path], need: Callable[..., None]) -> None:
    """Under AddressSanitizer and UndefinedBehaviorSanitizer."""
    need("make", "cc")
    done = subprocess.run(
        [built("fuzz") / "fuzz", str(count), "1"], capture_output=True, text=True, check=False, timeout=110
    )
    assert done.returncode == 0, done.stderr
    assert "bytes sent" in done.stdout
