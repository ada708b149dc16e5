"""DATAQ source against the emulator: real bytes through a pseudo-terminal and through TCP, every fault."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from functools import partial
from itertools import islice

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import (
    Block,
    Channel,
    DataqEmulator,
    DataqFaults,
    DataqSource,
    DataqTraits,
    DeviceError,
    HammeredStructure,
    Hammering,
    Hit,
    HitFlags,
    SensorInput,
    SimulatedSource,
    Structure,
    Trigger,
    capture_hits,
    check_hit,
)
from acquisition.dataq.source import DataqStatus
from acquisition.dataq.stream import HELD_BACK_BYTES
from acquisition.emulation.emulated_device import SignalFunction

RATE = 25_000.0
HELD = -(-HELD_BACK_BYTES // 6)
TRIGGER = Trigger(level=20.0, n_samples=6250, pre_trigger=500)
INPUTS = (
    SensorInput(0, Channel("force", 2.25e-3, 2.0)),
    SensorInput(5, Channel("acceleration", 1.02e-3, 5.0)),
)
SignalAt = Callable[[float], SignalFunction]
Make = Callable[..., DataqEmulator]


@pytest.fixture(autouse=True)
def impatience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorten the silence after which an emulated device counts as stopped."""
    monkeypatch.setattr("acquisition.dataq.protocol.DATAQ_STOP_SILENCE", 0.05)


@pytest.fixture
def signal_at(structure: Structure) -> SignalAt:
    """Return the signal of a tapped `structure`, with the same taps at each start."""
    how = Hammering(double_hits=0.0, overloads=0.0)
    return lambda rate: HammeredStructure(structure, rate, np.random.default_rng(1), how)


@pytest.fixture
def emulated(signal_at: SignalAt) -> Make:
    def make(tcp: bool = False, realtime: bool = False, **how: object) -> DataqEmulator:
        traits = {name: how.pop(name) for name in list(how) if name in DataqTraits.__dataclass_fields__}
        faults = DataqFaults(**how)  # type: ignore[arg-type]
        return DataqEmulator(
            signal_at,
            INPUTS,
            realtime=realtime,
            tcp=tcp,
            traits=DataqTraits(**traits),  # type: ignore[arg-type]
            faults=faults,
        )

    return make


def expected(signal_at: SignalAt, count: int) -> NDArray[np.int32]:
    """Return the codes of the first scans (2, n)."""
    blocks = SimulatedSource(signal_at(RATE), tuple(one.channel for one in INPUTS), RATE, count).blocks()
    return np.concatenate([block.codes for block in blocks], axis=1)


def take(source: DataqSource, count: int) -> list[Block]:
    """Return blocks with at least this many scans."""
    taken: list[Block] = []
    for block in source.blocks():
        taken.append(block)
        if block.first_scan + block.codes.shape[1] >= count:
            break
    return taken


def check_against(blocks: list[Block], truth: NDArray[np.int32]) -> None:
    """Check that every scan is at its place."""
    for block in blocks:
        end = min(block.first_scan + block.codes.shape[1], truth.shape[1])
        assert np.array_equal(block.codes[:, : end - block.first_scan], truth[:, block.first_scan : end])


@pytest.mark.parametrize("tcp", [False, True], ids=["pty", "tcp"])
@pytest.mark.parametrize("trailing_nul", [False, True])
@pytest.mark.parametrize("echoes_stop", [False, True])
def test_scans_arrive_unchanged_and_complete(
    emulated: Make, signal_at: SignalAt, tcp: bool, trailing_nul: bool, echoes_stop: bool
) -> None:
    with (
        emulated(tcp, trailing_nul=trailing_nul, echoes_stop=echoes_stop) as device,
        DataqSource(device.port, INPUTS, RATE) as source,
    ):
        assert source.identity.model == "DI-4108"
        assert source.sample_rate == RATE
        assert source.loss_detection == "digital word"
        for _ in range(2):
            source.start()
            blocks = take(source, 15_000)
            states = [source.status]
            source.stop()
            assert [*states, source.status] == [DataqStatus.SCANNING, DataqStatus.STOPPED]
            assert blocks[0].first_scan == 0
            assert not any(block.lost_before for block in blocks)
            check_against(blocks, expected(signal_at, 15_360))


def test_what_a_slow_device_sends_after_its_stop_is_not_taken_for_the_next_stream(
    emulated: Make, signal_at: SignalAt
) -> None:
    traits = {"echoes_stop": True, "stop_delay": 0.4}
    with emulated(**traits) as device, DataqSource(device.port, INPUTS, RATE, digital_word=False) as source:
        for _ in range(2):
            source.start()
            check_against(take(source, 5000), expected(signal_at, 5120))
            source.stop()


