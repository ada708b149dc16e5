"""Modes that a person adds, leaves out, or holds."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Frf, from_accelerance
from modal import (
    Extraction,
    Mode,
    ModeEdits,
    Trust,
    assess_trust,
    edit_modes,
    extract_modes,
    modes_from_extraction,
    parse_mode_edits,
    synthesize_frf,
)

LINES = np.arange(10.0, 3200.0, 2.0)
STRONG = Mode(1500.0, 0.03, 3e7)
WEAK = Mode(1600.0, 0.02, 1e9)
OTHER = Mode(298.0, 0.01, 2e8)


def measured(modes: list[Mode], noise: float = 0.002, seed: int = 0) -> Extraction:
    """Return the extraction of these modes with noise as a share of the largest accelerance."""
    exact = synthesize_frf(modes, LINES).accelerance
    random = np.random.default_rng(seed).normal(size=(2, LINES.size)) * noise * np.max(np.abs(exact)) / np.sqrt(2)
    return extract_modes([from_accelerance(LINES, exact + random[0] + 1j * random[1])])


def edited(state: Extraction, **said: tuple[str, ...]) -> list[Mode]:
    return modes_from_extraction(edit_modes(state, parse_mode_edits(**said)))


def frequencies(modes: list[Mode]) -> list[float]:
    return [round(mode.frequency) for mode in modes]


def codes(mode: Mode) -> list[str]:
    return [remark.code for remark in mode.remarks]


def test_a_mode_that_is_left_out_is_gone_and_the_others_stay() -> None:
    state = measured([OTHER, STRONG])
    (left,) = edited(state, drop=("1490",))
    assert frequencies([left]) == [298]
    assert left.interval()[2, 0] < OTHER.stiffness < left.interval()[2, 1]
    assert codes(left) == []


def test_of_modes_fitted_together_one_is_left_out_and_the_other_takes_its_place() -> None:
    state = measured([STRONG, Mode(1800.0, 0.03, 4e7)])
    assert frequencies(modes_from_extraction(state)) == [1500, 1800]
    (left,) = edited(state, drop=("1800",))
    assert abs(left.frequency / 1500 - 1) < 0.02


def test_a_mode_on_a_flank_is_added_and_within_its_errors() -> None:
    state = measured([STRONG, WEAK])
    assert len(modes_from_extraction(state)) == 1
    strong, weak = edited(state, add=("1600",))
    for mode, true in ((strong, STRONG), (weak, WEAK)):
        low, high = mode.interval(0.999).T
        assert low[0] < true.frequency < high[0]
        assert low[2] < true.stiffness < high[2]
    assert "by-hand" in codes(weak)
    assert "by-hand" not in codes(strong)


def test_a_mode_that_stands_alone_below_the_noise_of_peaks_is_added() -> None:
    state = measured([STRONG, OTHER], noise=0.004)
    assert frequencies(modes_from_extraction(state)) == [1500]
    added, _ = edited(state, add=("297",))
    assert added.interval()[0, 0] < OTHER.frequency < added.interval()[0, 1]


def test_a_held_mode_has_its_frequency_and_damping_without_error_and_k_with_one() -> None:
    state = measured([OTHER, STRONG])
    _, held = edited(state, fix=("1500:0.03",))
    assert (held.frequency, held.damping_ratio) == pytest.approx((1500.0, 0.03))
    assert held.standard_error[:2] == pytest.approx([0, 0])
    assert 0 < held.standard_error[2] < modes_from_extraction(state)[1].standard_error[2]
    assert held.interval()[2, 0] < STRONG.stiffness < held.interval()[2, 1]
    assert held.correlation == pytest.approx(np.eye(3))
    assert assess_trust(held) is Trust.TRUSTED
    assert "by-hand" in codes(held)


def test_a_held_mode_next_to_others_is_fitted_with_them() -> None:
    strong, weak = edited(measured([STRONG, WEAK], noise=0.02), fix=("1600:0.02",))
    assert weak.frequency == 1600.0
    assert strong.interval()[2, 0] < STRONG.stiffness < strong.interval()[2, 1]


def test_nothing_stated_changes_nothing() -> None:
    state = measured([STRONG])
    assert edit_modes(state, ModeEdits()) is state


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"add": ("3500",)}, "add 3500 Hz: .*10 to 3198 Hz"),
        ({"fix": ("5:0.03",)}, "fix 5 Hz at zeta 3 %: .*10 to 3198 Hz"),
        ({"add": ("800",)}, "add 800 Hz: .*fits"),
        ({"add": ("1501",)}, "add 1501 Hz: .*1500.* Hz.*fix .*drop"),
        ({"fix": ("800:0.01",)}, "fix 800 Hz at zeta 1 %: .*FRF"),
        ({"drop": ("1520",)}, "drop 1520 Hz: .*1 %.*298, 1500"),
        ({"drop": ("1500", "1501")}, "drop 1501 Hz: .*1 %.*298"),
    ],
)
def test_what_cannot_be_done_is_rejected_with_what_is_there(said: dict[str, tuple[str, ...]], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        edited(measured([OTHER, STRONG]), **said)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"add": ("298,5",)}, r"ModeEdits.add 298,5: .*298\.5.* point"),
        ({"add": ("",)}, r"ModeEdits.add : .*298\.5"),
        ({"drop": ("0",)}, "drop 0: .* 0 Hz"),
        ({"drop": ("nan",)}, "drop nan: .* 0 Hz"),
        ({"fix": ("1500",)}, r"ModeEdits.fix 1500: .*1500:0\.03"),
        ({"fix": ("1500:3",)}, r"fix 1500:3: .*between 0 and 1.* 0\.03"),
        ({"add": ("298", "298.0")}, "298 Hz: add twice"),
        ({"add": ("298",), "drop": ("298",)}, "298 Hz: add and drop"),
    ],
)
def test_what_makes_no_sense_is_rejected(said: dict[str, tuple[str, ...]], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        parse_mode_edits(**said)


def test_edits_read_as_they_were_reported() -> None:
    assert str(parse_mode_edits(("298",), ("412.5",), ("1500:0.03",))) == "add 298, drop 412.5, fix 1500:0.03"


def test_several_frfs_share_what_is_held() -> None:
    first = synthesize_frf([STRONG], LINES)
    second = Frf(LINES, -0.5 * first.receptance)
    (mode,) = modes_from_extraction(edit_modes(extract_modes([first, second]), parse_mode_edits(fix=("1500:0.03",))))
    assert mode.shape == pytest.approx([1, -0.5])
