"""Test that every verdict on a recorded cut has its next step."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from lobewatch.cuts.chatter_detection.evaluated_cut import CutEvaluation
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed
from lobewatch.logbook.cut_comparison import CutComparison
from lobewatch.logbook.heard_cuts import CutFileRequest, hear_signal
from lobewatch.machine.journal.entries import CutVerdict, PartVerdict
from lobewatch.show.cuts.recorded_cuts import FAULTS, NEXT_STEP_TEXTS, reason_text, recorded_cut_texts
from tests.lobewatch.cuts.phone_recordings import as_signal

pytestmark = pytest.mark.quick


def test_each_verdict_has_a_next_step() -> None:
    assert set(NEXT_STEP_TEXTS) == set(get_args(CutVerdict))


def test_each_fault_has_a_remedy_and_no_full_stop() -> None:
    assert not [reason for reason, fault in FAULTS.items() if not fault.remedy[:1].isupper()]
    assert not [reason for reason, fault in FAULTS.items() if any(text.endswith(".") for text in fault)]


def shown_cut(detected: CutEvaluation) -> CutComparison:
    """Return the comparison of a cut without a machine, by a microphone."""
    comparisons, _ = hear_signal(as_signal(np.zeros(8000), 8000.0), "cut.wav", CutFileRequest(4, 6000.0))
    return replace(comparisons[-1], detected=detected)


@pytest.mark.parametrize(("ratio", "shown"), [(1e-4, "0.01 %"), (0.5, "50 %"), (9.9, "990 %"), (120782.89, "10 times")])
def test_energy_far_above_that_of_the_harmonics_is_no_percentage(ratio: float, shown: str) -> None:
    text = reason_text(shown_cut(CutEvaluation("stable", "", energy_ratio=ratio)))
    assert shown in text
    assert "12078289" not in text


def test_the_evaluated_time_is_that_of_all_parts() -> None:
    parts = PartVerdict(0.5, 1.5, "chatter", 900.0), PartVerdict(1.5, 6.25, "stable", None)
    speed = SpindleSpeed(100.0, 0.01, 1.0, 9, 0.0)
    detected = CutEvaluation("stable", "", spindle_speed=speed, part_verdicts=parts)
    assert any("5.75 s" in text for text in recorded_cut_texts(shown_cut(detected)))
