"""Standings of machines, as Prometheus reads them (text format 0.0.4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from lobewatch.decay.light import Light
from lobewatch.decay.reach import Reach
from lobewatch.plant.plant import MachineStanding
from lobewatch.plant.summary import SeriesSummary

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
DAY = 86400.0
"""Length of a day (s)."""
Labels = tuple[tuple[str, str], ...]
"""Names and values of labels."""


class Sample(NamedTuple):
    """One value of a family."""

    labels: Labels
    """Names and values of its labels."""
    value: float
    """Value in the unit that the name of the family says."""


def prometheus_text(standings: Sequence[MachineStanding]) -> str:
    """Text of all families, those without a value too."""
    return "".join(
        f"# HELP {name} {meaning}\n# TYPE {name} gauge\n"
        + "".join(_line(name, sample) for sample in samples(standings))
        for name, (meaning, samples) in FAMILIES.items()
    )


def _line(name: str, sample: Sample) -> str:
    labels = ",".join(f'{label}="{_escape(value)}"' for label, value in sample.labels)
    return f"{name}{{{labels}}} {sample.value!r}\n"


def _escape(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def _machine(standing: MachineStanding) -> Labels:
    return ("folder", standing.key), ("machine", standing.summary.name)


def _labelled_series(standings: Iterable[MachineStanding]) -> Iterator[tuple[Labels, SeriesSummary]]:
    """All series, each with its labels."""
    for standing in standings:
        for series in standing.summary.series:
            yield (*_machine(standing), ("tool", series.tool), ("direction", series.direction)), series


def _lights(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        for light in Light:
            yield Sample((*_machine(standing), ("light", light.value)), float(standing.dated.light is light))


def _reasons(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        for code in dict.fromkeys(remark.code for remark in standing.dated.remarks):
            count = sum(remark.code == code for remark in standing.dated.remarks)
            yield Sample((*_machine(standing), ("code", code)), float(count))


def _falls(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    return (
        Sample(labels, series.fall / 100) for labels, series in _labelled_series(standings) if series.fall is not None
    )


def _frequencies(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    return (
        Sample(labels, series.frequency)
        for labels, series in _labelled_series(standings)
        if series.frequency is not None
    )


def _up(_standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    yield Sample((), 1.0)


def _judged(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    return (Sample(_machine(standing), standing.dated.time.timestamp()) for standing in standings)


def _judgeable(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    return (Sample(_machine(standing), float(standing.dated.can_be_judged)) for standing in standings)


def _alarms(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    return (Sample(_machine(standing), float(len(standing.summary.alarms))) for standing in standings)


def _acknowledged(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        quiet = [alarm for alarm in standing.summary.alarms if alarm.is_quiet(standing.dated.time)]
        yield Sample(_machine(standing), float(len(quiet)))


def _open_alarms(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        for alarm in standing.summary.alarms:
            labels = ("alarm", alarm.id), ("code", alarm.code), ("about", alarm.about)
            yield Sample((*_machine(standing), *labels), alarm.raised.timestamp())


def _taps(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        if standing.summary.time is not None:
            yield Sample(_machine(standing), standing.summary.time.timestamp())


def _due(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        if standing.summary.time is not None:
            yield Sample(_machine(standing), standing.summary.time.timestamp() + DAY * standing.summary.interval_days)


def _limits(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        for percent, reach in standing.summary.limits:
            yield from _reached(standing, (("fall_percent", f"{percent:g}"),), reach)


def _fates(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        for program, fate in standing.summary.fates.items():
            for word, reach in (("doubtful", fate.doubtful), ("not stable", fate.not_stable)):
                yield from _reached(standing, (("program", program), ("becomes", word)), reach)


def _reached(standing: MachineStanding, labels: Labels, reach: Reach) -> Iterator[Sample]:
    """The probable date; the last tap test where that shows it already."""
    last = standing.summary.time
    if reach.is_measured and last is not None:
        yield Sample((*_machine(standing), *labels), last.timestamp())
    elif reach.probable is not None:
        yield Sample((*_machine(standing), *labels), DAY * reach.probable)


def _programs(standings: Iterable[MachineStanding]) -> Iterator[Sample]:
    for standing in standings:
        for program, word in standing.summary.programs.items():
            yield Sample((*_machine(standing), ("program", program), ("word", word)), 1.0)


FAMILIES = {
    "lobewatch_up": ("1 as long as anybody answers.", _up),
    "lobewatch_judged_timestamp_seconds": ("When the machine was judged last.", _judged),
    "lobewatch_can_be_judged": (
        "1 where the machine can be judged, 0 where its files do not let.",
        _judgeable,
    ),
    "lobewatch_light": ("1 for the light that the machine has, 0 for the others.", _lights),
    "lobewatch_reasons": ("How many reasons of a code the light has.", _reasons),
    "lobewatch_alarms": ("How many alarms are open.", _alarms),
    "lobewatch_alarms_acknowledged": ("How many of them a person has acknowledged.", _acknowledged),
    "lobewatch_alarm_raised_timestamp_seconds": ("When each open alarm was raised.", _open_alarms),
    "lobewatch_frequency_fall_ratio": ("Fall of the followed frequency since the first tests, 0.05 for 5 %.", _falls),
    "lobewatch_frequency_hertz": ("Followed frequency at the newest point of its series.", _frequencies),
    "lobewatch_last_tap_timestamp_seconds": ("When the machine was tapped last.", _taps),
    "lobewatch_tap_due_timestamp_seconds": ("When the next tap test is due.", _due),
    "lobewatch_limit_timestamp_seconds": ("When a fixed limit is probably reached; none where not in sight.", _limits),
    "lobewatch_program_timestamp_seconds": (
        "When a program probably becomes doubtful, or not stable; none where not in sight.",
        _fates,
    ),
    "lobewatch_program_word": ("1 for the word on each cutting program.", _programs),
}
"""Families by name: meaning, and function that yields the samples."""
