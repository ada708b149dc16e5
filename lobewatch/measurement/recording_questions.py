"""Questions on implausible tap tests, and their answers."""

import functools
import shlex
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from acquisition import Circumstances, DataError, DeviceIdentity, Frf, Remark
from acquisition.files.tap_file import read_circumstances
from dsm import format_rounded
from lobewatch.machine import Machine, MachineFolder, TapEntry
from lobewatch.machine.journal.tap_entry import ONE_HIT_CODE
from lobewatch.measurement import clock_questions as clock
from modal import Mode

ACCEPTED_CODE = "accepted"
"""Code of the remark on an accepted question."""
TOOL_MISMATCH_CODE = "tool-mismatch"
"""Code of the remark on a tool whose question a check with a known mass has answered."""
MAX_RESUME_AGE = timedelta(hours=12)
"""Age up to which an interrupted test may be resumed although others were taken since."""


@dataclass(frozen=True)
class RecordingQuestion:
    """Question that a person answers before a tap test is a reference for others."""

    code: str
    """Code of its remark."""
    limit: float = np.nan
    """Limit above or below which it is asked; NaN without one."""
    sentence: str = ""
    """Sentence with fields in braces; empty if the mode tracker writes it."""

    def ask(self, about: str = "", **values: object) -> Remark:
        """Return the remark that asks the question."""
        return Remark(self.code, about, self.sentence.format(**values))


