"""Find the hits in the signals of a file: axes of arrays, groups and numbered channels."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.column_headings import assign_columns, infer_role
from acquisition.files.contents.contents import Description, ImportReport, Signal
from acquisition.files.contents.resolve_hits import infer_kind
from acquisition.hit import MIN_SAMPLES

Signals = list[Signal]
AXES = ("hits", "channels", "samples")
"""Axes of an array of hits."""
_HIT_NUMBER = re.compile(
    r"(?<![^\W_])(?:tap|hit|impact|impulse|shot|blow|schlag|meas(?:urement)?|messung|run|rep(?:etition)?|trial|test"
    r"|rec(?:ord)?|average|avg)"
    r"[\s_.:#-]*(\d+)",
    re.IGNORECASE,
)
"""Number of a hit behind a word for it: "Hammer_tap_1", "run 3/force"."""
_LAST_NUMBER, _FIRST_NUMBER = re.compile(r"(\d+)(?!.*\d)"), re.compile(r"(\d+)")
_GROUP = re.compile(r"(.+)[/.](?=[^/.]+$)")
"""Group in a name: "first/force", "struct.force"."""
_BORDER = re.compile(r"^[\s_.:/#-]+|[\s_.:#-]+(?=[/.]|$)|/$")
"""Signs that are left where a number is taken out of a name."""


def suggest_axes(array: NDArray[Any]) -> tuple[str, ...]:
    """Return the likely axes of an array: most samples, and channels along the axis where the crest factor differs.

    A force is a short pulse in every hit, a response is not. Hits without any change do not count.
    """
    samples = int(np.argmax(array.shape))
    others = [axis for axis in range(3) if axis != samples]
    peaks = np.ma.array(np.max(np.abs(array), axis=samples), mask=np.ptp(array, axis=samples) == 0)
    crest = np.ma.log(peaks / np.std(array, axis=samples))
    spreads = [np.ma.filled(np.ma.std(crest.mean(axis=axis)), 0.0) for axis in (1, 0)]
    channels = others[int(np.argmax(spreads))]
    return tuple("samples" if axis == samples else "channels" if axis == channels else "hits" for axis in range(3))


def suggest_columns(signals: Sequence[Signal]) -> str:
    """Return an example of `Description.columns` for the signals of a hit: by their names, else a force first."""
    words = {"time": "time [s]", "force": "force [N]", "response": "acceleration [g]"}
    roles = [infer_role(re.split(r"[/.]", signal.name)[-1], signal.unit) for signal in signals]
    free = iter([role for role in ("force", "response") if role not in roles])
    return ",".join(words[role] if role in words else words.get(next(free, ""), "-") for role in roles)


def find_stack(signals: Sequence[Signal]) -> Signal | None:
    """Return the first column of a real array of three axes, none of length 1; None without one."""
    for signal in signals:
        array = signal.array
        if array is not None and not np.iscomplexobj(array) and np.squeeze(array).ndim > 2:
            return signal
    return None


class HitSignals(NamedTuple):
    """Signals of one hit."""

    signals: Signals
    """Signals with the roles and units of `Description.columns`."""
    report: ImportReport
    """Report of this hit."""


def split_hits(signals: Sequence[Signal], report: ImportReport) -> list[HitSignals]:
    """Return the signals of each hit without its zero padding.

    `Description.axes` splits arrays, `Description.one_test` splits records into groups and numbered channels.
    """
    if report.description.axes:
        signals = _split_arrays(signals, report)
    records: dict[int, Signals] = {}
    for signal in signals:
        records.setdefault(signal.record, []).append(signal)
    hits = list[HitSignals]()
    for record in records.values():
        one_test = report.description.one_test
        hits += _split_record(record, report.description) if one_test else [_assign(record, report.description)]
    return [hit._replace(signals=_trim_padding(hit.signals)) for hit in hits]


def _assign(signals: Sequence[Signal], description: Description) -> HitSignals:
    report = ImportReport(description)
    return HitSignals(list(assign_columns(tuple(signals), report)), report)


def _split_arrays(signals: Sequence[Signal], report: ImportReport) -> Signals:
    """Return the channels of each hit as a record, with the other signals of their length."""
    axes = report.description.axes
    if sorted(axes) != sorted(AXES):
        raise report.reject("axes", ",".join(axes), f"not {', '.join(AXES)}, each once, in the order of the array")
    stacks = _arrange_arrays(signals, axes, report)
    n_hits, _, n_samples = next(iter(stacks.values())).shape
    split = Signals()
    for hit in range(n_hits):
        done = set[int]()
        for signal in signals:
            stack = stacks.get(id(signal.array))
            if stack is None and signal.values.size == n_samples:
                split.append(replace(signal, record=hit))
            elif stack is not None and id(signal.array) not in done:
                done.add(id(signal.array))
                split += _make_channels(signal, stack[hit], hit)
    return split


def _arrange_arrays(signals: Sequence[Signal], axes: Sequence[str], report: ImportReport) -> Mapping[int, NDArray[Any]]:
    """Return the arrays of hits with the shape (hits, channels, samples), by the id of the array."""
    without_channels = [axis for axis in axes if axis != "channels"]
    arrays = {id(signal.array): signal.array for signal in signals if signal.array is not None}
    stacks = {key: array.transpose(list(map(axes.index, AXES))) for key, array in arrays.items() if array.ndim == 3}
    for key, array in arrays.items():
        if array.ndim == 2:
            rows = array.transpose([without_channels.index("hits"), without_channels.index("samples")])[:, None]
            like = next(iter(stacks.values()), rows)
            stacks |= {key: rows} if rows.shape[::2] == like.shape[::2] else {}
    sizes = {stack.shape[::2] for stack in stacks.values()}
    if len(sizes) > 1:
        listed = " and ".join(f"{hits} hits of {samples} samples" for hits, samples in sorted(sizes))
        raise report.reject("axes", ",".join(axes), f"the arrays differ: {listed}")
    if not stacks:
        raise report.reject_useless("axes", ",".join(axes), "the file has no array of two or three axes")
    _check_stacks([*stacks.values()], axes, report)
    return {key: stack.real for key, stack in stacks.items()}


def _check_stacks(stacks: Sequence[NDArray[Any]], axes: Sequence[str], report: ImportReport) -> None:
    if any(np.iscomplexobj(stack) and np.any(stack.imag) for stack in stacks):
        raise report.reject("axes", ",".join(axes), "the array is complex", "Export signals over time as real numbers")
    if (n := stacks[0].shape[2]) < MIN_SAMPLES:
        fault = f"{n} samples are too few for a hit, which needs at least {MIN_SAMPLES}"
        raise report.reject("axes", ",".join(axes), fault, "Check the order of the axes")


def _make_channels(column: Signal, channels: NDArray[Any], hit: int) -> Signals:
    """Return the channels of one hit: named as the array if there is one, else with their numbers."""
    name = column.name.rpartition(":")[0]
    names = [name] if len(channels) == 1 else [f"{name}:{i}" for i in range(1, len(channels) + 1)]
    made = zip(names, channels, strict=True)
    return [replace(column, name=name, values=values, record=hit, array=None) for name, values in made]


_Split = Callable[[str], tuple[str, str] | None]
"""Function that splits a name into the key of its hit and the name of its channel; None if the name has no key."""


def _split_by(pattern: re.Pattern[str]) -> _Split:
    def split(name: str) -> tuple[str, str] | None:
        match = pattern.search(name)
        return match and (match[1], _BORDER.sub("", name[: match.start(1)] + name[match.end() :]))

    return split


_SPLITS = tuple(map(_split_by, (_HIT_NUMBER, _GROUP, _LAST_NUMBER, _FIRST_NUMBER)))
"""Ways to name hits, the surest first."""


class NamedHits(NamedTuple):
    """Hits that the names of signals show."""

    hits: Sequence[Signals]
    """Signals of each hit, named by their channel."""
    shared: Signals
    """Signals of all hits."""
    channels: Mapping[str, str]
    """Name of the channel of each other signal."""
    is_named: bool
    """True if a word for a hit or a group is in the names."""

    @property
    def is_likely(self) -> bool:
        """True if the names or the kinds of the channels show that these are hits."""
        return self.is_named or any(map(infer_kind, self.hits[0]))

    def count_complete(self, *, needs_force: bool) -> int:
        """Count the hits with a response, and with one force where one is needed; unknown kinds may be it."""
        kinds = ([infer_kind(signal) for signal in hit if signal.role != "time"] for hit in self.hits)
        return sum(_is_complete(of_hit, needs_force=needs_force) for of_hit in kinds)


def _is_complete(kinds: Sequence[str], *, needs_force: bool) -> bool:
    if not needs_force:
        return bool(kinds)
    return len(kinds) > 1 and (kinds.count("force") == 1 or ("force" not in kinds and "" in kinds))


def find_named_hits(signals: Sequence[Signal], *, needs_force: bool) -> NamedHits | None:
    """Find the hits by the way of naming that gives most complete hits; None with fewer than two.

    Without a force, a bare number may also be that of a sensor.
    """
    splits = _SPLITS if needs_force else _SPLITS[:2]
    found = [_group_by_name(signals, split) for split in splits]
    best = max(found, key=lambda named: named.count_complete(needs_force=needs_force))
    return best if best.count_complete(needs_force=needs_force) > 1 else None


def _group_by_name(signals: Sequence[Signal], split: _Split) -> NamedHits:
    parts = {signal.name: split(signal.name) or ("", signal.name) for signal in signals}  # "Force", then "Force.1"
    keys: dict[str, set[str]] = {}
    for key, channel in parts.values():
        keys.setdefault(channel, set()).add(key)
    hits, shared, channels = dict[str, Signals](), Signals(), dict[str, str]()
    for signal in signals:
        key, channel = parts[signal.name]
        if len(keys[channel]) > 1:
            hits.setdefault(key, []).append(replace(signal, name=channel, array=None))
            channels[signal.name] = channel
        else:
            shared.append(signal)
    groups = {channel.rpartition("/")[0] for channel in channels.values()}
    common = f"{groups.pop()}/" if len(groups) == 1 else ""  # which says nothing without its number
    short = {channel: channel.removeprefix(common) for channel in channels.values()}
    named = [[replace(signal, name=short[signal.name]) for signal in hit] for hit in hits.values()]
    channels = {name: short[channel] for name, channel in channels.items()}
    return NamedHits(named, shared, channels, split in _SPLITS[:2])


def _split_record(record: Signals, description: Description) -> list[HitSignals]:
    """Split a record by the names of its signals, else by the order of its forces and responses."""
    columns, needs_force = description.columns, not description.without_force
    in_order = len(columns) >= len(record) and not any("=" in text for text in columns)
    named = None if in_order else find_named_hits(record, needs_force=needs_force)
    if named is None:
        whole = _assign(record, description)
        return [HitSignals(hit, whole.report) for hit in _pair_in_order(whole.signals)]
    headings = (text.partition("=") for text in columns)
    columns = tuple(f"{word}{sign}{named.channels.get(name.strip(), name)}" for word, sign, name in headings)
    return [_assign([*named.shared, *hit], replace(description, columns=columns)) for hit in named.hits]


def _pair_in_order(signals: Signals) -> list[Signals]:
    """Return a hit for each of several forces: the first force with the first response, and so on."""
    forces, responses = ([one for one in signals if infer_kind(one) == kind] for kind in ("force", "response"))
    times, n = [signal for signal in signals if signal.role == "time"], len(forces)
    if n < 2 or n != len(responses):
        return [signals]
    times = times if len(times) == n else times[:1] * n
    return [list(hit) for hit in zip(*([times] if times else []), forces, responses, strict=True)]


def _trim_padding(hit: Signals) -> Signals:
    """Remove the samples at the end where all channels are zero or NaN, as longer hits leave them."""
    channels = [signal.values for signal in hit if signal.role != "time"]
    n = max((values.size for values in channels), default=0)
    if not n or any(values.size != n for values in channels):
        return hit
    filled = np.flatnonzero(np.any([np.nan_to_num(values) != 0 for values in channels], axis=0))
    end = int(filled[-1]) + 1 if filled.size else n
    return [replace(signal, values=signal.values[:end]) if signal.values.size == n else signal for signal in hit]
