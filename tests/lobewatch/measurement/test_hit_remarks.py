"""Remarks on modes that change from hit to hit: codes, doubtful verdicts, hits that differ from the mean."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from acquisition import Circumstances, Description, Hit, HitFlags, Remark, Structure, TapTest, estimate_frf
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.measurement.coverage import UNCOVERED_CODES
from lobewatch.measurement.file_modes import fit_file_modes
from lobewatch.measurement.hit_remarks import (
    EXPLAINED_CODES,
    HIT_CHANGE_CODES,
    SMALL_CHANGE_CODE,
    drop_explained_remedies,
    find_changes_in_band,
    find_hit_remarks,
    select_uncovered_changes,
)
from lobewatch.measurement.tap_measurement import measure
from modal import Mode
from tests.modal.disturbed_hits import Share, tap_structure

ZETA = 0.012
SPINDLE = Structure(np.array([700.0, 1300.0, 2300.0]), np.full(3, ZETA), np.array([2e8, 2.5e7, 6e8]))
LOOSE = Structure(np.array([700.0, 2300.0]), np.full(2, ZETA), np.array([2e8, 6e8]))
SHARES: dict[str, Share] = {
    "hits-drift": lambda number, _: 1 - ZETA * number / 9,
    "hits-two-states": lambda number, _: 1 - ZETA * (number % 2),
    "hits-follow-force": lambda _, peak: 1 - ZETA * (peak - 250) / 200,
    "hits-scatter": lambda number, _: 1 - ZETA * (number == 4),
}


def tap(share: Share = lambda *_: 1.0) -> list[Hit]:
    return tap_structure([SPINDLE] * 10, seed=5, share=share)


def codes(hits: Sequence[Hit], band: tuple[float, float] | None = None, flags: Sequence[HitFlags] = ()) -> list[str]:
    return [remark.code for remark in find_hit_remarks(hits, band, flags)]


@pytest.mark.parametrize("code", SHARES)
def test_each_change_has_its_code_its_mode_and_a_remedy(code: str) -> None:
    (remark,) = find_hit_remarks(tap(SHARES[code]))
    assert remark.code == code
    assert abs(float(remark.about.removesuffix(" Hz")) / 1300 - 1) < ZETA
    assert remark.cure


@pytest.mark.parametrize(
    ("code", "figures"),
    [
        ("hits-drift", ("falls", "0.1 %", "1.2 %", "10 hits")),
        ("hits-two-states", ("1.2 %", "5 of 10 hits")),
        ("hits-follow-force", ("falls", "1.1 %")),
    ],
)
def test_the_size_of_a_change_is_in_the_text(code: str, figures: Sequence[str]) -> None:
    """A change of one damping ratio, 1.2 %, and a ninth of it from hit to hit."""
    (remark,) = find_hit_remarks(tap(SHARES[code]))
    assert remark.code == code
    assert all(figure in remark.text for figure in figures)


def test_a_mode_in_some_hits_and_undisturbed_hits() -> None:
    some = tap_structure([LOOSE if number % 3 else SPINDLE for number in range(10)], seed=5)
    assert codes(some) == ["mode-in-some-hits"]
    assert codes(tap()) == []


def test_only_a_change_that_moves_limits_keeps_a_verdict_doubtful() -> None:
    assert codes(tap(lambda number, _: 1 - 0.2 * ZETA * number / 9)) == [SMALL_CHANGE_CODE]
    assert codes(tap(lambda number, _: 1 - 0.3 * ZETA * number / 9)) == ["hits-drift"]
    assert {*HIT_CHANGE_CODES.values()} <= {*UNCOVERED_CODES}
    assert SMALL_CHANGE_CODE not in UNCOVERED_CODES


def test_changes_with_an_uncovered_code_are_selected() -> None:
    large = find_changes_in_band(tap(lambda number, _: 1 - 0.3 * ZETA * number / 9))
    small = find_changes_in_band(tap(lambda number, _: 1 - 0.2 * ZETA * number / 9))
    assert select_uncovered_changes(large) == (*large,) != ()
    assert small != []
    assert select_uncovered_changes(small) == ()


def test_a_small_change_with_force_is_left_to_the_linearity_check() -> None:
    assert codes(tap(lambda _, peak: 1 - 0.2 * ZETA * (peak - 250) / 200)) == []


def test_the_mode_must_be_in_the_band() -> None:
    assert codes(tap(SHARES["hits-drift"]), (1000.0, 1500.0)) == ["hits-drift"]
    assert codes(tap(SHARES["hits-drift"]), (1600.0, 3000.0)) == []


def test_hits_that_differ_from_the_mean_show_a_second_state() -> None:
    hits = tap(SHARES["hits-two-states"])
    flags = [HitFlags.INCONSISTENT if number % 2 else HitFlags.OK for number in range(10)]
    assert codes(hits, None, flags) == ["hits-two-states"]
    assert codes(hits, None, [HitFlags.UNDONE if flag else flag for flag in flags]) == []


def test_a_slip_of_the_hammer_and_hits_that_miss_a_mode_are_no_change() -> None:
    slipped = tap(SHARES["hits-scatter"])
    one = [HitFlags.INCONSISTENT if number == 4 else HitFlags.OK for number in range(10)]
    assert codes(slipped, None, one) == []
    off_spot = tap_structure([LOOSE if number in (3, 6) else SPINDLE for number in range(10)], seed=5)
    assert codes(off_spot, None, [HitFlags.INCONSISTENT if i in (3, 6) else HitFlags.OK for i in range(10)]) == []
    assert codes(off_spot) == ["mode-in-some-hits"]


@pytest.mark.parametrize("code", [None, *SHARES])
def test_a_tap_test_says_it_and_is_not_covered(tmp_path: Path, code: str | None) -> None:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    hits = tap(SHARES[code]) if code else tap()
    about = Circumstances("m", datetime(2026, 11, 20, tzinfo=UTC), "reference")
    test = TapTest("t", about, estimate_frf(hits), tuple(hits), (HitFlags.OK,) * len(hits))
    measurement = measure(test, MachineFolder(tmp_path / "m").machine)
    mode_level = [remark for mode in measurement.modes for remark in mode.remarks if remark.code in EXPLAINED_CODES]
    assert bool(mode_level) == bool(code)
    assert not any(remark.cure for remark in mode_level)
    hit_level = [remark.code for remark in measurement.uncovered if remark.code in HIT_CHANGE_CODES.values()]
    assert hit_level == ([code] if code else [])


def test_only_the_remedies_that_a_change_explains_are_dropped() -> None:
    remarks = tuple(Remark(code, "900 Hz", "a text", "A remedy") for code in ("scatter", "not-driving-point"))
    modes = [Mode(900.0, 0.01, 3e7, remarks=remarks)]
    assert drop_explained_remedies(modes, ()) == tuple(modes)
    (mode,) = drop_explained_remedies(modes, [Remark("hits-drift", "900 Hz", "a text")])
    assert [remark.cure for remark in mode.remarks] == ["", "A remedy"]


@pytest.mark.parametrize("has_force", [True, False])
def test_the_modes_of_a_file_have_no_remedy_beside_that_of_the_change(tmp_path: Path, has_force: bool) -> None:
    hits = tap(SHARES["hits-drift"])
    names = ["time [s]", *(["force [N]"] if has_force else []), "acceleration [m/s^2]"]
    response = np.concatenate([hit.acceleration for hit in hits])
    force = [np.concatenate([hit.force for hit in hits])] if has_force else []
    columns = np.column_stack([np.arange(response.size) / hits[0].sample_rate, *force, response])
    np.savetxt(tmp_path / "hits.csv", columns, fmt="%.9g", delimiter=",", header=",".join(names), comments="")
    file_modes = fit_file_modes(tmp_path / "hits.csv", description=Description(without_force=not has_force))
    assert "hits-drift" in {remark.code for remark in file_modes.remarks}
    explained = [remark for mode in file_modes.fitted for remark in mode.remarks if remark.code in EXPLAINED_CODES]
    assert explained
    assert not any(remark.cure for remark in explained)
