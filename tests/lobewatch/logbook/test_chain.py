"""The whole chain on simulated hardware: what was emulated is found again, and nothing is lost on the way."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from acquisition import (
    Circumstances,
    Frf,
    HammeredStructure,
    Hit,
    HitFlags,
    TapDirection,
    TapsEmulator,
    TapsFaults,
    TapsSource,
    TapTest,
    average_good_hits,
    from_accelerance,
    new_tap_id,
    write_hit,
)
from dsm import modal_stiffness, modes_at, receptance, static_stiffness
from lobes import SldHistory, lower_envelope, zero_order_lobes
from lobewatch.history import History
from lobewatch.history.history import HistoryRow, compute_row_lobes, make_export_columns
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.settings.machine_file import REFERENCE_CUT, parse_machine_file
from lobewatch.measurement import Measurement, measure
from lobewatch.show.report.report import render_report
from lobewatch.tap.emulated_spindle import (
    EMULATED_CHANNELS,
    EMULATED_SAMPLE_RATE,
    build_structure,
    set_bearing_stiffness,
)
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapStep
from lobewatch.tap.tap_in_progress import begin_tap
from lobewatch.tool.assembly import speed_grid
from modal import Mode, synthesize_frf
from tests.lobewatch.tapped_emulator import make_emulator

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
LINES = np.arange(4.0, 4000.0, 4.0)


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    return MachineFolder(tmp_path / "m")


def about(folder: MachineFolder, days: float = 0.0, direction: TapDirection = "x") -> Circumstances:
    return Circumstances("m", START + timedelta(days=days), "reference", direction, "", folder.toml.read_text("utf-8"))


def recorded(circumstances: Circumstances, *modes: Mode) -> TapTest:
    frf = synthesize_frf(list(modes), LINES)
    return TapTest(new_tap_id(circumstances), circumstances, from_accelerance(LINES, frf.accelerance))


def live_tap(
    folder: MachineFolder, k: float, days: float = 0.0, direction: TapDirection = "x", seed: int = 3
) -> Measurement:
    table = folder.machine.spindle
    assert table is not None
    structure = build_structure(set_bearing_stiffness(table.build(), k), table.damping_ratio)
    with make_emulator(structure, np.random.default_rng(seed), realtime=False) as device:
        session = TapSession(folder, lambda: TapsSource(device.port), about(folder, days, direction), guided=False)
        session.run()
    return session.measurement


def up_to_date(folder: MachineFolder) -> tuple[History, list[Measurement]]:
    """Return the history of a newly opened folder, and every measurement."""
    logbook = Logbook.open(folder.path)
    return logbook.history, [logbook.measurement(tap.id) for tap in logbook.taps]


def codes(found: Measurement | HistoryRow) -> list[str]:
    return [remark.code for remark in found.remarks]


def columns_of(folder: MachineFolder) -> SldHistory:
    return make_export_columns(Logbook(folder).history, folder.machine)


def test_the_emulated_structure_has_the_receptance_of_the_model() -> None:
    table = parse_machine_file(_example()).spindle
    assert table is not None
    spindle = table.build()
    structure = build_structure(spindle, 1e-9)
    f = np.array([1.0, 500.0, 1500.0, 2500.0])
    modes = 1 / (structure.stiffness * (1 - (f[:, None] / structure.frequency) ** 2))
    assert modes.sum(axis=1) + structure.residual == pytest.approx(receptance(spindle, f).real, rel=2e-3)
    assert modes[0].sum() + structure.residual == pytest.approx(1 / static_stiffness(spindle), rel=1e-6)


def _example() -> str:
    from importlib import resources

    return resources.files("sim_data").joinpath("surrogate_machine.toml").read_text("utf-8")


def test_live_taps_find_what_was_emulated_and_the_history_grows(folder: MachineFolder) -> None:
    table = folder.machine.spindle
    assert table is not None
    for month, k in enumerate((1.28e9, 0.9e9)):
        found = live_tap(folder, k, 30.0 * month)
        history, _ = up_to_date(folder)
        (f, *_), (stiffness, *_) = modes_at(set_bearing_stiffness(table.build(), k), 3)
        assert found.followed is not None
        assert found.calibration is not None
        assert found.followed.frequency == pytest.approx(f, rel=5e-4)
        assert found.followed.damping_ratio == pytest.approx(table.damping_ratio, rel=0.03)
        assert found.followed.stiffness == pytest.approx(stiffness, rel=0.02)
        assert found.calibration.bearing_stiffness == pytest.approx(k, rel=0.01)
        assert len(history.rows) == month + 1
    assert history.rows[1].stiffness.value < history.rows[0].stiffness.value
    again = columns_of(folder)
    followed = found.at_tip
    cuts = folder.machine.cuts("reference")[REFERENCE_CUT]
    expected = lower_envelope([zero_order_lobes(followed, followed, cut, again.speed_rpm) for cut in cuts])
    assert np.array_equal(again.depth[REFERENCE_CUT][1], expected.depth)
    assert not list(folder.spool.iterdir())


def test_a_history_made_again_is_the_same_and_stale_ones_are_not_used(folder: MachineFolder) -> None:
    for month, k in enumerate((1.28e9, 1.0e9, 0.8e9)):
        live_tap(folder, k, 30.0 * month)
    history, _ = up_to_date(folder)
    columns = columns_of(folder).columns
    for spoil in (folder.history_path.unlink, lambda: folder.history_path.write_bytes(b"rubbish")):
        spoil()
        up_to_date(folder)
        again = columns_of(folder).columns
        for name, column in columns.items():
            if name not in ("program_limit", "program_verdict"):
                assert np.array_equal(column, again[name], equal_nan=column.dtype.kind == "f")
            assert np.array_equal(column[-1:], again[name][-1:], equal_nan=column.dtype.kind == "f")
    folder.toml.write_text(folder.toml.read_text().replace("band_hz = [1200, 2200]", "band_hz = [1200, 2300]"))
    changed, _ = up_to_date(folder)
    assert len(changed.rows) == 3
    assert changed.settings_hash != history.settings_hash


def test_an_unplugged_cable_costs_no_hit(folder: MachineFolder) -> None:
    table = folder.machine.spindle
    assert table is not None
    structure = build_structure(table.build(), table.damping_ratio)
    signal = HammeredStructure(structure, EMULATED_SAMPLE_RATE, np.random.default_rng(1))
    with TapsEmulator(
        signal, EMULATED_CHANNELS, EMULATED_SAMPLE_RATE, realtime=False, faults=TapsFaults(unplug_after=100_000)
    ) as device:
        session = TapSession(folder, lambda: TapsSource(device.port), about(folder), sleep=lambda _: session.stop())
        with pytest.raises(TapStopped):
            session.run()
    assert session.state.word is TapStep.NO_DEVICE
    assert session.state.reason
    seen = session.state.hits
    assert len(seen) >= 2
    resumed = begin_tap(folder, about(folder, days=0.1))
    assert [f"{hit.force.max():.0f} N" for hit in resumed.hits] == [hit.peak for hit in seen]
    assert resumed.flags == [hit.flags for hit in seen]
    assert begin_tap(folder, about(folder, days=0.1, direction="y")).hits == []
    assert begin_tap(folder, about(folder, days=2.0)).hits == []
    assert begin_tap(folder, about(folder), resume=False).hits == []
    with TapsEmulator(signal, EMULATED_CHANNELS, 2 * EMULATED_SAMPLE_RATE, realtime=False) as other:
        again = TapSession(folder, lambda: TapsSource(other.port), about(folder, days=0.1))
        with pytest.raises(ValueError, match=r"plan_session\.resume=False"):
            again.run()


def test_a_committed_test_whose_spool_was_left_is_not_resumed(folder: MachineFolder) -> None:
    tap = recorded(about(folder), Mode(1700.0, 0.03, 3.5e7))
    folder.commit(tap)
    (folder.spool / tap.id).mkdir(parents=True)
    hit = Hit(np.ones(100), np.ones(100), 1000.0)
    write_hit(folder.spool / tap.id / "0000.h5", hit, about(folder), HitFlags.OK)
    assert begin_tap(folder, about(folder)).hits == []


def test_the_newest_x_and_y_make_one_diagram_however_far_apart(folder: MachineFolder) -> None:
    x, y = Mode(1700.0, 0.03, 3.5e7), Mode(1600.0, 0.04, 2.5e7)
    later = Mode(1590.0, 0.04, 2.4e7)
    folder.commit(recorded(about(folder, 0.0, "x"), x))
    folder.commit(recorded(about(folder, 0.5, "y"), y))
    folder.commit(recorded(about(folder, 300.0, "y"), later))
    alone, both, late = up_to_date(folder)[0].rows
    cuts = folder.machine.cuts("reference")[REFERENCE_CUT]
    speeds = speed_grid(folder.machine)
    for row, normal in ((alone, x), (both, y), (late, later)):
        expected = lower_envelope([zero_order_lobes([x], [normal], cut, speeds) for cut in cuts]).depth
        assert compute_row_lobes(row, folder.machine)[REFERENCE_CUT].depth == pytest.approx(expected, rel=1e-3)
    assert [codes(row) for row in (alone, both, late)] == [["one-direction"], [], ["older-direction"]]
    assert re.search(r"\bx\b.* 2026-01-15.* 300 days", str(late.remarks[0]))


def test_a_tap_recorded_earlier_and_stored_later_takes_its_place_in_time(folder: MachineFolder) -> None:
    x, y = Mode(1700.0, 0.03, 3.5e7), Mode(1600.0, 0.04, 2.5e7)
    folder.commit(recorded(about(folder, 1.0, "x"), x))
    alone, _ = up_to_date(folder)
    folder.commit(recorded(about(folder, 0.5, "y"), y))
    kept_up, _ = up_to_date(folder)
    folder.history_path.unlink()
    made_again, _ = up_to_date(folder)
    assert [row.direction for row in kept_up.rows] == ["y", "x"]
    assert kept_up.rows[1].x == made_again.rows[1].x
    assert kept_up.rows[1].y == made_again.rows[1].y != alone.rows[0].y


def test_a_negative_stiffness_is_stored_and_stops_the_lobes_with_a_reason(folder: MachineFolder) -> None:
    tap = recorded(about(folder), Mode(1700.0, 0.03, 3.5e7), Mode(1950.0, 0.01, -9e7))
    found = measure(tap, folder.machine)
    assert [mode.is_driving_point for mode in found.modes] == [True, False]
    assert not found.at_tip
    assert codes(found)[-1] == "no-lobes-driving-point"
    assert "1950 Hz" in found.remarks[-1].text
    text = folder.toml.read_text()
    assert measure(tap, replace_band(folder, "[1200, 1800]").machine).at_tip
    folder.toml.write_text(text)
    folder.commit(tap)
    history, _ = up_to_date(folder)
    assert not compute_row_lobes(history.rows[0], folder.machine)
    assert np.isnan(columns_of(folder).depth[REFERENCE_CUT]).all()
    html = render_report(Logbook.open(folder.path), "reference", "x").replace("\N{NO-BREAK SPACE}", " ")
    assert "1950 Hz" in html


def replace_band(folder: MachineFolder, band: str) -> MachineFolder:
    folder.toml.write_text(folder.toml.read_text().replace("band_hz = [1200, 2200]", f"band_hz = {band}"))
    return MachineFolder(folder.path)


def test_nothing_in_the_band_and_out_of_reach_are_reasons_not_errors(folder: MachineFolder) -> None:
    outside = measure(recorded(about(folder), Mode(900.0, 0.03, 3.5e7)), folder.machine)
    assert outside.followed is None
    assert all(fact in outside.remarks[0].text for fact in ("[mode] band_hz", "1200..2200 Hz", "900 Hz"))
    wide = replace_band(folder, "[1200, 3000]")
    beyond = measure(recorded(about(folder), Mode(2500.0, 0.03, 3.5e7)), wide.machine)
    assert beyond.calibration is None
    assert "2301.1 Hz" in str(beyond.remarks[0])
    assert beyond.at_tip


def test_an_frf_that_cannot_be_fitted_is_stored_with_the_reason_and_blocks_nothing(folder: MachineFolder) -> None:
    good = recorded(about(folder, 30.0), Mode(1700.0, 0.03, 3.5e7))
    first = recorded(about(folder), Mode(1700.0, 0.03, 3.5e7))
    folder.commit(replace(first, frf=Frf(LINES, first.required_frf.receptance.conj())))
    folder.commit(good)
    _, (conjugated, fine) = up_to_date(folder)
    assert codes(conjugated) == ["no-modes", "no-mode-in-band"]
    assert fine.at_tip
    assert '<th scope="row">reference, x</th>' in render_report(Logbook.open(folder.path), "reference", "x")


def test_a_tap_next_to_the_tip_is_carried_to_it_by_the_model(folder: MachineFolder) -> None:
    folder.toml.write_text(folder.toml.read_text().replace("position_mm = 0 ", "position_mm = 60 "))
    beside = MachineFolder(folder.path)
    table = beside.machine.spindle
    assert table is not None
    spindle = table.build()
    (f, *_), (k, *_) = modes_at(spindle, 1, 0.06)
    found = measure(recorded(about(folder), Mode(float(f), 0.03, float(k))), beside.machine)
    (tip,) = found.at_tip
    assert tip.stiffness == pytest.approx(modal_stiffness(spindle), rel=1e-3)
    assert found.followed is not None
    assert found.followed.stiffness == pytest.approx(k, rel=1e-3)


def test_a_machine_without_spindle_gives_all_but_the_models_part(tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "plain", "new_machine.toml")
    folder = MachineFolder(tmp_path / "plain")
    folder.commit(recorded(about(folder), Mode(1700.0, 0.03, 3.5e7)))
    folder.commit(recorded(about(folder, 30.0), Mode(1600.0, 0.03, 3.5e7)))
    history, measurements = up_to_date(folder)
    assert "no-bearing-stiffness" in codes(measurements[0])
    assert REFERENCE_CUT in compute_row_lobes(history.rows[0], folder.machine)
    html = render_report(Logbook.open(folder.path), "reference", "x")
    assert '<th scope="row">reference, x</th>' in html
    assert 'id="bearing-stiffness"' not in html


def test_series_are_sorted_by_time_and_distinguished(folder: MachineFolder) -> None:
    tapped: list[tuple[float, TapDirection]] = [(60, "x"), (0, "x"), (30, "x"), (45, "y")]
    for days, direction in tapped:
        folder.commit(recorded(about(folder, days, direction), Mode(1700.0 - days, 0.03, 3.5e7)))
    history, _ = up_to_date(folder)
    rows = history.series("reference", "x")
    assert [row.frequency.value for row in rows] == pytest.approx([1700, 1670, 1640], abs=0.1)
    with pytest.raises(ValueError, match="'T9'"):
        render_report(Logbook.open(folder.path), "T9", "x")


def test_modes_of_many_hits_agree_with_the_frf_they_come_from(
    folder: MachineFolder, tapper: Callable[..., HammeredStructure]
) -> None:
    live_tap(folder, 1.28e9)
    (entry,) = folder.taps()
    tap = folder.read(entry)
    assert isinstance(tap.required_frf, Frf)
    assert len(tap.accepted) == folder.machine.tap.hits
    again, flags = average_good_hits(tap.hits)
    assert again is not None
    assert np.array_equal(again.receptance, tap.required_frf.receptance)
    assert replace(tap, flags=flags).accepted == tap.accepted


def test_standard_errors_are_those_over_the_hits(folder: MachineFolder) -> None:
    found = live_tap(folder, 1.28e9)
    history, _ = up_to_date(folder)
    followed = found.followed
    assert followed is not None
    assert followed.n_hits == folder.machine.tap.hits
    assert followed.jackknife is not None
    assert history.rows[0].stiffness.std == pytest.approx(np.sqrt(followed.jackknife[2, 2]))


def test_a_mode_is_followed_past_a_neighbour_that_becomes_the_highest(folder: MachineFolder) -> None:
    for month in range(4):
        own = Mode(1700.0 - 20 * month, 0.03, 3.5e7)
        neighbour = Mode(1900.0, 0.03, 3.9e7 - 0.4e7 * month)
        folder.commit(recorded(about(folder, 30.0 * month), own, neighbour))
    history, measurements = up_to_date(folder)
    assert [row.frequency.value for row in history.rows] == pytest.approx([1700, 1680, 1660, 1640], abs=0.5)
    assert not any({"large-change", "rival-mode"} & set(codes(found)) for found in measurements)
    folder.history_path.unlink()
    again, _ = up_to_date(folder)
    assert [row.frequency for row in again.rows] == [row.frequency for row in history.rows]


def test_a_jump_of_the_frequency_is_reported_and_a_far_one_is_asked_about(folder: MachineFolder) -> None:
    for days, f in ((0.0, 1640.0), (30.0, 1500.0), (60.0, 2100.0)):
        folder.commit(recorded(about(folder, days), Mode(f, 0.03, 3.5e7)))
    history, (_, jumped, far) = up_to_date(folder)
    assert codes(jumped) == ["large-change"]
    assert "1500.0 Hz" in jumped.remarks[0].text
    assert codes(far) == ["frequency-jump"]
    assert far.remarks[0].about == "2100 Hz"
    assert all(fact in far.remarks[0].text for fact in ("2100.0 Hz", "+40 %", "1500.0 Hz"))
    assert history.rows[2].frequency.value == pytest.approx(2100.0, abs=0.5)
    assert far.at_tip
