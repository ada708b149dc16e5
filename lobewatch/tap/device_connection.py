"""Open and watch the device of a live test."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain

import numpy as np

import acquisition
from acquisition import Block, Device, DeviceError, Hit, find_driver, find_usb_identity
from acquisition.arrays import Codes
from acquisition.channel import ChannelQuantity
from acquisition.devices.registry import convert_driver_errors
from acquisition.hit import TapInputs
from acquisition.sensors.stream_rate import StreamRate
from acquisition.tap_test import SERIAL_PREFIX
from lobewatch.machine.settings.setup_tables import DaqTable

REPLAY_PREFIX = "file:"
"""Prefix of a port that is a recording, whatever the driver."""


class DeviceOpener:
    """Opener of one device, again and again, at whatever port its USB device is plugged in later.

    Devices without USB or without a USB serial number are identified by the name of their port only.
    """

    def __init__(self, daq: DaqTable, port: str) -> None:
        """Configure the device by [daq]. port: where it is the first time."""
        self._daq, self._port = daq, port
        self._identity: tuple[int, str] | None = None

    def open(self) -> Device:
        """Open as `open_device` does. DeviceError while the USB device is absent: no other at its port is touched."""
        if self._identity is not None and find_usb_identity(self._port) != self._identity:
            if (port := acquisition.find_usb_port(*self._identity)) is None:
                number = self._identity[1]
                raise DeviceError(f"the DAQ with USB serial number {number} is not plugged in", "Plug the DAQ in")
            self._port = port
        source = open_device(self._daq, self._port)
        self._identity = self._identity or find_usb_identity(self._port)
        return source


def open_device(daq: DaqTable, port: str) -> Device:
    """Connect to a device as [daq] configures it, or open the hits of a recording, "file:PATH".

    Raises DeviceError if there is no device, DataError for a file without hits.
    """
    if port.startswith(REPLAY_PREFIX):
        return acquisition.FileSource(port.removeprefix(REPLAY_PREFIX))
    with convert_driver_errors(daq.driver, f"opening {port}"):
        return find_driver(daq.driver).open(port, daq.settings)


def find_sensor_data(daq: DaqTable, port: str) -> acquisition.SensorDataLocation | None:
    """Return the location of the sensor data in the device on a port, None if machine.toml has them."""
    return None if port.startswith(REPLAY_PREFIX) else find_driver(daq.driver).sensor_data


LEVEL_WINDOW = 0.05
"""Length of the window of live levels (s)."""


def describe_device(device: Device) -> str:
    """Describe model, serial number, firmware and loss detection, as far as known."""
    identity = device.identity
    texts = identity.serial, identity.firmware, device.loss_detection
    details = zip((SERIAL_PREFIX, "firmware ", "loss detection: "), texts, strict=True)
    return ", ".join([identity.model, *(name + value for name, value in details if value)])


def label_device(device: Device) -> str:
    """Return model and sample rate of a device, and whether it is emulated."""
    note = ", emulated device" * device.identity.is_emulated
    return f"{device.identity.model}, {device.sample_rate:g} Hz{note}"


def get_newest_codes(pieces: Sequence[Codes], rate: float) -> Codes:
    """Return the newest codes of at least one piece, at most LEVEL_WINDOW, at a sample rate (Hz)."""
    wanted, newest = round(LEVEL_WINDOW * rate), [pieces[-1]]
    while sum(part.shape[-1] for part in newest) < wanted and len(newest) < len(pieces):
        newest.insert(0, pieces[-1 - len(newest)])
    return np.concatenate(newest, axis=-1)[..., -wanted:]


def collect_codes(blocks: Iterable[Block], count: float) -> tuple[Codes, int]:
    """Return the codes of the next blocks with this many scans, shape (n_channels, n), and the scans lost in them."""
    codes, lost = list[Codes](), 0
    for block in blocks:
        codes.append(block.codes)
        lost += block.lost_before
        if sum(part.shape[1] for part in codes) >= count:
            break
    return np.concatenate(codes, axis=1), lost


def estimate_resting_rms(baseline: Hit, width: int) -> float:
    """Return the median rms of the acceleration at rest over windows of `width` samples (m/s^2)."""
    pieces = baseline.acceleration[: max(baseline.acceleration.size // width, 1) * width]
    return float(np.median(np.std(pieces.reshape(-1, min(width, pieces.size)), axis=1)))


UNFELT_HIT_RATIO = 30.0
"""Peak of the response over its rms at rest that only a hit reaches, chosen."""
BUTTON_BOUNCE_TIME = 0.3
"""Time after a button event in which further presses are bouncing (s)."""


class DeviceConnection:
    """Opened device: its newest samples, button and faults."""

    def __init__(self, device: Device, quantity: ChannelQuantity = "force", direction: str = "") -> None:
        """Select the inputs. quantity: that triggers. direction: that is tapped. DataError as `TapInputs.of`."""
        self.device, self.direction = device, direction
        """Device, and direction that is tapped. It selects one of several accelerations."""
        self.inputs = TapInputs.select(device.channels, quantity, direction)
        """Inputs of the tap test: force and acceleration, or acceleration only, with a cross sensor between them."""
        self.rate = StreamRate(device.sample_rate) if device.follows_clock else None
        """Measured sample rate of the blocks, None without a sample clock."""
        self._recent: deque[Codes] = deque(maxlen=64)
        self._moved: int | None = None
        self._fault = ""

    @property
    def levels(self) -> tuple[float | None, float]:
        """RMS about the mean of force (N, None if not measured) and acceleration (m/s^2) over LEVEL_WINDOW."""
        steps = np.std(get_newest_codes(self._recent, self.device.sample_rate)[list(self.inputs.rows)], axis=1)
        rms = [float(step * abs(channel.scale)) for step, channel in zip(steps, self.inputs.channels, strict=True)]
        return rms[0] if len(rms) > 1 else None, rms[-1]

    def is_hit_alone(self, baseline: Hit | None) -> bool:
        """Return whether the response in the newest block is that of a hit. baseline: record at rest with a force."""
        if baseline is None or not baseline.has_force:
            return False
        channel = self.inputs.channels[-1]
        response = self._recent[-1][self.inputs.rows[-1]] * channel.scale
        peak = float(np.max(np.abs(response - np.mean(baseline.acceleration))))
        return peak > UNFELT_HIT_RATIO * float(np.std(baseline.acceleration))

    def record(self, blocks: Iterable[Block], duration: float) -> Hit:
        """Return the next blocks of this duration (s) as one record."""
        codes, lost = collect_codes(blocks, duration * self.device.sample_rate)
        return self.inputs.make_hit(codes[list(self.inputs.rows)], self.device.sample_rate, lost_scans=lost)

    def read_on(self, blocks: Iterator[Block], duration: float) -> Hit | None:
        """Return the next blocks of this duration (s) as one record, None if the samples have ended."""
        first = next(blocks, None)
        return None if first is None else self.record(chain([first], blocks), duration)

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks that the device sends from now on."""
        for block in self.device.blocks():
            if self.rate is not None:
                self.rate.add(block)
            self._recent.append(block.codes)
            yield block

    def count_presses(self) -> int:
        """Count button presses since the last call, each of which takes back the last good hit.

        The clock of the device separates presses from bouncing: waiting events arrive all at once.
        """
        count, bounce = 0, BUTTON_BOUNCE_TIME * self.device.sample_rate
        while self.device.events:
            event = self.device.events.popleft()
            if event.kind == acquisition.EventKind.BUTTON:
                count += event.begins and (self._moved is None or abs(event.scan - self._moved) >= bounce)
                self._moved = event.scan
        return count

    def poll_fault_text(self) -> str:
        """Return a sentence when a sensor fault appears or disappears, once. Empty if nothing changed."""
        before, self._fault = self._fault, self.device.fault
        return "" if self._fault == before else self._fault or "The sensor is connected again."
