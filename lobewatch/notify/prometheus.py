"""How machines stand, as Prometheus reads it (text format 0.0.4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from lobewatch.decay.light import Light
from lobewatch.plant.plant import MachineStanding

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
DAY = 86400.0
"""Seconds."""


class Sample(NamedTuple):
    """One value of a family."""

    labels: tuple[tuple[str, str], ...]
    """Names and values."""
    value: float
    """In the unit that the name of the family says."""


def prometheus_text(found: Sequence[MachineStanding]) -> str:
    """All families, those without a value too."""
    return "".join(
        f"# HELP {name} {told}\n# TYPE {name} gauge\n" + "".join(_line(name, one) for one in samples(found))
        for name, (told, samples) in FAMILIES.items()
    )


def _line(name: str, sample: Sample) -> str:
    labels = ",".join(f'{label}="{_escaped(value)}"' for label, value in sample.labels)
    return f"{name}{{{labels}}} {sample.value!r}\n"


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")


def _machine(one: MachineStanding) -> tuple[tuple[str, str], ...]:
    return ("folder", one.key), ("machine", one.summary.name)


def _lights(found: Iterable[MachineStanding]) -> Iterator[Sample]:
    for one in found:
        for light in Light:
            yield Sample((*_machine(one), ("light", light.value)), float(one.dated.light is light))


def _reasons(found: Iterable[MachineStanding]) -> Iterator[Sample]:
    for one in found:
        for code in dict.fromkeys(remark.code for remark in one.dated.remarks):
            count = sum(remark.code == code for remark in one.dated.remarks)
            yield Sample((*_machine(one), ("code", code)), float(count))


def _falls(found: Iterable[MachineStanding]) -> Iterator[Sample]:
    for one in found:
        for course in one.summary.series:
            if course.fall is not None:
                yield Sample(
                    (*_machine(one), ("tool", course.tool), ("direction", course.direction)), course.fall / 100
                )


def _frequencies(found: Iterable[MachineStanding]) -> Iterator[Sample]:
    for one in found:
        for course in one.summary.series:
            if course.frequency is not None:
                labels = (*_machine(one), ("tool", course.tool), ("direction", course.direction))
                yield Sample(labels, course.frequency)


def _taps(found: Iterable[MachineStanding]) -> Iterator[Sample]:
    return (Sample(_machine(one), one.summary.time.timestamp()) for one in found if one.summary.time is not None)


def _due(found: Iterable[MachineStanding]) -> Iterator[Sample]:
    for one in found:
        if one.summary.time is not None:
            yield Sample(_machine(one), one.summary.time.timestamp() + DAY * one.summary.interval_days)


def _limits(found: Iterable[MachineStanding]) -> Iterator[Sample]:
    for one in found:
        for course in one.summary.series:
            for limit in course.limits:
                if limit.probable is not None:
                    labels = (*_machine(one), ("tool", course.tool), ("direction", course.direction))
                    yield Sample((*labels, ("fall_percent", f"{limit.percent:g}")), DAY * limit.probable)


def _programs(found: Iterable[MachineStanding]) -> Iterator[Sample]:
    for one in found:
        for program, word in one.summary.programs.items():
            yield Sample((*_machine(one), ("program", program), ("word", word)), 1.0)


FAMILIES = {
    "lobewatch_light": ("1 for the light that the machine has, 0 for the others.", _lights),
    "lobewatch_reasons": ("How many reasons of a code the light has.", _reasons),
    "lobewatch_frequency_fall_ratio": ("Fall of the followed frequency since the first tests, 0.05 for 5 %.", _falls),
    "lobewatch_frequency_hertz": ("Followed frequency at the newest point of its series.", _frequencies),
    "lobewatch_last_tap_timestamp_seconds": ("When the machine was tapped last.", _taps),
    "lobewatch_tap_due_timestamp_seconds": ("When the next tap test is due.", _due),
    "lobewatch_limit_timestamp_seconds": ("When a fixed limit is probably reached; none where not in sight.", _limits),
    "lobewatch_program_word": ("1 for the word on each cutting program.", _programs),
}
"""Names, what they say, and their values."""
