"""Test that every verdict on a recorded cut has its next step."""

from __future__ import annotations

from typing import get_args

import pytest

from lobewatch.machine.journal.entries import CutVerdict
from lobewatch.show.cuts.recorded_cuts import FAULTS, NEXT_STEP_TEXTS

pytestmark = pytest.mark.quick


def test_each_verdict_has_a_next_step() -> None:
    assert set(NEXT_STEP_TEXTS) == set(get_args(CutVerdict))


def test_each_fault_has_a_remedy_and_no_full_stop() -> None:
    assert not [reason for reason, fault in FAULTS.items() if not fault.remedy[:1].isupper()]
    assert not [reason for reason, fault in FAULTS.items() if any(text.endswith(".") for text in fault)]