@pytest.mark.quick
def test_without_the_digital_word_scans_arrive_too(emulated: Make, signal_at: SignalAt) -> None:
    with emulated() as device, DataqSource(device.port, INPUTS, RATE, digital_word=False) as source:
        assert source.loss_detection == "none"
        source.start()
        check_against(take(source, 5000), expected(signal_at, 5120))


def test_hits_come_out_in_newtons_whatever_the_range(emulated: Make) -> None:
    with emulated() as device, DataqSource(device.port, INPUTS, RATE) as source:
        source.start()
        hits = list(islice(capture_hits(source, TRIGGER), 3))
    assert all(150 * 0.95 < hit.force.max() < 350 for hit in hits)
    assert not any(check_hit(hit) for hit in hits)
    assert [channel.full_scale for channel in hits[0].channels or ()] == [2.0, 5.0]


@pytest.mark.parametrize(("lost_bytes", "scans"), [(64, (11, 12)), (128, (22, 23)), (1, (1, 2)), (5, (1, 2))])
def test_lost_bytes_are_found_counted_and_mark_the_hit(
    emulated: Make, signal_at: SignalAt, lost_bytes: int, scans: tuple[int, int]
) -> None:
    crossing = int(np.argmax(expected(signal_at, 20_480)[0] * INPUTS[0].channel.scale > 20))
    with (
        emulated(drop_at=6 * (crossing + 100) + 2, drop_bytes=lost_bytes) as device,
        DataqSource(device.port, INPUTS, RATE) as source,
    ):
        source.start()
        blocks = take(source, 20_000)
        (gap,) = (block.lost_before for block in blocks if block.lost_before)
        assert scans[0] <= gap <= scans[1] + 1  # and at most the whole one that follows
        check_against(blocks, expected(signal_at, 20_480))
        source.stop()
        source.start()
        hits = list(islice(capture_hits(source, TRIGGER), 2))
    assert [check_hit(hit) for hit in hits] == [HitFlags.LOST_SCANS, HitFlags.OK]
    assert hits[0].lost_scans == gap


def test_a_buffer_that_ran_over_is_found_and_scanning_starts_again(emulated: Make, signal_at: SignalAt) -> None:
    with emulated(overflow_after=14_000) as device, DataqSource(device.port, INPUTS, RATE) as source:
        source.start()
        seen: list[DataqStatus] = []
        before: list[Block] = []
        for block in source.blocks():
            seen.append(source.status)
            if block.lost_before:
                after = block
                break
            before.append(block)
        assert source.overflows == 1
    truth = expected(signal_at, 15_360)
    check_against(before, truth)
    assert before[-1].first_scan + before[-1].codes.shape[1] > 13_000
    assert np.array_equal(after.codes, truth[:, : after.codes.shape[1]])  # a new stream of the device
    gap = after.first_scan - before[-1].first_scan - before[-1].codes.shape[1]
    assert after.lost_before == gap
    assert gap > 0.1 * RATE  # no less than the silence after which it was looked for


def test_the_hit_in_which_the_buffer_ran_over_is_rejected(emulated: Make) -> None:
    with emulated(overflow_after=14_000) as device, DataqSource(device.port, INPUTS, RATE) as source:
        source.start()
        hits = list(islice(capture_hits(source, TRIGGER), 2))
    assert hits[0].lost_scans > 0
    assert HitFlags.LOST_SCANS in check_hit(hits[0])
    assert hits[1].lost_scans == 0


