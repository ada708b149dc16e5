"""The scatter that a machine of a plant may be expected to have, learnt from the others when it is young."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from lobewatch.decay.change_point import FIRST_JUDGED
from lobewatch.decay.known_scatter import scatter_of_others
from lobewatch.decay.readings import Scatter
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.journal.known_scatter import KnownScatter
from lobewatch.plant.standing_file import STANDING, read_kept
from lobewatch.plant.summary import SeriesSummary

MOST = 500
"""Machines that are asked at most; chosen."""


def learn_scatter(logbook: Logbook) -> None:
    """Write down in the journal what the machines beside a young one tell of its scatter, and what it was before a
    repair; once after each baseline, as soon as there is anything to tell.

    BusyError, OSError and DataError as every line of the journal.
    """
    history = logbook.history
    rows = history.current
    counts = Counter((row.tool, row.direction) for row in rows)
    if not counts or logbook.files.known_scatter is not None or all(count >= FIRST_JUDGED for count in counts.values()):
        return
    series = [*_series_beside(logbook.folder.path)]
    alone = scatter_of_others([Scatter(*one.scatter) for one in series])
    common = scatter_of_others([Scatter(*one.common_scatter) for one in series if one.direction == "x"])
    if alone.freedom:
        with logbook.folder.locked():
            logbook.folder.journal.append(KnownScatter(rows[-1].time, alone, common, len(series)).line)


def _series_beside(folder: Path) -> Iterator[SeriesSummary]:
    """The series of all machines in the folder that a machine stands in, its own ones among them."""
    for path in islice(sorted(folder.resolve().parent.glob(f"*/{STANDING}")), MOST):
        summary = read_kept(path.parent)
        yield from () if summary is None else summary.series
