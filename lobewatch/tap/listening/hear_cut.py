"""A cut heard, from a file or from the device that machine.toml names, judged, and shown meanwhile."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args

from acquisition import Description
from acquisition.errors import failure_text
from acquisition.files.cut_file import CutSignal
from acquisition.files.read_sound import read_sound
from lobewatch.logbook import Logbook
from lobewatch.logbook.cut_comparison import CutComparison, Sensor, compare_cuts
from lobewatch.machine import MachineFolder, checked_rate
from lobewatch.machine.settings.cut_setting import CutSetting
from lobewatch.tap.listening.cut_state import CutState, CutStep, cut_curves, word_of
from lobewatch.tap.listening.record_cut import record_cut
from lobewatch.tap.plug import REPLAY, open_source
from lobewatch.tap.publisher import Pictures


def hear_cut(
    folder: MachineFolder,
    setting: CutSetting,
    file: Path | None,
    port: str,
    patience: float,
    description: Description,
    show: Callable[[str], None],
    picture: Callable[..., None],
) -> CutSignal:
    """The sound at the accelerometer; file: in place of the device, description: what the file does not say itself.

    patience: how long a cut is waited for (s); show: told what to do; picture: as in record_cut. ValueError without a
    port, DataError for a file that holds no such recording and where no cut is heard, DeviceError where no device
    answers.
    """
    if file is not None:
        return read_sound(file, description)
    port = port or folder.machine.daq.port
    if not port:
        raise ValueError(f"no port: give --port, --file, or port in [daq] of {folder.toml}")
    if port.startswith(REPLAY):
        raise ValueError(f"--port {port}: a recording of hits; give the recording of a cut with --file")
    show("move the accelerometer from the tool to the spindle housing, and let the spindle turn in air")
    show(f"to be cut: {setting.speed_rpm:g} rpm, {1e3 * setting.depth:g} mm deep, {setting.program or 'reference cut'}")
    with open_source(folder.machine.daq, port) as device:
        with folder.locked():
            checked_rate(folder, device)
        picture(device=f"{device.identity.model}, {device.sample_rate:g} Hz")
        device.start()
        return record_cut(device, 60 / setting.speed_rpm, patience, show, picture)


def checked_sensor(sensor: str, file: Path | None) -> str:
    """A kind of sensor; ValueError for one that is not known, and for a microphone at a device."""
    if sensor not in get_args(Sensor):
        raise ValueError(f"--sensor {sensor}: none of {', '.join(get_args(Sensor))}")
    if sensor == "microphone" and file is None:
        raise ValueError("--sensor microphone is for a --file; a device hears by its accelerometer")
    return sensor


def checked_tacho(tacho: str, pulses: int | None, file: Path | None) -> dict[str, Any]:
    """Fields of a description of a tachometer; ValueError at a device, which has none."""
    if file is None and (tacho or pulses is not None):
        given = f"--tacho {tacho}" if tacho else f"--pulses {pulses}"
        raise ValueError(f"{given} is for a --file; of a device only the accelerometer is heard")
    return {"tacho": tacho, "pulses": pulses}


@contextlib.contextmanager
def cut_pictures(logbook: Logbook, setting: CutSetting) -> Iterator[Pictures[CutState]]:
    """Begin with where the sensor belongs; what is raised within is the last of them."""
    cut = f"{setting.program or 'reference cut'}, {setting.speed_rpm:g} rpm, {1e3 * setting.depth:g} mm"
    title, reason = f"{logbook.machine.machine.name}: {cut}", "From the tool to the housing; spindle turning in air."
    pictures = Pictures(CutState(0, CutStep.SENSOR, title, reason=reason), time.monotonic)
    try:
        yield pictures
    except KeyboardInterrupt:
        pictures.show(word=CutStep.FAILED, reason="Stopped at the terminal.", level=None, left=None)
        raise
    except (OSError, RuntimeError, ValueError) as error:
        pictures.show(word=CutStep.FAILED, reason=failure_text(error), level=None, left=None)
        raise


def judge_live(
    logbook: Logbook, setting: CutSetting, signal: CutSignal, pictures: Pictures[CutState]
) -> list[CutComparison]:
    """Listen to a recording, and show the word on its last cut."""
    pictures.show(word=CutStep.JUDGING, reason="The cut is over.", level=None, left=None, cut_seconds=None)
    comparisons = compare_cuts(logbook, setting, signal)
    last = comparisons[-1]
    pictures.show(word=word_of(last), reason="", comparison=last, plots=cut_curves(last))
    return comparisons
