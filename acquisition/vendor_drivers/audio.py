"""USB audio: sound interfaces and signal conditioners with two IEPE inputs, through PortAudio.

The name of a Modal Shop device holds its calibration: model, format, serial number, for each input the counts of a
24-bit converter per volt (format 2, in format 3 20 times as many) or per m/s^2 (format 1), and the date as yymmdd.
Source: The Modal Shop, MAN-0343, USB audio interface guide, 2021.
"""

import queue
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple
from weakref import WeakSet

import numpy as np

from acquisition.channel import Channel, SensorInput
from acquisition.errors import DeviceError
from acquisition.source import DeviceAddress, DeviceIdentity
from acquisition.vendor_drivers import library_device
from acquisition.vendor_drivers.library_device import LibraryDevice, StreamReader, VoltageBlock

_MODEL = r"(?P<model>(?:485B|333D|633A|SDC0)\w\w)"
_DATA = r".(?P<format>[123])(?P<serial>\w{6})(?P<counts>\d{14}|\d{10})(?P<date>\d{6})"
MODAL_SHOP_NAME_PATTERN = re.compile(_MODEL + _DATA)


class NameCalibration(NamedTuple):
    """Calibration in the name of a Modal Shop device."""

    model: str
    """Model."""
    serial: str
    """Serial number."""
    date: str
    """Calibration date (ISO 8601)."""
    full_scales: tuple[float, ...]
    """Full scale of each input (V, or m/s^2 for a device that measures acceleration itself)."""
    is_accelerometer: bool
    """True if the device measures acceleration itself."""


def parse_name_calibration(name: str) -> NameCalibration | None:
    """Parse the calibration in the name of a device.

    Parameters
    ----------
    name
        Name of the sound device.

    Returns
    -------
    NameCalibration or None
        Calibration, None if the name holds none.
    """
    match = MODAL_SHOP_NAME_PATTERN.search(name)
    if match is None:
        return None
    kind, counts = match["format"], match["counts"]
    half = len(counts) // 2
    factor = 20 if kind == "3" else 1
    scales = tuple(2.0**23 / (factor * int(part)) for part in (counts[:half], counts[half:]))
    date = "-".join(match["date"][k : k + 2] for k in (0, 2, 4))
    return NameCalibration(match["model"], match["serial"], f"20{date}", scales, kind == "1")


AUDIO_DEFAULT_RATE = 48000.0
"""Default sample rate (Hz)."""
FULL_SCALE_CODE = 2.0**31
"""32-bit code of full scale. Devices of 24 bits fill the upper bits."""
PORTAUDIO_INVALID_RATE = -9997
"""PortAudio error for a rate that a device does not have."""
MAX_RANGE_DEVIATION = 0.2
"""Relative deviation of range_v from the calibration in the name above which it is an error."""


def search_audio() -> Sequence[DeviceAddress]:
    """List the sound devices with at least two inputs.

    Returns
    -------
    Sequence of DeviceAddress
        Addresses that `open_audio` takes.

    Raises
    ------
    DeviceError
        The library is not installed.
    """
    devices = _list_devices(library_device.load_library("sounddevice"))
    return [_make_address(entry) for entry in devices if entry["max_input_channels"] >= 2]


def open_audio(port: str, inputs: Sequence[SensorInput], sample_rate: float | None = None) -> LibraryDevice:
    """Open a sound device, sampled by its own clock.

    Parameters
    ----------
    port
        "audio:NAME", "audio:PART OF ITS NAME" or "audio:NUMBER".
    inputs
        Sensors with the numbers of their inputs.
    sample_rate
        Sample rate (Hz), None for 48 kHz.

    Returns
    -------
    LibraryDevice
        Connected device.

    Raises
    ------
    DeviceError
        The library or the device is missing, or the device cannot be opened.
    ValueError
        The device does not have an input, range or rate.
    """
    library = library_device.load_library("sounddevice")
    entry = _find_sound_device(_list_devices(library), port.removeprefix("audio:"))
    numbers = tuple(sensor.number for sensor in inputs)
    library_device.check_input_numbers(inputs, entry["max_input_channels"], entry["name"])
    rate, calibration = sample_rate or AUDIO_DEFAULT_RATE, parse_name_calibration(entry["name"])
    channels = tuple(_calibrate_channel(sensor.channel, sensor.number, calibration) for sensor in inputs)
    try:
        library.check_input_settings(entry["index"], max(numbers) + 1, "int32", samplerate=rate)
        reader = AudioReader(library, entry["index"], numbers, rate, [channel.full_scale for channel in channels])
    except library.PortAudioError as error:
        if error.args[1:2] == (PORTAUDIO_INVALID_RATE,):
            text = f"sample_rate_hz={rate:g} is not supported by {entry['name']} ({error}). Try sample_rate_hz = 48000."
            raise ValueError(text) from error
        cure = "Check that no other program uses the sound device"
        raise DeviceError(f"{port} cannot be opened ({error})", cure) from error
    return LibraryDevice(port, reader, _make_address(entry).identity, channels, rate, "callback status")


