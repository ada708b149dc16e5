"""Result at the end of a tap test, and the curves of its screen."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import (
    Channel,
    Circumstances,
    HammeredStructure,
    Hit,
    RunningMean,
    SimulatedSource,
    TapDirection,
    TapTest,
    Trigger,
    capture_hits,
    from_accelerance,
    new_tap_id,
)
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.measurement import Estimate
from lobewatch.monitoring.series_history import build_series_history
from lobewatch.monitoring.status_rules import FREQUENCY_ALARM, MODE_LOST, PROGRAM_DOUBTFUL
from lobewatch.tap.live_curves import build_curves
from lobewatch.tap.session import build_outcome
from lobewatch.tap.state import Outcome
from modal import Mode, synthesize_frf

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
LINES = np.arange(4.0, 4000.0, 4.0)
Pair = tuple[Channel, Channel]


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    """Make a machine without a model, which would raise questions at these stiffnesses."""
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    found = MachineFolder(tmp_path / "m")
    text = found.toml.read_text("utf-8")
    found.toml.write_text(text[: text.index("\n[spindle]\n")], "utf-8")
    return found


def tapped(
    folder: MachineFolder, days: float, frequency: float, direction: TapDirection = "x", stiffness: float = 3e8
) -> Outcome:
    about = Circumstances("m", START + timedelta(days=days), "reference", direction)
    frf = synthesize_frf([Mode(frequency, 0.03, stiffness)], LINES)
    folder.commit(TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance)))
    logbook = Logbook(folder)
    return build_outcome(logbook, logbook.measurement(logbook.newest_tap().id))


def test_the_status_follows_the_fall_of_the_frequency(folder: MachineFolder) -> None:
    first = tapped(folder, 0, 1720.0)
    assert first.status == "warn"
    assert "1720" in first.texts[0]
    assert "%" not in first.texts[0]  # nothing to compare with
    assert "direction y" in first.next_step
    (doubtful,) = (text for text in first.texts if "doubtful" in text)
    assert all(f"{letter}: slot at" in doubtful for letter in "ABC")
    both = tapped(folder, 0.1, 1700.0, "y")
    assert (both.status, "2026-02-14" in both.next_step) == ("good", True)
    assert not [text for text in both.texts if "doubtful" in text or "stable" in text]
    lights = [tapped(folder, 30 * month, 1720 * share).status for month, share in enumerate((0.96, 0.94, 0.89), 1)]
    assert lights == ["good", "warn", "alarm"]
    worn = tapped(folder, 120, 0.88 * 1720)
    assert "-12.0 ± " in worn.texts[0]
    assert worn.next_step == FREQUENCY_ALARM.remedy


def test_the_fall_has_the_standard_error_of_both_frequencies(folder: MachineFolder) -> None:
    """Check 0.1 % each, in addition to reclamping: 0.96 sqrt(2) 0.1 % = 0.14 %."""
    tapped(folder, 0, 1720.0)
    tapped(folder, 30, 0.96 * 1720)
    first, last = Logbook(folder).history.rows
    exact, scattered = (
        build_series_history(
            [
                replace(row, frequency=Estimate(row.frequency.value, share * row.frequency.value))
                for row in (first, last)
            ]
        ).frequency.change
        for share in (0.0, 0.001)
    )
    assert scattered.value == pytest.approx(-4.0, abs=0.01)
    assert math.sqrt(scattered.std**2 - exact.std**2) == pytest.approx(0.136, abs=0.001)


def test_a_worn_direction_is_not_forgotten_when_another_one_is_tapped(folder: MachineFolder) -> None:
    tapped(folder, 0, 1720.0)
    tapped(folder, 30, 0.94 * 1720)
    assert tapped(folder, 60, 0.88 * 1720).status == "alarm"
    other = tapped(folder, 60.1, 1700.0, "y")
    assert other.status == "alarm"
    assert any("reference, x" in text and "12.0 ± " in text for text in other.texts)
    assert other.next_step == FREQUENCY_ALARM.remedy


def test_a_program_that_chatters_is_named(folder: MachineFolder) -> None:
    soft = tapped(folder, 0, 1720.0, stiffness=3e6)
    assert soft.status == "alarm"
    assert any("A: slot at 12 600 rpm" in text and "not stable" in text for text in soft.texts)
    assert "direction y" in soft.next_step
    both = tapped(folder, 0.1, 1700.0, "y", stiffness=3e6)
    assert both.status == "alarm"
    assert "Logbook.verdicts" in both.next_step


def test_a_doubtful_program_warns_and_says_where_to_ask(shop: Any) -> None:
    shop.run(("sure", 8700, 0.4), ("unsure", 12900, 3))
    shop.tap_both()
    logbook = shop.logbook
    found = build_outcome(logbook, logbook.measurement(logbook.newest_tap().id))
    assert found.status == "warn"
    assert any(text.startswith("unsure: ") and "doubtful" in text for text in found.texts)
    assert not any(text.startswith("sure") for text in found.texts)
    assert found.next_step == PROGRAM_DOUBTFUL.remedy


def test_a_test_without_the_mode_asks_for_another(folder: MachineFolder) -> None:
    lost = tapped(folder, 0, 900.0)
    assert lost.status == "warn"
    assert any("no-mode-in-band" in text and "900 Hz" in text for text in lost.texts)
    assert lost.next_step == MODE_LOST.remedy


@pytest.fixture
def hits(tapper: Callable[..., HammeredStructure], channels: Pair) -> list[Hit]:
    source = SimulatedSource(tapper(), channels, 25600.0, 60_000)
    return list(capture_hits(source, Trigger(20.0, 6400, 512)))


def test_curves_are_thinned_and_keep_every_extreme(hits: list[Hit]) -> None:
    mean = RunningMean()
    for hit in hits[:3]:
        mean.add(hit)
    plots = build_curves(hits[2], mean)
    assert plots.time.size < 2600
    assert plots.frequency.size < 2000
    assert plots.force is not None
    assert np.max(plots.force) == np.max(hits[2].force)
    assert np.min(plots.acceleration) == np.min(hits[2].acceleration)
    assert plots.mean is not None
    assert mean.frf is not None
    shown = mean.frf.frequency <= plots.frequency[-1]
    assert np.max(plots.mean) == np.max(np.abs(mean.frf.receptance[shown]))
    assert np.all(np.diff(plots.frequency) > 0)
    assert plots.usable_band == mean.frf.usable_band
    assert plots.frequency[-1] == pytest.approx(1.25 * mean.frf.usable_band[1], rel=0.01)  # type: ignore[index]
    assert plots.force_spectrum is not None
    assert np.max(plots.force_spectrum) == 0.0
    assert plots.coherence is not None
    pulse = (plots.time > -0.5e-3) & (plots.time < 1e-3)
    assert np.count_nonzero(pulse) == np.count_nonzero((hits[2].time > -0.5e-3) & (hits[2].time < 1e-3))


def test_what_is_not_known_yet_is_not_shown(hits: list[Hit]) -> None:
    mean = RunningMean()
    before = build_curves(hits[0], mean)
    assert before.mean is None
    assert before.last is not None
    assert before.coherence is None
    assert before.force_spectrum is not None
    assert before.usable_band is not None
    edge = np.interp(before.usable_band[1], before.frequency, before.force_spectrum)
    assert edge == pytest.approx(-20.0, abs=2.0)
    mean.add(hits[0])
    mean.add(hits[1])
    assert build_curves(hits[1], mean).coherence is None
    silent = Hit(np.zeros(1000), np.zeros(1000), 25600.0)
    nothing = build_curves(silent, RunningMean())
    assert nothing.last is None
    assert nothing.force_spectrum is None
    assert nothing.usable_band is None
    assert nothing.frequency.size > 0
