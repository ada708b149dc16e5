"""The whole way of one tap test, from its hits to the verdicts on programs, against a chain of peers.

Ours: ten hits checked and averaged, stored for good, modes with errors, bearings calibrated, compared with what was
before, three programs judged over 300 draws of the doubt, in a machine folder with a tap test in y. Theirs: checks and
H1 by pyFRF, codes and FRF by h5py, modes by sdypy-EMA at frequencies that it is told, bearings by finite elements, each
program at 20 depths by the textbook loop of semi-discretisation; nothing is compared, no error is known.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyFRF
from bench_archive import PACKED, plain
from bench_dsm import MEASURED, spindle
from bench_lobes import textbook
from bench_modal import theirs as modes_by_ema
from bench_replay import hammered_hits
from dsm_peers import FiniteElements
from race import Race

from acquisition import Circumstances, Frf, Hit, TapDirection, TapTest, average_good_hits, evaluate_hit, new_tap_id
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from modal import Mode

MODES = [Mode(1000.0, 0.02, 2e7), Mode(1713.0, 0.03, 3.5e7), Mode(2900.0, 0.025, 9e7)]
"""Modes of the tapped structure."""
PROGRAMS, DEPTHS = 3, np.linspace(1e-4, 5e-3, 20)


def races() -> Iterator[Race]:
    """Compare the two chains."""
    hits = hammered_hits()
    with TemporaryDirectory() as scratch:
        make_machine_folder(Path(scratch, "m"), "surrogate_machine.toml")
        logbook = Logbook(MachineFolder(Path(scratch, "m")))
        _ours(logbook, hits, "y")
        yield Race(
            "ten hits to three verdicts",
            lambda: _ours(logbook, hits, "x"),
            "pyFRF, h5py, sdypy-EMA, finite elements, textbook loop",
            lambda: _theirs(hits, Path(scratch, "plain.h5")),
            rounds=5,
        )


def _ours(logbook: Logbook, hits: tuple[Hit, ...], direction: TapDirection) -> object:
    for hit in hits:
        evaluate_hit(hit)
    average, flags = average_good_hits(hits)
    about = Circumstances("m", datetime.now(UTC), "reference", direction)
    tap = TapTest(new_tap_id(about), about, average, hits, flags)
    logbook.commit(tap)
    return logbook.history, logbook.verdicts()


def _theirs(hits: tuple[Hit, ...], file: Path) -> None:
    force, response = np.stack([hit.force for hit in hits]), np.stack([hit.acceleration for hit in hits])
    whole = pyFRF.FRF(int(hits[0].sample_rate), force, response, exc_type="f", resp_type="a", frf_estimator="H1")
    for one, other in zip(force, response, strict=True):
        whole.is_data_ok(one, other)
    frf = Frf(whole.get_f_axis()[1:], whole.get_H1()[0, 0, 1:], whole.get_coherence()[0, 1:], len(hits))
    plain(file, TapTest("plain", Circumstances("m", datetime.now(UTC), "reference"), frf, hits), **PACKED)
    modes_by_ema([frf], [mode.frequency for mode in MODES])
    FiniteElements(spindle("euler-bernoulli")).calibrate(MEASURED)
    for _ in range(PROGRAMS):
        textbook(MODES, MODES, np.array([6200.0]), DEPTHS)
