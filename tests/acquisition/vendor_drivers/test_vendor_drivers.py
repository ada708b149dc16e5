"""Devices read through a vendor library, tested against emulated libraries."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from fake_libraries import Volts, Wiring, fake_daqhats, fake_ljm, fake_nidaqmx, fake_sounddevice, fake_uldaq

from acquisition import Channel, DeviceError, DeviceSettings, SensorInput, find_driver, scan_ports
from acquisition.vendor_drivers.audio import parse_name_calibration
from acquisition.vendor_drivers.library_device import LibraryDevice

pytestmark = pytest.mark.quick

NAME = "485B39 201234508460000846000260115"
"""A 485B39 with the serial number 012345, 846000 counts a volt: 9.9156 V of full scale."""
AUDIO_SCALE = 2**23 / 846000


def ramp(_rate: float) -> Callable[[int, int], Volts]:
    """Return voltages that identify each scan: rising in the first row, falling twice as fast in the second."""
    return lambda first, count: np.array([1e-6, -2e-6])[:, None] * np.arange(first, first + count)


@dataclass(frozen=True)
class Kind:
    """Kind of device in the tests."""

    port: str
    libraries: Callable[[Wiring], dict[str, ModuleType]]
    rate: float
    range_v: float
    bits: int


KINDS = {
    "audio": Kind(
        "audio:485B39",
        lambda wiring: {"sounddevice": fake_sounddevice(wiring, ("HDMI 0", NAME), AUDIO_SCALE)},
        48000.0,
        10.0,
        24,
    ),
    "nidaqmx": Kind("nidaqmx:cDAQ1Mod1", lambda wiring: fake_nidaqmx(wiring, (25600.0, 51200.0)), 51200.0, 5.0, 24),
    "mcc172": Kind("mcc172:0", lambda wiring: {"daqhats": fake_daqhats(wiring)}, 51200.0, 5.0, 24),
    "uldaq": Kind("uldaq:01F2A3B4", lambda wiring: {"uldaq": fake_uldaq(wiring)}, 50000.0, 10.0, 16),
    "ljm": Kind("ljm:470012345", fake_ljm, 40000.0, 10.0, 16),
}


def inputs(
    range_v: float, numbers: tuple[int, int] = (0, 1), iepe: bool = True, alone: bool = False
) -> tuple[SensorInput, ...]:
    """Return the inputs. alone: acceleration only, no force."""
    force = SensorInput(numbers[0], Channel("force", 2.25e-3, range_v), iepe)
    acceleration = SensorInput(numbers[1], Channel("acceleration", 1.02e-3, range_v), iepe)
    return (acceleration,) if alone else (force, acceleration)


@pytest.fixture
def wiring() -> Wiring:
    return Wiring(ramp)


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch, wiring: Wiring) -> Callable[..., LibraryDevice]:
    """Return a function that opens a device of a kind whose library is installed."""

    def open_it(name: str, port: str = "", range_v: float = 0.0, rate: float | None = None, **more: Any) -> Any:
        kind = KINDS[name]
        for library, module in kind.libraries(wiring).items():
            monkeypatch.setitem(sys.modules, library, module)
        settings = DeviceSettings(rate, inputs(range_v or kind.range_v, **more))
        return find_driver(name).open(port or kind.port, settings)

    return open_it


@pytest.mark.parametrize("name", KINDS)
def test_scans_are_the_voltages_at_the_inputs_in_order(name: str, plugged: Any, wiring: Wiring) -> None:
    kind = KINDS[name]
    numbers = (1, 0) if name in ("audio", "mcc172") else (3, 1)
    wiring.inputs = numbers
    with plugged(name, numbers=numbers) as device:
        assert device.sample_rate == kind.rate
        device.start()
        blocks = list(islice(device.blocks(), 5))
        device.stop()
    codes = np.concatenate([block.codes for block in blocks], axis=1)
    assert [block.first_scan for block in blocks] == list(np.cumsum([0, *(b.codes.shape[1] for b in blocks)])[:-1])
    force, acceleration = device.channels
    assert (force.quantity, force.adc_bits, acceleration.adc_bits) == ("force", kind.bits, kind.bits)
    volts = codes * np.array([[force.scale * force.sensitivity], [acceleration.scale * acceleration.sensitivity]])
    step = force.full_scale / 2 ** (kind.bits - 1)
    np.testing.assert_allclose(volts, ramp(0.0)(0, codes.shape[1]), atol=0.51 * step)


@pytest.mark.parametrize("name", KINDS)
def test_a_stream_restarts_at_scan_0(name: str, plugged: Any) -> None:
    with plugged(name) as device:
        for _ in range(2):
            device.start()
            block = next(iter(device.blocks()))
            device.stop()
            assert (block.first_scan, block.lost_before) == (0, 0)


@pytest.mark.parametrize(("name", "lost"), [("audio", 1), ("uldaq", 50100), ("ljm", 200)])
def test_lost_scans_are_counted(name: str, lost: int, plugged: Any, wiring: Wiring) -> None:
    with plugged(name) as device:
        device.start()
        stream = iter(device.blocks())
        first = next(stream)
        wiring.faults.add("overrun")
        blocks = [first, *islice(stream, 30)]
        device.stop()
    gaps = [block for block in blocks if block.lost_before]
    assert [gap.lost_before for gap in gaps] == [lost]
    ends = [block.first_scan + block.codes.shape[1] for block in blocks]
    assert [block.first_scan - block.lost_before for block in blocks[1:]] == ends[:-1]


@pytest.mark.parametrize(
    ("name", "fault", "reason"),
    [
        ("nidaqmx", "overrun", "no longer available"),
        ("mcc172", "overrun", "MCC 172 lost"),
        ("nidaqmx", "unplugged", "cDAQ1Mod1 .*Device is not available"),
        ("mcc172", "unplugged", "mcc172:0 .*Addr 0: Incorrect response"),
        ("uldaq", "unplugged", "UL Error: 9"),
        ("ljm", "unplugged", "LJM library error code 1301"),
    ],
)
def test_a_device_that_goes_away_is_a_device_error(
    name: str, fault: str, reason: str, plugged: Any, wiring: Wiring
) -> None:
    with plugged(name) as device:
        device.start()
        stream = iter(device.blocks())
        next(stream)
        wiring.faults.add(fault)
        with pytest.raises(DeviceError, match=reason):
            list(islice(stream, 60))


@pytest.mark.parametrize("name", ["audio", "nidaqmx", "mcc172", "uldaq"])
def test_a_silent_device_is_a_device_error(
    name: str, plugged: Any, wiring: Wiring, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.vendor_drivers.library_device.LIBRARY_SILENCE_TIMEOUT", 0.2)
    monkeypatch.setattr("acquisition.vendor_drivers.library_device.LIBRARY_READ_TIMEOUT", 0.05)
    wiring.faults.add("silent")
    with plugged(name) as device:
        device.start()
        with pytest.raises(DeviceError, match=r"no samples .*0\.2 s"):
            list(device.blocks())


def test_the_supply_of_iepe_sensors_is_switched_by_input(plugged: Any, wiring: Wiring) -> None:
    with plugged("nidaqmx"):
        force, acceleration = wiring.log[:2]
        assert (force.ai_coupling, force.ai_excit_src, force.ai_excit_val) == ("AC", "INTERNAL", 0.002)
        assert acceleration.name == "cDAQ1Mod1/ai1"
    wiring.log.clear()
    with plugged("nidaqmx", iepe=False):
        assert not hasattr(wiring.log[0], "ai_excit_val")
    wiring.log.clear()
    with plugged("mcc172"):
        assert wiring.log == [(0, 1), (1, 1)]
    assert wiring.log[2:] == [(0, 0), (1, 0)]


def test_an_open_loop_is_reported(plugged: Any, wiring: Wiring) -> None:
    wiring.faults.add("open loop")
    with plugged("nidaqmx") as device:
        assert device.fault == ""
        device.start()
        next(iter(device.blocks()))
        assert "cDAQ1Mod1/ai1" in device.fault


@pytest.mark.parametrize(("name", "asked", "actual"), [("nidaqmx", 20000.0, 25600.0), ("mcc172", 20000.0, 51200 / 3)])
def test_the_rate_is_one_that_the_device_has(name: str, asked: float, actual: float, plugged: Any) -> None:
    with plugged(name, rate=asked) as device:
        assert device.sample_rate == pytest.approx(actual)


@pytest.mark.parametrize(
    ("name", "wrong", "error", "reason"),
    [
        ("audio", {"port": "audio:Scarlett"}, DeviceError, r'"audio:Scarlett" \(1: 485B39'),
        ("audio", {"rate": 51200.0}, ValueError, "sample_rate_hz=51200 .*485B39"),
        ("audio", {"range_v": 5.0}, ValueError, r"range_v=5 .*485B39 .*9\.916 for input 0"),
        ("audio", {"numbers": (0, 2)}, ValueError, "input=2 .*485B39 .*0 to 1"),
        ("nidaqmx", {"port": "nidaqmx:Dev7"}, DeviceError, "Dev7 .*invalid.*acquisition.scan_ports"),
        ("nidaqmx", {"numbers": (0, 4)}, ValueError, "input=4 .*NI 9234 .*0 to 3"),
        ("mcc172", {"port": "mcc172:first"}, ValueError, "mcc172:first.* 0 to 7"),
        ("mcc172", {"port": "mcc172:3"}, DeviceError, "Addr 3: Board not responding"),
        ("mcc172", {"range_v": 10.0}, ValueError, "range_v=10 .*MCC 172 .*5 V"),
        ("uldaq", {"port": "uldaq:77"}, DeviceError, "'77'"),
        ("uldaq", {"range_v": 3.0}, ValueError, "range_v=3 .*1, 10, 2, 5 V"),
        ("ljm", {"port": "ljm:1"}, DeviceError, "LJME_DEVICE_NOT_FOUND"),
        ("ljm", {"range_v": 5.0}, ValueError, r"range_v=5 .*10, 1, 0\.1, 0\.01"),
    ],
)
def test_what_cannot_be_opened_is_one_clear_error(
    name: str, wrong: dict[str, Any], error: type[Exception], reason: str, plugged: Any
) -> None:
    with pytest.raises(error, match=reason):
        plugged(name, **wrong)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("audio", "audio:485B39 .*Device unavailable"),
        ("nidaqmx", "reserved"),
        ("mcc172", "Addr 0: A scan is already active"),
        ("uldaq", "Device in use"),
        ("ljm", "CLAIMED_BY_ANOTHER_PROCESS"),
    ],
)
def test_a_device_in_use_is_reported(name: str, reason: str, plugged: Any, wiring: Wiring) -> None:
    wiring.faults.add("busy")
    with pytest.raises(DeviceError, match=reason):
        plugged(name).start()


def test_a_sound_device_that_gives_no_numbers_of_32_bits(plugged: Any, wiring: Wiring) -> None:
    wiring.faults.add("no 32 bits")
    with pytest.raises(DeviceError, match=r"audio:485B39 .*Sample format not supported"):
        plugged("audio")


@pytest.mark.parametrize("name", KINDS)
def test_an_acceleration_alone_is_read(name: str, plugged: Any) -> None:
    with plugged(name, alone=True) as device:
        device.start()
        blocks = list(islice(device.blocks(), 3))
        device.stop()
    codes = np.concatenate([block.codes for block in blocks], axis=1)
    (channel,) = device.channels
    assert channel.quantity == "acceleration"
    volts = codes[0] * channel.scale * channel.sensitivity
    np.testing.assert_allclose(volts, ramp(0.0)(0, volts.size)[1], atol=0.51 * channel.full_scale / 2**15)


def test_sound_devices_that_are_not_what_was_asked(monkeypatch: pytest.MonkeyPatch, wiring: Wiring) -> None:
    audio = find_driver("audio")
    settings = DeviceSettings(48000.0, inputs(10.0))
    two = fake_sounddevice(wiring, ("USB Audio", "USB Audio", "Mono Mic"), 10.0)
    monkeypatch.setitem(sys.modules, "sounddevice", two)
    with pytest.raises(DeviceError, match=r"2 .*0: USB Audio, 1: USB Audio"):
        audio.open("audio:USB Audio", settings)
    with audio.open("audio:1", settings) as device:
        assert device.channels[0].full_scale == 10.0  # no calibration in its name: range_v is believed
    with pytest.raises(ValueError, match=r"input=1 .*Mono Mic .*0 to 0"):
        audio.open("audio:Mono", settings)
    slow = fake_sounddevice(wiring, ("USB Audio",), 10.0, actual_rate=44100.0)
    monkeypatch.setitem(sys.modules, "sounddevice", slow)
    with pytest.raises(DeviceError, match=r"44100 Hz .*48000 Hz"):
        audio.open("audio:USB", settings)


def test_the_list_of_sound_devices_is_read_again_unless_a_stream_is_open(
    monkeypatch: pytest.MonkeyPatch, wiring: Wiring
) -> None:
    """Check a replugged device with another number, as PortAudio lists it after it was initialised again."""
    audio, settings, log = find_driver("audio"), DeviceSettings(48000.0, inputs(10.0)), list[str]()
    library, replugged = (fake_sounddevice(wiring, (*others, "USB Audio"), 10.0) for others in ((), ("HDMI",)))

    def initialize() -> None:
        log.append("initialize")
        library.__dict__.update({name: replugged.__dict__[name] for name in ("query_devices", "check_input_settings")})

    monkeypatch.setitem(sys.modules, "sounddevice", library)
    with audio.open("audio:USB Audio", settings):
        library.__dict__.update(_terminate=lambda: log.append("terminate"), _initialize=initialize)
        assert audio.search is not None
        assert [device.address for device in audio.search()] == ["audio:USB Audio"]
        assert log == []
    with audio.open("audio:USB Audio", settings):
        assert log == ["terminate", "initialize"]
        with pytest.raises(DeviceError, match="audio:0"):
            audio.open("audio:0", settings)
    with audio.open("audio:1", settings):
        assert log == ["terminate", "initialize"] * 2


def test_an_accelerometer_that_is_a_sound_device_has_no_force(monkeypatch: pytest.MonkeyPatch, wiring: Wiring) -> None:
    """Check 53 134 counts per m/s^2: at 10 mV each they are 1.578765 V of full scale."""
    audio, scale = find_driver("audio"), 2**23 / 53134 * 0.01
    name = "333D01 10165435313412345190301"
    monkeypatch.setitem(sys.modules, "sounddevice", fake_sounddevice(wiring, (name,), scale))
    wiring.inputs, wiring.volts_at = (0,), lambda _rate: lambda _first, count: np.full((1, count), 20.0 * 0.01)
    sensor = SensorInput(0, Channel("acceleration", 0.01, 1.6))
    with audio.open("audio:333D01", DeviceSettings(48000.0, (sensor,))) as device:
        assert device.channels[0].full_scale == pytest.approx(scale)
        device.start()
        block = next(iter(device.blocks()))
    np.testing.assert_allclose(block.codes[0] * device.channels[0].scale, 20.0, rtol=1e-6)
    with pytest.raises(ValueError, match=r"input=0: .*333D01"):
        audio.open("audio:333D01", DeviceSettings(48000.0, inputs(10.0)))
    with pytest.raises(ValueError, match=r"range_v=5 .*333D01 .*1\.579 for input 0"):
        audio.open("audio:333D01", DeviceSettings(48000.0, (SensorInput(0, Channel("acceleration", 0.01, 5.0)),)))


def test_calibrations_in_names() -> None:
    """Check numbers worked out by hand from the format."""
    normal = parse_name_calibration(f"Microphone (2- {NAME})")
    assert normal is not None
    assert (normal.model, normal.serial, normal.date) == ("485B39", "012345", "2026-01-15")
    assert normal.full_scales == pytest.approx((9.915612, 9.915612), rel=1e-6)
    sensitive = parse_name_calibration("485B39 301234508460000850000260115")
    assert sensitive is not None
    assert sensitive.full_scales == pytest.approx((0.4957806, 0.4934475), rel=1e-6)
    accelerometer = parse_name_calibration("333D01 10165435313412345190301: USB Audio (hw:2,0)")
    assert accelerometer is not None
    assert (accelerometer.model, accelerometer.is_accelerometer) == ("333D01", True)
    assert accelerometer.full_scales == pytest.approx((157.8765, 679.5146), rel=1e-6)
    assert not normal.is_accelerometer
    assert parse_name_calibration("Scarlett 2i2 USB") is None


@pytest.mark.parametrize("name", KINDS)
def test_a_missing_library_is_reported_with_the_command_that_installs_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for library in ("sounddevice", "nidaqmx", "daqhats", "uldaq", "labjack.ljm", "labjack"):
        monkeypatch.setitem(sys.modules, library, None)
    driver = find_driver(name)
    assert driver.search is not None
    assert list(driver.search()) == []
    with pytest.raises(DeviceError, match=rf"pip install 'lobewatch\[{driver.extra}\]'"):
        driver.open(KINDS[name].port, DeviceSettings(None, inputs(10.0)))


def test_ports_lists_them_all(monkeypatch: pytest.MonkeyPatch, wiring: Wiring) -> None:
    monkeypatch.setattr(sys.modules["acquisition.devices.port_scan"], "list_serial_ports", list)
    for kind in KINDS.values():
        for library, module in kind.libraries(wiring).items():
            monkeypatch.setitem(sys.modules, library, module)
    survey = scan_ports()
    assert survey.remarks == ()
    listed = {
        entry.port.device: entry.answer and (entry.answer.driver, entry.answer.identity) for entry in survey.ports
    }
    assert set(listed) == {kind.port for kind in KINDS.values()} - {"audio:485B39"} | {f"audio:{NAME}"}
    (only,) = scan_ports("uldaq:01F2A3B4").ports
    assert only.answer is not None
    assert only.answer.identity.model == "USB-1608FS-Plus"
    assert scan_ports("mcc172:5").ports[0].answer is None


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (RuntimeError("bus error"), "RuntimeError: bus error"),
        (["somewhere"], 'DeviceAddress .*"uldaq:"'),
    ],
)
def test_a_search_that_fails_is_a_remark_and_disables_nothing(
    answer: Any, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def search() -> Any:
        if isinstance(answer, Exception):
            raise answer
        return answer

    monkeypatch.setattr("acquisition.vendor_drivers.measurement_computing.search_uldaq", search)
    survey = scan_ports("uldaq:1")
    assert len(survey.remarks) == 1
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(str(survey.remarks[0]))


def test_closing_a_device_that_is_gone_is_no_error(plugged: Any, wiring: Wiring) -> None:
    device = plugged("mcc172")
    device.start()
    wiring.faults.add("unplugged")
    started = time.monotonic()
    device.close()
    device.close()
    assert time.monotonic() - started < 20.0  # it waits for no answer
