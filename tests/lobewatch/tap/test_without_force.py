"""Tap tests without a force sensor: one accelerometer, any hammer, through the whole chain."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from acquisition import Channel, DataError, HammeredStructure, Hammering, SensorInput
from lobewatch.cli import app
from lobewatch.history.history import HistoryRow
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.emulated_spindle import (
    EMULATED_CHANNELS,
    EMULATED_SAMPLE_RATE,
    build_structure,
    map_signal_to_inputs,
    open_synchronized_device,
)
from lobewatch.tap.session import TapSession, plan_session
from lobewatch.tap.state import TapState

GRAVITY = 9.81
OpenSession = Callable[..., TapSession]
Simulate = Callable[..., Any]


def truth(folder: MachineFolder) -> HammeredStructure:
    spindle = folder.machine.spindle
    assert spindle is not None
    structure = build_structure(spindle.build(), spindle.damping_ratio)
    return HammeredStructure(structure, EMULATED_SAMPLE_RATE, np.random.default_rng(1), Hammering())


@pytest.fixture
def without_force(folder: MachineFolder) -> MachineFolder:
    text = re.sub(r"^trigger_n .*\n", "", folder.toml.read_text("utf-8"), flags=re.MULTILINE)
    folder.toml.write_text(text.replace("[tap]\n", '[tap]\nhammer = "none"\n'), "utf-8")
    return MachineFolder(folder.path)


@pytest.fixture
def tapped(without_force: MachineFolder, simulated: Simulate, session_of: OpenSession) -> TapSession:
    """Finish a test of an accelerometer that feels gravity, with some hits too hard or double."""
    spindle, channel = truth(without_force), EMULATED_CHANNELS[1]
    states: list[TapState] = []
    session = session_of(
        without_force,
        lambda: simulated(lambda first, n: spindle(first, n)[1:] + GRAVITY, (channel,)),
        states.append,
    )
    session.run()
    return session


def last_row(folder: MachineFolder) -> HistoryRow:
    return Logbook.open(folder.path).history.rows[-1]


def test_a_test_without_force_gives_frequency_and_damping(tapped: TapSession, without_force: MachineFolder) -> None:
    structure, mode = truth(without_force).structure, tapped.measurement.followed
    assert mode is not None
    for value, true, (low, high) in zip(
        (mode.frequency, mode.damping_ratio),
        (structure.frequency[0], structure.damping_ratio[0]),
        mode.interval(0.999),
        strict=False,
    ):
        assert low < true < high
        assert value == pytest.approx(true, rel=5e-3)
    assert (mode.has_stiffness, mode.n_hits) == (False, 10)
    assert "force-not-measured" in {remark.code for remark in tapped.measurement.remarks}
    calibration = tapped.measurement.calibration
    assert calibration is not None
    assert calibration.bearing_stiffness == pytest.approx(1.28e9, rel=1e-3)
    assert tapped.state.outcome is not None
    assert not re.search(r"\d N/um", " ".join(tapped.state.outcome.texts))
    assert all(hit.peak.endswith("m/s²") for hit in tapped.state.hits)


def test_what_a_test_without_force_stores_holds_no_stiffness(tapped: TapSession, without_force: MachineFolder) -> None:
    assert tapped.state.good == 10
    row = last_row(without_force)
    assert not row.stiffness.is_known
    assert row.frequency.is_known
    assert row.bearing_stiffness.is_known
    assert (row.x, row.y) == ((), ())
    tap = without_force.read(without_force.taps()[0])
    assert tap.frf is None
    assert all(hit.codes is not None and hit.codes.shape[0] == 1 and not hit.force.size for hit in tap.hits)
    with pytest.raises(DataError, match="force"):
        _ = tap.required_frf
    run = CliRunner().invoke(app, ["history", str(without_force.path), "--json"])
    assert json.loads(run.stdout)["taps"][0]["stiffness_n_per_m"] is None


@pytest.mark.parametrize("command", ["status", "trend", "history", "report", "check", "model"])
def test_commands_answer_without_a_stiffness(command: str, tapped: TapSession, without_force: MachineFolder) -> None:
    run = CliRunner().invoke(app, [command, str(without_force.path)])
    assert run.exit_code in (0, 1), run.output
    assert "nan" not in run.output.split()


def test_what_needs_a_stiffness_rejects_with_the_reason(tapped: TapSession, without_force: MachineFolder) -> None:
    path = str(without_force.path)
    lobes = CliRunner().invoke(app, ["lobes", path, "--figure", str(without_force.path / "lobes.png")])
    assert isinstance(lobes.exception, DataError)
    assert "force" in str(lobes.exception)
    other = CliRunner().invoke(app, ["lobes", path, "--tool", "long end mill"])
    assert isinstance(other.exception, DataError)
    assert "force" in str(other.exception)
    check = json.loads(CliRunner().invoke(app, ["check", path, "--json"]).stdout)
    assert {program["verdict"] for program in check["programs"]} == {"unknown"}
    assert all("force" in str(program["remarks"]) for program in check["programs"])


def test_a_cross_tap_without_force_is_rejected(without_force: MachineFolder) -> None:
    with pytest.raises(ValueError, match=r"direction xy.*force"):
        plan_session(without_force, port="/dev/x", direction="xy")


def test_a_series_goes_on_from_a_hammer_to_none(folder: MachineFolder, session_of: OpenSession) -> None:
    structure = truth(folder).structure
    with open_synchronized_device(structure, np.random.default_rng(2)) as open_device:
        session_of(folder, open_device, guided=False).run()
    text = re.sub(r"^trigger_n .*\n", "", folder.toml.read_text("utf-8"), flags=re.MULTILINE)
    folder.toml.write_text(text.replace("[tap]\n", '[tap]\nhammer = "none"\n'), "utf-8")
    folder = MachineFolder(folder.path)
    with open_synchronized_device(structure, np.random.default_rng(3)) as open_device:
        session_of(folder, open_device, guided=False).run()
    before, after = Logbook.open(folder.path).history.rows
    assert after.series == before.series
    apart = after.frequency.value - before.frequency.value
    assert abs(apart) < 4 * np.hypot(before.frequency.std, after.frequency.std)
    assert (before.stiffness.is_known, after.stiffness.is_known) == (True, False)


def test_one_channel_is_felt_alone() -> None:
    channel = Channel("acceleration", 1.0, 5.0)
    signal = map_signal_to_inputs([SensorInput(0, channel)], lambda _, n: np.array([[1.0] * n, [2.0] * n]))
    assert signal(0, 3).tolist() == [[2.0, 2.0, 2.0]]
