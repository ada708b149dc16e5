"""Join the recordings of several files into one tap test."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count

from acquisition.errors import Remark, join_sentences
from acquisition.files.contents.contents import Fact
from acquisition.files.contents.join_hits import join_hits, make_left_out_remark
from acquisition.files.contents.recording import Recording
from acquisition.files.contents.units import parse_unit
from acquisition.hit import Hit


def join_recordings(recordings: Sequence[Recording]) -> Recording:
    """Join the hits of several files in their order, with a remark on each file and each hit that is left out.

    The result has the problems of the first file if no file can be used, and those of files that contradict each other.
    """
    usable = [recording for recording in recordings if recording.hits]
    if not usable:
        missing = [recording for recording in recordings if recording.facts]
        return _reject_frf((missing or recordings)[0])
    hits, remarks = dict[str, Hit](), list[Remark]()
    for recording in recordings:
        name = recording.path.name
        if recording.hits:
            remarks += recording.remarks
            hits |= _name_hits(recording, name, hits)
        else:
            remarks.append(make_left_out_remark(name, _reject_frf(recording).problems))
    joined, differing = join_hits(hits)
    n_files = Fact("files", f"{len(usable)} of {len(recordings)}", "option")
    n_hits = Fact("hits", f"{len(joined)} of {len(hits) + len(remarks)}", "file")
    facts = tuple(fact for fact in usable[0].facts if fact.name != "hits")
    created = min((recording.created for recording in usable if recording.created), default=None)
    problems = join_sentences(*_list_contradictions(usable))
    together = replace(usable[0], created=created, facts=(*facts, n_files, n_hits), problems=problems)
    remarks += [*differing, *_compare_units(usable)]
    left_out = {remark.about for remark in differing}
    places = tuple(place for place in hits if place not in left_out)
    return replace(together, hits=() if problems else tuple(joined), remarks=tuple(remarks), places=places)


def _compare_units(usable: Sequence[Recording]) -> Iterator[Remark]:
    """Yield a remark on each file with another unit than most of them."""
    units = [tuple(map(parse_unit, recording.units)) for recording in usable]
    usual = max(units, key=units.count)
    of_most = ", ".join(usable[units.index(usual)].units)
    for recording, unit in zip(usable, units, strict=True):
        if unit != usual:
            text = f"converted from {', '.join(recording.units)} instead of {of_most} as in the other files"
            yield Remark("units-differ", recording.path.name, text, "Check the units in this file")


def _name_hits(recording: Recording, name: str, earlier: dict[str, Hit]) -> dict[str, Hit]:
    """Return the hits of a file by their place, with the path of a second file of one name."""
    names = chain((name, str(recording.path)), (f"{recording.path} ({number})" for number in count(2)))
    free = next(name for name in names if f"{name}, hit 1" not in earlier)
    return {f"{free}, hit {number}": hit for number, hit in enumerate(recording.hits, 1)}


def _reject_frf(recording: Recording) -> Recording:
    """Return the recording with the problem that it has no hits to join."""
    if recording.problems:
        return recording
    problem = "the file has an FRF but no hits. A tap test of several files needs signals over time"
    return replace(recording, frf=None, problems=problem)


def _list_contradictions(usable: Sequence[Recording]) -> list[str]:
    """List what the files state differently although one tap test has one of it."""
    stated = {
        "direction": {recording.direction for recording in usable if recording.direction},
        "tool": {recording.tool for recording in usable if recording.tool},
        "window": {repr(recording.window) for recording in usable},
    }
    cure = "Name only files of one tap test"
    return [
        f"the files differ in {noun}: {', '.join(sorted(values))}. {cure}"
        for noun, values in stated.items()
        if len(values) > 1
    ]
