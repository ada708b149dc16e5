"""SDyPy SEP005 time series as JSON: a list of dictionaries with data, name, unit_str and fs (or time)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal, distinct
from acquisition.files.contents.heading import role_of
from acquisition.files.readers.format import Format

_NEEDED = ("data", "name", "unit_str")


def read_sep005(path: Path) -> Contents:
    """Its channels; DataError where it is damaged or no list of time series."""
    try:
        channels = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise DataError(f"{path}: damaged or cut short ({error})") from error
    return contents_of(str(path), channels)


def contents_of(place: str, channels: Sequence[Mapping[str, Any]]) -> Contents:
    """What a list of SEP005 dictionaries holds; place: for errors. Channels of one group were recorded together."""
    signals, groups = list[Signal](), dict[str, int]()
    for number, channel in enumerate(channels, 1):
        where = f"{place}: channel {number}"
        missing = [key for key in _NEEDED if key not in channel] + ([] if {"fs", "time"} & channel.keys() else ["fs"])
        if missing:
            raise DataError(f"{where} has no {', '.join(missing)}; SEP005 asks for them")
        record = groups.setdefault(str(channel.get("group", "")), len(groups))
        try:
            values = np.asarray(channel["data"], dtype=np.float64).ravel()
            rate = None if channel.get("fs") is None else float(channel["fs"])
            time = None if rate is not None else np.asarray(channel["time"], dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise DataError(f"{where}: {error}") from error
        name, unit = str(channel["name"]), str(channel["unit_str"] or "")
        if rate is not None and not rate > 0:
            raise DataError(f"{where}: fs={rate} Hz is not > 0")
        signals.append(Signal(name, values, role_of(name, unit), unit, rate=rate, record=record))
        signals += [] if time is None else [Signal("time", time, "time", "s", record=record)]
    first = channels[0] if channels else {}
    return Contents(
        tuple(signals),
        created=_time(first.get("start_timestamp")),
        direction=str(first.get("direction", "")),
        tool=str(first.get("tool", "")),
        machines=distinct(groups),
    )


def _time(text: object) -> datetime | None:
    try:
        return datetime.fromisoformat(str(text)).astimezone()
    except (ValueError, OverflowError, OSError):
        return None


def _is_sep005(head: bytes, _path: Path) -> bool:
    return head.lstrip().startswith(b"[") and b"{" in head[:200] and b'"' in head[:200]


SEP005 = Format("sep005", "SDyPy SEP005 time series", (".json",), _is_sep005, read_sep005)
