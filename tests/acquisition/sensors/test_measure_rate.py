"""Sample rate from arrival times of blocks: closed forms, jitter, an emulated device, stored rates."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import (
    Block,
    Channel,
    DataError,
    DeviceError,
    DeviceIdentity,
    MeasuredRate,
    Remark,
    SimulatedSource,
    TapsEmulator,
    TapsSource,
    Trigger,
    capture_hits,
    check_rate,
    measure_rate,
)
from lobewatch.machine.daq_rates import check_device_rate, find_stored_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder

PAIR = (Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0))


BOARD = DeviceIdentity("DI-2108", "5F1", "1.40")


class Stream(SimulatedSource):
    """Device whose blocks arrive at given times. `clock` returns the time of the block delivered last."""

    def __init__(
        self,
        arrival: NDArray[np.float64],
        nominal: float = 25600.0,
        per_block: int = 512,
        identity: DeviceIdentity = BOARD,
        follows_clock: bool = True,
    ) -> None:
        super().__init__(silence, PAIR, nominal, 0)
        self.identity, self.follows_clock = identity, follows_clock
        self._arrival, self._per_block = arrival, per_block
        self._now = 0.0
        self.starts = 0

    def clock(self) -> float:
        return self._now

    def start(self) -> None:
        self.starts += 1

    def blocks(self) -> Iterator[Block]:
        for i, arrival in enumerate(self._arrival):
            self._now = arrival
            yield Block(i * self._per_block, np.zeros((2, self._per_block), np.int32))


def even(rate: float, seconds: float = 6.0, per_block: int = 512) -> NDArray[np.float64]:
    """Return the times at which the blocks of an ideal device are complete (s)."""
    return np.arange(1, int(seconds * rate / per_block) + 1) * per_block / rate


def measured(arrival: NDArray[np.float64], seconds: float = 5.0) -> MeasuredRate:
    stream = Stream(arrival)
    return measure_rate(stream, seconds, stream.clock)


@given(st.floats(1e3, 2e5), st.integers(6, 2000), st.floats(0.0, 1e5))
def test_even_blocks_give_the_exact_rate(rate: float, per_block: int, start: float) -> None:
    per_block = max(per_block, int(rate / 10))
    stream = Stream(start + np.arange(1, 40) * per_block / rate, per_block=per_block)
    found = measure_rate(stream, 30 * per_block / rate, stream.clock)
    assert found.rate == pytest.approx(rate, rel=1e-6)
    assert found.std == pytest.approx(1e-3 / np.sqrt(6) / found.seconds * rate, rel=1e-3)
    assert found.n_scans in (30 * per_block, 31 * per_block)


def test_the_time_and_the_scans_are_those_listened_to() -> None:
    found = measured(even(25600.0))
    assert found.seconds == pytest.approx(5.0, abs=0.02)
    assert found.n_scans == pytest.approx(5 * 25600, abs=512)


def jitters(kind: str, arrival: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Return late arrivals: waiting times, a growing delay, a host that polls every 9.3 ms, bursts of four blocks."""
    if kind == "waiting":
        return arrival + random.exponential(3e-3, arrival.size)
    if kind == "swell":
        swell = 0.5e-3 * (1 + np.sin(2 * np.pi * 0.2 * arrival + random.uniform(0, 2 * np.pi)))
        return arrival + swell + random.exponential(1e-4, arrival.size)
    if kind == "polling":
        phase = random.uniform(0, 9.3e-3)
        return np.asarray(np.ceil((arrival - phase) / 9.3e-3) * 9.3e-3 + phase)
    last_of_burst = (np.arange(arrival.size) + int(random.integers(4))) // 4 * 4 + 3
    return np.asarray(arrival[np.minimum(last_of_burst, arrival.size - 1)])


@pytest.mark.parametrize("kind", ["waiting", "swell", "polling", "bursts"])
def test_the_standard_error_is_honest_under_jitter(kind: str) -> None:
    random = np.random.default_rng(5)
    deviations = []
    for _ in range(150):
        rate = 25600 * random.uniform(0.99, 1.01)
        found = measured(np.sort(jitters(kind, even(rate), random)))
        assert found.std < 5e-4 * rate
        deviations.append((found.rate - rate) / found.std)
    spread = float(np.sqrt(np.mean(np.square(deviations))))
    assert spread < 1.3
    assert np.mean(np.abs(deviations) < 2) > 0.9


