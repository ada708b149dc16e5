"""What the report of a machine is made from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property

from acquisition import Frf, TapTest
from lobewatch.decay import SeriesStanding
from lobewatch.history import Row
from lobewatch.history.left_out import left_out
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.outlook import Outlook, outlook_of
from lobewatch.machine import Machine
from lobewatch.show.programs.describe_advice import ProgramAdvice, advise_program
from lobewatch.show.report.lobe_course import LobeCourse, lobe_course
from lobewatch.show.report.lobe_diagram import LobeDiagram, lobe_diagram
from lobewatch.tool import Assembly

BELOW, ABOVE = 0.6, 1.4
"""Ends of the frequencies shown over those of the usable band; chosen."""
BELOW_MODES = 0.3
"""Least of them over the lowest mode: further down a response drowns its modes, for acceleration is divided by w^2."""


@dataclass(frozen=True, eq=False)
class ReportMaterial:
    """A machine and one of its series, with all that their report says; what several sections need is made once."""

    analysis: Analysis
    """Answers from the files of the machine."""
    rows: Sequence[Row]
    """Rows of the series that count, oldest first; at least one."""
    first: TapTest | None
    """Oldest tap test of the series; None where the newest is the only one."""
    newest: TapTest
    """Newest tap test of the series."""
    outlook: Outlook
    """Outlook of the machine."""
    programs: Sequence[ProgramAdvice]
    """Programs of the machine, with all that is said of them."""

    @property
    def machine(self) -> Machine:
        """machine.toml."""
        return self.analysis.machine

    @property
    def last(self) -> Row:
        """Row of the newest tap test of the series."""
        return self.rows[-1]

    @property
    def series(self) -> SeriesStanding:
        """How the series stands."""
        return self.outlook.series(self.last.tool, self.last.direction)

    @cached_property
    def assembly(self) -> Assembly:
        """The tool of the series as tapped."""
        return self.analysis.assembly(self.last.tool)

    @cached_property
    def excluded_rows(self) -> Sequence[Row]:
        """Rows of the tap tests of the series that do not count."""
        return left_out(self.analysis.folder, self.analysis.files.excluded, self.rows)

    @cached_property
    def lobe_diagram(self) -> LobeDiagram | None:
        """Lobes of the first cut of the tool, with the programs on them; None where it has none."""
        return lobe_diagram(self.analysis, self.assembly, self.programs)

    def response_band(self, frf: Frf) -> tuple[float, float]:
        """Frequencies that are shown of a response (Hz)."""
        ends = float(frf.frequency[0]), float(frf.frequency[-1])
        low, high = self.machine.mode.band_hz or frf.usable_band or ends
        lowest = min((frequency for frequency, *_ in self.last.modes), default=0.0)
        return max(BELOW * low, BELOW_MODES * lowest, ends[0]), min(ABOVE * high, ends[1])

    @cached_property
    def lobe_course(self) -> LobeCourse | None:
        """Lobes of the first cut of the tool over the series; None where fewer than two tap tests show it."""
        cut = next(iter(self.machine.cuts(self.assembly.tool)), None)
        if cut is None:
            return None
        series = self.outlook.standing.series
        return lobe_course(cut, self.rows, self.assembly, series, self.machine, self.analysis.cuts)


def report_material(analysis: Analysis, tool: str, direction: str, now: datetime | None) -> ReportMaterial:
    """All for one series; ValueError where it holds no tap test. now: None for the clock's."""
    rows, entries = analysis.history.series(tool, direction), {entry.id: entry for entry in analysis.taps}
    if not rows:
        raise ValueError(f"{analysis.folder.path}: no tap test with tool {tool!r} in direction {direction!r} yet")
    outlook = outlook_of(analysis, now or datetime.now(UTC))
    newest = analysis.folder.read(entries[rows[-1].tap_id])
    first = analysis.folder.read(entries[rows[0].tap_id]) if len(rows) > 1 else None
    programs = [advise_program(analysis, verdict) for verdict in analysis.verdicts()]
    return ReportMaterial(analysis, rows, first, newest, outlook, programs)
