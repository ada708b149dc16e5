"""Read the FRF of a recorded file with its hits."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import acquisition
from acquisition import DataError, Description, Fact, Frf, Hit, HitFlags, Remark
from lobewatch.measurement.exponential_window import Window, missing_window_text, own_window_remark, window_ringing_hits
from modal import ConjugateError, pick_peaks

ACCEPTABLE_FLAGS = (
    HitFlags.NOT_DECAYED | HitFlags.TOO_SOFT | HitFlags.TOO_HARD | HitFlags.OVERLOAD_FORCE | HitFlags.OVERLOAD_RESPONSE
)
"""Faults of hits that can be accepted; hits with others have no single pulse, or lost scans."""


@dataclass(frozen=True, eq=False)
class FileFrf:
    """FRF of a recorded file with its hits."""

    frf: Frf | None
    """FRF of the file, or the average of its hits; None without force."""
    hits: tuple[Hit, ...] = ()
    """Averaged hits; empty if the file contains only an FRF."""
    time_constant: float | None = None
    """Time constant of our own window over all hits (s); None without one."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on what was done to the hits."""
    facts: tuple[Fact, ...] = ()
    """Facts of the file with their origins."""
    recorded_window: float | None = None
    """Time constant of the response window in the file (s); NaN for an unknown shape, None without one."""


def read_file_frf(
    path: Path, accept: Collection[str], description: Description, window: Window | None, *, conjugate: bool
) -> FileFrf:
    """Read the FRF of a file with its hits; see `fit_file_modes`.

    window, conjugate: as given, so that missing window data is requested together with all other missing data.
    """
    accepted, averages = _parse_accepted_flags(accept), description.averages
    description = replace(description, averages=None)
    recording = acquisition.inspect_file(path, description)
    if recording.problems:
        phase = "" if conjugate else _check_phase(path, description)
        raise DataError(f"{path}: {recording.problems}{missing_window_text(recording.window, window)}{phase}")
    if recording.frf is not None:
        facts = tuple(fact for fact in recording.facts if fact.name != "averages")
        return replace(_set_averages(path, recording.frf, averages), facts=facts, recorded_window=recording.window)
    if averages is not None:
        raise ValueError(f"Description.averages {averages}: {path.name} holds hits, and they are counted; leave it out")
    frf = _average_hits(path, recording.hits, accepted, description)
    return replace(frf, facts=recording.facts, recorded_window=recording.window)


def _check_phase(path: Path, description: Description) -> str:
    """Return the fault of the phase of an FRF whose unit or response number is missing, else an empty text."""
    unit, response = description.unit or "m/N", description.response or 1
    frf = acquisition.inspect_file(path, replace(description, unit=unit, response=response)).frf
    try:
        if frf is not None:
            pick_peaks(frf)
    except ConjugateError as error:
        return f"; {error}"
    except ValueError:
        return ""
    return ""


def _average_hits(path: Path, hits: Sequence[Hit], accepted: HitFlags, description: Description) -> FileFrf:
    verdicts = [acquisition.check_hit(hit) for hit in hits]
    good = [hit for hit, verdict in zip(hits, verdicts, strict=True) if not verdict & ~accepted]
    refused = sum(bool(verdict) and not verdict & ~accepted for verdict in verdicts)
    if refused:
        text = f"{refused} of {len(hits)} hits are averaged though they were refused"
        frf = acquisition.estimate_frf(good) if good[0].has_force else None
        return FileFrf(frf, tuple(good), remarks=(Remark("hits-accepted", "", text),))
    if good and not good[0].has_force:
        return FileFrf(None, tuple(good))
    try:
        return FileFrf(acquisition.read_frf(path, description), tuple(good))
    except DataError:
        ringing = [hit for hit, verdict in zip(hits, verdicts, strict=True) if verdict == HitFlags.NOT_DECAYED]
        if not ringing or not hits[0].has_force:
            raise
        frf, windowed, tau = window_ringing_hits(ringing)
        cure = "a longer record needs none; fit_file_modes.accept not-decayed takes the hits as they are"
        return FileFrf(frf, windowed, tau, (own_window_remark("", tau, cure),))


def _parse_accepted_flags(codes: Collection[str]) -> HitFlags:
    flags = {flag.words.replace(" ", "-"): flag for flag in ACCEPTABLE_FLAGS}
    accepted = HitFlags.OK
    for code in codes:
        if code not in flags:
            allowed = ", ".join(flags)
            raise ValueError(f"fit_file_modes.accept {code}: no verdict on hits that can be accepted; give {allowed}")
        accepted |= flags[code]
    return accepted


def _set_averages(path: Path, frf: Frf, averages: int | None) -> FileFrf:
    """Set the number of averages behind the coherence: as given, else as in the file, else inferred."""
    if averages is not None:
        option = f"Description.averages {averages}"
        if averages < 1:
            raise ValueError(f"{option}: give the number of hits averaged, 1 or more")
        if frf.coherence is None:
            raise ValueError(f"{option}: {path.name} has no coherence to use it with; leave it out")
        return FileFrf(replace(frf, n_averages=averages))
    if frf.coherence is None or frf.n_averages > 1:
        return FileFrf(frf)
    inferred, cure = acquisition.infer_averages(frf), "give it with Description.averages"
    if inferred is None:
        text = "the coherence is not used: the number of averages is not known and cannot be inferred"
        return FileFrf(frf, remarks=(Remark("averages-unknown", "", text, cure),))
    text = f"about {inferred} averages, inferred from the coherence and the scatter from line to line"
    return FileFrf(replace(frf, n_averages=inferred), remarks=(Remark("averages-inferred", "", text, cure),))
