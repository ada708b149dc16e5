"""`lobewatch export --to`: a real PostgreSQL server, also when it disconnects."""

from __future__ import annotations

import json
import math
import shutil
import socket
import sqlite3
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import closing, suppress
from datetime import UTC
from pathlib import Path
from typing import Any

import psycopg
import pytest

from acquisition import DataError
from lobewatch.show.fleet import export_postgres as table_postgres
from tests.lobewatch.commands.invoke import invoke

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
Server = Any
"""PostgreSQL of conftest.py."""
SECRET = "quite-secret"
"""Its password."""


@pytest.fixture
def mills(shop: Shop, tmp_path: Path) -> Path:
    """Three machines of two tap tests in x and one in y each."""
    shop.put("")
    shop.tap_both()
    shop.tap(30, 1700.0)
    for name in ("a", "b", "c"):
        shutil.copytree(shop.path, tmp_path / "mills" / name)
    return tmp_path / "mills"


@pytest.fixture
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Export with one transaction for each machine."""
    monkeypatch.setattr(table_postgres, "POSTGRES_BATCH_TAPS", 1)


def export(*arguments: object) -> dict[str, Any]:
    result = invoke(["export", *map(str, arguments), "--json"])
    return {"exit_code": result.exit_code, **json.loads(result.stdout)}


def lines(server: Server, database: str) -> list[tuple[Any, ...]]:
    return list(server.ask("SELECT * FROM lobewatch_taps ORDER BY folder, time, tap_id", database))


class Cable:
    """A way to a server that is cut, or whatever happens then, after so many bytes to the server."""

    def __init__(self, port: int, length: int, at_end: Callable[[], None] = lambda: None) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listener.getsockname()[1])
        self.sent = 0
        self._left, self._at_end = length, at_end
        self._thread = threading.Thread(target=self._serve, args=(port,))
        self._thread.start()

    def _serve(self, port: int) -> None:
        client, _ = self._listener.accept()
        with client, socket.create_connection(("127.0.0.1", port)) as server:
            back = threading.Thread(target=self._pass_back, args=(server, client))
            back.start()
            with suppress(OSError):
                while self._left > 0 and (sent := client.recv(min(self._left, 4096))):
                    server.sendall(sent)
                    self._left -= len(sent)
                    self.sent += len(sent)
            if self._left <= 0:
                self._at_end()
            for end in (client, server):
                with suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)
            back.join()

    def _pass_back(self, server: socket.socket, client: socket.socket) -> None:
        with suppress(OSError):
            while answer := server.recv(4096):
                client.sendall(answer)

    def end(self) -> None:
        self._thread.join()
        self._listener.close()


def test_the_table_holds_what_the_file_holds(server: Server, plant: str, mills: Path, tmp_path: Path) -> None:
    export(mills, tmp_path / "fleet.sqlite")
    told = export(mills, "--to", server.address(plant))
    assert (told["exit_code"], told["tap_tests"], told["written"], told["set_aside"]) == (0, 9, 9, 0)
    assert (told["database"], told["hypertable"]) == (f"127.0.0.1:{server.port}/{plant}", False)
    with closing(sqlite3.connect(tmp_path / "fleet.sqlite")) as base:
        wanted = base.execute("SELECT * FROM taps ORDER BY folder, time, tap_id").fetchall()
    for line, row in zip(lines(server, plant), wanted, strict=True):
        assert line[:3] == row[:3]
        assert f"{line[3].astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}" == row[3]
        assert line[-1] is True
        for value, number in zip(line[4:-1], row[4:], strict=True):
            assert value == (pytest.approx(number, rel=1e-6) if isinstance(number, float) else number)
        assert not any(isinstance(value, float) and math.isnan(value) for value in line)


def test_the_same_again_writes_nothing_and_what_is_new_or_otherwise_is_written(
    server: Server, plant: str, mills: Path, shop: Shop
) -> None:
    address = server.address(plant)
    export(mills, "--to", address)
    before = lines(server, plant)
    assert export(mills, "--to", address)["written"] == 0
    assert lines(server, plant) == before
    shop.path = mills / "b"
    tap = shop.tap(61, 1690.0)
    assert export(mills, "--to", address)["written"] == 1
    assert [line[2] for line in lines(server, plant) if line not in before] == [tap]
    server.ask("UPDATE lobewatch_taps SET frequency_hz = 1 WHERE folder = 'a'", plant)
    assert export(mills, "--to", address)["written"] == 3
    assert len(lines(server, plant)) == 10
    assert server.ask("SELECT count(*) FROM lobewatch_taps WHERE frequency_hz = 1", plant) == [(0,)]


def test_what_counts_no_longer_stays_and_says_so(server: Server, plant: str, mills: Path) -> None:
    address = server.address(plant)
    export(mills, "--to", address)
    before = lines(server, plant)
    tap = before[0][2]
    invoke(["exclude", str(mills / "a"), tap, "--reason", "trial"])
    assert export(mills, "--to", address)["set_aside"] == 1
    assert export(mills, "--to", address)["set_aside"] == 0
    assert server.ask("SELECT folder, tap_id FROM lobewatch_taps WHERE NOT counts", plant) == [("a", tap)]
    invoke(["include", str(mills / "a"), tap])
    export(mills, "--to", address)
    assert lines(server, plant) == before
    (mills / "b" / "machine.toml").write_text("x", "utf-8")
    told = export(mills, "--to", address)
    assert (told["exit_code"], [*told["left_out"]], told["set_aside"]) == (2, ["b"], 0)
    assert server.ask("SELECT count(*) FROM lobewatch_taps WHERE counts", plant) == [(9,)]


@pytest.mark.usefixtures("small_batches")
def test_cut_off_anywhere_it_is_one_sentence_and_the_next_completes_it(server: Server, mills: Path) -> None:
    server.ask("CREATE DATABASE whole")
    cable = Cable(server.port, 10**9)
    export(mills, "--to", server.address("whole", cable.port))
    cable.end()
    wanted, length, present = lines(server, "whole"), cable.sent, set[int]()
    for number, share in enumerate((0.01, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.99)):
        database = f"cut_{number}"
        server.ask(f"CREATE DATABASE {database}")
        cable = Cable(server.port, int(share * length))
        reason = rf"--to 127\.0\.0\.1:{cable.port}/{database}: "
        with pytest.raises(DataError, match=reason) as refusal:
            export(mills, "--to", server.address(database, cable.port))
        cable.end()
        assert SECRET not in str(refusal.value)
        with suppress(psycopg.errors.UndefinedTable):
            present.add(len(lines(server, database)))
        export(mills, "--to", server.address(database))
        assert lines(server, database) == wanted
    assert {3, 6} <= present <= {0, 3, 6, 9}


@pytest.mark.usefixtures("small_batches")
def test_a_server_that_dies_in_the_middle_loses_and_doubles_nothing(server: Server, plant: str, mills: Path) -> None:
    cable = Cable(server.port, 6000, server.stop)
    with pytest.raises(DataError, match=f"--to 127.0.0.1:{cable.port}/"):
        export(mills, "--to", server.address(plant, cable.port))
    cable.end()
    with pytest.raises(DataError, match=f"--to 127.0.0.1:{server.port}/.*refused"):
        export(mills, "--to", server.address(plant))
    server.start()
    export(mills, "--to", server.address(plant))
    assert len({line[:3] for line in lines(server, plant)}) == len(lines(server, plant)) == 9


def test_of_exports_at_once_none_writes_twice(server: Server, plant: str, mills: Path) -> None:
    command = [sys.executable, "-m", "lobewatch.cli", "export", str(mills), "--to", server.address(plant), "--json"]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE) for _ in range(3)]
    told = [json.loads(process.communicate()[0]) for process in running]
    assert sorted(one["written"] for one in told) == [0, 0, 9]
    assert len(lines(server, plant)) == 9


def test_another_export_is_waited_for_but_not_for_ever(
    server: Server, plant: str, mills: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table_postgres, "POSTGRES_LOCK_WAIT", 1)
    with psycopg.connect(server.address(plant)) as other:
        other.execute(table_postgres.EXPORT_LOCK_QUERY)
        with pytest.raises(DataError, match="another export"):
            export(mills, "--to", server.address(plant))
    assert export(mills, "--to", server.address(plant))["written"] == 9


def test_where_timescale_is_the_table_is_a_hypertable(server: Server, plant: str, mills: Path) -> None:
    server.ask(
        "CREATE FUNCTION create_hypertable(relation regclass, name text, chunk_time_interval interval) RETURNS text "
        "LANGUAGE sql AS $$ COMMENT ON TABLE lobewatch_taps IS 'hypertable'; SELECT 'done' $$",
        plant,
    )
    for _ in range(2):
        assert export(mills, "--to", server.address(plant))["hypertable"] is True
    assert server.ask("SELECT obj_description('lobewatch_taps'::regclass)", plant) == [("hypertable",)]


def test_names_of_any_characters_arrive(server: Server, plant: str, mills: Path, shop: Shop) -> None:
    shop.path = mills / "a"
    toml = (shop.path / "machine.toml").read_text("utf-8")
    name = next(line for line in toml.splitlines() if line.startswith("name = "))
    shop.edit(name, r'name = "A \\ \\N \" \u0027 \u4e94"')
    export(mills / "a", "--to", server.address(plant))
    assert server.ask("SELECT DISTINCT machine FROM lobewatch_taps", plant) == [("A \\ \\N \" ' 五",)]


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("", "PostgreSQL"),
        ("fleet.sqlite", "PostgreSQL"),
        ("mysql://u:SECRET@h/db", "PostgreSQL"),
        ("postgresql://u:SECRET@[h/db", "PostgreSQL"),
        ("postgresql://u:SECRET@h:99999/db", "99999"),
        ("postgresql://u:SECRET@h/db?nonsense=1", "PostgreSQL"),
        ("postgresql://u:SECRET@127.0.0.1:1/db", "refused"),
        ("postgresql://lobewatch:SECRETx@127.0.0.1:PORT/postgres", "password authentication failed"),
        ("postgresql://lobewatch:SECRET@127.0.0.1:PORT/none", 'database "none" does not exist'),
        ("postgresql://u:SECRET@127.0.0.1:PORT/db?connect_timeout=x", "connect_timeout"),
    ],
)
def test_an_address_that_cannot_be_is_one_sentence_without_its_password(
    server: Server, mills: Path, address: str, reason: str
) -> None:
    there = address.replace("SECRET", SECRET).replace("PORT", str(server.port))
    command = [sys.executable, "-m", "lobewatch.cli", "export", str(mills), "--to", there]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert reason in done.stderr
    assert SECRET not in done.stderr
    assert "Traceback" not in done.stderr
    debug = subprocess.run([*command[:3], "--debug", *command[3:]], capture_output=True, text=True, check=False)
    assert SECRET not in debug.stderr


def test_a_user_who_may_not_make_the_table_is_reported(server: Server, plant: str, mills: Path) -> None:
    with suppress(psycopg.errors.DuplicateObject):
        server.ask(f"CREATE ROLE guest LOGIN PASSWORD '{SECRET}'")
    address = server.address(plant).replace("lobewatch:", "guest:")
    with pytest.raises(DataError, match="permission denied for schema public"):
        export(mills, "--to", address)


def test_without_psycopg_it_is_reported_how_to_install_it(mills: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(DataError, match=r'pip install "lobewatch\[postgres\]"'):
        export(mills, "--to", "postgresql://db.example/plant")
