"""Test that every verdict on a recorded cut has its next step."""

from __future__ import annotations

from typing import get_args

import pytest

from lobewatch.machine.journal.entries import CutVerdict
from lobewatch.show.cuts.recorded_cuts import FAULT_TEXTS, NEXT_STEP_TEXTS

pytestmark = pytest.mark.quick


def test_each_verdict_has_a_next_step() -> None:
    assert set(NEXT_STEP_TEXTS) == set(get_args(CutVerdict))


def test_no_fault_ends_with_a_full_stop() -> None:
    assert not [reason for reason, text in FAULT_TEXTS.items() if text.endswith(".")]
