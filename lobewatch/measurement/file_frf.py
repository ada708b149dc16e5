"""Read the FRF of a recorded file with its averaged hits."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import acquisition
from acquisition import DataError, Description, Fact, Frf, Hit, HitDecision, HitFlags, Recording, Remark
from acquisition.errors import join_sentences
from acquisition.files.read_recording import detect_format
from acquisition.files.tap_file import TAP_FORMAT, read_judged_tap
from acquisition.hit_quality.decide_hits import add_decisions, average_decided_hits
from acquisition.tap_test import TapTest, decide_flags
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
    flags: tuple[HitFlags, ...] = ()
    """Flags of these hits without accepted faults and after decisions; falsy for an averaged hit."""
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
    is_tap_file = not description.hit_files and detect_format(path) is TAP_FORMAT
    tap = read_judged_tap(path) if is_tap_file else None
    if tap is None and recording.frf is not None:
        add_decisions((), (), description.hit_decisions)
        facts = tuple(fact for fact in recording.facts if fact.name != "averages")
        return replace(_set_averages(path, recording.frf, averages), facts=facts, recorded_window=recording.window)
    if averages is not None:
        finding = f"Description.averages {averages}: lobewatch counts the hits of {path.name}"
        raise ValueError(f"{finding}. Leave out the number of averages.")
    recording = recording if tap is None else replace(recording, hits=tap.hits)
    frf = _average_hits(recording, tap, accepted, description)
    remarks, n_found, places = (*recording.remarks, *frf.remarks), recording.n_found, recording.places
    of_file = replace(frf, facts=recording.facts, recorded_window=recording.window, remarks=remarks)
    return replace(of_file, n_found=n_found, places=places)


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


def _average_hits(recording: Recording, tap: TapTest | None, accepted: HitFlags, description: Description) -> FileFrf:
    """Average the hits of a recording, of a tap file by its own verdicts, without those that the checks refuse."""
    hits, earlier = recording.hits, () if tap is None else tap.decisions
    faults = tuple(map(acquisition.check_hit, hits)) if tap is None else tap.flags
    left = tuple(found & ~accepted for found in faults)
    decisions = add_decisions(left, earlier, description.hit_decisions)
    flags = decide_flags(left, decisions)
    if decisions:
        frf, used = average_decided_hits(hits, flags)
        remarks = (*find_choice_remarks(faults, decisions),)
        return FileFrf(frf, used, remarks=remarks, faults=faults, flags=flags, decisions=decisions)
    good = tuple(hit for hit, found in zip(hits, flags, strict=True) if not found)
    if refused := sum(bool(found) and not now for found, now in zip(faults, flags, strict=True)):
        text = f"average includes {refused} of {len(hits)} hits that failed the checks"
        frf = acquisition.estimate_frf(good) if good[0].has_force else None
        return FileFrf(frf, good, remarks=(Remark("hits-accepted", "", text),), faults=faults, flags=flags)
    if good and not good[0].has_force:
        return FileFrf(None, good, faults=faults, flags=flags)
    try:
        return FileFrf(acquisition.read_frf(recording.path, description), good, faults=faults, flags=flags)
    except DataError:
        ringing = [hit for hit, found in zip(hits, faults, strict=True) if found == HitFlags.NOT_DECAYED]
        if not ringing or not hits[0].has_force:
            raise
        return _window_hits(ringing, faults)


def _window_hits(ringing: Sequence[Hit], faults: tuple[HitFlags, ...]) -> FileFrf:
    """Average the hits whose only fault is that they ring at the end, with our own window."""
    frf, windowed, tau = window_ringing_hits(ringing)
    cure = "Record longer, or use the hits without a window with fit_file_modes.accept not-decayed"
    flags = tuple(HitFlags.OK if found == HitFlags.NOT_DECAYED else found for found in faults)
    return FileFrf(frf, windowed, tau, (own_window_remark("", tau, cure),), faults=faults, flags=flags)


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
