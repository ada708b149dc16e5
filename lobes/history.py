"""History of the stability-lobe diagrams (SLD) of one machine."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lobes.stability_lobes import check_speeds
from modal.arrays import Floats

Column = Floats | NDArray[np.str_]
ColumnT = TypeVar("ColumnT", Floats, Column)


@dataclass(frozen=True, eq=False)
class SldHistory:
    """Limiting depths of n measurements over one speed grid, for each cut, with further measured values.

    A history begins with arrays of no rows (n = 0), which fix the names and the row shapes.

    Raises
    ------
    ValueError
        For names that cannot be stored, arrays of different n, values that are neither numbers nor text,
        and depths <= 0.

    Examples
    --------
    >>> speeds = np.linspace(4000.0, 18000.0, 8)  # rpm
    >>> columns, depth = {"frequency": np.empty(0)}, {"slot": np.empty((0, 8))}
    >>> empty = SldHistory("", "lobewatch", speeds, columns, depth, {"frequency": "Hz"})
    >>> history = empty.append({"frequency": 696.2}, {"slot": np.full(8, 1.2e-3)})
    >>> history.columns["frequency"].tolist(), history.depth["slot"].shape
    ([696.2], (1, 8))
    """

    settings_hash: str
    """Hash of the settings used for the depths."""
    software: str
    """Name and version of the program that computed them."""
    speed_rpm: Floats
    """Common speed grid (rpm), rising, shape (m,)."""
    columns: Mapping[str, Column]
    """Values by name (letters, digits, underscore), one row per measurement: numbers (n,) or (n, k), or text (n,)."""
    depth: Mapping[str, Floats]
    """Limiting depth by cut (m), shape (n, m); inf if stable at any depth, nan if not computed."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Unit by column; a column without one is a plain number or text."""

    def __post_init__(self) -> None:
        """Convert to arrays and check names, shapes and values."""
        object.__setattr__(self, "speed_rpm", check_speeds(self.speed_rpm))
        object.__setattr__(self, "columns", {name: _check_column(name, c) for name, c in self.columns.items()})
        object.__setattr__(self, "depth", {name: np.asarray(d, dtype=np.float64) for name, d in self.depth.items()})
        object.__setattr__(self, "units", dict(self.units))
        if np.any(np.diff(self.speed_rpm) <= 0):
            raise ValueError("speed_rpm does not rise from value to value. Sort the speeds in rising order.")
        for text in (self.settings_hash, self.software, *self.units.values(), *self.depth):
            _check_text(text)
        stray = sorted(self.units.keys() - self.columns.keys())
        if stray:
            raise ValueError(f"units names unknown columns {stray}. The columns are {sorted(self.columns)}.")
        for name, depth in self.depth.items():
            self._check_depth(name, depth)
        rows = {name: len(values) for name, values in (*self.columns.items(), *self.depth.items())}
        if len(set(rows.values())) > 1:
            raise ValueError(
                f"columns and depths have different numbers of rows: {rows}. Give one row per measurement."
            )

    def _check_depth(self, name: str, depth: Floats) -> None:
        if not name:
            raise ValueError("a cut has an empty name. Give each cut a name.")
        if depth.ndim != 2 or depth.shape[1] != self.speed_rpm.size:
            raise ValueError(f"depth of {name!r} has shape {depth.shape}, not (n, {self.speed_rpm.size})")
        if np.any(depth <= 0):
            advice = "Give inf for an unlimited depth and nan for a limit that was not computed."
            raise ValueError(f"depth of {name!r} has values that are not > 0 m. {advice}")

    def __len__(self) -> int:
        """Return the number of measurements n."""
        return len(next(iter((*self.columns.values(), *self.depth.values())), ()))

    def append(self, row_columns: Mapping[str, ArrayLike], row_depth: Mapping[str, ArrayLike]) -> Self:
        """Return a history with one more measurement.

        Parameters
        ----------
        row_columns : mapping of str to array_like
            One value, or (k,) values, for each column.
        row_depth : mapping of str to array_like
            Depths (m), shape (m,), for each cut.

        Returns
        -------
        SldHistory
            Longer history.

        Raises
        ------
        ValueError
            If names or shapes differ from those of this history.
        """
        return replace(self, columns=_append_row(self.columns, row_columns), depth=_append_row(self.depth, row_depth))


def _append_row(table: Mapping[str, ColumnT], row: Mapping[str, ArrayLike]) -> dict[str, ColumnT]:
    if table.keys() != row.keys():
        raise ValueError(
            f"the new row has columns {sorted(row)}, the history {sorted(table)}. Give a value for each column."
        )
    return {name: _append_value(name, values, row[name]) for name, values in table.items()}


def _append_value(name: str, values: ColumnT, row: ArrayLike) -> ColumnT:
    new = np.asarray(row)
    if new.shape != values.shape[1:]:
        raise ValueError(
            f"the new row of {name!r} has shape {new.shape}, the rows of the history have {values.shape[1:]}"
        )
    if (new.dtype.kind == "U") != (values.dtype.kind == "U"):
        raise ValueError(
            f"the new row of {name!r} has type {new.dtype}, the history {values.dtype}. Use the type of the history."
        )
    return np.concatenate((values, new[np.newaxis]))


def _check_column(name: str, values: ArrayLike) -> Column:
    if not name.isidentifier():
        raise ValueError(f"invalid column name {name!r}. Use only letters, digits and underscores.")
    column = np.asarray(values)
    is_text = column.dtype.kind == "U"
    if column.dtype.kind not in "biufU" or column.ndim not in ((1,) if is_text else (1, 2)):
        given = f"{column.dtype} of shape {column.shape}"
        raise ValueError(f"column {name!r} is {given}. Give numbers of shape (n,) or (n, k), or text of shape (n,).")
    for text in column if is_text else ():
        _check_text(text)
    return column if is_text else column.astype(np.float64)


def _check_text(text: str) -> None:
    """Reject characters that UTF-8 text in HDF5 cannot hold: a zero character or half a surrogate pair."""
    if re.search("[\0\ud800-\udfff]", text):
        raise ValueError(f"text {text!r} has a character that cannot be stored. Remove this character.")
