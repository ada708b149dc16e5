"""Updates of the dashboard table: all machines first, then changes only."""

from __future__ import annotations

import json
import shutil
import urllib.parse
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.screen import DashboardServer
from lobewatch.screen import dashboard_table as board
from tests.lobewatch.screen.test_dashboard_server import ask

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture(autouse=True)
def _look_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board, "MACHINE_POLL_INTERVAL", 0.0)


def make(folder: Path) -> None:
    make_machine_folder(folder, "surrogate_machine.toml")


def rename(folder: Path, name: str) -> None:
    """Another name in machine.toml."""
    toml = folder / "machine.toml"
    lines = toml.read_text("utf-8").splitlines()
    number = next(i for i, line in enumerate(lines) if line.startswith("name = "))
    lines[number] = f'name = "{name}"'
    toml.write_text("\n".join(lines), "utf-8")


def take_away(folder: Path) -> None:
    """At once, while the server may be at work in it."""
    shutil.rmtree(folder.rename(folder.parent.with_name(f"gone-{folder.name}")), ignore_errors=True)


class Page:
    """A page that shows the list, as dashboard.js does it."""

    def __init__(self, server: DashboardServer) -> None:
        self.server, self.version, self.machines = server, "", list[dict[str, Any]]()

    def refresh(self) -> dict[str, Any]:
        status, answer = ask(self.server, "GET", f"/machines?known={urllib.parse.quote(self.version)}")
        assert status == 200
        if "machines" in answer:
            self.machines = answer["machines"]
        else:
            others = {*answer["gone"], *(row["key"] for _, row in answer["changed"])}
            self.machines = [row for row in self.machines if row["key"] not in others]
            for place, row in answer["changed"]:
                self.machines.insert(place, row)
        self.version = answer["version"]
        return dict(answer)


def whole(server: DashboardServer) -> list[dict[str, Any]]:
    return list(ask(server, "GET", "/machines")[1]["machines"])


@pytest.fixture
def mills(tmp_path: Path) -> Path:
    for number in range(40):
        make(tmp_path / "mills" / f"m{number:02d}")
    return tmp_path / "mills"


def test_of_many_machines_only_the_row_that_has_changed_is_sent(mills: Path, shop: Shop) -> None:
    shop.tap_both()
    with DashboardServer(mills) as server:
        page = Page(server)
        assert len(page.refresh()["machines"]) == 40
        assert page.refresh() == {"version": page.version, "changed": [], "gone": [], "may_alter": True}
        shutil.copytree(shop.path, mills / "m17", dirs_exist_ok=True)
        (((place, row),), gone) = (answer := page.refresh())["changed"], answer["gone"]
        assert (row["key"], gone) == ("m17", [])
        assert page.machines[place] == row
        assert len(json.dumps(answer)) < 50_000
        assert page.machines == whole(server)


def test_a_machine_that_goes_or_comes_is_announced_to_the_page_and_to_prometheus(mills: Path) -> None:
    with DashboardServer(mills) as server:
        page = Page(server)
        page.refresh()
        take_away(mills / "m03")
        make(mills / "new")
        answer = page.refresh()
        assert answer["gone"] == ["m03"]
        assert [row["key"] for _, row in answer["changed"]] == ["new"]
        assert page.machines == whole(server)
        assert ask(server, "POST", "/machines/m03/start", {"direction": "x"})[0] == 404
        assert "[daq]" in ask(server, "POST", "/machines/new/start", {"direction": "x"})[1]["error"]
        make(mills / "m03")
        answer = page.refresh()
        assert ([row["key"] for _, row in answer["changed"]], answer["gone"]) == (["m03"], [])
        take_away(mills / "new")
        metrics = ask(server, "GET", "/metrics")[1]
        assert 'folder="m03"' in metrics
        assert 'folder="new"' not in metrics


def test_where_the_whole_folder_is_away_every_machine_stays_and_says_so(mills: Path) -> None:
    with DashboardServer(mills) as server:
        page = Page(server)
        page.refresh()
        mills.rename(mills.with_name("away"))
        assert len(page.refresh()["changed"]) == 40
        assert {row["can_be_judged"] for row in page.machines} == {False}
        mills.with_name("away").rename(mills)
        page.refresh()
        assert {row["can_be_judged"] for row in page.machines} == {True}


@pytest.mark.parametrize(
    "known", ["", "-", "0", "00000000-0", "x-1", "{start}-", "{start}-x", "{start}--1", "{start}-٣"]
)
def test_who_names_no_version_of_this_server_gets_all(mills: Path, known: str) -> None:
    with DashboardServer(mills) as server:
        start = ask(server, "GET", "/machines")[1]["version"].split("-")[0]
        name = urllib.parse.quote(known.format(start=start))
        assert len(ask(server, "GET", f"/machines?known={name}")[1]["machines"]) == 40


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=st.lists(st.lists(st.tuples(st.sampled_from("abcde"), st.sampled_from("-+12!")), max_size=4), max_size=8))
def test_after_any_changes_a_page_shows_what_a_new_page_shows(
    tmp_path_factory: pytest.TempPathFactory, steps: list[list[tuple[str, str]]]
) -> None:
    mills = tmp_path_factory.mktemp("mills")
    make(mills / "always")
    with DashboardServer(mills) as server:
        often, seldom = Page(server), Page(server)
        seldom.refresh()
        for step in steps:
            for name, what in step:
                if what == "-":
                    if (mills / name).exists():
                        take_away(mills / name)
                elif not (mills / name).exists():
                    make(mills / name)
                elif what == "!":
                    (mills / name / "machine.toml").write_text("x", "utf-8")
                elif "name = " in (mills / name / "machine.toml").read_text("utf-8"):
                    rename(mills / name, f"machine {what}")
            often.refresh()
            assert often.machines == whole(server)
        seldom.refresh()
        assert seldom.machines == whole(server)
