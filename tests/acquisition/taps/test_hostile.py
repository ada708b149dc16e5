"""Hostile bytes at both ends of a TAPS/1 wire: one sentence, one closed connection, and the next host is served."""

from __future__ import annotations

import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from acquisition import Channel, DeviceError, SimulatedSource, TapsEmulator, TapsSource
from acquisition.ports import SerialLink
from acquisition.taps import protocol
from acquisition.taps.bridge import TapsBridge
from acquisition.taps.protocol import Frame, FrameDecoder, MessageType, encode_data, encode_frame, parse_object
from acquisition.taps.source import ScanStream, probe_taps

RATE = 25600.0
SENSORS = (Channel("force", 1.0, 1.0), Channel("acceleration", 1.0, 1.0))
GOOD_CONFIG = {"fs": RATE, "channels": [0, 1], "format": 0, "samples_per_frame": 512}


def config(body: bytes | str | dict[str, Any], kind: MessageType = MessageType.CONFIG) -> bytes:
    text = json.dumps(body) if isinstance(body, dict) else body
    return encode_frame(Frame(kind, 1, text.encode() if isinstance(text, str) else text))


CLOSED = {
    "nested": config("[" * 3000),
    "nested and closed": config("[" * 3000 + "]" * 3000),
    "nested objects": config('{"a":' * 1000 + "1" + "}" * 1000),
    "nested after a string of ends": config('["' + "]" * 4000 + '",' + "[" * 3900),
    "nested in another encoding": config(("[" * 2000).encode("utf-16-le")),
    "open quotes": config('"\\' * 4000),
    "no UTF-8": config(b"\xff\xfe\xfd"),
    "no object": config("[]"),
    "many digits": config('{"fs": ' + "1" * 5000 + "}"),
    "long START": config(b"\xff" * 4000, MessageType.START),
    "empty START": config(b"", MessageType.START),
    "endless frame": b"\x01" * 20_000,
    "noise": np.random.default_rng(1).integers(0, 256, 50_000, np.uint8).tobytes(),
}
REJECTED: dict[str, dict[str, Any]] = {
    "no scans": {"samples_per_frame": 0},
    "negative scans": {"samples_per_frame": -1},
    "endless scans": {"samples_per_frame": float("inf")},
    "no number": {"samples_per_frame": float("nan")},
    "scans in a list": {"samples_per_frame": [512]},
    "true scans": {"samples_per_frame": True},
    "format from the end": {"format": -1},
    "no format": {"format": 3},
    "half of a character": {"fs": "\ud800"},
    "long text": {"fs": "\u20ac" * 1300},
    "other channels": {"channels": {"0": 1}},
    "rate without a value": {"fs": None},
}


class HostileHost:
    """Connection that sends any bytes."""

    def __init__(self, port: str) -> None:
        host, _, number = port.removeprefix("socket://").partition(":")
        self.socket = socket.create_connection((host, int(number)), timeout=5.0)

    def close(self) -> None:
        self.socket.close()

    def is_closed_after(self, content: bytes) -> bool:
        """Send the content and read to the end. False if the other end keeps the connection for 5 s."""
        try:
            self.socket.sendall(content)
            while self.socket.recv(65536):
                pass
        except TimeoutError:
            return False
        except ConnectionError:
            pass
        return True


class Endless(SimulatedSource):
    """Device that starts again and again."""

    def __init__(self) -> None:
        super().__init__(lambda _, n: np.zeros((2, n)), SENSORS, RATE, 2**62, block=4096)

    def stop(self) -> None: ...


@pytest.fixture(scope="module")
def bridge() -> Iterator[tuple[TapsBridge, list[str]]]:
    sentences: list[str] = []
    served = TapsBridge(Endless, sentences.append)
    thread = threading.Thread(target=served.run)
    thread.start()
    yield served, sentences
    served.stop()
    thread.join(30.0)
    assert not thread.is_alive()


def assert_next_host_is_served(port: str) -> None:
    with TapsSource(port) as host:
        host.start()
        assert next(host.blocks()).first_scan == 0


@pytest.mark.parametrize("name", CLOSED)
def test_hostile_bytes_end_their_connection_only(bridge: tuple[TapsBridge, list[str]], name: str) -> None:
    served, sentences = bridge
    before = len(sentences)
    with closing(HostileHost(served.port)) as host:
        assert host.is_closed_after(CLOSED[name])
    assert len(sentences) == before + 1
    assert_next_host_is_served(served.port)


