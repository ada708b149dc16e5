"""Recorded files of other programs and our own, told apart by their content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents
from acquisition.files.contents.description import Description
from acquisition.files.contents.joined import joined
from acquisition.files.contents.ledger import Fact
from acquisition.files.contents.recording import Recording, understood
from acquisition.files.formats import broken_formats, format_of
from acquisition.files.readers.format import Format
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.tap import Circumstances
from acquisition.verdicts.average_good import average_good

Result = TypeVar("Result")
NOTHING = Description()
"""A person who says nothing."""
DECIMAL_SIGNS = {"": "", "comma": ",", "point": "."}
"""Decimal signs of a text by what a person calls them."""


def look(path: Path | str, said: Description = NOTHING) -> Recording:
    """A recorded file as it is understood, what is missing or wrong in it told as its `complaint`.

    DataError for a file that is damaged or of no format that is known.

    >>> from tempfile import TemporaryDirectory
    >>> line = np.arange(400.0, 500.0)
    >>> with TemporaryDirectory() as folder:
    ...     table = np.column_stack([line, 0 * line, 0 * line - 1e-6])
    ...     np.savetxt(f"{folder}/frf.csv", table, delimiter=",", header="frequency [Hz],real,imag", comments="")
    ...     unclear = look(f"{folder}/frf.csv")
    ...     clear = look(f"{folder}/frf.csv", Description(unit="m/N"))
    >>> print(unclear.complaint)
    it does not say: the unit of real (--unit, such as m/N, um/N, g/N)
    >>> clear.complaint, clear.frf.frequency.size
    ('', 100)
    """
    path = Path(path)
    file_format = format_of(path)
    held = contents_of(file_format, path, said)
    if isinstance(held, Contents):
        contents = held if said.force is None else joined(held, _force_contents(said.force, said), said.force)
        return _guarded(file_format, path, lambda: understood(path, file_format.title, contents, said))
    about = file_format.recorded_as(path)
    hits, frf = ((), held) if isinstance(held, Frf) else (tuple(held), None)
    options = said.of_signals()
    complaint = f"a {file_format.title} says itself what it holds; leave out {', '.join(options)}" if options else ""
    recording = Recording(path, file_format.title, hits, frf, tuple(_facts(hits, frf)), complaint)
    return recording if about is None else _labelled(recording, about)


def contents_of(file_format: Format, path: Path, said: Description) -> Contents | list[Hit] | Frf:
    """What a file of this format holds, behind the lines that are passed over of a text; DataError where it is none."""
    read_from, option = file_format.read_from, f"--skip {said.skip}" if said.skip else f"--decimal {said.decimal}"
    if not said.skip and not said.decimal:
        return _guarded(file_format, path, lambda: file_format.read(path))
    if read_from is None:
        raise DataError(f"{path}: {option}: a {file_format.title} is no text of lines; leave the option out")
    if said.decimal not in DECIMAL_SIGNS:
        raise DataError(f"{path}: {option}: is no decimal sign; give comma or point")
    sign = DECIMAL_SIGNS[said.decimal]
    return _guarded(file_format, path, lambda: read_from(path, said.skip or 0, sign))


def _force_contents(path: Path, said: Description) -> Contents:
    file_format = format_of(path)
    held = contents_of(file_format, path, said if file_format.read_from else NOTHING)
    if not isinstance(held, Contents):
        raise DataError(f"--force {path}: a {file_format.title}; it needs no other file")
    return held


def read_hits(path: Path | str, said: Description = NOTHING) -> list[Hit]:
    """The hits in a recorded file of any known format, bad ones too (see `check_hit`); DataError where there are none.

    >>> from tempfile import TemporaryDirectory
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> force = 200 * np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)  # N
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> with TemporaryDirectory() as folder:
    ...     table = np.column_stack([time, force, 200 * structure.response(time, 1e-3) / STANDARD_GRAVITY])
    ...     names = "time [s],force [N],response [g]"
    ...     np.savetxt(f"{folder}/hit.csv", table, delimiter=",", header=names, comments="")
    ...     (hit,) = read_hits(f"{folder}/hit.csv")
    >>> f"{hit.sample_rate:.0f} Hz, {hit.force.max():.0f} N, {abs(hit.acceleration).max():.1f} m/s^2"
    '10240 Hz, 199 N, 102.1 m/s^2'
    """
    recording = read_recording(path, said)
    if isinstance(recording, Frf):
        raise DataError(f"{path}: holds an FRF, not the hits it was made from")
    return recording


def read_frf(path: Path | str, said: Description = NOTHING) -> Frf:
    """The FRF that a recorded file holds, or that estimated (H1) from its good hits.

    DataError where it holds neither, or no good hit.

    >>> from tempfile import TemporaryDirectory
    >>> line = np.arange(400.0, 500.0)
    >>> with TemporaryDirectory() as folder:
    ...     table = np.column_stack([line, 0 * line, 0 * line - 1.0])
    ...     names = "frequency [Hz],real [um/N],imag [um/N]"
    ...     np.savetxt(f"{folder}/frf.csv", table, delimiter=",", header=names, comments="")
    ...     frf = read_frf(f"{folder}/frf.csv")
    >>> complex(frf.receptance[0])  # m/N
    -1e-06j
    """
    path = Path(path)
    file_format = format_of(path)
    if file_format.read_frf is not None:
        return file_format.read_frf(path)
    recording = read_recording(path, said)
    if isinstance(recording, Frf):
        return recording
    try:
        frf = average_good(recording)[0]
    except DataError as error:
        raise DataError(f"{path}: {error}") from error
    if frf is None:
        raise DataError(f"{path}: it holds no force, and so no FRF")
    return frf


def read_recording(path: Path | str, said: Description = NOTHING) -> list[Hit] | Frf:
    """Hits where the file holds time histories, an FRF where it holds one; DataError where it holds neither."""
    recording = look(path, said).checked()
    return list(recording.hits) if recording.frf is None else recording.frf


def _guarded(file_format: Format, path: Path, work: Callable[[], Result]) -> Result:
    """What some work on a file gives; DataError for whatever goes wrong in it."""
    try:
        return work()
    except DataError as error:
        raise DataError(f"{error}{broken_formats()}") from error
    except OSError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise DataError(
            f"{path}: cannot be read as {file_format.title} ({reason}); export it in another format"
        ) from error


def _facts(hits: Sequence[Hit], frf: Frf | None) -> list[Fact]:
    if frf is not None:
        span = f"{frf.frequency.size}, {frf.frequency[0]:.4g} to {frf.frequency[-1]:.6g} Hz"
        return [Fact("lines", span, "file"), Fact("unit", f"m/N, from {frf.measured_as}", "file")]
    unit, force = Fact("unit", "m/s^2 (acceleration)", "file"), Fact("force", "N", "file")
    return [Fact("sample rate", f"{hits[0].sample_rate:.8g} Hz", "file"), *([force] if hits[0].has_force else []), unit]


def _labelled(recording: Recording, about: Circumstances) -> Recording:
    return replace(
        recording,
        created=about.created,
        tool=about.tool,
        direction=about.direction,
        operator=about.operator,
        device=about.device,
        conditions=about.conditions if about.machine else None,
    )
