"""Decisions of a person on hits: from their options, checked, and applied to a tap test."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from acquisition.errors import join_sentences
from acquisition.estimation.estimate_frf import estimate_frf
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.hit_fault import HitFlags
from acquisition.tap_test import HitDecision, TapTest, decide_flags

UNUSABLE_HIT_FLAGS = HitFlags.NO_HIT | HitFlags.NO_RESPONSE | HitFlags.LOST_SCANS | HitFlags.SWAPPED_CHANNELS
"""Faults that nobody can accept: force or response of the hit is missing, or not where the FRF takes it from."""


def parse_hit_decisions(
    accept: Iterable[str] = (), reject: Iterable[int] = (), undo: Iterable[int] = ()
) -> tuple[HitDecision, ...]:
    """Parse decisions on hits, one for each hit that is named.

    Parameters
    ----------
    accept
        Number and code of each accepted fault, such as "3:double-hit".
    reject
        Numbers of rejected hits, from 1.
    undo
        Numbers of the hits whose decision is withdrawn.

    Returns
    -------
    tuple of HitDecision
        Decisions, in the order of the hits.

    Raises
    ------
    ValueError
        For a text that is no number and code, a code that does not exist, or two decisions on one hit.

    Examples
    --------
    >>> [str(decision) for decision in parse_hit_decisions(["3:double-hit", "3:too-hard"], [1])]
    ['reject 1', 'accept 3:double-hit,too-hard']
    """
    codes: dict[int, list[str]] = {}
    for text in accept:
        number, _, code = text.partition(":")
        if not (number.isascii() and number.isdigit() and code):
            raise ValueError(f"decide_hits.accept {text}: not a hit and a code. Write N:CODE, such as 3:double-hit.")
        HitFlags.from_codes([code])
        codes.setdefault(int(number), []).append(code)
    decisions = [HitDecision(hit, "accept", tuple(dict.fromkeys(found))) for hit, found in codes.items()]
    decisions += [HitDecision(hit, "reject") for hit in dict.fromkeys(reject)]
    decisions += [HitDecision(hit, "undo") for hit in dict.fromkeys(undo)]
    numbers = [decision.hit for decision in decisions]
    if twice := [hit for hit in numbers if numbers.count(hit) > 1]:
        raise ValueError(f"hit {twice[0]} has two decisions. Give one decision for each hit.")
    return tuple(sorted(decisions, key=lambda decision: decision.hit))


def merge_decisions(decisions: Iterable[HitDecision]) -> tuple[HitDecision, ...]:
    """Return the decision that counts for each hit: the last one, none where it was withdrawn."""
    by_hit = {decision.hit: decision for decision in decisions}
    counting = (decision for decision in by_hit.values() if decision.decision != "undo")
    return tuple(sorted(counting, key=lambda decision: decision.hit))


def decide_hits(tap: TapTest, decisions: Sequence[HitDecision]) -> TapTest:
    """Return a tap test with decisions on its hits, in place of earlier ones, and the FRF of the hits that remain.

    The faults of the hits stay as they are.

    Parameters
    ----------
    tap
        Tap test.
    decisions
        Decisions that count, at most one per hit.

    Returns
    -------
    TapTest
        Tap test with these decisions.

    Raises
    ------
    ValueError
        If no hit remains, or if an accepted hit has no FRF.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> response = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7])).response(time, 1e-3)
    >>> hits = tuple(Hit(peak * pulse, peak * response, 10240.0, 100) for peak in (180.0, 200.0, 220.0))
    >>> tested = Circumstances("Mill 3", datetime(2026, 3, 2, 9, 30, tzinfo=UTC))
    >>> flags = HitFlags.OK, HitFlags.OK, HitFlags.TOO_HARD
    >>> tap = TapTest("ID", tested, estimate_frf(hits[:2]), hits, flags)
    >>> decided = decide_hits(tap, add_decisions(flags, (), parse_hit_decisions(["3:too-hard"], [1])))
    >>> [flags.words for flags in decided.decided_flags], decided.frf.n_averages
    (['undone', 'good', 'good'], 2)
    """
    decided = replace(tap, decisions=tuple(decisions))
    if [*map(bool, decided.decided_flags)] == [*map(bool, tap.decided_flags)]:
        return decided
    return replace(decided, frf=average_decided_hits(tap.hits, decided.decided_flags)[0])


def decide_stored_hits(tap: TapTest, decisions: Sequence[HitDecision] = ()) -> TapTest:
    """Return a tap test of a file with the decisions in the journal, in place of those behind the FRF of the file.

    Without decisions and without a good hit, those of the file stay, so that the test still opens.
    """
    return decide_hits(tap, decisions if decisions or not all(tap.flags) else tap.decisions)


def average_decided_hits(hits: Sequence[Hit], flags: Sequence[HitFlags]) -> tuple[Frf | None, tuple[Hit, ...]]:
    """Return the FRF of the hits without a flag, None without force, and these hits; ValueError if none remains."""
    used = tuple(hit for hit, found in zip(hits, flags, strict=True) if not found)
    if not used:
        raise ValueError(f"none of {len(hits)} hits remains. Keep one, or leave out the file or tap test.")
    return estimate_frf(used) if used[0].has_force else None, used


def add_decisions(
    faults: Sequence[HitFlags], earlier: Sequence[HitDecision], new: Iterable[HitDecision]
) -> tuple[HitDecision, ...]:
    """Return all decisions on the hits of a tap test after further ones.

    Parameters
    ----------
    faults
        Faults that the evaluation found in each hit.
    earlier
        Decisions that count so far.
    new
        Further decisions. The same decision again changes nothing.

    Returns
    -------
    tuple of HitDecision
        Decisions that count now.

    Raises
    ------
    ValueError
        For a hit that does not exist, a code that the hit does not have, a fault that cannot be accepted or is left,
        or a decision to withdraw that does not exist.

    Examples
    --------
    >>> faults = HitFlags.OK, HitFlags.DOUBLE_HIT
    >>> [str(decision) for decision in add_decisions(faults, (), [HitDecision(2, "accept", ("double-hit",))])]
    ['accept 2:double-hit']
    """
    new, current = [decision for decision in new if decision not in earlier], decide_flags(faults, earlier)
    for decision in new:
        if not 1 <= decision.hit <= len(faults):
            has = f"the tap test has {len(faults)} hits" if faults else "the tap test has an FRF, but no hits"
            raise ValueError(f"hit {decision.hit} does not exist, because {has}. Give the number of a hit.")
        if decision.decision == "accept":
            _check_acceptance(decision, faults[decision.hit - 1], current[decision.hit - 1])
        elif decision.decision == "undo" and decision.hit not in [past.hit for past in earlier]:
            raise ValueError(f"hit {decision.hit} has no decision. Leave out this hit.")
    return merge_decisions([*earlier, *new])


def _check_acceptance(decision: HitDecision, faults: HitFlags, now: HitFlags) -> None:
    """Raise ValueError if accepting these codes of a hit with these faults does not make it good; now: flags so far."""
    hit, codes = decision.hit, decision.codes
    if now and not faults:
        raise ValueError(f"hit {hit} was rejected by hand. Withdraw that decision with decide_hits.undo {hit}.")
    if unusable := faults & UNUSABLE_HIT_FLAGS:
        finding = f"hit {hit} cannot be accepted, because it has no usable force or response ({unusable.words})"
        raise ValueError(join_sentences(finding, "Leave out this hit"))
    if absent := [code for code in codes if code not in faults.codes]:
        has = f"has {' and '.join(faults.codes)}, not {absent[0]}" if faults else f"is good and has no {absent[0]}"
        raise ValueError(f"hit {hit} {has}. Give only codes of the hit.")
    if left := (faults & ~HitFlags.from_codes(codes)).codes:
        also = " ".join(f"decide_hits.accept {hit}:{code}" for code in left)
        raise ValueError(f"hit {hit} also has {' and '.join(left)}. Accept each fault: add {also}.")
