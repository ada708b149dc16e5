"""Commands to a DATAQ device as (sent, received) pairs, byte for byte, and the facts of its protocol."""

from __future__ import annotations

from dataclasses import replace

import pytest

from acquisition import Channel, DataqSource, DeviceError, DeviceIdentity, SensorInput
from acquisition.dataq.protocol import (
    RateSetting,
    choose_packet_code,
    choose_rate,
    encode_range,
    parse_firmware,
    parse_model,
    split_lines,
)

pytestmark = pytest.mark.quick

Pair = tuple[bytes, bytes]
INPUTS = (
    SensorInput(0, Channel("force", 2.25e-3, 5.0)),
    SensorInput(3, Channel("acceleration", 1.02e-3, 0.5)),
)
IDENTITY: list[Pair] = [
    (b"stop\r", b"stop\r"),
    (b"info 0\r", b"info 0 DATAQ\r"),
    (b"info 1\r", b"info 1 4108\r"),
    (b"info 2\r", b"info 2 1.36\r"),
    (b"info 6\r", b"info 6 5E0ABC12FF\r"),
    (b"info 9\r", b"info 9 60000000\r"),
]
SET_UP: list[Pair] = [
    (b"encode 0\r", b"encode 0\r"),
    (b"slist 0 256\r", b"slist 0 256\r"),  # input 0, range code 1: +-5 V
    (b"slist 1 1027\r", b"slist 1 1027\r"),  # input 3, range code 4: +-0.5 V
    (b"slist 2 8\r", b"slist 2 8\r"),  # the digital word
    (b"filter * 0\r", b"filter * 0\r"),
    (b"srate 1200\r", b"srate 1200\r"),
    (b"dec 1\r", b"dec 1\r"),
    (b"deca 1\r", b"deca 1\r"),
    (b"ps 7\r", b"ps 7\r"),
]
GOODBYE: list[Pair] = [(b"stop\r", b"")]


class ScriptedLink:
    """SerialLink that expects what is written and answers from a script."""

    port = "COM9"
    overruns = 0
    script: list[Pair]

    received = b""

    def __init__(self, _port: str) -> None:
        ScriptedLink.received = b""

    def write(self, data: bytes) -> None:
        assert self.script, f"{data!r} is one command too many"
        sent, received = self.script.pop(0)
        assert data == sent
        ScriptedLink.received += received

    def read(self, _timeout: float) -> bytes:
        line, end, ScriptedLink.received = self.received.partition(b"\r")  # a NUL after the CR comes later
        return line + end

    def close(self) -> None:
        pass


@pytest.fixture(autouse=True)
def impatience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.dataq.source.SerialLink", ScriptedLink)
    monkeypatch.setattr("acquisition.dataq.protocol.DATAQ_ECHO_TIMEOUT", 0.01)


def connect(script: list[Pair], sample_rate: float | None = None, digital_word: bool = True) -> DataqSource:
    ScriptedLink.script = list(script)
    source = DataqSource("COM9", INPUTS, sample_rate, digital_word)
    assert not ScriptedLink.script
    return source


def test_the_connect_sequence_byte_for_byte() -> None:
    source = connect(IDENTITY + SET_UP)
    assert source.identity == DeviceIdentity("DI-4108", "5E0ABC12", "1.36")
    assert source.sample_rate == 50_000.0
    assert source.loss_detection == "digital word"
    assert [channel.quantity for channel in source.channels] == ["force", "acceleration"]
    ScriptedLink.script = [(b"start\r", b""), *GOODBYE]
    source.start()
    source.close()
    assert not ScriptedLink.script


def test_without_the_digital_word_the_list_is_shorter_and_the_source_says_so() -> None:
    script = [pair for pair in IDENTITY + SET_UP if pair[0] != b"slist 2 8\r"]
    assert connect(script, digital_word=False).loss_detection == "none"


def test_a_low_rate_is_decimated_and_sent_in_small_packets() -> None:
    changed = {b"srate 1200\r": b"srate 60000\r", b"dec 1\r": b"dec 10\r", b"ps 7\r": b"ps 0\r"}
    script = [(changed.get(sent, sent), changed.get(sent, received)) for sent, received in IDENTITY + SET_UP]
    assert connect(script, sample_rate=100.0).sample_rate == 100.0


def test_echoes_may_end_with_cr_nul_and_come_late_or_hidden_in_rubbish() -> None:
    script = [(sent, received.replace(b"\r", b"\r\0")) for sent, received in IDENTITY + SET_UP]
    script[2] = (b"info 1\r", b"\x13\xff\0\0half a scan\r\0info 1 4108\r\0")
    assert connect(script).identity.model == "DI-4108"
    assert not ScriptedLink.received  # nothing is left that would be taken for the first byte of the stream


def test_a_command_without_its_echo_is_sent_three_times() -> None:
    script = IDENTITY + SET_UP
    at = script.index((b"srate 1200\r", b"srate 1200\r"))
    script[at:at] = [(b"srate 1200\r", b""), (b"srate 1200\r", b"srate 120\r")]
    assert connect(script).sample_rate == 50_000.0


