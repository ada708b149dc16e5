"""Numbers as people type them: decimal signs, thousands, and numbers with two values."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobewatch.machine.settings.number_text import list_readings, read_numbers

pytestmark = pytest.mark.quick
SPEEDS = (10.0, 250_000.0)


@pytest.mark.parametrize(
    ("text", "readings"),
    [
        ("18000", [18000]),
        ("-2.5", [-2.5]),
        ("2,5", [2.5]),
        ("0,125", [0.125]),
        ("0.125", [0.125]),
        ("1000,18000", [1000.18]),
        ("18000.000", [18000]),
        ("18'000", [18000]),
        ("18\u2019000", [18000]),
        ("18\u202f000", [18000]),
        ("18 000", [18000]),
        ("18_000", [18000]),
        ("1,234.5", [1234.5]),
        ("1.234,5", [1234.5]),
        ("1'234,5", [1234.5]),
        ("1,234,567", [1234567]),
        ("1.2e3", [1200]),
        ("18,000", [18, 18000]),
        ("18.000", [18, 18000]),
        ("1,23,456", []),
        ("1.2.3", []),
        ("12,34,567", []),
        ("1'23", []),
        ("000", []),
        ("ten", []),
        ("", []),
    ],
)
def test_readings_of_a_number(text: str, readings: list[float]) -> None:
    assert list_readings(text) == pytest.approx(readings)


@pytest.mark.parametrize(
    ("texts", "limits", "values"),
    [
        (["1,000", "18,000"], [(10, 60_000), (300, 250_000)], [1000, 18000]),
        (["1.000", "18.000"], [(10, 60_000), (300, 250_000)], [1000, 18000]),
        (["12,000", "24,000"], [(10, 60_000), (300, 250_000)], [12000, 24000]),
        (["8.000", "2,5"], [SPEEDS], [8000, 2.5]),
        (["2.248"], [(0.08, 30)], [2.248]),
        (["2,248"], [(0.08, 30)], [2.248]),
        (["1,400", "500"], [(200, 6000)], [1400, 500]),
        (["700.000", "250.000"], [(200, 6000)], [700, 250]),
        (["1", "18"], [(10, 60_000), (300, 250_000)], [1, 18]),
        ([], [], []),
    ],
)
def test_ranges_and_the_other_numbers_tell_the_signs_apart(
    texts: list[str], limits: list[tuple[float, float] | None], values: list[float]
) -> None:
    assert read_numbers(texts, limits) == pytest.approx(values)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (["18,000"], "'18,000' may be 18 or 18000"),
        (["20", "1.500"], r"'1\.500' may be 1\.5 or 1500"),
        (["1.2.3"], r"'1\.2\.3' is not a number"),
        (["8", "000"], "'000' is not a number"),
        (["1.234,5", "1,234.5"], r"1\.234,5.*1,234\.5"),
    ],
)
def test_numbers_of_two_values_or_none_are_rejected(texts: list[str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_numbers(texts, [(1, 250_000)] * len(texts))


@given(value=st.integers(1000, 10**12), group=st.sampled_from("'\u2019\u202f_ "), decimals=st.sampled_from(["", ".5"]))
def test_grouped_digits_keep_their_value(value: int, group: str, decimals: str) -> None:
    text = f"{value:,}".replace(",", group) + decimals
    assert list_readings(text) == [float(f"{value}{decimals}")]
    assert float(f"{value}{decimals}") in list_readings(f"{value:,}{decimals}")
