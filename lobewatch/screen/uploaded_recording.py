"""Evaluate the recording of a cut that a browser sent, in a subprocess with limits on length, time and memory."""

import hashlib
import json
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
import numpy as np

from acquisition import DataError
from acquisition.errors import format_error
from acquisition.files.cut_file import CutSignal
from acquisition.files.read_cut import MICROPHONE_SENSOR
from acquisition.files.readers.read_audio import MissingDecoderError, decode_audio
from acquisition.subprocess_guard import limit_resources, run_in_subprocess
from lobewatch.arrays import Floats
from lobewatch.logbook import Logbook
from lobewatch.logbook.cut_comparison import CutComparison, compare_cuts, find_worst_cut, store_recorded_cuts
from lobewatch.logbook.heard_cuts import ASSUMED_RANGE, CutFileRequest, hear_signal
from lobewatch.machine.journal.entries import CutEntry
from lobewatch.machine.settings.cut_tables import ProgramTable
from lobewatch.machine.settings.display_units import shown_units
from lobewatch.machine.settings.requested_cut import CutSetting, find_cut_setting
from lobewatch.machine.settings.setup_tables import SpeedTable
from lobewatch.machine.settings.toml import find_plausible_ranges
from lobewatch.show.cuts.next_speeds import next_speeds_json, next_speeds_texts
from lobewatch.show.cuts.recorded_cuts import reason_text, recorded_cut_json, recording_texts
from lobewatch.show.listen_answers import stored_answer
from lobewatch.show.terminal.option_names import with_option_names_inside
from lobewatch.show.terminal.output import JsonObject, remark_lines

MAX_UPLOAD_BYTES = 50_000_000
"""Largest size of an uploaded recording (bytes); chosen, five minutes of stereo WAV at 44.1 kHz have 53 MB."""
MAX_RECORDING_SECONDS = 300.0
"""Longest recording (s); chosen."""
SAMPLE_RATES = (8000.0, 96_000.0)
"""Lowest and highest sample rate (Hz): that of a telephone, and twice that of a good recorder."""
DEPTHS_MM = (0.001, 300.0)
"""Lowest and highest depth of cut (mm); chosen, 300 mm is longer than any flute."""
MAX_CPU_SECONDS = 20.0
"""Longest processor time of decoding and evaluation (s); chosen."""
MAX_WAIT_SECONDS = 180.0
"""Longest time of decoding and evaluation (s), for a busy computer or one without limits of processor time; chosen."""
MAX_MEMORY = 3e9
"""Largest memory of decoding and evaluation (bytes); chosen, twice that of five minutes."""


