"""Power of normal production, without a verdict: one piece of evidence per program, and questions on a reading."""

import itertools
from collections.abc import Iterator, Sequence
from statistics import median

from acquisition import Remark
from lobewatch.cuts.learning.cut_likelihood import estimate_force_by_power
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.journal.entries import CutEntry, geometry_key, material_key
from lobewatch.machine.settings.drive_power import predict_power

MAX_MATERIAL_RATIO = 2.0
"""Largest ratio of Kt by power to that of the material, either way, without a question; chosen."""
MAX_PROGRAM_CHANGE = 1.3
"""Largest ratio of Kt by power to that of earlier days of a program, either way, without a question; chosen."""
MAX_OTHER_PROGRAM_RATIO = 1.15
"""Largest ratio of a power to that of another program for which the two may have been confused; chosen."""


def merge_readings(entries: Sequence[CutEntry]) -> list[tuple[CutEntry, int]]:
    """Merge power readings: the newest of each program with the median Kt of its days, and the number of days.

    The readings of a day share feed, radial depth and edges, so a day counts once: the median of its readings.
    """
    readings = sorted((entry for entry in entries if entry.is_power_reading), key=_program_key)
    return [_merge(list(group)) for _, group in itertools.groupby(readings, key=_program_key)]


def _program_key(entry: CutEntry) -> tuple[str, str, str, str]:
    """Return the key of the program that a reading belongs to."""
    shape, material = geometry_key(entry.cut), material_key(entry.coefficients, entry.cut)
    return entry.tool, entry.program or "", str((*shape, entry.feed, entry.feed_per_tooth)), str(material)


def _merge(entries: Sequence[CutEntry]) -> tuple[CutEntry, int]:
    newest = max(entries, key=lambda entry: entry.at)
    days = itertools.groupby(sorted(entries, key=_day), key=_day)
    forces = [median(map(_force_by_power, day)) for _, day in days]
    return newest.with_tangential_by_power(median(forces) * newest.cut.tangential), len(forces)


def _day(entry: CutEntry) -> str:
    return f"{entry.at.astimezone():%Y-%m-%d}"


def _force_by_power(entry: CutEntry) -> float:
    """Return Kt by power over that of machine.toml; 1 without a power."""
    return 1.0 if entry.power is None else entry.power.tangential / entry.cut.tangential


def is_off_by_two(force: float) -> bool:
    """Return whether Kt by power over that of the material is off by a factor of two."""
    return max(force, 1 / force) >= MAX_MATERIAL_RATIO


def find_reading_remarks(entry: CutEntry, machine: Machine, earlier: Sequence[CutEntry]) -> Iterator[Remark]:
    """Find the questions on a stored power: another program, a change from earlier days, or another material."""
    if entry.power is None:
        return
    same = [old for old in earlier if old.is_evidence and old.power and _program_key(old) == _program_key(entry)]
    usual = median(map(_force_by_power, same)) if same else 1.0
    change = _force_by_power(entry) / usual
    if max(change, 1 / change) > MAX_PROGRAM_CHANGE:
        exclude = f"then exclude {entry.id} with folder_updates.exclude_entry"
        others = [table.name for table in machine.program if _is_power_of(entry, table, machine, usual)]
        if others:
            text = f"the power is {change:.2g} times that expected here, and fits program {others[0]!r}"
            yield Remark("power-of-other-program", entry.id, text, f"Enter it for the program that ran, {exclude}")
        elif same:
            text = f"the power is {change:.2g} times that of earlier readings of this program"
            cure = f"Check the power in air, the feed and the edges. After a wrong reading, {exclude}."
            yield Remark("power-changed", entry.id, text, cure)
    force = estimate_force_by_power(entry.power, entry.cut, entry.has_chatter).force
    if is_off_by_two(force):
        yield make_material_remark(entry.id, force)


def make_material_remark(cut: str, force: float) -> Remark:
    """Return the question whether the material is right; force: Kt by power over that of the material."""
    use = "" if force > 1 else ", and lobewatch does not learn from it"
    text = f"the power gives {force:.2g} times the Kt of the material{use}"
    cure = "Check the material, the power in air and its unit. Set tangential_n_per_mm2 if the reading is right."
    return Remark("material-contradicted", cut, text, cure)


def _is_power_of(entry: CutEntry, table: ProgramTable, machine: Machine, force: float) -> bool:
    """Return whether another program has the power of a reading; force: Kt by power over that of machine.toml."""
    if entry.power is None or table.name == entry.program or table.tool != entry.tool:
        return False
    expected = predict_power(machine, table, table.speed_rpm, table.depth_mm / 1e3)
    if expected is None:
        return False
    ratio = entry.power.watts / (force * expected.watts)
    return max(ratio, 1 / ratio) <= MAX_OTHER_PROGRAM_RATIO