FREQUENCY_JUMP = RecordingQuestion(
    "frequency-jump",
    0.15,
    "frequency {now:.1f} Hz differs by {percent:+.0f} % from the newest test ({last:.1f} Hz): "
    "wrong machine, tool or direction?",
)
"""Limit: relative change of the frequency since the newest test of the series, either way; chosen."""
NO_MODE_IN_BAND = RecordingQuestion("no-mode-in-band", sentence="no mode with positive stiffness{place} ({peaks})")
"""Asked if no mode can be followed."""
OTHER_BAND = RecordingQuestion(
    "other-band", 0.9, "usable band {low:.0f}..{high:.0f} Hz does not cover [mode] band_hz {first:g}..{last:g} Hz"
)
"""Limit: share of [mode] band_hz that a recording has to cover; chosen."""
FOLLOWED_OUT_OF_BAND = RecordingQuestion(
    OTHER_BAND.code,
    sentence="usable band {low:.0f}..{high:.0f} Hz does not contain the followed mode of the newest test at "
    "{last:.0f} Hz: is the hammer tip too soft?",
)
"""Asked if the mode to follow is outside of the usable band."""
NO_MODE_TO_FOLLOW = RecordingQuestion("no-mode-to-follow")
"""Asked if no mode continues the followed one."""
STIFFNESS_JUMP = RecordingQuestion(
    "stiffness-jump",
    0.12,
    "stiffness K {now} N/um is {ratio:.3g} times the {expected} N/um expected from {count} earlier test{s} "
    "(limit {limit:.0f} %): gain, range, sensitivity, hit point or tool changed?",
)
"""Limit: smallest relative difference from the expected stiffness that raises the question; chosen.

A larger scatter of the series raises it."""
STIFFNESS_DRIFT = RecordingQuestion(
    "stiffness-jump",
    0.12,
    "stiffness K {now} N/um of the newest {recent} (median) is {ratio:.3g} times the {expected} N/um expected from the "
    "first {count} (limit {limit:.0f} %): gain, range, sensitivity or tool changed little by little?",
)
"""Limit: as of STIFFNESS_JUMP, between the two ends of a level; chosen."""
FREQUENCY_RISE = RecordingQuestion(
    "frequency-jump",
    0.05,
    "frequency {now:.1f} Hz is {percent:.0f} % above the {before:.1f} Hz of the last {count} test{s}: "
    "which tool is in the spindle?",
)
"""Limit: smallest relative rise that raises the question; chosen: warmth raises by up to 3 %, wear never."""
DIRECTION_STIFFNESS = RecordingQuestion(
    "direction-stiffness",
    2.0,
    "stiffness K {now} N/um is {ratio:.2g} times that of the other direction ({other} N/um) at the same frequency: "
    "gain or sensitivity changed between x and y?",
)
"""Limit: ratio of K of the first test in a direction to that of the other, or the inverse, at frequencies within 5 %;
chosen."""
SAME_DIRECTION = RecordingQuestion(
    "same-direction",
    50.0,
    "frequency {now:.2f} Hz differs by only {percent} % from that of the other direction: "
    "were hammer and sensor turned?",
)
"""Limit: likelihood of one direction over that of two (`series_questions`); chosen."""
MODE_JUMP = RecordingQuestion(
    "mode-jump",
    0.05,
    "mode at {now:.0f} Hz is new, and the mode at {before:.0f} Hz of the last {count} test{s} is gone, although the "
    "followed mode is the same: wrong machine?",
)
"""Limit: smallest relative rise of a mode that makes it another one, as of FREQUENCY_RISE; chosen."""
EXCHANGED_DIRECTIONS = RecordingQuestion(
    "exchanged-directions",
    1000.0,
    "frequency {now:.2f} Hz differs by {percent:+.2g} % from the other direction, and by {usual:+.2g} % on {days} "
    "earlier days: were x and y exchanged?",
)
"""Limit: likelihood of exchanged over right names (`series_modes`); chosen, about one of 10 000 honest tests."""
DAMPING_JUMP = RecordingQuestion(
    "damping-jump",
    sentence="damping zeta is {percent:.0f} % above the {count} earlier tests, and all modes decay faster by "
    "{rise:.2g} 1/s, as with an exponential window of {time:.3g} ms: is a window on?",
)
"""Asked if the decay rates of all modes rose by one constant (`series_modes`)."""
STIFFNESS_OFF_MODEL = RecordingQuestion(
    "stiffness-off-model",
    4.0,
    "stiffness K {now} N/um is {ratio:.2g} times that of the model ({model} N/um): "
    "wrong machine, [spindle] or sensitivity?",
)
"""Limit: ratio of K of the first test of a series to that of the model, or the inverse.

A real spindle is not twice as stiff as its drawing says; the smallest mistake of a unit is 4.4."""
TOOL_COMPLIANCE = RecordingQuestion(
    "tool-compliance",
    3.0,
    "static stiffness {measured} N/um at the tip is {agreement} for its tool, which alone has {alone} N/um: "
    "wrong sensitivity, gain or [[tool]]?",
)
"""Limit: ratio of the compliance at the tip to the largest plausible one; a stiffer tip than its tool is asked, too."""
WRONG_QUANTITY = RecordingQuestion("wrong-quantity")
"""Asked if the modes show another quantity than stated."""
WRONG_UNIT = RecordingQuestion("wrong-unit")
"""Asked if the modes show a wrong unit or sensitivity."""
ONE_HIT = RecordingQuestion(
    ONE_HIT_CODE, sentence="only one hit was averaged, so nothing shows that it repeats: is the clamping firm?"
)
"""Asked of a tap test of a single hit."""
EMULATED_DEVICE = RecordingQuestion(
    "emulated-device", sentence="recorded from an emulated device, but other tap tests of this machine are real"
)
"""Asked of an emulated tap test in a machine with real ones."""
SPINDLE_TURNING = RecordingQuestion(
    "spindle-turning", sentence="steady vibration before or after the hits: did the spindle turn, or was it mains hum?"
)
"""Asked of a live test before its first hit and after its last one."""
RATE_NOT_VERIFIED = RecordingQuestion(
    "rate-not-verified", sentence="the sample rate could not be verified to 0.2 %: was the computer busy?"
)
"""Asked of a live test whose stream showed neither a right nor a wrong rate within 20 s."""
AT_COMMIT = (EMULATED_DEVICE, ONE_HIT, SPINDLE_TURNING, RATE_NOT_VERIFIED)
"""Questions with a code in the journal line of the tap test."""
MODE_QUESTIONS = (
    FREQUENCY_JUMP,
    NO_MODE_IN_BAND,
    OTHER_BAND,
    NO_MODE_TO_FOLLOW,
    STIFFNESS_JUMP,
    STIFFNESS_OFF_MODEL,
    DIRECTION_STIFFNESS,
    SAME_DIRECTION,
    MODE_JUMP,
    EXCHANGED_DIRECTIONS,
    DAMPING_JUMP,
    TOOL_COMPLIANCE,
    WRONG_QUANTITY,
    WRONG_UNIT,
)
RECORDING_QUESTIONS = tuple(question.code for question in MODE_QUESTIONS)
RECORDING_QUESTIONS += (*clock.CLOCK_QUESTIONS, *(question.code for question in AT_COMMIT))
"""Codes of all questions: until each is accepted the test is no reference, and no status is good."""


def check_frequency_jump(last: Mode, now: Mode) -> Remark | None:
    """Return the question about a frequency that no wear changes so much within one interval, or None."""
    change = now.frequency / last.frequency - 1
    if abs(change) <= FREQUENCY_JUMP.limit:
        return None
    return FREQUENCY_JUMP.ask(f"{now.frequency:.0f} Hz", now=now.frequency, percent=100 * change, last=last.frequency)


