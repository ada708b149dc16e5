"""Record a cut with the accelerometer on the spindle housing and evaluate it live."""

import contextlib
import enum
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np

from acquisition import Block, Channel, DataError, Description, Device, DeviceError
from acquisition.arrays import Codes
from acquisition.errors import format_error, join_sentences
from acquisition.files.cut_file import CutSignal
from acquisition.files.read_cut import read_cut_recording
from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection.cut_detection import find_cuts
from lobewatch.cuts.chatter_detection.cut_evaluation import group_peaks
from lobewatch.logbook import Logbook
from lobewatch.logbook.cut_comparison import CutComparison, CutSensor, compare_cuts
from lobewatch.machine import MachineFolder, check_device_rate
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.tap.device_connection import LEVEL_WINDOW, REPLAY_PREFIX, get_newest_codes, label_device, open_device
from lobewatch.tap.live_curves import find_extremes
from lobewatch.tap.state import LiveState, StatePublisher

MAX_CURVE_FREQUENCY = 8000.0
"""Highest frequency of the curves (Hz)."""


class CutStep(enum.StrEnum):
    """Step of a cut recording, as a word that can be read from 3 m."""

    SENSOR = "SENSOR TO HOUSING"
    """The accelerometer is moved, the device opened."""
    LISTENING = "START CUT"
    """The spindle runs in air, the cut is awaited."""
    CUTTING = "CUTTING"
    """A cut has begun."""
    AGAIN = "CUT AGAIN"
    """The cut was unusable, the next one is awaited."""
    JUDGING = "EVALUATING"
    """The cut is over."""
    STABLE = "STABLE"
    """Result, as the four words of the cut evaluation."""
    CHATTER = "CHATTER"
    FLIP = "FLIP CHATTER"
    CANNOT_TELL = "CANNOT TELL"
    FAILED = "FAILED"
    """Nothing was recorded. The reason says why and what to do."""


@dataclass(frozen=True, eq=False)
class CutState(LiveState):
    """State of a cut recording."""

    word: CutStep
    """Step."""
    title: str
    """Machine and cut."""
    device: str = ""
    """DAQ, port and rate."""
    reason: str = ""
    """Sentence on what to do, or why nothing was recorded."""
    level: float | None = None
    """RMS of the acceleration over the newest 50 ms (m/s^2)."""
    left: float | None = None
    """Remaining time to wait for a cut (s)."""
    cut_seconds: float | None = None
    """Length of the cut recorded so far (s)."""
    comparison: CutComparison | None = None
    """Recorded cut compared with its prediction, None before the end."""
    saved: str = ""
    """Name under which it is saved, empty if it is not or not yet."""
    plots: Mapping[str, Floats] | None = None
    """Curves of the recorded cut, see build_cut_curves."""


def build_cut_curves(comparison: CutComparison) -> dict[str, Floats]:
    """Build the spectrum up to 8 kHz as `frequency` (Hz) and `amplitude` (m/s^2), reduced without losing a peak.

    Empty without a spectrum. For each kind of line, its lines as `NAME` (Hz) and `NAME_amplitude`. The tapped modes as
    `x` and `y` (Hz).
    """
    spectrum = comparison.detected.spectrum
    if spectrum is None:
        return {}
    amplitude = np.sqrt(spectrum.power)
    at = find_extremes([amplitude], int(np.searchsorted(spectrum.frequency, MAX_CURVE_FREQUENCY, side="right")))
    curves = {"frequency": spectrum.frequency[at], "amplitude": amplitude[at]}
    for name, lines in group_peaks(comparison.detected).items():
        curves |= {name: lines.frequency, f"{name}_amplitude": lines.amplitude}
    if comparison.assembly is not None:
        for name, modes in (("x", comparison.assembly.x), ("y", comparison.assembly.y)):
            curves[name] = np.array([mode.frequency for mode in modes or ()])
    return curves


CUT_SEARCH_INTERVAL = 0.5
"""Time between two searches for a cut in the recorded signal (s)."""
KEPT_SIGNAL_SECONDS = 20.0
"""Length of the newest signal that is kept (s)."""
MAX_CUT_SECONDS = 8.0
"""Length after which a cut is evaluated, whether it ends or not (s)."""
AIR_AFTER_CUT = 0.3
"""Length of air that shows that a cut has ended (s)."""
AIR_BEFORE_CUT = 1.0
"""Length of air that is kept before a cut (s)."""
SENSOR_CHECK_DELAY = 1.0
"""Time after which the sensor signal is checked (s)."""

SENSOR_ON_HOUSING_TEXT = "Keep the sensor on the spindle housing and run the spindle in air. Start the cut."
CUT_TOO_SHORT_TEXT = (
    "The cut was too short, or there was no running in air before it. Cut again for a second or longer."
)
CUT_RUNNING_TEXT = "Cut for a second or longer, then leave the cut. The verdict then appears automatically."


