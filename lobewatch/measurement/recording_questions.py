"""Questions on implausible tap tests, and their answers."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from acquisition import Frf, Remark
from dsm import format_rounded
from lobewatch.machine import Machine, MachineFolder, TapEntry
from lobewatch.measurement.clock_questions import (
    CLOCK_AHEAD,
    CLOCK_BEFORE_RELEASE,
    CLOCK_BEHIND,
    CLOCK_QUESTIONS,
    FIRST_RELEASE,
    clock_question,
    is_in_future,
)
from modal import Mode

MODE_QUESTIONS = (
    "frequency-jump",
    "no-mode-in-band",
    "other-band",
    "no-mode-to-follow",
    "stiffness-jump",
    "stiffness-off-model",
)
RECORDING_QUESTIONS = (*MODE_QUESTIONS, *CLOCK_QUESTIONS)
"""Codes of the remarks that ask a person: until each is accepted the test sets no reference, and nothing is good."""
ACCEPTED_CODE = "accepted"
"""Code of the remark that tells of an answer."""
MAX_FREQUENCY_CHANGE = 0.15
"""Relative change of the frequency against the newest test of the series that is asked about, up or down; chosen."""
MAX_STIFFNESS_STEP_RATIO = 1.5
"""K of the mode followed over that of the newest test of the series, or the inverse, above which it is asked about;
chosen.

The same for K / f_n^2, so that a fall of f_n by itself never asks, whether its stiffness or its mass makes it. Tests
scatter by a tenth; gains are mostly switched by 2 and more."""
MAX_MODEL_STIFFNESS_RATIO = 4.0
"""K of the first test of a series over that of the model there, or the inverse, above which it is asked about.

