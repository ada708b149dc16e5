"""Format the status of machines for Prometheus (text format 0.0.4)."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import chain

from lobewatch.fleet.fleet import FleetMachine
from lobewatch.monitoring.status_rules import StatusLevel
from lobewatch.monitoring.threshold_dates import ThresholdDates

PROMETHEUS_CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
SECONDS_PER_DAY = 86400.0
MetricLabels = tuple[tuple[str, str], ...]
"""Names and values of labels."""
MetricSamples = Iterable[tuple[MetricLabels, float]]
"""Samples of one machine: further labels, and the value in the unit of the metric."""


def format_prometheus(machines: Sequence[FleetMachine]) -> str:
    """Format all metric families, including those without a sample."""
    lines = ["# HELP lobewatch_up 1 as long as anybody answers.", "# TYPE lobewatch_up gauge", "lobewatch_up{} 1.0"]
    for name, (meaning, sample) in METRIC_FAMILIES.items():
        lines += [f"# HELP {name} {meaning}", f"# TYPE {name} gauge"]
        for machine in machines:
            common = (("folder", machine.key), ("machine", machine.summary.name))
            lines += [f"{name}{{{_format_labels((*common, *labels))}}} {value!r}" for labels, value in sample(machine)]
    return "\n".join(lines) + "\n"


def _format_labels(labels: MetricLabels) -> str:
    return ",".join(f'{label}="{_escape_label(value)}"' for label, value in labels)


def _escape_label(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def _sample_series(machine: FleetMachine, field: str, scale: float = 1.0) -> MetricSamples:
    for series in machine.summary.series:
        value = getattr(series, field)
        if value is not None:
            yield (("tool", series.tool), ("direction", series.direction)), value / scale


def _sample_last_tap(machine: FleetMachine, added_days: float = 0.0) -> MetricSamples:
    if machine.summary.time is not None:
        yield (), machine.summary.time.timestamp() + SECONDS_PER_DAY * added_days


def _sample_program_forecasts(machine: FleetMachine) -> MetricSamples:
    for program, forecast in machine.summary.forecasts.items():
        for verdict, dates in (("doubtful", forecast.doubtful), ("not stable", forecast.not_stable)):
            yield from _sample_date(machine, (("program", program), ("becomes", verdict)), dates)


def _sample_date(machine: FleetMachine, labels: MetricLabels, dates: ThresholdDates) -> MetricSamples:
    """Yield the probable date, or that of the newest tap test if the threshold is reached already."""
    last = machine.summary.time
    if dates.is_measured and last is not None:
        yield labels, last.timestamp()
    elif dates.probable is not None:
        yield labels, SECONDS_PER_DAY * dates.probable


METRIC_FAMILIES: dict[str, tuple[str, Callable[[FleetMachine], MetricSamples]]] = {
    "lobewatch_judged_timestamp_seconds": (
        "When the machine was judged last.",
        lambda m: [((), m.current.time.timestamp())],
    ),
    "lobewatch_can_be_judged": (
        "1 where the machine can be judged, 0 where its files do not let.",
        lambda m: [((), float(m.current.is_readable))],
    ),
    "lobewatch_light": (
        "1 for the light that the machine has, 0 for the others.",
        lambda m: [((("light", level.value),), float(m.current.status is level)) for level in StatusLevel],
    ),
    "lobewatch_reasons": (
        "How many reasons of a code the light has.",
        lambda m: [
            ((("code", code),), float(count))
            for code, count in Counter(remark.code for remark in m.current.remarks).items()
        ],
    ),
    "lobewatch_alarms": ("How many alarms are open.", lambda m: [((), float(len(m.summary.alarms)))]),
    "lobewatch_alarms_acknowledged": (
        "How many of them a person has acknowledged.",
        lambda m: [((), float(sum(alarm.is_acknowledged(m.current.time) for alarm in m.summary.alarms)))],
    ),
    "lobewatch_alarm_raised_timestamp_seconds": (
        "When each open alarm was raised.",
        lambda m: [
            ((("alarm", alarm.id), ("code", alarm.code), ("about", alarm.about)), alarm.triggered_at.timestamp())
            for alarm in m.summary.alarms
        ],
    ),
    "lobewatch_frequency_fall_ratio": (
        "Fall of the followed frequency since the first tests, 0.05 for 5 %.",
        lambda m: _sample_series(m, "drop", 100.0),
    ),
    "lobewatch_frequency_hertz": (
        "Followed frequency at the newest point of its series.",
        lambda m: _sample_series(m, "frequency"),
    ),
    "lobewatch_last_tap_timestamp_seconds": ("When the machine was tapped last.", _sample_last_tap),
    "lobewatch_tap_due_timestamp_seconds": (
        "When the next tap test is due.",
        lambda m: _sample_last_tap(m, m.summary.interval_days),
    ),
    "lobewatch_limit_timestamp_seconds": (
        "When a fixed limit is probably reached; none where not in sight.",
        lambda m: chain.from_iterable(
            _sample_date(m, (("fall_percent", f"{percent:g}"),), dates) for percent, dates in m.summary.limits
        ),
    ),
    "lobewatch_program_timestamp_seconds": (
        "When a program probably becomes doubtful, or not stable; none where not in sight.",
        _sample_program_forecasts,
    ),
    "lobewatch_program_word": (
        "1 for the word on each cutting program.",
        lambda m: [((("program", name), ("word", verdict)), 1.0) for name, verdict in m.summary.programs.items()],
    ),
}
"""Metric families of machines by name: meaning, and function that yields the samples of a machine."""
