"""Command `lobewatch serve`: serve the dashboard of machines."""

import time

from lobewatch.commands.shared_options import FleetFolder
from lobewatch.show.terminal.output import HttpPort, Json, Listen, Token, WatchToken, show_address


def serve(
    folder: FleetFolder,
    listen: Listen = "127.0.0.1",
    http_port: HttpPort = 0,
    token: Token = None,
    watch_token: WatchToken = None,
    as_json: Json = False,
) -> None:
    """Serve the dashboard of machines.

    START begins a tap test on the port in machine.toml. "Hear a cut" evaluates a recording of a phone.
    Ctrl-C ends the server.

    Examples
    --------
      lobewatch serve mills
      lobewatch serve mills --listen 0.0.0.0 --http-port 8080
    """
    from lobewatch.screen import DashboardServer

    with DashboardServer(folder, listen=listen, port=http_port, token=token, watch_token=watch_token) as server:
        show_address(server.url, server.watch_url, as_json)
        while True:
            time.sleep(1)
