"""The recording of a cut, by accelerometers or a microphone, in a file of any known format."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents
from acquisition.files.contents.description import Description
from acquisition.files.contents.ledger import Ledger
from acquisition.files.contents.settle_sound import settle_sound
from acquisition.files.cut_file import CutSignal, is_cut_file, read_cut_signal
from acquisition.files.formats import format_of
from acquisition.files.read_recording import NOTHING, contents_of


def read_sound(path: Path | str, said: Description = NOTHING) -> CutSignal:
    """What accelerometers or a microphone have recorded; DataError for a file without, or that says not enough."""
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    if is_cut_file(path):
        return read_cut_signal(path)[0]
    file_format = format_of(path)
    contents = contents_of(file_format, path, said)
    if not isinstance(contents, Contents):
        raise DataError(f"{path}: a {file_format.title}, not the recording of a cut")
    ledger = Ledger()
    sound = settle_sound(contents, said, ledger)
    if sound is None or not ledger.is_clean:
        raise DataError(f"{path}: {ledger.complaint()}")
    if not np.all(np.isfinite(sound[0])):
        raise DataError(f"{path}: holds values that are no numbers; export it again")
    values, rate, speed = sound
    return CutSignal(values, rate, sensor=said.sensor, speed_rpm=speed)
