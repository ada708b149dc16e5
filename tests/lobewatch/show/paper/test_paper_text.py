"""Numbers of the comparison with the paper, as they are printed."""

from __future__ import annotations

import pytest

from lobewatch.paper import Comparison
from lobewatch.show.paper.paper_text import number_text, paper_cells

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("value", "digits", "text"), [(1722.0, 4, "1722"), (0.00012345, 3, "1.23e-4"), (3.2289e7, 5, "3.2289e7")]
)
def test_a_number_has_its_significant_digits(value: float, digits: int, text: str) -> None:
    assert number_text(value, digits, whole=False) == text


def test_a_difference_is_a_share_of_the_number_of_the_paper() -> None:
    row = Comparison("f1", "Table 1", 1000.0, 1010.0, "Hz", 5, "")
    assert paper_cells(row) == ("f1", "Table 1", "1000", "1010.0", "Hz", "+1 %")
