"""Universal files: data sets 151 (header), 164 (units, SI) and 58, ASCII, double precision.

Values have 12 digits, the abscissa 6 as the format has it; all digits of its step stand in a line of identification,
from which lobewatch reads it back. Source: SDRC Universal File Formats 58, 151, 164.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError
from acquisition.files.writers.labels import Labels, as_measured
from acquisition.frf import Frf
from acquisition.hit import Hit

_NONE = (0, "NONE", "NONE")
_FORCE = (13, "Force", "N")
_OVER_TIME = (17, "Time", "s")
_ORDINATES = {
    "receptance": (8, "Displacement", "m"),
    "mobility": (11, "Velocity", "m/s"),
    "accelerance": (12, "Acceleration", "m/s^2"),
}
EVEN = 1e-9
"""Relative difference of two frequency steps that are taken for the same."""


def uff_of_frf(frf: Frf, labels: Labels) -> bytes:
    """The FRF as function type 4, its coherence as type 6."""
    values, _ = as_measured(frf)
    ordinate = _ORDINATES[frf.measured_as]
    axis = _Axis(frf.frequency, (18, "Frequency", "Hz"))
    averages = f"averages={frf.n_averages}"
    sets = [_function(4, axis, values, (ordinate, _FORCE), labels, averages)]
    if frf.coherence is not None:
        sets.append(_function(6, axis, frf.coherence, (_NONE, _NONE), labels, averages))
    return _file(sets, labels)


def uff_of_hits(hits: Sequence[Hit], labels: Labels) -> bytes:
    """Force and acceleration of each hit as function type 1."""
    sets = []
    for number, hit in enumerate(hits, 1):
        axis = _Axis(np.arange(hit.force.size) / hit.sample_rate, _OVER_TIME, 1 / hit.sample_rate)
        for values, ordinate in ((hit.force, _FORCE), (hit.acceleration, _ORDINATES["accelerance"])):
            sets.append(_function(1, axis, values, (ordinate, _NONE), labels, f"hit={number}"))
    return _file(sets, labels)


class _Axis:
    """An abscissa with its step, where it has one."""

    def __init__(self, values: NDArray[np.float64], what: tuple[int, str, str], step: float | None = None) -> None:
        self.values, self.what = values, what
        self.step = step or float(values[-1] - values[0]) / (values.size - 1)
        even = values[0] + self.step * np.arange(values.size)
        self.is_even = bool(np.max(np.abs(values - even)) <= EVEN * abs(self.step))


def _function(
    kind: int,
    axis: _Axis,
    values: NDArray[np.float64] | NDArray[np.complex128],
    ordinates: tuple[tuple[int, str, str], tuple[int, str, str]],
    labels: Labels,
    extra: str,
) -> list[str]:
    """One data set 58."""
    node = {"x": 1, "y": 2, "z": 3}.get(labels.direction, 0)
    exact = f"step={axis.step!r};start={float(axis.values[0])!r};" if axis.is_even else ""
    recorded = f"window={labels.window}" + (f";recorded={labels.created.isoformat()}" if labels.created else "")
    stamp = f"{labels.created:%d-%b-%y %H:%M:%S}" if labels.created else "NONE"
    lines = [f"{58:6d}", labels.name, exact + extra, stamp, recorded, f"tool={labels.plain_tool}"]
    lines[1:6] = [_line(text) for text in lines[1:6]]
    point = f" {'NONE':10s}{1:10d}{node:4d}"
    lines.append(f"{kind:5d}{0:10d}{0:5d}{0:10d}{point}{point}")
    is_complex, n = np.iscomplexobj(values), values.size
    start, step = (axis.values[0], axis.step) if axis.is_even else (0.0, 0.0)
    spacing = int(axis.is_even)
    lines.append(f"{6 if is_complex else 4:10d}{n:10d}{spacing:10d}{start:13.5E}{step:13.5E}{0.0:13.5E}")
    lines += [f"{t:10d}{0:5d}{0:5d}{0:5d} {name:20s} {unit:20s}" for t, name, unit in (axis.what, *ordinates, _NONE)]
    lines += _rows(axis, values)
    return lines


def _line(text: str) -> str:
    """Of identification: 80 characters; DataError where more would be lost."""
    if len(text.encode("utf-8")) > 80:
        raise DataError(f"{text!r} has more than the 80 characters of a line of a universal file")
    return text or "NONE"


def _rows(axis: _Axis, values: NDArray[np.float64] | NDArray[np.complex128]) -> Iterator[str]:
    """Even: 20 characters a number, four a line (complex: two pairs). Uneven: the abscissa (13) before each value."""
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    numbers = np.stack(parts, axis=1)
    if axis.is_even:
        flat = numbers.ravel()
        for first in range(0, flat.size, 4):
            yield "".join(f"{value:20.11E}" for value in flat[first : first + 4])
        return
    for x, row in zip(axis.values, numbers, strict=True):
        yield f"{x:13.5E}" + "".join(f"{value:20.11E}" for value in row)


def _file(sets: Sequence[list[str]], labels: Labels) -> bytes:
    written = labels.created or datetime.now(UTC)
    day = f"{written:%d-%b-%y}{written:%H:%M:%S}".ljust(20)
    header = [f"{151:6d}", _line(labels.name), "NONE", "lobewatch", day, day, "lobewatch", day]
    units = [f"{164:6d}", f"{1:10d}{'SI: Meter (newton)':20s}{2:10d}"]
    units += [f"{1.0:25.17E}{1.0:25.17E}{1.0:25.17E}", f"{273.15:25.17E}"]
    mark = "    -1"
    lines = [line for data_set in (header, units, *sets) for line in (mark, *data_set, mark)]
    return ("\n".join(lines) + "\n").encode("utf-8")
