"""`lobewatch serve`: machine data, and the tap test that its button starts."""

from __future__ import annotations

import asyncio
import http.client
import json
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import aiohttp
import numpy as np
import pytest

from acquisition import Circumstances, DataError, Hit, HitFlags, TapDirection, TapsEmulator, TapsSource, write_hit
from lobewatch.cli import main
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.monitoring.series_drop import NO_DROP
from lobewatch.monitoring.status_rules import OVERDUE
from lobewatch.screen import DashboardServer
from lobewatch.tap.emulated_spindle import build_structure, set_bearing_stiffness
from lobewatch.tap.session import TapSession
from tests.lobewatch.tapped_emulator import make_emulator

DAY = datetime(2026, 5, 4, 9, tzinfo=UTC)
NEW, WORN = 1.28e9, 0.6661e9
"""Bearing stiffness of the demo's first and last month (N/m): f_1 1713.05 and 1541.74 Hz, 10.00 % lower."""


def machine(path: Path, daq: str = "", hits: int = 10) -> MachineFolder:
    """Make the example machine, without a frequency drop at speed."""
    toml = make_machine_folder(path, "surrogate_machine.toml")
    text = toml.read_text("utf-8").replace("high_rpm = 24000\n", "high_rpm = 24000\ndrop_percent = [0, 0]\n")
    text = text.replace("[daq]\n", f"[daq]\n{daq}\n").replace("hits = 10", f"hits = {hits}")
    toml.write_text(text, "utf-8")
    return MachineFolder(path)


@contextmanager
def hammered(folder: MachineFolder, stiffness: float = NEW, realtime: bool = False) -> Iterator[TapsEmulator]:
    """Somebody taps its spindle with these bearings (N/m)."""
    spindle = folder.machine.spindle
    assert spindle is not None
    structure = build_structure(set_bearing_stiffness(spindle.build(), stiffness), spindle.damping_ratio)
    with make_emulator(structure, np.random.default_rng(1), realtime=realtime) as device:
        yield device


def tap(folder: MachineFolder, stiffness: float, when: datetime, direction: TapDirection = "x") -> None:
    """One tap test more."""
    about = Circumstances("mill", when, "reference", direction, machine_toml=folder.toml.read_text("utf-8"))
    with hammered(folder, stiffness) as device:
        TapSession(folder, lambda: TapsSource(device.port), about, guided=False).run()