@dataclass
class _SignalBuffer:
    """Newest signal of one channel."""

    channel: Channel
    row: int
    rate: float
    codes: list[Codes] = field(default_factory=list)
    marks: list[tuple[int, int]] = field(default_factory=list)
    count: int = 0
    received: int = 0

    def add(self, block: Block) -> None:
        """Keep a block and drop what is too old."""
        codes = block.codes[self.row]
        if block.lost_before or block.overload >> self.row & 1:
            self.marks.append((self.received, block.lost_before or -1))
        self.codes.append(codes)
        self.received, self.count = self.received + codes.size, self.count + codes.size
        while self.count - self.codes[0].size > KEPT_SIGNAL_SECONDS * self.rate:
            self.count -= self.codes.pop(0).size

    @property
    def signal(self) -> CutSignal:
        """Signal that is kept."""
        codes, first = np.concatenate(self.codes), self.received - self.count
        marks = [mark for place, mark in self.marks if place > first]
        lost = sum(mark for mark in marks if mark > 0)
        values = np.asarray(codes * self.channel.scale, np.float64)
        return CutSignal(values, self.rate, codes, self.channel, lost, -1 in marks)

    @property
    def level(self) -> float:
        """RMS about the mean over the newest LEVEL_WINDOW (m/s^2)."""
        return float(np.std(get_newest_codes(self.codes, self.rate)) * abs(self.channel.scale))

    def forget(self) -> None:
        """Drop the signal so far."""
        self.codes, self.count, self.marks = [self.codes[-1]], self.codes[-1].size, []


Publish = Callable[..., None]
"""Function called with changed fields of CutState."""


def record_cut(
    device: Device, turn: float, time_limit: float, show: Callable[[str], None], publish: Publish = lambda **_: None
) -> CutSignal:
    """Record the next whole cut of a started device, from the air before it to the air after it.

    turn: time of a spindle revolution (s). time_limit: longest wait for the end of the cut (s). show: called with what
    is awaited. publish: called with the changed fields of CutState. DataError without an accelerometer or if no cut is
    detected in time, DeviceError if the sensor is dead.
    """
    row = next((i for i, channel in enumerate(device.channels) if channel.quantity == "acceleration"), None)
    if row is None:
        cure = "Plug the accelerometer in, or add a [[daq.channel]] for it to machine.toml"
        raise DataError(join_sentences("the device has no acceleration channel", cure))
    buffer = _SignalBuffer(device.channels[row], row, device.sample_rate)
    waiting = {"word": CutStep.LISTENING, "reason": SENSOR_ON_HOUSING_TEXT}
    show("Recording. Start the cut.")
    for signal in _iterate_signals(device, buffer, time_limit, publish):
        parts = find_cuts(signal.acceleration, signal.sample_rate, turn)[-1]
        has_ended = np.isfinite(parts.end) and signal.duration - parts.end > AIR_AFTER_CUT
        if has_ended and parts.reason:
            buffer.forget()
            show(CUT_TOO_SHORT_TEXT)
            waiting = {"word": CutStep.AGAIN, "reason": CUT_TOO_SHORT_TEXT}
            publish(**waiting, cut_seconds=None)
        elif not parts.reason and (has_ended or parts.end - parts.begin > MAX_CUT_SECONDS):
            return signal.slice_time(max(parts.begin - AIR_BEFORE_CUT, 0.0), parts.end + AIR_AFTER_CUT)
        elif np.isfinite(parts.begin):
            publish(word=CutStep.CUTTING, reason=CUT_RUNNING_TEXT, cut_seconds=parts.end - parts.begin)
        elif buffer.received >= SENSOR_CHECK_DELAY * buffer.rate:
            publish(**waiting, cut_seconds=None)
    cure = "Start with the spindle running in air, then cut, or increase record_cut.time_limit"
    raise DataError(join_sentences(f"no cut was detected in {time_limit:g} s", cure))


def _iterate_signals(device: Device, buffer: _SignalBuffer, time_limit: float, publish: Publish) -> Iterator[CutSignal]:
    """Yield the signal so far, again and again."""
    next_look, next_level, checked = CUT_SEARCH_INTERVAL, LEVEL_WINDOW, False
    for block in device.blocks():
        buffer.add(block)
        seconds = buffer.received / buffer.rate
        if not checked and seconds >= SENSOR_CHECK_DELAY:
            _check_sensor_signal(buffer)
            checked = True
        if seconds >= next_level:
            next_level = seconds + LEVEL_WINDOW
            publish(level=buffer.level, left=max(time_limit - seconds, 0.0))
        if seconds >= next_look:
            next_look = seconds + CUT_SEARCH_INTERVAL
            yield buffer.signal
        if seconds > time_limit:
            return


