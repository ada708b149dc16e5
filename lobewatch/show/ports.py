"""Show serial ports and the devices that answer on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.table import Table

from acquisition.devices import PortScan, ScannedPort
from acquisition.ports import PortInfo, explain_no_ports
from lobewatch.show.terminal.output import new_table


def ports_json(scan: PortScan) -> dict[str, Any]:
    """Return every port with the device that answers, and what is wrong with drivers."""
    return {"ports": [_port_json(scanned) for scanned in scan.ports], "remarks": scan.remarks}


def ports_texts(scan: PortScan) -> list[str | Table]:
    """Return a table of the ports, their problems, and the next step."""
    remarks = [f"{remark}." for remark in scan.remarks]
    if not scan.ports:
        return [explain_no_ports(), *remarks]
    headings = "<port", "<VID:PID", "<serial number", "<description", "<answer"
    problems = [scanned.problem for scanned in scan.ports if scanned.problem]
    table = new_table(*headings, rows=map(_port_cells, scan.ports))
    return [table, *problems, *remarks, _ports_summary(scan.ports)]


def _usb_id(port: PortInfo) -> str:
    return "" if port.vendor is None else f"{port.vendor:04x}:{port.product or 0:04x}"


def _port_json(scanned: ScannedPort) -> dict[str, Any]:
    port, answer = scanned.port, scanned.answer
    return {
        "device": port.device,
        "usb": _usb_id(port),
        "serial_number": port.serial_number,
        "description": port.description,
        "answer": answer
        and {"driver": answer.driver, **asdict(answer.identity), "tried_on_hardware": answer.is_hardware_tested},
        "problem": scanned.problem or None,
    }


def _port_cells(scanned: ScannedPort) -> Iterator[str]:
    port = scanned.port
    return map(escape, (port.device, _usb_id(port), port.serial_number, port.description, _answer_text(scanned)))


def _answer_text(scanned: ScannedPort) -> str:
    answer = scanned.answer
    if answer is None:
        return scanned.text
    serial, firmware = answer.identity.serial, answer.identity.firmware
    words = (
        f"{answer.driver}: {answer.identity.model}",
        serial and f"serial number {serial}",
        firmware and f"firmware {firmware}",
        "" if answer.is_hardware_tested else "not tried on hardware",
    )
    return ", ".join(filter(None, words))


def _ports_summary(ports: tuple[ScannedPort, ...]) -> str:
    """Return how many devices answer, and the next step."""
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
