"""Speed ranges are parsed in all forms that people type, and wrong ones are rejected with their values."""

from __future__ import annotations

import pytest

from lobewatch.machine.settings.speed_range import parse_speed_range

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    "text",
    [
        *("1000 24000", "1,000 24,000", "1.000 24.000", "1000, 24000", "1000-24000", "1,000-24,000 rpm", "1000..24000"),
        *(
            "1000 .. 24000",
            "1000rpm - 24000rpm",
            "1 000..24 000",
            "1000\u201324000",
            "1000 24000 1/min",
            " 1e3 24e3 RPM ",
        ),
    ],
)
def test_all_forms_of_a_range_are_the_same(text: str) -> None:
    assert parse_speed_range(text) == (1000, 24000)


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("1000", "^'1000'.*1 number"),
        ("-1000 24000", "^'-1000 24000'"),
        ("1000-2000-3000", "'1000-2000-3000'"),
        ("24000-1000", "^'24000-1000'.*24000.*1000"),
        ("8000 8000", "8000.*8000"),
        ("5-24000", "^'5-24000'.*10 to 60000"),
        ("1000-24000 Hz", "Hz"),
        ("", "^''"),
    ],
)
def test_other_texts_are_rejected_with_their_values(text: str, facts: str) -> None:
    with pytest.raises(ValueError, match=facts):
        parse_speed_range(text)