@pytest.mark.parametrize("name", REJECTED)
def test_a_wrong_value_is_rejected_and_the_host_may_go_on(bridge: tuple[TapsBridge, list[str]], name: str) -> None:
    link = SerialLink(bridge[0].port)
    with closing(link):
        link.write(config(GOOD_CONFIG | REJECTED[name]) + config(GOOD_CONFIG))
        decoder, frames, deadline = FrameDecoder(), list[Frame](), time.monotonic() + 5.0
        while len(frames) < 2 and time.monotonic() < deadline:
            frames += decoder.feed(link.read(0.1))
    assert [frame.type for frame in frames] == [MessageType.NACK, MessageType.ACK]


def test_more_scans_than_fit_into_a_frame_are_cut_into_several(bridge: tuple[TapsBridge, list[str]]) -> None:
    link = SerialLink(bridge[0].port)
    with closing(link):
        link.write(config(GOOD_CONFIG | {"samples_per_frame": 10**9}) + config(bytes(8), MessageType.START))
        decoder, frames, deadline = FrameDecoder(), list[Frame](), time.monotonic() + 5.0
        while len(frames) < 20 and time.monotonic() < deadline:
            frames += [frame for frame in decoder.feed(link.read(0.1)) if frame.type == MessageType.DATA]
    stream = ScanStream(frames[0].session, 2)
    sizes = {block.codes.shape[1] for block in map(stream.accept, frames) if block}
    assert max(sizes) == protocol.max_scans_per_frame(2, 16)
    assert stream.lost_scans == stream.refused == 0


def test_a_silent_host_and_one_that_reads_nothing_are_disconnected(
    bridge: tuple[TapsBridge, list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.taps.bridge.FIRST_FRAME_TIMEOUT", 0.2)
    monkeypatch.setattr("acquisition.taps.bridge.BRIDGE_BUFFER_BYTES", 100_000)
    served, sentences = bridge
    before = len(sentences)
    with closing(HostileHost(served.port)) as host:
        assert host.is_closed_after(b"")
    hellos = config(b"", MessageType.HELLO) * 10_000
    with closing(HostileHost(served.port)) as host, pytest.raises(ConnectionError):
        host.socket.sendall(hellos * 100)
    assert len(sentences) == before + 2
    assert_next_host_is_served(served.port)


HOSTILE_INFO: dict[str, Callable[[dict[str, Any]], Any]] = {
    "nested": lambda info: info | {"extra": json.loads("[" * 900 + "]" * 900)},
    "a list": lambda info: [info],
    "channels of text": lambda info: info | {"channels": ["force", "acceleration"]},
    "no channel": lambda info: info | {"channels": []},
    "bits of text": lambda info: info | {"adc_bits": "16"},
    "endless rate": lambda info: info | {"fs_choices": [1e300]},
    "rate that is no number": lambda info: info | {"fs_choices": [10**400]},
    "terminal codes": lambda info: info | {"model": "\x1b]0;owned\x07"},
    "terminal codes in a sensor": lambda info: (
        info | {"channels": [entry | {"sensor_serial": "\x1b[2J"} for entry in info["channels"]]}
    ),
}


@pytest.mark.parametrize("name", HOSTILE_INFO)
def test_a_hostile_device_is_one_device_error(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    with TapsEmulator(lambda _, n: np.zeros((2, n)), SENSORS, RATE) as device:
        info = HOSTILE_INFO[name](device._info())  # noqa: SLF001
        monkeypatch.setattr(device, "_info", lambda: info)
        with pytest.raises(DeviceError, match="invalid channel data"):
            TapsSource(device.port)


def test_a_probe_of_a_hostile_device_lists_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    with TapsEmulator(lambda _, n: np.zeros((2, n)), SENSORS, RATE) as device:
        monkeypatch.setattr(device, "_info", lambda: [1])
        with closing(SerialLink(device.port)) as link:
            assert probe_taps(link) is None


@pytest.mark.parametrize(
    "body",
    [
        encode_data(2**63, np.zeros((2, 1), np.int32)),
        encode_data(0, np.zeros((2, 0), np.int32)),
        encode_data(0, np.zeros((0, 5), np.int32)),
        struct.pack("<QHBBI", 0, 65535, 255, 9, 0),
    ],
)
def test_data_that_no_device_sends_is_refused(body: bytes) -> None:
    stream = ScanStream(0, 2)
    assert stream.accept(Frame(MessageType.DATA, body=body)) is None
    assert (stream.refused, stream.lost_scans) == (1, 0)


def test_json_of_the_allowed_depth_passes() -> None:
    deepest = '{"a": ' + "[" * (protocol.MAX_JSON_DEPTH - 1) + "]" * (protocol.MAX_JSON_DEPTH - 1) + "}"
    assert parse_object(deepest.encode())
    assert parse_object(b'{"name": "[[[[[[[[[[\\"[[["}') == {"name": '[[[[[[[[[["[[['}
