"""lobewatch ports."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

from acquisition import DeviceError, DeviceIdentity, PortInfo, list_ports, no_ports_hint, probe_port
from lobewatch.show.output import Json, emit, table


@dataclass(frozen=True)
class _Seen:
    """A port and what came of asking there."""

    port: PortInfo
    answer: DeviceIdentity | None = None
    text: str = ""
    """What stands in the table where nobody answers."""
    problem: str = ""
    """Why it could not be asked, a sentence with the cure."""

    @property
    def row(self) -> tuple[str, ...]:
        who = self.answer
        text = f"{who.driver}: {who.model}, serial number {who.serial}, firmware {who.firmware}" if who else self.text
        return self.port.device, _usb(self.port), self.port.serial_number, self.port.description, text


def ports(
    port: Annotated[str, typer.Option(help="Ask only here; also a pseudo-terminal or socket://HOST:PORT.")] = "",
    as_json: Json = False,
) -> None:
    """Serial ports, and which DAQ answers there.

    Only USB ports are asked, each once: a DATAQ device by its vendor number, all others whether they speak TAPS/1.

    Examples:

      lobewatch ports

      lobewatch ports --port /dev/pts/3
    """
    known = list_ports()
    if port:
        known = [one for one in known if one.device == port] or [PortInfo(port)]
    seen = [_ask(one, named=bool(port)) for one in known]
    problems = [one.problem for one in seen if one.problem]
    texts = [_table(seen), *problems, _summary(seen)] if seen else [no_ports_hint()]
    emit({"ports": [_json(one) for one in seen]}, as_json, *texts)


def _ask(port: PortInfo, named: bool) -> _Seen:
    if port.vendor is None and not named:
        return _Seen(port, text="not asked: no USB device")
    try:
        answer = probe_port(port.device, port.vendor)
    except DeviceError as error:
        return _Seen(port, text="cannot be opened", problem=str(error))
    return _Seen(port, answer, "no answer")


def _usb(port: PortInfo) -> str:
    return "" if port.vendor is None else f"{port.vendor:04x}:{port.product or 0:04x}"


def _json(seen: _Seen) -> dict[str, Any]:
    port = seen.port
    return {
        "device": port.device,
        "usb": _usb(port),
        "serial_number": port.serial_number,
        "description": port.description,
        "answer": asdict(seen.answer) if seen.answer else None,
        "problem": seen.problem or None,
    }


def _table(seen: list[_Seen]) -> Table:
    made = table("<port", "<VID:PID", "<serial number", "<description", "<answer")
    for one in seen:
        made.add_row(*map(escape, one.row))
    return made


def _summary(seen: list[_Seen]) -> str:
    """How many answer, and the next step."""
    answering = [one for one in seen if one.answer]
    if not answering:
        return (
            "No DAQ answers. One that was just plugged in may need some seconds; a DATAQ device must blink yellow "
            "(CDC mode)."
        )
    first = answering[0]
    driver = first.answer.driver if first.answer else ""
    return (
        f"{len(answering)} of {len(seen)} answer; next: lobewatch tap MACHINE --port {first.port.device}, "
        f'with driver = "{driver}" in [daq] of its machine.toml'
    )