A spindle as it stands is not twice as stiff as its drawing says; the smallest mistake of a unit is 4.4."""
MIN_BAND_COVERAGE = 0.9
"""Share of [mode] band_hz that a recording has to cover; chosen."""
MAX_RESUME_AGE = timedelta(hours=12)
"""Time after which an interrupted test, which keeps its time, may still be gone on with, others having been taken."""


def check_frequency_jump(last: Mode, now: Mode) -> Remark | None:
    """Question about a change of the frequency that no wear makes within one interval; None where it is smaller."""
    change = now.frequency / last.frequency - 1
    if abs(change) <= MAX_FREQUENCY_CHANGE:
        return None
    text = f"frequency {now.frequency:.1f} Hz is {100 * change:+.0f} % off the newest test of the series"
    text += f" ({last.frequency:.1f} Hz): is this the machine, the tool and the direction it is said to be?"
    return Remark("frequency-jump", f"{now.frequency:.0f} Hz", text)


def check_stiffness_jump(last: Mode, now: Mode) -> Remark | None:
    """Question about a stiffness that changes while the frequency does not go with it; None where there is none."""
    stiffer, faster = now.stiffness / last.stiffness, now.frequency / last.frequency
    if not all(max(ratio, 1 / ratio) > MAX_STIFFNESS_STEP_RATIO for ratio in (stiffer, stiffer / faster**2)):
        return None
    here, there = (format_rounded(stiffness, scale=1e6, digits=3) for stiffness in (now.stiffness, last.stiffness))
    text = f"stiffness {here} N/um is {stiffer:.2g} times that of the newest test of the series ({there} N/um), the "
    text += f"frequency moved by {round(100 * (faster - 1), 1) + 0.0:g} %"
    text += ": has a gain, a range or a sensitivity changed, or the place that is tapped?"
    return Remark("stiffness-jump", f"{now.frequency:.0f} Hz", text)


def check_model_stiffness(first: Mode, model: float) -> Remark | None:
    """Question about the first test of a series whose mode is not one of this spindle; None where it may be.

    model: stiffness (N/m) of the mode of the model that was calibrated to its frequency, where it was tapped.
    """
    ratio = first.stiffness / model
    if 1 / MAX_MODEL_STIFFNESS_RATIO <= ratio <= MAX_MODEL_STIFFNESS_RATIO:
        return None
    here, there = (format_rounded(stiffness, scale=1e6, digits=3) for stiffness in (first.stiffness, model))
    text = f"stiffness {here} N/um is {ratio:.2g} times that of the model, {there} N/um"
    text += ": is this the machine of [spindle], are the sensitivities of hammer and accelerometer right?"
    return Remark("stiffness-off-model", f"{first.frequency:.0f} Hz", text)


def no_mode_remark(modes: Sequence[Mode], machine: Machine) -> Remark:
    """Question about a recording that shows no mode to follow; modes: all that were found."""
    low, high = machine.mode.band_hz or (0.0, np.inf)
    place = "" if machine.mode.band_hz is None else f" in [mode] band_hz {low:g}..{high:g} Hz"
    peaks = f"found are {', '.join(f'{mode.frequency:.0f}' for mode in modes)} Hz" if modes else "none was found at all"
    return Remark("no-mode-in-band", "", f"no mode to follow: none with positive stiffness{place}; {peaks}")


def check_band_coverage(frf: Frf, machine: Machine) -> Remark | None:
    """Question about a recording that does not cover [mode] band_hz; None where it does, or there is none."""
    if machine.mode.band_hz is None:
        return None
    usable = frf.usable_band or (0.0, np.inf)
    low, high = max(usable[0], float(frf.frequency[0])), min(usable[1], float(frf.frequency[-1]))
    wanted = machine.mode.band_hz
    if min(high, wanted[1]) - max(low, wanted[0]) >= MIN_BAND_COVERAGE * (wanted[1] - wanted[0]):
        return None
    text = f"its usable lines, {low:.0f}..{high:.0f} Hz, do not cover [mode] band_hz {wanted[0]:g}..{wanted[1]:g} Hz"
    return Remark("other-band", "", text)


def mark_accepted(remarks: Iterable[Remark], tap: TapEntry) -> tuple[Remark, ...]:
    """The remarks on a test and on its time, with the questions that were accepted told as such, the open ones left."""
    accepted = tap.accepted
    remarks = (*remarks, *(clock_question(code, tap.time) for code in tap.asked))
    asked = {remark.code: str(remark) for remark in remarks}
    answers = [Remark(ACCEPTED_CODE, code, asked.get(code, "asked no longer")) for code in accepted]
    return (*(remark for remark in remarks if remark.code not in accepted), *answers)


def find_open_questions(remarks: Iterable[Remark]) -> tuple[Remark, ...]:
    """The questions among these that nobody has answered."""
    return tuple(remark for remark in remarks if remark.code in RECORDING_QUESTIONS)


def find_accepted_codes(remarks: Iterable[Remark]) -> frozenset[str]:
    """Codes of the questions that were answered."""
    return frozenset(remark.about for remark in remarks if remark.code == ACCEPTED_CODE)


def check_question_codes(codes: Iterable[str]) -> list[str]:
    """Each code once; ValueError for one that is no question."""
    distinct = list(dict.fromkeys(codes))
    for code in distinct:
        if code not in RECORDING_QUESTIONS:
            raise ValueError(f"--accept {code}: no such question; there are {', '.join(RECORDING_QUESTIONS)}")
    return distinct


def label_question(tap_id: str, remark: Remark) -> Remark:
    """A question as the assembly passes it on, told of the tap test."""
    return replace(remark, about=f"tap test {tap_id}")


def accept_questions(
    folder: MachineFolder, asked: Mapping[str, Sequence[str]], tap_ids: Sequence[str], codes: Sequence[str]
) -> list[str]:
    """Write down each of these codes for each of these tap tests that asks it; the codes that none of them asks.

    asked: codes of the open questions by tap test. ValueError, and nothing is written, where a code is no question.
    """
    codes = check_question_codes(codes)
    answers = [(tap_id, code) for tap_id in tap_ids for code in codes if code in asked.get(tap_id, ())]
    for tap_id, code in answers:
        folder.accept(tap_id, code)
    answered = {code for _, code in answers}
    return [code for code in codes if code not in answered]


def format_not_asked(codes: Sequence[str], tap_ids: Sequence[str], asked: Mapping[str, Sequence[str]]) -> str:
    """Sentence on codes that these tap tests do not ask, with what they do ask; asked: as for `accept_questions`."""
    still_open = "; ".join(f"{tap_id}: {', '.join(open_codes)}" for tap_id, open_codes in asked.items())
    text = f"--accept {' '.join(codes)}: not asked of {', '.join(tap_ids)}, which is stored"
    return f"{text}; open questions: {still_open or 'none'}"


def question_remarks(
    asked: Mapping[str, Sequence[Remark]], path: Path | str, of: Collection[str] | None = None
) -> Iterator[Remark]:
    """Remarks on what is asked of tap tests, one for all that ask the same, with the command that answers it.

    asked: open questions by tap test, of the whole machine; path: of its folder; of: tap tests that are told of, not
    all.
    """
    alike: dict[Remark, list[str]] = {}
    for tap_id in asked if of is None else of:
        for question in asked[tap_id]:
            alike.setdefault(replace(question, about=""), []).append(tap_id)
    codes = Counter(question.code for questions in asked.values() for question in questions)
    for question, tap_ids in alike.items():
        answer = format_answer_command(path, tap_ids, question.code, all_of_them=len(tap_ids) == codes[question.code])
        if len(tap_ids) == 1:
            about, rest, test = (
                f"tap test {tap_ids[0]}",
                "it sets no reference until you say that it is right",
                "this test is",
            )
        else:
            about = f"{len(tap_ids)} tap tests, {tap_ids[0]} to {tap_ids[-1]}"
            rest, test = "they set no reference until you say that they are right", "these tests are"
        cure = f"Tap again; if {test} right, say so: {answer}"
        yield Remark(question.code, about, f"{question.text}; {rest}: {answer}", cure)


def format_answer_command(path: Path | str, tap_ids: Sequence[str], code: str, *, all_of_them: bool) -> str:
    """The command that accepts what is asked of these tap tests; all_of_them: no other one of the machine asks it."""
    taps = Path(path) / "taps"
    files = [taps] if all_of_them and len(tap_ids) > 1 else [taps / f"{tap_id}.h5" for tap_id in tap_ids]
    return shlex.join(["lobewatch", "replay", str(path), *map(str, files), "--accept", code])


def find_clock_questions(created: datetime, now: datetime | None, taps: Iterable[TapEntry]) -> tuple[str, ...]:
    """Codes of what is asked of a test of this time; now: when a live one is committed, None for any other."""
    if now is None:
        return ()
    newest = max((datetime.fromisoformat(tap.time) for tap in taps if not tap.excluded), default=None)
    behind = newest is not None and (now < newest or created < newest - MAX_RESUME_AGE)
    asked = {
        CLOCK_BEHIND: behind,
        CLOCK_BEFORE_RELEASE: created < FIRST_RELEASE,
        CLOCK_AHEAD: is_in_future(created, now),
    }
    return tuple(code for code, is_asked in asked.items() if is_asked)
