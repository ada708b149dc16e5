"""The sound of a cut: from a file, or from the device that machine.toml names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from acquisition import Description
from acquisition.files.cut_file import CutSignal
from acquisition.files.read_sound import read_sound
from lobewatch.machine import MachineFolder, checked_rate
from lobewatch.machine.settings.cut_setting import CutSetting
from lobewatch.tap.listening.record_cut import record_cut
from lobewatch.tap.plug import REPLAY, open_source


def hear_cut(
    folder: MachineFolder,
    setting: CutSetting,
    file: Path | None,
    port: str,
    patience: float,
    said: Description,
    show: Callable[[str], None],
    picture: Callable[..., None],
) -> CutSignal:
    """What the accelerometer hears; file: in place of the device, said: what it does not say itself.

    patience: how long a cut is waited for (s); show: told what to do; picture: as in record_cut. ValueError without a
    port, DataError for a file that holds no such recording and where no cut is heard, DeviceError where no device
    answers.
    """
    if file is not None:
        return read_sound(file, said)
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
