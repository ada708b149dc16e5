"""Test cuts for people and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC
from typing import Any

from acquisition import Remark
from lobewatch.logbook import Logbook
from lobewatch.machine.additions.observe_cut import contradicting_cuts
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.show.programs.describe_power import power_json, power_text


def cut_text(cut: HeardCut) -> str:
    """A test cut in one line."""
    return f"{cut.id}: {cut.at.astimezone():%Y-%m-%d %H:%M} {cut_words(cut)}"


def cut_words(cut: HeardCut) -> str:
    """Name, speed and depth of a test cut, what it sounded like, and its power."""
    named = cut.program or "reference cut"
    words = f"{named} at {cut.speed_rpm:.6g} rpm, {1e3 * cut.depth:.4g} mm: {heard_text(cut)}, by {cut.by}"
    return words if cut.power is None else f"{words}; {power_text(cut.power, cut.cut)}"


def heard_text(cut: HeardCut) -> str:
    """Sound of a test cut, in words."""
    heard: str = cut.word
    if cut.chatter_frequency_hz is not None:
        error = cut.chatter_frequency_std_hz
        heard += f" at {cut.chatter_frequency_hz:.5g}{'' if error is None else f' +- {2 * error:.2g}'} Hz"
    return heard + (f" ({cut.reason})" if cut.reason else "")


def cut_json(cut: HeardCut) -> dict[str, Any]:
    """One test cut."""
    return {
        "id": cut.id,
        "time": cut.at.astimezone(UTC).isoformat(timespec="microseconds"),
        "program": cut.program,
        "tool": cut.tool,
        "feed": cut.feed,
        "speed_rpm": cut.speed_rpm,
        "commanded_rpm": cut.commanded_rpm,
        "depth_mm": 1e3 * cut.depth,
        "word": cut.word,
        "chatter_frequency_hz": cut.chatter_frequency_hz,
        "chatter_frequency_hz_std": cut.chatter_frequency_std_hz,
        "by": cut.by,
        **power_json(cut.power),
        "reason": cut.reason,
        "recording": None if cut.recording is None else cut.recording.file,
        "excluded": cut.excluded,
    }


def kept_cut_remarks(logbook: Logbook, cut: HeardCut, earlier: Sequence[HeardCut]) -> list[Remark]:
    """What is to be said of a cut that was heard and kept; earlier: those kept before."""
    contrary = contradicting_cuts(cut, earlier) if cut.counts else ()
    return [*untapped_remarks(logbook, cut), *map(contradiction_remark, contrary)]


def untapped_remarks(logbook: Logbook, cut: HeardCut) -> list[Remark]:
    """A remark that the tool was never tapped; none where it was."""
    if any(tap.tool == cut.tool for tap in logbook.taps):
        return []
    text = "was never tapped: the cut is kept, and counts when it is"
    return [Remark("tool-not-tapped", cut.tool, text, f"tap it with: lobewatch tap {logbook.folder.path}")]


def contradiction_remark(cut: HeardCut) -> Remark:
    """A remark that a cut was heard otherwise before."""
    text = f"heard otherwise at the same point ({cut_words(cut)}); both are kept"
    cure = f"lobewatch exclude MACHINE {cut.id} --reason TEXT takes out the one that is wrong"
    return Remark("cuts-contradict", cut.id, text, cure)
