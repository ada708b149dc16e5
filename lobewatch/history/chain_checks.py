"""Evidence for the sensors behind tap tests: known mass, spindle model, another tool, or printed sensitivities."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

from acquisition import CROSS_TAP, Remark
from lobewatch.history.history import HistoryRow
from lobewatch.machine import Machine, TapEntry
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain, find_deciding_check
from lobewatch.machine.settings.sensor_models import fits_sensor_models
from lobewatch.measurement.chain_check import ChainCheck, ChainEvidence, not_recorded_remark, unchecked_remark
from lobewatch.tool import Assembly

MAX_MODEL_STIFFNESS_RATIO = 1.2
"""Ratio of K to that of the calibrated model, or the inverse, up to which both agree; chosen.

An error by a factor of 3 then needs a model that is wrong by a factor of 2.5 the other way."""
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

    def check(self, tap_id: str) -> ChainCheck:
        """Return the check of one tap test; its mass check counts before all other evidence."""
        entry = self._entries[tap_id]
        if entry.chain is None:
            return ChainCheck(tap_id, remark=not_recorded_remark(entry.tool), is_recorded=False)
        decides = find_deciding_check(entry.chain, entry.created, self._mass_checks)
        if decides is not None and decides.passed:
            return ChainCheck(tap_id, ChainEvidence.MASS, decides.date)
        if decides is None:
            for found in self._find_other_evidence(entry, entry.chain):
                return found
        counting = [check for check in self._mass_checks if not check.excluded]
        remark = unchecked_remark(entry.direction, self._path, decides, next(reversed(counting), None))
        return ChainCheck(tap_id, remark=remark)

    def _find_other_evidence(self, entry: TapEntry, chain: SensorChain) -> Iterator[ChainCheck]:
        row = self._rows.get(entry.id)
        if row is not None and self._agrees_with_model(row):
            yield ChainCheck(entry.id, ChainEvidence.MODEL, row.time)
        for other in reversed(self._rows.values()):
            is_near = abs(other.time - entry.created) <= MAX_OTHER_TOOL_AGE and other.tool != entry.tool
            if is_near and self._entries[other.tap_id].chain == chain and self._agrees_with_model(other):
                yield ChainCheck(entry.id, ChainEvidence.OTHER_TOOL, other.time)
        if fits_sensor_models(self._machine.daq, chain):
            yield ChainCheck(entry.id, ChainEvidence.SENSOR_MODELS, entry.created)

    def _agrees_with_model(self, row: HistoryRow) -> bool:
        """Tell whether K of a tap test at the tip, without open questions, is that of its calibrated model."""
        if self._machine.tap.position_mm or row.questions or not row.stiffness.is_known:
            return False
        ratio = row.stiffness.value / row.modal_tip_stiffness
        return 1 / MAX_MODEL_STIFFNESS_RATIO <= ratio <= MAX_MODEL_STIFFNESS_RATIO

    def attach(self, assembly: Assembly) -> Assembly:
        """Return an assembly with the checks of its tap tests, and the remarks on those without evidence."""
        used = [assembly.taps[direction] for direction in assembly.directions if direction in assembly.taps]
        checks = tuple(map(self.check, used))
        recorded = [check.remark for check in checks if check.remark is not None and check.is_recorded]
        others = dict.fromkeys(check.remark for check in checks if check.remark is not None and not check.is_recorded)
        remarks = (*assembly.remarks, *others)
        return replace(assembly, chain_checks=checks, unchecked=(*assembly.unchecked, *recorded), remarks=remarks)

    def newest_remarks(self, rows: Sequence[HistoryRow]) -> Iterator[Remark]:
        """Yield the remarks on the newest tap tests of each tool and direction that nothing has checked."""
        newest = {(row.tool, row.direction): row for row in rows if row.direction != CROSS_TAP}
        for row in newest.values():
            check = self.check(row.tap_id)
            if check.remark is not None and check.is_recorded and row.stiffness.is_known:
                yield replace(check.remark, about=f"{row.tool}, {row.direction}")
