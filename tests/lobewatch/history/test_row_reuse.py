"""Changes in mid-history: only dependent rows are analyzed again, with the result of a full analysis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from acquisition import Conditions
from lobewatch.logbook import Logbook
from lobewatch.machine.folder_updates import add_event, exclude_entry, include_entry
from lobewatch.measurement import measure
from tests.lobewatch.conftest import START, Shop

Analysed = Callable[[], list[int]]
FREQUENCIES = (1713.0, 1711.0, 1708.0, 1706.0, 1701.0)


@pytest.fixture
def analysed(monkeypatch: pytest.MonkeyPatch) -> Analysed:
    """Days of the tap tests that were analysed since this was asked last, each once."""
    found: list[int] = []

    def counting(tap: Any, *others: Any) -> Any:
        found.append((tap.circumstances.created - START).days)
        return measure(tap, *others)

    monkeypatch.setattr("lobewatch.history.tap_measurements.measure", counting)

    def told() -> list[int]:
        known = sorted(set(found))
        found.clear()
        return known

    return told


@pytest.fixture
def tapped(shop: Shop) -> Shop:
    """Alternate x and y every ten days, so that one is shifted with the other."""
    shop.put("")
    for number, frequency in enumerate(FREQUENCIES):
        shop.tap(20 * number + 10, frequency)
        shop.tap(20 * number + 20, frequency - 23, "y")
    assert len(shop.logbook.history.rows) == 2 * len(FREQUENCIES)
    return shop


def values(logbook: Logbook) -> list[str]:
    return [repr(replace(row, verdicts=None)) for row in logbook.history.rows]


def is_as_from_the_start(shop: Shop) -> bool:
    known = values(shop.logbook)
    shop.folder.history_path.unlink()
    return known == values(shop.logbook)


def test_a_backdated_test_alters_those_that_build_on_it(tapped: Shop, analysed: Analysed) -> None:
    analysed()
    tapped.tap(35, 1709.0)
    assert len(tapped.logbook.history.rows) == 11
    # itself beside y of day 20; then y of day 40, beside x of day 35 now; x of day 50, which follows it, moves that y
    # by it; y of day 60 beside that; of those behind none
    assert analysed() == [20, 35, 40, 50, 60]
    assert is_as_from_the_start(tapped)


def test_a_test_taken_out_and_back_alters_its_neighbours(tapped: Shop, analysed: Analysed) -> None:
    taken = tapped.logbook.taps[3].id
    analysed()
    exclude_entry(tapped.folder, taken, "wrong tool")
    assert len(tapped.logbook.history.rows) == 9
    assert analysed() == [20, 50, 60, 70]
    assert is_as_from_the_start(tapped)
    analysed()
    include_entry(tapped.folder, taken)
    assert len(tapped.logbook.history.rows) == 10
    assert analysed() == [30, 40, 50, 60, 70]
    assert is_as_from_the_start(tapped)


def test_a_first_test_before_all_others_and_a_new_baseline_alter_all_behind_them(
    tapped: Shop, analysed: Analysed
) -> None:
    tapped.tap(0, 1714.0)
    analysed()
    assert len(tapped.logbook.history.rows) == 11
    assert len(analysed()) == 11
    assert is_as_from_the_start(tapped)
    add_event(tapped.folder, "bearings replaced", START.replace(month=2, day=12), new_baseline=True)
    assert is_as_from_the_start(tapped)


def test_another_frequency_between_two_tests_is_followed_from_there_on(tapped: Shop) -> None:
    tapped.tap(45, 1300.0)  # in question: no reference
    assert is_as_from_the_start(tapped)
    tapped.tap(46, 1500.0)  # so are those behind it
    assert is_as_from_the_start(tapped)
    tapped.logbook.accept(list(tapped.logbook.questions), ["frequency-jump"])
    assert is_as_from_the_start(tapped)


def test_another_mounting_between_two_tests_begins_a_series(tapped: Shop) -> None:
    tapped.tap(47, 1600.0, conditions=Conditions(stick_out_mm=140.0, drawbar_kn=12.0))
    tapped.tap(72, 1702.0, conditions=Conditions(stick_out_mm=120.0, drawbar_kn=14.0))
    assert is_as_from_the_start(tapped)