def check_followed_band(last: Mode, band: tuple[float, float] | None) -> Remark | None:
    """Return the question about a followed mode outside of the usable band (Hz), where no hit shows it, or None."""
    if band is None or band[0] <= last.frequency <= band[1]:
        return None
    return FOLLOWED_OUT_OF_BAND.ask(f"{last.frequency:.0f} Hz", low=band[0], high=band[1], last=last.frequency)


def check_model_stiffness(first: Mode, model: float) -> Remark | None:
    """Return the question about the first test of a series whose stiffness does not fit the model, or None.

    model: stiffness (N/m) of the mode of the calibrated model at the tapped place.
    """
    ratio = first.stiffness / model
    if not _is_beyond(ratio, STIFFNESS_OFF_MODEL.limit):
        return None
    here, there = (format_rounded(stiffness, scale=1e6, digits=3) for stiffness in (first.stiffness, model))
    return STIFFNESS_OFF_MODEL.ask(f"{first.frequency:.0f} Hz", now=here, ratio=ratio, model=there)


def _is_beyond(ratio: float, limit: float) -> bool:
    return max(ratio, 1 / ratio) > limit


def no_mode_remark(modes: Sequence[Mode], machine: Machine) -> Remark:
    """Return the question about a recording without a mode to follow; modes: all that were found."""
    low, high = machine.mode.band_hz or (0.0, np.inf)
    place = "" if machine.mode.band_hz is None else f" in [mode] band_hz {low:g}..{high:g} Hz"
    peaks = f"modes found: {', '.join(f'{mode.frequency:.0f}' for mode in modes)} Hz" if modes else "no modes found"
    return NO_MODE_IN_BAND.ask(place=place, peaks=peaks)


def check_quantity(modes: Iterable[Mode]) -> Remark | None:
    """Return the question about the quantity or the unit of a recording, from the remarks on its modes, or None."""
    codes = (WRONG_QUANTITY.code, WRONG_UNIT.code)
    asked = (remark for mode in modes for remark in mode.remarks if remark.code in codes)
    return next((replace(remark, about="") for remark in asked), None)


def check_band_coverage(frf: Frf, machine: Machine) -> Remark | None:
    """Return the question about a recording that does not cover [mode] band_hz, or None."""
    if machine.mode.band_hz is None:
        return None
    usable, (first, last) = frf.usable_band or (0.0, np.inf), machine.mode.band_hz
    low, high = max(usable[0], float(frf.frequency[0])), min(usable[1], float(frf.frequency[-1]))
    if min(high, last) - max(low, first) >= OTHER_BAND.limit * (last - first):
        return None
    return OTHER_BAND.ask(low=low, high=high, first=first, last=last)


def mark_accepted(remarks: Iterable[Remark], tap: TapEntry) -> tuple[Remark, ...]:
    """Return the remarks on a test and its time, with accepted questions replaced by remarks on the answers."""
    remarks = (*remarks, *filter(None, (_question_at_commit(code, tap) for code in (*tap.asked, *tap.asked_live))))
    remarks = [_answer_by_mass(remark) if tap.is_mass_checked else remark for remark in remarks]
    texts = {remark.code: str(remark) for remark in remarks}
    answers = [Remark(ACCEPTED_CODE, code, texts.get(code, "no longer asked")) for code in tap.accepted]
    return (*(remark for remark in remarks if remark.code not in tap.accepted), *answers)


def _answer_by_mass(remark: Remark) -> Remark:
    """Return the question about the compliance of a tool as the remark that a passed mass check leaves of it."""
    if remark.code != TOOL_COMPLIANCE.code:
        return remark
    text = "static stiffness at the tip does not fit this tool, and a mass check shows that the sensitivities are right"
    return Remark(TOOL_MISMATCH_CODE, remark.about, text, "Correct diameter, stick-out and material in [[tool]]")


def _question_at_commit(code: str, tap: TapEntry) -> Remark | None:
    """Return the question of a code, None for one of a newer version."""
    asked = {question.code: question.ask() for question in AT_COMMIT}
    return clock.clock_question(code, tap.time) if code in clock.CLOCK_QUESTIONS else asked.get(code)


def find_open_questions(remarks: Iterable[Remark]) -> tuple[Remark, ...]:
    """Return the open questions among remarks."""
    return tuple(remark for remark in remarks if remark.code in RECORDING_QUESTIONS)


