"""Format the status of machines for Prometheus (text format 0.0.4)."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence

from lobewatch.fleet.fleet import FleetMachine
from lobewatch.monitoring.status_rules import StatusLevel

PROMETHEUS_CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
SECONDS_PER_DAY = 86400.0
MetricSample = tuple[str, dict[str, str], float]
"""Family without its prefix, further labels, and the value in the unit of the metric."""
METRIC_FAMILIES = {
    "lobewatch_judged_timestamp_seconds": "Time of the last assessment.",
    "lobewatch_can_be_judged": "1 if the machine can be assessed, 0 if its files are unreadable.",
    "lobewatch_light": "1 for the status of the machine, 0 for all others.",
    "lobewatch_reasons": "Number of reasons for the status, by code.",
    "lobewatch_alarms": "Number of open alarms.",
    "lobewatch_alarms_acknowledged": "Number of open alarms that are acknowledged.",
    "lobewatch_alarm_raised_timestamp_seconds": "Start time of each open alarm.",
    "lobewatch_frequency_fall_ratio": "Frequency drop since the first tests, 0.05 for 5 %.",
    "lobewatch_frequency_hertz": "Newest natural frequency of the series.",
    "lobewatch_last_tap_timestamp_seconds": "Time of the newest tap test.",
    "lobewatch_tap_due_timestamp_seconds": "Due time of the next tap test.",
    "lobewatch_limit_timestamp_seconds": "Forecast time of a frequency-drop limit, missing if unknown.",
    "lobewatch_program_timestamp_seconds": "Forecast time of a new verdict on a program, missing if unknown.",
    "lobewatch_program_word": "1 for the verdict on each cutting program.",
}
"""Meaning of the metric families of machines, by name."""


def format_prometheus(machines: Sequence[FleetMachine]) -> str:
    """Format all metric families, including those without a sample."""
    samples = defaultdict[str, list[str]](list)
    for machine in machines:
        common = {"folder": machine.key, "machine": machine.summary.name}
        for family, labels, value in (*_sample_status(machine), *_sample_series(machine), *_sample_dates(machine)):
            name = f"lobewatch_{family}"
            samples[name].append(f"{name}{{{_format_labels(common | labels)}}} {value!r}")
    lines = ["# HELP lobewatch_up 1 while lobewatch answers.", "# TYPE lobewatch_up gauge", "lobewatch_up{} 1.0"]
    for name, meaning in METRIC_FAMILIES.items():
        lines += [f"# HELP {name} {meaning}", f"# TYPE {name} gauge", *samples[name]]
    return "\n".join(lines) + "\n"


def _format_labels(labels: Mapping[str, str]) -> str:
    return ",".join(f'{label}="{_escape_label(value)}"' for label, value in labels.items())


def _escape_label(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def _sample_status(machine: FleetMachine) -> Iterator[MetricSample]:
    """Yield the samples of status, reasons and alarms."""
    current, alarms = machine.current, machine.summary.alarms
    yield "judged_timestamp_seconds", {}, current.time.timestamp()
    yield "can_be_judged", {}, float(current.is_readable)
    for level in StatusLevel:
        yield "light", {"light": level.value}, float(current.status is level)
    for code, count in Counter(remark.code for remark in current.remarks).items():
        yield "reasons", {"code": code}, float(count)
    yield "alarms", {}, float(len(alarms))
    yield "alarms_acknowledged", {}, float(sum(alarm.is_acknowledged(current.time) for alarm in alarms))
    for alarm in alarms:
        labels = {"alarm": alarm.id, "code": alarm.code, "about": alarm.about}
        yield "alarm_raised_timestamp_seconds", labels, alarm.triggered_at.timestamp()


def _sample_series(machine: FleetMachine) -> Iterator[MetricSample]:
    """Yield the samples of series and programs."""
    for series in machine.summary.series:
        labels = {"tool": series.tool, "direction": series.direction}
        if series.drop is not None:
            yield "frequency_fall_ratio", labels, series.drop / 100.0
        if series.frequency is not None:
            yield "frequency_hertz", labels, series.frequency
    for program, verdict in machine.summary.programs_at(machine.current.time).items():
        yield "program_word", {"program": program, "word": verdict}, 1.0


def _sample_dates(machine: FleetMachine) -> Iterator[MetricSample]:
    """Yield the samples of the newest and the next tap test, and of the forecasts.

    A threshold that is reached already has the date of the newest tap test.
    """
    summary, last = machine.summary, machine.summary.time
    if last is not None:
        yield "last_tap_timestamp_seconds", {}, last.timestamp()
        yield "tap_due_timestamp_seconds", {}, last.timestamp() + SECONDS_PER_DAY * summary.interval_days
    dated = [("limit", {"fall_percent": f"{percent:g}"}, dates) for percent, dates in summary.limits]
    for program, forecast in summary.forecasts.items():
        dated.append(("program", {"program": program, "becomes": "doubtful"}, forecast.doubtful))
        dated.append(("program", {"program": program, "becomes": "not stable"}, forecast.not_stable))
    for kind, labels, dates in dated:
        if dates.is_measured and last is not None:
            yield f"{kind}_timestamp_seconds", labels, last.timestamp()
        elif dates.probable is not None:
            yield f"{kind}_timestamp_seconds", labels, SECONDS_PER_DAY * dates.probable
