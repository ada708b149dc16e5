"""Tables of JSON keys and the record attributes they are read from."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import reduce
from typing import Any

FIELD_PATTERN = re.compile(r"(\w+)(?:=([\w.]+))?(?:([*/])([\d.e]+))?")
"""Key, attribute path, and factor or divisor of a unit."""

JsonFields = Callable[[Any], dict[str, Any]]
"""Function that makes the JSON object of a record."""


def json_fields(table: str) -> JsonFields:
    """Return a function that makes the JSON object of a record, its keys in the order of the table.

    An entry of the table is a key, `key=path.of.attribute`, or either of them with the factor or divisor of its unit.
    The value is None where a part of the path is None.

    >>> from types import SimpleNamespace
    >>> pocket = SimpleNamespace(speed_rpm=6000.0, tip=SimpleNamespace(depth=0.002), mode=None)
    >>> json_fields("speed_rpm depth_mm=tip.depth*1e3 frequency_hz=mode.frequency")(pocket)
    {'speed_rpm': 6000.0, 'depth_mm': 2.0, 'frequency_hz': None}
    """
    fields = [_read_field(entry) for entry in table.split()]
    return lambda record: {key: value(record) for key, value in fields}


def _read_field(entry: str) -> tuple[str, Callable[[Any], Any]]:
    match = FIELD_PATTERN.fullmatch(entry)
    if match is None:
        raise ValueError(f"{entry!r} is no key=path.of.attribute*factor")
    key, path, operator, unit = match.groups()
    names, factor = (path or key).split("."), float(unit or 1)

    def value(record: Any) -> Any:
        number = reduce(lambda part, name: None if part is None else getattr(part, name), names, record)
        if number is None or operator is None:
            return number
        return number * factor if operator == "*" else number / factor

    return key, value