def find_accepted_codes(remarks: Iterable[Remark]) -> frozenset[str]:
    """Return the codes of the accepted questions among remarks."""
    return frozenset(remark.about for remark in remarks if remark.code == ACCEPTED_CODE)


def check_question_codes(codes: Iterable[str]) -> list[str]:
    """Return each code once; ValueError for an unknown one."""
    distinct = list(dict.fromkeys(codes))
    for code in [code for code in distinct if code not in RECORDING_QUESTIONS]:
        raise ValueError(f"accept_questions.codes {code}: unknown. Choose from {', '.join(RECORDING_QUESTIONS)}.")
    return distinct


def label_question(tap_id: str, remark: Remark) -> Remark:
    """Return a question of an assembly, about its tap test."""
    return replace(remark, about=f"tap test {tap_id}")


def accept_questions(
    folder: MachineFolder, asked: Mapping[str, Sequence[str]], tap_ids: Sequence[str], codes: Sequence[str]
) -> list[str]:
    """Accept questions of tap tests in the journal, and return the codes that none of the tests asks.

    asked: codes of the open questions by tap test. Raises ValueError, and writes nothing, for an unknown code.
    """
    codes = check_question_codes(codes)
    answers = [(tap_id, code) for tap_id in tap_ids for code in codes if code in asked.get(tap_id, ())]
    for tap_id, code in answers:
        folder.accept(tap_id, code)
    answered = {code for _, code in answers}
    return [code for code in codes if code not in answered]


def format_not_asked(codes: Sequence[str], tap_ids: Sequence[str], asked: Mapping[str, Sequence[str]]) -> str:
    """Return the sentence on codes that tap tests do not ask, with their open questions."""
    still_open = ", ".join(f"{tap_id}: {' '.join(open_codes)}" for tap_id, open_codes in asked.items())
    text = (
        f"accept_questions.codes {' '.join(codes)}: not an open question of the stored tap tests {', '.join(tap_ids)}"
    )
    return f"{text}. Open questions: {still_open or 'none'}."


def question_remarks(
    asked: Mapping[str, Sequence[Remark]], path: Path | str, of: Collection[str] | None = None
) -> Iterator[Remark]:
    """Yield a remark for each question and all tap tests that ask it, with the command that accepts it.

    asked: open questions by tap test of the whole machine; path: machine folder; of: selected tap tests, None for all.
    """
    same, taps = dict[Remark, list[str]](), Path(path) / "taps"
    for tap_id in asked if of is None else of:
        for question in asked[tap_id]:
            same.setdefault(replace(question, about=""), []).append(tap_id)
    counts = Counter(question.code for questions in asked.values() for question in questions)
    for question, tap_ids in same.items():
        files, about = [taps / f"{tap_id}.h5" for tap_id in tap_ids], f"tap test {tap_ids[0]}"
        if len(tap_ids) > 1:
            files = [taps] if len(tap_ids) == counts[question.code] else files
            about = f"{len(tap_ids)} tap tests, {tap_ids[0]} to {tap_ids[-1]}"
        answer = shlex.join(["lobewatch", "replay", str(path), *map(str, files)])
        answer += f" accept_questions.codes {question.code}"
        cure = f"Tap again, or run {answer} to confirm"
        yield Remark(question.code, about, f"{question.text} ({answer} confirms it)", cure)


def find_device_questions(folder: MachineFolder, device: Circumstances | DeviceIdentity) -> tuple[str, ...]:
    """Return the code of the question about an emulated device in a machine with real tap tests."""
    if not device.is_emulated:
        return ()
    has_real = any(_is_real(folder.path / tap.file) for tap in reversed(folder.taps()))
    return (EMULATED_DEVICE.code,) if has_real else ()


@functools.lru_cache(maxsize=10_000)
def _is_real(path: Path) -> bool:
    """Return whether a tap file, which never changes, is readable and from a real device."""
    try:
        return not read_circumstances(path).is_emulated
    except (DataError, OSError):
        return False


def find_clock_questions(created: datetime, now: datetime | None, taps: Iterable[TapEntry]) -> tuple[str, ...]:
    """Return the codes of the questions about the time of a test; now: time of its commit, None for a replay."""
    if now is None:
        return ()
    newest = max((tap.created for tap in taps if not tap.excluded), default=None)
    is_asked = {
        "clock-behind": newest is not None and (now < newest or created < newest - MAX_RESUME_AGE),
        "clock-before-release": created < clock.FIRST_RELEASE,
        "clock-ahead": clock.is_in_future(created, now),
    }
    return tuple(code for code in clock.CLOCK_QUESTIONS if is_asked[code])
