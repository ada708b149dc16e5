"""Command `lobewatch bridge`: serve any device as a TAPS/1 device on TCP."""

import json
from functools import partial
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from lobewatch.commands.shared_options import FolderArgument
from lobewatch.show.terminal.output import Json, notes, results


def bridge(
    driver: Annotated[str, Argument(help="Driver name, as in [daq] of machine.toml.")],
    machine: Annotated[
        Path | None, FolderArgument(help="Machine folder with port, sensors and sample rate in [daq].")
    ] = None,
    port: Annotated[str, Option(help="Port of the device. Default: [daq] port.")] = "",
    listen: Annotated[str, Option(help="IP address to listen on. 0.0.0.0: all addresses.")] = "127.0.0.1",
    tcp_port: Annotated[int, Option(min=0, max=65535, help="TCP port. 0: any free port.")] = 0,
    as_json: Json = False,
) -> None:
    """Serve a DAQ as a TAPS/1 device on TCP.

    Lost samples, overloads and button events are passed on to the other computer. While the device is unplugged, the
    other computer waits. There is no password: anyone who reaches the address can start and stop the device.

    Examples
    --------
      lobewatch bridge dataq mill-3 --port /dev/ttyACM0 --listen 0.0.0.0 --tcp-port 5025
      lobewatch tap mill-3 --port socket://10.0.0.5:5025  # on the other computer, with driver = "taps"
    """
    from acquisition import DataError, find_driver
    from acquisition.taps.bridge import TapsBridge
    from lobewatch.machine.folder import MachineFolder
    from lobewatch.machine.settings.setup_tables import DaqTable
    from lobewatch.tap.device_connection import DeviceOpener

    print_note = partial(notes.print, markup=False)
    folder, kind = None if machine is None else MachineFolder(machine), find_driver(driver)
    if folder is None and kind.sensor_data is None:
        cure = "Give a machine folder with [[daq.channel]] tables."
        raise DataError(f"{kind.title} does not describe its sensors. {cure}")
    daq = DaqTable(driver=driver) if folder is None else folder.machine.daq
    if folder is not None and daq.driver != driver:
        raise DataError(f'{folder.toml}: driver is "{daq.driver}", not "{driver}". Name the driver of this file.')
    port = port or daq.port
    if not port:
        raise ValueError("no port. Give --port, or a machine folder with port in [daq].")
    server = TapsBridge(DeviceOpener(daq, port).open, print_note, address=listen, number=tcp_port)
    identity = server.device.identity
    results.print(json.dumps({"port": server.port}) if as_json else f"port {server.port}", markup=False)
    results.file.flush()
    rate = f"{server.device.sample_rate:g} Hz"
    print_note(f"{identity.model} on {port}, {rate}. Tap with --port {server.port} (Ctrl-C ends the bridge)")
    server.run()
