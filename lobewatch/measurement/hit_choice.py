"""Remarks on the choice of the averaged hits: decisions of a person, overloads among them, and hits not needed."""

from collections.abc import Sequence

from acquisition import HitDecision, HitFlags, Remark

HIT_DECISIONS_CODE = "hits-by-hand"
"""Code of the remark on decisions on hits; it is about all of them."""
HIT_DECISION_CODES = (HIT_DECISIONS_CODE, "hits-overloaded")
"""Codes of the remarks that follow from decisions on hits."""
OVERLOAD_FLAGS = HitFlags.OVERLOAD_FORCE | HitFlags.OVERLOAD_RESPONSE


def format_decisions(decisions: Sequence[HitDecision]) -> str:
    """Return decisions on hits in words; empty without any."""
    return ", ".join(map(str, decisions))


def format_unused_hits(flags: Sequence[HitFlags], places: Sequence[str] = ()) -> str:
    """Return each hit that is not averaged with its flags; empty if all are.

    places: file of each hit and its number there, if the hits are of several files.
    """
    of = [f"{place}: " for place in places] or [""] * len(flags)
    listed = enumerate(zip(flags, of, strict=True), 1)
    unused = [f"hit {number} ({place}{_format_flags(found)})" for number, (found, place) in listed if found]
    return f"without {', '.join(unused)}" if unused else ""


def _format_flags(flags: HitFlags) -> str:
    """Return flags in words, where a hit that a person took out is rejected by hand."""
    return ", ".join("rejected by hand" if flag is HitFlags.UNDONE else flag.words for flag in flags)


def find_choice_remarks(faults: Sequence[HitFlags], decisions: Sequence[HitDecision]) -> list[Remark]:
    """Return the remarks on the averaged hits of a tap test.

    Parameters
    ----------
    faults
        Faults of each hit, before the decisions.
    decisions
        Decisions on hits that count.

    Returns
    -------
    list of Remark
        Remarks on decisions, on accepted overloads, and on good hits that were not needed.
    """
    remarks = []
    if decisions:
        remarks.append(Remark(HIT_DECISIONS_CODE, format_decisions(decisions), "the user decided on these hits"))
    accepted = [decision for decision in decisions if decision.decision == "accept"]
    if clipped := [d.hit for d in accepted if HitFlags.from_codes(d.codes) & OVERLOAD_FLAGS]:
        numbers = ", ".join(map(str, clipped))
        text = "the FRF includes accepted hits with overload, so stiffness K and damping may be wrong"
        cure = "Tap again with softer hits or a larger range to confirm K"
        remarks.append(Remark("hits-overloaded", f"hit {numbers}", text, cure))
    if surplus := [f"{number}" for number, flags in enumerate(faults, 1) if flags & HitFlags.SURPLUS]:
        text = "good but not needed: other hits agree better with the median FRF and force spectrum"
        remarks.append(Remark("hits-surplus", f"hit {', '.join(surplus)}", text))
    return remarks