def test_a_host_that_does_not_read_makes_the_buffer_run_over(emulated: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.dataq.emulator.DATAQ_BUFFER_SECONDS", 0.02)
    with emulated(realtime=True) as device:
        handle = os.open(device.port, os.O_RDWR | os.O_NOCTTY)
        os.write(handle, b"encode 0\rslist 0 0\rslist 1 8\rsrate 400\rstart\r")
        while device.streaming or not device.wire.pending:
            threading.Event().wait(0.01)
        stream = b""
        while not stream.endswith(b"stop 01\r"):
            stream += os.read(handle, 65536)
        os.close(handle)
    assert len(stream) > 4000


def test_a_consumer_that_comes_too_late_is_told_of_the_gap(emulated: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.ports.serial_ports.MAX_UNREAD_BYTES", 20_000)
    with emulated(realtime=True) as device, DataqSource(device.port, INPUTS, RATE) as source:
        source.start()
        while not source._link.overruns:  # noqa: SLF001
            threading.Event().wait(0.02)
        first = next(source.blocks())
    assert source.overflows == 1
    assert first.lost_before == first.first_scan > 3000  # 20 000 bytes were thrown away
    assert np.abs(first.codes).max() < 100


def test_a_device_that_scans_already_is_taken_over(emulated: Make) -> None:
    with emulated(realtime=True, streaming_at_connect=True) as device:
        handle = os.open(device.port, os.O_RDWR | os.O_NOCTTY)
        assert len(os.read(handle, 64)) > 0
        os.close(handle)
        with DataqSource(device.port, INPUTS, RATE) as source:
            source.start()
            blocks = take(source, 600)
        assert blocks[0].first_scan == 0
        assert not any(block.lost_before for block in blocks)
        assert all(np.abs(block.codes).max() < 100 for block in blocks)  # noise: nobody taps so early


def test_a_device_that_never_stops_is_rejected(emulated: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.dataq.protocol.DATAQ_STOP_SILENCE", 0.5)
    monkeypatch.setattr("acquisition.dataq.protocol.MAX_DRAIN_TIME", 0.2)
    with (
        emulated(streaming_at_connect=True, ignores_commands=True) as device,
        pytest.raises(DeviceError, match="3 tries"),
    ):
        DataqSource(device.port, INPUTS, RATE)


def test_old_firmware_is_rejected(emulated: Make) -> None:
    with emulated(firmware="1.34") as device, pytest.raises(DeviceError, match=r"1\.34.* 1\.35 "):
        DataqSource(device.port, INPUTS, RATE)


def test_a_silent_device_is_given_up(emulated: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.dataq.source.SILENCE_TIMEOUT", 0.3)
    with emulated(stall_after=9000) as device, DataqSource(device.port, INPUTS, RATE) as source:
        source.start()
        with pytest.raises(DeviceError, match=r"no samples .*0\.3 s"):
            list(source.blocks())


def test_hanging_up_is_reported_in_one_sentence(emulated: Make) -> None:
    with emulated(unplug_after=9000) as device, DataqSource(device.port, INPUTS, RATE) as source:
        source.start()
        with pytest.raises(DeviceError, match="unplugged"):
            list(source.blocks())


def test_digital_inputs_that_do_not_hold_still_are_reported(emulated: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.dataq.source.SILENCE_TIMEOUT", 0.3)
    with emulated(digital_word=0x0001) as device, DataqSource(device.port, INPUTS, RATE) as source:
        source.start()
        with pytest.raises(DeviceError, match=r"digital inputs .*loss_detection = false"):
            list(source.blocks())


@pytest.mark.parametrize("word", [0, 0x5500])
def test_digital_inputs_may_rest_anywhere(emulated: Make, signal_at: SignalAt, word: int) -> None:
    with emulated(digital_word=word, drop_at=9001) as device, DataqSource(device.port, INPUTS, RATE) as source:
        source.start()
        blocks = take(source, 5000)
    assert sum(block.lost_before for block in blocks) in (11, 12, 13)
    check_against(blocks, expected(signal_at, 8192))


def test_a_halved_rate_is_that_of_the_clock_not_of_the_formula(signal_at: SignalAt) -> None:
    for halved, count in ((False, 2500), (True, 1250)):
        clock = partial(next, iter([0.0]), 0.1)
        device = DataqEmulator(signal_at, INPUTS, faults=DataqFaults(halved_rate=halved), clock=clock)
        with device, DataqSource(device.port, INPUTS, RATE) as source:
            source.start()
            last = take(source, count - 400)[-1]
        assert count - 400 <= last.first_scan + last.codes.shape[1] <= count - HELD


def test_inputs_that_are_scanned_lag_by_a_part_of_a_scan(structure: Structure) -> None:
    """Use a ramp to show each conversion time: input 5 comes a third of a scan after input 0."""

    def ramp(rate: float) -> SignalFunction:
        return lambda first, n: np.tile((first + np.arange(n)) / rate, (2, 1))

    inputs = tuple(SensorInput(number, Channel("force", 1.0, 10.0)) for number in (0, 5))
    with (
        DataqEmulator(ramp, inputs, realtime=False, traits=DataqTraits(is_multiplexed=True)) as device,
        DataqSource(device.port, inputs, 1000.0) as source,
    ):
        source.start()
        codes = take(source, 2000)[0].codes[:, -1]
    assert np.diff(codes) * inputs[0].channel.scale == pytest.approx(1 / 3000, abs=inputs[0].channel.scale)


@pytest.mark.parametrize("bits", [12, 14, 16])
def test_an_overload_is_found_at_the_resolution_of_the_rate(bits: int) -> None:
    """Use a sine of 102 % of the range, in words whose lower bits are 0."""

    def loud(rate: float) -> SignalFunction:
        return lambda first, n: np.tile(2.04 * np.sin(2 * np.pi * 300 / rate * (first + np.arange(n))), (2, 1))

    inputs = SensorInput(0, Channel("force", 1.0, 10.0)), SensorInput(5, Channel("acceleration", 1.0, 2.0))
    with (
        DataqEmulator(loud, inputs, realtime=False, traits=DataqTraits(bits=bits)) as device,
        DataqSource(device.port, inputs, RATE) as source,
    ):
        source.start()
        codes = np.concatenate([block.codes for block in take(source, 2000)], axis=1)
    assert codes[1].max() == 32768 - 2 ** (16 - bits)
    flags = check_hit(Hit.from_codes(codes, (inputs[0].channel, inputs[1].channel), RATE))
    assert HitFlags.OVERLOAD_RESPONSE in flags
    assert HitFlags.OVERLOAD_FORCE not in flags


@pytest.mark.parametrize("firmware", ["87", "1.36", "2A0", "beta"])
def test_firmware_is_read_in_every_form_it_may_have(emulated: Make, firmware: str) -> None:
    with emulated(firmware=firmware) as device, DataqSource(device.port, INPUTS, RATE) as source:
        assert source.identity.firmware == firmware


def test_every_model_takes_the_set_up(signal_at: SignalAt) -> None:
    for model, volts in (("1120", 2.0), ("2108", 10.0), ("2108P", 2.5), ("4208", 100.0), ("4718B", 5.0)):
        inputs = (
            SensorInput(2, Channel("force", 2.25e-3, volts)),
            SensorInput(7, Channel("acceleration", 1e-3, volts)),
        )
        device = DataqEmulator(signal_at, inputs, realtime=False, traits=DataqTraits(model=model))
        with device, DataqSource(device.port, inputs) as source:
            assert source.identity.model == f"DI-{model}"
            source.start()
            assert take(source, 100)[0].first_scan == 0


def test_wrong_commands_are_rejected_in_the_words_of_the_device(emulated: Make) -> None:
    def answers(handle: int, commands: bytes, count: int) -> list[bytes]:
        os.write(handle, commands)
        said = b""
        while said.count(b"\r") < count:
            said += os.read(handle, 4096)
        return said.split(b"\r")[:-1]

    with emulated() as device:
        handle = os.open(device.port, os.O_RDWR | os.O_NOCTTY)
        commands = [
            b"slist 2 0",
            b"slist 0 9",
            b"slist 0 1536",
            b"srate 374",
            b"dec 513",
            b"deca 0",
            b"ps 8",
            b"info 5",
        ]
        commands += [b"srate", b"srate fast", b"filter 0 1", b"filter * 4"]
        invalid = answers(handle, b"".join(command + b"\r" for command in commands), len(commands))
        assert invalid == [b"Invalid Parameter"] * len(commands)
        assert answers(handle, b"STOP\rled 1\rstop\r", 3) == [b"Command not found", b"Command not found", b"stop"]
        os.close(handle)


def test_a_port_in_use_is_rejected_with_the_cure(emulated: Make) -> None:
    with (
        emulated() as device,
        DataqSource(device.port, INPUTS, RATE),
        pytest.raises(DeviceError, match="fuser"),
    ):
        DataqSource(device.port, INPUTS, RATE)


def test_a_clock_shows_the_loss_of_whole_scans(emulated: Make, signal_at: SignalAt) -> None:
    """Lose three packets, 32 scans, within a hit: neither the digital word nor the rate shows them."""
    crossing = int(np.argmax(expected(signal_at, 20_480)[0] * INPUTS[0].channel.scale > 20))
    for clock, told in ((False, HitFlags.OK), (True, HitFlags.LOST_SCANS)):
        with (
            emulated(drop_at=6 * (crossing + 300), drop_bytes=192, clock_hz=700.0 if clock else None) as device,
            DataqSource(device.port, INPUTS, RATE, digital_clock=clock) as source,
        ):
            assert source.loss_detection == ("digital word and clock" if clock else "digital word")
            source.start()
            hits = list(islice(capture_hits(source, TRIGGER), 2))
        assert [check_hit(hit) for hit in hits] == [told, HitFlags.OK]
        assert hits[0].lost_scans in ((32, 31, 33) if clock else (0,))


def test_a_clock_that_is_not_there_is_reported(emulated: Make) -> None:
    with emulated() as device, DataqSource(device.port, INPUTS, RATE, digital_clock=True) as source:
        source.start()
        with pytest.raises(DeviceError, match="digital input 0"):
            take(source, 5000)
