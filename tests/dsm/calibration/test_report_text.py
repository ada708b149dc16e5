"""Numbers as people read them."""

from __future__ import annotations

import math

import pytest

from dsm import format_rounded, format_with_error

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("value", "std", "scale", "text"),
    [
        (1722.0312, 0.0471, 1.0, "1722.031 ± 0.047"),
        (1722.0312, 4.71, 1.0, "1722.0 ± 4.7"),
        (1722.0312, 47.1, 1.0, "1722 ± 47"),
        (3.2289e7, 1.2e4, 1e6, "32.289 ± 0.012"),
        (-0.0029136, 0.00012, 0.01, "-0.291 ± 0.012"),
        (1722.0312, math.nan, 1.0, "1722.03"),
        (1722.0312, 1e-12, 1.0, "1722.0312"),
        (math.nan, math.nan, 1.0, "-"),
        (-0.3, 47.1, 1.0, "0 ± 47"),
        (-0.0, math.nan, 1.0, "0"),
    ],
)
def test_two_digits_of_the_standard_error_decide(value: float, std: float, scale: float, text: str) -> None:
    assert format_with_error(value, std, scale) == text
    assert format_rounded(value, std, scale) == text.partition(" ")[0]


def test_large_numbers_and_large_errors_have_no_exponent() -> None:
    assert format_rounded(1.125e13, None, 1e6) == "11250000"
    assert format_with_error(1.1e13, math.nan, 1e6, "N/um") == "11000000 N/um"
    assert format_with_error(2.0, 2.5, percent=True) == "2.0 ± 2.5 (125 %)"
