"""Tables of JSON keys: which attribute of a record each key of a JSON object is taken from."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import reduce
from types import MappingProxyType
from typing import Any

FIELD_PATTERN = re.compile(r"(\w+)(?:=([\w.-]+))?(?:([*/])([\d.e]+))?")
"""Key, attribute path, and factor or divisor of a unit."""
JsonFields = Callable[[Any], dict[str, Any]]
"""Function that makes the JSON object of a record."""


def json_fields(table: str, encoders: Mapping[str, Callable[[Any], Any]] = MappingProxyType({})) -> JsonFields:
    """Return a function that makes the JSON object of a record, its keys in the order of the table.

    An entry of the table is a key, `key=path.of.attribute`, or either of them with the factor or divisor of its unit;
    the path `self` is the record, a number in a path an index. The value is None where a part of the path is None. An
    encoder makes the value of its key from the attribute. Encoder and unit apply to each item of a list or tuple.

    >>> from types import SimpleNamespace
    >>> pocket = SimpleNamespace(speed_rpm=6000.0, tip=SimpleNamespace(depth=0.002), mode=None)
    >>> json_fields("speed_rpm depth_mm=tip.depth*1e3 frequency_hz=mode.frequency", {"speed_rpm": round})(pocket)
    {'speed_rpm': 6000, 'depth_mm': 2.0, 'frequency_hz': None}
    """
    fields = [_read_field(entry, encoders) for entry in table.split()]
    return lambda record: {key: value(record) for key, value in fields}


def _read_field(entry: str, encoders: Mapping[str, Callable[[Any], Any]]) -> tuple[str, Callable[[Any], Any]]:
    match = FIELD_PATTERN.fullmatch(entry)
    if match is None:
        raise ValueError(f"{entry!r} is no key=path.of.attribute*factor")
    key, path, operator, unit = match.groups()
    names, size = [] if path == "self" else (path or key).split("."), float(unit or 1)
    encode = encoders.get(key, lambda value: value)

    def scale(number: Any) -> Any:
        return number * size if operator == "*" else number / size

    def value(record: Any) -> Any:
        part = reduce(_follow, names, record)
        is_list = isinstance(part, (list, tuple)) and not hasattr(part, "_fields")
        convert = scale if operator else encode
        return list(map(convert, part)) if is_list else None if part is None else convert(part)

    return key, value


def _follow(part: Any, name: str) -> Any:
    if part is None:
        return None
    return part[int(name)] if name.lstrip("-").isdigit() else getattr(part, name)
