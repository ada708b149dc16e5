"""Lazily decoded rows equal the stored ones; an updated logbook equals a newly opened one."""

from __future__ import annotations

from dataclasses import fields, replace
from datetime import UTC, datetime

import pytest

from acquisition import Circumstances, Conditions, Remark, TapTest, from_accelerance, new_tap_id
from lobewatch.history import HistoryRow
from lobewatch.history.history import decode_row, encode_row
from lobewatch.logbook import Logbook
from lobewatch.measurement.estimate import Estimate
from lobewatch.measurement.recording_questions import RECORDING_QUESTIONS
from lobewatch.monitoring.status_rules import STATUS_BY_CODE, StatusLevel
from lobewatch.verdicts.verdict import Stability, StoredVerdict
from modal import Mode, synthesize_frf
from tests.lobewatch.conftest import LINES, START, Shop

pytestmark = pytest.mark.quick

HASHES = {"A": "of A"}
ROW = HistoryRow(
    "T",
    START,
    "reference",
    "y",
    *(Estimate(1713.0, 0.5), Estimate(0.03, 1e-4), Estimate(3.5e7, 1e5), Estimate(-12.5, 0.4), Estimate(1.2e9, 3e5)),
    static_tip_stiffness=2.9e7,
    modal_tip_stiffness=3.5e7,
    modes=((1713.0, 0.03, 3.5e7, -12.5), (2900.0, 0.02, 9e7, 8.0)),
    remarks=(Remark("frequency-jump", "1713 Hz", "far off"), Remark("accepted", "clock-ahead", "was right")),
    x=((1690.0, 0.03, 3.4e7, 0.0),),
    y=((1713.0, 0.03, 3.5e7, -12.5),),
    verdicts={"A": StoredVerdict(Stability.DOUBTFUL, 2.5e-3)},
    baseline=START,
    series="first",
    conditions=Conditions(temperature_c=31.5, state="warm"),
)
PLAIN = replace(
    ROW, remarks=(), conditions=Conditions(), baseline=None, verdicts={"A": StoredVerdict(Stability.STABLE, 1e-3)}
)


@pytest.mark.parametrize("row", [ROW, PLAIN], ids=["asked about", "without remarks"])
def test_each_field_is_as_it_was_stored_whichever_is_asked_for_first(row: HistoryRow) -> None:
    names = [one.name for one in fields(HistoryRow)] + ["questions", "accepted", "mode", "followed"]
    for name in names:
        number, read = decode_row(encode_row(7, row, HASHES), HASHES)
        assert number == 7
        assert repr(getattr(read, name)) == repr(getattr(row, name)), name
        assert repr(read) == repr(row)
        assert encode_row(7, read, HASHES) == encode_row(7, row, HASHES)
    changed = replace(decode_row(encode_row(7, row, HASHES), HASHES)[1], tool="other")
    assert repr(changed) == repr(replace(row, tool="other"))
    assert (changed.followed, changed.questions, changed.accepted) == (row.followed, row.questions, row.accepted)


@pytest.mark.parametrize("code", RECORDING_QUESTIONS)
def test_no_question_is_overlooked(code: str) -> None:
    asked = replace(PLAIN, remarks=(Remark("one-direction", "reference", "x alone"), Remark(code, "", "is it?")))
    assert [one.code for one in decode_row(encode_row(0, asked, HASHES), HASHES)[1].questions] == [code]
    assert STATUS_BY_CODE[code] is not StatusLevel.GOOD


def test_a_logbook_that_goes_on_after_commits_is_as_one_that_is_reopened(shop: Shop) -> None:
    shop.put("")
    shop.tap(0, 1713.0)
    logbook = shop.logbook
    assert len(logbook.history.rows) == 1
    commit(logbook, shop, 30, 1710.0)
    shop.tap(60, 1700.0)  # by somebody else
    assert not logbook.is_current
    commit(logbook, shop, 90, 1690.0)
    commit(logbook, shop, 15, 1712.0)  # before others
    assert logbook.is_current
    assert [round(row.frequency.value) for row in logbook.history.rows] == [1713, 1712, 1710, 1700, 1690]
    known = values(logbook)
    assert known == values(shop.logbook)
    shop.folder.history_path.unlink()
    assert known == values(shop.logbook)


def test_rows_that_were_compared_once_are_compared_again_where_another_test_comes_before_them(shop: Shop) -> None:
    shop.put("")
    shop.tap(0, 1713.0)
    logbook = shop.logbook
    expected = [1713]
    for days, frequency in ((30, 1710.0), (60, 1700.0), (15, 1712.0), (90, 1690.0), (45, 1705.0)):
        commit(logbook, shop, days, frequency)
        expected = sorted([*expected, round(frequency)], reverse=True)
        assert [round(row.frequency.value) for row in logbook.history.rows] == expected
    assert values(logbook) == values(shop.logbook)


def values(logbook: Logbook) -> list[str]:
    """All of each row, to the last digit; there are no programs to say a word on."""
    return [repr(replace(row, verdicts=None)) for row in logbook.history.rows]


def commit(logbook: Logbook, shop: Shop, days: int, frequency: float) -> None:
    about = Circumstances("m", datetime.fromtimestamp(START.timestamp() + 86400 * days, UTC), "reference")
    frf = from_accelerance(LINES, synthesize_frf([Mode(frequency, 0.03, 3.5e7)], LINES).accelerance)
    logbook.commit(TapTest(new_tap_id(about), about, frf))
