"""Evidence for the sensors behind tap tests: known mass, model, tool geometry, another tool, printed sensitivities."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

from acquisition import CROSS_TAP, Remark
from lobewatch.history.history import HistoryRow
from lobewatch.machine import Machine, TapEntry
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain, find_deciding_check
from lobewatch.measurement.chain_check import (
    ChainCheck,
    ChainEvidence,
    format_check_command,
    not_recorded_remark,
    unchecked_remark,
)
from lobewatch.measurement.sensor_models import fits_sensor_models
from lobewatch.measurement.tool_compliance import find_tool_beam, has_plausible_size
from lobewatch.tool import Assembly
from lobewatch.verdicts.verdict import Stability, StoredVerdict

MAX_MODEL_STIFFNESS_RATIO = 1.2
"""Ratio of K to that of the calibrated model, or the inverse, up to which both agree; chosen.

An error by a factor of 3 then needs a model that is wrong by a factor of 2.5 the other way."""
MAX_DRAWING_STIFFNESS_RATIO = 2.0
"""Ratio of K to that of the calibrated model, or the inverse, above which they contradict each other; chosen.

A real spindle is not twice as stiff as its drawing says. Only a known mass counts then."""
MAX_OTHER_TOOL_AGE = timedelta(hours=24)
"""Longest time between a tap test and that of another tool which is evidence for its chain; chosen."""


class ChainChecks:
    """Checks of the sensors behind the tap tests of a machine."""

    def __init__(
        self,
        machine: Machine,
        rows: Sequence[HistoryRow],
        entries: Mapping[str, TapEntry],
        mass_checks: Sequence[MassCheckEntry],
        path: Path | str,
    ) -> None:
        """Use these tap tests. rows: history; entries: by identity; path: machine folder, for commands."""
        self._machine, self._entries, self._mass_checks, self._path = machine, entries, mass_checks, path
        self._rows = {row.tap_id: row for row in rows if row.direction != CROSS_TAP}
        self._sorted = list(self._rows.values())
        self._checks: dict[str, ChainCheck] = {}

    def check(self, tap_id: str) -> ChainCheck:
        """Return the check of one tap test; its mass check counts before all other evidence."""
        if tap_id not in self._checks:
            self._checks[tap_id] = self._check(tap_id)
        return self._checks[tap_id]

    def _check(self, tap_id: str) -> ChainCheck:
        entry = self._entries[tap_id]
        if entry.chain is None:
            return ChainCheck(tap_id, remark=not_recorded_remark(entry.tool), is_recorded=False)
        decides = find_deciding_check(entry.chain, entry.created, self._mass_checks)
        is_measured = decides is not None and decides.mass_kg is not None
        if decides is not None and decides.passed and is_measured:
            return ChainCheck(tap_id, ChainEvidence.MASS, decides.date)
        other = None if is_measured else next(self._find_other_evidence(entry, entry.chain, decides), None)
        if other is not None:
            return other
        counting = [check for check in self._mass_checks if check.mass_kg is not None and not check.excluded]
        command = format_check_command(self._path, entry.direction, self._machine.daq.channel)
        remark = unchecked_remark(entry.direction, self._path, command, decides if is_measured else None, counting)
        return ChainCheck(tap_id, remark=remark)

    def _find_other_evidence(
        self, entry: TapEntry, chain: SensorChain, emulator: MassCheckEntry | None
    ) -> Iterator[ChainCheck]:
        """Yield all evidence but a mass, the strongest first; emulator: check that the emulated device brings."""
        row = self._rows.get(entry.id)
        own = None if row is None else self._agreement(row)
        if own is not None:
            yield ChainCheck(entry.id, own, entry.created)
        first = bisect_left(self._sorted, entry.created - MAX_OTHER_TOOL_AGE, key=_time_of)
        last = bisect_right(self._sorted, entry.created + MAX_OTHER_TOOL_AGE, key=_time_of)
        for other in reversed(self._sorted[first:last]):
            is_same = other.tool != entry.tool and self._entries[other.tap_id].chain == chain
            if is_same and self._agreement(other):
                yield ChainCheck(entry.id, ChainEvidence.OTHER_TOOL, other.time)
        ratio = math.nan if row is None else self._ratio_to_model(row)
        if math.isfinite(ratio) and not _is_within(ratio, MAX_DRAWING_STIFFNESS_RATIO):
            return
        if fits_sensor_models(self._machine.daq, chain):
            yield ChainCheck(entry.id, ChainEvidence.SENSOR_MODELS, entry.created)
        if emulator is not None:
            yield ChainCheck(entry.id, ChainEvidence.EMULATOR, emulator.date)

    def _agreement(self, row: HistoryRow) -> ChainEvidence | None:
        """Return the evidence of a tap test by itself: its spindle model, else the geometry of its tool."""
        ratio = self._ratio_to_model(row)
        if _is_within(ratio, MAX_MODEL_STIFFNESS_RATIO):
            return ChainEvidence.MODEL
        is_contradicted = math.isfinite(ratio) and not _is_within(ratio, MAX_DRAWING_STIFFNESS_RATIO)
        if row.questions or self._machine.tap.position_mm or is_contradicted:
            return None
        tool = find_tool_beam(self._machine, row.tool)
        return ChainEvidence.TOOL if has_plausible_size(row.tip_compliance, tool, row.highest_frequency) else None

    def _ratio_to_model(self, row: HistoryRow) -> float:
        """Return K of a tap test at the tip over that of its calibrated model; NaN if unknown or in question."""
        if self._machine.tap.position_mm or row.questions or not row.stiffness.is_known:
            return math.nan
        return row.stiffness.value / row.modal_tip_stiffness

    def attach(self, assembly: Assembly) -> Assembly:
        """Return an assembly with the checks of its tap tests, and the remarks on those without evidence."""
        used = [assembly.taps[direction] for direction in assembly.directions if direction in assembly.taps]
        checks = tuple(map(self.check, used))
        recorded = [check.remark for check in checks if check.remark is not None and check.is_recorded]
        return replace(assembly, chain_checks=checks, unchecked=(*assembly.unchecked, *recorded))

    def limit_verdicts(self, row: HistoryRow, verdicts: Mapping[str, StoredVerdict]) -> Mapping[str, StoredVerdict]:
        """Return the verdicts after a tap test, doubtful instead of stable where nothing checks the sensors."""
        tools = {program.name: program.tool for program in self._machine.program}
        stable = {tools[name] for name, verdict in verdicts.items() if verdict.stability is Stability.STABLE}
        unchecked = {tool for tool in stable if any(map(self._is_unchecked, self._find_newest(tool, row)))}
        return {
            name: verdict._replace(stability=Stability.DOUBTFUL)
            if tools[name] in unchecked and verdict.stability is Stability.STABLE
            else verdict
            for name, verdict in verdicts.items()
        }

    def _find_newest(self, tool: str, row: HistoryRow) -> Iterable[str]:
        """Return the newest tap tests of a tool in x and y up to a row of its series."""
        newest: dict[str, str] = {}
        for other in reversed(self._sorted[: bisect_right(self._sorted, row.time, key=_time_of)]):
            if other.baseline != row.baseline or len(newest) == 2:
                break
            if other.tool == tool:
                newest.setdefault(other.direction, other.tap_id)
        return newest.values()

    def _is_unchecked(self, tap_id: str) -> bool:
        check = self.check(tap_id)
        return check.is_recorded and check.remark is not None

    def newest_remarks(self, rows: Sequence[HistoryRow]) -> Iterator[Remark]:
        """Yield the remarks on the newest tap tests of each tool and direction that nothing has checked."""
        newest = {(row.tool, row.direction): row for row in rows if row.direction != CROSS_TAP}
        for row in newest.values():
            check = self.check(row.tap_id)
            if check.remark is not None and check.is_recorded and row.stiffness.is_known:
                yield replace(check.remark, about=f"{row.tool}, {row.direction}")


def _time_of(row: HistoryRow) -> datetime:
    return row.time


def _is_within(ratio: float, limit: float) -> bool:
    """Tell whether a ratio and its inverse are up to a limit; NaN is not."""
    return 1 / limit <= ratio <= limit