def ask(server: DashboardServer, method: str, path: str, body: object = None, token: str = "") -> tuple[int, Any]:
    """Send a request as the page does."""
    connection = http.client.HTTPConnection(server.origin.removeprefix("http://"), timeout=60)
    headers = {"Origin": server.origin, "Authorization": f"Bearer {token or server.token}"}
    connection.request(method, path, json.dumps(body), headers)
    answer = connection.getresponse()
    content = answer.read().decode()
    connection.close()
    return answer.status, json.loads(content) if content[:1] == "{" else content


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a worn machine, one tapped once, one never tapped, and one with a broken machine.toml."""
    path = tmp_path_factory.mktemp("shop")
    worn = machine(path / "b-worn")
    tap(worn, NEW, DAY - timedelta(days=60))
    tap(worn, WORN, DAY - timedelta(days=40))
    tap(machine(path / "a-new"), NEW, DAY - timedelta(days=10))
    machine(path / "c-untapped")
    machine(path / "d-broken").toml.write_text("[machine]\nname = 7\n")
    return path


def test_a_worn_machine_says_how_far_its_frequency_has_fallen(shop: Path) -> None:
    found = Logbook.open(shop / "b-worn").status(DAY)
    (series,) = found.series
    assert series.drop.value == pytest.approx(10.0, abs=0.01)
    assert 0.05 < series.drop.std < 1.0  # with reclamping
    assert (found.status, series.name) == ("alarm", "reference, x")
    assert found.days_left == pytest.approx(-10)
    assert any("slot at 12 600 rpm" in remark.about for remark in found.remarks)
    assert "overdue" in [remark.code for remark in found.remarks]


def test_a_machine_tapped_once_has_nothing_to_compare_with(shop: Path) -> None:
    found = Logbook.open(shop / "a-new").status(DAY)
    (series,) = found.series
    assert (series.drop, series.is_baseline) == (NO_DROP, True)
    assert found.days_left == pytest.approx(20)


def test_one_direction_warns_of_programs_by_name_and_both_are_good(tmp_path: Path) -> None:
    folder = machine(tmp_path / "mill")
    tap(folder, NEW, DAY)
    alone = Logbook.open(folder.path).status(DAY)
    codes = [remark.code for remark in alone.remarks]
    assert (alone.status, codes) == ("warn", ["program-doubtful"] * 3 + ["one-direction"])
    with DashboardServer(folder.path) as server:
        (row,) = ask(server, "GET", "/machines")[1]["machines"]
    assert re.search(r"A: slot at .*B: slot at .*C: slot at .*doubtful.*reference", row["note"])
    assert "direction y" in alone.next_step
    tap(folder, 0.99 * NEW, DAY + timedelta(hours=1), "y")
    both = Logbook.open(folder.path).status(DAY)
    assert (both.status, [remark.code for remark in both.remarks]) == ("good", [])


def test_what_is_damaged_is_found_in_the_background(tmp_path: Path) -> None:
    folder = machine(tmp_path / "mill")
    tap(folder, NEW, DAY)
    (folder.path / "daq.json").write_text("no devices")
    with DashboardServer(folder.path) as server:
        for _ in range(600):
            (row,) = ask(server, "GET", "/machines")[1]["machines"]
            if "daq.json" in row["note"]:
                break
            time.sleep(0.1)
    assert (row["light"], "daq.json: " in row["note"]) == ("warn", True)


def test_an_interrupted_test_is_resumed_or_restarted(tmp_path: Path) -> None:
    folder = machine(tmp_path / "mill", hits=3)
    with hammered(folder) as device:
        toml = folder.toml.read_text("utf-8").replace("[daq]", f'[daq]\nport = "{device.port}"')
        folder.toml.write_text(toml, "utf-8")
        about = Circumstances("mill", datetime.now(UTC), "reference", "y")
        spool = folder.spool / "earlier"
        spool.mkdir(parents=True)
        pulse = np.exp(-((np.arange(1000) / 30 - 5) ** 2))
        write_hit(spool / "0000.h5", Hit(500 * pulse, 100 * pulse, 25600.0), about, HitFlags.OK)
        with DashboardServer(folder.path) as server:
            (row,) = ask(server, "GET", "/machines")[1]["machines"]
            assert row["interrupted"] == {"y": 1}
            ask(server, "POST", "/machines/mill/start", {"direction": "y", "resume": False})
            for _ in range(600):
                (row,) = ask(server, "GET", "/machines")[1]["machines"]
                if row["last_tap"]:
                    break
                time.sleep(0.1)
    (entry,) = MachineFolder(folder.path).taps()
    assert entry.id != "earlier"
    assert (spool / "0000.h5").is_file()


def test_overdue_is_never_good(shop: Path) -> None:
    found = Logbook.open(shop / "a-new").status(DAY + timedelta(days=21))
    assert found.status == "warn"
    assert found.remarks[0].code == "overdue"
    assert "1 day" in found.remarks[0].text
    assert found.next_step == OVERDUE.remedy


def test_another_machine_toml_is_analysed_again(tmp_path: Path) -> None:
    folder = machine(tmp_path / "mill")
    tap(folder, NEW, DAY)
    assert "mode-lost" not in [remark.code for remark in Logbook.open(folder.path).status(DAY).remarks]
    text = folder.toml.read_text("utf-8")
    folder.toml.write_text(text.replace("band_hz = [1200, 2200]", "band_hz = [3900, 3950]"), "utf-8")
    found = Logbook.open(folder.path).status(DAY)
    assert (found.status, found.remarks[0].code) == ("warn", "mode-lost")


def test_the_list_is_worst_first_and_nothing_is_listed_without_the_token(shop: Path) -> None:
    with DashboardServer(shop) as server:
        status, answer = ask(server, "GET", "/machines")
        assert [one["key"] for one in answer["machines"]] == ["d-broken", "b-worn", "c-untapped", "a-new"]
        assert [one["light"] for one in answer["machines"]] == ["unknown", "alarm", "unknown", "warn"]
        assert "machine.toml" in answer["machines"][0]["note"]
        assert status == 200
        assert ask(server, "GET", "/machines", token="wrong-token-wrong")[0] == 401
        for action in ("start", "report"):
            assert ask(server, "POST", f"/machines/a-new/{action}", {}, token="wrong-token-wrong")[0] == 401
            assert ask(server, "GET", f"/machines/a-new/{action}")[0] in (404, 405)


def test_a_report_is_written_on_demand_and_read_by_a_name_that_cannot_be_guessed(shop: Path) -> None:
    with DashboardServer(shop) as server:
        status, answer = ask(server, "POST", "/machines/a-new/report")
        assert status == 200
        assert "spindle report" in ask(server, "GET", answer["url"], token="none")[1]
        assert ask(server, "GET", answer["url"][:-1], token="none")[0] == 404
        assert ask(server, "GET", "/report/b-worn/", token="none")[0] in (401, 404)
        assert ask(server, "GET", "/report/b-worn/x", token="none")[0] == 404
        assert ask(server, "POST", "/machines/c-untapped/report")[1]["error"].count("START") == 1


def test_who_may_only_watch_reads_lists_and_reports_and_starts_nothing(shop: Path) -> None:
    with DashboardServer(shop) as server:
        token = server.watch_token
        status, answer = ask(server, "GET", "/machines", token=token)
        assert (status, answer["may_alter"], len(answer["machines"])) == (200, False, 4)
        assert ask(server, "POST", "/machines/a-new/report", token=token)[0] == 200
        status, answer = ask(server, "POST", "/machines/a-new/start", {"direction": "x"}, token)
        assert (status, "read-only" in answer["error"]) == (403, True)


@pytest.mark.parametrize("body", [None, {}, {"direction": "z"}, {"direction": "x", "port": "/dev/null"}, [1], "x"])
def test_what_cannot_be_started_is_rejected(shop: Path, body: object) -> None:
    with DashboardServer(shop) as server:
        status, answer = ask(server, "POST", "/machines/a-new/start", body)
        assert status == 400
        assert "direction" in answer["error"]


@pytest.mark.parametrize("key", ["nobody", "..", "%2e%2e%2fa-new", "a-new%00"])
def test_only_machines_of_the_folder_are_known(shop: Path, key: str) -> None:
    with DashboardServer(shop) as server:
        assert ask(server, "POST", f"/machines/{key}/start", {"direction": "x"})[0] == 404
        assert ask(server, "GET", f"/tap/{key}/access")[0] == 404


def test_start_without_a_port_in_machine_toml_says_so(shop: Path) -> None:
    with DashboardServer(shop) as server:
        status, answer = ask(server, "POST", "/machines/c-untapped/start", {"direction": "x"})
        assert status == 409
        assert "port in [daq]" in answer["error"]
        assert ask(server, "GET", "/tap/c-untapped/access")[0] == 404


def test_start_begins_a_test_once_and_stop_gives_the_device_back(tmp_path: Path) -> None:
    folder = machine(tmp_path / "a mill", hits=1000)
    with hammered(folder, realtime=True) as device:
        machine(tmp_path / "other", f'port = "{device.port}"')
        folder.toml.write_text(folder.toml.read_text("utf-8").replace("[daq]\n", f'[daq]\nport = "{device.port}"\n'))
        with DashboardServer(tmp_path) as server:
            answers = [ask(server, "POST", "/machines/a%20mill/start", {"direction": "y"}) for _ in range(2)]
            assert answers == [(200, {"url": "/tap/a%20mill/"})] * 2
            assert ask(server, "GET", "/tap/a%20mill/access")[0] == 200
            assert {one["key"]: one["running"] for one in ask(server, "GET", "/machines")[1]["machines"]} == {
                "a mill": True,
                "other": False,
            }
            assert ask(server, "POST", "/tap/a%20mill/stop")[0] == 200
            deadline = time.monotonic() + 100
            while any(one["running"] for one in ask(server, "GET", "/machines")[1]["machines"]):
                assert time.monotonic() < deadline
        with TapsSource(device.port):
            pass


START = "/machines/mill/start"


def test_a_page_that_has_watched_a_test_to_its_end_sees_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where START is pressed before the thread of the failed test has ended."""
    machine(tmp_path / "mill", 'port = "/dev/nothing-here"')
    monkeypatch.setattr("lobewatch.screen.dashboard_server._release_memory", lambda: time.sleep(0.3))

    async def titles(server: DashboardServer) -> list[str]:
        found: list[str] = []
        async with aiohttp.ClientSession(headers={"Origin": server.origin}) as client:
            feed = client.ws_connect(f"{server.origin}/tap/mill/feed", protocols=("lobewatch", f"token.{server.token}"))
            async with asyncio.timeout(100), feed as messages:
                while len(found) < 2:
                    state = json.loads(await messages.receive_str())
                    if state.get("kind") == "failed" and state["title"] not in found:
                        found.append(state["title"])
                        assert (await asyncio.to_thread(ask, server, "POST", START, {"direction": "y"}))[0] == 200
        return found

    with DashboardServer(tmp_path) as server:
        assert ask(server, "POST", START, {"direction": "x"})[0] == 200
        assert [title[-1] for title in asyncio.run(titles(server))] == ["x", "y"]


def test_no_machine_is_one_sentence_and_exit_code_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(DataError, match=rf"{tmp_path}.*make_machine_folder"):
        DashboardServer(tmp_path)
    monkeypatch.setattr(sys, "argv", ["lobewatch", "serve", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert "lobewatch init" in capsys.readouterr().err
