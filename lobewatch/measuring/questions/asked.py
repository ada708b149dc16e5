"""What a recording makes one ask: whether it is of this machine at all, and what was answered."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from acquisition import Frf, Remark
from lobewatch.machine import Machine, TapEntry
from lobewatch.measuring.questions.clock import CLOCK_QUESTIONS, about_clock
from modal import Mode

ABOUT_MODES = ("frequency-jump", "no-mode-in-band", "other-band", "no-mode-to-follow", "stiffness-off-model")
QUESTIONS = (*ABOUT_MODES, *CLOCK_QUESTIONS)
"""Codes of the remarks that ask a person: until each is accepted the test sets no reference, and nothing is good."""
ACCEPTED = "accepted"
"""Code of the remark that tells of an answer."""
LARGEST_JUMP = 0.15
"""Relative change of the frequency against the newest test of the series that is asked about, up or down."""
LARGEST_MISFIT = 4.0
"""K of the first test of a series over that of the model there, or the inverse, above which it is asked about.

A spindle as it stands is not twice as stiff as its drawing says; the smallest mistake of a unit is 4.4."""
LEAST_COVERED = 0.9
"""Share of [mode] band_hz that a recording has to cover."""


def frequency_jump(last: Mode, now: Mode) -> Remark | None:
    """Asks about a change of the frequency that no wear makes within one interval; None where it is smaller."""
    change = now.frequency / last.frequency - 1
    if abs(change) <= LARGEST_JUMP:
        return None
    text = f"f_n {now.frequency:.1f} Hz is {100 * change:+.0f} % off the newest test of the series"
    text += f" ({last.frequency:.1f} Hz): is this the machine, the tool and the direction it is said to be?"
    return Remark("frequency-jump", f"{now.frequency:.0f} Hz", text)


def stiffness_off_model(first: Mode, model: float) -> Remark | None:
    """Asks about the first test of a series whose mode is not one of this spindle; None where it may be.

    model: stiffness (N/m) of the mode of the model that was calibrated to its frequency, where it was tapped.
    """
    ratio = first.stiffness / model
    if 1 / LARGEST_MISFIT <= ratio <= LARGEST_MISFIT:
        return None
    text = f"K {first.stiffness / 1e6:.3g} N/um is {ratio:.2g} times that of the model, {model / 1e6:.3g} N/um"
    text += ": is this the machine of [spindle], are the sensitivities of hammer and accelerometer right?"
    return Remark("stiffness-off-model", f"{first.frequency:.0f} Hz", text)


def no_mode_in_band(modes: Sequence[Mode], machine: Machine) -> Remark:
    """Asks about a recording that shows no mode to follow; modes: all that were found."""
    low, high = machine.mode.band_hz or (0.0, np.inf)
    place = "" if machine.mode.band_hz is None else f" in [mode] band_hz {low:g}..{high:g} Hz"
    found = f"found are {', '.join(f'{mode.frequency:.0f}' for mode in modes)} Hz" if modes else "none was found at all"
    return Remark("no-mode-in-band", "", f"no mode to follow: none with positive stiffness{place}; {found}")


def other_band(frf: Frf, machine: Machine) -> Remark | None:
    """Asks about a recording that does not cover [mode] band_hz; None where it does, or there is none."""
    if machine.mode.band_hz is None:
        return None
    usable = frf.usable_band or (0.0, np.inf)
    low, high = max(usable[0], float(frf.frequency[0])), min(usable[1], float(frf.frequency[-1]))
    wanted = machine.mode.band_hz
    if min(high, wanted[1]) - max(low, wanted[0]) >= LEAST_COVERED * (wanted[1] - wanted[0]):
        return None
    text = f"its usable lines, {low:.0f}..{high:.0f} Hz, do not cover [mode] band_hz {wanted[0]:g}..{wanted[1]:g} Hz"
    return Remark("other-band", "", text)


def answered(remarks: Iterable[Remark], tap: TapEntry) -> tuple[Remark, ...]:
    """The remarks on a test and on its time, with the questions that were accepted told as such, the open ones left."""
    accepted = tap.accepted
    remarks = (*remarks, *(about_clock(code, tap.time) for code in tap.asked))
    asked = {remark.code: str(remark) for remark in remarks}
    told = [Remark(ACCEPTED, code, asked.get(code, "asked no longer")) for code in accepted]
    return (*(remark for remark in remarks if remark.code not in accepted), *told)


def open_questions(remarks: Iterable[Remark]) -> tuple[Remark, ...]:
    """The questions among these that nobody has answered."""
    return tuple(remark for remark in remarks if remark.code in QUESTIONS)


def accepted_codes(remarks: Iterable[Remark]) -> frozenset[str]:
    """Codes of the questions that were answered."""
    return frozenset(remark.about for remark in remarks if remark.code == ACCEPTED)


def checked_codes(codes: Iterable[str]) -> list[str]:
    """Each code once; ValueError for one that is no question."""
    found = list(dict.fromkeys(codes))
    for code in found:
        if code not in QUESTIONS:
            raise ValueError(f"--accept {code}: no such question; there are {', '.join(QUESTIONS)}")
    return found


def in_question(tap_id: str, remark: Remark) -> Remark:
    """A question as the assembly passes it on, told of the tap test."""
    return replace(remark, about=f"tap test {tap_id}")