def test_a_stall_of_the_host_changes_nothing() -> None:
    arrival = even(25600.0)
    stalled = np.where((arrival > 4.1) & (arrival < 4.9), 4.9, arrival)
    assert measured(stalled).rate == pytest.approx(25600, rel=1e-6)
    stalled = np.maximum(arrival, 0.7)
    assert measured(stalled).rate == pytest.approx(25600, rel=1e-6)


def test_chaos_is_rejected() -> None:
    arrival = even(25600.0)
    chaos = measured(np.sort(arrival + np.random.default_rng(1).exponential(0.5, arrival.size)))
    with pytest.raises(DeviceError, match=r" \d+\.\d\d%.* limit 0\.20%"):
        check_rate(chaos, 25600.0)


def test_too_few_blocks_a_stream_that_ends_and_no_time_are_rejected() -> None:
    with pytest.raises(DeviceError, match=r"6 blocks .*10 in 5 s"):
        measured(even(512.0, seconds=7.0))
    with pytest.raises(DeviceError, match=r"50 blocks .*0\.98 s"):
        measured(even(25600.0, seconds=1.0))
    with pytest.raises(DeviceError, match="0 blocks"):
        measured(np.array([]))
    with pytest.raises(ValueError, match="seconds=0"):
        measured(even(25600.0), seconds=0)


def test_half_the_rate_is_rejected_with_the_error_of_every_frequency() -> None:
    check_rate(MeasuredRate(25600 * 1.0019, 0.5, 128000, 5.0), 25600.0)
    check_rate(MeasuredRate(25600 * 0.9981, 0.5, 128000, 5.0), 25600.0)
    with pytest.raises(DeviceError, match=r"12800\.00 ± 0\.50 .* 25600 .*100\.0% too high"):
        check_rate(MeasuredRate(12800.0, 0.5, 64000, 5.0), 25600.0)
    with pytest.raises(DeviceError, match=r"0\.2% too low"):
        check_rate(MeasuredRate(25600 * 1.0021, 0.5, 128000, 5.0), 25600.0)


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path, "new_machine.toml")
    return MachineFolder(tmp_path)


def accepting(folder: MachineFolder) -> MachineFolder:
    text = folder.toml.read_text("utf-8")
    folder.toml.write_text(text.replace("[daq]", "[daq]\naccept_measured_rate = true"), "utf-8")
    return MachineFolder(folder.path)


def check(folder: MachineFolder, stream: Stream) -> float:
    return check_device_rate(folder, stream, clock=stream.clock)


def test_a_device_is_measured_once(folder: MachineFolder) -> None:
    first, again = Stream(even(25601.0)), Stream(even(25601.0))
    assert find_stored_rate(folder, first) is None
    assert check(folder, first) == 25600.0
    assert first.starts == 1
    written = (folder.path / "daq.json").read_bytes()
    assert check(folder, again) == 25600.0
    assert again.starts == 0
    assert (folder.path / "daq.json").read_bytes() == written
    known = find_stored_rate(folder, again)
    assert known is not None
    assert known.rate == pytest.approx(25601.0, rel=1e-6)


def test_another_serial_number_and_another_rate_are_measured_too(folder: MachineFolder) -> None:
    check(folder, Stream(even(25600.0)))
    for other in (
        Stream(even(25600.0), identity=DeviceIdentity("DI-2108", "5F2")),
        Stream(even(51200.0), nominal=51200.0),
    ):
        check(folder, other)
        assert other.starts == 1
    known = json.loads((folder.path / "daq.json").read_text())
    assert [(entry["serial"], entry["nominal_rate_hz"]) for entry in known] == [
        ("5F1", 25600.0),
        ("5F2", 25600.0),
        ("5F1", 51200.0),
    ]


def test_a_wrong_rate_is_rejected_and_measured_again_next_time(folder: MachineFolder) -> None:
    for _ in range(2):
        halved = Stream(even(12800.0))
        with pytest.raises(
            DeviceError, match=r"12800\.00 .* \(accept_measured_rate = true in \[daq\] of .*machine.toml"
        ):
            check(folder, halved)
        assert halved.starts == 1
    assert check(folder, Stream(even(25600.0))) == 25600.0


