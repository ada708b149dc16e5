"""Faults of a hit: one record for each flag."""

from __future__ import annotations

import pytest

from acquisition import HitFlags
from acquisition.hit_fault import HIT_FAULTS

pytestmark = pytest.mark.quick


def test_each_flag_has_one_fault_with_its_own_words() -> None:
    assert set(HIT_FAULTS) == set(HitFlags) - {HitFlags.OK}
    assert len({fault.words for fault in HIT_FAULTS.values()}) == len(HIT_FAULTS)
    assert all(HitFlags.from_words(fault.words) == flag for flag, fault in HIT_FAULTS.items())


def test_a_sentence_states_the_limit_of_its_fault() -> None:
    fault = HIT_FAULTS[HitFlags.TOO_SOFT]
    assert fault.state("range", peak=3.0, full=500.0) == "Force peak of 3 N is below 2% of the range of 500 N"


def test_an_unknown_case_is_an_error() -> None:
    with pytest.raises(KeyError):
        HIT_FAULTS[HitFlags.NO_HIT].state("unknown")
