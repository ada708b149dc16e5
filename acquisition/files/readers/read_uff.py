"""Read universal files, data set 58, ASCII and binary, with the units of data set 164.

FRFs, coherence and signals over time are read. Source: SDRC Universal File Formats 58, 58b, 151, 164 (University of
Cincinnati, SDRL).
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from acquisition.arrays import Complexes, Floats
from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Format, Role, Signal, parse_local_time
from acquisition.files.readers.text_file import decode_utf8_or_latin1
from acquisition.frf import FrfPoints

_NUMBERS_PER_VALUE = {2: 1, 4: 1, 5: 2, 6: 2}
"""Number of numbers per value by the type of the ordinate data: real and complex, single and double."""
_NUMBER_TOKEN = re.compile(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[EeDd][+-]?\d+)?|[+-]?nan|[+-]?inf", re.IGNORECASE)


@dataclass(frozen=True)
class UffAxis:
    """Abscissa, ordinate or its denominator."""

    type: int
    """Code of the quantity: 8 displacement, 11 velocity, 12 acceleration, 13 force, 17 time, 18 frequency, ..."""
    unit: str
    """Unit; empty if unknown."""


@dataclass(frozen=True, eq=False)
class UffFunction:
    """Data set 58."""

    lines: tuple[str, ...]
    """Five lines of identification."""
    type: int
    """Code of the function: 1 over time, 4 FRF, 6 coherence."""
    name: str
    """Name for people: the measured points."""
    response_direction: int
    """Direction of the response: +-1 x, +-2 y, +-3 z; 0 if unknown."""
    reference_direction: int
    """Direction of the hammer in the same code."""
    place: tuple[str, int, int, str, int, int]
    """Nodes and directions, equal for an FRF and its coherence."""
    abscissa: Floats
    """Abscissa in its unit, shape (n,)."""
    step: float
    """Step of an even abscissa; 0 where it is uneven."""
    values: Floats | Complexes
    """Values of the function in their unit, shape (n,)."""
    abscissa_axis: UffAxis
    """Quantity and unit of the abscissa."""
    ordinate: UffAxis
    """Quantity and unit of the values."""
    denominator: UffAxis
    """Quantity and unit that the values were divided by."""

    @property
    def keys(self) -> dict[str, str]:
        """Entries `key=value` in the lines of identification, as lobewatch writes them."""
        return {key: value for line in self.lines for key, value in re.findall(r"(\w+)=([^;]*)(?:;|$)", line)}

    @property
    def points(self) -> FrfPoints | None:
        """Points of response and hit; None if the file numbers none."""
        _, response_node, response_direction, _, hit_node, hit_direction = self.place
        points = FrfPoints(response_node, response_direction, hit_node, hit_direction)
        return points if response_node or hit_node else None

    @property
    def averages(self) -> int | None:
        """Number of averaged hits; None if unknown."""
        text = " ".join(self.lines)
        number = self.keys.get("averages", "") or "".join(re.findall(r"(?i)\baverages?\s*[:=]\s*(\d+)", text)[:1])
        return int(number) if number.strip().isdigit() else None

    @property
    def window(self) -> str:
        """Window over the response; empty if unknown."""
        match = re.search(r"(?i)\b(?:response )?window\s*[:=]\s*([^;]+)", "; ".join(self.lines))
        return match[1].strip() if match else ""


def read_function(place: str, content: bytes, begin: int) -> tuple[UffFunction, int]:
    """Read the data set whose first line begins here, and return where its values end; place: for errors."""
    ends = [begin]
    for _ in range(12):
        end = content.find(b"\n", ends[-1])
        if end < 0:
            raise DataError(f"{place}: truncated header, {len(ends) - 1} of 12 lines. Export the file again.")
        ends.append(end + 1)
    lines = [decode_utf8_or_latin1(content[a:b]).rstrip("\r\n") for a, b in pairwise(ends)]
    try:
        kind, n, spacing = map(int, lines[7].split()[:3])
        start, step = map(float, lines[7].split()[3:5])
        per_value = _NUMBERS_PER_VALUE[kind]
        if n < 1:
            raise ValueError(n)
    except (ValueError, KeyError) as error:
        fault = f"line 7 of the header is invalid ({lines[7].strip()!r})"
        raise DataError(f"{place}: {fault}. Export the file again.") from error
    even, width = bool(spacing), per_value + (0 if spacing else 1)
    if lines[0].split()[0] == "58":
        numbers, after = _read_text_values(place, content, ends[-1], n * width)
    else:
        numbers, after = _read_binary_values(place, lines[0], content, ends[-1], n, (kind, even))
    table = numbers.reshape(n, width)
    abscissa = start + step * np.arange(n, dtype=np.float64) if even else table[:, 0]
    values = table[:, -1] if per_value == 1 else table[:, -2] + 1j * table[:, -1]
    return _make_function(lines, abscissa, step if even else 0.0, values), after


def _make_function(lines: list[str], abscissa: Floats, step: float, values: Floats | Complexes) -> UffFunction:
    six = lines[6].ljust(80)
    response, reference = (_parse_point(six[31:55]), _parse_point(six[56:80]))
    below = _format_point(reference)
    where = " ".join(filter(None, [_format_point(response), "over" if below else "", below]))
    name = where or lines[9].ljust(80)[26:46].strip() or "function"
    points = response[2], reference[2], (*response, *reference)
    axes = map(_parse_axis, lines[8:11])
    function = UffFunction(tuple(lines[1:6]), int(six[:5]), name, *points, abscissa, step, values, *axes)
    exact = function.keys.get("step")
    if exact and step and abs(float(exact) / step - 1) < 1e-4:
        even = float(exact) * np.arange(values.size, dtype=np.float64)
        return replace(function, abscissa=float(function.keys.get("start", abscissa[0])) + even, step=float(exact))
    return function


def _parse_point(text: str) -> tuple[str, int, int]:
    """Return name, node and direction."""
    name = text[:10].strip()
    node, direction = (re.sub(r"[^\d-]", "", part) for part in (text[10:20], text[20:24]))
    return ("" if name == "NONE" else name), int(node or 0), int(direction or 0)


def _format_point(point: tuple[str, int, int]) -> str:
    name, node, direction = point
    axis = "xyz"[abs(direction) - 1] if 0 < abs(direction) < 4 else ""
    sign = f"-{axis}" if direction < 0 else axis
    return " ".join(filter(None, [name, str(node) if node or sign else "", sign]))


def _parse_axis(line: str) -> UffAxis:
    line = line.ljust(80)
    unit = line[47:67].strip()
    return UffAxis(int(line[:10].split()[0] if line[:10].split() else 0), "" if unit.upper() == "NONE" else unit)


def _read_text_values(place: str, content: bytes, begin: int, n: int) -> tuple[Floats, int]:
    """Read n numbers in columns that may touch each other."""
    end = content.find(b"\n    -1", begin - 1)
    body = content[begin : end if end >= 0 else len(content)]
    numbers = _NUMBER_TOKEN.findall(body)
    strays = _NUMBER_TOKEN.sub(b"", body).split()
    if strays:
        raise DataError(f"{place}: {strays[0][:20]!r} is not a number. Export the file again.")
    if len(numbers) != n or end < 0:
        raise DataError(f"{place}: truncated or damaged, {len(numbers)} of {n} numbers. Export the file again.")
    return np.array([float(word.replace(b"D", b"E").replace(b"d", b"e")) for word in numbers]), begin + len(body)


def _read_binary_values(
    place: str, head: str, content: bytes, begin: int, n: int, layout: tuple[int, bool]
) -> tuple[Floats, int]:
    """Read n values; an uneven abscissa is single precision next to single values, else double."""
    kind, even = layout
    words = head.split()
    order, form = int(words[1]), int(words[2])
    if form != 2 or order not in (1, 2):
        raise DataError(f"{place}: binary form {order} {form} is not supported. Export IEEE numbers (1 2 or 2 2).")
    sign, size = "<>"[order - 1], 4 if kind in (2, 5) else 8
    value = [("value", f"{sign}f{size}", (_NUMBERS_PER_VALUE[kind],))]
    row = np.dtype(value if even else [("abscissa", f"{sign}f{size}"), *value])
    body = content[begin : begin + n * row.itemsize]
    if len(body) < n * row.itemsize:
        raise DataError(f"{place}: truncated, {len(body)} of {n * row.itemsize} value bytes. Export the file again.")
    table = np.frombuffer(body, row)
    parts = [table["value"]] if even else [table["abscissa"][:, None], table["value"]]
    return np.hstack(parts).astype(np.float64).ravel(), begin + len(body)


_DATA_SET_MARK = re.compile(rb"\s*-1[ \r]*(?:\n|$)")
_UNIT_SYSTEMS = {1: ("m", "N"), 2: ("ft", "lbf"), 3: ("m", "kgf"), 5: ("mm", "mN"), 7: ("in", "lbf"), 9: ("mm", "N")}
"""Units of length and force by the code in data set 164."""
_MOTION_TYPES = {8: ("displacement", ""), 11: ("velocity", "/s"), 12: ("acceleration", "/s^2")}
"""Quantity of an ordinate type, and the part of its unit behind the length."""
_FORCE_TYPES = (9, 13)
_ORDINATE_TYPES = _MOTION_TYPES | dict.fromkeys(_FORCE_TYPES, ("force", ""))
_TIME_TYPE, _FRF_TYPE, _COHERENCE_TYPE = 1, 4, 6
_DATE_FORMATS = ("%d-%b-%y %H:%M:%S", "%d-%b-%Y %H:%M:%S", "%d-%b-%y", "%d-%b-%Y", "%Y-%m-%dT%H:%M:%S%z")


@dataclass(frozen=True)
class UffDataSets:
    """Data sets of a file."""

    functions: Sequence[UffFunction]
    """Data sets 58 in their order."""
    system: tuple[str, str] | None
    """Units of length and force by data set 164."""
    models: tuple[str, ...]
    """Names of data sets 151, each once."""


def read_uff(path: Path) -> Contents:
    """Read FRFs with their coherence, or signals over time; raise DataError with the data set where it is damaged."""
    sets = _read_data_sets(path, path.read_bytes())
    frfs = [function for function in sets.functions if function.type == _FRF_TYPE]
    kinds = sorted({function.type for function in sets.functions} - {_TIME_TYPE, _FRF_TYPE, _COHERENCE_TYPE})
    signals = list(_make_frf_signals(sets, frfs)) if frfs else list(_make_time_signals(sets))
    if not signals:
        content = f"functions of type {', '.join(map(str, kinds))}" if kinds else "no data set 58"
        raise DataError(f"{path}: the file has {content}. Export FRFs (type 4) or signals over time (type 1).")
    first = frfs[0] if frfs else sets.functions[0]
    averages = {function.averages for function in frfs if function.averages}
    n_averages = averages.pop() if len(averages) == 1 else None
    labels = _parse_date(first), _get_common_direction(sets), first.keys.get("tool", "")
    window = next((function.window for function in (frfs or sets.functions) if function.window), "")
    return Contents(tuple(signals), n_averages, *labels, sets.models, window, tuple(_list_notes(frfs)))


def _read_data_sets(path: Path, content: bytes) -> UffDataSets:
    functions, system, models, at = list[UffFunction](), None, dict[str, None](), 0
    while (opening := _DATA_SET_MARK.match(content, at)) is not None:
        begin = opening.end()
        kind = content[begin : content.find(b"\n", begin)].split()[:1]
        if kind and kind[0] in (b"58", b"58b"):
            function, at = read_function(f"{path}: data set {len(functions) + 1}", content, begin)
            functions.append(function)
        else:
            end = content.find(b"\n    -1", begin)
            at = len(content) if end < 0 else end + 1
        if kind == [b"151"]:
            named = re.match(rb"[^\n]*\n([^\n]*)", content[begin : begin + 400])
            name = decode_utf8_or_latin1(named[1]).strip() if named else ""
            models |= {name: None} if name not in ("", "NONE") else {}
        closing = _DATA_SET_MARK.match(content, at)
        if closing is None:
            raise DataError(f"{path}: truncated or damaged, the last data set has no end (-1). Export the file again.")
        if kind == [b"164"]:
            code = re.match(rb"[^\n]*\n\s*(\d+)", content[begin:])
            system = _UNIT_SYSTEMS.get(int(code[1])) if code else None
        at = closing.end()
    if content[at:].strip():
        rest = content[at:].strip()[:20]
        raise DataError(f"{path}: damaged, {rest!r} follows the last data set. Export the file again.")
    return UffDataSets(functions, system, tuple(models))


def _make_frf_signals(sets: UffDataSets, frfs: Sequence[UffFunction]) -> Iterator[Signal]:
    """Return one record per FRF with positive axis directions."""
    coherences = [function for function in sets.functions if function.type == _COHERENCE_TYPE]
    for record, frf in enumerate(frfs):
        unit, quantity = _get_frf_unit(frf, sets.system)
        sign = -1.0 if frf.response_direction * frf.reference_direction < 0 else 1.0
        yield Signal("frequency", frf.abscissa, "frequency", frf.abscissa_axis.unit or "Hz", record=record)
        yield Signal(frf.name, sign * frf.values, "frf", unit, quantity, record=record, points=frf.points)
        for function in coherences:
            if function.place == frf.place and function.values.size == frf.values.size:
                yield Signal(f"coherence of {frf.name}", function.values, "coherence", record=record)
                break


def _get_frf_unit(frf: UffFunction, system: tuple[str, str] | None) -> tuple[str, str]:
    """Return unit and quantity of the response as far as known."""
    quantity, per_time = _MOTION_TYPES.get(frf.ordinate.type, ("", ""))
    top, below = frf.ordinate.unit, frf.denominator.unit
    if not top and system and quantity:
        top = f"{system[0]}{per_time}"
    if not below and system and frf.denominator.type in _FORCE_TYPES:
        below = system[1]
    return (f"({top})/({below})" if top and below else top), quantity


def _make_time_signals(sets: UffDataSets) -> Iterator[Signal]:
    """Return the channels; where one comes again, the next hit begins."""
    record, places = 0, set[tuple[object, ...]]()
    for function in (listed for listed in sets.functions if listed.type == _TIME_TYPE):
        if (function.place, function.ordinate.type) in places:
            record, places = record + 1, set()
        places.add((function.place, function.ordinate.type))
        quantity, per_time = _ORDINATE_TYPES.get(function.ordinate.type, ("", ""))
        unit = function.ordinate.unit
        if not unit and sets.system and quantity:
            unit = sets.system[1] if quantity == "force" else f"{sets.system[0]}{per_time}"
        role: Role = "" if not quantity else "force" if quantity == "force" else "response"
        rate = 1 / function.step if function.step else None
        yield Signal(function.name, function.values, role, unit, quantity, rate=rate, record=record)
        if rate is None:
            yield Signal("time", function.abscissa, "time", function.abscissa_axis.unit or "s", record=record)


def _get_common_direction(sets: UffDataSets) -> str:
    """Return the direction at the tool tip where all responses have the same."""
    measured = (function for function in sets.functions if function.ordinate.type in _MOTION_TYPES)
    responses = {abs(function.response_direction) for function in measured}
    return {1: "x", 2: "y", 3: "z"}.get(responses.pop(), "") if len(responses) == 1 else ""


def _list_notes(frfs: Sequence[UffFunction]) -> Iterator[str]:
    turned = sum(frf.response_direction * frf.reference_direction < 0 for frf in frfs)
    if turned:
        yield f"sign changed of {turned} FRF(s) with opposite directions of hit and response"
    if any(abs(frf.response_direction) != abs(frf.reference_direction) and frf.reference_direction for frf in frfs):
        yield "hit and response differ in direction"


def _parse_date(function: UffFunction) -> datetime | None:
    """Return the date of the third line, or that of lobewatch's own files; local time where it has no zone."""
    return parse_local_time(function.keys.get("recorded") or function.lines[2].strip(), *_DATE_FORMATS)


def _is_uff(head: bytes, _path: Path) -> bool:
    first = head.lstrip(b"\r\n").split(b"\n", 1)[0]
    return first.strip() == b"-1" and first.startswith(b"    -1")


UFF_FORMAT = Format("uff", "universal file, data set 58", (".uff", ".unv", ".uf", ".bunv"), _is_uff, read_uff)
