"""What a finished tap test means to the one who tapped: the light of the machine, the result, the next step."""

from __future__ import annotations

from acquisition import joined
from dsm import plus_minus
from lobewatch.decay import SeriesStanding
from lobewatch.decay.light import LIGHTS
from lobewatch.logbook import Logbook
from lobewatch.measuring import Measurement
from lobewatch.measuring.questions.asked import open_questions
from lobewatch.tap.state import Outcome


def outcome_of(logbook: Logbook, found: Measurement) -> Outcome:
    """The standing of the machine after this test, and what was measured."""
    standing = logbook.standing(found.time)
    series = standing.series_of(found.tool, found.direction)
    asked = open_questions(found.remarks)
    told = [*(remark for remark in found.remarks if remark not in asked), *joined(standing.remarks)]
    told += [remark for remark in logbook.remarks if remark.code not in LIGHTS]
    texts = [*_values(found, series), *(f"{remark.finding}." for remark in told)]
    return Outcome(standing.light, texts, standing.next_step)


def _values(found: Measurement, series: SeriesStanding | None) -> list[str]:
    mode = found.followed
    if mode is None:
        return []
    f_std, zeta_std, k_std = mode.standard_error.tolist()
    against = "the first test of this tool and direction"
    if open_questions(found.remarks):
        against = "in question"
    elif series is not None and not series.is_first:
        sign = "+" if series.fall.value < 0 else ""
        against = f"{sign}{plus_minus(-series.fall.value, series.fall.std)} % against the first test"
    damping = plus_minus(mode.damping_ratio, zeta_std, 0.01)
    return [
        f"f_n {plus_minus(mode.frequency, f_std)} Hz, {against}.",
        f"K {plus_minus(mode.stiffness, k_std, 1e6)} N/um, zeta {damping} %.",
    ]
