"""TDMS files of LabVIEW, read by npTDMS where that is installed (`pip install "lobewatch[tdms]"`)."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal, distinct
from acquisition.files.contents.heading import name_and_unit, role_of
from acquisition.files.readers.format import Format


def read_tdms(path: Path) -> Contents:
    """Its channels of numbers, a record a group; DataError where it is damaged, or npTDMS is not installed."""
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise DataError(f'{path}: TDMS is read by npTDMS; install it: pip install "lobewatch[tdms]"') from error
    try:
        file = TdmsFile.read(path)
        groups = file.groups()
        held = [list(_signals(group.channels(), i)) for i, group in enumerate(groups)]
        machines = distinct(group.name for group, signals in zip(groups, held, strict=True) if signals)
        created = [_start(channel) for group in groups for channel in group.channels()]
    except Exception as error:
        raise DataError(f"{path}: damaged or cut short ({type(error).__name__}: {error}); export it anew") from error
    return Contents(tuple(chain.from_iterable(held)), created=next(filter(None, created), None), machines=machines)


def _signals(channels: list[Any], record: int) -> Iterator[Signal]:
    for channel in channels:
        values = channel[:]
        if values.dtype.kind in "fiu" and values.size > 1:
            name, by_name = name_and_unit(channel.name)
            unit = str(
                channel.properties.get("unit_string", "") or channel.properties.get("NI_UnitDescription", "") or by_name
            )
            step = float(channel.properties.get("wf_increment", 0) or 0)
            rate = 1 / step if step > 0 else None
            yield Signal(name, values.astype(np.float64), role_of(name, unit), unit, rate=rate, record=record)


def _start(channel: Any) -> datetime | None:
    """Of the waveform; TDMS has it in UTC."""
    time = channel.properties.get("wf_start_time")
    if time is None:
        return None
    seconds = np.datetime64(time, "us").astype("int64") / 1e6
    return datetime.fromtimestamp(float(seconds), UTC)


def _is_tdms(head: bytes, _path: Path) -> bool:
    return head.startswith(b"TDSm")


TDMS = Format("tdms", "TDMS file", (".tdms",), _is_tdms, read_tdms)
