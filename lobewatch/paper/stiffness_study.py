"""The tip stiffness of the old spindle, K_theo: what (30) to (36) give, and the rule that the paper must have used."""

from __future__ import annotations

from dataclasses import dataclass

from dsm import Calibration, static_stiffness
from lobewatch.paper import printed
from lobewatch.paper.comparison import Comparison, NumberGroup, share_text


@dataclass(frozen=True, eq=False)
class StiffnessStudy:
    """Stiffness at the tool tip of the surrogate, new and old."""

    static: tuple[float, float]
    """Exact static stiffness (N/m)."""
    linearized: tuple[float, float]
    """The same by (30) to (36), linearised at the natural frequency (N/m)."""
    modal: tuple[float, float]
    """Modal stiffness of mode 1 (N/m)."""


def study_stiffness(old: Calibration) -> StiffnessStudy:
    """From the bearings calibrated to the frequency before and after the fall."""
    pair = (old.given, printed.FREQUENCY), (old.spindle, printed.OLD_FREQUENCY)
    before, after = (static_stiffness(spindle, linearized_at=frequency) for spindle, frequency in pair)
    return StiffnessStudy(
        (old.static_stiffness_before, old.static_stiffness_after),
        (before, after),
        (old.modal_stiffness_before, old.modal_stiffness_after),
    )


def stiffness_section(study: StiffnessStudy) -> NumberGroup:
    """Numbers of the tip stiffness."""
    old = printed.OLD_STIFFNESS
    ratio = round(old / printed.STIFFNESS, 4)
    static, modal = study.linearized[1] / study.linearized[0], study.modal[1] / study.modal[0]
    rounded = "0.9 x 1722, which the paper rounds"
    rule = "equal in every printed digit: K_theo is this rule, and not (30) to (36)"
    off = share_text(study.linearized[1] / study.static[1] - 1, "+")
    cost = f"linearised at 1550 Hz, {off} off the exact one; and another shaft"
    exact = "term 0 of the dynamic stiffness, exact"
    part = "by (30) to (36) at both frequencies: the bearings are a part of the softness only"
    shown = "what an FRF shows and the lobes need: it hardly falls"
    return NumberGroup(
        "Tip stiffness of the old spindle: eqs. (30) to (36)",
        (),
        (
            Comparison("f_1, old", "", printed.OLD_FREQUENCY, 0.9 * printed.FREQUENCY, "Hz", 5, rounded),
            Comparison("K_theo by the rule 0.9 K_exp", "(36)", old, 0.9 * printed.STIFFNESS, "N/m", 6, rule),
            Comparison("K_theo by (30) to (36)", "(36)", old, study.linearized[1], "N/m", 5, cost),
            Comparison("K static, new", "(35)", None, study.static[0], "N/m", 5, exact),
            Comparison("K static, old", "(35)", None, study.static[1], "N/m", 5, exact),
            Comparison("K static, old over new", "(36)", ratio, static, "-", 4, part),
            Comparison("K of mode 1, old over new", "", ratio, modal, "-", 4, shown),
        ),
    )
