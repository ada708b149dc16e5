"""A password in machine.toml stays there: no stored file, output, error or export repeats it."""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition.files.tap_file import read_tap
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.settings.notify_table import parse_broker
from tests.lobewatch.commands.invoke import invoke

ROOT = Path(__file__).parents[3]
SECRET = "quite-secret"
TABLE = f'\n[notify]\nmqtt = "mqtt://mill:{SECRET}@127.0.0.1:1/plant"\n'


def test_no_file_and_no_output_repeats_the_password(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mill = tmp_path / "mill"
    make_machine_folder(mill, "surrogate_machine.toml")
    toml = mill / "machine.toml"
    toml.write_text(toml.read_text(encoding="utf-8") + TABLE, encoding="utf-8")
    said = [invoke(["replay", "mill", str(ROOT / "sim_data" / "tap-good-1722-hz.h5")])]
    said += [invoke(line.split()) for line in ("verify mill", "status . --notify", "export . f.csv", "history mill")]
    toml.rename(tmp_path / "own.toml")
    said.append(invoke(["rebuild", "mill"]))
    for result in said:
        assert SECRET not in result.output
    assert "machine-file-edited" not in said[1].output
    files = [path for path in tmp_path.rglob("*") if path.is_file() and path.name != "own.toml"]
    assert (mill / "history.rows") in files
    assert [path for path in files if SECRET.encode() in path.read_bytes()] == []
    (tap,) = (mill / "taps").iterdir()
    assert 'mqtt = "mqtt://mill@127.0.0.1:1/plant"' in read_tap(tap).circumstances.machine_toml


@pytest.mark.parametrize(
    "line",
    [
        f'mqtt = "mqtt://mill:{SECRET}@h/a b"',
        f'mqtt = "mqtt://mill:1/{SECRET}@h"',
        f'mqtt = "http://mill:{SECRET}@h"',
        f'mqtt = ["mqtt://mill:{SECRET}@h"]',
        f"mqtt = mqtt://mill:{SECRET}@h",
        f'"mqtt://mill:{SECRET}@h" = 1',
    ],
)
def test_no_error_repeats_the_password(tmp_path: Path, line: str) -> None:
    make_machine_folder(tmp_path / "mill", "surrogate_machine.toml")
    toml = tmp_path / "mill" / "machine.toml"
    toml.write_text(f"{toml.read_text(encoding='utf-8')}\n[notify]\n{line}\n", encoding="utf-8")
    result = invoke(["status", str(tmp_path / "mill"), "--json"])
    assert "machine.toml" in result.output
    assert SECRET not in result.output


def test_a_broker_in_a_traceback_has_no_password() -> None:
    broker = parse_broker(f"mqtts://mill:{SECRET}@h:8883/plant")
    assert (repr(broker), str(broker)) == ("Broker('mqtts://mill@h:8883/plant')",) * 2