def test_the_measured_rate_is_worked_with_where_the_machine_file_says_so(folder: MachineFolder) -> None:
    assert not folder.machine.daq.accept_measured_rate
    trusting = accepting(folder)
    for starts in (1, 0):
        halved = Stream(even(12800.0))
        assert check(trusting, halved) == pytest.approx(12800.0, rel=1e-6)
        assert halved.sample_rate == pytest.approx(12800.0, rel=1e-6)
        assert halved.starts == starts
        check(trusting, halved)
        assert halved.starts == starts
    assert len(json.loads((folder.path / "daq.json").read_text())) == 1
    with pytest.raises(DeviceError, match=" 25600 "):
        check(folder, Stream(even(12800.0)))


def test_what_does_not_follow_the_clock_is_not_measured(folder: MachineFolder) -> None:
    for simulated in (
        Stream(even(9.0), identity=DeviceIdentity("")),
        Stream(even(9.0), identity=DeviceIdentity("x")),
        Stream(even(9.0), identity=DeviceIdentity("x", "1"), follows_clock=False),
    ):
        assert check(folder, simulated) == 25600.0
        assert simulated.starts == 0
    assert not (folder.path / "daq.json").exists()


def test_what_the_first_versions_kept_without_a_checksum_is_known(folder: MachineFolder) -> None:
    check(folder, Stream(even(25601.0)))
    path = folder.path / "daq.json"
    path.write_text(
        json.dumps([{k: v for k, v in entry.items() if k != "crc"} for entry in json.loads(path.read_text())])
    )
    again = Stream(even(25601.0))
    assert check(folder, again) == 25600.0
    assert again.starts == 0


@pytest.mark.parametrize("content", [b"{", b'[{"model": 1}]', b"\xff"])
def test_a_damaged_memory_is_reported(folder: MachineFolder, content: bytes) -> None:
    (folder.path / "daq.json").write_bytes(content)
    with pytest.raises(DataError, match=r"daq\.json: .*Delete this file"):
        check(folder, Stream(even(25600.0)))


def silence(first: int, n: int) -> NDArray[np.float64]:
    return np.zeros((2, n))


def test_an_emulated_device_through_a_pseudo_terminal(folder: MachineFolder) -> None:
    with TapsEmulator(silence, PAIR, 102400.0) as device, TapsSource(device.port) as source:
        found = measure_rate(source, 3.0)
        assert found.rate == pytest.approx(102400, abs=5 * found.std)
        source.sample_rate = 51200.0
        with pytest.raises(DeviceError, match=r" 51200 .*50\.\d% too low"):
            check_device_rate(folder, source, 3.0)


def test_hits_have_the_measured_rate(folder: MachineFolder, tapper: Callable[..., Any]) -> None:
    with (
        TapsEmulator(tapper(), PAIR, 25600.0, realtime=False) as device,
        TapsSource(device.port) as source,
    ):
        source.follows_clock = True
        halved = Stream(even(12800.0), identity=source.identity)
        check(accepting(folder), halved)
        rate = check_device_rate(MachineFolder(folder.path), source)
        source.start()
        hit = next(capture_hits(source, Trigger(20.0, 6400, 512)))
        source.stop()
    assert hit.sample_rate == rate == pytest.approx(12800.0, rel=1e-6)


def busy(rate: float) -> NDArray[np.float64]:
    """Return arrivals at a computer so busy that the rate is known to about 0.1 %."""
    arrival = even(rate)
    return np.sort(arrival + np.random.default_rng(1).exponential(0.03, arrival.size))


def test_a_busy_computer_is_a_remark_and_the_rate_is_measured_again_next_time(folder: MachineFolder) -> None:
    assert 0.0007 < measured(busy(25600.0)).std / 25600 < 0.002
    remarks = list[Remark]()
    stream = Stream(busy(25600.0))
    assert check_device_rate(folder, stream, clock=stream.clock, remarks=remarks) == 25600.0
    assert stream.starts == 3
    assert [remark.code for remark in remarks] == ["rate-not-sure"]
    assert re.search(r" 0\.\d\d%", remarks[0].text)
    assert not (folder.path / "daq.json").exists()
    quiet = Stream(even(25600.0))
    assert check_device_rate(folder, quiet, clock=quiet.clock, remarks=remarks) == 25600.0
    assert (quiet.starts, len(remarks)) == (1, 1)


def test_a_wrong_rate_is_rejected_on_a_busy_computer_too_and_never_worked_with(folder: MachineFolder) -> None:
    with pytest.raises(DeviceError, match=" 25600 "):
        check(accepting(folder), Stream(busy(12800.0)))
    assert not (folder.path / "daq.json").exists()
