"""Mode shapes along tool, holder, spindle and column from a folder of measured points."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path

import modal
from acquisition import DataError, Description, Frf, Remark
from lobewatch.arrays import Complexes, Floats
from lobewatch.measurement.file_modes import check_modes_together, make_no_mode_remark
from lobewatch.measurement.point_frfs import PointFrf, read_point_frfs, treat_windows
from lobewatch.measurement.point_table import MIN_POINTS, PARTS, read_point_table
from lobewatch.step_times import time_step
from modal import ModeShape, PartShare, Trust, assess_trust

MAX_SCALE_DIFFERENCE = 0.1
"""Relative difference in size of two FRFs between the same points from which a check fails; chosen."""
MIN_FRAC = 0.9
"""Least FRAC of two FRFs between the same points; chosen, as for a MAC of one mode measured twice."""
MAX_AUTO_MAC = 0.95
"""MAC of two modes above which the points hardly distinguish them; chosen."""
MIN_PHASE_COLLINEARITY = 0.8
"""Least MPC of a mode of a lightly damped structure; chosen."""


@dataclass(frozen=True)
class MeasuredPoint:
    """Measured point on the axis of the spindle."""

    name: str
    """Name of the point."""
    position: float
    """Distance from the tool tip (m)."""
    part: str
    """Part of the machine: tool, holder, spindle or column."""
    count: int
    """Number of measurements between the point and the tip."""


@dataclass(frozen=True)
class PointCheck:
    """Comparison of two measurements between a point and the tip."""

    point: str
    """Name of the point."""
    kind: str
    """Kind of the check: repeatability, or reciprocity if hammer and sensor changed places."""
    frac: float
    """Frequency response assurance criterion of the two FRFs, 0 to 1."""
    scale: float
    """Size of the second FRF over the first (-); negative for opposite signs."""

    @property
    def is_passed(self) -> bool:
        """True if both FRFs agree in form, size and sign."""
        return self.frac >= MIN_FRAC and abs(self.scale - 1) <= MAX_SCALE_DIFFERENCE


@dataclass(frozen=True, eq=False)
class FolderShapes:
    """Mode shapes of one folder."""

    folder: Path
    """Folder of the measurements."""
    points: tuple[MeasuredPoint, ...]
    """Points by the distance from the tip, which is the first."""
    shapes: tuple[ModeShape, ...]
    """Mode shapes over these points by rising frequency, with those of rejected modes."""
    shares: tuple[tuple[PartShare, ...], ...]
    """Shares of the parts in the compliance at the tip, for each mode."""
    checks: tuple[PointCheck, ...]
    """Checks of repeated measurements."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on modes, points and parts."""

    @cached_property
    def accepted(self) -> tuple[int, ...]:
        """Indices of the modes that are not rejected."""
        return tuple(i for i, shape in enumerate(self.shapes) if assess_trust(shape.mode) is not Trust.REJECTED)

    @cached_property
    def auto_mac(self) -> Floats:
        """MAC of the accepted modes with each other, shape (m, m)."""
        motions = self.list_motions([point.name for point in self.points])
        return modal.mac_matrix(motions, motions)

    def list_motions(self, names: Sequence[str]) -> list[Complexes]:
        """Return the motions of some points in each accepted mode, shape (p,) each."""
        places = [[point.name for point in self.points].index(name) for name in names]
        return [self.shapes[i].motion[places] for i in self.accepted]


def measure_folder_shapes(
    folder: Path, band: tuple[float, float] | None = None, description: Description | None = None
) -> FolderShapes:
    """Measure the mode shapes along tool, holder, spindle and column.

    The FRFs of all points have common poles. Each is measured between a point and the tool tip: with the hammer at the
    tip and the sensor at the point, or the reverse. Measurements of the same point are compared and averaged.

    Parameters
    ----------
    folder
        Folder with points.csv and the recorded files.
    band
        Frequency range (Hz); None for all usable lines.
    description
        Data that the files lack.

    Returns
    -------
    FolderShapes
        Shapes, shares of the parts, and checks.

    Raises
    ------
    DataError
        If the table or a file is wrong, or the files do not fit together; the message names file and point.
    """
    rows, description = read_point_table(folder), description or Description()
    with time_step("reading"):
        measured = read_point_frfs(rows, description)
        windowed = treat_windows(measured, description)
    with time_step("fitting"):
        shapes = modal.fit_mode_shapes(windowed.frfs, band, windowed.hits)
    shapes = list(windowed.correct(shapes))
    groups = _group_by_point(measured)
    points = tuple(_describe_point(measured, name, group) for name, group in groups.items())
    averaged = tuple(modal.average_points(shape, [*groups.values()]) for shape in shapes)
    shares = tuple(_divide_tip_motion(points, shape) for shape in averaged)
    checks = tuple(_compare_repeated(measured, groups.values(), windowed.frfs, band))
    found = FolderShapes(folder, points, averaged, shares, checks)
    remarks = (*_list_file_remarks(measured), *windowed.remarks, *_find_remarks(found))
    return replace(found, remarks=remarks)


