"""A real broker, and what it has received; machines that name a broker; commands."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from paho.mqtt import subscribe
from typer.testing import CliRunner, Result

from lobewatch.cli import app

PATHS = f"{os.environ['PATH']}:/usr/sbin:/usr/local/sbin"
MOSQUITTO, PASSWD = (shutil.which(name, path=PATHS) for name in ("mosquitto", "mosquitto_passwd"))

LONG = 90
"""Time after which a command is taken for hanging (s): far more than it needs on any computer."""


def machine(path: Path, address: str) -> Path:
    """Make a machine that names a broker."""
    path.mkdir(parents=True)
    (path / "machine.toml").write_text(f'[machine]\nname = "{path.name}"\n[notify]\nmqtt = "{address}"\n', "utf-8")
    return path


def run(*arguments: object) -> Result:
    """Run a command in this process."""
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


def started(*arguments: object, before: str = "") -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own, which must end with all its threads."""
    program = f"import sys\n{before}\nsys.argv[0] = 'lobewatch'\nfrom lobewatch.cli import main\nmain()"
    command = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=LONG, check=False)


def received(broker: Mosquitto, topic: str | list[str], **how: Any) -> Any:
    """Read the retained message of a topic, or of several topics."""
    ask: Any = subscribe.simple
    return ask(topic, qos=1, hostname="127.0.0.1", port=broker.port, **how)


class Mosquitto:
    """On a port of its own; forgets all when it is killed."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.folder = folder
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def address(self) -> str:
        return f"mqtt://127.0.0.1:{self.port}"

    def start(self, user: str = "", password: str = "", more: Sequence[str] = ()) -> None:
        """more: lines of its configuration."""
        lines = [f"listener {self.port} 127.0.0.1", "user root", "persistence false", *more]
        if user:
            subprocess.run([str(PASSWD), "-b", "-c", str(self.folder / "users"), user, password], check=True)
            lines += ["allow_anonymous false", f"password_file {self.folder / 'users'}"]
        else:
            lines.append("allow_anonymous true")
        (self.folder / "mosquitto.conf").write_text("\n".join(lines) + "\n", "utf-8")
        command = [str(MOSQUITTO), "-c", str(self.folder / "mosquitto.conf")]
        self._process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        for _ in range(200):
            try:
                socket.create_connection(("127.0.0.1", self.port), 1).close()
                return
            except OSError:
                time.sleep(0.05)
        raise TimeoutError("mosquitto does not listen")

    def kill(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None


@pytest.fixture
def mosquitto(tmp_path: Path) -> Iterator[Mosquitto]:
    """Not started yet; skips where there is none, but not in continuous integration."""
    if not (MOSQUITTO and PASSWD) and "CI" not in os.environ:
        pytest.skip("mosquitto is not installed")
    (tmp_path / "broker").mkdir()
    broker = Mosquitto(tmp_path / "broker")
    yield broker
    broker.kill()
