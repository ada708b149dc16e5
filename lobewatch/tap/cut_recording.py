"""Record a cut with the accelerometer on the spindle housing and evaluate it live."""

import contextlib
import enum
from collections.abc import Callable, Generator, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args

import numpy as np

from acquisition import DataError, Description, Device, DeviceError
from acquisition.errors import format_error, join_sentences
from acquisition.files.cut_file import CutSignal
from acquisition.files.read_cut import read_cut_recording
from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection.cut_detection import find_cuts
from lobewatch.cuts.chatter_detection.cut_evaluation import group_peaks
from lobewatch.cuts.chatter_detection.cut_search import CutSearch
from lobewatch.logbook import Logbook
from lobewatch.logbook.cut_comparison import CutComparison, CutSensor, compare_cuts
from lobewatch.machine import MachineFolder, check_device_rate
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.tap.cut_stream import KEPT_SIGNAL_SECONDS, SignalBuffer
from lobewatch.tap.device_connection import LEVEL_WINDOW, REPLAY_PREFIX, label_device, open_device
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
UNCLEAR_CUT_INTERVAL = 2.0
"""Time to the next search if the whole signal does not show the cut that its bands show (s); chosen."""
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


Publish = Callable[..., None]
"""Function called with changed fields of CutState."""


def record_cuts(
    device: Device, turn: float, time_limit: float, show: Callable[[str], None], publish: Publish = lambda **_: None
) -> Iterator[CutSignal]:
    """Record one whole cut of a started device after the other, each from the air before it to the air after it.

    turn: time of a spindle revolution (s). time_limit: longest wait for the end of a cut (s), after which the
    recording ends. show: called with what is awaited. publish: called with the changed fields of CutState. All
    acceleration channels are recorded. DataError without an accelerometer or if no cut is detected in time,
    DeviceError if a sensor is dead.
    """
    rows = [i for i, channel in enumerate(device.channels) if channel.quantity == "acceleration"]
    if not rows:
        cure = "Plug the accelerometer in, or add a [[daq.channel]] for it to machine.toml"
        raise DataError(join_sentences("the device has no acceleration channel", cure))
    buffer = SignalBuffer([device.channels[row] for row in rows], rows, device.sample_rate)
    show("Recording. Start the cut.")
    recorder = _CutRecorder(buffer, CutSearch(device.sample_rate, turn, KEPT_SIGNAL_SECONDS), turn, show, publish)
    n_cuts, until = 0, time_limit
    for block in device.blocks():
        recorder.search.add(buffer.add(block))
        recorder.watch(until)
        signal = recorder.look() if buffer.seconds >= recorder.next_look else None
        if signal is not None:
            yield signal
            n_cuts, until = n_cuts + 1, buffer.seconds + time_limit
        if buffer.seconds > until:
            break
    if not n_cuts:
        cure = "Start with the spindle running in air, then cut, or increase record_cuts.time_limit"
        raise DataError(join_sentences(f"no cut was detected in {time_limit:g} s", cure))


WAITING: Mapping[str, Any] = {"word": CutStep.LISTENING, "reason": SENSOR_ON_HOUSING_TEXT}
"""Fields of CutState while the first cut is awaited. After a cut its result stays to be seen."""


