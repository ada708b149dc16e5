"""Recordings of one acceleration channel, replayed for a machine without a force sensor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from acquisition import DataError
from lobewatch.cli import app
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.emulated_spindle import EMULATED_SAMPLE_RATE as RATE
from tests.lobewatch.conftest import Shop
from tests.modal.test_hit_scatter import TRUTH, tap

WITHOUT = '[tap]\nhammer = "none"\n'


def record(path: Path, force: bool = False) -> Path:
    """Five hits in one long record, one column of acceleration (or force before it), with its units."""
    hits = tap(3, hits=5)
    columns = [np.concatenate([hit.acceleration for hit in hits])]
    heads = ["acceleration [m/s^2]"]
    if force:
        columns.insert(0, np.concatenate([hit.force for hit in hits]))
        heads.insert(0, "force [N]")
    time = np.arange(columns[0].size) / RATE
    text = ",".join(["time [s]", *heads])
    np.savetxt(path, np.transpose([time, *columns]), fmt="%.8g", delimiter=",", header=text, comments="")
    return path


@pytest.fixture
def without_force(shop: Shop) -> Shop:
    shop.edit("[tap]\n", WITHOUT)
    text = (shop.path / "machine.toml").read_text("utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("trigger_n")]
    (shop.path / "machine.toml").write_text("\n".join(lines), "utf-8")
    return shop


@pytest.mark.parametrize("force", [False, True])
def test_hits_are_found_in_the_response_and_tell_frequency_and_damping(
    force: bool, without_force: Shop, tmp_path: Path
) -> None:
    path = record(tmp_path / "decays.csv", force)
    run = CliRunner().invoke(app, ["replay", str(without_force.path), str(path), "--date", "2026-03-01"])
    assert run.exit_code == 0, run.output
    (row,) = without_force.logbook.history.rows
    assert row.frequency.value == pytest.approx(TRUTH[0], abs=5 * row.frequency.std)
    assert row.damping_ratio.value == pytest.approx(TRUTH[1], abs=5 * row.damping_ratio.std)
    assert not row.stiffness.is_known
    folder = MachineFolder(without_force.path)
    stored = folder.read(folder.taps()[0])
    assert (stored.frf, len(stored.accepted)) == (None, 5)


def test_a_tap_file_of_ours_is_replayed_for_another_machine(without_force: Shop, tmp_path: Path) -> None:
    path = record(tmp_path / "decays.csv")
    CliRunner().invoke(app, ["replay", str(without_force.path), str(path), "--date", "2026-03-01"])
    other = Shop(tmp_path / "other")
    taps = without_force.path / "taps"
    run = CliRunner().invoke(app, ["replay", str(other.path), str(next(taps.iterdir()))])
    assert run.exit_code == 0, run.output
    assert [row.frequency.value for row in other.logbook.history.rows] == [
        row.frequency.value for row in without_force.logbook.history.rows
    ]


def test_with_a_hammer_a_recording_without_force_is_rejected(shop: Shop, tmp_path: Path) -> None:
    path = record(tmp_path / "decays.csv")
    run = CliRunner().invoke(app, ["replay", str(shop.path), str(path), "--date", "2026-03-01"])
    assert isinstance(run.exception, DataError)
    assert "force" in str(run.exception)
