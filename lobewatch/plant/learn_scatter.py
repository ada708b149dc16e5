"""The scatter that a machine of a plant may be expected to have, learnt from the others when it is young."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from acquisition import ACROSS
from lobewatch.decay.change_point import FIRST_JUDGED
from lobewatch.decay.known_scatter import scatter_of, scatter_of_others
from lobewatch.decay.readings import NOTHING_KNOWN, UNKNOWN_SCATTER, KnownSpread, SeriesScatter
from lobewatch.decay.series_history import series_history
from lobewatch.history.history import History
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.journal.known_scatter import KnownScatter
from lobewatch.plant.standing_file import STANDING, read_kept

MOST = 500
"""Machines that are asked at most; chosen."""


def learn_scatter(logbook: Logbook) -> None:
    """Write down in the journal what the machines beside a young one tell of its scatter, and what it was before a
    repair; once after each baseline, as soon as there is anything to tell.

    BusyError, OSError and DataError as every line of the journal.
    """
    history = logbook.history
    rows = history.current
    counts = Counter((row.tool, row.direction) for row in rows if row.direction != ACROSS)
    if not counts or logbook.files.known_scatter is not None or all(count >= FIRST_JUDGED for count in counts.values()):
        return
    known = [*_scatters_beside(logbook.folder.path), *_scatters_before(history)]
    alone, common = (scatter_of_others(scatters) for scatters in zip(*known, strict=True)) if known else NOTHING_KNOWN
    if alone.freedom:
        number = sum(scatter.freedom > 0 for scatter, _ in known)
        with logbook.folder.locked():
            logbook.folder.journal.append(KnownScatter(rows[-1].time, alone, common, number).line)


def _scatters_beside(folder: Path) -> Iterator[SeriesScatter]:
    """Those of the series of all machines in the folder that a machine stands in."""
    for path in islice(sorted(folder.resolve().parent.glob(f"*/{STANDING}")), MOST):
        summary = read_kept(path.parent)
        for series in () if summary is None else summary.series:
            common = series.common_scatter if series.direction == "x" else UNKNOWN_SCATTER
            yield SeriesScatter(KnownSpread(*series.scatter), KnownSpread(*common))


def _scatters_before(history: History) -> Iterator[SeriesScatter]:
    """Those of the series that ended with a new baseline."""
    before = [row for row in history.rows if row.baseline != history.baseline]
    for baseline, series in dict.fromkeys((row.baseline, row.series) for row in before):
        alike = [row for row in before if (row.baseline, row.series) == (baseline, series)]
        x, y = ([row for row in alike if row.direction == direction] for direction in ("x", "y"))
        for rows, beside in ((x, y), (y, ())):
            trend = series_history(rows, beside).frequency.trend if rows else None
            if trend is not None:
                yield SeriesScatter(scatter_of(trend.readings.y), scatter_of(trend.readings.common.y))
