"""Remarks on modes that change from hit to hit of one tap test."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

import modal
from acquisition import Hit, HitFlags, Remark
from modal import HitChange, HitChangeKind, Mode

MIN_UNCOVERED_SPREAD = 0.25
"""Spread of a frequency over the hits from which its states limit cuts differently (damping ratios).

Below it, the limit of the worst state is above 0.9 of that of the mean at 95 % of the speeds (docs/studies/modal.md).
"""
SMALL_CHANGE_CODE = "hits-differ-slightly"
"""Code of a change from hit to hit that hardly moves a limit."""
HIT_CHANGE_CODES = {
    HitChangeKind.DRIFT: "hits-drift",
    HitChangeKind.FORCE: "hits-follow-force",
    HitChangeKind.TWO_STATES: "hits-two-states",
    HitChangeKind.SCATTER: "hits-scatter",
    HitChangeKind.PARTIAL: "mode-in-some-hits",
}
"""Code of a change from hit to hit that moves limits, by its kind."""
REMEDIES = {
    HitChangeKind.DRIFT: "Let the spindle warm up, then tap again",
    HitChangeKind.FORCE: "Check joints and clamping, and give all hits the same force",
    HitChangeKind.TWO_STATES: "Check the clamping, clamp the tool again, and tap again",
    HitChangeKind.SCATTER: "Check the clamping, and hit the same point in the same direction",
    HitChangeKind.PARTIAL: "Look for loose parts, and hit the same point in the same direction",
}
"""Remedy of a change from hit to hit, by its kind."""
EXPLAINED_CODES = ("low-coherence", "scatter", "several-modes", "uncertain", "uneven-peak")
"""Codes of remarks on modes that a change from hit to hit explains."""


MIN_INCONSISTENT_HITS = 2
"""Fewest hits that differ from the mean and are compared as well; chosen: one may be a slip of the hammer."""


def find_hit_remarks(
    hits: Sequence[Hit], band: tuple[float, float] | None = None, flags: Sequence[HitFlags] = ()
) -> Iterator[Remark]:
    """Return a remark on each kind of change over the hits of a tap test, at its most flexible mode.

    band: frequencies of interest (Hz), None for all. flags: faults of each hit, empty if all are accepted.
    """
    return describe_changes(find_changes_in_band(hits, band, flags))


def find_changes_in_band(
    hits: Sequence[Hit], band: tuple[float, float] | None = None, flags: Sequence[HitFlags] = ()
) -> list[HitChange]:
    """Find the changes over the hits of a tap test, the most flexible mode first; arguments as `find_hit_remarks`."""
    low, high = band or (0.0, np.inf)
    return [change for change in _find_changes(hits, flags) if low <= change.frequency <= high]


def describe_changes(changes: Sequence[HitChange]) -> Iterator[Remark]:
    """Yield a remark on each kind of these changes, at its most flexible mode."""
    for of_kind in _group_by_kind(changes):
        is_small = _is_small(of_kind)
        if not (is_small and of_kind[0].kind is HitChangeKind.FORCE):  # the linearity check of the modes says it
            yield _make_remark(of_kind, is_small)


def select_uncovered_changes(changes: Sequence[HitChange]) -> tuple[HitChange, ...]:
    """Return the changes whose remark makes verdicts doubtful."""
    return tuple(change for of_kind in _group_by_kind(changes) if not _is_small(of_kind) for change in of_kind)


def _group_by_kind(changes: Sequence[HitChange]) -> list[list[HitChange]]:
    kinds = dict.fromkeys(change.kind for change in changes)
    return [[change for change in changes if change.kind is kind] for kind in kinds]


def _is_small(changes: Sequence[HitChange]) -> bool:
    """Return whether changes of one kind hardly move a limit."""
    return max(change.relative_spread for change in changes) < MIN_UNCOVERED_SPREAD


def drop_explained_remedies(modes: Sequence[Mode], changes: Sequence[Remark]) -> tuple[Mode, ...]:
    """Return the modes without the remedies that compete with the remedy of a change from hit to hit.

    More hits, for example, only prolong a drift. changes: remarks of `find_hit_remarks`; without any the modes stay.
    """
    if not changes:
        return tuple(modes)
    return tuple(replace(mode, remarks=tuple(map(_drop_explained_remedy, mode.remarks))) for mode in modes)


def _drop_explained_remedy(remark: Remark) -> Remark:
    return replace(remark, cure="") if remark.code in EXPLAINED_CODES else remark


def _find_changes(hits: Sequence[Hit], flags: Sequence[HitFlags]) -> list[HitChange]:
    """Return the changes over the accepted hits, or over these and the hits that differ from their mean.

    The mean is that of the first hits: of two states, all hits in the other one are rejected. Of these hits only what
    repeats counts, and no mode that they miss.
    """
    accepted = [hit for hit, flag in zip(hits, flags, strict=True) if not flag] if flags else hits
    if flags.count(HitFlags.INCONSISTENT) < MIN_INCONSISTENT_HITS:
        return modal.find_hit_changes(accepted)
    kept = [(hit, flag) for hit, flag in zip(hits, flags, strict=True) if flag in (HitFlags.OK, HitFlags.INCONSISTENT)]
    good = {i for i, (_, flag) in enumerate(kept) if not flag}
    changes = modal.find_hit_changes([hit for hit, _ in kept])
    return [change for change in changes if _repeats(change, good)] or modal.find_hit_changes(accepted)


def _repeats(change: HitChange, good: set[int]) -> bool:
    """Return whether a change is more than rejected hits of their own, or without a mode that all good hits have."""
    is_only_missing = change.kind is HitChangeKind.PARTIAL and good <= {*change.hits}
    return change.kind is not HitChangeKind.SCATTER and not is_only_missing


def _make_remark(changes: Sequence[HitChange], is_small: bool) -> Remark:
    """Return the remark on the changes of one kind, the most flexible mode first."""
    change = changes[0]
    code = SMALL_CHANGE_CODE if is_small else HIT_CHANGE_CODES[change.kind]
    others = f", also at {', '.join(f'{other.frequency:.0f}' for other in changes[1:])} Hz" if changes[1:] else ""
    return Remark(code, f"{change.frequency:.0f} Hz", _describe(change) + others, REMEDIES[change.kind])


def _describe(change: HitChange) -> str:
    name, percent = "f1" if change.is_highest else "frequency", 100 / change.frequency
    falls = "falls" if change.spread < 0 else "rises"
    total = f"{abs(change.spread) * percent:.2g} %"
    if change.kind is HitChangeKind.DRIFT:
        return f"{name} {falls} by {abs(change.per_hit) * percent:.1g} % per hit, {total} in {change.n_hits} hits"
    if change.kind is HitChangeKind.FORCE:
        return f"{name} {falls} by {total} from the softest hit to the hardest"
    if change.kind is HitChangeKind.TWO_STATES:
        return f"{name} has two states {total} apart, one in {len(change.hits)} of {change.n_hits} hits"
    if change.kind is HitChangeKind.SCATTER:
        return f"{name} differs by up to {total} from hit to hit"
    return f"mode present in only {len(change.hits)} of {change.n_hits} hits"