@dataclass
class _CutRecorder:
    """Watcher of a stream for whole cuts."""

    buffer: SignalBuffer
    search: CutSearch
    turn: float
    show: Callable[[str], None]
    publish: Publish
    next_look: float = CUT_SEARCH_INTERVAL
    next_level: float = LEVEL_WINDOW
    is_checked: bool = False
    waiting: Mapping[str, Any] = field(default_factory=lambda: WAITING)
    """Fields of CutState while a cut is awaited."""

    def watch(self, until: float) -> None:
        """Check the sensors once, and publish the level again and again; until: end of the wait (s)."""
        seconds = self.buffer.seconds
        if not self.is_checked and seconds >= SENSOR_CHECK_DELAY:
            _check_sensor_signal(self.buffer)
            self.is_checked = True
        if seconds >= self.next_level:
            self.next_level = seconds + LEVEL_WINDOW
            self.publish(level=self.buffer.level, left=max(until - seconds, 0.0))

    def look(self) -> CutSignal | None:
        """Look for a cut at little cost, and return it if it is whole."""
        now = self.buffer.seconds
        self.next_look = now + CUT_SEARCH_INTERVAL
        newest = self.search.find_newest()
        if newest is None:
            if self.is_checked:
                self.publish(**self.waiting, cut_seconds=None)
            return None
        begin, end = newest
        if now - end > AIR_AFTER_CUT or end - begin > MAX_CUT_SECONDS:
            return self._take_whole_cut(now)
        self._show_cutting(end - begin)
        return None

    def _take_whole_cut(self, now: float) -> CutSignal | None:
        """Return the newest cut if it is whole and usable; if it is over and not usable, ask for another one."""
        start = self.buffer.first / self.buffer.rate
        kept = self.buffer.take(start, now)
        parts = find_cuts(kept.acceleration, kept.sample_rate, self.turn)[-1]
        begin, end = start + parts.begin, start + parts.end
        has_ended = np.isfinite(end) and now - end > AIR_AFTER_CUT
        if has_ended and parts.reason:
            self._forget(now)
            self.show(CUT_TOO_SHORT_TEXT)
            self.waiting = {"word": CutStep.AGAIN, "reason": CUT_TOO_SHORT_TEXT}
            self.publish(**self.waiting, cut_seconds=None)
        elif not parts.reason and (has_ended or end - begin > MAX_CUT_SECONDS):
            signal = self.buffer.take(max(begin - AIR_BEFORE_CUT, start), end + AIR_AFTER_CUT)
            self._forget(end)
            self.waiting = {}
            return signal
        else:
            self.next_look = now + UNCLEAR_CUT_INTERVAL
            if np.isfinite(begin):
                self._show_cutting(end - begin)
        return None

    def _show_cutting(self, seconds: float) -> None:
        self.publish(
            word=CutStep.CUTTING, reason=CUT_RUNNING_TEXT, cut_seconds=seconds, comparison=None, saved="", plots=None
        )

    def _forget(self, before: float) -> None:
        """Forget the stream before a time (s)."""
        self.buffer.forget(before)
        self.search.forget(before)


def _check_sensor_signal(buffer: SignalBuffer) -> None:
    for channel, codes in zip(buffer.channels, np.concatenate(buffer.codes, axis=1), strict=True):
        low, high = channel.rails
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
) -> Generator[CutSignal, None, None]:
    """Read a cut from a file, or record one after the other with the device of machine.toml.

    file: replaces the device. description: what the file does not state itself. time_limit: longest wait for a cut (s).
    show: called with what to do. publish: as in record_cuts. ValueError without a port, DataError for a file without
    such a recording or if no cut is detected, DeviceError if no device answers.
    """
    if file is not None:
        yield read_cut_recording(file, description)
        return
    port = port or folder.machine.daq.port
    if not port:
        raise ValueError(
            f"DAQ port missing. Give acquire_cut.port or acquire_cut.file, or set port in [daq] of {folder.toml}."
        )
    if port.startswith(REPLAY_PREFIX):
        cure = "Give the recording of a cut with acquire_cut.file"
        raise ValueError(join_sentences(f"acquire_cut.port {port}: this is a recording of hits", cure))
    show("Move the accelerometer from the tool to the spindle housing. Run the spindle in air.")
    show(
        f"Cut: {setting.program or 'reference cut'}, {setting.speed_rpm:g} rpm, {LENGTH.text(1e3 * setting.depth)} deep"
    )
    with open_device(folder.machine.daq, port) as device:
        with folder.locked():
            check_device_rate(folder, device)
        publish(device=label_device(device))
        device.start()
        yield from record_cuts(device, 60 / setting.speed_rpm, time_limit, show, publish)


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
    cut = f"{setting.program or 'reference cut'}, {setting.speed_rpm:g} rpm, {LENGTH.text(1e3 * setting.depth)}"
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
