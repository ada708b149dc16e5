"""Test short names of tap tests: an end of the identity that no other has."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from lobewatch.show.history import MIN_SHORT_NAME, shorten_ids


def test_six_characters_do_where_no_other_has_them() -> None:
    assert shorten_ids(["20260302T093000Z_m_d16_x_ecbf", "20260302T093100Z_m_d16_y_12ab"]) == ["x_ecbf", "y_12ab"]


def test_an_end_that_another_has_anywhere_is_longer() -> None:
    assert shorten_ids(["1_m_a_x_ecbf", "2_m_b_x_ecbf"]) == ["a_x_ecbf", "b_x_ecbf"]
    assert shorten_ids(["1_x_ecbf_y_12ab", "2_d16_x_ecbf"]) == ["y_12ab", "6_x_ecbf"]


@given(st.lists(st.text("ab_1", min_size=7, max_size=12), min_size=1, max_size=8, unique=True))
def test_a_short_name_means_one_test_alone_or_is_the_whole_identity(ids: list[str]) -> None:
    for identity, name in zip(ids, shorten_ids(ids), strict=True):
        assert identity.endswith(name)
        assert len(name) >= MIN_SHORT_NAME
        assert name == identity or sum(name in other for other in ids) == 1
