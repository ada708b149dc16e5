"""Text tables: hits as time, force and acceleration, or an FRF as frequency, real and imaginary part.

The separator (tab, semicolon, comma, white space) and the decimal comma are found from the first rows. A heading
names each column and its unit: `time_s,force_N,acceleration_g`, `Time (s);Force [N];Acc [m/s^2]`,
`Freq Real Imag` (Hz; receptance, m/N).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import DataError
from acquisition.files.format import Format
from acquisition.files.units import FACTORS, STANDARD_GRAVITY, hit_from
from acquisition.frf import Frf
from acquisition.hit import Hit

TIME = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
"""Unit of the time column in lower case -> seconds."""
EVEN = 1e-3
"""Largest deviation of a time step from the mean step, as a share of it."""
_SUFFIX = re.compile(rf"(.+?)_({'|'.join(re.escape(unit) for unit in [*FACTORS, *TIME, 'hz'])})", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Table:
    """Columns of a text file."""

    names: list[str]
    """Headings, without units."""
    units: list[str]
    """Unit of each column, as written; empty where none stands there."""
    values: NDArray[np.float64]
    """Shape (n_columns, n_rows)."""


def read_table(path: Path) -> Table:
    """The table in a text file; DataError with the line where it is none."""
    lines = [line for line in path.read_text(encoding="utf-8-sig", errors="replace").splitlines() if line.strip()]
    if len(lines) < 2:
        raise DataError(f"{path}: {len(lines)} lines; a heading and rows of numbers are needed")
    separator, comma = _dialect(lines[1:])
    heading = [word.strip().strip('"') for word in re.split(separator, lines[0].strip())]
    rows = [_row(path, i, line, separator, comma, len(heading)) for i, line in enumerate(lines[1:], 2)]
    names, units = zip(*(_name_and_unit(word) for word in heading), strict=True)
    return Table(list(names), list(units), np.array(rows).T)


def is_frf(table: Table) -> bool:
    """True where the columns are frequency, real and imaginary part."""
    starts = [name.lower()[:4] for name in table.names[:3]]
    return starts == ["freq", "real", "imag"]


def frf_of(path: Path, table: Table) -> Frf:
    """Receptance (m/N) from frequency (Hz), real and imaginary part, and coherence where a fourth column has it."""
    if table.units[0].lower() not in ("", "hz"):
        raise DataError(f"{path}: frequency is in {table.units[0]!r}; give it in Hz")
    coherence = table.values[3] if len(table.names) > 3 and table.names[3].lower().startswith("coh") else None
    try:
        return Frf(table.values[0], table.values[1] + 1j * table.values[2], coherence)
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error


def hit_of(path: Path, table: Table) -> Hit:
    """One hit from the columns time, force and acceleration; DataError names all that stands in the way."""
    faults = _faults(table)
    if faults:
        raise DataError(f"{path}: not usable as a tap test: {'; '.join(faults)}")
    columns = [
        (unit or name, values)
        for name, unit, values in zip(table.names[1:], table.units[1:], table.values[1:], strict=True)
    ]
    step = float(np.mean(np.diff(table.values[0]))) * TIME[table.units[0].lower()]
    return hit_from(path, columns, 1 / step)


def _faults(table: Table) -> list[str]:
    if table.values.shape[1] < 8:
        return [f"{table.values.shape[1]} samples; at least 8 are needed"]
    quantities = [FACTORS.get(unit.lower(), ("unknown", 0.0))[0] for unit in table.units[1:]]
    faults = []
    if quantities.count("force") != 1:
        faults.append(f"{quantities.count('force') or 'no'} force channel (columns {', '.join(table.names)})")
    if table.units[0].lower() not in TIME:
        faults.append(
            f"unit of the first column, time, not known (heading {table.names[0]!r}; known: {', '.join(TIME)})"
        )
    step = np.diff(table.values[0])
    uneven = float(np.max(np.abs(step - step.mean())) / abs(step.mean())) if step.mean() else np.inf
    if uneven > EVEN:
        faults.append(f"time steps uneven by up to {uneven:.0%} (sampling must be even within {EVEN:.1%})")
    faults += [_gravity_fault(*column) for column in zip(table.names, table.units, table.values, strict=True)]
    return list(filter(None, faults))


def _gravity_fault(name: str, unit: str, values: NDArray[np.float64]) -> str:
    """A resting sensor that shows 9.8 in a column called g holds m/s^2."""
    rest = abs(float(np.median(values)))
    if unit.lower() == "g" and abs(rest - STANDARD_GRAVITY) < 0.5:
        return f"unit of {name} in doubt (called g, rests at {rest:.2f}, which is gravity in m/s^2)"
    return ""


def _dialect(rows: list[str]) -> tuple[str, bool]:
    """Separator (a pattern) and whether the decimal sign is a comma."""
    has_comma = any("," in row for row in rows)
    for separator in ("\t", ";"):
        if separator in rows[0]:
            return separator, has_comma
    return ("," if has_comma else r"\s+"), False


def _row(path: Path, number: int, line: str, separator: str, comma: bool, n: int) -> list[float]:
    words = re.split(separator, (line.replace(",", ".") if comma else line).strip())
    try:
        row = [float(word) for word in words]
    except ValueError as error:
        raise DataError(f"{path}: line {number}: {line.strip()[:60]!r} is no row of numbers") from error
    if len(row) != n:
        raise DataError(f"{path}: line {number}: {len(row)} numbers under {n} headings")
    return row


def _name_and_unit(heading: str) -> tuple[str, str]:
    """Name and unit of "Force [N]", "Force (N)" or "force_N"."""
    match = re.fullmatch(r"(.+?)\s*[\[(]\s*(.+?)\s*[\])]", heading) or _SUFFIX.fullmatch(heading)
    return (match[1], match[2]) if match else (heading, "")


def _is_text(head: bytes, _path: Path) -> bool:
    return b"\x00" not in head


def _read(path: Path) -> list[Hit] | Frf:
    table = read_table(path)
    return frf_of(path, table) if is_frf(table) else [hit_of(path, table)]


TEXT_TABLE = Format("table", "text table with a heading", (".csv", ".txt"), _is_text, _read)
