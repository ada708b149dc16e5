"""Standings of machines, as Prometheus reads them (text format 0.0.4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from lobewatch.fleet.fleet import FleetMachine
from lobewatch.fleet.machine_summary import SeriesSummary
from lobewatch.monitoring.status_rules import StatusLevel
from lobewatch.monitoring.threshold_dates import ThresholdDates

PROMETHEUS_CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
SECONDS_PER_DAY = 86400.0
"""Length of a day (s)."""
MetricLabels = tuple[tuple[str, str], ...]
"""Names and values of labels."""


class MetricSample(NamedTuple):
    """One value of a family."""

    labels: MetricLabels
    """Names and values of its labels."""
    value: float
    """Value in the unit that the name of the family says."""


def format_prometheus(standings: Sequence[FleetMachine]) -> str:
    """Text of all families, those without a value too."""
    return "".join(
        f"# HELP {name} {meaning}\n# TYPE {name} gauge\n"
        + "".join(_format_sample(name, sample) for sample in samples(standings))
        for name, (meaning, samples) in METRIC_FAMILIES.items()
    )


def _format_sample(name: str, sample: MetricSample) -> str:
    labels = ",".join(f'{label}="{_escape_label(value)}"' for label, value in sample.labels)
    return f"{name}{{{labels}}} {sample.value!r}\n"


def _escape_label(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def _label_machine(standing: FleetMachine) -> MetricLabels:
    return ("folder", standing.key), ("machine", standing.summary.name)


def _label_series(standings: Iterable[FleetMachine]) -> Iterator[tuple[MetricLabels, SeriesSummary]]:
    """All series, each with its labels."""
    for standing in standings:
        for series in standing.summary.series:
            yield (*_label_machine(standing), ("tool", series.tool), ("direction", series.direction)), series


def _sample_status(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        for light in StatusLevel:
            yield MetricSample(
                (*_label_machine(standing), ("light", light.value)), float(standing.current.status is light)
            )


def _sample_reasons(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        for code in dict.fromkeys(remark.code for remark in standing.current.remarks):
            count = sum(remark.code == code for remark in standing.current.remarks)
            yield MetricSample((*_label_machine(standing), ("code", code)), float(count))


def _sample_drops(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    return (
        MetricSample(labels, series.drop / 100)
        for labels, series in _label_series(standings)
        if series.drop is not None
    )


def _sample_frequencies(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    return (
        MetricSample(labels, series.frequency)
        for labels, series in _label_series(standings)
        if series.frequency is not None
    )


def _sample_up(_standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    yield MetricSample((), 1.0)


def _sample_evaluation_times(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    return (MetricSample(_label_machine(standing), standing.current.time.timestamp()) for standing in standings)


def _sample_readable(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    return (MetricSample(_label_machine(standing), float(standing.current.is_readable)) for standing in standings)


def _sample_alarms(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    return (MetricSample(_label_machine(standing), float(len(standing.summary.alarms))) for standing in standings)


def _sample_acknowledged(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        quiet = [alarm for alarm in standing.summary.alarms if alarm.is_acknowledged(standing.current.time)]
        yield MetricSample(_label_machine(standing), float(len(quiet)))


def _sample_alarm_times(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        for alarm in standing.summary.alarms:
            labels = ("alarm", alarm.id), ("code", alarm.code), ("about", alarm.about)
            yield MetricSample((*_label_machine(standing), *labels), alarm.triggered_at.timestamp())


def _sample_last_taps(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        if standing.summary.time is not None:
            yield MetricSample(_label_machine(standing), standing.summary.time.timestamp())


def _sample_due_dates(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        if standing.summary.time is not None:
            yield MetricSample(
                _label_machine(standing),
                standing.summary.time.timestamp() + SECONDS_PER_DAY * standing.summary.interval_days,
            )


def _sample_limits(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        for percent, reach in standing.summary.limits:
            yield from _sample_reach(standing, (("fall_percent", f"{percent:g}"),), reach)


def _sample_program_forecasts(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        for program, fate in standing.summary.fates.items():
            for word, reach in (("doubtful", fate.doubtful), ("not stable", fate.not_stable)):
                yield from _sample_reach(standing, (("program", program), ("becomes", word)), reach)


def _sample_reach(standing: FleetMachine, labels: MetricLabels, reach: ThresholdDates) -> Iterator[MetricSample]:
    """The probable date; the last tap test where that shows it already."""
    last = standing.summary.time
    if reach.is_measured and last is not None:
        yield MetricSample((*_label_machine(standing), *labels), last.timestamp())
    elif reach.probable is not None:
        yield MetricSample((*_label_machine(standing), *labels), SECONDS_PER_DAY * reach.probable)


def _sample_verdicts(standings: Iterable[FleetMachine]) -> Iterator[MetricSample]:
    for standing in standings:
        for program, word in standing.summary.programs.items():
            yield MetricSample((*_label_machine(standing), ("program", program), ("word", word)), 1.0)


METRIC_FAMILIES = {
    "lobewatch_up": ("1 as long as anybody answers.", _sample_up),
    "lobewatch_judged_timestamp_seconds": ("When the machine was judged last.", _sample_evaluation_times),
    "lobewatch_can_be_judged": (
        "1 where the machine can be judged, 0 where its files do not let.",
        _sample_readable,
    ),
    "lobewatch_light": ("1 for the light that the machine has, 0 for the others.", _sample_status),
    "lobewatch_reasons": ("How many reasons of a code the light has.", _sample_reasons),
    "lobewatch_alarms": ("How many alarms are open.", _sample_alarms),
    "lobewatch_alarms_acknowledged": ("How many of them a person has acknowledged.", _sample_acknowledged),
    "lobewatch_alarm_raised_timestamp_seconds": ("When each open alarm was raised.", _sample_alarm_times),
    "lobewatch_frequency_fall_ratio": (
        "Fall of the followed frequency since the first tests, 0.05 for 5 %.",
        _sample_drops,
    ),
    "lobewatch_frequency_hertz": ("Followed frequency at the newest point of its series.", _sample_frequencies),
    "lobewatch_last_tap_timestamp_seconds": ("When the machine was tapped last.", _sample_last_taps),
    "lobewatch_tap_due_timestamp_seconds": ("When the next tap test is due.", _sample_due_dates),
    "lobewatch_limit_timestamp_seconds": (
        "When a fixed limit is probably reached; none where not in sight.",
        _sample_limits,
    ),
    "lobewatch_program_timestamp_seconds": (
        "When a program probably becomes doubtful, or not stable; none where not in sight.",
        _sample_program_forecasts,
    ),
    "lobewatch_program_word": ("1 for the word on each cutting program.", _sample_verdicts),
}
"""Families by name: meaning, and function that yields the samples."""
