"""Trust in a mode follows from its figures only."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition import Remark, estimate_frf
from modal import (
    Mode,
    Trust,
    assess_trust,
    fit_modes,
    match_modes,
    select_credible_modes,
    synthesize_frf,
    trust_rules,
)
from tests.modal.test_moving_modes import tap

pytestmark = pytest.mark.quick

GOOD = Mode(
    1722.0,
    0.03,
    3.5e7,
    np.diag([0.2, 1e-4, 1e5]) ** 2,
    coherence=0.99,
    misfit=1.1,
    misfit_share=0.4,
    edge_distance=30.0,
    remaining_decay=1e-9,
    half_power_damping=0.031,
)
UNCERTAIN = np.diag([0.2, 1e-4, 1.05e7]) ** 2


def test_a_mode_with_nothing_against_it_is_trusted_and_so_is_one_without_figures() -> None:
    assert assess_trust(GOOD) is Trust.TRUSTED
    assert assess_trust(Mode(1722.0, 0.03, 3.5e7)) is Trust.TRUSTED
    assert assess_trust(replace(GOOD, stiffness=-3.5e7, remarks=(Remark("misfit", "", "a text"),))) is Trust.TRUSTED


@pytest.mark.parametrize(
    ("change", "code", "verdict"),
    [
        ({"misfit": 5.0, "misfit_share": 0.31}, "misfit", Trust.REJECTED),
        ({"misfit": 5.0, "misfit_share": 0.02, "half_power_damping": None}, "misfit", Trust.DOUBTFUL),
        ({"misfit": 5.0, "misfit_share": 0.06, "half_power_damping": None}, "misfit", Trust.REJECTED),
        ({"damping_ratio": 0.1, "half_power_damping": None}, "heavy-damping", Trust.DOUBTFUL),
        ({"damping_ratio": 0.193, "half_power_damping": None}, "heavy-damping", Trust.REJECTED),
        ({"damping_ratio": 0.35}, "heavy-damping", Trust.REJECTED),
        ({"covariance": UNCERTAIN / 2, "phase_deg": -31.0}, "uncertain", Trust.DOUBTFUL),
        ({"covariance": UNCERTAIN / 8, "phase_deg": 31.0}, "uncertain", Trust.DOUBTFUL),
        ({"covariance": 2 * UNCERTAIN}, "uncertain", Trust.REJECTED),
        ({"jackknife": UNCERTAIN / 2, "n_hits": 5, "phase_deg": 31.0}, "uncertain", Trust.DOUBTFUL),
        ({"jackknife": 2 * UNCERTAIN, "n_hits": 5}, "uncertain", Trust.REJECTED),
        ({"coherence": 0.49}, "low-coherence", Trust.DOUBTFUL),
        ({"edge_distance": 0.9}, "cut-by-edge", Trust.DOUBTFUL),
        ({"remaining_decay": 0.051}, "still-ringing", Trust.DOUBTFUL),
        ({"remarks": (Remark("several-modes", "", "a text"),)}, "several-modes", Trust.DOUBTFUL),
    ],
)
def test_each_rule_alone(change: dict[str, Any], code: str, verdict: Trust) -> None:
    mode = replace(GOOD, **change)
    assert list(trust_rules(mode)) == [(code, verdict)]
    assert assess_trust(mode) is verdict


@pytest.mark.parametrize(
    "change",
    [
        {"misfit": 5.0, "misfit_share": 0.29},
        {"remarks": (Remark("half-power-width", "", "a text"),)},
        {"damping_ratio": 0.1},
        {"damping_ratio": 0.07, "half_power_damping": None},
        {"coherence": 0.51},
        {"edge_distance": 1.1},
        {"remaining_decay": 0.049},
        {"covariance": UNCERTAIN, "phase_deg": 29.0},
        {"covariance": UNCERTAIN / 10, "phase_deg": 60.0},
    ],
)
def test_less_than_a_limit_is_no_reason(change: dict[str, Any]) -> None:
    assert assess_trust(replace(GOOD, **change)) is Trust.TRUSTED


@pytest.mark.parametrize(
    "change",
    [
        {"misfit": 5.0, "misfit_share": 0.29, "half_power_damping": None},
        {"damping_ratio": 0.29, "half_power_damping": None},
        {"covariance": 1.6 * UNCERTAIN, "phase_deg": 89.0},
        {"covariance": 2.2 * UNCERTAIN},
        {"remarks": (Remark("several-modes", "", "a text"), Remark("bent-by-neighbour", "", "a text"))},
    ],
)
def test_what_three_quarters_of_two_or_more_others_have_is_trusted_all_the_same(change: dict[str, Any]) -> None:
    mode = replace(GOOD, **change)
    verdicts = {
        found: assess_trust(replace(mode, match_count=found)) for found in [(2, 2), (3, 4), (1, 1), (1, 2), (2, 3)]
    }
    trusted = [found for found, verdict in verdicts.items() if verdict is Trust.TRUSTED]
    assert trusted == [(2, 2), (3, 4)]
    assert verdicts[2, 3] is assess_trust(mode)


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"misfit": 5.0, "misfit_share": 0.31}, "misfit"),
        ({"damping_ratio": 0.31}, "heavy-damping"),
        ({"covariance": 3 * UNCERTAIN}, "uncertain"),
        ({"coherence": 0.49}, "low-coherence"),
        ({"edge_distance": 0.9}, "cut-by-edge"),
        ({"remaining_decay": 0.051}, "still-ringing"),
        ({"remarks": (Remark("smoothed-lines", "", "a text"),)}, "smoothed-lines"),
    ],
)
def test_what_is_wrong_in_all_measurements_alike_or_hardly_known_stays_uncertain(
    change: dict[str, Any], code: str
) -> None:
    assert [rule for rule, _ in trust_rules(replace(GOOD, match_count=(4, 4), **change))] == [code]


def test_a_mode_is_found_again_within_half_a_percent() -> None:
    others = [[Mode(GOOD.frequency * factor, 0.01, 1e6)] for factor in (1.0049, 0.9951, 1.0051)]
    assert [mode.match_count for mode in match_modes([GOOD, Mode(400.0, 0.02, 2e7)], [*others, []])] == [(2, 4), (0, 4)]


def test_the_worst_rule_decides() -> None:
    both = replace(GOOD, coherence=0.4, damping_ratio=0.5)
    assert dict(trust_rules(both)) == {"low-coherence": Trust.DOUBTFUL, "heavy-damping": Trust.REJECTED}
    assert assess_trust(both) is Trust.REJECTED


def test_a_fitted_mode_carries_the_figures() -> None:
    lines = np.arange(5.0, 2000.0, 5.0)
    (mode,) = fit_modes(synthesize_frf([Mode(1722.0, 0.01, 3.5e7)], lines))
    assert mode.edge_distance == pytest.approx((1995 - 1722) / 17.22, rel=1e-3)
    assert mode.remaining_decay == pytest.approx(np.exp(-2 * np.pi * 17.22 / 5), rel=1e-3)
    assert mode.misfit_share is not None
    assert mode.misfit_share < 1e-6
    assert assess_trust(mode) is Trust.TRUSTED


def test_a_mode_that_only_the_scatter_over_hits_rejects_has_its_own_code() -> None:
    scatter = replace(GOOD, covariance=UNCERTAIN / 10, jackknife=3 * UNCERTAIN, n_hits=3)
    poor = replace(GOOD, covariance=3 * UNCERTAIN, jackknife=3 * UNCERTAIN, n_hits=3)
    codes = [select_credible_modes([mode]).remarks[0].code for mode in (scatter, poor)]
    assert codes == ["mode-differs-over-hits", "mode-not-believed"]
    assert select_credible_modes([scatter]).remarks[0].cure
    assert select_credible_modes([replace(scatter, jackknife=UNCERTAIN / 10)]).remarks == ()


@pytest.mark.parametrize(
    ("of_mode", "code"),
    [
        (["low-coherence", "uneven-peak"], "mode-differs-over-hits"),
        (["low-coherence", "misfit"], "mode-differs-over-hits"),
        (["low-coherence"], "mode-not-believed"),
        (["uneven-peak", "misfit"], "mode-not-believed"),
    ],
)
def test_an_uncertain_fit_is_due_to_the_hits_if_they_are_incoherent_and_the_peak_is_uneven(
    of_mode: list[str], code: str
) -> None:
    remarks = tuple(Remark(one, "", "a text") for one in of_mode)
    mode = replace(GOOD, covariance=3 * UNCERTAIN, jackknife=3 * UNCERTAIN, n_hits=3, remarks=remarks)
    assert [remark.code for remark in select_credible_modes([mode]).remarks] == [code]
    without_hits = replace(mode, jackknife=None, n_hits=0)
    assert [remark.code for remark in select_credible_modes([without_hits]).remarks] == ["mode-not-believed"]


def test_three_hits_that_differ_reject_their_modes_as_such() -> None:
    for seed in range(3):
        hits = tap([0.0, 2.0, 0.0], 0.01, seed)
        remarks = select_credible_modes(fit_modes(estimate_frf(hits), hits=hits)).remarks
        assert {remark.code for remark in remarks} == {"mode-differs-over-hits"}
