"""Work shared with a Dask cluster: identical results, even if a worker is killed meanwhile."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from distributed import Client, LocalCluster, Security
from typer.testing import CliRunner

from acquisition import DataError, Description
from lobewatch import Logbook
from lobewatch.cli import app
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.measurement.share_work import Workers, scheduler_remarks, share_work
from lobewatch.measurement.software import CURRENT_SOFTWARE
from tests.lobewatch.authority import certify
from tests.lobewatch.logbook.recordings.test_store_recordings import text_files, values

PAGE = (Path(__file__).parents[3] / "docs" / "several-computers.md").read_text("utf-8")
SAID = Description(date_pattern="%Y-%m-%d")


@pytest.fixture(scope="module")
def cluster() -> Iterator[LocalCluster]:
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0") as made:
        yield made


def plain_machine(path: Path) -> None:
    """Without programs, which take their time."""
    make_machine_folder(path, "surrogate_machine.toml")
    toml = path / "machine.toml"
    toml.write_text(toml.read_text().split("[[program]]")[0])


class Killer:
    """Progress callback that kills one busy worker once."""

    def __init__(self, cluster: LocalCluster) -> None:
        with Client(cluster, set_as_default=False) as client:
            self.pids: list[int] = [*client.run(os.getpid).values()]
        self.killed = 0

    def __call__(self, step: str, done: int, _of: int) -> None:
        if step == "store" and done == 1:
            self.killed = self.pids[0]
            os.kill(self.killed, signal.SIGKILL)


def test_a_replay_on_a_cluster_finds_the_same_though_a_worker_is_killed(cluster: LocalCluster, tmp_path: Path) -> None:
    files = text_files(tmp_path / "files", 9)
    files[4].write_text("Freq (Hz),Real (m/N),Imag\n1,2,3\n2,x,3\n")
    killer, found, refused = Killer(cluster), [], []
    for name, workers in (("alone", Workers()), ("cluster", Workers(scheduler=cluster.scheduler_address))):
        plain_machine(tmp_path / name)
        logbook = Logbook.open(tmp_path / name)
        progress = killer if workers.scheduler else lambda *_: None
        stored = logbook.replay_all(files, SAID, workers=workers, keep_going=True, progress=progress)
        found.append([*map(values, logbook.history.rows)])
        refused.append(dict(stored.rejected))
        assert {path.name for path in (tmp_path / name / "taps").iterdir()} == {
            f"{one}.h5" for one in stored.new_tap_ids
        }
    assert killer.killed
    assert len(found[0]) == 8
    assert found[0] == found[1]
    assert refused[0] == refused[1]
    ((refused_file, reason),) = refused[0].items()
    assert refused_file == files[4]
    assert all(fact in reason for fact in ("'x'", "line 3", "Real", "Description.columns"))


def test_a_folder_of_machines_is_rebuilt_on_a_cluster_as_it_was(cluster: LocalCluster, tmp_path: Path) -> None:
    files, plant = text_files(tmp_path / "files", 2), tmp_path / "mills"
    for name, n_programs in (("a", 1), ("b", 0)):
        make_machine_folder(plant / name, "surrogate_machine.toml")
        toml = plant / name / "machine.toml"
        toml.write_text("[[program]]".join(toml.read_text().split("[[program]]")[: 1 + n_programs]))
        Logbook.open(plant / name).replay_all(files[: 1 + n_programs], SAID)
    histories = []
    for options in ([], ["--scheduler", cluster.scheduler_address]):
        said = CliRunner().invoke(app, ["rebuild", str(plant), *options], catch_exceptions=False).stdout
        assert re.search(r"a: history\.rows: .*2 tap tests", said)
        assert "2 of 2 machines" in said
        histories.append([repr(row) for name in ("a", "b") for row in Logbook.open(plant / name).history.rows])
    assert len(histories[0]) == 3
    assert "verdicts=None" not in histories[0][0]
    assert histories[0] == histories[1]
    (plant / "b" / "machine.toml").write_text("[machine")
    with pytest.raises(DataError, match=r"1 of 2 machines .*\n.*machine\.toml"):
        CliRunner().invoke(app, ["rebuild", str(plant)], catch_exceptions=False)


def test_what_a_cluster_cannot_do_is_one_sentence(cluster: LocalCluster, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match=r"Workers\.jobs 2 and Workers\.scheduler tcp://x"):
        Workers(2, "tcp://x")
    monkeypatch.setattr("lobewatch.measurement.share_work.SCHEDULER_TIMEOUT", 0.3)
    with pytest.raises(DataError, match=r"Workers.scheduler tcp://127\.0\.0\.1:9: .*dask scheduler"):
        [*share_work(abs, [1], Workers(scheduler="tcp://127.0.0.1:9"))]
    monkeypatch.setattr("lobewatch.measurement.share_work.SCHEDULER_TIMEOUT", 10.0)
    workers = Workers(scheduler=cluster.scheduler_address)
    assert [*share_work(abs, [-1, -2], workers)] == [1, 2]
    other = CURRENT_SOFTWARE._replace(numpy="1.0")
    monkeypatch.setattr("lobewatch.measurement.share_work.CURRENT_SOFTWARE", other)
    with pytest.raises(DataError, match=r"worker .*lobewatch .* lobewatch .*, numpy 1\.0, "):
        [*share_work(abs, [-1], workers)]


@pytest.mark.parametrize("address", ["", "x", "foo://h:1", "tls://", "tcp://[::1", "tcp://h:port", "inproc://x"])
def test_what_is_no_address_of_a_scheduler_is_one_sentence(address: str) -> None:
    with pytest.raises(DataError, match=rf"^Workers.scheduler {re.escape(address)}: .*tls://HOST:PORT"):
        scheduler_remarks(address)
    with pytest.raises(DataError, match="tls://HOST:PORT"):
        [*share_work(abs, [1], Workers(scheduler=address or "/"))]


def test_who_answers_and_is_no_scheduler_is_one_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def refuse() -> None:
            connection, _ = server.accept()
            with connection, suppress(OSError):
                connection.sendall(b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n")
                connection.recv(1000)

        stranger = threading.Thread(target=refuse)
        stranger.start()
        address = f"127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(DataError, match=rf"^Workers.scheduler {address}: .*dask scheduler"):
            [*share_work(abs, [1], Workers(scheduler=address))]
        stranger.join()


@pytest.mark.parametrize("address", ["tcp://10.0.0.5:8786", "mill-pc:8786", "tcp://[fd00::1]:8786", "ws://mill-pc:80"])
def test_a_scheduler_elsewhere_without_encryption_is_remarked(address: str) -> None:
    (remark,) = Workers(scheduler=address).remarks
    assert (remark.code, remark.about) == ("scheduler-open", f"Workers.scheduler {address}")


@pytest.mark.parametrize(
    "address", ["tls://10.0.0.5:1", "wss://mill-pc:1", "localhost:1", "127.9.0.1:1", "[::1]:1", ""]
)
def test_an_encrypted_one_and_one_of_this_computer_is_not(address: str) -> None:
    assert Workers(scheduler=address).remarks == []
    assert Workers(scheduler=f"tcp://{socket.gethostname().upper()}:8786").remarks == []


@pytest.mark.parametrize("command", [["rebuild"], ["replay", "--dry-run", "hits.csv"]])
def test_the_remark_comes_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]) -> None:
    monkeypatch.setattr("lobewatch.measurement.share_work.SCHEDULER_TIMEOUT", 0.3)
    monkeypatch.chdir(tmp_path)
    Path("hits.csv").write_text("Freq (Hz),Real (m/N),Imag\n1,2,3\n")
    plain_machine(tmp_path / "m")
    name, *options = command
    said = CliRunner().invoke(app, [name, "m", *options, "--scheduler", "nowhere.invalid:8786"])
    assert said.stderr.startswith("note: --scheduler nowhere.invalid:8786: ")
    assert "tls://" in said.stderr
    assert "dask scheduler" in str(said.exception)


def test_a_scheduler_with_tls_as_the_page_says(tmp_path: Path) -> None:
    ca, certificate, key = certify(tmp_path / "certificates", "DNS:cluster")
    both = {f"tls_{role}_cert": str(certificate) for role in ("scheduler", "worker", "client")}
    both |= {name.replace("cert", "key"): str(key) for name in both}
    security = Security(tls_ca_file=str(ca), require_encryption=True, **both)
    named = dict(re.findall(r"export (DASK_\w+)=\S+/(\S+)", PAGE))
    files = {"ca.pem": ca, "computer.pem": certificate, "computer.key": key}
    size = {"n_workers": 1, "threads_per_worker": 1}
    with LocalCluster(**size, dashboard_address="127.0.0.1:0", protocol="tls", security=security) as made:
        address = made.scheduler_address
        assert address.startswith("tls://")
        with pytest.raises(DataError, match=r"(?s)TLS.*docs/[\w-]+\.md"):
            [*share_work(abs, [-1], Workers(scheduler=address))]
        program = (
            "import sys; from lobewatch.measurement.share_work import Workers, share_work\n"
            "if __name__ == '__main__': print(*share_work(abs, [-1, -2], Workers(scheduler=sys.argv[1])))"
        )
        known = {name: str(files[file]) for name, file in named.items()}
        command = [sys.executable, "-c", program, address]
        said = subprocess.run(command, env=os.environ | known, capture_output=True, text=True, timeout=90, check=False)
    assert (said.stdout, len(known)) == ("1 2\n", 3)


def test_a_process_that_is_ended_from_outside_is_one_sentence() -> None:
    with pytest.raises(DataError, match=r"2 processes .*Workers\.jobs"):
        [*share_work(os._exit, [1, 1], Workers(2))]


def test_work_is_handed_out_three_tasks_a_worker_ahead() -> None:
    tasks = iter(range(0, -20, -1))
    results = share_work(abs, tasks, Workers(2))
    assert next(results) == 0
    assert next(tasks) == -6
    assert [*results] == [1, 2, 3, 4, 5, *range(7, 20)]