class UploadedCut(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Values that a person enters with the recording of a cut."""

    teeth: int
    """Number of flutes."""
    speed_rpm: float
    """Set spindle speed (rpm)."""
    low_rpm: float | None = None
    """Lowest speed of the machine (rpm)."""
    high_rpm: float | None = None
    """Highest speed of the machine (rpm)."""
    depth_mm: float | None = None
    """Axial depth of cut (mm)."""
    machine: str = ""
    """Machine in whose journal the cut is kept; empty to keep it nowhere."""
    program: str = ""
    """Program of that machine, or "reference cut"."""

    @property
    def range_rpm(self) -> tuple[float, float]:
        """Speed range of the machine (rpm), an unknown end from `ASSUMED_RANGE`."""
        low, high = (share * self.speed_rpm for share in ASSUMED_RANGE)
        return low if self.low_rpm is None else self.low_rpm, high if self.high_rpm is None else self.high_rpm

    @property
    def request(self) -> CutFileRequest:
        """Request with these values for `hear_signal`."""
        return CutFileRequest(self.teeth, self.speed_rpm, self.depth_mm, self.range_rpm)


LABELS = {
    "teeth": "number of flutes",
    "speed_rpm": "speed",
    "low_rpm": "lowest speed",
    "high_rpm": "highest speed",
    "depth_mm": "depth",
}
"""Names of the entered values."""


def parse_uploaded_cut(query: Mapping[str, str]) -> UploadedCut:
    """Parse the values that a person entered; ValueError that names an invalid value and its limits."""
    try:
        cut = msgspec.convert(dict(query), UploadedCut, strict=False)
    except msgspec.ValidationError:
        raise ValueError("flutes or speed are missing or no numbers. Enter both.") from None
    teeth, speeds = find_plausible_ranges(ProgramTable)["teeth"], find_plausible_ranges(SpeedTable)
    speed = speeds["low_rpm"].low, speeds["high_rpm"].high
    limits = dict.fromkeys(("speed_rpm", "low_rpm", "high_rpm"), speed)
    limits |= {"teeth": (teeth.low, teeth.high), "depth_mm": DEPTHS_MM}
    for key, (low, high) in limits.items():
        value = getattr(cut, key)
        if value is not None and not low <= value <= high:
            raise ValueError(f"{LABELS[key]} {value:g} is not from {low:g} to {high:g}. Correct this value.")
    low, high = cut.range_rpm
    if not (low <= cut.speed_rpm <= high and low < high):
        text = f"speed {cut.speed_rpm:g} is not between the lowest speed {low:g} and the highest speed {high:g}"
        raise ValueError(f"{text}. Correct one of them.")
    if bool(cut.machine) != bool(cut.program):
        missing = "program" if cut.machine else "machine"
        raise ValueError(f"no {missing} is chosen. Choose machine and program, or neither.")
    return cut


def evaluate_upload(content: bytes | bytearray, cut: UploadedCut, folder: Path | None = None) -> JsonObject:
    """Return the result of a recording, or `error` and its `code`, whatever the file contains.

    Codes: "unreadable", "no-decoder", "sample-rate", "too-long", "too-large", "too-slow", "not-kept", "failed".

    Parameters
    ----------
    content
        Bytes of the file.
    cut
        Entered values.
    folder
        Machine folder in whose journal the cut is kept; None to keep it nowhere.
    """
    try:
        entered = msgspec.json.encode(cut).decode()
        arguments = entered, str(MAX_CPU_SECONDS), str(MAX_MEMORY), *([str(folder)] if folder else [])
        output = run_in_subprocess(__name__, *arguments, patience=MAX_WAIT_SECONDS, content=content)
    except subprocess.TimeoutExpired:
        return _too_slow(content, folder)
    except subprocess.CalledProcessError as error:
        if -error.returncode == getattr(signal, "SIGXCPU", None):  # Windows has no such signal
            return _too_slow(content, folder)
        crashed = error.returncode < 0
        return refuse("unreadable", "the file crashes its decoder. Record the cut again.") if crashed else _failed()
    answer: JsonObject = json.loads(output)
    return answer


def refuse(code: str, text: str) -> JsonObject:
    """Return the answer to a recording that is not evaluated."""
    return {"code": code, "error": text}


def _too_slow(content: bytes | bytearray, folder: Path | None) -> JsonObject:
    """Return the answer to a recording whose evaluation was stopped, perhaps after its cuts were stored."""
    kept = [cut.id for cut in _find_kept_cuts(Logbook.open(folder), content)] if folder else []
    if kept:
        text = f"the cut is kept as {', '.join(kept)}, but the next speeds need more than {MAX_CPU_SECONDS:g} s"
        return refuse("too-slow", f"{text}. Run lobewatch suggest on the computer.") | {"saved": kept}
    return refuse("too-slow", f"the recording needs more than {MAX_CPU_SECONDS:g} s of computing. Send a shorter one.")


def _find_kept_cuts(logbook: Logbook, content: bytes | bytearray) -> list[CutEntry]:
    """Find the cuts of a file that are in the journal already, which the same file must not store again."""
    upload = _hash_upload(content)
    return [cut for cut in logbook.files.contents.cuts if cut.upload == upload and not cut.excluded]


def _hash_upload(content: bytes | bytearray) -> str:
    return hashlib.sha256(content).hexdigest()


def _failed() -> JsonObject:
    return refuse("failed", "lobewatch could not evaluate this recording. Record the cut again.")


def main() -> None:
    """Write the result of the recording on standard input to standard output as JSON."""
    cut = msgspec.json.decode(sys.argv[1], type=UploadedCut)
    content = sys.stdin.buffer.read()
    limit_resources(*map(float, sys.argv[2:4]))
    folder = Path(sys.argv[4]) if len(sys.argv) > 4 else None
    sys.stdout.write(json.dumps(with_option_names_inside(_evaluate(content, cut, folder))))


def _evaluate(content: bytes, cut: UploadedCut, folder: Path | None) -> JsonObject:
    try:
        rate, columns = decode_audio(content, "recording", MAX_RECORDING_SECONDS)
        if fault := _find_fault(rate, columns):
            return fault
        loudest = columns[int(np.argmax(np.std(columns, axis=1)))]
        signal = CutSignal(loudest, rate, sensor=MICROPHONE_SENSOR)
        return _hear(signal, cut) if folder is None else _keep(signal, cut, folder, content)
    except MissingDecoderError as error:
        return refuse("no-decoder", str(error))
    except DataError as error:
        return refuse("unreadable", str(error))
    except MemoryError:
        text = f"the recording needs more than {MAX_MEMORY / 1e9:g} GB of memory. Send a shorter one."
        return refuse("too-large", text)


def _find_fault(rate: float, columns: Floats) -> JsonObject | None:
    """Return why a decoded recording, shape (channels, n), cannot be evaluated; None if it can."""
    low, high = SAMPLE_RATES
    if not low <= rate <= high:
        text = f"sample rate {rate:g} Hz is not from {low:g} to {high:g} Hz. Record with 48000 Hz."
        return refuse("sample-rate", text)
    if columns.shape[1] > MAX_RECORDING_SECONDS * rate:
        text = f"the recording is longer than {MAX_RECORDING_SECONDS / 60:g} min. Send a shorter one."
        return refuse("too-long", text)
    if not np.all(np.isfinite(columns)):
        return refuse("unreadable", "the recording has infinite or missing values. Record the cut again.")
    return None


def _hear(signal: CutSignal, cut: UploadedCut) -> JsonObject:
    """Evaluate a cut of an unknown machine, and keep it nowhere."""
    comparisons, found = hear_signal(signal, "recording", cut.request)
    shown = recording_texts(comparisons)
    return _answer(comparisons, next_speeds_json(found), shown, next_speeds_texts(found))


def _keep(signal: CutSignal, cut: UploadedCut, folder: Path, content: bytes) -> JsonObject:
    """Evaluate a cut of a machine, and keep it in its journal once, as `listen` does with a file."""
    try:
        logbook = Logbook.open(folder)
        setting = find_cut_setting(logbook.machine, cut.program, cut.speed_rpm, cut.depth_mm)
        kept = _find_kept_cuts(logbook, content)
        if fault := _find_setting_fault(setting, cut, kept):
            return refuse("not-kept", fault)
        logbook.folder.refuse_damage()
        comparisons = compare_cuts(logbook, setting, signal)
        earlier = [entry for entry in logbook.cuts if entry not in kept]
        upload, kept = _hash_upload(content), kept[: len(comparisons)]
        stored = store_recorded_cuts(logbook.folder, comparisons, signal, None, upload, kept)
    except (OSError, ValueError) as error:
        return refuse("not-kept", format_error(error))
    with shown_units(logbook.machine.machine.units):
        speeds, texts, remarks = stored_answer(logbook, comparisons, earlier, stored)
        shown = [*recording_texts(comparisons), *remark_lines(remarks)]
    answer = _answer(comparisons, {"next_speeds": [], **speeds}, shown, texts if speeds else ())
    return answer | {"saved": [entry.id for entry in stored]}


def _find_setting_fault(setting: CutSetting, cut: UploadedCut, kept: Sequence[CutEntry]) -> str:
    """Return why a cut cannot be kept with a setting; empty if it can."""
    if setting.cut.teeth != cut.teeth:
        text = f"{cut.teeth} flutes are not the {setting.cut.teeth} flutes of {cut.program}"
        return f"{text}. Correct the number of flutes."
    as_entered = setting.program, setting.speed_rpm, setting.depth
    if any((entry.program, entry.commanded_rpm, entry.depth) != as_entered for entry in kept):
        ids = ", ".join(entry.id for entry in kept)
        return f"this recording is kept as {ids} with other values. Exclude {ids} first."
    return ""


def _answer(
    comparisons: Sequence[CutComparison], speeds: JsonObject, shown: Sequence[str], more: Sequence[object]
) -> JsonObject:
    """Return the answer of the page: the worst cut of a recording, the next speeds and texts."""
    worst = find_worst_cut(comparisons)
    finding = reason_text(worst) if worst.detected.verdict == "cannot tell" else ""
    sentence = next((text for text in reversed(more) if isinstance(text, str)), "")
    return recorded_cut_json(worst) | speeds | {"finding": finding, "texts": shown, "next_text": sentence}


if __name__ == "__main__":
    main()
