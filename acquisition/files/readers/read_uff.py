"""Read universal files, data set 58, ASCII and binary, with the units of data set 164.

FRFs, coherence and signals over time are read. Source: SDRC Universal File Formats 58, 58b, 151, 164 (University of
Cincinnati, SDRL).
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Format, Role, Signal
from acquisition.files.readers.text_file import decode_utf8_or_latin1
from acquisition.files.readers.uff_dataset_58 import UffFunction, read_function

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
        raise DataError(f"{path}: holds {content}; FRFs (type 4) and signals over time (type 1) are read")
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
            raise DataError(f"{path}: its last data set has no end (-1); it is cut short or damaged")
        if kind == [b"164"]:
            code = re.match(rb"[^\n]*\n\s*(\d+)", content[begin:])
            system = _UNIT_SYSTEMS.get(int(code[1])) if code else None
        at = closing.end()
    if content[at:].strip():
        raise DataError(f"{path}: {content[at:].strip()[:20]!r} stands behind its last data set; it is damaged")
    return UffDataSets(functions, system, tuple(models))


def _make_frf_signals(sets: UffDataSets, frfs: Sequence[UffFunction]) -> Iterator[Signal]:
    """Return one record per FRF with positive axis directions."""
    coherences = [function for function in sets.functions if function.type == _COHERENCE_TYPE]
    for record, frf in enumerate(frfs):
        unit, quantity = _get_frf_unit(frf, sets.system)
        sign = -1.0 if frf.response_direction * frf.reference_direction < 0 else 1.0
        yield Signal("frequency", frf.abscissa, "frequency", frf.abscissa_axis.unit or "Hz", record=record)
        yield Signal(frf.name, sign * frf.values, "frf", unit, quantity, record=record)
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
        yield f"{turned} FRF(s) of opposite directions, turned round"
    if any(abs(frf.response_direction) != abs(frf.reference_direction) and frf.reference_direction for frf in frfs):
        yield "hit and response differ in direction"


def _parse_date(function: UffFunction) -> datetime | None:
    """Return the date of the third line, or that of lobewatch's own files; local time where it has no zone."""
    text = function.keys.get("recorded") or function.lines[2].strip()
    for form in _DATE_FORMATS:
        try:
            return datetime.strptime(text, form).astimezone()
        except (ValueError, OverflowError, OSError):
            continue
    return None


def _is_uff(head: bytes, _path: Path) -> bool:
    first = head.lstrip(b"\r\n").split(b"\n", 1)[0]
    return first.strip() == b"-1" and first.startswith(b"    -1")


UFF_FORMAT = Format("uff", "universal file, data set 58", (".uff", ".unv", ".uf", ".bunv"), _is_uff, read_uff)
