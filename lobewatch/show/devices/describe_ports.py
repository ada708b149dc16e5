"""Serial ports as a table, sentences and JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.table import Table

from acquisition.devices import PortSurvey, SeenPort
from acquisition.ports import PortInfo, no_ports_hint
from lobewatch.show.terminal.output import table


def ports_json(survey: PortSurvey) -> dict[str, Any]:
    """Every port, and what is wrong with drivers."""
    return {"ports": [_port_json(one) for one in survey.seen], "remarks": [asdict(one) for one in survey.remarks]}


def ports_texts(survey: PortSurvey) -> list[str | Table]:
    """A table of the ports, what stands in the way, and the next step."""
    remarks = [f"{remark}." for remark in survey.remarks]
    if not survey.seen:
        return [no_ports_hint(), *remarks]
    problems = [one.problem for one in survey.seen if one.problem]
    return [_table(survey.seen), *problems, *remarks, _summary(survey.seen)]


def _usb(port: PortInfo) -> str:
    return "" if port.vendor is None else f"{port.vendor:04x}:{port.product or 0:04x}"


def _port_json(seen: SeenPort) -> dict[str, Any]:
    port, answer = seen.port, seen.answer
    return {
        "device": port.device,
        "usb": _usb(port),
        "serial_number": port.serial_number,
        "description": port.description,
        "answer": {"driver": answer.driver, **asdict(answer.identity)} if answer else None,
        "problem": seen.problem or None,
    }


def _table(seen: tuple[SeenPort, ...]) -> Table:
    made = table("<port", "<VID:PID", "<serial number", "<description", "<answer")
    for one in seen:
        port = one.port
        made.add_row(*map(escape, (port.device, _usb(port), port.serial_number, port.description, _answer(one))))
    return made


def _answer(seen: SeenPort) -> str:
    if seen.answer is None:
        return seen.text
    who = seen.answer.identity
    return f"{seen.answer.driver}: {who.model}, serial number {who.serial}, firmware {who.firmware}"


def _summary(seen: tuple[SeenPort, ...]) -> str:
    """How many answer, and the next step."""
    answering = [(one.port.device, one.answer.driver) for one in seen if one.answer]
    if not answering:
        return (
            "No DAQ answers. One that was just plugged in may need some seconds; a DATAQ device must blink yellow "
            "(CDC mode)."
        )
    port, driver = answering[0]
    return (
        f"{len(answering)} of {len(seen)} answer; next: lobewatch tap MACHINE --port {port}, "
        f'with driver = "{driver}" in [daq] of its machine.toml'
    )
