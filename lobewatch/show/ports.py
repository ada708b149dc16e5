"""Show serial ports and the devices that answer on them."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.table import Table

from acquisition.devices import PortScan, ScannedPort
from acquisition.ports import PortInfo, explain_no_ports
from lobewatch.show.terminal.output import new_table


def ports_json(survey: PortScan) -> dict[str, Any]:
    """Every port, and what is wrong with drivers."""
    return {
        "ports": [_port_json(listed) for listed in survey.ports],
        "remarks": [asdict(remark) for remark in survey.remarks],
    }


def ports_texts(survey: PortScan) -> list[str | Table]:
    """A table of the ports, what stands in the way, and the next step."""
    remarks = [f"{remark}." for remark in survey.remarks]
    if not survey.ports:
        return [explain_no_ports(), *remarks]
    problems = [listed.problem for listed in survey.ports if listed.problem]
    return [_ports_table(survey.ports), *problems, *remarks, _ports_summary(survey.ports)]


def _usb_id(port: PortInfo) -> str:
    return "" if port.vendor is None else f"{port.vendor:04x}:{port.product or 0:04x}"


def _port_json(listed: ScannedPort) -> dict[str, Any]:
    port, answer = listed.port, listed.answer
    return {
        "device": port.device,
        "usb": _usb_id(port),
        "serial_number": port.serial_number,
        "description": port.description,
        "answer": {"driver": answer.driver, **asdict(answer.identity), "tried_on_hardware": answer.is_hardware_tested}
        if answer
        else None,
        "problem": listed.problem or None,
    }


def _ports_table(ports: tuple[ScannedPort, ...]) -> Table:
    rows = new_table("<port", "<VID:PID", "<serial number", "<description", "<answer")
    for listed in ports:
        port = listed.port
        rows.add_row(
            *map(escape, (port.device, _usb_id(port), port.serial_number, port.description, _answer_text(listed)))
        )
    return rows


def _answer_text(listed: ScannedPort) -> str:
    if listed.answer is None:
        return listed.text
    who = listed.answer.identity
    words = [f"{listed.answer.driver}: {who.model}"]
    words += [f"serial number {who.serial}"] if who.serial else []
    words += [f"firmware {who.firmware}"] if who.firmware else []
    return ", ".join([*words, *([] if listed.answer.is_hardware_tested else ["not tried on hardware"])])


def _ports_summary(ports: tuple[ScannedPort, ...]) -> str:
    """How many answer, and the next step."""
    answering = [(listed.port.device, listed.answer.driver) for listed in ports if listed.answer]
    if not answering:
        return (
            "No DAQ answers. One that was just plugged in may need some seconds; a DATAQ device must blink yellow "
            "(CDC mode)."
        )
    port, driver = answering[0]
    return (
        f"{len(answering)} of {len(ports)} answer; next: lobewatch tap MACHINE --port {port}, "
        f'with driver = "{driver}" in [daq] of its machine.toml'
    )
