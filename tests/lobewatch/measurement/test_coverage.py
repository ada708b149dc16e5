"""Tap tests whose modes do not cover the measured FRF, and what follows for verdicts and recommendations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from acquisition import Circumstances, Frf, Remark, TapDirection, TapTest
from lobewatch.machine import Machine, ProgramTable
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement import Measurement, measure
from lobewatch.measurement.coverage import UNCOVERED_CODES, describe_uncovered, find_uncovered
from lobewatch.measurement.tap_measurement import fit_tap, interpret_fit
from lobewatch.tool.assembly import Assembly, assemble
from lobewatch.verdicts import Stability, advise
from lobewatch.verdicts.program_case import NO_TEST_CUTS
from lobewatch.verdicts.recommendation import find_stable_pockets, recommend
from lobewatch.verdicts.verdict import evaluate_program, find_open_question
from modal import HitChange, HitChangeKind, Mode, ModeEdits, synthesize_frf

LINES = np.arange(1.0, 4000.0, 1.0)
STRONG, OTHER = Mode(900.0, 0.02, 2e7), Mode(1700.0, 0.03, 4e7)
DROP = ModeEdits(drop=(900.0,))
SETTINGS = '[machine]\nname = "m"\n[speed]\nlow_rpm = 3000\nhigh_rpm = 12000\n'
PROGRAM = ProgramTable(
    name="slot",
    tool="T",
    teeth=2,
    radial_depth_mm=20.0,
    tool_diameter_mm=20.0,
    direction="down",
    tangential_n_per_mm2=1000.0,
    radial_n_per_mm2=300.0,
    helix_deg=30.0,
    speed_rpm=6000.0,
    depth_mm=0.05,
)


def machine(*settings: str) -> Machine:
    return parse_machine_file(SETTINGS + "\n".join(settings))


def tapped(direction: TapDirection = "x", edits: ModeEdits | None = None, on: Machine | None = None) -> Measurement:
    """Return the measurement of an FRF of both modes, with or without the stronger one."""
    about = Circumstances("m", datetime(2026, 1, 15, tzinfo=UTC), "T", direction)
    frf = Frf(LINES, synthesize_frf([STRONG, OTHER], LINES).receptance)
    return measure(TapTest(direction, about, frf), on or machine(), None, edits or ModeEdits())


def assembled(edits: ModeEdits | None = None) -> Assembly:
    return assemble(tapped("y"), tapped("x", edits), {})


def test_a_dropped_mode_leaves_a_remark_and_a_mode_for_lobes_with_its_real_part() -> None:
    whole, part = tapped(), tapped(edits=DROP)
    assert whole.uncovered == ()
    (remark,) = part.uncovered
    assert (remark.code, remark.about) == ("peak-not-explained", "900 Hz")
    assert [round(mode.frequency) for mode in part.modes] == [1700]
    least = [min(synthesize_frf(fit.at_tip, LINES).receptance.real) for fit in (whole, part)]
    assert least[1] == pytest.approx(least[0], rel=0.03)


def test_peaks_outside_the_band_are_said_and_left_out() -> None:
    found = tapped(on=machine("[mode]", "band_hz = [1200, 2200]"))
    assert found.uncovered == ()
    assert [remark.about for remark in found.remarks if remark.code == "peak-outside-band"] == ["900 Hz"]
    assert [round(mode.frequency) for mode in found.at_tip] == [1700]


def test_verdicts_and_recommendations_rest_on_both_directions() -> None:
    covered, open_tool = assembled(), assembled(DROP)
    assert [evaluate_program(PROGRAM, tool, machine()).stability for tool in (covered, open_tool)] == [
        Stability.STABLE,
        Stability.DOUBTFUL,
    ]
    verdict = evaluate_program(PROGRAM, open_tool, machine())
    assert verdict.decisive_cause == "coverage"
    assert [(remark.code, remark.about) for remark in verdict.remarks if remark.code in UNCOVERED_CODES] == [
        ("peak-not-explained", "900 Hz in x")
    ]
    assert advise(verdict, machine()).best is None
    assert find_stable_pockets(PROGRAM, covered, machine())
    assert find_stable_pockets(PROGRAM, open_tool, machine()) == []
    answer = recommend(PROGRAM, open_tool, machine(), NO_TEST_CUTS)
    assert (answer.setting, answer.remedies) == (None, (open_tool.uncovered[0].cure,))


def test_the_limit_is_that_of_the_measured_frf() -> None:
    limits = [evaluate_program(PROGRAM, tool, machine()).limit for tool in (assembled(), assembled(DROP))]
    assert limits[1] == pytest.approx(limits[0], rel=0.1)


@pytest.mark.parametrize("code", UNCOVERED_CODES)
def test_any_reason_keeps_a_program_doubtful(code: str) -> None:
    remark = Remark(code, "", "a finding", "Do something")
    x = replace(tapped("x"), remarks=(remark,))
    tool = assemble(tapped("y"), x, {})
    assert find_uncovered(tool.uncovered) == tool.uncovered != ()
    assert evaluate_program(PROGRAM, tool, machine()).stability is Stability.DOUBTFUL


def test_a_result_that_a_check_must_confirm_keeps_a_program_doubtful() -> None:
    remark = Remark("chain-not-checked", "", "a finding", "Do something")
    tool = replace(assembled(), unchecked=(remark,))
    verdict = evaluate_program(PROGRAM, tool, machine())
    assert (verdict.stability, verdict.decisive_cause) == (Stability.DOUBTFUL, "unchecked")
    assert remark in verdict.remarks
    assert not tool.is_complete
    assert find_stable_pockets(PROGRAM, tool, machine()) == []
    answer = recommend(PROGRAM, tool, machine(), NO_TEST_CUTS)
    assert (answer.setting, answer.remedies) == (None, (remark.cure,))


@pytest.mark.parametrize(
    ("break_it", "is_used"),
    [
        (lambda tap: tap, True),
        (lambda tap: replace(tap, unexplained=tapped(edits=DROP).unexplained), False),
        (lambda tap: replace(tap, unexplained=weak(tapped(edits=DROP))), True),
        (lambda tap: replace(tap, remarks=(Remark(UNCOVERED_CODES[0], "", "a finding"),)), False),
    ],
)
def test_a_cross_tap_is_used_if_its_modes_cover_it_up_to_what_hardly_counts(
    break_it: Callable[[Measurement], Measurement], is_used: bool
) -> None:
    half = [replace(mode, stiffness=2 * mode.stiffness) for mode in (STRONG, OTHER)]
    cross = break_it(replace(tapped("xy"), cross=half))
    tool = assemble(tapped("y"), tapped("x"), {}, cross)
    assert (tool.cross is not None) is is_used
    assert [remark.about for remark in tool.uncovered if not remark.about.endswith("xy")] == []
    assert [remark.code for remark in tool.remarks if remark.code.startswith("cross")] == ["cross-not-covered"] * (
        not is_used
    )
    verdict = evaluate_program(PROGRAM, tool, machine())
    assert verdict.stability is (Stability.STABLE if is_used else Stability.DOUBTFUL)
    assert any(remark in verdict.remarks for remark in tool.uncovered) is not is_used


def weak(tap: Measurement) -> tuple[object, ...]:
    return tuple(peak._replace(measured=peak.measured / 100) for peak in tap.unexplained)


def test_a_deep_peak_outside_the_band_hides_none_inside() -> None:
    about = Circumstances("m", datetime(2026, 1, 15, tzinfo=UTC), "T", "x")
    frf = Frf(LINES, synthesize_frf([Mode(1100.0, 8e-4, 4e7), OTHER, Mode(2100.0, 0.02, 4e7)], LINES).receptance)
    found = measure(
        TapTest("x", about, frf), machine("[mode]", "band_hz = [1200, 2200]"), None, ModeEdits(drop=(2100.0,))
    )
    assert [round(peak.frequency, -2) for peak in found.unexplained] == [2100.0]
    assert [remark.code for remark in found.uncovered] == ["peak-not-explained"]
    assert [remark.about for remark in found.remarks if remark.code == "peak-outside-band"] == ["1100 Hz"]


@pytest.mark.parametrize(("share", "codes"), [(0.999, []), (1.001, ["peak-not-explained"])])
def test_a_peak_within_the_half_width_of_a_change_over_hits_is_not_named_again(share: float, codes: list[str]) -> None:
    about = Circumstances("m", datetime(2026, 1, 15, tzinfo=UTC), "T", "x")
    frf = Frf(LINES, synthesize_frf([STRONG, OTHER], LINES).receptance)
    fit = fit_tap(TapTest("x", about, frf), machine(), DROP)
    (peak,) = interpret_fit(fit, machine(), None).unexplained
    missing = HitChange(HitChangeKind.PARTIAL, peak.frequency / (1 + share * 0.02), 0.02, 1e-6, 10, True, (0, 1, 2))
    found = interpret_fit(replace(fit, changes=(missing,)), machine(), None)
    assert [remark.code for remark in found.uncovered] == codes
    assert [one.frequency for one in found.unexplained] == [peak.frequency]


def test_the_used_modes_are_those_that_are_compared() -> None:
    assert [round(mode.frequency) for mode in tapped().used] == [900, 1700]
    aside = tapped(on=machine("[tap]", "position_mm = 20"))
    assert [mode.frequency for mode in aside.used] == [aside.followed.frequency if aside.followed else 0.0]
    assert [round(mode.frequency) for mode in tapped("xy").used] == [900, 1700]


def test_all_reasons_and_all_remedies_are_named() -> None:
    remarks = [
        Remark("hits-drift", "900 Hz in y", "f1 falls", "Wait"),
        Remark("hits-drift", "901 Hz in x", "f1 falls", "Wait"),
        Remark("hits-two-states", "1700 Hz in x", "f1 jumps", "Clamp"),
    ]
    found, cure = describe_uncovered(remarks)
    assert [found.index(word) for word in ("900 Hz in y", "901 Hz in x", "f1 falls", "1700 Hz in x")] == sorted(
        found.index(word) for word in ("900 Hz in y", "901 Hz in x", "f1 falls", "1700 Hz in x")
    )
    assert cure == "Wait. Clamp"
    tool = replace(assembled(), uncovered=tuple(remarks))
    verdict = evaluate_program(PROGRAM, tool, machine())
    (advice,) = [remark for remark in verdict.remarks if remark.code == "doubt-decides"]
    assert (found in advice.text, advice.cure) == (True, cure)
    assert find_open_question(PROGRAM, tool) == (found, cure)
