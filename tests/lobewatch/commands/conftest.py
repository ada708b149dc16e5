"""A command as a person types it, in an empty folder; a real PostgreSQL."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

import psycopg
import pytest

from lobewatch.cli import main
from lobewatch.machine.folder import MachineFolder
from lobewatch.verdicts import Advice


class Said(NamedTuple):
    """Result of a command."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        """The object on stdout."""
        parsed: dict[str, Any] = json.loads(self.out)
        return parsed


Run = Callable[..., Said]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    """Run a command in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments: object) -> Said:
        monkeypatch.setattr(sys, "argv", ["lobewatch", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        code = end.value.code
        return Said(code if isinstance(code, int) else int(code is not None), *capsys.readouterr())

    return command


@pytest.fixture
def trial(run: Run) -> MachineFolder:
    """Make a machine folder with the example spindle."""
    assert run("init", "trial", "--example").code == 0
    return MachineFolder("trial")


class Checked(Said):
    """Result of `lobewatch check`."""

    @property
    def programs(self) -> dict[str, dict[str, Any]]:
        """Objects on stdout, by the names of programs."""
        return {one["name"]: one for one in self.json["programs"]}

    @property
    def last(self) -> str:
        """Last line on stdout."""
        return self.out.splitlines()[-1]

    def line(self, name: str) -> str:
        """Return the list of advice on a program below the table, in one line."""
        lines = self.out.splitlines()
        return " ".join(
            line.strip() for line in takewhile(lambda line: line[:1] == " ", lines[lines.index(f"{name}:") + 1 :])
        )


Check = Callable[..., Checked]


@pytest.fixture
def check(shop: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Check:
    """Run `lobewatch check` on the shop or another folder."""

    def command(*options: str, folder: Path | None = None) -> Checked:
        monkeypatch.setattr(sys, "argv", ["lobewatch", "check", str(folder or shop.path), *options])
        capsys.readouterr()
        code: Any = 0
        try:
            main()
        except SystemExit as end:
            code = end.code or 0
        return Checked(code, *capsys.readouterr())

    return command


@pytest.fixture
def no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the search for settings in tests of other things."""
    monkeypatch.setattr("lobewatch.logbook.analysis.advise", lambda *_: Advice())


def refused(said: Said, *words: str) -> None:
    """Exit code 2 and one sentence with these words, no traceback, nothing on stdout."""
    assert said.code == 2
    *progress, error = said.err.splitlines()  # a slow machine shows progress first
    assert error.startswith("error: ")
    assert all(re.fullmatch(r"[\w ]+: \d+ of \d+ .*", line) for line in progress), said.err
    assert said.out == ""
    for word in words:
        assert word in said.err


SECRET = "quite-secret"
PATHS = os.pathsep.join(
    [os.environ["PATH"], *map(str, sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True))]
)
INITDB, POSTGRES = (shutil.which(name, path=PATHS) or "" for name in ("initdb", "postgres"))


class Server:
    """PostgreSQL in a folder of its own, with a password; of a user that may nothing else where we are root."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.user: dict[str, Any] = (
            {"user": "nobody", "group": "nogroup", "extra_groups": []} if not os.geteuid() else {}
        )
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = int(free.getsockname()[1])
        password = folder / "password"
        password.write_text(SECRET)
        if self.user:
            for path in (folder, password):
                shutil.chown(path, "nobody", "nogroup")
        command: list[str | Path] = [
            INITDB,
            "-D",
            folder / "data",
            "-U",
            "lobewatch",
            "-A",
            "scram-sha-256",
            "--pwfile",
            password,
            "-N",
        ]
        subprocess.run(command, check=True, capture_output=True, cwd=folder, **self.user)
        self.start()

    def start(self) -> None:
        command: list[str | Path] = [
            POSTGRES,
            "-D",
            self.folder / "data",
            "-k",
            self.folder,
            "-p",
            str(self.port),
            "-F",
        ]
        with (self.folder / "log").open("ab") as log:
            self.process = subprocess.Popen([*command, "-h", "127.0.0.1"], stderr=log, cwd=self.folder, **self.user)
        deadline = time.monotonic() + 60
        while True:
            try:
                self.ask("SELECT 1")
            except psycopg.OperationalError:
                assert time.monotonic() < deadline, (self.folder / "log").read_text()
                time.sleep(0.05)
            else:
                return

    def stop(self) -> None:
        """At once, as after a power cut."""
        self.process.send_signal(signal.SIGQUIT)
        self.process.wait()

    def address(self, database: str = "postgres", port: int = 0) -> str:
        return f"postgresql://lobewatch:{SECRET}@127.0.0.1:{port or self.port}/{database}"

    def ask(self, query: str, database: str = "postgres") -> list[tuple[Any, ...]]:
        with psycopg.connect(self.address(database), autocommit=True) as connection:
            cursor = connection.execute(query)
            return cursor.fetchall() if cursor.description else []


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    """Start a server; skip without one, except in continuous integration."""
    if not (INITDB and POSTGRES) and "CI" not in os.environ:
        pytest.skip("PostgreSQL is not installed")
    with tempfile.TemporaryDirectory() as folder:
        running = Server(Path(folder))
        yield running
        running.stop()


@pytest.fixture
def plant(server: Server) -> str:
    """Make an empty database and return its name."""
    name = f"plant_{time.monotonic_ns()}"
    server.ask(f"CREATE DATABASE {name}")
    return name
