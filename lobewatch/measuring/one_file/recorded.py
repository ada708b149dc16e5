"""What a recorded file gives to fit modes to."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from acquisition import (
    DataError,
    Description,
    Fact,
    Frf,
    Hit,
    HitFlags,
    Remark,
    check_hit,
    estimate_frf,
    infer_averages,
    look,
    read_frf,
)
from lobewatch.measuring.one_file.own_window import under_own_window, windowed_here

ACCEPTABLE = (
    HitFlags.NOT_DECAYED | HitFlags.TOO_SOFT | HitFlags.TOO_HARD | HitFlags.OVERLOAD_FORCE | HitFlags.OVERLOAD_RESPONSE
)
"""Verdicts that can be accepted: a hit with others has no single pulse, or not all of its scans."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """An FRF with the hits behind it."""

    frf: Frf
    """Read, or the average of the hits."""
    hits: tuple[Hit, ...] = ()
    """Those that it was averaged from; none where the file holds only an FRF."""
    time_constant: float | None = None
    """Of the window that was laid over all of them here (s)."""
    remarks: tuple[Remark, ...] = ()
    """What was done to them."""
    facts: tuple[Fact, ...] = ()
    """What is known of the file, and from where."""
    named_window: float | None = None
    """Time constant (s) of the window over the response that the file names; NaN where it does not say how it falls."""


def recorded(path: Path, accept: Collection[str], said: Description) -> Recorded:
    """The FRF of a file with its hits, and how many it was averaged from where nobody says: see `modes_of_file`."""
    accepted, averages, said = _accepted(accept), said.averages, replace(said, averages=None)
    found = look(path, said).checked()
    if found.frf is not None:
        facts = tuple(fact for fact in found.facts if fact.name != "averages")
        return replace(_with_averages(path, found.frf, averages), facts=facts, named_window=found.window)
    if averages is not None:
        raise ValueError(f"--averages {averages}: {path.name} holds hits, and they are counted; leave it out")
    return replace(_averaged(path, found.hits, accepted, said), facts=found.facts, named_window=found.window)


def _averaged(path: Path, recording: Sequence[Hit], accepted: HitFlags, said: Description) -> Recorded:
    verdicts = [check_hit(hit) for hit in recording]
    good = [hit for hit, verdict in zip(recording, verdicts, strict=True) if not verdict & ~accepted]
    refused = sum(bool(verdict) and not verdict & ~accepted for verdict in verdicts)
    if refused:
        text = f"{refused} of {len(recording)} hits are averaged though they were refused"
        return Recorded(estimate_frf(good), tuple(good), remarks=(Remark("hits-accepted", "", text),))
    try:
        return Recorded(read_frf(path, said), tuple(good))
    except DataError:
        ringing = [hit for hit, verdict in zip(recording, verdicts, strict=True) if verdict == HitFlags.NOT_DECAYED]
        if not ringing:
            raise
        return _windowed(ringing)


def _accepted(codes: Collection[str]) -> HitFlags:
    known = {flag.words.replace(" ", "-"): flag for flag in ACCEPTABLE}
    accepted = HitFlags.OK
    for code in codes:
        if code not in known:
            raise ValueError(f"--accept {code}: no verdict on hits that can be accepted; give {', '.join(known)}")
        accepted |= known[code]
    return accepted


def _windowed(hits: list[Hit]) -> Recorded:
    frf, windowed, tau = under_own_window(hits)
    remark = windowed_here("", tau, "a longer record needs none; --accept not-decayed takes the hits as they are")
    return Recorded(frf, windowed, tau, (remark,))


def _with_averages(path: Path, frf: Frf, averages: int | None) -> Recorded:
    """An FRF of a file with the number of hits behind its coherence: as asked, else as the file says, else inferred."""
    if averages is not None:
        if averages < 1:
            raise ValueError(f"--averages {averages}: give the number of hits averaged, 1 or more")
        if frf.coherence is None:
            raise ValueError(f"--averages {averages}: {path.name} has no coherence to use it with; leave it out")
        return Recorded(replace(frf, n_averages=averages))
    if frf.coherence is None or frf.n_averages > 1:
        return Recorded(frf)
    inferred, cure = infer_averages(frf), "give it with --averages"
    if inferred is None:
        text = "the coherence is not used: the number of averages is not known and cannot be inferred"
        return Recorded(frf, remarks=(Remark("averages-unknown", "", text, cure),))
    text = f"about {inferred} averages, inferred from the coherence and the scatter from line to line"
    return Recorded(replace(frf, n_averages=inferred), remarks=(Remark("averages-inferred", "", text, cure),))
