"""Show serial ports and the devices that answer on them."""

from __future__ import annotations

from rich.markup import escape

from acquisition.devices import PortScan, ScannedPort
from acquisition.ports import PortInfo, explain_no_ports
from lobewatch.show.terminal.output import Texts, json_fields, new_table

NO_ANSWER_TEXT = (
    "No DAQ answers. One that was just plugged in may need some seconds; a DATAQ device must blink yellow (CDC mode)."
)


def ports_texts(scan: PortScan) -> Texts:
    """Return a table of the ports, their problems, and the next step."""
    remarks = [f"{remark}." for remark in scan.remarks]
    if not scan.ports:
        return [explain_no_ports(), *remarks]
    headings = "<port", "<VID:PID", "<serial number", "<description", "<answer"
    rows = (
        map(escape, (port.device, _usb_id(port), port.serial_number, port.description, _answer_text(scanned)))
        for scanned in scan.ports
        for port in [scanned.port]
    )
    problems = [scanned.problem for scanned in scan.ports if scanned.problem]
    return [new_table(*headings, rows=rows), *problems, *remarks, _ports_summary(scan.ports)]


def _usb_id(port: PortInfo) -> str:
    return "" if port.vendor is None else f"{port.vendor:04x}:{port.product or 0:04x}"


ANSWER_FIELDS = json_fields("""
    driver model=identity.model serial=identity.serial firmware=identity.firmware tried_on_hardware=is_hardware_tested
""")
PORT_FIELDS = json_fields(
    "device=port.device usb=port serial_number=port.serial_number description=port.description answer problem",
    {"usb": _usb_id, "answer": ANSWER_FIELDS, "problem": lambda problem: problem or None},
)
ports_json = json_fields("ports remarks", {"ports": PORT_FIELDS})
"""Function that returns every port with the device that answers, and what is wrong with drivers."""


def _answer_text(scanned: ScannedPort) -> str:
    answer = scanned.answer
    if answer is None:
        return scanned.text
    serial, firmware = answer.identity.serial, answer.identity.firmware
    words = [f"{answer.driver}: {answer.identity.model}", serial and f"serial number {serial}"]
    words += [firmware and f"firmware {firmware}", "" if answer.is_hardware_tested else "not tried on hardware"]
    return ", ".join(filter(None, words))


def _ports_summary(ports: tuple[ScannedPort, ...]) -> str:
    """Return how many devices answer, and the next step."""
    answering = [(listed.port.device, listed.answer.driver) for listed in ports if listed.answer]
    if not answering:
        return NO_ANSWER_TEXT
    port, driver = answering[0]
    following = f'lobewatch tap MACHINE --port {port}, with driver = "{driver}" in [daq] of its machine.toml'
    return f"{len(answering)} of {len(ports)} answer; next: {following}"
