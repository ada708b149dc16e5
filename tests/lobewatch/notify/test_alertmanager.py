"""The configuration of docs/alarms.md in Alertmanager itself: who gets a mail and a call, and who does not."""

from __future__ import annotations

import http.client
import http.server
import json
import os
import re
import shutil
import socket
import socketserver
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

PAGE = (Path(__file__).parents[3] / "docs" / "alarms.md").read_text("utf-8")
(CONFIG,) = (
    block for block in re.findall(r"^```yaml\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE) if "receivers:" in block
)
MANAGER = shutil.which("prometheus-alertmanager") or shutil.which("alertmanager")
LONG = 60
"""Time after which a message is taken for lost (s)."""


class Mails(socketserver.StreamRequestHandler):
    """SMTP server (RFC 5321) that can only receive mails."""

    def handle(self) -> None:
        server: Any = self.server
        self.wfile.write(b"220 sink\r\n")
        while line := self.rfile.readline().strip():
            if line.upper() == b"DATA":
                self.wfile.write(b"354 go on\r\n")
                lines = list(iter(self.rfile.readline, b".\r\n"))
                server.received.append(b"".join(lines).decode())
            self.wfile.write(b"221 bye\r\n" if line.upper() == b"QUIT" else b"250 ok\r\n")


class Calls(http.server.BaseHTTPRequestHandler):
    """Accept all posts."""

    def do_POST(self) -> None:
        server: Any = self.server
        server.received.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Nothing."""


@contextmanager
def serving(handler: type[socketserver.BaseRequestHandler]) -> Iterator[tuple[int, list[Any]]]:
    """Port, and the posts received there."""
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), handler) as server:
        server.daemon_threads = True
        received = list[Any]()
        vars(server)["received"] = received
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield server.server_address[1], received
        server.shutdown()


def post(port: int, alerts: list[dict[str, Any]]) -> None:
    """Post as Prometheus does; ConnectionError until a server listens."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    try:
        connection.request("POST", "/api/v2/alerts", json.dumps(alerts), {"Content-Type": "application/json"})
        assert connection.getresponse().status == 200
    finally:
        connection.close()


def wait_for(received: list[Any]) -> None:
    end = time.monotonic() + LONG
    while not received:
        assert time.monotonic() < end
        time.sleep(0.1)


def alert(name: str, folder: str) -> dict[str, Any]:
    return {"labels": {"alertname": name, "folder": folder, "machine": folder}}


@pytest.mark.skipif(MANAGER is None and not os.environ.get("CI"), reason="Alertmanager is not installed")
def test_an_alarm_is_mailed_once_a_machine_and_not_where_it_is_acknowledged(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with serving(Mails) as (smtp, mails), serving(Calls) as (web, calls):
        config = CONFIG.replace("mail.plant.example:25", f"127.0.0.1:{smtp}").replace(":9095", f":{web}")
        config = config.replace("group_wait: 1m", "group_wait: 1s")
        (tmp_path / "config.yml").write_text(config, "utf-8")
        command = [str(MANAGER), f"--config.file={tmp_path}/config.yml", f"--storage.path={tmp_path}/data"]
        command += [f"--web.listen-address=127.0.0.1:{port}", "--cluster.listen-address="]
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
            try:
                end = time.monotonic() + LONG
                while True:
                    try:
                        post(port, [alert("SpindleAlarmAcknowledged", "known")])
                        break
                    except OSError:
                        assert time.monotonic() < end
                        time.sleep(0.1)
                names = [("SpindleAlarm", "known"), ("SpindleAlarm", "worn"), ("TapTestOverdue", "worn")]
                post(port, [alert(*name) for name in names])
                wait_for(mails)
                wait_for(calls)
            finally:
                process.terminate()
    assert [call["groupLabels"] for call in calls] == [{"folder": "worn"}]
    assert {one["labels"]["alertname"] for one in calls[0]["alerts"]} == {"SpindleAlarm", "TapTestOverdue"}
    (mail,) = mails
    assert re.search(r"^Subject: \[FIRING:2\].*worn", mail, re.MULTILINE), mail[:500]
    assert not [one for one in mails if "known" in one]
