"""History on disk against computed results, value by value and in the same units."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from acquisition import Circumstances, TapTest, from_accelerance, new_tap_id
from lobewatch import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from modal import Mode, synthesize_frf

pytestmark = pytest.mark.quick

LINES = np.arange(4.0, 4000.0, 4.0)


def test_rows_are_read_back_as_they_were_computed(tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    folder = MachineFolder(tmp_path / "m")
    for days, modes in enumerate(([Mode(1713.0, 0.03, 3.5e7), Mode(2900.0, 0.02, 9e7)], [Mode(900.0, 0.03, 3.5e7)])):
        about = Circumstances("m", datetime(2026, 1, 15, tzinfo=UTC) + timedelta(days=days), "reference")
        frf = synthesize_frf(modes, LINES)
        folder.commit(TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance)))
    worked_out = Logbook(folder)
    worked_out.stored_verdicts(worked_out.taps[0].id)
    read = Logbook.open(folder.path).history.rows
    for expected, row in zip(worked_out.history.rows, read, strict=True):
        for name, value in vars(expected).items():
            if name in ("tap_id", "time", "tool", "direction", "remarks", "x", "y", "questions"):
                assert getattr(row, name) == value
            elif name != "verdicts":
                np.testing.assert_array_equal(getattr(row, name), value, err_msg=name)
        assert row.verdicts is not None
        assert expected.verdicts is not None
        assert [one.stability for one in row.verdicts.values()] == [one.stability for one in expected.verdicts.values()]
        limits, wanted = ([one.limit for one in rulings.values()] for rulings in (row.verdicts, expected.verdicts))
        np.testing.assert_array_equal(limits, wanted)
    assert read[0].frequency.is_known
    assert not read[1].frequency.is_known
