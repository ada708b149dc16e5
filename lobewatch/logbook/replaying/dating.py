"""When a recording was made: by option, by the name of its file, or by what stands in it; never by the file system."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from pathlib import Path

from lobewatch.measuring.clock import is_ahead

_PARTS = {"%Y": r"\d{4}", "%y": r"\d{2}", "%m": r"\d{1,2}", "%d": r"\d{1,2}", "%H": r"\d{1,2}", "%M": r"\d{1,2}"}
_PARTS |= {"%S": r"\d{1,2}", "%b": r"[^\W\d]{3,4}", "%B": r"[^\W\d]+", "%j": r"\d{3}", "%%": "%"}
_FIXED = {part: re.sub(r"\{1,2\}", "{2}", pattern) for part, pattern in _PARTS.items()}


def date_in_name(file: Path, pattern: str) -> datetime:
    """The date that stands in a file's name, or in its path where the pattern has a "/"; of local time.

    ValueError where it stands there not at all, or the pattern holds no year, month or day.
    """
    directives = re.findall(r"%.", pattern)
    unknown = [one for one in directives if one not in _PARTS]
    if unknown or not directives:
        raise ValueError(f"--date-pattern {pattern!r}: give it with {', '.join(_PARTS)}, such as %Y%m%d")
    text = file.absolute().as_posix() if "/" in pattern else file.name
    for parts in (_FIXED, _PARTS):
        pieces = (parts.get(piece, re.escape(piece)) for piece in re.split(r"(%.)", pattern))
        for found in re.finditer(rf"(?<!\d){''.join(pieces)}(?!\d)", text):
            try:
                return datetime.strptime(found[0], pattern).astimezone()
            except (ValueError, OverflowError, OSError):
                continue
    raise ValueError(f"{file}: no date like --date-pattern {pattern!r} in {text!r}")


def checked_time(file: Path, time: datetime) -> datetime:
    """With its zone; ValueError for a time in the future, or one that no calendar of UTC has."""
    try:
        created = time.astimezone()
    except (OverflowError, ValueError, OSError) as error:
        raise ValueError(f"{file}: recorded on {time}: out of range; give --date from year 2 on") from error
    if is_ahead(created, datetime.now(UTC)):
        raise ValueError(
            f"{file}: recorded on {created:%Y-%m-%d}, in the future; give the day with --date, or set the clock right"
        )
    return created