def _list_devices(library: Any) -> Sequence[dict[str, Any]]:
    """List the sound devices as they are connected now.

    PortAudio reads its list once, when it is initialised, and closes all streams when it is terminated
    (PortAudio API reference, Pa_Terminate). While a stream is open, the old list therefore stays.
    """
    try:
        if not _OPEN_READERS:
            for name in ("_terminate", "_initialize"):  # sounddevice has no public name for them
                getattr(library, name, bool)()
        devices: Sequence[dict[str, Any]] = library.query_devices()
    except library.PortAudioError as error:
        raise DeviceError(f"the sound devices cannot be listed ({error})", "Start the sound service") from error
    return devices


class AudioReader(StreamReader):
    """Reader of the blocks that PortAudio delivers in its own thread."""

    def __init__(
        self, library: Any, index: int, numbers: tuple[int, ...], rate: float, full_scales: Sequence[float]
    ) -> None:
        """Open the device with this index. numbers: its inputs in order. full_scales: of these inputs (V)."""
        self.errors: tuple[type[Exception], ...] = (library.PortAudioError,)
        self._numbers, self._volts = list(numbers), np.array(full_scales)[:, None] / FULL_SCALE_CODE
        self._blocks = queue.SimpleQueue[VoltageBlock]()
        size, count = round(rate * library_device.BLOCK_TIME), max(numbers) + 1
        self._stream = library.InputStream(rate, size, index, count, "int32", callback=self._keep)
        actual = self._stream.samplerate
        if abs(actual / rate - 1) > 1e-3:
            self._stream.close()
            text = f"the sound device samples at {actual:g} Hz instead of {rate:g} Hz"
            raise DeviceError(text, f"Set sample_rate_hz = {actual:g} in [daq]")
        _OPEN_READERS.add(self)

    def start(self) -> None:
        self._blocks = queue.SimpleQueue()
        super().start()

    def close(self) -> None:
        _OPEN_READERS.discard(self)
        super().close()

    def read(self, timeout: float) -> VoltageBlock | None:
        try:
            return self._blocks.get(timeout=timeout)
        except queue.Empty:
            return None

    def _keep(self, data: Any, _frames: int, _times: Any, status: Any) -> None:
        volts = np.asarray(data, np.float64).T[self._numbers] * self._volts
        self._blocks.put(VoltageBlock(volts, lost_before=int(bool(status.input_overflow))))


_OPEN_READERS = WeakSet[AudioReader]()
"""Readers whose stream is open."""


def _make_address(entry: dict[str, Any]) -> DeviceAddress:
    calibration = parse_name_calibration(entry["name"])
    model, serial = (calibration.model, calibration.serial) if calibration else (entry["name"], entry["name"])
    identity = DeviceIdentity(model, serial)
    return DeviceAddress(f"audio:{entry['name']}", identity, f"{entry['max_input_channels']} inputs")


def _find_sound_device(devices: Sequence[dict[str, Any]], wanted: str) -> dict[str, Any]:
    """Find the one sound device with inputs that has this name or number, or contains it in its name."""
    inputs = [entry for entry in devices if entry["max_input_channels"]]
    exact = [entry for entry in inputs if wanted in (entry["name"], str(entry["index"]))]
    listed = exact or [entry for entry in inputs if wanted.casefold() in entry["name"].casefold()]
    if len(listed) == 1:
        return listed[0]
    names = ", ".join(f"{entry['index']}: {entry['name']}" for entry in listed or inputs) or "none"
    reason = f"{len(listed)} sound devices match" if listed else "no sound device matches"
    cure = "Plug the sound device in, or give its number, as in audio:3"
    raise DeviceError(f'{reason} "audio:{wanted}" ({names})', cure)


def _calibrate_channel(channel: Channel, number: int, calibration: NameCalibration | None) -> Channel:
    """Return a 24-bit channel with the full scale of the calibration in the name, else range_v.

    An accelerometer that is a sound device has no volts: those of its sensitivity represent its m/s^2.
    """
    if calibration is None:
        return replace(channel, adc_bits=24)
    scale = calibration.full_scales[number]
    if calibration.is_accelerometer:
        if channel.quantity == "force":
            found = f"input={number}: a {calibration.model} is an accelerometer and cannot measure force"
            raise ValueError(f"{found}. Correct [[daq.channel]].")
        scale *= abs(channel.sensitivity)
    if abs(channel.full_scale / scale - 1) > MAX_RANGE_DEVIATION:
        text = (
            f"range_v={channel.full_scale:g} differs from the calibration in the name of the {calibration.model} device"
        )
        raise ValueError(f"{text}. Set range_v = {scale:.4g} for input {number}.")
    return replace(channel, adc_bits=24, full_scale=scale)