def _group_by_point(measured: Sequence[PointFrf]) -> dict[str, list[int]]:
    """Return the indices of the measurements of each point."""
    groups: dict[str, list[int]] = {}
    for index, one in enumerate(measured):
        groups.setdefault(one.row.point, []).append(index)
    return groups


def _describe_point(measured: Sequence[PointFrf], name: str, group: Sequence[int]) -> MeasuredPoint:
    row = measured[group[0]].row
    return MeasuredPoint(name, row.position, row.part, len(group))


def _divide_tip_motion(points: Sequence[MeasuredPoint], shape: ModeShape) -> tuple[PartShare, ...]:
    position, parts = [point.position for point in points], [point.part for point in points]
    return tuple(modal.compliance_shares(position, parts, shape.motion.real, shape.size_covariance))


def _compare_repeated(
    measured: Sequence[PointFrf],
    groups: Iterable[Sequence[int]],
    frfs: Sequence[Frf],
    band: tuple[float, float] | None,
) -> Iterator[PointCheck]:
    """Compare the further measurements of each point with its first."""
    for first, *others in groups:
        for other in others:
            frac, scale = modal.compare_frfs(frfs[first], frfs[other], band)
            is_repeated = measured[first].role == measured[other].role
            kind = "repeatability" if is_repeated else "reciprocity"
            yield PointCheck(measured[first].row.point, kind, frac, scale)


def _list_file_remarks(measured: Sequence[PointFrf]) -> Iterator[Remark]:
    for one in measured:
        for remark in one.source.remarks:
            about = ", ".join(filter(None, [f"point {one.row.point}", remark.about]))
            if remark.code != "windowed-here":
                yield replace(remark, about=about)


def _find_remarks(found: FolderShapes) -> Iterator[Remark]:
    modes = [found.shapes[i].mode for i in found.accepted]
    if not modes:
        yield make_no_mode_remark()
    yield from check_modes_together(modes)
    yield from (_make_check_remark(check) for check in found.checks if not check.is_passed)
    for i, j in combinations(range(len(modes)), 2):
        if found.auto_mac[i, j] > MAX_AUTO_MAC:
            about, text = f"{modes[i].frequency:.0f} Hz, {modes[j].frequency:.0f} Hz", "these points hardly distinguish"
            yield Remark(
                "shapes-alike", about, f"{text} the modes (MAC {found.auto_mac[i, j]:.2f})", "Measure more points"
            )
    for shape in (found.shapes[i] for i in found.accepted):
        if shape.phase_collinearity < MIN_PHASE_COLLINEARITY:
            text = f"points move with different phases (MPC {shape.phase_collinearity:.2f})"
            cure = "Check for close modes, and sample all channels at the same time"
            yield Remark("complex-shape", f"{shape.mode.frequency:.0f} Hz", text, cure)
    yield from _find_part_remarks(found.points)


def _make_check_remark(check: PointCheck) -> Remark:
    about, figures = f"point {check.point}", f"(FRAC {check.frac:.2f}, size ratio {check.scale:+.2f})"
    if check.kind == "repeatability":
        cure = "Check sensor mounting, hit position and direction, then measure this point again"
        return Remark("not-repeatable", about, f"two measurements of the point differ {figures}", cure)
    cure = "Check position, direction and sensitivity of hammer and sensor at both points"
    return Remark("not-reciprocal", about, f"FRFs differ with hammer and sensor exchanged {figures}", cure)


def _find_part_remarks(points: Sequence[MeasuredPoint]) -> Iterator[Remark]:
    """Yield a remark on each part that cannot be separated from the others."""
    counts = Counter(point.part for point in points)
    front, *behind = dict.fromkeys(point.part for point in points)
    for part in behind:
        if counts[part] == 1:
            text = "one point gives no rotation, so the share counts to the part in front"
            yield Remark("part-not-separated", part, text, "Measure a second point at least 30 mm behind the first")
    missing = [part for part in PARTS[PARTS.index(front) :] if part not in counts]
    for part in missing:
        text = "no point, so the share counts to a neighbouring part"
        yield Remark("part-not-measured", part, text, "Measure two points on this part")


def compare_shapes(found: FolderShapes, reference: FolderShapes) -> tuple[tuple[str, ...], Floats]:
    """Compare the mode shapes of two folders over the points with the same names.

    Parameters
    ----------
    found, reference
        Mode shapes of two folders.

    Returns
    -------
    tuple of str and ndarray, shape (m, n)
        Names of the common points, and the MAC of all modes that are not rejected.

    Raises
    ------
    DataError
        For fewer than three common points.
    """
    names = tuple(point.name for point in found.points if point.name in {other.name for other in reference.points})
    if len(names) < MIN_POINTS:
        finding = f"{len(names)} points have the same names in {found.folder} and {reference.folder}"
        raise DataError(f"{finding}. Name at least {MIN_POINTS} points alike.")
    return names, modal.mac_matrix(found.list_motions(names), reference.list_motions(names))
