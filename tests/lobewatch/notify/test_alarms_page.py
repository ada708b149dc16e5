"""docs/alarms.md: its commands, keys and names exist."""

from __future__ import annotations

import re
import shlex
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import pytest
import typer

from lobewatch.cli import app
from lobewatch.fleet.fleet import FleetMachine
from lobewatch.fleet.machine_summary import DatedStatus, MachineSummary
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.monitoring.status_rules import StatusLevel
from lobewatch.notify.prometheus import METRIC_FAMILIES
from lobewatch.notify.publish_status import make_message

PAGE = (Path(__file__).parents[3] / "docs" / "alarms.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", PAGE, flags=re.DOTALL | re.MULTILINE)
COMMANDS = re.findall(r"lobewatch ((?:status|trend|check|verify|serve)\b[^`>|\n]*)", PAGE)


@pytest.mark.parametrize("line", COMMANDS)
@pytest.mark.quick
def test_each_command_is_understood(line: str) -> None:
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    name, *words = shlex.split(line)
    options = {option for parameter in group.commands[name].params for option in parameter.opts}
    assert {word for word in words if word.startswith("-")} <= options


def test_there_is_a_line_for_cron_and_one_for_systemd() -> None:
    assert [kind for kind, _ in BLOCKS] == ["text", "ini", "ini", "toml", "sh", "yaml", "yaml", "yaml"]
    assert all("lobewatch status" in BLOCKS[number][1] for number in (0, 1))


def test_the_table_for_machine_toml_is_taken_with_the_password(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in re.findall(r"export (\w+)=(\S+)", BLOCKS[4][1]):
        monkeypatch.setenv(name, value)
    broker = parse_machine_file(f'[machine]\nname = "m"\n{BLOCKS[3][1]}').notify.broker
    assert broker == ("mqtt", "broker.example", 1883, "lobewatch", "...", "plant")


@pytest.mark.quick
def test_each_key_of_a_message_and_each_family_is_explained() -> None:
    summary = MachineSummary("m", (), "tap")
    now = datetime(2026, 1, 1, tzinfo=UTC)
    one = FleetMachine("m", Path("m"), summary, DatedStatus(StatusLevel.GOOD, (), "tap", None, now))
    keys = msgspec.json.decode(make_message(one, now))
    rows = [line.split("|")[1] for line in PAGE.splitlines() if line.startswith("| `")]
    assert {*keys, *METRIC_FAMILIES} <= {name for row in rows for name in re.findall(r"`(\w+)`", row)}
