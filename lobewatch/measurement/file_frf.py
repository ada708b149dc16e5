"""Read the FRF of a recorded file with its averaged hits."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import acquisition
from acquisition import DataError, Description, Fact, Frf, Hit, HitDecision, HitFlags, Remark
from acquisition.errors import join_sentences
from acquisition.files.read_recording import detect_format
from acquisition.files.tap_file import TAP_FORMAT
from acquisition.hit_quality.decide_hits import add_decisions, average_decided_hits
from acquisition.tap_test import decide_flags
from lobewatch.measurement.exponential_window import Window, missing_window_text, own_window_remark, window_ringing_hits
from lobewatch.measurement.hit_choice import find_choice_remarks
from lobewatch.step_times import time_step
from modal import ConjugateError, pick_peaks

ACCEPTABLE_FLAGS = HitFlags.NOT_DECAYED | HitFlags.TOO_SOFT | HitFlags.TOO_HARD
ACCEPTABLE_FLAGS |= HitFlags.OVERLOAD_FORCE | HitFlags.OVERLOAD_RESPONSE
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
    faults: tuple[HitFlags, ...] = ()
    """Faults of all hits of the file."""
    decisions: tuple[HitDecision, ...] = ()
    """Decisions of a person on these hits."""
    places: tuple[str, ...] = ()
    """File and number of each hit in it, where the hits are of several files; empty otherwise."""
    n_found: int = 0
    """Number of hits found, with those that cannot be used; 0 for an FRF."""


@time_step("reading")
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
        missing = missing_window_text(recording.window, window)
        raise DataError(join_sentences(f"{path}: {recording.problems}", missing, phase))
    recording.require_measurable()
    if recording.frf is not None:
        facts = tuple(fact for fact in recording.facts if fact.name != "averages")
        return replace(_set_averages(path, recording.frf, averages), facts=facts, recorded_window=recording.window)
    if averages is not None:
        finding = f"Description.averages {averages}: lobewatch counts the hits of {path.name}"
        raise ValueError(f"{finding}. Leave out the number of averages.")
    frf = _average_hits(path, recording.hits, accepted, description)
    facts, remarks, n_found = recording.facts, (*recording.remarks, *frf.remarks), recording.n_found
    return replace(
        frf, facts=facts, recorded_window=recording.window, remarks=remarks, n_found=n_found, places=recording.places
    )


def _check_phase(path: Path, description: Description) -> str:
    """Return the fault of the phase of an FRF whose unit or response number is missing, else an empty text."""
    unit, response = description.unit or "m/N", description.response or 1
    frf = acquisition.inspect_file(path, replace(description, unit=unit, response=response)).frf
    try:
        if frf is not None:
            pick_peaks(frf)
    except ValueError as error:
        return f"Also {error}" if isinstance(error, ConjugateError) else ""
    return ""


def _average_hits(path: Path, hits: Sequence[Hit], accepted: HitFlags, description: Description) -> FileFrf:
    faults = tuple(map(acquisition.check_hit, hits))
    if description.hit_decisions:
        return _average_decided_hits(path, hits, faults, accepted, description)
    good = tuple(hit for hit, verdict in zip(hits, faults, strict=True) if not verdict & ~accepted)
    refused = sum(bool(verdict) and not verdict & ~accepted for verdict in faults)
    if refused:
        text = f"average includes {refused} of {len(hits)} hits that failed the checks"
        frf = acquisition.estimate_frf(good) if good[0].has_force else None
        return FileFrf(frf, good, remarks=(Remark("hits-accepted", "", text),), faults=faults)
    if good and not good[0].has_force:
        return FileFrf(None, good, faults=faults)
    try:
        return FileFrf(acquisition.read_frf(path, description), good, faults=faults)
    except DataError:
        ringing = [hit for hit, verdict in zip(hits, faults, strict=True) if verdict == HitFlags.NOT_DECAYED]
        if not ringing or not hits[0].has_force:
            raise
        frf, windowed, tau = window_ringing_hits(ringing)
        cure = "Record longer, or use the hits without a window with fit_file_modes.accept not-decayed"
        return FileFrf(frf, windowed, tau, (own_window_remark("", tau, cure),), faults=faults)


def _average_decided_hits(
    path: Path, hits: Sequence[Hit], faults: tuple[HitFlags, ...], accepted: HitFlags, description: Description
) -> FileFrf:
    """Average the hits that remain after decisions, of one tap file by its own verdicts on all its hits."""
    if detect_format(path) is TAP_FORMAT and not description.hit_files:
        tap = acquisition.read_tap(path)
        hits, faults = tap.hits, tap.flags
    left = [found & ~accepted for found in faults]
    decisions = add_decisions(left, (), description.hit_decisions)
    frf, used = average_decided_hits(hits, decide_flags(left, decisions))
    return FileFrf(frf, used, remarks=(*find_choice_remarks(faults, decisions),), faults=faults, decisions=decisions)


def _parse_accepted_flags(codes: Collection[str]) -> HitFlags:
    flags = {flag.words.replace(" ", "-"): flag for flag in ACCEPTABLE_FLAGS}
    accepted = HitFlags.OK
    for code in codes:
        if code not in flags:
            raise ValueError(
                f"fit_file_modes.accept {code}: this code cannot be accepted. Choose from {', '.join(flags)}."
            )
        accepted |= flags[code]
    return accepted


def _set_averages(path: Path, frf: Frf, averages: int | None) -> FileFrf:
    """Set the number of averages behind the coherence: as given, else as in the file, else inferred."""
    if averages is not None:
        option = f"Description.averages {averages}"
        if averages < 1:
            raise ValueError(f"{option}: not above 0. Give the number of averaged hits.")
        if frf.coherence is None:
            raise ValueError(f"{option}: {path.name} has no coherence. Leave out the number of averages.")
        return FileFrf(replace(frf, n_averages=averages))
    if frf.coherence is None or frf.n_averages > 1:
        return FileFrf(frf)
    inferred, cure = acquisition.infer_averages(frf), "Give the number of averages with Description.averages"
    if inferred is None:
        text = "coherence not used, because the number of averages is unknown"
        return FileFrf(frf, remarks=(Remark("averages-unknown", "", text, cure),))
    text = f"about {inferred} averages, estimated from coherence and line-to-line scatter"
    return FileFrf(replace(frf, n_averages=inferred), remarks=(Remark("averages-inferred", "", text, cure),))
