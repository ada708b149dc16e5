"""Command `lobewatch ports`: list serial ports and the devices on them."""

from typing import Annotated

from typer import Option

from lobewatch.show.terminal.output import Json, emit


def ports(
    port: Annotated[str, Option(help="Only this port, pseudo-terminal or socket://HOST:PORT.")] = "",
    as_json: Json = False,
) -> None:
    """List serial ports and the devices that answer.

    Only USB ports are queried, and only by drivers for the USB vendor number of the port.

    Examples
    --------
      lobewatch ports
      lobewatch ports --port /dev/pts/3
    """
    from acquisition import scan_ports
    from lobewatch.show.sensors import ports_json, ports_texts

    survey = scan_ports(port)
    emit(ports_json(survey), as_json, *ports_texts(survey))
