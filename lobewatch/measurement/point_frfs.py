"""FRFs between the tool tip and the points of a table: read, checked, and brought to one window."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

import acquisition
from acquisition import DataError, Description, Frf, FrfPoints, Hit, Remark
from lobewatch.measurement import exponential_window as windows
from lobewatch.measurement.file_frf import FileFrf, read_file_frf
from lobewatch.measurement.point_table import ROLES, PointRow
from modal import ModeShape


@dataclass(frozen=True, eq=False)
class PointFrf:
    """FRF between a point and the tip."""

    row: PointRow
    """Line of the table."""
    role: str
    """Role of the point."""
    number: int | None
    """Number of the FRF in its file; None if there is only one."""
    sign: float
    """-1 for a sensor or hammer against the direction at the tip, else 1."""
    source: FileFrf
    """FRF with its hits, as read."""
    frf: Frf
    """FRF in the direction of the tip."""

    @property
    def where(self) -> str:
        """Point and file, for errors."""
        return f"point {self.row.point}, {self.row.file.name}"


def read_point_frfs(rows: Sequence[PointRow], description: Description) -> list[PointFrf]:
    """Read the FRFs of the lines of a table, the tip first; DataError for files that do not fit together."""
    measured = list(_read_points(rows, description))
    _check_together(measured)
    return measured


def _read_points(rows: Sequence[PointRow], description: Description) -> Iterator[PointFrf]:
    tip = rows[0]
    for row in rows:
        direction = row.direction or tip.direction
        is_turned = row.node is None and direction.startswith("-") != tip.direction.startswith("-")
        sign = -1.0 if is_turned else 1.0
        for number, role in _find_measurements(row, tip):
            own = replace(description, response=number or description.response)
            try:
                source = read_file_frf(row.file, (), own, None, conjugate=False)
            except (DataError, ValueError) as error:
                raise DataError(f"{row.where}: {error}") from error
            if source.frf is None:
                raise DataError(f"{row.where}: {row.file.name} has no force. Use an instrumented hammer.")
            turned = replace(source.frf, receptance=sign * source.frf.receptance)
            yield PointFrf(row, role, own.response, sign, source, turned)


def _find_measurements(row: PointRow, tip: PointRow) -> list[tuple[int | None, str]]:
    """Return the number of each FRF in the file of a line, and the role of the point."""
    if tip.direction and row.direction and tip.direction[-1] != row.direction[-1]:
        finding = f"direction {row.direction}, but {tip.direction} at the tip"
        raise DataError(f"{row.where}: {finding}. Put the points of each direction into a folder of its own.")
    if row.node is None:
        return [(row.number, ROLES[0] if row.point == tip.point else row.role)]
    if tip.node is None:
        raise DataError(f"{row.where}: node {row.node}, but the tip has none. Give the tip its node too.")
    numbered = enumerate(acquisition.list_frf_points(row.file), 1)
    pairs = [(number, points) for number, points in numbered if points is not None]
    same = [(number, points) for number, points in pairs if _is_between(points, row, tip.node)]
    if not same:
        nodes = sorted({node for _, points in pairs for node in (points.response_node, points.hit_node)})
        finding = f"no FRF between nodes {row.node} and {tip.node} in one direction in {row.file.name}"
        raise DataError(f"{row.where}: {finding}. Its nodes are {', '.join(map(str, nodes)) or 'without numbers'}.")
    if len({abs(points.hit_direction) for _, points in same}) > 1:
        raise DataError(f"{row.where}: {row.file.name} has FRFs in several directions. Give the column direction.")
    return [(number, ROLES[points.response_node != row.node]) for number, points in same]


_AXES = {0: "", 1: "x", 2: "y", 3: "z"}
"""Axis by the number in a universal file, without rotations."""


def _is_between(points: FrfPoints, row: PointRow, tip_node: int) -> bool:
    """Return whether an FRF is between a point and the tip, with hammer and sensor along the direction of the line."""
    axis, wanted = _AXES.get(abs(points.hit_direction)), row.direction[-1:]
    is_along = axis is not None and axis == _AXES.get(abs(points.response_direction)) and wanted in ("", axis)
    return is_along and sorted((points.response_node, points.hit_node)) == sorted((row.node or 0, tip_node))


def _check_together(measured: Sequence[PointFrf]) -> None:
    """Check that all points have the same lines, quantity and window, and different data."""
    first, facts = measured[0], _list_settings(measured[0])
    for number, other in enumerate(measured[1:], 1):
        for name, value in _list_settings(other).items():
            if value != facts[name]:
                finding = f"{name} {value}, but {facts[name]} at {first.where}"
                raise DataError(f"{other.where}: {finding}. Measure all points with the same settings.")
        for earlier in measured[:number]:
            if np.array_equal(earlier.frf.receptance, other.frf.receptance):
                raise DataError(f"{other.where}: same data as {earlier.where}. Give each line its own measurement.")


def _list_settings(measured: PointFrf) -> dict[str, str]:
    """List what must be the same at all points, by its name."""
    f, hits, window = measured.frf.frequency, measured.source.hits, measured.source.recorded_window
    return {
        "sample rate": f"{hits[0].sample_rate:g} Hz" if hits else "unknown",
        "frequency lines": f"{f.size} from {f[0]:.6g} to {f[-1]:.6g} Hz",
        "quantity": measured.frf.measured_as,
        "response window": "none" if window is None else f"{window:g} s",
    }


class WindowedFrfs(NamedTuple):
    """FRFs of all points with one window over their responses."""

    frfs: list[Frf]
    """FRFs, the driving point first."""
    hits: list[Sequence[Hit]]
    """Hits of each FRF, maybe none."""
    time_constant: float | None = None
    """Time constant of the window (s); None without a window."""
    delay: float = 0.0
    """Time from the start of the window to the hit (s)."""
    remarks: tuple[Remark, ...] = ()
    """Remark on our own window."""

    def correct(self, shapes: Sequence[ModeShape]) -> Iterator[ModeShape]:
        """Yield the mode shapes without the damping of the window."""
        for shape in shapes:
            if self.time_constant is None:
                yield shape
            else:
                modes = windows.remove_own_window([shape.mode], self.time_constant, self.delay)
                yield from (replace(shape, mode=mode) for mode in modes)


def treat_windows(measured: Sequence[PointFrf], description: Description) -> WindowedFrfs:
    """Correct a recorded window. Hits that ring at the end of the record get our own window at all points."""
    frfs = [one.frf for one in measured]
    hits: list[Sequence[Hit]] = [one.source.hits for one in measured]
    recorded = measured[0].source.recorded_window
    if recorded is not None:
        if math.isnan(recorded) or not all(hits):
            finding = f"{measured[0].where}: the response has a window"
            raise DataError(f"{finding}. Export the response without a window, or hits with its time constant.")
        delay = float(np.mean([windows.Window(recorded).delay(own) for own in hits]))
        return WindowedFrfs(
            [acquisition.correct_windowed_receptance(frf, recorded) for frf in frfs], hits, recorded, delay
        )
    constants = [one.source.time_constant for one in measured if one.source.time_constant is not None]
    if not constants or not all(hits):
        return WindowedFrfs(frfs, hits)
    tau = min(constants)
    remark = windows.own_window_remark("", tau, "Record longer to avoid the window")
    return WindowedFrfs(*_window_all(measured, description, tau), tau, remarks=(remark,))


def _window_all(
    measured: Sequence[PointFrf], description: Description, time_constant: float
) -> tuple[list[Frf], list[Sequence[Hit]]]:
    """Return the FRFs of all hits under one window (s), and these hits."""
    frfs, hits = list[Frf](), list[Sequence[Hit]]()
    for one in measured:
        own = replace(description, response=one.number)
        raw = read_file_frf(one.row.file, ("not-decayed",), own, None, conjugate=False).hits
        frf, windowed, _ = windows.window_ringing_hits(raw, time_constant)
        frfs.append(replace(frf, receptance=one.sign * frf.receptance))
        hits.append(windowed)
    return frfs, hits