@pytest.mark.parametrize(
    "answer",
    [b"Invalid Parameter\r", b"Command not found\r", b"Command not available\r", b"slist 1 1027 Invalid Parameter\r"],
)
def test_a_rejected_command_is_reported_with_the_words_of_the_device(answer: bytes) -> None:
    script = [*IDENTITY, *SET_UP[:2], *[(b"slist 1 1027\r", answer)] * 3]
    words = answer.decode().strip()
    with pytest.raises(DeviceError, match=rf"COM9.*'slist 1 1027'.*'{words}'.*3"):
        connect(script)


def test_a_silent_device_gets_the_hint_to_cdc_mode() -> None:
    with pytest.raises(DeviceError, match=r"COM9.*info 0, 3 .*CDC"):
        connect([IDENTITY[0], *[(b"info 0\r", b"")] * 3])


@pytest.mark.parametrize(
    ("at", "answer", "message"),
    [
        (1, b"info 0 ACME\r", "'ACME'"),
        (2, b"info 1 1100\r", "'1100'.* DI-1120, DI-2108"),
        (3, b"info 2 1.20\r", r"1\.20.* 1\.35 "),
        (3, b"info 2 78\r", r"1\.20.* 1\.35 "),
        (4, b"info 6\r", "serial number"),
        (5, b"info 9 fast\r", "'fast'"),
    ],
)
def test_a_device_that_cannot_be_used_is_rejected(at: int, answer: bytes, message: str) -> None:
    script = list(IDENTITY)
    script[at] = (script[at][0], answer)
    with pytest.raises(DeviceError, match=message):
        connect(script)


def test_a_range_that_the_model_does_not_have_is_rejected() -> None:
    script = list(IDENTITY)
    script[2] = (b"info 1\r", b"info 1 DI-4208\r")
    with pytest.raises(ValueError, match=r"range_v=0\.5 .*DI-4208 .*100, 50, 20, 10, 5, 2 V"):
        connect(script)


@pytest.mark.parametrize(
    ("wanted", "setting", "rate"),
    [
        (50_000, (1200, 1, 1), 50_000.0),
        (51_200, (1172, 1, 1), 51_194.539_249),  # 60e6/51200 is no integer
        (160_000, (375, 1, 1), 160_000.0),
        (25_600, (2344, 1, 1), 25_597.269_625),
        (915, (32_787, 2, 1), 914.996_798),  # 65 574 is beyond srate: decimated by two
        (10, (65_217, 92, 1), 10.000_060),
    ],
)
def test_rates_follow_the_formula(wanted: float, setting: tuple[int, int, int], rate: float) -> None:
    chosen = choose_rate(wanted, 60_000_000)
    assert chosen == RateSetting(*setting)
    assert chosen.rate(60_000_000) == pytest.approx(rate, rel=1e-7)


def test_every_rate_within_reach_is_met_within_a_thousandth_and_others_are_rejected() -> None:
    for wanted in (0.001, 0.1, 3.3, 77.7, 1234.5, 9_999.0, 40_000.0):
        chosen = choose_rate(wanted, 60_000_000)
        assert chosen.rate(60_000_000) == pytest.approx(wanted, rel=1e-3)
        assert 375 <= chosen.srate <= 65_535
        assert 1 <= chosen.dec <= 512
        assert 1 <= chosen.deca <= 40_000
    with pytest.raises(ValueError, match=r"200000 Hz .*160000 Hz"):
        choose_rate(200_000.0, 60_000_000)


@pytest.mark.parametrize(
    ("bytes_per_second", "ps"), [(600, 0), (1600, 0), (1601, 1), (100_000, 6), (204_800, 7), (300_000, 7)]
)
def test_packets_are_the_smallest_with_at_most_100_a_second(bytes_per_second: float, ps: int) -> None:
    assert choose_packet_code(bytes_per_second) == ps


def test_small_facts_of_the_protocol() -> None:
    assert split_lines(b"info 0 DATAQ\r\0\nstop\rinf") == (["info 0 DATAQ", "stop"], b"inf")
    assert [parse_model(text) for text in ("4108", "DI-2108-P", "2108p", "DI-4718B")] == [
        "4108",
        "2108P",
        "2108P",
        "4718B",
    ]
    assert [parse_firmware(text) for text in ("1.35", "87", "newest")] == [1.35, 1.35, None]
    assert [encode_range("4108", volts) for volts in (10, 5, 2, 1, 0.5, 0.2)] == [0, 1, 2, 3, 4, 5]
    assert [encode_range("1120", volts) for volts in (100, 50, 20, 10, 5, 2)] == [0, 1, 2, 3, 4, 5]
    with pytest.raises(ValueError, match=r"input=8 .*0 to 7"):
        DataqSource("COM9", (replace(INPUTS[0], number=8),))
    with pytest.raises(ValueError, match=r"inputs \[0, 0\]"):
        DataqSource("COM9", (INPUTS[0], INPUTS[0]))