def _check_sensor_signal(buffer: _SignalBuffer) -> None:
    codes = np.concatenate(buffer.codes)
    low, high = buffer.channel.rails
    if np.mean((codes <= low) | (codes >= high)) > 0.5:
        raise DeviceError(
            "the accelerometer signal is at the limit of the input range", "Check the cable and the power supply"
        )
    if np.ptp(codes) == 0:
        cure = "Plug the accelerometer in, fix it to the housing, and run the spindle"
        raise DeviceError("the accelerometer signal is constant", cure)


def acquire_cut(
    folder: MachineFolder,
    setting: CutSetting,
    file: Path | None,
    port: str,
    time_limit: float,
    description: Description,
    show: Callable[[str], None],
    publish: Publish,
) -> CutSignal:
    """Read a cut from a file, or record one with the device of machine.toml.

    file: replaces the device. description: what the file does not state itself. time_limit: longest wait for a cut (s).
    show: called with what to do. publish: as in record_cut. ValueError without a port, DataError for a file without
    such a recording or if no cut is detected, DeviceError if no device answers.
    """
    if file is not None:
        return read_cut_recording(file, description)
    port = port or folder.machine.daq.port
    if not port:
        raise ValueError(
            f"DAQ port missing. Give acquire_cut.port or acquire_cut.file, or set port in [daq] of {folder.toml}."
        )
    if port.startswith(REPLAY_PREFIX):
        cure = "Give the recording of a cut with acquire_cut.file"
        raise ValueError(join_sentences(f"acquire_cut.port {port}: this is a recording of hits", cure))
    show("Move the accelerometer from the tool to the spindle housing. Run the spindle in air.")
    show(f"Cut: {setting.program or 'reference cut'}, {setting.speed_rpm:g} rpm, {1e3 * setting.depth:g} mm deep")
    with open_device(folder.machine.daq, port) as device:
        with folder.locked():
            check_device_rate(folder, device)
        publish(device=label_device(device))
        device.start()
        return record_cut(device, 60 / setting.speed_rpm, time_limit, show, publish)


def check_file_options(sensor: str, tacho: str, pulses: int | None, file: Path | None) -> dict[str, Any]:
    """Return the fields of a description that name the sensor and the tachometer.

    ValueError for an unknown kind of sensor, and for a microphone or a tachometer at a device, which has none.
    """
    if file is None and (tacho or pulses is not None):
        given = f"Description.tacho {tacho}" if tacho else f"Description.pulses {pulses}"
        raise ValueError(f"{given} works only with a recording. Give a recording with acquire_cut.file.")
    if sensor not in get_args(CutSensor):
        raise ValueError(f"Description.sensor {sensor} is unknown. Use {' or '.join(get_args(CutSensor))}.")
    if sensor == "microphone" and file is None:
        raise ValueError(
            "Description.sensor microphone works only with a recording. Give a recording with acquire_cut.file."
        )
    return {"sensor": sensor, "tacho": tacho, "pulses": pulses}


@contextlib.contextmanager
def publish_cut_states(logbook: Logbook, setting: CutSetting) -> Iterator[StatePublisher[CutState]]:
    """Publish states from the move of the sensor on. An error raised within becomes the last state."""
    cut = f"{setting.program or 'reference cut'}, {setting.speed_rpm:g} rpm, {1e3 * setting.depth:g} mm"
    reason = "Move the sensor from the tool to the spindle housing. Run the spindle in air."
    publisher = StatePublisher(CutState(0, CutStep.SENSOR, f"{logbook.machine.machine.name}: {cut}", reason=reason))
    try:
        yield publisher
    except (KeyboardInterrupt, OSError, RuntimeError, ValueError) as error:
        reason = "Stopped at the terminal." if isinstance(error, KeyboardInterrupt) else format_error(error)
        publisher.show(word=CutStep.FAILED, reason=reason, level=None, left=None)
        raise


def evaluate_live_cut(
    logbook: Logbook, setting: CutSetting, signal: CutSignal, publisher: StatePublisher[CutState]
) -> list[CutComparison]:
    """Evaluate a recording and show the result of its last cut."""
    publisher.show(word=CutStep.JUDGING, reason="The cut is complete.", level=None, left=None, cut_seconds=None)
    comparisons = compare_cuts(logbook, setting, signal)
    last = comparisons[-1]
    word = CutStep[last.detected.verdict.upper().replace(" ", "_")]
    publisher.show(word=word, reason="", comparison=last, plots=build_cut_curves(last))
    return comparisons
